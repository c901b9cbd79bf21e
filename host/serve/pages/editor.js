// Makes a table: visits as rows that are checked as they are typed, and as a time line in which a click switches an output.

import { get, post } from './server.js';
import { showAlert } from './frame.js';
import { byId, make, seconds, setText, titleCells } from './format.js';
import { Draft } from './draft.js';
import { TimeLine } from './timeline.js';

// As typed: a request for each key would be too many.
const CHECK_AFTER_MS = 200;

const DEGREE = Math.PI / 180;
const draft = new Draft();
let arm = null;
// The draft as the server would make it, where it can, and the state that it was made of.
let made = null;
let madeOf = null;
let checking = null;
// The field that is typed into and was not left yet.
let typing = null;

const names = () => arm.actuators.map((actuator) => actuator.name);
const restWord = () => '0'.repeat(arm.actuators.length);
const request = ({ visits, mayRest }) => ({
  visits: visits.map(({ word, servosDeg, dwell }) => ({
    word, servos_rad: servosDeg.map((deg) => DEGREE * deg), dwell_s: dwell === '' ? null : Number(dwell),
  })),
  may_rest: mayRest,
});

// ---------------------------------------------------------------- the visits

function change(visits) {
  draft.become({ ...draft.now, visits });
  show();
}

const at = (index, visit) => draft.now.visits.map((old, k) => (k === index ? { ...old, ...visit } : old));
const without = (index) => draft.now.visits.filter((_, k) => k !== index);

function moved(index, by) {
  const visits = [...draft.now.visits];
  const [visit] = visits.splice(index, 1);
  visits.splice(index + by, 0, visit);
  return visits;
}

const visitOf = (word) => ({ word, servosDeg: arm.servos.map(() => 0), dwell: '' });

// Several lines that are pasted into a word are as many visits.
function paste(event, index) {
  const words = event.clipboardData.getData('text').split(/\s+/).filter(Boolean);
  if (words.length < 2) return;
  event.preventDefault();
  change([...draft.now.visits.slice(0, index), ...words.map(visitOf), ...draft.now.visits.slice(index + 1)]);
}

function button(text, label, act) {
  const element = make('button', { type: 'button', className: 'small' }, text);
  element.setAttribute('aria-label', label);
  element.addEventListener('click', act);
  return element;
}

// What is typed is checked at once, and a step of undo when the field is left.
function field(properties, label, take) {
  const input = make('input', { autocomplete: 'off', spellcheck: false, ...properties });
  input.setAttribute('aria-label', label);
  input.addEventListener('input', () => {
    typing = input;
    check({ ...draft.now, visits: take(input.value) });
  });
  input.addEventListener('change', () => {
    typing = null;
    change(take(input.value));
  });
  return input;
}

const angles = (index) => draft.now.visits[index].servosDeg;

// A row for the visit of this number, whichever it is by then: it stays while visits change, so that neither the focus that goes
// from field to field nor a click that leaves a field loses its element.
function row(index) {
  const of = `of visit ${index + 1}`;
  const word = field({ className: 'word', maxLength: restWord().length }, `Word ${of}`, (text) => at(index, { word: text.trim() }));
  word.size = restWord().length + 1;
  word.addEventListener('paste', (event) => paste(event, index));
  const servos = arm.servos.map((_, k) => field({ type: 'number', step: 'any' }, `Angle of servo ${k} ${of}, degrees`, (text) =>
    at(index, { servosDeg: angles(index).map((old, other) => (other === k ? Number(text) : old)) })));
  const dwell = field({ type: 'number', min: 0, max: 3600, step: 'any', placeholder: 'auto' }, `Rest ${of}, s`, (text) => at(index, { dwell: text }));
  const earlier = button('↑', `Visit ${index + 1} earlier`, () => change(moved(index, -1)));
  const later = button('↓', `Visit ${index + 1} later`, () => change(moved(index, 1)));
  const element = make('tr', {},
    make('th', { scope: 'row', className: 'num' }, String(index + 1)),
    make('td', {}, word), make('td', {}, ...servos), make('td', {}, dwell),
    make('td', {}, earlier, later,
      button('Copy', `Copy visit ${index + 1}`, () => change([...draft.now.visits.slice(0, index + 1), ...draft.now.visits.slice(index)])),
      button('Remove', `Remove visit ${index + 1}`, () => change(without(index)))));
  element.fill = (visit, length) => {
    write(word, visit.word);
    servos.forEach((input, k) => write(input, String(visit.servosDeg[k])));
    write(dwell, visit.dwell);
    earlier.disabled = index === 0;
    later.disabled = index + 1 >= length;
  };
  return element;
}

function write(input, value) {
  if (input.value !== value) input.value = value;
}

function show() {
  const { visits, mayRest } = draft.now;
  const rows = byId('visits');
  const table = rows.closest('table');
  table.classList.toggle('no-servos', arm.servos.length === 0);
  while (rows.children.length > visits.length) rows.lastElementChild.remove();
  while (rows.children.length < visits.length) rows.append(row(rows.children.length));
  visits.forEach((visit, k) => rows.children[k].fill(visit, visits.length));
  titleCells(table);
  table.hidden = visits.length === 0;
  byId('may-rest').checked = mayRest;
  byId('undo').disabled = !draft.canStep(-1);
  byId('redo').disabled = !draft.canStep(1);
  check(draft.now);
}

