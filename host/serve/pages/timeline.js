// A program as lanes: one for each output, with the spans in which it is on.

import { clock, seconds } from './format.js';

const SVG = 'http://www.w3.org/2000/svg';
// Height of a lane, and of the name in it: beside its bars, or above them on a narrow page.
const WIDE = { lane: 22, name: 15, bar: 4, left: 310, right: 30, ticks: 8 };
const NARROW = { lane: 40, name: 14, bar: 20, left: 18, right: 22, ticks: 4 };
const NARROW_PX = 640;
const BAR = 13;
const TOP = 26;

function draw(tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

// Round steps, about so many of them.
function steps(end, count) {
  const rough = end / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5, 10].find((factor) => factor * power >= rough) ?? 10);
  const decimals = Math.max(0, -Math.floor(Math.log10(step)));
  return Array.from({ length: Math.floor(end / step + 1e-9) + 1 }, (_, k) => [k * step, (k * step).toFixed(decimals)]);
}

export class TimeLine {
  // `onToggle(lane, at_s)` is called where a lane is clicked.
  constructor(place, onToggle = null) {
    this.place = place;
    this.onToggle = onToggle;
  }

  // `names` are those of the actuators, as far as they are known.
  show(program, names = []) {
    this.program = program;
    this.names = names;
    const { lanes, rows, end_s: end, refusal } = program;
    const room = this.place.parentElement.clientWidth;
    this.size = room < NARROW_PX ? NARROW : WIDE;
    this.width = Math.max(280, room - 8);
    this.height = TOP + this.size.lane * lanes.length + 8;
    const svg = draw('svg', { viewBox: `0 0 ${this.width} ${this.height}`, width: this.width, height: this.height, role: 'img' });
    svg.append(draw('title', {}, `${lanes.length} outputs over ${seconds(end)}; the table of rows below has the same data`));
    for (const [at, text] of end > 0 ? steps(end, this.size.ticks) : []) {
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
    const { left, right } = this.size;
    return left + ((this.width - left - right) * at) / (this.program.end_s || 1);
  }

  // Output, actuator and its name.
  label({ output, actuator }) {
    const name = this.names[actuator];
    return `output ${output} · actuator ${actuator}${name ? `: ${name}` : ''}`;
  }

  lane(lane, index, refusal) {
    const { lane: height, name, bar, left, right } = this.size;
    const y = TOP + height * index;
    const isCause = refusal && refusal.output === lane.output;
    const parts = [draw('text', { class: isCause ? 'name cause' : 'name', x: 4, y: y + name }, this.label(lane))];
    if (this.onToggle) parts.push(this.ground(lane, y));
    parts.push(draw('line', { class: 'grid', x1: left, x2: this.width - right, y1: y + height - 1, y2: y + height - 1 }));
    for (const [from, to] of lane.spans_s) {
      const width = Math.max(1, this.x(to) - this.x(from));
      const span = draw('rect', { class: `span ${lane.drive}${isCause ? ' cause' : ''}`, x: this.x(from), y: y + bar, width, height: BAR, rx: 2 });
      span.append(draw('title', {}, `${this.label(lane)}: on from ${clock(from)} to ${clock(to)}`));
      parts.push(span);
    }
    return parts;
  }

  // What of a lane can be clicked, the spans above it included.
  ground(lane, y) {
    const { lane: height, left, right } = this.size;
    const ground = draw('rect', { class: 'ground', x: left, y, width: this.width - left - right, height });
    const toggle = (event) => {
      const { left: begin, width } = this.place.querySelector('svg').getBoundingClientRect();
      const x = ((event.clientX - begin) * this.width) / width;
      this.onToggle(lane, ((x - left) / (this.width - left - right)) * (this.program.end_s || 1));
    };
    ground.addEventListener('click', toggle);
    return ground;
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
