// The page of the program: opens or makes a table, shows when each output is on and what is refused, uploads, plays, steps and records it.

import { get, getBytes, post } from './server.js';
import { follow, hasControl, onLive, order, showAlert } from './frame.js';
import { byId, clock, degrees, make, save, seconds, setFacts, setText, short } from './format.js';
import { TimeLine } from './timeline.js';
import * as editor from './editor.js';
import * as playback from './playback.js';

const timeline = new TimeLine(byId('timeline'));
let program = null;
let shown = -1;
let isUploading = false;
let names = [];
let live = null;

// A table, and its visit file behind it where that is given too.
async function open(files) {
  showAlert(null);
  const isVisits = (file) => file.name.endsWith('.csv');
  for (const file of [...files].sort((a, b) => isVisits(a) - isVisits(b))) {
    const path = isVisits(file) ? '/api/open-visits' : '/api/open';
    try {
      await post(`${path}?name=${encodeURIComponent(file.name)}`, isVisits(file) ? file : await file.arrayBuffer());
    } catch (error) {
      showAlert(program ? `${error.message} Still shown: ${program.name}.` : error.message);
    }
  }
}

byId('file').addEventListener('change', (event) => open(event.target.files));
const drop = byId('drop');
for (const type of ['dragenter', 'dragover']) {
  drop.addEventListener(type, (event) => {
    event.preventDefault();
    drop.classList.add('over');
  });
}
drop.addEventListener('dragleave', () => drop.classList.remove('over'));
drop.addEventListener('drop', (event) => {
  event.preventDefault();
  drop.classList.remove('over');
  open(event.dataTransfer.files);
});

function limitOf(refusal) {
  const { limit } = refusal;
  if (!limit) return '';
  return ` Limit of output ${refusal.output}: ${seconds(limit.max_on_s)} without a pause, ${limit.duty_percent} % of ${seconds(limit.window_s)}.`;
}

function showRefusal(refusal) {
  const note = byId('refusal');
  note.hidden = !refusal;
  if (!refusal) return;
  setText(note, `Refused: ${refusal.text ?? refusal.message}.${limitOf(refusal)}`);
}

// Sets the arm to a row by hand: where a program is tried step by step.
function setButton(index) {
  const button = make('button', { type: 'button', className: 'small', disabled: true }, 'Set');
  button.dataset.needsControl = '';
  button.dataset.ready = String(isLoaded());
  button.setAttribute('aria-label', `Set the arm to row ${index}`);
  button.addEventListener('click', () => playback.setRow(program, index, live));
  return button;
}

const isLoaded = () => Boolean(program?.digest && live?.board?.table === program.digest);

function showProgram(refusal) {
  byId('timeline-section').hidden = byId('rows-section').hidden = !program;
  if (!program) return;
  showRefusal(refusal);
  timeline.show({ ...program, refusal }, names);
  const table = byId('rows').closest('table');
  table.classList.toggle('no-servos', program.rows.every((row) => row.servos_rad.length === 0));
  table.classList.toggle('no-refusal', refusal?.row === undefined || refusal.row === null);
  byId('rows').replaceChildren(...program.rows.map((row, index) => {
    const isRefused = refusal?.row === index;
    const cells = [
      make('td', { className: 'num' }, String(index)),
      make('td', { className: 'num' }, clock(row.at_s)),
      make('td', {}, make('code', {}, row.word)),
      make('td', {}, row.servos_rad.map(degrees).join(' ')),
      make('td', {}, setButton(index)),
      make('td', {}, isRefused ? (refusal.text ?? refusal.message) : ''),
    ];
    return make('tr', { className: isRefused ? 'refused' : '' }, ...cells);
  }));
  setFacts(byId('table-facts'), [
    ['file', program.name], ['digest', short(program.digest)], ['rows', String(program.rows.length)],
    ['duration', seconds(program.end_s)], ['outputs', String(program.lanes.length)],
  ]);
}

