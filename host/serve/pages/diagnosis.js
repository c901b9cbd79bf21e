// The page of the diagnosis: sends model and measurements, shows how far the diagnosis is, then the report.

import { get, getBytes, post } from './server.js';
import { follow } from './frame.js';
import { byId, make, modelName, save, setText, short, titleCells } from './format.js';
import { Columns } from './columns.js';
import { Zoom } from './zoom.js';

const STAGES = {
  read: 'Reading the files', prepare: 'Preparing the rows', select: 'Searching for missing effects', judge: 'Judging what was found',
};
const POLL_MS = 300;
const INPUTS = ['model', 'data', 'more'];
const MB = 1 << 20;

const maxBytes = Number(byId('files').dataset.maxBytes);
let running = null;
let result = null;
let models = [];
const columns = new Columns();

// ---------------------------------------------------------------- files

const chosen = () => Object.fromEntries(INPUTS.map((id) => [id, [...byId(id).files]]));

function showFiles() {
  const { model: [model], data: [data], more } = chosen();
  const hasModel = Boolean(model || byId('known').value);
  const files = [model, data, ...more].filter(Boolean);
  const bytes = files.reduce((sum, file) => sum + file.size, 0);
  const isTooLarge = bytes > maxBytes;
  const missing = !hasModel ? 'Choose a model.' : !data ? 'Choose measurements.' : '';
  const large = `${(bytes / MB).toFixed(1)} MB are too large: at most ${maxBytes / MB} MB; diagnose on the command line, or leave rows out.`;
  setText(byId('files-note'), isTooLarge ? large : files.length ? missing : '');
  byId('diagnose').disabled = Boolean(missing) || isTooLarge || running !== null;
  byId('cancel').disabled = running === null;
  showReplayLink();
}

function assign(id, files) {
  const list = new DataTransfer();
  for (const file of files) list.items.add(file);
  byId(id).files = list.files;
}

// Measurements and robots are known by their names; of several TOML files the first is the model.
function sort(files) {
  const ends = (file, ...known) => known.some((end) => file.name.toLowerCase().endsWith(end));
  const robots = files.filter((file) => ends(file, '.urdf', '.xml'));
  const tomls = files.filter((file) => ends(file, '.toml'));
  const data = files.filter((file) => !robots.includes(file) && !tomls.includes(file));
  const [model, ...more] = [...tomls, ...robots];
  if (model) {
    assign('model', [model]);
    assign('more', more);
  }
  if (model) byId('known').value = '';
  if (data.length) {
    byId('recordings').value = '';
    assign('data', data.slice(0, 1));
    columns.look(data[0]);
  }
  showFiles();
}

// A chosen file and a model of the server exclude each other.
byId('model').addEventListener('change', () => { if (byId('model').files.length) byId('known').value = ''; });
byId('known').addEventListener('change', () => {
  if (byId('known').value) assign('model', []);
  showFiles();
});
byId('data').addEventListener('change', () => {
  byId('recordings').value = '';
  columns.look(byId('data').files[0] ?? null);
});

// The link next to the measurements of this server: to the chosen one, else to the list.
function showReplayLink() {
  const { value: name, hidden } = byId('recordings');
  Object.assign(byId('replay-link'), { hidden, href: name ? `/replay?data=${encodeURIComponent(name)}` : '/replay' });
  setText(byId('replay-link'), name ? `Replay ${name}` : 'Replay one of this server');
}

// Measurements that pages of this server have recorded. The page Program names one in the address.
async function showRecordings() {
  const files = await get('/api/data');
  const select = byId('recordings');
  select.hidden = files.length === 0;
  select.replaceChildren(select.options[0], ...files.map((file) => make('option', { value: file.name },
    `${file.name}, ${new Date(file.at_ms).toLocaleString('sv')}`)));
  showFiles();
  const wanted = new URLSearchParams(location.search).get('data');
  if (!files.some((file) => file.name === wanted)) return;
  select.value = wanted;
  await takeRecording();
}

async function takeRecording() {
  const name = byId('recordings').value;
  if (!name) return;
  try {
    const file = new File([await getBytes(`/api/data/${encodeURIComponent(name)}`)], name, { type: 'text/csv' });
    assign('data', [file]);
    columns.look(file);
  } catch (error) {
    byId('recordings').value = '';
    showFailure(error.message);
  }
  showFiles();
}

