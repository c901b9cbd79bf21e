// Rows one by one, and a table again and again. The board has neither: it plays a table once, as a whole that keeps its limits.
// A row is set by hand, within the limits of what is set by hand.

import { hasControl, order } from './frame.js';
import { byId, setText } from './format.js';

const RETRY_MS = 1000;

// The row that was set last.
let row = null;
// While the table is played again and again: the stops known then, the newest event then, and when it may be played again.
let loop = null;

export async function setRow(program, index) {
  const { word, servos_rad: servos } = program.rows[index];
  if (await order('/api/command', { do: 'word', word })) return;
  for (const [servo, angle] of servos.entries()) {
    if (await order('/api/command', { do: 'servo', servo, angle_rad: angle })) return;
  }
  row = index;
}

export const stepBy = (program, by) => setRow(program, Math.min(Math.max((row ?? (by > 0 ? -1 : 1)) + by, 0), program.rows.length - 1));

// Stops, then sets the row that was due by hand: what holds by its coil alone lets go for the moment between.
export async function pause(program, live) {
  const { row: next } = live.board.phase;
  if (await order('/api/stop', {})) return;
  await setRow(program, Math.max((next ?? 1) - 1, 0));
}

const newest = (live) => live.events.at(-1)?.number ?? 0;

export function startLoop(live) {
  loop = { stops: live.stops, after: newest(live), notBefore: 0 };
}

export function endLoop(why) {
  loop = null;
  byId('loop').checked = false;
  setText(byId('loop-note'), why);
}

// Plays the table once more when it has finished. A stop of anybody, a fault, and the loss of control end it.
export async function follow(program, live) {
  if (!loop || loop.isPlaying) return;
  const since = live.events.filter((event) => event.number > loop.after);
  if (live.stops !== loop.stops) return endLoop('ended by a stop');
  if (since.some((event) => event.kind === 'fault' || event.kind === 'booted')) return endLoop('ended by a fault or a restart');
  if (!hasControl() || live.board?.table !== program?.digest) return endLoop('ended: no control, or another table');
  const isDue = live.board.phase.name === 'idle' && (since.some((event) => event.kind === 'finished') || loop.notBefore);
  if (!isDue || performance.now() < loop.notBefore || live.link.state !== 'live') return;
  loop.isPlaying = true;
  const refusal = await order('/api/command', { do: 'play', table: program.digest, stops: loop.stops });
  if (!loop) return;
  if (refusal && refusal.kind !== 'refused') return endLoop('ended by a stop');
  // Outputs that were on for long need a pause; the sentence of the refusal is shown.
  setText(byId('loop-note'), refusal ? 'waits until the limits of the outputs allow the next' : '');
  loop = { ...loop, isPlaying: false, after: refusal ? loop.after : newest(live), notBefore: refusal ? performance.now() + RETRY_MS : 0 };
}
