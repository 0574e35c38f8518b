// WebSocket to the server: keeps the newest values, reconnects, and knows the age of every topic.

export const state = {
  hello: null, values: {}, profile: [], trend: null, control: {}, source: {}, timeS: null,
  ages: {}, receivedMs: -Infinity, connected: false, lost: 0, rows: 0, page: 0,
  line: 0, // number of the rope that the pages show
};
const PROTOCOL = 2; // of the server's frames that this page reads
const listeners = { hello: [], row: [], profile: [], state: [], reply: [], seat_wanted: [], notice: [], link: [] };
export const on = (kind, act) => listeners[kind].push(act);
const tell = (kind, content) => { for (const act of listeners[kind]) act(content); };

const ANSWER_MS = 8000; // the server answers a command without effect after 2.5 s
const ALIVE_MS = 500; // the server gives up the seat of a page that is silent for 2 s

let socket = null, waitMs = 250, number = 0, last = 0, aliveMs = -Infinity;
const waiting = new Map();

export function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/live`);
  socket.onopen = () => { state.connected = true; waitMs = 250; tell("link"); };
  socket.onmessage = (event) => { for (const frame of JSON.parse(event.data)) take(frame); };
  socket.onclose = () => {
    state.connected = false;
    for (const done of waiting.values()) done({ ok: false, words: "the connection was lost", stage: "done" });
    waiting.clear();
    tell("link");
    setTimeout(connect, waitMs);
    waitMs = Math.min(2 * waitMs, 4000);
  };
}

// Sent as rows arrive, not by a timer, which browsers slow down in a tab in the background.
function alive() {
  const now = performance.now(), holder = state.control?.holder ?? null;
  if (holder === null || holder !== state.page || now - aliveMs < ALIVE_MS) return;
  if (socket?.readyState !== WebSocket.OPEN) return;
  aliveMs = now;
  socket.send(JSON.stringify({ do: "alive" }));
}

function take(frame) {
  if (frame.type === "row") {
    if (frame.whole) state.values = {};
    else if (last && frame.seq > last + 1) state.lost += frame.seq - last - 1;
    last = frame.seq;
    Object.assign(state.values, frame.values);
    state.ages = frame.ages;
    state.timeS = frame.time_s;
    state.receivedMs = performance.now();
    state.rows += 1;
    alive();
  } else if (frame.type === "profile") {
    state.profile = frame.ropes;
  } else if (frame.type === "hello") {
    if (frame.protocol !== PROTOCOL && sessionStorage.getItem("reloaded") !== String(frame.protocol)) {
      sessionStorage.setItem("reloaded", String(frame.protocol)); // the server is of another version
      location.reload();
    }
    last = 0;
    Object.assign(state, { hello: frame, control: frame.control, source: frame.source, page: frame.page });
  } else if (frame.type === "state") {
    Object.assign(state, { control: frame.control, source: frame.source, log: frame.log ?? state.log });
  } else if (frame.type === "reply") {
    const done = waiting.get(frame.id);
    if (done) done(frame);
    if (frame.stage === "done" || !frame.ok) waiting.delete(frame.id);
  }
  if (frame.log) state.log = frame.log;
  if (frame.sea_limits) state.sea_limits = frame.sea_limits;
  tell(frame.type, frame);
}

// Send a request; `progress` is called for each answer, the promise resolves with the last.
export function request(content, progress = () => {}) {
  return new Promise((resolve) => {
    if (!socket || socket.readyState !== WebSocket.OPEN) {
      resolve({ ok: false, words: "not connected to the console's server" });
      return;
    }
    const id = ++number;
    const late = setTimeout(() => {
      waiting.delete(id);
      resolve({ ok: false, words: "no answer of the console's server", stage: "done" });
    }, ANSWER_MS);
    waiting.set(id, (frame) => {
      progress(frame);
      if (frame.stage === "done" || !frame.ok) { clearTimeout(late); resolve(frame); }
    });
    socket.send(JSON.stringify({ ...content, id }));
  });
}

// Age of the newest message of a topic [s]; null: none has arrived.
export function age(topic) {
  const at = state.ages[topic];
  return at === undefined ? null : at + (performance.now() - state.receivedMs) / 1000;
}
export function stale(topic) {
  const limit = state.hello?.stale_s?.[topic], now = age(topic);
  return now !== null && limit !== undefined && now > limit;
}
export const facts = () => state.hello?.facts ?? {};

// What belongs to the rope that is shown: values by its number, its winch and payload by their names.
export const own = (name) => state.values[name]?.[state.line];
export const rope = () => facts().ropes?.[state.line] ?? {};
export const ropeNames = () => state.values.ropes ?? [];
export const winchName = () => rope().winch || Object.keys(facts().winches ?? {})[0] || state.values.winches?.[0]?.name || "winch";
export const winch = () => facts().winches?.[winchName()];
export const winchRow = () => state.values.winches?.find((row) => row.name === winchName());
export const payload = () => state.values.payloads?.find((row) => row.name === rope().payload) ?? state.values.payloads?.[0];

// Limits that the crew has set, as the twin reports them; the stricter of scene and crew applies.
export function crewLimit(name) {
  const words = state.values["diagnostics simulation: crew limits"]?.values?.[name];
  return words === undefined ? null : Number(words);
}
const stricter = (atLeast, values) => {
  const set = values.filter((one) => Number.isFinite(one));
  return set.length ? Math[atLeast ? "max" : "min"](...set) : null;
};
export function limit(name) {
  const one = facts().crew_limits?.find((row) => row.name === name);
  return stricter(one?.at_least, [one ? one.scene : facts().limits?.[name], crewLimit(name)]);
}
export function allowed() {
  const share = crewLimit("utilisation"), breaking = rope().breaking_load_n;
  return stricter(false, [rope().allowed_n, crewLimit("tension_n"), share === null ? null : share * breaking]) ?? undefined;
}
export const leastTension = () => stricter(true, [facts().limits?.min_tension_n, crewLimit("min_tension_n")]);

// What a text such as "winch: speed 0 m/s (a limit; another); aft: brake" says of a winch.
export function said(text, name = winchName()) {
  const part = (text ?? "").split(/; (?![^(]*\))/).find((one) => one.startsWith(`${name}: `));
  return part ? part.slice(name.length + 2) : "";
}

// Newest residual of a quantity at the winch or payload of the rope that is shown.
export function residual(quantity) {
  const rows = (state.values.residuals ?? []).filter((row) => row.quantity === quantity);
  if (ropeNames().length < 2) return rows[0];
  return rows.find((row) => [winchName(), rope().payload].includes(row.name));
}
