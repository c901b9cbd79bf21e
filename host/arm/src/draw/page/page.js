// What a page does beside showing text: values of plots under the pointer and by the arrow keys, and headings of cells on a phone.

function valuesOf(plot) {
  return [...plot.querySelectorAll('.values > *')].map((mark) => {
    const number = (name) => Number(mark.getAttribute(name));
    const isBox = mark.tagName === 'rect';
    const at = isBox ? [number('x') + number('width') / 2, number('y') + number('height') / 2] : [number('cx'), number('cy')];
    return { mark, at, text: mark.textContent };
  }).sort((a, b) => a.at[0] - b.at[0] || a.at[1] - b.at[1]);
}

for (const plot of document.querySelectorAll('svg[role=img]')) {
  const values = valuesOf(plot);
  if (values.length === 0) continue;
  const readout = Object.assign(document.createElement('output'), { className: 'readout', textContent: 'values: pointer, or arrow keys in the plot' });
  const frame = Object.assign(document.createElement('div'), { className: 'plot', tabIndex: 0 });
  frame.setAttribute('role', 'group');
  frame.setAttribute('aria-label', 'Plot; the keys left and right go through its values');
  plot.replaceWith(frame);
  frame.append(plot, readout);
  let seen = -1;
  const show = (index) => {
    values[seen]?.mark.classList.remove('seen');
    seen = Math.min(Math.max(index, 0), values.length - 1);
    values[seen].mark.classList.add('seen');
    readout.textContent = values[seen].text;
  };
  frame.addEventListener('keydown', (event) => {
    const to = { ArrowRight: seen + 1, ArrowLeft: seen - 1, PageDown: seen + 20, PageUp: seen - 20, Home: 0, End: values.length - 1 }[event.key];
    if (to === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    show(to);
  });
  plot.addEventListener('pointermove', (event) => {
    const { left, top, width } = plot.getBoundingClientRect();
    const scale = Number(plot.getAttribute('width')) / width;
    const [x, y] = [(event.clientX - left) * scale, (event.clientY - top) * scale];
    const away = ({ at }) => Math.hypot(at[0] - x, at[1] - y);
    const nearest = values.reduce((best, value, index) => (away(value) < away(values[best]) ? index : best), 0);
    if (away(values[nearest]) < 25) show(nearest);
  });
}

for (const table of document.querySelectorAll('table')) {
  const titles = [...table.querySelectorAll('thead th')].map((head) => head.textContent);
  if (titles.length < 4) continue;
  table.classList.add('cards-on-phone');
  for (const row of table.tBodies[0].rows) {
    const cells = [...row.cells];
    if (cells.length === titles.length) cells.forEach((cell, index) => { cell.dataset.title = titles[index]; });
  }
}
