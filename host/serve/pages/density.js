// A plane of the density map: cells shaded by the number of words, with the target and the tool; a click sets the target.

const SVG = 'http://www.w3.org/2000/svg';
const LEVELS = 7;
const LONG_PX = 520;
const ROOM = { left: 62, top: 12, right: 14, bottom: 44 };

const make = (tag, attributes, text) => {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return element;
};

// Round numbers, about five of them.
function ticks(low, high) {
  const rough = (high - low) / 5;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((size) => size >= rough);
  const first = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, k) => (first + k) * step);
}

const level = (words, most) => Math.min(LEVELS - 1, Math.floor((LEVELS * Math.log1p(words)) / Math.log1p(most)));
const lowest = (step, most) => Math.max(1, Math.ceil(Math.expm1((step / LEVELS) * Math.log1p(most))));

export class DensityPlot {
  // `chosen` is called with the two coordinates that were clicked, m; `hovered` with a sentence.
  constructor(place, { chosen, hovered }) {
    this.place = place;
    this.chosen = chosen;
    this.hovered = hovered;
  }

  show(slice, names) {
    const { cell_m, low, high, cells, max_words: most } = slice;
    this.slice = slice;
    this.words = new Map(cells.map(([u, v, words]) => [`${u} ${v}`, words]));
    const [width, height] = [0, 1].map((axis) => high[axis] - low[axis] + 3);
    this.scale = LONG_PX / Math.max(width, height);
    this.size = [width * this.scale, height * this.scale];
    const [across, down] = [this.size[0] + ROOM.left + ROOM.right, this.size[1] + ROOM.top + ROOM.bottom];
    const svg = make('svg', {
      width: across, height: down, viewBox: `0 0 ${across} ${down}`, role: 'img',
      'aria-label': `Density of reachable positions in ${names.join('')}: ${cells.length} cells of ${(1e3 * cell_m).toFixed(0)} mm, up to ${most.toPrecision(3)} words in one`,
    });
    svg.append(make('rect', { x: ROOM.left, y: ROOM.top, width: this.size[0], height: this.size[1], class: 'ground' }));
    const paths = Array.from({ length: LEVELS }, () => '');
    for (const [u, v, words] of cells) {
      const [x, y] = this.at([(u - 0.5) * cell_m, (v + 0.5) * cell_m]);
      paths[level(words, most)] += `M${x.toFixed(1)} ${y.toFixed(1)}h${this.scale.toFixed(2)}v${this.scale.toFixed(2)}h${(-this.scale).toFixed(2)}z`;
    }
    paths.forEach((d, step) => d && svg.append(make('path', { d, class: 'cell', 'fill-opacity': (step + 1) / LEVELS })));
    this.axes(svg, names);
    this.marks = make('g', {});
    svg.append(this.marks);
    svg.addEventListener('pointermove', (event) => this.hovered(this.sentence(this.point(event))));
    svg.addEventListener('click', (event) => this.chosen(this.point(event)));
    this.svg = svg;
    this.place.replaceChildren(svg, this.legend(most));
  }

  // From coordinates in m to the plot, and back.
  at([u, v]) {
    const { cell_m, low, high } = this.slice;
    return [ROOM.left + (u / cell_m - low[0] + 1.5) * this.scale, ROOM.top + (high[1] + 1.5 - v / cell_m) * this.scale];
  }

  point(event) {
    const { cell_m, low, high } = this.slice;
    const { left, top, width } = this.svg.getBoundingClientRect();
    const pixel = this.svg.width.baseVal.value / width;
    const [x, y] = [(event.clientX - left) * pixel, (event.clientY - top) * pixel];
    return [((x - ROOM.left) / this.scale + low[0] - 1.5) * cell_m, (high[1] + 1.5 - (y - ROOM.top) / this.scale) * cell_m];
  }

  sentence(point) {
    const cell = point.map((m) => Math.round(m / this.slice.cell_m));
    const words = this.words.get(cell.join(' ')) ?? 0;
    return `${point.map((m) => (1e3 * m).toFixed(0)).join(', ')} mm: ${words.toLocaleString('en')} words`;
  }

  axes(svg, names) {
    const { cell_m, low, high } = this.slice;
    const ends = [0, 1].map((axis) => [(low[axis] - 1.5) * cell_m, (high[axis] + 1.5) * cell_m]);
    const bottom = ROOM.top + this.size[1];
    for (const m of ticks(...ends[0])) {
      const [x] = this.at([m, 0]);
      svg.append(make('line', { x1: x, x2: x, y1: bottom, y2: bottom + 5, class: 'axis' }));
      svg.append(make('text', { x, y: bottom + 18, 'text-anchor': 'middle' }, (1e3 * m).toFixed(0)));
    }
    for (const m of ticks(...ends[1])) {
      const [, y] = this.at([0, m]);
      svg.append(make('line', { x1: ROOM.left - 5, x2: ROOM.left, y1: y, y2: y, class: 'axis' }));
      svg.append(make('text', { x: ROOM.left - 8, y: y + 4, 'text-anchor': 'end' }, (1e3 * m).toFixed(0)));
    }
    svg.append(make('text', { x: ROOM.left + 0.5 * this.size[0], y: bottom + 36, 'text-anchor': 'middle', class: 'name' }, `${names[0]}, mm`));
    svg.append(make('text', { x: 12, y: ROOM.top + 10, class: 'name' }, `${names[1]}, mm`));
  }

  // A cross where the target is, a ring where the tool is.
  mark(target, tool) {
    if (!this.svg) return;
    const [x, y] = this.at(target);
    this.marks.replaceChildren(make('path', { d: `M${x - 9} ${y}h18M${x} ${y - 9}v18`, class: 'target' }));
    if (!tool) return;
    const [cx, cy] = this.at(tool);
    this.marks.append(make('circle', { cx, cy, r: 6, class: 'tool' }));
  }

  legend(most) {
    const legend = document.createElement('p');
    legend.className = 'legend';
    legend.append('Words in a cell: ');
    const used = Array.from({ length: LEVELS }, (_, step) => step).filter((step) => lowest(step + 1, most) > lowest(step, most));
    for (const step of used) {
      const box = document.createElement('span');
      box.className = 'swatch';
      box.style.setProperty('--share', (step + 1) / LEVELS);
      legend.append(box, `from ${lowest(step, most).toLocaleString('en', { maximumSignificantDigits: 2 })} `);
    }
    legend.append(' · cross: target · ring: tool · a click sets the target');
    return legend;
  }
}
