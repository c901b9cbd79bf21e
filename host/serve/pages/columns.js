// What the measurements have: how their columns are read, and how they can be read otherwise.

import { post } from './server.js';
import { byId, make, setText } from './format.js';

// Units whose names in files are not their symbols.
const SYMBOLS = {
  n: 'N', kn: 'kN', nm: 'N·m', mnm: 'mN·m', ncm: 'N·cm', nmm: 'N·mm', pa: 'Pa', hpa: 'hPa', kpa: 'kPa', mpa: 'MPa', psi: 'psi', a: 'A', ma: 'mA',
  v: 'V', mv: 'mV', k: 'K', c: '°C', us: 'µs', um: 'µm', deg: '°', rad_s: 'rad/s', deg_s: '°/s', rad_s2: 'rad/s²', deg_s2: '°/s²', m_s: 'm/s',
  mm_s: 'mm/s', m_s2: 'm/s²', mm_s2: 'mm/s²', rpm: '1/min',
};
const unitLabel = (unit) => SYMBOLS[unit] ?? unit;
const [holdsOf, unitOf] = [(row) => row.querySelector('.holds'), (row) => row.querySelector('.unit')];
// Rows are not numbered in place of it: effects over time would be tested against a time that nobody measured.
const NO_TIME = 'Where the file has none, add a column time_s, when each row was measured in s from the first one: drift, creep and '
  + 'steps are tested over time, and rows are held out by it. darm record writes it.';
const number = (value) => String(Number(value.toPrecision(6)));

export class Columns {
  constructor() {
    this.file = null;
    this.shown = null;
    this.isEdited = false;
    this.asking = null;
    // Called when a file was looked into.
    this.seen = () => {};
  }

  // Looks into a file; `null` where there is none.
  look(file) {
    [this.file, this.shown, this.isEdited] = [file, null, false];
    byId('log').hidden = !file;
    byId('columns').replaceChildren();
    if (file) this.ask();
    else this.seen();
  }

  // How the columns are read, where their names do not say it.
  given() {
    return this.shown && (this.shown.is_converted || this.isEdited) ? this.fields() : [];
  }

  fields() {
    return [...byId('columns').rows].map((row) => ({
      column: row.dataset.column, quantity: holdsOf(row).value, unit: unitOf(row).value,
    }));
  }

  async ask() {
    this.asking?.abort();
    const asking = new AbortController();
    this.asking = asking;
    const head = { data: { name: this.file.name, bytes: this.file.size }, columns: this.isEdited ? this.fields() : [] };
    setText(byId('log-text'), 'Reading the file …');
    try {
      const view = await post('/api/diagnosis/log', new Blob([`${JSON.stringify(head)}\n`, this.file]), { signal: asking.signal });
      if (this.asking === asking) this.show(view);
    } catch (error) {
      if (asking.signal.aborted) return;
      this.shown = null;
      byId('log-details').hidden = true;
      for (const id of ['log-problems', 'log-notes']) byId(id).replaceChildren();
      setText(byId('log-text'), error.message);
    }
  }

  show(view) {
    const isFirst = this.shown === null;
    this.shown = view;
    if (isFirst) this.seen();
    byId('log-details').hidden = false;
    const source = view.is_converted ? ', a recording of another program that is converted' : '';
    const kinds = view.possible.map((one) => `${one.kind} with ${one.model}`).join(', ');
    const how = view.problem ? `${view.problem}.` : kinds ? `It can be diagnosed as ${kinds}.` : '';
    const missing = view.missing.length
      ? `For the diagnosis of an arm ${view.missing.join(', ')} ${view.missing.length > 1 ? 'are' : 'is'} missing: choose below which column holds ${view.missing.length > 1 ? 'them' : 'it'}.` : '';
    const time = view.missing.includes('time') ? NO_TIME : '';
    setText(byId('log-text'), `${view.n_rows} rows${source}. ${how} ${missing} ${time}`);
    byId('log-problems').replaceChildren(...view.doubts.map((doubt) => this.doubt(doubt)));
    const better = view.possible.flatMap((one) => one.missing.map((what) => `Better with ${what}.`));
    byId('log-notes').replaceChildren(...[...better, ...view.notes].map((note) => make('li', {}, note)));
    const unknown = view.columns.filter((column) => !column.meaning).length;
    setText(byId('log-summary'), `${view.columns.length} columns${unknown ? `, ${unknown} of them of unknown meaning` : ''}`);
    if (isFirst) this.fill(view);
    else view.columns.forEach((column, index) => setText(byId('columns').rows[index].lastElementChild, column.meaning || '?'));
  }

  doubt({ column, question, units }) {
    const buttons = units.flatMap((unit) => {
      const button = make('button', { type: 'button', className: 'small' }, `Read ${column} in ${unitLabel(unit)}`);
      button.addEventListener('click', () => {
        const row = [...byId('columns').rows].find((one) => one.dataset.column === column);
        unitOf(row).value = unit;
        this.edited();
      });
      return [button, ' '];
    });
    return make('li', {}, `${question} `, ...buttons);
  }

  fill(view) {
    byId('log-details').open = view.possible.length === 0 || view.problem !== null;
    byId('columns').replaceChildren(...view.columns.map((column) => this.row(column, view)));
  }

  row(column, { units, quantities }) {
    const titles = [...byId('columns').closest('table').querySelectorAll('th')].map((th) => th.textContent);
    const own = quantities.some(([value]) => value === column.quantity) || !column.quantity ? [] : [[column.quantity, column.quantity]];
    const holds = make('select', { className: 'holds', ariaLabel: `${column.column} holds` }, make('option', { value: '' }, 'not read'),
      ...[...own, ...quantities].map(([value, label]) => make('option', { value }, value === label ? value : `${value}: ${label}`)));
    holds.value = column.quantity;
    const known = units.includes(column.unit) || !column.unit ? units : [...units, column.unit];
    const unit = make('select', { className: 'unit', ariaLabel: `Unit of ${column.column}` },
      make('option', { value: '' }, 'no unit'), ...known.map((name) => make('option', { value: name }, unitLabel(name))));
    unit.value = column.unit;
    for (const field of [holds, unit]) field.addEventListener('change', () => this.edited());
    const numbers = column.others ? `${column.numbers}, ${column.others} others` : String(column.numbers);
    const range = column.range ? column.range.map(number).join(' to ') : column.example;
    const cells = [make('code', {}, column.column), numbers, range, holds, unit, column.meaning || '?'];
    const row = make('tr', {}, ...cells.map((content, index) => {
      const cell = make('td', {}, content);
      cell.dataset.title = titles[index];
      return cell;
    }));
    row.dataset.column = column.column;
    return row;
  }

  edited() {
    this.isEdited = true;
    this.ask();
  }
}
