// Requests to the server. An answer that is a refusal is thrown as `Refusal`: its kind decides, its text is for people.

const TOKEN = 'darm-token';

// The address that `darm serve` prints has the token behind `#`, which a browser sends to nobody.
const given = new URLSearchParams(location.hash.slice(1)).get('token');
if (given) {
  sessionStorage.setItem(TOKEN, given);
  history.replaceState(null, '', location.pathname);
}

export class Refusal extends Error {
  constructor(refused) {
    super(refused.text);
    this.kind = refused.kind;
    this.visit = refused.visit;
    this.row = refused.row;
    this.output = refused.output;
    this.limit = refused.limit;
  }
}

async function request(path, options, timeoutMs, given) {
  const headers = { ...options.headers };
  const token = sessionStorage.getItem(TOKEN);
  if (token) headers.authorization = `Bearer ${token}`;
  const signal = given ?? (timeoutMs ? AbortSignal.timeout(timeoutMs) : undefined);
  let answer;
  try {
    answer = await fetch(path, { ...options, headers, signal, cache: 'no-store' });
  } catch {
    throw new Refusal({ kind: 'server', text: 'darm serve does not answer' });
  }
  if (answer.ok && options.asBytes) return answer.arrayBuffer();
  let body = null;
  try {
    body = await answer.json();
  } catch {
    // A refusal of the server itself has no JSON.
  }
  if (answer.ok) return body;
  throw new Refusal(body?.refused ?? { kind: 'server', text: `darm serve answered with status ${answer.status}` });
}

// The key keeps the connections of a page with control open: what renews its control needs no new one.
export function get(path, timeoutMs = 2000, key = null) {
  return request(path, { method: 'GET', headers: key ? { 'x-darm-control': key } : {} }, timeoutMs);
}

// A file: it may be large.
export function getBytes(path) {
  return request(path, { method: 'GET', asBytes: true }, 60_000);
}

// A request whose `signal` is aborted is given up, by the server too.
export function post(path, body, { key, timeoutMs, keepalive, signal } = {}) {
  const headers = {};
  if (key) headers['x-darm-control'] = key;
  const isBytes = body instanceof ArrayBuffer || body instanceof Blob;
  if (!isBytes) headers['content-type'] = 'application/json';
  return request(path, { method: 'POST', headers, body: isBytes ? body : JSON.stringify(body), keepalive }, timeoutMs, signal);
}
