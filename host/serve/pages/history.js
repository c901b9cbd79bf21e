// The page of the history: what the server has seen, newest first, and files of it.

import { get, getBytes } from './server.js';
import { follow } from './frame.js';
import { byId, make, save, seconds, setText, short, titleCells } from './format.js';

const when = (ms) => (ms === null ? '–' : new Date(ms).toLocaleString('sv'));
const OUTCOMES = { running: '… running', finished: '✓ finished', stopped: '■ stopped', fault: '✕ fault', unknown: '? end not seen' };

let shown = null;

// ---------------------------------------------------------------- parts

const digest = (text) => (text ? make('code', { title: text }, short(text).slice(0, 12)) : 'none');

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
    OUTCOMES[run.outcome] + (run.cause ? `: ${run.cause}` : ''), String(run.rows), digest(run.table), digest(run.model),
    `${run.board} ${run.device}`, button('Events', `Events of run ${run.id}`, () => showEvents(run)),
  ]), 'No table was played yet.');
}

const showEvents = (run) => attempt(async () => {
  const events = await get(`/api/history/events?id=${run.id}`);
  byId('events-section').hidden = false;
  setText(byId('events-title'), `Events of the run that began ${when(run.started_ms)}`);
  byId('events').replaceChildren(...events.map((event) =>
    make('li', { className: event.kind, value: event.number }, make('time', {}, `${event.at_s.toFixed(3)} s`), ` ${event.text}`)));
  byId('events-title').focus();
});

function showDiagnoses(diagnoses) {
  fill('diagnoses', diagnoses.map((diagnosis) => [
    when(diagnosis.at_ms), digest(diagnosis.model), [diagnosis.data_name, ' ', digest(diagnosis.data_digest)],
    make('span', { className: 'wide' }, make('b', {}, diagnosis.verdict), ` ${diagnosis.summary}`), digest(diagnosis.corrected),
    button('JSON', `JSON of diagnosis ${diagnosis.id}`, () =>
      download(`/api/history/diagnosis?id=${diagnosis.id}`, `diagnosis-${diagnosis.id}.json`, 'application/json')),
  ]), 'Nothing was diagnosed yet.');
}

function showTables(tables) {
  fill('tables', tables.map((table) => [
    when(table.seen_ms), table.name, digest(table.digest), digest(table.model), String(table.rows), seconds(table.end_s),
    button('.darm', `.darm of table ${table.name} ${short(table.digest)}`, () =>
      download(`/api/history/table?digest=${table.digest}`, table.name, 'application/octet-stream')),
  ]), 'No table was brought to a board yet.');
}

function showUploads(uploads) {
  fill('uploads', uploads.map((upload) => [
    when(upload.at_ms), upload.name, digest(upload.table), digest(upload.model), `${upload.board} ${upload.device}`,
  ]), 'No table was uploaded yet.');
}

// A tree: each model above those that were corrected from it.
function showModels(models, runs, diagnoses) {
  const known = new Set(models.map((model) => model.digest));
  const roots = models.filter((model) => !known.has(model.parent));
  const item = (model, above) => {
    const [n_runs, n_diagnoses] = [runs, diagnoses].map((entries) => entries.filter((entry) => entry.model === model.digest).length);
    const children = models.filter((other) => other.parent === model.digest && !above.includes(other.digest));
    const file = button('.toml', `.toml of model ${model.number ?? ''} ${short(model.digest)}`, () => attempt(async () => {
      const name = model.name.endsWith('.toml') ? model.name : `${model.name}.toml`;
      save(name, await get(`/api/history/model?digest=${model.digest}`), 'application/toml');
      wrote(name);
    }));
    file.hidden = !model.has_file;
    const list = children.length ? [make('ul', {}, ...children.map((child) => item(child, [...above, model.digest])))] : [];
    return make('li', {}, make('b', {}, model.number === null ? 'model' : `model ${model.number}`), ` ${model.name} `, digest(model.digest),
      ` since ${when(model.seen_ms)}, ${n_runs} runs, ${n_diagnoses} diagnoses `, file, ...list);
  };
  const list = make('ul', { className: 'lineage' }, ...roots.map((model) => item(model, [])));
  byId('lineage').replaceChildren(models.length ? list : make('p', {}, 'No model was seen yet.'));
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