// What is typed and not left yet is a change too: undo takes it back, and nothing before it.
function step(by) {
  typing?.dispatchEvent(new Event('change'));
  draft.step(by);
  show();
}

// ---------------------------------------------------------------- checked as typed

function check(state) {
  clearTimeout(checking?.timer);
  checking?.abort.abort();
  const abort = new AbortController();
  checking = { abort, timer: setTimeout(() => ask(state, abort.signal), CHECK_AFTER_MS) };
}

async function ask(state, signal) {
  const mark = (refused) => [...byId('visits').children].forEach((row, k) => row.classList.toggle('refused', refused === k));
  byId('make-visits').disabled = true;
  byId('draft-scroll').hidden = state.visits.length === 0;
  if (state.visits.length === 0) {
    setText(byId('make-note'), '');
    return;
  }
  try {
    const answer = await post('/api/draft', request(state), { signal });
    if (signal.aborted) return;
    [made, madeOf] = [answer, state];
    mark(null);
    line.show({ ...made, refusal: null }, names());
    setText(byId('make-note'), `${state.visits.length} visits in ${seconds(made.end_s)}, ${made.rows.length} rows: within all limits.`);
    byId('make-visits').disabled = state !== draft.now;
  } catch (error) {
    if (signal.aborted) return;
    mark(error.visit ?? null);
    setText(byId('make-note'), `No table: ${error.message}`);
  }
}

// Whether the visits of a state are those of the time line, but for their words.
function isOnTimeLine({ visits }) {
  const isSame = (visit, old) => visit.dwell === old.dwell && visit.word.length === old.word.length && visit.servosDeg.every((deg, k) => deg === old.servosDeg[k]);
  return visits.length === madeOf?.visits.length && visits.every((visit, k) => isSame(visit, madeOf.visits[k]));
}

// Switches the output in the visit of this time: that of its row, the way to it included. Of an actuator whose coils are never on
// together the other one goes off.
function toggle(lane, at_s) {
  const index = made.visits_s.findIndex(([, to]) => at_s < to);
  const visit = draft.now.visits[index];
  // While a draft is refused, the time line is that of another one.
  if (!visit || !isOnTimeLine(draft.now)) return;
  const coils = made.lanes.filter((other) => other.actuator === lane.actuator).map((other) => other.output);
  const coil = 1 << coils.indexOf(lane.output);
  const both = Number(visit.word[lane.actuator]) ^ coil;
  const digit = both < arm.actuators[lane.actuator].states ? both : coil;
  const word = visit.word.slice(0, lane.actuator) + digit + visit.word.slice(lane.actuator + 1);
  change(at(index, { word }));
}
const line = new TimeLine(byId('draft'), toggle);

// ---------------------------------------------------------------- all of it

async function open(body, doing) {
  showAlert(null);
  setText(byId('make-note'), doing);
  try {
    const table = await post('/api/plan', body, { timeoutMs: 120_000 });
    setText(byId('make-note'), `${table.name}: ${table.n_visits} visits, opened above.`);
  } catch (error) {
    setText(byId('make-note'), `No table: ${error.message}`);
  }
}

// Each row of a table is a visit that rests as long as the row lasts, the way to it included.
export function take(program) {
  const { rows, end_s: end } = program;
  change(rows.map(({ at_s, word, servos_rad: servos }, k) => ({
    word, servosDeg: arm.servos.map((_, servo) => Number(((servos[servo] ?? 0) / DEGREE).toFixed(4))), dwell: String(Number(((rows[k + 1]?.at_s ?? end) - at_s).toFixed(6))),
  })));
  byId('make-section').scrollIntoView();
}

// `served` is the arm of the server.
export function start(served) {
  arm = served;
  byId('make-section').hidden = byId('edit').disabled = false;
  draft.fit(arm.servos.length);
  byId('add').addEventListener('click', () => {
    const last = draft.now.visits.at(-1);
    change([...draft.now.visits, last ? { ...last } : visitOf(restWord())]);
  });
  byId('undo').addEventListener('click', () => step(-1));
  byId('redo').addEventListener('click', () => step(1));
  byId('may-rest').addEventListener('change', (event) => { draft.become({ ...draft.now, mayRest: event.target.checked }); show(); });
  byId('make-plan').addEventListener('click', () => open({ of: 'plan' }, 'Planning …'));
  byId('make-visits').addEventListener('click', () => open({ of: 'visits', ...request(draft.now) }, 'Making …'));
  byId('make-section').addEventListener('keydown', (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== 'z') return;
    event.preventDefault();
    step(event.shiftKey ? 1 : -1);
  });
  // A page that the browser has kept for "back" has the draft from before the page Reach added to it.
  window.addEventListener('pageshow', (event) => {
    if (!event.persisted) return;
    draft.load();
    draft.fit(arm.servos.length);
    show();
  });
  window.addEventListener('resize', () => made && line.show({ ...made, refusal: null }, names()));
  show();
}
