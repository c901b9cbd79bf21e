// The live page: the arm, the state, every output with its budget, switches, servos, events and the link.

import { get } from './server.js';
import { follow, hasControl, onLive, order } from './frame.js';
import { byId, clock, degrees, make, percent, poseText, seconds, setFacts, setText, short } from './format.js';
import './console.js';
import './last-hour.js';
import { showMeasured } from './measured.js';

const PHASES = {
  idle: 'Idle: no output carries current',
  manual: 'Moved by hand',
  approaching: 'Going to the first row',
  playing: 'Playing',
  safe: 'SAFE STATE',
};

let arm = null;
let picture = null;
let predicted = null;
let hasArm = null;
let hasPicture = false;
let shownPicture = -1;
let lastEvent = '';
// The table for which another model is explained.
let explained = null;
let live = null;

// The library of the picture is large and WebGL slow to begin: control and values do not wait for them.
async function startPicture() {
  if (hasPicture || !hasArm) return;
  hasPicture = true;
  let arms;
  try {
    arms = await import('./arm.js');
  } catch {
    hasPicture = false;
    return;
  }
  try {
    picture = new arms.ArmPicture(byId('arm'));
    shownPicture = -1;
    byId('seen-legend').hidden = !live?.measured;
  } catch {
    byId('arm').parentElement.hidden = true;
    setText(byId('picture-note'), 'The picture needs WebGL, which this browser does not offer. The tables have all values.');
  }
}

// ---------------------------------------------------------------- the arm

async function fetchPicture(number) {
  shownPicture = number;
  const shown = await get('/api/picture');
  if (!shown) return;
  if (shown.error) {
    setText(byId('picture-note'), `The model has no pose for this word: ${shown.error}.`);
    return;
  }
  picture?.show(shown);
  predicted = shown.tool;
  const place = poseText(shown.tool, shown.is_planar);
  setText(byId('tool'), `Predicted tool pose: ${place}`);
  byId('arm').setAttribute('aria-label', `${shown.name}, word ${shown.word}, tool at ${place}`);
}

// ---------------------------------------------------------------- state

// Which model the table on the board was made for, where the history knows it, and what to do.
async function explainModel(table) {
  explained = table;
  let name = null;
  try {
    const history = await get('/api/history', 10_000);
    const model = history?.tables.find((one) => one.digest === table)?.model;
    name = history?.models.find((one) => one.digest === model)?.name ?? null;
  } catch {
    // The step is shown without the name.
  }
  const file = name?.endsWith('.toml') ? name : null;
  setText(byId('picture-note'), `The table on the board was made for ${file ?? 'another model'}, not for this arm. Next: end darm serve and start it with `
    + `that model, \`darm serve ${file ?? 'MODEL.toml'}\`, or upload a table of this arm on the page Program.`);
}

function showPhase({ phase, rows, table, has_other_model }) {
  const isRunning = phase.name === 'playing' || phase.name === 'approaching';
  const row = phase.name === 'playing' ? `, row ${phase.row} of ${rows}` : '';
  const fault = phase.fault ? `: ${phase.fault.text}. Remove the cause, then clear it.` : '';
  setText(byId('phase'), PHASES[phase.name] + row + fault);
  byId('phase').dataset.phase = phase.name;
  const place = byId('progress');
  if (!isRunning) place.replaceChildren();
  else {
    if (!place.firstChild) place.replaceChildren(make('progress', { max: 1, ariaLabel: 'Rows done' }), make('span'));
    const [bar, time] = place.children;
    bar.value = rows ? (phase.row ?? 0) / rows : 0;
    setText(time, ` ${(phase.since_s ?? 0).toFixed(1)} s`);
  }
  if (has_other_model && table !== explained) explainModel(table);
}

function supplyText({ room, all, full_s }) {
  return `can feed ${room} more outputs now${room < all ? `, ${all} in ${seconds(full_s)}` : ''}`;
}

