// A program as lanes: one for each output, with the spans in which it is on.

import { seconds } from './format.js';

const SVG = 'http://www.w3.org/2000/svg';
const LANE = 22;
const LEFT = 96;
const TOP = 26;

function draw(tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

// Round steps, about eight of them.
function steps(end) {
  const rough = end / 8;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5, 10].find((factor) => factor * power >= rough) ?? 10);
  const decimals = Math.max(0, -Math.floor(Math.log10(step)));
  return Array.from({ length: Math.floor(end / step + 1e-9) + 1 }, (_, k) => [k * step, (k * step).toFixed(decimals)]);
}

export class TimeLine {
  constructor(place) {
    this.place = place;
  }

  show(program) {
    this.program = program;
    const { lanes, rows, end_s: end, refusal } = program;
    this.width = Math.max(640, this.place.parentElement.clientWidth - 8);
    this.height = TOP + LANE * lanes.length + 8;
    const svg = draw('svg', { viewBox: `0 0 ${this.width} ${this.height}`, width: this.width, height: this.height, role: 'img' });
    svg.append(draw('title', {}, `${lanes.length} outputs over ${seconds(end)}; the table of rows below has the same data`));
    for (const [at, text] of end > 0 ? steps(end) : []) {
      svg.append(draw('line', { class: 'grid', x1: this.x(at), x2: this.x(at), y1: TOP - 6, y2: this.height }));
      svg.append(draw('text', { class: 'tick', x: this.x(at), y: TOP - 10, 'text-anchor': 'middle' }, `${text} s`));
    }
    lanes.forEach((lane, index) => svg.append(...this.lane(lane, index, refusal)));
    for (const row of rows) {
      svg.append(draw('line', { class: 'row', x1: this.x(row.at_s), x2: this.x(row.at_s), y1: TOP - 4, y2: TOP }));
    }
    if (refusal && refusal.row !== null) svg.append(...this.mark(refusal));
    this.cursor = draw('line', { class: 'cursor', x1: 0, x2: 0, y1: TOP - 6, y2: this.height, visibility: 'hidden' });
    svg.append(this.cursor);
    this.place.replaceChildren(svg);
  }

  x(at) {
    return LEFT + ((this.width - LEFT - 30) * at) / (this.program.end_s || 1);
  }

  lane(lane, index, refusal) {
    const y = TOP + LANE * index;
    const isCause = refusal && refusal.output === lane.output;
    const parts = [draw('text', { class: isCause ? 'name cause' : 'name', x: 4, y: y + 15 }, `output ${lane.output}`)];
    parts.push(draw('line', { class: 'grid', x1: LEFT, x2: this.width - 30, y1: y + LANE - 1, y2: y + LANE - 1 }));
    for (const [from, to] of lane.spans_s) {
      const width = Math.max(1, this.x(to) - this.x(from));
      const bar = draw('rect', { class: `span ${lane.drive}${isCause ? ' cause' : ''}`, x: this.x(from), y: y + 4, width, height: LANE - 9, rx: 2 });
      bar.append(draw('title', {}, `output ${lane.output}, actuator ${lane.actuator}: on from ${seconds(from)} to ${seconds(to)}`));
      parts.push(bar);
    }
    return parts;
  }

  mark(refusal) {
    const at = this.program.rows[refusal.row]?.at_s ?? this.program.end_s;
    const name = refusal.row < this.program.rows.length ? `row ${refusal.row}` : 'end';
    return [
      draw('line', { class: 'refused', x1: this.x(at), x2: this.x(at), y1: TOP - 6, y2: this.height }),
      draw('text', { class: 'refused', x: Math.min(this.x(at) + 4, this.width - 60), y: this.height - 2 }, `✕ ${name}`),
    ];
  }

  // Where the program is now; `null` while it does not run.
  setTime(at) {
    if (!this.cursor) return;
    this.cursor.setAttribute('visibility', at === null ? 'hidden' : 'visible');
    if (at === null) return;
    const x = this.x(Math.min(at, this.program.end_s));
    this.cursor.setAttribute('x1', x);
    this.cursor.setAttribute('x2', x);
  }
}
