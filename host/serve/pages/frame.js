// What every page has: the state of the link, the stop, and control.

import { get, post, Refusal } from './server.js';
import { keepStopLine, stopByLine } from './stop-line.js';
import { byId, make, seconds, setText } from './format.js';

const KEY = 'darm-control-key';
// Without an answer of the server for this time the page says so.
const SERVER_LOST_MS = 1000;
const RENEW_MS = 1000;
// A state from before a stop may arrive as long after it.
const FORMER_STATE_MS = 500;

// The storage of the tab has the key of its last page. A page that is left says so; the next one resumes within 2 s under a
// new key, so that no duplicate of the tab has it. Otherwise the server takes control away, and what was switched by hand goes off.
// What was asked for and is not handed over yet: its number and its key.
const control = { key: null, asked: null };
const RESUME_TRIES = 5;
const RESUME_MS = 150;
let lastAnswer = performance.now();
let last = null;

const listeners = [];
export const hasControl = () => control.key !== null;

// ---------------------------------------------------------------- the stop

let confirmedAt = 0;

async function stop() {
  const note = byId('stopped');
  note.hidden = false;
  note.dataset.outcome = 'sent';
  setText(note, 'Stopping …');
  try {
    const answer = await stopByLine() ?? await post('/api/stop', {}, { timeoutMs: 3000 });
    if (answer.refused) throw new Refusal(answer.refused);
    const { confirmed, servos_uncontrolled, took_s } = answer;
    note.dataset.outcome = confirmed ? 'confirmed' : 'missing';
    confirmedAt = performance.now();
    setText(note, confirmed
      ? `Stopped: the board confirmed after ${seconds(took_s)} that all outputs are off.${servos_uncontrolled
        ? ' It is held after crashes and does not control the servos: cut their supply.' : ''}`
      : 'The stop was sent, but the board did not confirm it: switch off the supply of the arm.');
  } catch (error) {
    note.dataset.outcome = 'failed';
    setText(note, `NOT STOPPED: switch off the supply of the arm. ${error.message}`);
  }
}

// A confirmed stop is true until the arm is moved again, or the board is not seen.
function showStop({ link, board }) {
  const note = byId('stopped');
  const isAtRest = link.state === 'live' && ['idle', 'safe'].includes(board?.phase.name);
  if (note.dataset.outcome === 'confirmed' && !isAtRest && performance.now() - confirmedAt > FORMER_STATE_MS) {
    note.hidden = true;
    note.dataset.outcome = '';
  }
}

byId('stop-form').addEventListener('submit', (event) => {
  event.preventDefault();
  stop();
});

// The latched safe state, with its cause and what clears it, whatever the page is about.
function showSafeState({ board, link }) {
  const note = byId('safe');
  const fault = board?.phase.name === 'safe' ? board.phase.fault : null;
  note.hidden = !fault;
  const seen = link.state === 'live' ? '' : ' (seen before the connection was lost)';
  setText(note, fault ? `Safe state${seen}: ${fault.text}. All outputs are off. Remove the cause, then clear it on the page Live.` : '');
}

