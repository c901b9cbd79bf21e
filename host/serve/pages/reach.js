// The page of reach: the target, the nearest word, the path to it, and a plane of the density map.

import { get, post } from './server.js';
import { follow, onLive, order } from './frame.js';
import { Draft, withVisit } from './draft.js';
import { byId, degrees, fixed, make, percent, poseText, seconds, setFacts, setText, titleCells } from './format.js';
import { DensityPlot } from './density.js';
import { Latest } from './latest.js';

const STAGES = { start: 'starting', index: 'forming the index of the frames', words: 'searching the words', servos: 'searching words and servo angles', map: 'forming the density map' };
const POLL_MS = 250;
const AXES = { xy: [0, 1, 2], xz: [0, 2, 1], yz: [1, 2, 0] };
const NAMES = ['x', 'y', 'z'];
const RAD = Math.PI / 180;

let about = null;
let arm = null;
let live = null;
let current = null;
let found = null;
// The words of the path, that of the arm now first.
let rests = [];
// Stops that were known when the path was asked for: a stop of anybody outdates it.
let pathStops = null;
let picture = null;
// What draws it, once it is loaded: control does not wait for the library.
let targets = null;
// Until a person moves the target it is where the tool is first seen.
let isMoved = false;
// Without WebGL there is no picture, and the fields say all.
let target = { position: [0, 0, 0], rotation: [0, 0, 0] };

// A rounded zero would promise more than there is.
const exact = (m) => (Math.abs(m) < 1e-7 ? '< 0.0001 mm' : `${(1e3 * m).toFixed(m < 0.1 ? 4 : 2)} mm`);
const isPlanar = () => about.rest.is_planar;

// ---------------------------------------------------------------- the fields

const FIELDS = () => (isPlanar() ? [['x', 'mm', 0], ['y', 'mm', 1], ['angle', '°', 5]]
  : [['x', 'mm', 0], ['y', 'mm', 1], ['z', 'mm', 2], ['rotation x', '°', 3], ['rotation y', '°', 4], ['rotation z', '°', 5]]);

function field(id, name, unit, input) {
  Object.assign(input, { id });
  return make('div', { className: 'field' }, make('label', { htmlFor: id }, `${name}, ${unit}`), input);
}

function makeFields() {
  const number = () => make('input', { type: 'number', step: 'any' });
  byId('pose').replaceChildren(...FIELDS().map(([name, unit, index]) => field(`pose-${index}`, name, unit, number())));
  for (const input of byId('pose').querySelectorAll('input')) input.addEventListener('input', typed);
  byId('servo-fields').replaceChildren(...arm.servos.map((servo, index) => {
    const [min, max] = [servo.min_rad, servo.max_rad].map((rad) => (rad / RAD).toFixed(1));
    const input = make('input', { type: 'number', step: 'any', min, max, value: '0' });
    input.addEventListener('input', servosChanged);
    return field(`servo-${index}`, `servo ${index}: ${servo.name}`, `° (${min} to ${max})`, input);
  }));
  byId('optimise-field').hidden = arm.servos.length === 0;
}

const servos = () => arm.servos.map((_, index) => RAD * Number(byId(`servo-${index}`).value));

function showFields() {
  const numbers = [...target.position.map((m) => 1e3 * m), ...target.rotation.map((rad) => rad / RAD)];
  for (const [, unit, index] of FIELDS()) {
    const input = byId(`pose-${index}`);
    // What is being typed is left alone.
    if (document.activeElement !== input) input.value = numbers[index].toFixed(unit === 'mm' ? 1 : 2).replace(/\.?0+$/, '').replace(/^-0$/, '0');
  }
}

function typed() {
  const numbers = [0, 0, 0, 0, 0, 0];
  for (const [, , index] of FIELDS()) {
    const { value } = byId(`pose-${index}`);
    if (value === '' || !Number.isFinite(Number(value))) return;
    numbers[index] = Number(value);
  }
  target = { position: numbers.slice(0, 3).map((mm) => 1e-3 * mm), rotation: numbers.slice(3).map((deg) => RAD * deg) };
  picture?.setTarget(target.position, target.rotation);
  targetChanged();
}

