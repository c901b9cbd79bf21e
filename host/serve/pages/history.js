// The page of the history: what the server has seen, newest first, and files of it.

import { get, getBytes, post } from './server.js';
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

// A table by the name that a person gave it or its file, and digest.
function table(text) {
  const known = shown.tables.find((one) => one.digest === text);
  return known ? [`${known.label ?? known.name} `, digest(text)] : digest(text);
}

// Where an entry is given a name. Kinds are as in the address of an export.
function nameField(of, one, what) {
  const entry = String(one.id ?? one.digest);
  const field = make('input', { className: 'label', value: one.label ?? '', maxLength: 60, autocomplete: 'off', spellcheck: false, ariaLabel: `Name of ${what}` });
  field.addEventListener('change', () => attempt(async () => {
    await post('/api/history/name', { of, entry, name: field.value }, { timeoutMs: 10_000 });
    one.label = field.value.trim() || null;
    setText(byId('note'), one.label ? `${what} is called ${one.label}.` : `${what} has no name.`);
    show();
  }));
  return field;
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
    [nameField('runs', run, `run ${run.id}`), when(run.started_ms)], run.ended_ms === null ? '–' : seconds(1e-3 * (run.ended_ms - run.started_ms)),
    OUTCOMES[run.outcome] + (run.cause ? `: ${run.cause}` : ''), String(run.rows), table(run.table), model(run.model),
    `${run.board} ${run.device}`, button('Events', `Events of run ${run.id}`, () => showEvents(run)),
  ]), 'No run yet: a run is a table that the board plays, from the pages Live and Program or by the command darm play, while this server runs.');
}

const showEvents = (run) => attempt(async () => {
  const events = await get(`/api/history/events?id=${run.id}`);
  byId('events-section').hidden = false;
  setText(byId('events-title'), `Events of the run ${run.label ? `${run.label}, ` : ''}that began ${when(run.started_ms)}`);
  byId('events').replaceChildren(...events.map((event) =>
    make('li', { className: event.kind, value: event.number }, make('time', {}, clock(event.at_s)), ` ${event.text}`)));
  byId('events-title').focus();
});

function showDiagnoses(diagnoses) {
  fill('diagnoses', diagnoses.map((diagnosis) => [
    [nameField('diagnoses', diagnosis, `diagnosis ${diagnosis.id}`), when(diagnosis.at_ms)], model(diagnosis.model), [diagnosis.data_name, ' ', digest(diagnosis.data_digest)],
    make('span', { className: 'wide' }, make('b', {}, diagnosis.verdict), ` ${diagnosis.summary}`), model(diagnosis.corrected),
    [...(diagnosis.has_result ? [make('a', { href: `/diagnosis?result=${diagnosis.id}`, ariaLabel: `Open diagnosis ${diagnosis.id}` }, 'Open'), ' '] : []),
      button('JSON', `JSON of diagnosis ${diagnosis.id}`, () =>
        download(`/api/history/diagnosis?id=${diagnosis.id}`, `diagnosis-${diagnosis.id}.json`, 'application/json'))],
  ]), 'No diagnosis yet: the page Diagnosis makes them.');
}

function showTables(tables) {
  fill('tables', tables.map((table) => [
    [nameField('tables', table, `table ${short(table.digest)}`), when(table.seen_ms)], table.name, digest(table.digest), model(table.model), String(table.rows), seconds(table.end_s),
    button('.darm', `.darm of table ${table.name} ${short(table.digest)}`, () =>
      download(`/api/history/table?digest=${table.digest}`, table.name, 'application/octet-stream')),
  ]), 'No table yet: the page Program uploads them.');
}