// A button acts when the key goes up, so both are taken away from it.
for (const type of ['keydown', 'keyup']) {
  window.addEventListener(type, (event) => {
    // The keyboard of a telephone gives no code.
    if ((event.code !== 'Space' && event.key !== ' ') || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    if (type === 'keydown' && !event.repeat) stop();
  }, { capture: true });
}

// ---------------------------------------------------------------- refusals

export function showAlert(text) {
  const alert = byId('alert');
  alert.hidden = !text;
  setText(alert, text ?? '');
}

// Sends an order of this page; the text of a refusal is shown, the refusal is returned.
export async function order(path, body) {
  showAlert(null);
  try {
    await post(path, body, { key: control.key });
    return null;
  } catch (error) {
    showAlert(error.message);
    if (error instanceof Refusal && error.kind === 'control') setKey(null);
    return error;
  }
}

// ---------------------------------------------------------------- control

function setKey(key) {
  control.key = key;
  if (key) sessionStorage.setItem(KEY, key);
  else sessionStorage.removeItem(KEY);
  keepStopLine(key);
}

// Resumes the control of the page before, if this tab had it.
async function resume() {
  const before = sessionStorage.getItem(KEY);
  control.key = null;
  if (!before) return;
  for (let tries = 0; tries < RESUME_TRIES; tries += 1) {
    try {
      setKey((await post('/api/control', { do: 'resume' }, { key: before, timeoutMs: 2000 })).key);
      showControl();
      return;
    } catch {
      // That the page before is left may arrive after this request.
      await new Promise((wake) => setTimeout(wake, RESUME_MS));
    }
  }
  // A person may have taken control meanwhile.
  if (!control.key) setKey(null);
}

async function takeOrRelease() {
  showAlert(null);
  try {
    if (hasControl()) {
      await post('/api/control', { do: 'release' }, { key: control.key });
      setKey(null);
    } else if (control.asked) {
      await post('/api/control', { do: 'refuse' }, { key: control.asked.key });
      control.asked = null;
    } else if (last?.control) {
      control.asked = await post('/api/control', { do: 'ask', page });
    } else {
      setKey((await post('/api/control', { do: 'take', page })).key);
    }
  } catch (error) {
    setKey(null);
    showAlert(error.message);
  }
  showControl();
}

async function renew() {
  if (!hasControl()) return;
  try {
    await post('/api/control', { do: 'renew' }, { key: control.key, timeoutMs: 2000 });
  } catch (error) {
    if (error.kind === 'control') {
      setKey(null);
      showAlert('This page has lost control.');
      showControl();
    }
  }
}

// What the button does now, and who has control.
function controlTexts(holder) {
  if (hasControl()) return ['Release control', 'this page controls'];
  if (!holder) return ['Take control', 'nobody controls'];
  if (holder.is_program) return ['Take control', `${holder.name} controls: end it first`];
  if (control.asked) return ['Ask no longer', `asked ${holder.name} for control`];
  return holder.asked_by ? ['Ask for control', `${holder.name} controls, ${holder.asked_by} has asked`] : ['Ask for control', `${holder.name} controls`];
}

function showControl() {
  const holder = last?.control ?? null;
  takeWhatWasAsked(holder);
  const [does, says] = controlTexts(holder);
  const take = byId('take');
  take.disabled = !last || (!hasControl() && !control.asked && Boolean(holder?.is_program || holder?.asked_by));
  setText(take, does);
  document.body.toggleAttribute('data-controls', hasControl());
  setText(byId('holder'), last ? says : '');
  const asks = hasControl() ? holder?.asked_by : null;
  byId('asked').hidden = !asks;
  setText(byId('asked-text'), asks ? `${asks} asks for control of the arm. What is on by hand stays on.` : '');
  for (const button of document.querySelectorAll('[data-needs-control]')) {
    button.disabled = !hasControl() || document.body.dataset.link !== 'live' || button.dataset.ready === 'false';
  }
}

// Control was handed over to this page, or it waits no longer: half a minute has passed, or it was refused.
function takeWhatWasAsked(holder) {
  if (!control.asked) return;
  if (holder?.page === control.asked.page) {
    setKey(control.asked.key);
    renew();
  }
  // A state from before the question has nobody who asks.
  control.asked.isSeen ||= Boolean(holder?.asked_by);
  if (hasControl() || (control.asked.isSeen && !holder?.asked_by) || !holder) control.asked = null;
}

async function answerAsked(what) {
  try {
    await post('/api/control', { do: what }, { key: control.key });
    if (what === 'hand-over') setKey(null);
  } catch (error) {
    showAlert(error.message);
  }
  byId('asked').hidden = true;
  showControl();
}

byId('take').addEventListener('click', takeOrRelease);
byId('hand-over').addEventListener('click', () => answerAsked('hand-over'));
byId('keep').addEventListener('click', () => answerAsked('refuse'));
setInterval(renew, RENEW_MS);
window.addEventListener('pagehide', () => {
  if (hasControl()) post('/api/control', { do: 'leave' }, { key: control.key, keepalive: true }).catch(() => {});
  // A page with an open one is not kept for "back".
  keepStopLine(null);
});
// A page that the browser has kept for "back" is left and comes back.
window.addEventListener('pageshow', (event) => { if (event.persisted) resume(); });
resume();

// ---------------------------------------------------------------- who is here

const PAGE = 'darm-page';
const PAGE_NAME = 'darm-page-name';
// The pages of a tab, one after the other, are one.
const page = Number(sessionStorage.getItem(PAGE) ?? crypto.getRandomValues(new Uint32Array(1))[0]);
sessionStorage.setItem(PAGE, page);

// Until a person gives a name: what the browser says of itself.
function browserName() {
  const agent = navigator.userAgent;
  const find = (names) => names.find(([sign]) => agent.includes(sign))?.[1];
  const browser = find([['Edg', 'Edge'], ['Firefox', 'Firefox'], ['Chrom', 'Chromium'], ['Safari', 'Safari']]) ?? 'Browser';
  const system = find([['Android', 'Android'], ['iPhone', 'iPhone'], ['iPad', 'iPad'], ['Windows', 'Windows'], ['Mac', 'macOS'], ['Linux', 'Linux']]);
  return system ? `${browser} on ${system}` : browser;
}

const pageName = () => localStorage.getItem(PAGE_NAME) || browserName();

async function sayHere() {
  try {
    await post('/api/here', { page, name: pageName() }, { timeoutMs: 2000 });
  } catch {
    // The state of the link says so already.
  }
}

byId('page-name').value = pageName();
byId('page-name').addEventListener('change', (event) => {
  localStorage.setItem(PAGE_NAME, event.target.value.trim());
  event.target.value = pageName();
  sayHere();
});
setInterval(sayHere, RENEW_MS);
sayHere();

function showHere({ attached }) {
  setText(byId('here-count'), `${attached.length} here`);
  const list = byId('here-list');
  const key = JSON.stringify(attached);
  if (list.dataset.key === key) return;
  list.dataset.key = key;
  list.replaceChildren(...attached.map((one) => make('li', {}, one.name)));
}

// ---------------------------------------------------------------- what is live

const LINKS = {
  connecting: () => 'connecting to the board',
  // Of a long path the end says which port it is.
  live: (live) => `live, ${live.port.replace(/^(unix:)?\/.{20,}(\/[^/]+\/[^/]+)$/, '$1…$2')}`,
  silent: () => 'the board is silent: values are old',
  lost: (live) => `no connection to the board: ${live.link.reason}`,
  server: () => 'darm serve does not answer: values are old, the stop cannot be sent from here',
};

function showLink(state) {
  document.body.dataset.link = state;
  setText(byId('link'), LINKS[state](last));
  byId('link').title = last?.port ?? '';
  // Apart from the text above, which a screen reader says again when it changes.
  const isOld = (state === 'lost' || state === 'silent') && last.age_s !== null;
  setText(byId('age'), isOld ? `(seen ${last.age_s.toFixed(1)} s ago)` : '');
  showControl();
}

setInterval(() => {
  if (performance.now() - lastAnswer > SERVER_LOST_MS) showLink('server');
}, 200);

// Calls `listener` with each state of the board, about 20 times a second.
export function onLive(listener) {
  listeners.push(listener);
}

export async function follow() {
  let after = 0;
  for (;;) {
    try {
      const live = await get(`/api/live?after=${after}`, 2000, control.key);
      lastAnswer = performance.now();
      // A server that was started again counts from the beginning.
      after = live.revision;
      last = live;
      showLink(live.link.state);
      showStop(live);
      showSafeState(live);
      showHere(live);
      for (const listener of listeners) listener(live);
    } catch (error) {
      if (error.kind === 'denied') {
        showAlert(error.message);
        lastAnswer = -Infinity;
      }
      await new Promise((wake) => setTimeout(wake, 300));
    }
  }
}