function setTarget(position, rotation) {
  target = { position, rotation };
  picture?.setTarget(position, rotation);
  showFields();
  targetChanged();
}

function dragged() {
  target = { position: picture.position.toArray(), rotation: targets.rotationVector(picture.rotation) };
  showFields();
  targetChanged();
}

function targetChanged() {
  isMoved = true;
  markDensity();
  search.ask();
  if (needsSlice()) slices.ask();
}

function servosChanged() {
  search.ask();
  askForMap();
}

// ---------------------------------------------------------------- the search

const now = () => (live?.board && live.board.word.length === about.rest.word.length ? live.board.word : about.rest.word);

const search = new Latest(async (signal) => {
  const request = {
    target: { position_m: target.position, rotation_rad: target.rotation }, position_only: byId('compare').value === 'position',
    servos_rad: servos(), optimise_servos: byId('optimise').value === 'free', from: now(),
  };
  try {
    showFound(await post('/api/reach/nearest', request, { signal }), request.target);
  } catch (error) {
    if (!signal.aborted) showFailure(error.message);
  }
});

function showFailure(text) {
  byId('target-note').hidden = !text;
  setText(byId('target-note'), text ?? '');
}

// Error of the reached tool along each axis of the base, mm.
function byAxis(tool, wanted) {
  const axes = NAMES.slice(0, isPlanar() ? 2 : 3);
  return axes.map((name, axis) => `${name} ${fixed(1e3 * (tool.position_m[axis] - wanted.position_m[axis]), 3)}`).join(', ');
}

function showFound(answer, wanted) {
  const isOther = found?.word !== answer.word || found.switches !== answer.switches;
  found = answer;
  showFailure(null);
  picture?.show(found.picture);
  setText(byId('word'), found.word);
  const words = `${found.words.toLocaleString('en')} words`;
  const bound = found.lower_bound_m > 0 ? exact(found.lower_bound_m) : '0 mm';
  const limited = byId('optimise').value === 'free' ? `none of ${words} is closer than ${bound} at any angles`
    : `not all of ${words} searched (${percent(found.searched)}); none is closer than ${bound}`;
  const proof = found.is_proven ? `proven: none of ${words} is closer` : limited;
  const effects = found.with_effects ? [['with the effects of the model', `${exact(found.with_effects[0])}, ${degrees(found.with_effects[1])}`]] : [];
  setFacts(byId('facts'), [
    ['distance', `${exact(found.distance_m)}, ${proof}`],
    ['position error', `${exact(found.error_m)} (${byAxis(found.tool, wanted)} mm)`],
    ['orientation error', degrees(found.error_rad)],
    ...effects,
    ['tool by the geometry', poseText(found.tool, isPlanar())],
    ...(found.servos_rad.length ? [['servos', found.servos_rad.map(degrees).join(', ')]] : []),
    ['switches', `${found.switches} actuators from the word now`],
    ['search', seconds(found.took_s)],
  ]);
  byId('add-visit').disabled = false;
  if (isOther) orders.ask();
  markDensity();
}

// One word at a time: more actuators at once than the supply feeds would be refused.
byId('set').addEventListener('click', () => order('/api/command', { do: 'word', word: rests[1].word, stops: pathStops }));
byId('add-visit').addEventListener('click', () => {
  const draft = new Draft();
  draft.become(withVisit(draft.now, { word: found.word, servosDeg: found.servos_rad.map((rad) => (180 / Math.PI) * rad), dwell: '' }));
  setText(byId('order-note'), `Visit ${draft.now.visits.length} of the table that is made on the page Program.`);
});
byId('compare').addEventListener('change', () => search.ask());
byId('optimise').addEventListener('change', () => search.ask());
byId('cancel-search').addEventListener('click', () => {
  search.cancel();
  showFailure('The search was cancelled. Move the target to search again.');
});
byId('target').addEventListener('submit', (event) => event.preventDefault());
byId('to-tool').addEventListener('click', () => {
  const { tool } = current ?? about.rest;
  setTarget(tool.position_m, tool.rotation_rad);
});

