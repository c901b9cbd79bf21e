// The page of replays: a time line over a recorded run, what the row at its cursor has, and the curves of all rows.

import { get, getBytes } from './server.js';
import { follow, onLive } from './frame.js';
import { byId, clock, degrees, make, poseText, setFacts, setText, titleCells } from './format.js';
import { Latest } from './latest.js';
import { showPose } from './measured.js';
import { Plots, indexOf } from './plots.js';

// Half of the handle of the time line: its first and last time are as far from its ends.
const INSET_PX = 8;
const MIN_SPAN_S = 0.1;
const MARKS = {
  started: ['▶', '--green'], finished: ['✓', '--ink'], stopped: ['■', '--ink'], fault: ['✕', '--red'], cleared: ['○', '--ink'],
  booted: ['○', '--ink'], row: ['', '--line'],
};

const name = new URLSearchParams(location.search).get('data');
let arm = null;
let picture = null;
// What the server said of the recording, and the times of its rows.
let run = null;
let times = [];
// The times at both ends of the time line, and those that the plots show.
let full = [0, 1];
let view = [0, 1];
let cursor = 0;
let row = 0;
// When the cursor was moved last, ms; `null` while it rests.
let playedAt = null;

const plots = new Plots(byId('plots'), {
  range: () => view,
  timeText: (s) => `${s.toFixed(1)} s`,
  point: (time, event) => { if (time !== null && event.buttons) seek(time); },
  step: stepBy,
  zoom,
});

// ---------------------------------------------------------------- the recording

// A line of JSON, then the numbers.
function unpack(buffer) {
  const end = new Uint8Array(buffer).indexOf('\n'.charCodeAt(0));
  const head = JSON.parse(new TextDecoder().decode(buffer.slice(0, end)));
  let at = end + 1;
  const take = (Numbers) => {
    const from = at;
    at += head.rows * Numbers.BYTES_PER_ELEMENT;
    return new Numbers(buffer.slice(from, at));
  };
  return { head, times: take(Float64Array), values: head.series.map(() => take(Float32Array)) };
}

function fail(text) {
  byId('replay-alert').hidden = !text;
  setText(byId('replay-alert'), text ?? '');
}

async function open() {
  const before = run;
  const got = unpack(await getBytes(`/api/replay/${encodeURIComponent(name)}`));
  [run, times] = [got.head, got.times];
  fail(null);
  const eventTimes = run.events.map((event) => event.at_s);
  full = [Math.min(times[0], ...eventTimes.slice(0, 1)), Math.max(times.at(-1), ...eventTimes.slice(-1))];
  if (full[0] === full[1]) full[1] += 1;
  byId('replay').hidden = byId('measured-section').hidden = false;
  setText(byId('run-title'), `${run.name}, ${run.rows} rows`);
  document.title = `${run.name} · Replay · darm`;
  byId('problem').hidden = !run.problem;
  setText(byId('problem'), run.problem ? `No prediction: ${run.problem}.` : '');
  byId('notes').replaceChildren(...run.notes.map((note) => make('li', {}, note)));
  [byId('at').min, byId('at').max] = full;
  if (!before) [view, cursor] = [[...full], times[0]];
  else if (view[1] > full[1]) view = [...full];
  byId('marks').hidden = byId('marks-key').hidden = run.events.length === 0;
  showEvents();
  drawMarks();
  plots.show(run.series, times, got.values);
  byId('plots-section').hidden = run.series.length === 0;
  row = -1;
  seek(cursor);
}

const read = () => open().catch((error) => fail(error.message));

// ---------------------------------------------------------------- the time line

function seek(time) {
  cursor = Math.min(Math.max(time, full[0]), full[1]);
  const at = Math.min(Math.max(indexOf(times, cursor + 1e-9) - 1, 0), times.length - 1);
  byId('at').value = cursor;
  const text = `${clock(cursor)}, row ${at} of 0–${times.length - 1}`;
  setText(byId('at-text'), text);
  byId('at').setAttribute('aria-valuetext', text);
  byId('back').disabled = at === 0;
  byId('forth').disabled = at === times.length - 1;
  showView();
  plots.setCursor(cursor);
  if (at === row) return;
  row = at;
  rows.ask();
}

