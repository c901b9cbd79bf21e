// The page of the program: opens a table, shows when each output is on and what is refused, uploads and plays it.

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
  setText(byId('origin-text'), `Made with model ${origin.model} after the diagnosis of ${origin.diagnosed}: ${origin.n_visits} visits in ${seconds(program.end_s)}. `
    + 'Upload and play it here to see it, or measure it: save both files, end darm serve, which has the port, and run');
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
  byId('upload-progress').hidden = !upload;
  if (upload) byId('progress').value = upload.total ? upload.done / upload.total : 0;
  if (!board) return;
  setText(byId('running'), running(board));
  timeline.setTime(isLoaded && board.phase.name === 'playing' && live.link.state === 'live' ? board.phase.since_s : null);
}

// Names of the actuators; without an arm there are none.
async function fetchNames() {
  try {
    names = (await get('/api/arm'))?.actuators.map((actuator) => actuator.name) ?? [];
    if (program) showProgram(program.refusal);
  } catch {
    setTimeout(fetchNames, 500);
  }
}

onLive(show);
fetchNames();
window.addEventListener('resize', () => program && showProgram(program.refusal));
follow();
