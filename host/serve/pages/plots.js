// Curves of the last hour: residual, supplies, temperature, on-times, servos. The server keeps them; a page has what it has fetched.

import { get } from './server.js';
import { onLive } from './frame.js';
import { byId, make, save, setText } from './format.js';

const HOUR_S = 3600;
const FETCH_MS = 250;
const COLORS = ['--accent', '--orange', '--green', '--azure'];
const MARGIN = { left: 52, right: 6, top: 6, bottom: 18 };

let series = [];
let times = [];
let values = [];
let next = 0;
let isFetching = false;
let lastFetch = 0;
// The right end that is shown: null follows the present.
let end = null;
let cursor = null;
let figures = [];

const span = () => Number(byId('span').value);

// ---------------------------------------------------------------- data

async function fetchSamples() {
  isFetching = true;
  try {
    for (;;) {
      const got = await get(`/api/samples?after=${next}`, 10_000);
      const isOther = got.next < next || JSON.stringify(got.series) !== JSON.stringify(series);
      if (isOther) {
        series = got.series;
        [times, values, next, figures] = [[], series.map(() => []), 0, []];
        byId('plots').replaceChildren();
        if (got.first > 0 && got.next > 0 && got.times_s.length === 0) continue;
      }
      times.push(...got.times_s);
      values.forEach((list, index) => list.push(...got.values[index]));
      next = got.first + got.times_s.length;
      if (next >= got.next || got.times_s.length === 0) break;
    }
    const old = times.findIndex((time) => time > times.at(-1) - HOUR_S);
    if (old > 2000) {
      times.splice(0, old);
      values.forEach((list) => list.splice(0, old));
    }
    makeFigures();
    draw();
  } finally {
    isFetching = false;
  }
}

// Index of the first sample at or after a time.
function indexOf(time) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

// ---------------------------------------------------------------- figures

function makeFigures() {
  for (const plot of new Set(series.map((one) => one.plot))) {
    const curves = series.map((one, index) => ({ ...one, index })).filter((one) => one.plot === plot)
      .filter((one) => values[one.index].some((value) => value !== null));
    const known = figures.find((figure) => figure.plot === plot);
    if (curves.length === 0 || known?.curves.length === curves.length) continue;
    known?.element.remove();
    const canvas = make('canvas', { role: 'img' });
    const keys = curves.map((curve, color) => {
      const key = make('span', { className: 'key' });
      key.style.color = `var(${COLORS[color % COLORS.length]})`;
      return key;
    });
    const unit = curves[0].unit ? `, ${curves[0].unit}` : '';
    const element = make('figure', {}, make('figcaption', {}, plot + unit, ...keys), canvas);
    byId('plots').append(element);
    canvas.addEventListener('pointermove', (event) => setCursor(timeAt(canvas, event.offsetX)));
    canvas.addEventListener('pointerleave', () => setCursor(null));
    figures = [...figures.filter((figure) => figure.plot !== plot), { plot, curves, canvas, keys, element }];
  }
}

const range = () => {
  const right = end ?? times.at(-1) ?? 0;
  return [right - span(), right];
};

function timeAt(canvas, x) {
  const [from, to] = range();
  const width = canvas.clientWidth - MARGIN.left - MARGIN.right;
  return from + ((x - MARGIN.left) / width) * (to - from);
}

function setCursor(time) {
  cursor = time;
  draw();
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

const clockTime = (s) => new Date(1e3 * s).toLocaleTimeString('sv');

function drawFigure({ plot, curves, canvas, keys }) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width) return;
  const ratio = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio)) [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
  const style = getComputedStyle(document.body);
  const color = (name) => style.getPropertyValue(name);
  const pen = canvas.getContext('2d');
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const [from, to] = range();
  const [start, stop] = [Math.max(indexOf(from) - 1, 0), indexOf(to + 1e-9)];
  let [low, high] = [Infinity, -Infinity];
  for (const { index } of curves) {
    for (let k = start; k < stop; k += 1) {
      const value = values[index][k];
      if (value === null) continue;
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
  pen.fillText(clockTime(from), MARGIN.left, height - 4);
  pen.textAlign = 'right';
  pen.fillText(clockTime(to), width - MARGIN.right, height - 4);
  curves.forEach(({ index }, number) => drawCurve(pen, values[index], [start, stop], [x, y], color(COLORS[number % COLORS.length])));
  const at = cursor === null ? stop - 1 : Math.min(Math.max(indexOf(cursor), start), stop - 1);
  if (cursor !== null) {
    pen.strokeStyle = color('--ink');
    pen.beginPath();
    pen.moveTo(x(cursor), MARGIN.top);
    pen.lineTo(x(cursor), height - MARGIN.bottom);
    pen.stroke();
  }
  const shown = curves.map(({ name, index }) => {
    const value = values[index][at];
    return `${name} ${value === null || value === undefined ? '–' : value.toFixed(Math.min(digits + 1, 6))}`;
  });
  keys.forEach((key, number) => setText(key, shown[number]));
  canvas.setAttribute('aria-label', `${plot}: ${shown.join(', ')}`);
}

// A column of pixels has the least and the largest of its samples, so that no peak is lost.
function drawCurve(pen, list, [start, stop], [x, y], color) {
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
      if (value !== null) {
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

function draw() {
  setText(byId('cursor'), cursor === null ? '' : `At ${clockTime(cursor)}:`);
  figures.forEach(drawFigure);
}

// ---------------------------------------------------------------- what a person does

byId('span').addEventListener('change', draw);
byId('freeze').addEventListener('click', () => {
  end = end === null ? (times.at(-1) ?? null) : null;
  byId('freeze').setAttribute('aria-pressed', String(end !== null));
  draw();
});
byId('plots').addEventListener('keydown', (event) => {
  const [from, to] = range();
  const step = (to - from) / 100;
  const spans = [...byId('span').options].map((option) => option.value);
  const at = spans.indexOf(byId('span').value);
  if (event.key === 'ArrowLeft') setCursor(Math.max((cursor ?? to) - step, from));
  else if (event.key === 'ArrowRight') setCursor(Math.min((cursor ?? to) + step, to));
  else if (event.key === '+') byId('span').value = spans[Math.max(at - 1, 0)];
  else if (event.key === '-' || event.key === '−') byId('span').value = spans[Math.min(at + 1, spans.length - 1)];
  else return;
  event.preventDefault();
  draw();
});
byId('export').addEventListener('click', () => {
  const [from, to] = range();
  const [start, stop] = [indexOf(from), indexOf(to + 1e-9)];
  const heading = ['time_s', ...series.map((one) => `${one.plot}: ${one.name}${one.unit ? ` [${one.unit}]` : ''}`)];
  const lines = [heading.map((text) => `"${text}"`).join(',')];
  for (let k = start; k < stop; k += 1) lines.push([times[k].toFixed(3), ...values.map((list) => list[k] ?? '')].join(','));
  save('darm-live.csv', `${lines.join('\n')}\n`, 'text/csv');
});
window.addEventListener('resize', draw);

onLive(() => {
  const now = performance.now();
  if (isFetching || now - lastFetch < FETCH_MS) return;
  lastFetch = now;
  fetchSamples().catch(() => {});
});