function stepBy(by) {
  pause();
  seek(times[Math.min(Math.max(row + by, 0), times.length - 1)]);
}

function pause() {
  playedAt = null;
  setText(byId('play'), 'Play');
}

function play() {
  if (cursor >= full[1]) seek(full[0]);
  playedAt = performance.now();
  setText(byId('play'), 'Pause');
  requestAnimationFrame(advance);
}

function advance(now) {
  if (playedAt === null) return;
  seek(cursor + (Number(byId('speed').value) * Math.max(now - playedAt, 0)) / 1e3);
  playedAt = now;
  if (cursor >= full[1]) pause();
  else requestAnimationFrame(advance);
}

function drawMarks() {
  const canvas = byId('marks');
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!run || !width) return;
  const ratio = window.devicePixelRatio || 1;
  [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
  const style = getComputedStyle(document.body);
  const pen = canvas.getContext('2d');
  pen.scale(ratio, ratio);
  pen.font = `13px ${style.fontFamily}`;
  pen.textAlign = 'center';
  for (const { at_s: at, kind } of run.events.toSorted((a, b) => (b.kind === 'row') - (a.kind === 'row'))) {
    const [sign, color] = MARKS[kind] ?? MARKS.cleared;
    const x = INSET_PX + ((at - full[0]) / (full[1] - full[0])) * (width - 2 * INSET_PX);
    pen.fillStyle = style.getPropertyValue(color);
    pen.fillRect(Math.round(x), sign ? 16 : 22, 1, height);
    pen.fillText(sign, x, 13);
  }
}

function showEvents() {
  const named = run.events.filter((event) => event.kind !== 'row');
  byId('events-section').hidden = named.length === 0;
  byId('events').replaceChildren(...named.map((event) => {
    const jump = make('button', { type: 'button', className: 'small' }, clock(event.at_s));
    jump.addEventListener('click', () => { pause(); seek(event.at_s); });
    return make('li', { className: event.kind }, jump, ` ${event.text}`);
  }));
}

// ---------------------------------------------------------------- the plots

// Around the cursor; 0 is all.
function zoom(by) {
  const [from, to] = view;
  const span = Math.min(Math.max((to - from) * 2 ** -by, MIN_SPAN_S), full[1] - full[0]);
  const share = Math.min(Math.max((cursor - from) / (to - from), 0), 1);
  view = by === 0 ? [...full] : within(cursor - share * span, span);
  showView();
  plots.draw();
}

// A span that begins at `from`, moved into the run.
function within(from, span) {
  const start = Math.min(Math.max(from, full[0]), full[1] - span);
  return [start, start + span];
}

// The plots follow the cursor.
function showView() {
  const [from, to] = view;
  if (cursor < from || cursor > to) {
    view = within(cursor < from ? cursor - 0.9 * (to - from) : cursor - 0.1 * (to - from), to - from);
    plots.draw();
  }
  const isAll = view[0] <= full[0] && view[1] >= full[1];
  byId('wider').disabled = byId('all').disabled = isAll;
  setText(byId('shown'), isAll ? 'the complete run' : `${clock(view[0])} to ${clock(view[1])}`);
}

// ---------------------------------------------------------------- the row at the cursor

const rows = new Latest(async () => {
  try {
    const { bytes } = run;
    const got = await get(`/api/replay/${encodeURIComponent(name)}/row?bytes=${bytes}&row=${row}`, 10_000);
    if (bytes === run.bytes) showRow(got);
    fail(null);
  } catch (error) {
    fail(error.message);
  }
});

function outputText({ output, actuator, drive }) {
  const called = arm?.actuators[actuator]?.name;
  return `${output}${drive === 'latch' ? ' set' : ''} (actuator ${actuator}${called ? `: ${called}` : ''})`;
}