// ---------------------------------------------------------------- progress

async function poll() {
  for (;;) {
    await new Promise((wake) => setTimeout(wake, POLL_MS));
    if (!search.running && !slices.running && !orders.running) {
      showRunning(null, 'searching', 'search-progress');
      for (const bar of ['density-progress', 'order-progress']) showRunning(null, null, bar);
      continue;
    }
    try {
      const { searching, mapping, ordering } = await get('/api/reach');
      showRunning(search.running && searching, 'searching', 'search-progress');
      showRunning(slices.running && mapping, slices.running && 'density-note', 'density-progress');
      showRunning(orders.running && ordering, null, 'order-progress');
    } catch {
      // The frame says that the server does not answer.
    }
  }
}

function showRunning(running, note, bar) {
  byId(bar).hidden = !running;
  if (note) setText(byId(note), running ? `${STAGES[running.stage]}, ${seconds(running.for_s)}` : '');
  const progress = byId(bar).firstElementChild;
  if (running?.share) progress.value = running.share;
  else progress.removeAttribute('value');
}

// ---------------------------------------------------------------- the path

const orders = new Latest(async (signal) => {
  if (!found) return;
  const deviation = byId('deviation').value;
  const { stops } = live;
  const request = { from: now(), to: found.word, servos_rad: found.servos_rad, deviation_m: deviation === '' ? null : 1e-3 * Number(deviation) };
  try {
    const answer = await post('/api/reach/path', request, { signal });
    pathStops = stops;
    showOrder(answer);
  } catch (error) {
    if (signal.aborted) return;
    showOrder({ at_once: about.at_once, rests: [] });
    setText(byId('order-note'), error.message);
  }
});

function showOrder({ at_once, rests: shown }) {
  rests = shown;
  byId('set').dataset.ready = String(rests.length > 1);
  setText(byId('set'), rests.length > 2 ? `Set the next word of the path (1 of ${rests.length - 1})` : 'Set the arm to this word');
  const between = Math.max(0, rests.length - 2);
  setText(byId('order-note'), rests.length < 2 ? 'The arm is at the nearest word.'
    : `${between} words in between, at most ${at_once} actuators at once`);
  byId('rests').replaceChildren(...rests.map(({ word, position_m, deviation_m }, step) => {
    const place = position_m.slice(0, isPlanar() ? 2 : 3).map((m) => (1e3 * m).toFixed(1)).join(', ');
    return make('tr', {}, make('td', { className: 'num' }, String(step)), make('td', {}, make('code', {}, word)),
      make('td', { className: 'num' }, place), make('td', { className: 'num' }, (1e3 * deviation_m).toFixed(1)));
  }));
  setText(byId('rests-at'), `Tool at ${isPlanar() ? 'x, y' : 'x, y, z'}, mm`);
  titleCells(byId('rests').closest('table'));
  picture?.setRests(rests.map(({ position_m }) => position_m));
}

byId('deviation').addEventListener('input', () => orders.ask());
byId('cancel-order').addEventListener('click', () => {
  orders.cancel();
  showOrder({ at_once: about.at_once, rests: [] });
  setText(byId('order-note'), 'The search for a path was cancelled.');
});

// ---------------------------------------------------------------- the density

let slice = null;
let sliced = '';
// Until a person asks again: each movement of the target would start it.
let isMapCancelled = false;

const density = new DensityPlot(byId('density'), {
  chosen: ([u, v]) => {
    const position = [...target.position];
    [position[plane()[0]], position[plane()[1]]] = [u, v];
    setTarget(position, target.rotation);
  },
  hovered: (text) => setText(byId('density-note'), text),
});