byId('recordings').addEventListener('change', takeRecording);
showRecordings().catch(() => {});
for (const id of INPUTS) byId(id).addEventListener('change', showFiles);
// A file that is dropped beside the field would replace the page.
for (const type of ['dragover', 'drop']) window.addEventListener(type, (event) => event.preventDefault());
const drop = byId('drop');
for (const type of ['dragenter', 'dragover']) drop.addEventListener(type, () => drop.classList.add('over'));
for (const type of ['dragleave', 'drop']) drop.addEventListener(type, () => drop.classList.remove('over'));
window.addEventListener('drop', (event) => sort([...event.dataTransfer.files]));

// A line that lists the files, then their bytes.
function body() {
  const { model: [model], data: [data], more } = chosen();
  const named = (file) => ({ name: file.name, bytes: file.size });
  const given = model ? { model: named(model) } : { known: byId('known').value };
  const head = { ...given, data: named(data), more: more.map(named), columns: columns.given(), other_model: byId('other-model').value === 'accept' };
  return new Blob([`${JSON.stringify(head)}\n`, ...(model ? [model] : []), data, ...more]);
}

// The arm of the server, and models of its history: a corrected one too.
async function showModels() {
  models = await get('/api/diagnosis/models', 10_000);
  const select = byId('known');
  const [before, isFirst] = [select.value, select.options.length === 1];
  const isAlone = (model) => models.filter((other) => other.name === model.name).length === 1;
  const origin = ({ effect, data, at_ms }) => [effect, `after ${data}`, new Date(at_ms).toLocaleTimeString('sv').slice(0, 5)].filter(Boolean).join(', ');
  const end = (model) => (model.origin && !isAlone(model) ? origin(model.origin) : short(model.digest));
  const label = (model) => `${modelName(model)}, ${end(model)}${model.is_served ? ' (arm of this server)' : ''}`;
  select.replaceChildren(select.options[0], ...models.map((model) => make('option', { value: model.digest }, label(model))));
  const served = models.find((model) => model.is_served);
  select.value = isFirst && served && !byId('model').files.length ? served.digest : before;
  offerRecorded();
  showFiles();
  showTables();
}

// The model whose table was recorded, where the measurements name it: it is chosen, unless a person has chosen a file.
function offerRecorded() {
  const recorded = columns.shown?.model ?? null;
  const note = byId('recorded');
  note.hidden = !recorded;
  if (!recorded) return;
  const model = models.find((one) => one.digest === recorded);
  const isFile = byId('model').files.length > 0;
  if (model && !isFile) byId('known').value = recorded;
  const chosen = isFile ? 'A file is chosen above' : 'It is chosen above';
  setText(note, model ? `Recorded with a table of ${modelName(model)}, ${short(recorded)}. ${chosen}.`
    : `Recorded with a table of model ${short(recorded)}, which this server does not have: choose its file, or a model of the same arm with other effects.`);
  showFiles();
}

columns.seen = offerRecorded;

// ---------------------------------------------------------------- the diagnosis

function showFailure(text) {
  byId('failure').hidden = !text;
  setText(byId('failure'), text ?? '');
}

async function showProgress() {
  while (running) {
    try {
      const { running: now } = await get('/api/diagnosis');
      const tried = now?.tried ? `, ${now.tried} models tried` : '';
      if (!now || !running) continue;
      // Apart from the stage, which a screen reader says when it changes.
      setText(byId('progress-text'), STAGES[now.stage]);
      setText(byId('tried'), tried);
    } catch {
      // The frame says that the server does not answer.
    } finally {
      await new Promise((wake) => setTimeout(wake, POLL_MS));
    }
  }
}

