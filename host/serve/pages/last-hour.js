// The last hour of a board in plots: residual, supplies, temperature, on-times, servos. The server keeps it; a page has what it has fetched.

import { get } from './server.js';
import { onLive } from './frame.js';
import { byId, save, setText } from './format.js';
import { Plots, indexOf } from './plots.js';

const HOUR_S = 3600;
const FETCH_MS = 250;

let series = [];
let times = [];
let values = [];
let next = 0;
let isFetching = false;
let lastFetch = 0;
// The right end that is shown: null follows the present.
let end = null;

const span = () => Number(byId('span').value);
const range = () => {
  const right = end ?? times.at(-1) ?? 0;
  return [right - span(), right];
};
const clockTime = (s) => new Date(1e3 * s).toLocaleTimeString('sv');

const plots = new Plots(byId('plots'), { range, timeText: clockTime, point: setCursor, step, zoom });

function setCursor(time) {
  plots.setCursor(time);
  setText(byId('cursor'), time === null ? '' : `At ${clockTime(time)}:`);
}

function step(by) {
  const [from, to] = range();
  setCursor(Math.min(Math.max((plots.cursor ?? to) + (by * (to - from)) / 100, from), to));
}

function zoom(by) {
  const spans = [...byId('span').options].map((option) => option.value);
  byId('span').value = spans[Math.min(Math.max(spans.indexOf(byId('span').value) - by, 0), spans.length - 1)];
  plots.draw();
}

async function fetchSamples() {
  isFetching = true;
  try {
    for (;;) {
      const got = await get(`/api/samples?after=${next}`, 10_000);
      const isOther = got.next < next || JSON.stringify(got.series) !== JSON.stringify(series);
      if (isOther) {
        series = got.series;
        [times, values, next] = [[], series.map(() => []), 0];
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
    plots.show(series, times, values);
  } finally {
    isFetching = false;
  }
}

byId('span').addEventListener('change', () => plots.draw());
byId('freeze').addEventListener('click', () => {
  end = end === null ? (times.at(-1) ?? null) : null;
  byId('freeze').setAttribute('aria-pressed', String(end !== null));
  plots.draw();
});
byId('export').addEventListener('click', () => {
  const [from, to] = range();
  const [start, stop] = [indexOf(times, from), indexOf(times, to + 1e-9)];
  const heading = ['time_s', ...series.map((one) => `${one.plot}: ${one.name}${one.unit ? ` [${one.unit}]` : ''}`)];
  const lines = [heading.map((text) => `"${text}"`).join(',')];
  for (let k = start; k < stop; k += 1) lines.push([times[k].toFixed(3), ...values.map((list) => list[k] ?? '')].join(','));
  save('darm-live.csv', `${lines.join('\n')}\n`, 'text/csv');
});

onLive(() => {
  const now = performance.now();
  if (isFetching || now - lastFetch < FETCH_MS) return;
  lastFetch = now;
  fetchSamples().catch(() => {});
});
