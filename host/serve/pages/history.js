// The page of the history: what the server has seen, newest first, and files of it.

import { get, getBytes } from './server.js';
import { follow } from './frame.js';
import { byId, clock, make, modelName, save, seconds, setText, short, titleCells } from './format.js';

const when = (ms) => (ms === null ? '–' : new Date(ms).toLocaleString('sv'));
const OUTCOMES = { running: '… running', finished: '✓ finished', stopped: '■ stopped', fault: '✕ fault', unknown: '? end not seen' };

let shown = null;

// ---------------------------------------------------------------- parts

const digest = (text) => (text ? make('code', { title: text }, short(text)) : 'none');

// A model by file, number and digest, where the history has it.
function model(text) {
  const known = shown.models.find((one) => one.digest === text);
  return known ? [`${modelName(known)} `, digest(text)] : digest(text);
}

// Two models may have files of one name.
function fileName(one) {
  const name = one.name.endsWith('.toml') ? one.name : `${one.name}.toml`;
  const isAlone = shown.models.filter((other) => other.name === one.name).length === 1;
  return isAlone ? name : name.replace(/\.toml$/, `-${short(one.digest)}.toml`);
}

// Rows of a table; on a narrow page each is a card that repeats the titles.
function fill(id, rows, none) {
  const body = byId(id);
  const titles = [...body.closest('table').querySelectorAll('th')].map((th) => th.textContent);
  const cell = (content) => make('td', {}, ...[content].flat());
  const empty = make('tr', {}, make('td', { colSpan: titles.length }, none));
  body.replaceChildren(...(rows.length ? rows.map((row) => make('tr', {}, ...row.map(cell))) : [empty]));
  if (rows.length) titleCells(body.closest('table'));
}

function button(text, label, act) {
  const made = make('button', { type: 'button', className: 'small', ariaLabel: label }, text);
  made.addEventListener('click', act);
  return made;
}

async function attempt(act) {
  try {
    await act();
  } catch (error) {
    setText(byId('note'), error.message);
  }
}

function wrote(name) {
  setText(byId('note'), `Wrote ${name} to the downloads of this browser.`);
}

const download = (path, name, type) => attempt(async () => {
  save(name, await getBytes(path), type);
  wrote(name);
});

// ---------------------------------------------------------------- kinds

function showRuns(runs) {
  fill('runs', runs.map((run) => [
    when(run.started_ms), run.ended_ms === null ? '–' : seconds(1e-3 * (run.ended_ms - run.started_ms)),
    OUTCOMES[run.outcome] + (run.cause ? `: ${run.cause}` : ''), String(run.rows), digest(run.table), model(run.model),
    `${run.board} ${run.device}`, button('Events', `Events of run ${run.id}`, () => showEvents(run)),
  ]), 'No run yet: a run is a table that the board plays, from the pages Live and Program or by the command darm play, while this server runs.');
}

const showEvents = (run) => attempt(async () => {
  const events = await get(`/api/history/events?id=${run.id}`);
  byId('events-section').hidden = false;
  setText(byId('events-title'), `Events of the run that began ${when(run.started_ms)}`);
  byId('events').replaceChildren(...events.map((event) =>
    make('li', { className: event.kind, value: event.number }, make('time', {}, clock(event.at_s)), ` ${event.text}`)));
  byId('events-title').focus();
});

function showDiagnoses(diagnoses) {
  fill('diagnoses', diagnoses.map((diagnosis) => [
    when(diagnosis.at_ms), model(diagnosis.model), [diagnosis.data_name, ' ', digest(diagnosis.data_digest)],
    make('span', { className: 'wide' }, make('b', {}, diagnosis.verdict), ` ${diagnosis.summary}`), model(diagnosis.corrected),
    button('JSON', `JSON of diagnosis ${diagnosis.id}`, () =>
      download(`/api/history/diagnosis?id=${diagnosis.id}`, `diagnosis-${diagnosis.id}.json`, 'application/json')),
  ]), 'No diagnosis yet: the page Diagnosis makes them.');
}

function showTables(tables) {
  fill('tables', tables.map((table) => [
    when(table.seen_ms), table.name, digest(table.digest), model(table.model), String(table.rows), seconds(table.end_s),
    button('.darm', `.darm of table ${table.name} ${short(table.digest)}`, () =>
      download(`/api/history/table?digest=${table.digest}`, table.name, 'application/octet-stream')),
  ]), 'No table yet: the page Program uploads them.');
}

function showUploads(uploads) {
  fill('uploads', uploads.map((upload) => [
    when(upload.at_ms), upload.name, digest(upload.table), model(upload.model), `${upload.board} ${upload.device}`,
  ]), 'No table was uploaded yet.');
}

// A tree: each model above those that were corrected from it.
function showModels(models, runs, diagnoses) {
  const known = new Set(models.map((model) => model.digest));
  const roots = models.filter((model) => !known.has(model.parent));
  const item = (one, above) => {
    const count = (entries, what, many) => {
      const n = entries.filter((entry) => entry.model === one.digest).length;
      return `${n} ${n === 1 ? what : many}`;
    };
    const children = models.filter((other) => other.parent === one.digest && !above.includes(other.digest));
    const made = diagnoses.find((diagnosis) => diagnosis.corrected === one.digest);
    const file = button('.toml', `File of ${modelName(one)}, ${short(one.digest)}`, () => attempt(async () => {
      save(fileName(one), await get(`/api/history/model?digest=${one.digest}`), 'application/toml');
      wrote(fileName(one));
    }));
    file.hidden = !one.has_file;
    const list = children.length ? [make('ul', {}, ...children.map((child) => item(child, [...above, one.digest])))] : [];
    return make('li', {}, make('b', {}, modelName(one)), ' ', digest(one.digest), made ? ` corrected after ${made.data_name}` : '',
      ` since ${when(one.seen_ms)}, ${count(runs, 'run', 'runs')}, ${count(diagnoses, 'diagnosis', 'diagnoses')} `, file, ...list);
  };
  const list = make('ul', { className: 'lineage' }, ...roots.map((root) => item(root, [])));
  byId('lineage').replaceChildren(models.length ? list : make('p', {}, 'No model yet: that of the server is entered when it starts with one, others by a diagnosis.'));
}

// ---------------------------------------------------------------- all of it

async function refresh() {
  shown = await get('/api/history', 10_000);
  byId('none').hidden = Boolean(shown);
  byId('history').hidden = !shown;
  if (!shown) return;
  byId('problem').hidden = !shown.problem;
  setText(byId('problem'), shown.problem ? `The last entry could not be written: ${shown.problem}` : '');
  setText(byId('file'), shown.file);
  showRuns(shown.runs);
  showDiagnoses(shown.diagnoses);
  showModels(shown.models, shown.runs, shown.diagnoses);
  showTables(shown.tables);
  showUploads(shown.uploads);
}

byId('json').addEventListener('click', () => download('/api/history/export', 'darm-history.json', 'application/json'));
for (const csv of document.querySelectorAll('[data-csv]')) {
  csv.addEventListener('click', () => download(`/api/history/export?of=${csv.dataset.csv}`, `darm-${csv.dataset.csv}.csv`, 'text/csv'));
}
byId('refresh').addEventListener('click', () => attempt(async () => {
  await refresh();
  setText(byId('note'), 'Refreshed.');
}));

async function start() {
  try {
    await refresh();
  } catch {
    setTimeout(start, 500);
  }
}
start();
follow();
