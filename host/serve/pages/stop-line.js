// A connection for stops alone: the server keeps it for the page with control, and a thread that does nothing else answers it.

// A stop without an answer for this time goes by a request too.
const PATIENCE_MS = 300;
const AGAIN_MS = 1000;

let line = null;
// What is to be done with the answers that are under way, in the order of the stops.
let waiting = [];

function show() {
  document.body.toggleAttribute('data-stop-line', line?.readyState === WebSocket.OPEN);
}

// Keeps a connection open under the key of this page; without a key there is none.
export function keepStopLine(key) {
  const before = line;
  [line, waiting] = [null, []];
  before?.close();
  show();
  if (!key) return;
  const opened = new WebSocket(`${location.origin.replace(/^http/, 'ws')}/stop-line?key=${key}`);
  line = opened;
  opened.addEventListener('open', show);
  opened.addEventListener('message', ({ data }) => {
    if (line === opened) waiting.shift()?.(JSON.parse(data));
  });
  opened.addEventListener('close', () => {
    show();
    setTimeout(() => { if (line === opened) keepStopLine(key); }, AGAIN_MS);
  });
}

// Sends a stop; its answer, or `null` where there is no connection or no answer in time.
export function stopByLine() {
  if (line?.readyState !== WebSocket.OPEN) return Promise.resolve(null);
  return new Promise((resolve) => {
    waiting.push(resolve);
    setTimeout(() => resolve(null), PATIENCE_MS);
    line.send('stop');
  });
}
