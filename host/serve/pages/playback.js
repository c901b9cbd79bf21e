// Rows one by one, and a table again and again. The board has neither: it plays a table once, complete, and keeps its limits.
// A row is set by hand, within the limits of what is set by hand.
//
// Each order after the first that a person's click makes says how many stops the page knows of: a stop of anybody outdates it.

import { hasControl, order, showAlert } from './frame.js';
import { post } from './server.js';
import { byId, setText } from './format.js';

const RETRY_MS = 1000;

// The row that was set last, and the table that it is of.
let last = { table: null, row: null };
// Rows are set one after the other: the next one counts from the row that is set by then.
let setting = Promise.resolve();
// While the table is played again and again: the stops and boots known then, the newest event then, and when it may be played again.
let loop = null;

function inTurn(act) {
  setting = setting.then(act, act);
  return setting;
}

async function set(program, row, stops) {
  const { word, servos_rad: servos } = program.rows[row];
  if (word && await order('/api/command', { do: 'word', word, stops })) return;
  for (const [servo, angle] of servos.entries()) {
    if (await order('/api/command', { do: 'servo', servo, angle_rad: angle, stops })) return;
  }
  last = { table: program.digest, row };
}

export const setRow = (program, row, { stops }) => inTurn(() => set(program, row, stops));

export function stepBy(program, by, { stops }) {
  return inTurn(() => {
    const row = last.table === program.digest ? last.row : null;
    return set(program, Math.min(Math.max((row ?? (by > 0 ? -1 : 1)) + by, 0), program.rows.length - 1), stops);
  });
}

// Stops, then sets the row that was due by hand: what holds by its coil alone lets go for the moment between. Its own stop is the only
// one that the row may follow, and only where the board has confirmed it.
export async function pause(program, live) {
  const { row: next } = live.board.phase;
  showAlert(null);
  try {
    const { confirmed } = await post('/api/stop', {});
    if (!confirmed) {
      showAlert('The stop was sent, but the board did not confirm it: switch off the supply of the arm.');
      return;
    }
  } catch (error) {
    showAlert(error.message);
    return;
  }
  await setRow(program, Math.max((next ?? 1) - 1, 0), { stops: live.stops + 1 });
}

const newest = (live) => live.events.at(-1)?.number ?? -1;

export function startLoop(live) {
  loop = { stops: live.stops, boots: live.board.boots, after: newest(live), notBefore: 0, isPlaying: false };
  setText(byId('loop-note'), '');
}

export function endLoop(why) {
  loop = null;
  byId('loop').checked = false;
  setText(byId('loop-note'), why);
}

// Why the table is not played again; empty where it is.
function whyEnded(program, live, since) {
  if (live.stops !== loop.stops) return 'ended by a stop or a lost connection';
  if (live.board.boots !== loop.boots || since.some((event) => event.kind === 'fault')) return 'ended by a fault or a restart';
  if (live.recordings?.last?.is_running) return 'ended by a recording';
  return !hasControl() || live.board.table !== program?.digest ? 'ended: no control, or another table' : '';
}

// Plays the table again when it has finished. A stop of anybody, a fault, a recording, and the loss of control end it.
export async function follow(program, live) {
  const own = loop;
  if (!own || own.isPlaying) return;
  const since = live.events.filter((event) => event.number > own.after);
  const why = whyEnded(program, live, since);
  if (why) {
    endLoop(why);
    return;
  }
  const isDue = live.board.phase.name === 'idle' && (since.some((event) => event.kind === 'finished') || own.notBefore);
  if (!isDue || performance.now() < own.notBefore || live.link.state !== 'live') return;
  own.isPlaying = true;
  const refusal = await order('/api/command', { do: 'play', table: program.digest, stops: own.stops });
  own.isPlaying = false;
  // It was ended meanwhile, and perhaps begun again.
  if (loop !== own) return;
  if (refusal && refusal.kind !== 'refused') {
    endLoop(refusal.kind === 'stopped' ? 'ended by a stop or a lost connection' : `ended: ${refusal.message}`);
    return;
  }
  // Outputs that were on for long need a pause; the sentence of the refusal is shown.
  setText(byId('loop-note'), refusal ? 'waits until the limits of the outputs allow the next' : '');
  if (refusal) own.notBefore = performance.now() + RETRY_MS;
  else Object.assign(own, { after: newest(live), notBefore: 0 });
}
