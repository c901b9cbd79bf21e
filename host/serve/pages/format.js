// Numbers with their units, and small helpers to change a page without building it again.

// What rounds to zero has no sign.
export const fixed = (value, decimals) => value.toFixed(decimals).replace(/^-(?=[0.]+$)/, '');

export const mm = (m) => `${fixed(1e3 * m, 1)} mm`;
export const degrees = (rad) => `${fixed((180 / Math.PI) * rad, 2)}°`;
// A pose with the names of its axes: x, y and the angle in the plane, else with a rotation vector.
export function poseText({ position_m: position, rotation_rad: rotation }, isPlanar) {
  const place = position.slice(0, isPlanar ? 2 : 3).map((m, axis) => `${'xyz'[axis]} ${mm(m)}`).join(', ');
  return isPlanar ? `${place}, angle ${degrees(rotation[2])}` : `${place}; rotation ${rotation.map((rad, axis) => `${'xyz'[axis]} ${degrees(rad)}`).join(', ')}`;
}

export const percent = (share) => `${(100 * share).toFixed(0)} %`;

export function seconds(s) {
  if (s === null || s === undefined) return '–';
  return s < 0.1 ? `${(1e3 * s).toFixed(1)} ms` : `${s.toFixed(s < 10 ? 2 : 1)} s`;
}

// A time of the board's clock, which is exact to the millisecond.
export const clock = (s) => `${fixed(s, 3)} s`;

export const short = (digest) => (digest ? digest.slice(0, 16) : 'none');
// A model by the name that a person gave it, its file and its number; its digest distinguishes two of one name.
export const modelName = ({ label, name, number }) => `${label ? `${label} · ` : ''}${number === null ? name : `${name}, model ${number}`}`;
export const byId = (id) => document.getElementById(id);

// Writes only what differs: twenty times a second, and a screen reader hears no repetition.
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in element) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

// A list of terms and values: `[['port', 'unix:…'], …]`.
export function setFacts(list, facts) {
  if (list.children.length !== 2 * facts.length) {
    list.replaceChildren(...facts.flatMap(() => [make('dt'), make('dd')]));
  }
  facts.forEach(([term, value], index) => {
    setText(list.children[2 * index], term);
    setText(list.children[2 * index + 1], value);
  });
}

// Hands a file to the downloads of the browser.
export function save(name, content, type) {
  const href = URL.createObjectURL(new Blob([content], { type }));
  make('a', { href, download: name }).click();
  URL.revokeObjectURL(href);
}

// Each cell repeats the title of its column, which a narrow page shows in place of the head.
export function titleCells(table) {
  const titles = [...table.querySelectorAll('thead th')].map((th) => th.textContent);
  for (const row of table.querySelectorAll('tbody tr')) {
    [...row.children].forEach((cell, column) => { cell.dataset.title = titles[column]; });
  }
}