// A table with its visit file: what it is for, and its two files for `darm record`.
function showOrigin() {
  const origin = program?.origin ?? null;
  byId('origin').hidden = !origin;
  if (!origin) return;
  const after = origin.diagnosed ? ` after the diagnosis of ${origin.diagnosed}` : '';
  const model = origin.model === null ? 'another model' : `model ${origin.model}`;
  setText(byId('origin-text'), `Made with ${model}${after}: ${origin.n_visits} visits in ${seconds(program.end_s)}. `
    + 'Upload it, then play it, or record it below. In a terminal, with both files saved:');
  setText(byId('origin-command'), `darm upload ${program.name} && darm record ${program.name} -o run-${origin.model ?? 1}.csv`);
}

async function saveFile(part, name, type) {
  try {
    save(name, await getBytes(`/api/program/${part}`), type);
    setText(byId('saved'), `Wrote ${name} to the downloads of this browser.`);
  } catch (error) {
    showAlert(error.message);
  }
}

// ---------------------------------------------------------------- record

let namesTaken = [];

async function fetchTaken() {
  try {
    namesTaken = (await get('/api/data')).map((file) => file.name);
    if (!byId('record-name').value) byId('record-name').value = freeName();
  } catch {
    // The server refuses a name that is taken.
  }
}

// The first run-N that is free.
function freeName() {
  let number = 1;
  while (namesTaken.includes(`run-${number}.csv`)) number += 1;
  return `run-${number}`;
}

byId('record').addEventListener('click', async () => {
  setText(byId('record-result'), '');
  playback.endLoop('');
  await order('/api/record', { table: program.digest, name: byId('record-name').value, stops: live.stops });
});

let wasRecording = false;
function showRecording(isLoaded) {
  const { recordings, board } = live;
  byId('no-data').hidden = Boolean(recordings);
  byId('record-here').hidden = !recordings;
  byId('record-section').hidden = !program?.digest;
  if (!recordings) return;
  const { last } = recordings;
  const isRunning = Boolean(last?.is_running);
  const why = !program?.origin ? 'Open its visit file too (.visits.csv): it says when the arm rests.'
    : !isLoaded ? 'Upload the table first.' : !hasControl() ? 'Take control to record.' : '';
  setText(byId('record-note'), isRunning ? '' : why);
  byId('record').disabled = Boolean(why) || isRunning || live.link.state !== 'live' || !byId('record-name').checkValidity();
  byId('record-progress').hidden = !isRunning;
  if (isRunning && program) {
    const since = board?.phase.name === 'playing' ? board.phase.since_s : 0;
    byId('recorded').value = Math.min(since / program.end_s, 1);
    setText(byId('record-left'), ` ${last.name}: ${Math.max(program.end_s - since, 0).toFixed(0)} s left`);
  }
  if (wasRecording && !isRunning) fetchTaken().then(() => { byId('record-name').value = freeName(); });
  wasRecording = isRunning;
  const result = byId('record-result');
  const key = JSON.stringify(last);
  if (isRunning || !last || result.dataset.key === key) return;
  result.dataset.key = key;
  const link = (text, page) => make('a', { href: `${page}?data=${encodeURIComponent(last.name)}` }, text);
  const diagnose = last.is_complete ? [link('Diagnose it', '/diagnosis'), ' · '] : [];
  result.replaceChildren(`${last.name}: ${last.text}. `, ...diagnose, link('Replay it', '/replay'));
}

byId('save-table').addEventListener('click', () => saveFile('table', program.name, 'application/octet-stream'));
byId('save-visits').addEventListener('click', () => saveFile('visits', program.origin.visits_name, 'text/csv'));

async function fetchProgram(number) {
  shown = number;
  const opened = await get('/api/program');
  // The answer to an earlier request may come after that to a later one.
  if (shown !== number) return;
  program = opened;
  byId('no-program').hidden = Boolean(program);
  showOrigin();
  showProgram(program?.refusal ?? null);
}

