// The console of the board: lines that are typed, and what it answers. The server says which lines need control.

import { get } from './server.js';
import { onLive, order } from './frame.js';
import { byId, make, setText } from './format.js';

const KEPT = 300;
let next = 0;
let stops = null;
let isFetching = false;
const typed = [];
let recalled = 0;

async function fetchLines() {
  isFetching = true;
  try {
    const lines = await get(`/api/console?after=${next}`);
    const log = byId('console');
    const isAtEnd = log.scrollTop + log.clientHeight >= log.scrollHeight - 4;
    for (const line of lines) {
      log.append(make('div', { className: line.is_typed ? 'typed' : line.text.startsWith('?') ? 'refused' : '' }, `${line.is_typed ? '> ' : ''}${line.text}`));
      next = line.number + 1;
    }
    while (log.childElementCount > KEPT) log.firstChild.remove();
    if (isAtEnd) log.scrollTop = log.scrollHeight;
  } finally {
    isFetching = false;
  }
}

onLive((live) => {
  stops = live.stops;
  // A server that was started again counts from the beginning.
  if (live.console < next) {
    next = 0;
    byId('console').replaceChildren();
  }
  if (live.console > next && !isFetching) fetchLines().catch(() => {});
});

byId('type-form').addEventListener('submit', async (event) => {
  event.preventDefault();
  const field = byId('line');
  const line = field.value.trim().replaceAll('_', ' ');
  if (!line) return;
  const refused = await order('/api/console', { line, stops });
  setText(byId('line-note'), refused ? `Not sent: ${refused.message}` : '');
  if (refused) return;
  typed.push(field.value);
  recalled = typed.length;
  field.value = '';
});

// Earlier lines, as in a terminal.
byId('line').addEventListener('keydown', (event) => {
  const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
  if (!step || typed.length === 0) return;
  event.preventDefault();
  recalled = Math.min(Math.max(recalled + step, 0), typed.length);
  byId('line').value = typed[recalled] ?? '';
});
