// The page of the program: opens or makes a table, shows when each output is on and what is refused, uploads, plays and records it.

import { get, getBytes, post } from './server.js';
import { follow, hasControl, onLive, order, showAlert } from './frame.js';
import { byId, clock, degrees, make, save, seconds, setFacts, setText, short } from './format.js';
import { TimeLine } from './timeline.js';

const timeline = new TimeLine(byId('timeline'));
let program = null;
let shown = -1;
let isUploading = false;
let names = [];
let live = null;

async function open(file) {
  showAlert(null);
  try {
    await post(`/api/open?name=${encodeURIComponent(file.name)}`, await file.arrayBuffer());
  } catch (error) {
    showAlert(program ? `${error.message} Still shown: ${program.name}.` : error.message);
  }
}

byId('file').addEventListener('change', (event) => {
  const [file] = event.target.files;
  if (file) open(file);
});
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
  const [file] = event.dataTransfer.files;
  if (file) open(file);
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
      make('td', {}, isRefused ? (refusal.text ?? refusal.message) : ''),
    ];
    return make('tr', { className: isRefused ? 'refused' : '' }, ...cells);
  }));
  setFacts(byId('table-facts'), [
    ['file', program.name], ['digest', short(program.digest)], ['rows', String(program.rows.length)],
    ['duration', seconds(program.end_s)], ['outputs', String(program.lanes.length)],
  ]);
}

// A table that was made after a diagnosis: what it is for, and its two files for `darm record`.
function showOrigin() {
  const origin = program?.origin ?? null;
  byId('origin').hidden = !origin;
  if (!origin) return;
  const after = origin.diagnosed ? ` after the diagnosis of ${origin.diagnosed}` : '';
  setText(byId('origin-text'), `Made with model ${origin.model}${after}: ${origin.n_visits} visits in ${seconds(program.end_s)}. `
    + 'Upload it, then play it, or record it below. In a terminal, with both files saved:');
  setText(byId('origin-command'), `darm upload ${program.name} && darm record ${program.name} -o run-${origin.model}.csv`);
}

async function saveFile(part, name, type) {
  try {
    save(name, await getBytes(`/api/program/${part}`), type);
    setText(byId('saved'), `Wrote ${name} to the downloads of this browser.`);
  } catch (error) {
    showAlert(error.message);
  }
}

// ---------------------------------------------------------------- make a table

// The order of the rows is the order of the lines; what is not a word is refused with its text.
async function makeTable(request) {
  showAlert(null);
  setText(byId('make-note'), 'Planning …');
  try {
    const made = await post('/api/plan', request, { timeoutMs: 120_000 });
    setText(byId('make-note'), `${made.name}: ${made.n_visits} visits, opened above.`);
  } catch (error) {
    setText(byId('make-note'), `No table: ${error.message}`);
  }
}

byId('make-plan').addEventListener('click', () => makeTable({ of: 'plan' }));
byId('make-words').addEventListener('click', () => {
  const words = byId('words').value.split('\n').map((line) => line.trim()).filter(Boolean);
  const dwell = byId('dwell').value;
  makeTable({ of: 'words', words, dwell_s: dwell === '' ? null : Number(dwell) });
});

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
  await order('/api/record', { table: program.digest, name: byId('record-name').value });
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
  const why = !program?.origin ? 'A table that was opened as a file has no visit file: record it with darm record.'
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
  const link = make('a', { href: `/diagnosis?data=${encodeURIComponent(last.name)}` }, 'Diagnose it');
  result.replaceChildren(`${last.name}: ${last.text}. `, ...(last.is_complete ? [link] : []));
}

byId('save-table').addEventListener('click', () => saveFile('table', program.name, 'application/octet-stream'));
byId('save-visits').addEventListener('click', () => saveFile('visits', program.origin.visits_name, 'text/csv'));

async function fetchProgram(number) {
  shown = number;
  program = await get('/api/program');
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
}

byId('upload').addEventListener('click', async () => {
  isUploading = true;
  await act('/api/upload', { table: program.digest });
  isUploading = false;
});
byId('play').addEventListener('click', () => act('/api/command', { do: 'play', table: program.digest }));

function running(board) {
  const { phase } = board;
  const names = { idle: 'idle', manual: 'moved by hand', approaching: 'going to the first row', playing: 'playing', safe: 'safe state' };
  const row = phase.name === 'playing' ? `, row ${phase.row} of ${board.rows}, ${phase.since_s.toFixed(1)} s` : '';
  const fault = phase.fault ? `: ${phase.fault.text}` : '';
  return names[phase.name] + row + fault;
}

function show(now) {
  live = now;
  const { board, upload } = live;
  if (live.program !== shown) fetchProgram(live.program).catch(() => { shown = -1; });
  const isReady = program?.digest && board && !isUploading;
  const isLoaded = isReady && board.table === program.digest;
  for (const [id, isPossible] of [['upload', isReady], ['play', isLoaded]]) {
    const button = byId(id);
    button.disabled = !isPossible || !hasControl() || live.link.state !== 'live';
  }
  const loaded = isLoaded ? 'The board has this table.' : `The board has ${board?.table ? `table ${short(board.table)}` : 'no table'}.`;
  const need = hasControl() ? '' : ' Take control to upload and play.';
  setText(byId('table-note'), board ? loaded + need : '');
  showRecording(Boolean(isLoaded));
  byId('upload-progress').hidden = !upload;
  if (upload) byId('progress').value = upload.total ? upload.done / upload.total : 0;
  if (!board) return;
  setText(byId('running'), running(board));
  timeline.setTime(isLoaded && board.phase.name === 'playing' && live.link.state === 'live' ? board.phase.since_s : null);
}

// Names of the actuators; without an arm there are none.
async function fetchNames() {
  try {
    const arm = await get('/api/arm');
    byId('make-section').hidden = !arm;
    names = arm?.actuators.map((actuator) => actuator.name) ?? [];
    if (program) showProgram(program.refusal);
  } catch {
    setTimeout(fetchNames, 500);
  }
}

onLive(show);
fetchNames();
fetchTaken();
window.addEventListener('resize', () => program && showProgram(program.refusal));
follow();