function showRow(got) {
  const { picture: shown, measured, word, previous } = got;
  byId('row-title').textContent = `Row ${got.row}`;
  setFacts(byId('facts'), [
    ['time', clock(got.time_s)],
    ['visit', `${got.visit} of run ${got.run}${got.is_held_out ? ', held out' : ''}`],
    ['line of the file', String(got.line)],
    ['word', word],
    ['word before', previous ?? 'not known'],
    ...(got.servos_rad.length ? [['servos', got.servos_rad.map(degrees).join(', ')]] : []),
    ...(got.load_kg === null ? [] : [['load', `${got.load_kg} kg`]]),
    ['outputs on', shown || got.outputs.length ? got.outputs.map(outputText).join(', ') || 'none' : 'not known'],
  ]);
  showPose({ ...got, tool: measured }, shown?.tool, run.is_planar);
  if (shown) picture?.show(shown);
  picture?.setMeasured(measured);
  const place = shown ? poseText(shown.tool, run.is_planar) : '';
  setText(byId('tool'), shown ? `Predicted tool pose: ${place}` : 'No prediction');
  setText(byId('picture-note'), got.problem ? `The model has no pose for this row: ${got.problem}.` : '');
  byId('arm').setAttribute('aria-label', shown ? `${shown.name}, word ${word}, tool at ${place}` : 'No prediction');
  byId('replay').dataset.row = got.row;
}

// The library of the picture is large and WebGL slow to begin: the other values do not wait for them.
async function startPicture() {
  try {
    const { ArmPicture } = await import('./arm.js');
    picture = new ArmPicture(byId('arm'));
  } catch {
    byId('arm').parentElement.hidden = true;
    setText(byId('picture-note'), 'The picture needs WebGL, which this browser does not offer. The tables have all values.');
    return;
  }
  if (run) rows.ask();
}

// ---------------------------------------------------------------- all of it

async function showRecordings() {
  const files = await get('/api/data', 10_000);
  const link = (text, page, file) => make('a', {
    href: `${page}?data=${encodeURIComponent(file.name)}`, ariaLabel: `${text} ${file.name}`,
  }, text);
  const line = (file) => {
    const isOpen = file.name === name;
    const links = [isOpen ? 'open above' : link('Replay', '/replay', file), ' · ', link('Diagnose', '/diagnosis', file)];
    const size = file.bytes < 1e6 ? `${(1e-3 * file.bytes).toFixed(1)} kB` : `${(1e-6 * file.bytes).toFixed(1)} MB`;
    const cells = [[file.name], [new Date(file.at_ms).toLocaleString('sv')], [size], links];
    return make('tr', {}, ...cells.map((cell) => make('td', {}, ...cell)));
  };
  const none = make('tr', {}, make('td', { colSpan: 4 }, 'None yet: start the server with a folder, ',
    make('code', {}, 'darm serve arm.toml --data runs'), ', and record on the page Program, or by ', make('code', {}, 'darm record'), ' into that folder.'));
  byId('recordings').replaceChildren(...(files.length ? files.map(line) : [none]));
  if (files.length) titleCells(byId('recordings').closest('table'));
}

byId('at').addEventListener('input', () => { pause(); seek(Number(byId('at').value)); });
byId('at').addEventListener('keydown', (event) => {
  const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
  if (!by) return;
  event.preventDefault();
  stepBy(by);
});
byId('back').addEventListener('click', () => stepBy(-1));
byId('forth').addEventListener('click', () => stepBy(1));
byId('play').addEventListener('click', () => (playedAt === null ? play() : pause()));
byId('again').addEventListener('click', read);
for (const [id, by] of [['closer', 1], ['wider', -1], ['all', 0]]) byId(id).addEventListener('click', () => zoom(by));
window.addEventListener('resize', drawMarks);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', drawMarks);

onLive(({ recordings }) => {
  const isGrowing = Boolean(name && recordings?.last?.is_running && recordings.last.name === name);
  setText(byId('growing'), isGrowing ? 'It is being recorded: Read again shows the rows since.' : '');
});

async function start() {
  try {
    await showRecordings();
    arm = await get('/api/arm');
  } catch {
    setTimeout(start, 500);
    return;
  }
  if (!name) return;
  await read();
  if (arm) startPicture();
  else byId('arm-section').hidden = true;
}
start();
follow();