async function act(path, body) {
  const refusal = await order(path, body);
  if (refusal && refusal.row !== null && refusal.row !== undefined) {
    const lane = program.lanes.find((lane) => lane.output === refusal.output);
    refusal.limit ??= lane?.limit;
    showProgram(refusal);
  }
  return refusal;
}

byId('upload').addEventListener('click', async () => {
  isUploading = true;
  await act('/api/upload', { table: program.digest });
  isUploading = false;
});
byId('play').addEventListener('click', async () => {
  if (byId('loop').checked) playback.startLoop(live);
  if (await act('/api/command', { do: 'play', table: program.digest, stops: live.stops })) playback.endLoop('');
});
byId('loop').addEventListener('change', (event) => {
  if (event.target.checked && ['approaching', 'playing'].includes(live?.board?.phase.name)) playback.startLoop(live);
  if (!event.target.checked) playback.endLoop('');
});
byId('pause').addEventListener('click', () => playback.pause(program, live));
for (const [id, by] of [['step-back', -1], ['step', 1]]) byId(id).addEventListener('click', () => playback.stepBy(program, by, live));
byId('edit').addEventListener('click', () => editor.take(program));

function running(board) {
  const { phase } = board;
  const names = { idle: 'idle', manual: 'moved by hand', approaching: 'going to the first row', playing: 'playing', safe: 'safe state' };
  const row = phase.name === 'playing' ? `, row ${phase.row} of ${board.rows}, ${phase.since_s.toFixed(1)} s` : '';
  const fault = phase.fault ? `: ${phase.fault.text}` : '';
  return names[phase.name] + row + fault;
}

let wasLoaded = false;
function show(now) {
  live = now;
  const { board, upload } = live;
  if (live.program !== shown) fetchProgram(live.program).catch(() => { shown = -1; });
  const isHere = live.link.state === 'live' && hasControl();
  const isReady = Boolean(program?.digest && board && !isUploading && isHere);
  const isPlaying = board?.phase.name === 'playing' || board?.phase.name === 'approaching';
  const isPossible = { upload: isReady, play: isReady && isLoaded(), pause: isReady && isLoaded() && isPlaying };
  for (const [id, possible] of Object.entries(isPossible)) byId(id).disabled = !possible;
  for (const id of ['step-back', 'step']) byId(id).disabled = !isReady || !isLoaded() || isPlaying;
  if (wasLoaded !== isLoaded()) {
    wasLoaded = isLoaded();
    for (const button of byId('rows').querySelectorAll('button')) button.dataset.ready = String(wasLoaded);
  }
  const loaded = isLoaded() ? 'The board has this table.' : `The board has ${board?.table ? `table ${short(board.table)}` : 'no table'}.`;
  const need = hasControl() ? '' : ' Take control to upload and play.';
  setText(byId('table-note'), board ? loaded + need : '');
  showRecording(isLoaded());
  byId('upload-progress').hidden = !upload;
  if (upload) byId('progress').value = upload.total ? upload.done / upload.total : 0;
  if (!board) return;
  setText(byId('running'), running(board));
  playback.follow(program, live);
  timeline.setTime(isLoaded() && board.phase.name === 'playing' && live.link.state === 'live' ? board.phase.since_s : null);
}

// Names of the actuators; without an arm there are none.
async function fetchNames() {
  let arm;
  try {
    arm = await get('/api/arm');
  } catch {
    setTimeout(fetchNames, 500);
    return;
  }
  names = arm?.actuators.map((actuator) => actuator.name) ?? [];
  if (program) showProgram(program.refusal);
  if (arm) editor.start(arm);
}

onLive(show);
fetchNames();
fetchTaken();
window.addEventListener('resize', () => program && showProgram(program.refusal));
follow();
