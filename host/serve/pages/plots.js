// Curves over time: several plots with one cursor and one span.

import { make, setText } from './format.js';

const COLORS = ['--accent', '--orange', '--green', '--azure'];
const MARGIN = { left: 52, right: 6, top: 6, bottom: 18 };

// Index of the first of some rising times that is not before `time`.
export function indexOf(times, time) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

// Numbers for about four lines, round.
function ticks(low, high) {
  const step0 = (high - low) / 4;
  const power = 10 ** Math.floor(Math.log10(step0));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((size) => size >= step0);
  const list = [];
  for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * step; value += step) list.push(value);
  return { list, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

// A column of pixels has the least and the largest of its samples, so that no peak is lost.
function drawCurve(pen, times, list, [start, stop], [x, y], color) {
  pen.strokeStyle = color;
  pen.lineWidth = 1.5;
  pen.beginPath();
  let isDown = false;
  for (let k = start; k < stop;) {
    const column = Math.round(x(times[k]));
    let [low, high, last] = [Infinity, -Infinity, null];
    let first = null;
    while (k < stop && Math.round(x(times[k])) === column) {
      const value = list[k];
      if (Number.isFinite(value)) {
        first ??= value;
        low = Math.min(low, value);
        high = Math.max(high, value);
        last = value;
      }
      k += 1;
    }
    if (last === null) {
      isDown = false;
      continue;
    }
    if (isDown) pen.lineTo(column, y(first));
    else pen.moveTo(column, y(first));
    if (high > low) {
      pen.lineTo(column, y(low));
      pen.lineTo(column, y(high));
      pen.lineTo(column, y(last));
    }
    isDown = true;
  }
  pen.stroke();
}

export class Plots {
  // `range()` is the time at both ends of the plots, `timeText(s)` writes one. `point(time, event)` is called where a pointer is on a
  // plot, with `null` where it has left; `step(±1)` and `zoom(±1)` by keys, and the latter with 0 for all.
  constructor(place, { range, timeText, point, step, zoom }) {
    Object.assign(this, { place, range, timeText, point, step, zoom });
    [this.series, this.times, this.values, this.figures] = [[], [], [], []];
    this.cursor = null;
    place.addEventListener('keydown', (event) => this.key(event));
    place.addEventListener('wheel', (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      zoom(event.deltaY < 0 ? 1 : -1);
    }, { passive: false });
    window.addEventListener('resize', () => this.draw());
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.draw());
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const acts = {
      ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1), '+': () => this.zoom(1), '=': () => this.zoom(1),
      '-': () => this.zoom(-1), '−': () => this.zoom(-1), 0: () => this.zoom(0),
    };
    if (!acts[event.key]) return;
    event.preventDefault();
    acts[event.key]();
  }

  // Each of the series has a plot, a name there and a unit; what was not measured is no finite value. Both lists may have grown.
  show(series, times, values) {
    if (series !== this.series) {
      this.figures = [];
      this.place.replaceChildren();
    }
    Object.assign(this, { series, times, values });
    this.makeFigures();
    this.draw();
  }

  makeFigures() {
    for (const plot of new Set(this.series.map((one) => one.plot))) {
      const curves = this.series.map((one, index) => ({ ...one, index })).filter((one) => one.plot === plot)
        .filter((one) => this.values[one.index].some((value) => Number.isFinite(value)));
      const known = this.figures.find((figure) => figure.plot === plot);
      if (curves.length === 0 || known?.curves.length === curves.length) continue;
      known?.element.remove();
      this.figures = [...this.figures.filter((figure) => figure.plot !== plot), this.figure(plot, curves)];
    }
  }

  figure(plot, curves) {
    const [canvas, line] = [make('canvas', { role: 'img' }), make('div', { className: 'line', hidden: true })];
    const keys = curves.map((curve, color) => {
      const key = make('span', { className: 'key' });
      key.style.color = `var(${COLORS[color % COLORS.length]})`;
      return key;
    });
    const unit = curves[0].unit ? `, ${curves[0].unit}` : '';
    const element = make('figure', {}, make('figcaption', {}, plot + unit, ...keys), canvas, line);
    this.place.append(element);
    for (const type of ['pointerdown', 'pointermove']) {
      canvas.addEventListener(type, (event) => this.point(this.timeAt(canvas, event.offsetX), event));
    }
    canvas.addEventListener('pointerleave', (event) => this.point(null, event));
    return { plot, curves, canvas, line, keys, element };
  }

  timeAt(canvas, x) {
    const [from, to] = this.range();
    const width = canvas.clientWidth - MARGIN.left - MARGIN.right;
    return from + ((x - MARGIN.left) / width) * (to - from);
  }

  // `null` hides it; the plots show their last values then.
  setCursor(time) {
    this.cursor = time;
    this.figures.forEach((figure) => this.showCursor(figure));
  }

  draw() {
    this.figures.forEach((figure) => this.drawFigure(figure));
  }

  drawFigure(figure) {
    const { curves, canvas } = figure;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width) return;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio)) [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    const style = getComputedStyle(document.body);
    const color = (name) => style.getPropertyValue(name);
    const pen = canvas.getContext('2d');
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const { times, values } = this;
    const [from, to] = this.range();
    const [start, stop] = [Math.max(indexOf(times, from) - 1, 0), Math.min(indexOf(times, to + 1e-9) + 1, times.length)];
    let [low, high] = [Infinity, -Infinity];
    for (const { index } of curves) {
      for (let k = start; k < stop; k += 1) {
        const value = values[index][k];
        if (!Number.isFinite(value)) continue;
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
    if (low > high) [low, high] = [0, 1];
    const pad = Math.max(0.05 * (high - low), 1e-3 * Math.abs(high), 1e-6);
    [low, high] = [low - pad, high + pad];
    const x = (time) => MARGIN.left + ((time - from) / (to - from)) * (width - MARGIN.left - MARGIN.right);
    const y = (value) => height - MARGIN.bottom - ((value - low) / (high - low)) * (height - MARGIN.top - MARGIN.bottom);
    pen.font = `12px ${style.fontFamily}`;
    pen.fillStyle = color('--muted');
    pen.strokeStyle = color('--soft');
    pen.lineWidth = 1;
    const { list, digits } = ticks(low, high);
    pen.textAlign = 'right';
    pen.textBaseline = 'middle';
    for (const value of list) {
      pen.beginPath();
      pen.moveTo(MARGIN.left, y(value));
      pen.lineTo(width - MARGIN.right, y(value));
      pen.stroke();
      pen.fillText(value.toFixed(digits), MARGIN.left - 6, y(value));
    }
    pen.textBaseline = 'alphabetic';
    pen.textAlign = 'left';
    pen.fillText(this.timeText(from), MARGIN.left, height - 4);
    pen.textAlign = 'right';
    pen.fillText(this.timeText(to), width - MARGIN.right, height - 4);
    pen.save();
    pen.beginPath();
    pen.rect(MARGIN.left, 0, width - MARGIN.left - MARGIN.right, height);
    pen.clip();
    curves.forEach(({ index }, number) => drawCurve(pen, times, values[index], [start, stop], [x, y], color(COLORS[number % COLORS.length])));
    pen.restore();
    Object.assign(figure, { x, digits });
    this.showCursor(figure);
  }

  // Over the curves, which are not drawn again.
  showCursor({ plot, curves, canvas, line, keys, x, digits }) {
    if (!x) return;
    const { times, values, cursor } = this;
    const [from, to] = this.range();
    const last = indexOf(times, to + 1e-9) - 1;
    const at = cursor === null ? last : Math.min(Math.max(indexOf(times, cursor + 1e-9) - 1, 0), last);
    line.hidden = cursor === null || cursor < from || cursor > to;
    if (!line.hidden) {
      line.style.left = `${canvas.offsetLeft + x(cursor)}px`;
      line.style.top = `${canvas.offsetTop + MARGIN.top}px`;
      line.style.height = `${canvas.clientHeight - MARGIN.top - MARGIN.bottom}px`;
    }
    const shown = curves.map(({ name, index }) => {
      const value = values[index][at];
      return `${name} ${Number.isFinite(value) ? value.toFixed(Math.min(digits + 1, 6)) : '–'}`;
    });
    keys.forEach((key, number) => setText(key, shown[number]));
    canvas.setAttribute('aria-label', `${plot}: ${shown.join(', ')}`);
  }
}