function showFacts(board) {
  setFacts(byId('facts'), [
    ['board', `${board.name} ${board.device}`],
    ['firmware', `${board.firmware}, start ${board.boots}`],
    ['table', board.table ? `${short(board.table)}, ${board.rows} rows` : 'none'],
    ['profile', board.profile ? short(board.profile) : board.is_profile_lost ? 'LOST: nothing is driven until it is written again' : 'built in'],
    ['word', board.word || 'none'],
    ...(board.supply ? [['supply', supplyText(board.supply)]] : []),
  ]);
  const { quality } = board;
  const least = quality.min_supply_v === null ? '' : `, at least ${quality.min_supply_v.toFixed(2)} V`;
  const supply = quality.supply_v === null ? 'not measured' : `${quality.supply_v.toFixed(2)} V`;
  setFacts(byId('quality'), [
    ['round trip', seconds(quality.round_trip_s)],
    ['frames sent', `${quality.sent}, again ${quality.again}`],
    ['damaged', `${quality.damaged} here, ${quality.bad_frames} at the board`],
    ['control tick', `at most ${seconds(quality.worst_lateness_s)} late`],
    ['supply of the board', supply + least],
  ]);
}

function showEvents(events) {
  const newest = events.at(-1);
  const key = `${events.length} ${newest?.number} ${newest?.at_s}`;
  if (key === lastEvent) return;
  lastEvent = key;
  byId('events').replaceChildren(...events.toReversed().slice(0, 20).map((event) =>
    make('li', { className: event.kind, value: event.number }, make('time', {}, clock(event.at_s)), ` ${event.text}`)));
}

// ---------------------------------------------------------------- outputs and servos

// Each order says how many stops the page knows of: the word of the state shown would switch on again what was stopped since.
function setDigit(actuator, digit) {
  const word = [...live.board.word].map((old, index) => (index === actuator ? String(digit) : old)).join('');
  return order('/api/command', { do: 'word', word, stops: live.stops });
}

function outputRow(output, isFirst) {
  const states = output.actuator === null || !isFirst ? 0 : (arm?.actuators[output.actuator]?.states ?? 0);
  const name = output.actuator === null ? '–' : `${output.actuator}: ${arm?.actuators[output.actuator]?.name ?? ''}`;
  const buttons = Array.from({ length: states }, (_, digit) => {
    const button = make('button', { type: 'button', className: 'small', disabled: true }, String(digit));
    button.dataset.needsControl = '';
    button.setAttribute('aria-label', `Set actuator ${output.actuator} to state ${digit}`);
    button.addEventListener('click', () => setDigit(output.actuator, digit));
    return button;
  });
  const meter = make('meter', { min: 0, max: output.allowed_s });
  meter.setAttribute('aria-label', `Time that output ${output.output} may still be on`);
  const cell = (title, ...content) => {
    const td = make('td', {}, ...content);
    td.dataset.title = title;
    return td;
  };
  const row = make('tr', {},
    make('th', { scope: 'row' }, String(output.output)), cell('Actuator', name), cell('Is'), cell('On for'),
    cell('Left', meter, make('span', { className: 'left' })), cell('Switch'), cell('Set to', ...buttons));
  row.children[3].classList.add('num');
  return row;
}

function switchText(actuator) {
  if (!actuator?.switch) return 'none';
  const { input, expected, seen, is_moving } = actuator.switch;
  const name = (closed) => (closed ? 'closed' : 'open');
  if (expected === seen) return `✓ ${name(seen)} (input ${input})`;
  return is_moving ? `… moving, still ${name(seen)}` : `✕ expected ${name(expected)}, seen ${name(seen)} (input ${input})`;
}