const plane = () => AXES[byId('plane').value];
const layer = () => (slice ? Math.round(target.position[plane()[2]] / slice.cell_m) : null);
const needsSlice = () => !isMapCancelled && (slice === null || `${byId('plane').value} ${layer()}` !== sliced);

function setMapCancelled(isCancelled) {
  isMapCancelled = isCancelled;
  byId('form-density').hidden = !isCancelled;
}

function askForMap() {
  setMapCancelled(false);
  slices.ask();
}

const slices = new Latest(async (signal) => {
  const [name, at_m] = [byId('plane').value, target.position[plane()[2]]];
  try {
    slice = await post('/api/reach/slice', { plane: name, at_m, servos_rad: servos() }, { signal });
    sliced = `${name} ${Math.round(slice.at_m / slice.cell_m)}`;
    density.show(slice, AXES[name].map((axis) => NAMES[axis]));
    const [, , across] = AXES[name];
    setText(byId('density-note'), isPlanar() ? '' : `Plane ${NAMES[across]} = ${(1e3 * slice.at_m).toFixed(0)} mm, cells of ${(1e3 * slice.cell_m).toFixed(0)} mm`);
    markDensity();
  } catch (error) {
    if (!signal.aborted) setText(byId('density-note'), error.message);
  }
});

function markDensity() {
  if (!slice) return;
  const [u, v] = plane();
  const tool = found?.tool.position_m;
  density.mark([target.position[u], target.position[v]], tool && [tool[u], tool[v]]);
}

byId('plane').addEventListener('change', askForMap);
byId('form-density').addEventListener('click', askForMap);
byId('cancel-density').addEventListener('click', () => {
  slices.cancel();
  setMapCancelled(true);
  setText(byId('density-note'), 'The density map was cancelled.');
});

// ---------------------------------------------------------------- all of it

let shownPicture = -1;
let shownWord = '';
let shownStops = null;

async function fetchCurrent(number) {
  shownPicture = number;
  const shown = await get('/api/picture');
  if (!shown?.lines) return;
  const isFirst = current === null;
  current = shown;
  picture?.setNow(current);
  if (!isFirst || isMoved) return;
  live.board?.servos.forEach((servo, index) => { if (byId(`servo-${index}`)) byId(`servo-${index}`).value = (servo.angle_rad / RAD).toFixed(2); });
  setTarget(current.tool.position_m, current.tool.rotation_rad);
}

function show(state) {
  live = state;
  if (!about) return;
  if (live.picture !== shownPicture) fetchCurrent(live.picture).catch(() => { shownPicture = -1; });
  if (now() === shownWord && live.stops === shownStops) return;
  if (now() !== shownWord) search.ask();
  [shownWord, shownStops] = [now(), live.stops];
  orders.ask();
}

async function start() {
  try {
    [about, arm] = [await get('/api/reach', 10_000), await get('/api/arm')];
    targets ??= await import('./target.js');
  } catch {
    setTimeout(start, 500);
    return;
  }
  byId('no-arm').hidden = Boolean(about);
  for (const id of ['reach', 'density-section', 'order-section']) byId(id).hidden = !about;
  if (!about) return;
  byId('depth-keys').hidden = byId('plane-field').hidden = isPlanar();
  if (isPlanar()) byId('plane').value = 'xy';
  makeFields();
  try {
    picture = new targets.TargetPicture(byId('arm'), { moved: dragged, turns: () => byId('drag').value === 'turn' });
    picture.show(about.rest);
  } catch {
    byId('arm').parentElement.hidden = true;
    setText(byId('picture-note'), 'The picture needs WebGL, which this browser does not offer. The fields and tables have all values.');
  }
  setTarget(about.rest.tool.position_m, about.rest.tool.rotation_rad);
  isMoved = false;
  poll();
}

onLive(show);
start();
follow();