async function diagnose() {
  showFailure(null);
  running = new AbortController();
  setText(byId('progress-text'), 'Sending the files');
  setText(byId('tried'), '');
  byId('progress').hidden = false;
  showFiles();
  showProgress();
  try {
    show(await post('/api/diagnosis/run', body(), { signal: running.signal }));
    byId('verdict-section').focus();
    showModels().catch(() => {});
  } catch (error) {
    // A verdict on other files would be read as theirs.
    if (!running.signal.aborted) show(null);
    const former = result ? `. The result below is of ${result.model} and ${result.data}.` : '';
    showFailure((running.signal.aborted ? 'The diagnosis was cancelled' : error.message) + former);
  }
  running = null;
  byId('progress').hidden = true;
  showFiles();
}

byId('files').addEventListener('submit', (event) => {
  event.preventDefault();
  diagnose();
});
byId('cancel').addEventListener('click', () => running?.abort());

// ---------------------------------------------------------------- the result

// A diagnosis of the history as it was. The next measurement is made after a new one: its model is not at hand here.
async function showStored(id) {
  try {
    const kept = await get(`/api/history/result?id=${encodeURIComponent(id)}`, 10_000);
    if (running) return;
    show({ ...kept, n_words: 0, has_plan: false, isStored: true });
    byId('verdict-section').focus();
  } catch (error) {
    showFailure(error.message);
  }
}

function show(shown) {
  result = shown;
  byId('actions').hidden = !result;
  if (!result) {
    // Behind the actions, which stand within a result.
    byId('result').before(byId('actions'));
    byId('result').replaceChildren();
    return;
  }
  setText(byId('result-files'), `${result.model} and ${result.data}${result.isStored ? ', from the history' : ''}`);
  // What can be done stands behind the verdict.
  byId('result').before(byId('actions'));
  byId('result').innerHTML = result.html;
  for (const table of byId('result').querySelectorAll('table:has(thead):not(.candidates)')) {
    table.classList.add('cards');
    titleCells(table);
  }
  byId('verdict-section').after(byId('actions'));
  for (const table of byId('result').querySelectorAll('table')) {
    const frame = make('div', { className: 'scroll', tabIndex: 0, role: 'region', ariaLabel: `Table: ${headingOf(table)}` });
    table.replaceWith(frame);
    frame.append(table);
  }
  for (const svg of byId('result').querySelectorAll('svg[role="img"]')) new Zoom(svg, headingOf(svg));
  byId('write').disabled = !result.corrected;
  setText(byId('write'), result.corrected ? `Write model ${result.corrected.number}` : 'No corrected model');
  byId('words').hidden = result.n_words === 0;
  byId('plan').hidden = !result.has_plan;
  setText(byId('actions-note'), '');
  showTables();
}

// A table is made for the board of the arm that the server has.
function showTables() {
  const hasArm = models.some((model) => model.is_served);
  for (const id of ['words', 'plan']) byId(id).disabled = !hasArm;
  byId('no-table').hidden = hasArm || !result || (byId('words').hidden && byId('plan').hidden);
}

// The table for the board of this server: it is open on the page Program, where its files can be saved too.
async function makeTable(button, of) {
  setText(byId('actions-note'), 'Making the table …');
  button.disabled = true;
  try {
    await post('/api/diagnosis/table', { result: result.number, of }, { timeoutMs: 60_000 });
    location.assign('/program');
  } catch (error) {
    setText(byId('actions-note'), error.message);
    button.disabled = false;
  }
}

function headingOf(element) {
  const headings = [...byId('result').querySelectorAll('h2, h3, h4')];
  const before = headings.filter((heading) => heading.compareDocumentPosition(element) & Node.DOCUMENT_POSITION_FOLLOWING);
  return before.at(-1)?.textContent ?? '';
}

for (const of of ['words', 'plan']) byId(of).addEventListener('click', () => makeTable(byId(of), of));

byId('write').addEventListener('click', () => {
  const { name, text } = result.corrected;
  save(name, text, 'application/toml');
  const isKept = models.some((model) => model.name === name && model.number === result.corrected.number);
  const kept = isKept ? ' It is also among the models above, for the next diagnosis, and on the page History.' : '';
  setText(byId('actions-note'), `Wrote ${name} to the downloads of this browser.${kept}`);
});

showFiles();
showModels().catch(() => {});
// The last result is there when the page is opened again.
const stored = new URLSearchParams(location.search).get('result');
if (stored) showStored(stored);
else get('/api/diagnosis/result').then((last) => running || show(last)).catch(() => {});
follow();