function showOutputs({ outputs, actuators }) {
  const body = byId('outputs');
  const key = JSON.stringify([outputs.map((output) => [output.output, output.allowed_s]), Boolean(arm)]);
  if (body.dataset.key !== key) {
    const isFirst = (output, index) => outputs.findIndex((other) => other.actuator === output.actuator) === index;
    body.replaceChildren(...outputs.map((output, index) => outputRow(output, isFirst(output, index))));
    body.dataset.key = key;
  }
  outputs.forEach((output, index) => {
    const [, , is, onFor, left, seen, set] = body.children[index].children;
    const actuator = output.actuator === null ? null : actuators[output.actuator];
    const on = output.drive === 'latch' ? ['set', 'reset'] : ['ON', 'off'];
    setText(is, output.is_on === null ? '–' : output.is_on ? on[0] : on[1]);
    body.children[index].classList.toggle('on', output.is_on === true);
    setText(onFor, output.on_s === null ? '–' : `${output.on_s.toFixed(1)} s`);
    const [meter, text] = left.children;
    meter.value = output.left_s;
    meter.low = 0.25 * output.allowed_s;
    meter.optimum = output.allowed_s;
    const wait = output.wait_s > 0 ? ` in ${seconds(output.wait_s)}:` : '';
    setText(text, `${wait} ${output.left_s.toFixed(1)} of ${output.allowed_s.toFixed(1)} s`);
    setText(seen, switchText(actuator));
    const isWrong = actuator?.switch && actuator.switch.expected !== actuator.switch.seen && !actuator.switch.is_moving;
    seen.classList.toggle('wrong', Boolean(isWrong));
    [...set.children].forEach((button, digit) => button.setAttribute('aria-pressed', String(actuator?.digit === digit)));
  });
}

function servoRow(servo, index) {
  const { name = `servo ${index}`, min_rad = -Math.PI, max_rad = Math.PI } = arm?.servos[index] ?? {};
  const [min, max] = [min_rad, max_rad].map((rad) => ((180 / Math.PI) * rad).toFixed(1));
  const angle = make('input', { type: 'number', min, max, step: 'any', value: '0' });
  angle.setAttribute('aria-label', `Angle of servo ${index} in degrees`);
  const go = make('button', { type: 'button', className: 'small', disabled: true }, 'Go');
  go.dataset.needsControl = '';
  go.addEventListener('click', () =>
    order('/api/command', { do: 'servo', servo: index, angle_rad: (Math.PI / 180) * Number(angle.value), stops: live.stops }));
  return make('tr', {}, make('th', { scope: 'row' }, String(index)), make('td', {}, name), make('td', { className: 'num' }),
    make('td', { className: 'num' }), make('td'), make('td', {}, angle, ` ° (${min} to ${max}) `, go));
}

function showServos({ servos }) {
  byId('servo-section').hidden = servos.length === 0;
  const body = byId('servos');
  if (body.children.length !== servos.length) body.replaceChildren(...servos.map(servoRow));
  servos.forEach((servo, index) => {
    const [, , angle, load, state] = body.children[index].children;
    setText(angle, servo.has_answered ? degrees(servo.angle_rad) : '–');
    setText(load, servo.has_answered ? percent(servo.load) : '–');
    const error = servo.error_bits ? `error bits 0x${servo.error_bits.toString(16)}` : 'well';
    setText(state, servo.has_answered ? error : 'has not answered');
  });
}

// ---------------------------------------------------------------- all of it

function show(now) {
  live = now;
  // After this state is shown.
  if (!hasPicture) setTimeout(startPicture);
  const { board, measured } = live;
  showMeasured(measured, predicted, arm?.is_planar);
  picture?.setMeasured(measured?.tool ?? null);
  if (live.picture !== shownPicture) fetchPicture(live.picture).catch(() => { shownPicture = -1; });
  if (!board) return;
  showPhase(board);
  showFacts(board);
  showEvents(live.events);
  showOutputs(board);
  showServos(board);
  const isLive = live.link.state === 'live' && hasControl();
  byId('play').disabled = !isLive || !board.table || board.phase.name === 'playing';
  byId('clear').disabled = !isLive || board.phase.name !== 'safe';
}

byId('play').addEventListener('click', () => order('/api/command', { do: 'play', table: live.board.table, stops: live.stops }));
byId('clear').addEventListener('click', () => order('/api/command', { do: 'clear' }));
onLive(show);
// The names do not change while the server runs; without an arm there are none.
async function fetchArm() {
  try {
    arm = await get('/api/arm');
    hasArm = Boolean(arm);
    byId('no-arm').hidden = hasArm;
    byId('arm').parentElement.hidden = byId('arm-legend').hidden = !hasArm;
    if (arm) setText(byId('arm-file'), `${arm.file}, model ${arm.number}, ${short(arm.model)}`);
  } catch {
    setTimeout(fetchArm, 500);
  }
}
fetchArm();
follow();