function showUploads(uploads) {
  fill('uploads', uploads.map((upload) => [
    when(upload.at_ms), upload.label ? `${upload.label} · ${upload.name}` : upload.name, digest(upload.table), model(upload.model), `${upload.board} ${upload.device}`,
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
    return make('li', {}, nameField('models', one, `model ${short(one.digest)}`), ' ', make('b', {}, modelName(one)), ' ', digest(one.digest), made ? ` corrected after ${made.label ?? made.data_name}` : '',
      ` since ${when(one.seen_ms)}, ${count(runs, 'run', 'runs')}, ${count(diagnoses, 'diagnosis', 'diagnoses')} `, file, ...list);
  };
  const list = make('ul', { className: 'lineage' }, ...roots.map((root) => item(root, [])));
  byId('lineage').replaceChildren(models.length ? list : make('p', {}, 'No model yet: that of the server is entered when it starts with one, others by a diagnosis.'));
}

// ---------------------------------------------------------------- two entries side by side

const COMPARED = ['first', 'second'];

function showChoices() {
  const groups = [
    ['Diagnoses', 'diagnoses', shown.diagnoses.map((one) => [one.id, `${one.label ?? `${one.data_name}, ${one.verdict}`}, ${when(one.at_ms)}`])],
    ['Models', 'models', shown.models.filter((one) => one.has_file).map((one) => [one.digest, `${modelName(one)}, ${short(one.digest)}`])],
  ];
  for (const id of COMPARED) {
    const [select, { value }] = [byId(id), byId(id)];
    select.replaceChildren(select.options[0], ...groups.map(([label, of, entries]) => make('optgroup', { label },
      ...entries.map(([entry, text]) => make('option', { value: `of=${of}&entry=${entry}` }, text)))));
    select.value = value;
  }
  compare();
}

const compare = () => attempt(async () => {
  const chosen = COMPARED.map((id) => byId(id).value);
  byId('compare-scroll').hidden = chosen.includes('');
  setText(byId('compare-note'), '');
  if (chosen.includes('')) return;
  const sides = await Promise.all(chosen.map((one) => get(`/api/history/numbers?${one}`, 10_000)));
  if (chosen.some((one, side) => byId(COMPARED[side]).value !== one)) return;
  const [first, second] = sides.map((lines) => new Map(lines.map(({ name, text }) => [name, text])));
  const names = [...new Set([...first.keys(), ...second.keys()])];
  const differs = (name) => first.get(name) !== second.get(name);
  COMPARED.forEach((id, side) => setText(byId('compared').tHead.rows[0].cells[side + 1], byId(id).selectedOptions[0].textContent));
  byId('compared').tBodies[0].replaceChildren(...names.map((name) => make('tr', { className: differs(name) ? 'differs' : '' },
    make('th', { scope: 'row' }, name), make('td', {}, first.get(name) ?? '–'), make('td', {}, second.get(name) ?? '–'), make('td', {}, differs(name) ? '≠' : ''))));
  setText(byId('compare-note'), `${names.filter(differs).length} of ${names.length} numbers differ.`);
});

for (const id of COMPARED) byId(id).addEventListener('change', compare);

// ---------------------------------------------------------------- all of it

async function refresh() {
  shown = await get('/api/history', 10_000);
  byId('none').hidden = Boolean(shown);
  byId('history').hidden = !shown;
  if (shown) show();
}

// The focus, and what is being typed there, stay.
function show() {
  const { ariaLabel, value } = document.activeElement;
  byId('problem').hidden = !shown.problem;
  setText(byId('problem'), shown.problem ? `The last entry could not be written: ${shown.problem}` : '');
  setText(byId('file'), shown.file);
  showRuns(shown.runs);
  showDiagnoses(shown.diagnoses);
  showModels(shown.models, shown.runs, shown.diagnoses);
  showTables(shown.tables);
  showUploads(shown.uploads);
  showChoices();
  const focused = ariaLabel && [...byId('history').querySelectorAll('[aria-label]')].find((one) => one.ariaLabel === ariaLabel);
  if (!focused || focused === document.activeElement) return;
  focused.focus();
  if (focused instanceof HTMLInputElement) focused.value = value;
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
