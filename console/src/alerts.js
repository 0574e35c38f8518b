// The list of alerts in the order of bridge displays, each with the icon of its state, and their sound.
//
// An alert is {id, instance, title, priority, category, state, text, since_s, revision, sounds}:
// priority "emergency", "alarm", "warning" or "caution"; state "unacknowledged", "silenced",
// "acknowledged", "transferred" or "rectified"; since_s: time of the twin. The topic `alerts` has them
// in order. In a recording without it, rows of the diagnostics at WARN and ERROR stand in for them, as
// warnings and alarms that nobody can acknowledge. Faults of the console itself always precede the list.

import { $, ask, icon, make, toast, write } from "./page.js";
import { on, request, stale, state } from "./link.js";
import { signIn } from "./control.js";

const began = new Map();
const MOST_MIN = 480; // a shift
let shown = "", audio = null, nextMs = 0;

function current() {
  const listed = Array.isArray(state.values.alerts);
  const found = [];
  for (const [key, row] of Object.entries(state.values)) {
    const diagnosed = key.startsWith("diagnostics ");
    if (diagnosed ? listed : !(key.startsWith("fault ") && row)) { began.delete(key); continue; }
    if (diagnosed && !row.level) { began.delete(key); continue; }
    const bad = diagnosed ? row.level >= 2 : true;
    if (!began.has(key)) began.set(key, state.timeS);
    found.push({
      id: key, instance: 1, priority: bad ? "alarm" : "warning", category: "B", state: "acknowledged",
      title: diagnosed ? key.slice(12).replace(/^simulation: /, "") : key,
      text: diagnosed ? row.message : row, since_s: began.get(key), revision: 0,
    });
  }
  if ($("link").textContent.endsWith("LOST")) {
    found.push({
      id: "fault link", instance: 1, priority: "alarm", category: "B", state: "acknowledged",
      title: state.connected ? "Twin lost" : "Console lost", since_s: null, revision: 0,
      text: `${state.connected ? "the twin sends no top tension" : "the page has no connection to its server"}: what is shown is old`,
    });
  }
  found.sort((one, two) => one.priority.localeCompare(two.priority));
  return listed ? [...found, ...state.values.alerts] : found; // shelved ones are at the end
}

const clock = (timeS) => {
  const epoch = state.values.epoch_s;
  if (timeS === null || timeS === undefined || epoch === undefined) return "";
  return new Date((epoch + timeS) * 1000).toISOString().slice(11, 19);
};

function drawing(one) {
  const priority = one.priority === "emergency" ? "alarm" : one.priority;
  return priority === "caution" ? "caution" : `${priority}-${one.state === "transferred" ? "acknowledged" : one.state}`;
}

// Out of the list for a limited time; it stays below it, and returns by itself or by hand.
async function shelve(one) {
  const typed = await ask("Shelve the alert?", `${one.title}: minutes without it in the list, up to ${MOST_MIN}.`, "Shelve", { value: "10" });
  if (typed === null) return;
  const minutes = Number(typed.trim().replace(",", "."));
  if (!(minutes > 0 && minutes <= MOST_MIN)) { toast(`${typed} is not between 0 and ${MOST_MIN} minutes.`, false); return; }
  await act("shelve", one.id, { seconds: Math.round(60 * minutes) });
}

function press(text, title, action) {
  const button = make("button", "small", text);
  button.title = title;
  button.onclick = action;
  return button;
}

async function act(action, id, more = {}) {
  if (!(await signIn())) return;
  const answer = await request({ do: "alert", action, alert: id, ...more });
  toast(answer.words, answer.ok);
}

// Two tones that cannot be confused: an alarm is three short high ones, a warning two lower ones.
export function start() {
  for (const kind of ["pointerdown", "keydown"]) { // browsers allow sound only after one of them
    document.addEventListener(kind, () => { audio ??= new AudioContext(); if (audio.state !== "running") audio.resume(); });
  }
  $("silence").onclick = () => act("silence", "all");
  on("link", () => { shown = ""; });
}

export function sound(nowMs) {
  $("sound-off").hidden = audio?.state === "running";
  const loud = current().filter((one) => one.sounds);
  if (!audio || !loud.length || stale("ropes/tension_top") || nowMs < nextMs) return;
  const alarm = loud.some((one) => one.priority !== "warning");
  nextMs = nowMs + (alarm ? 2000 : 4000);
  const [count, hertz, length] = alarm ? [3, 960, 0.14] : [2, 620, 0.28];
  for (let k = 0; k < count; k += 1) {
    const tone = audio.createOscillator(), gain = audio.createGain(), at = audio.currentTime + 1.5 * length * k;
    tone.frequency.value = hertz;
    gain.gain.setValueAtTime(0.0001, at);
    gain.gain.linearRampToValueAtTime(0.25, at + 0.01);
    gain.gain.setValueAtTime(0.25, at + length - 0.02);
    gain.gain.linearRampToValueAtTime(0.0001, at + length);
    tone.connect(gain).connect(audio.destination);
    tone.start(at);
    tone.stop(at + length);
  }
}

export function draw() {
  const rows = current(), allowed = Boolean(state.control?.allowed);
  const key = JSON.stringify([allowed, rows.map((one) => [one.id, one.priority, one.state, one.text, one.revision, one.shelved])]);
  if (key === shown) return;
  shown = key;
  const shelved = rows.filter((one) => one.shelved).length;
  write($("alert-count"), (rows.length > shelved ? String(rows.length - shelved) : "") + (shelved ? ` + ${shelved} shelved` : ""));
  $("silence").hidden = !allowed || !rows.some((one) => one.sounds);
  if (!rows.length) {
    $("alerts").replaceChildren(make("li", "none", "No alert"));
    return;
  }
  $("alerts").replaceChildren(...rows.map((one) => {
    const item = make("li", one.shelved ? "shelved" : one.state === "unacknowledged" ? "flash" : "");
    item.dataset.priority = one.priority;
    const text = make("div", "text"), side = make("div", "at");
    if (one.title) text.append(make("b", "", one.shelved ? `${one.title} (shelved)` : one.first_out ? `${one.title} (first)` : one.title));
    text.append(document.createTextNode(one.text));
    text.title = one.text;
    side.append(make("time", "", clock(one.since_s)));
    if (allowed && one.shelved) side.append(press("List", "List it again", () => act("unshelve", one.id)));
    else if (allowed && one.priority !== "caution" && ["unacknowledged", "silenced", "rectified"].includes(one.state)) {
      side.append(press("Ack", "Acknowledge", () => act("acknowledge", one.id)));
    } else if (allowed && one.title && !/^(fault|diagnostics) /.test(one.id)) {
      side.append(press("Shelve", "Take it out of the list for a time", () => shelve(one)));
    }
    item.append(icon(drawing(one)), text, side);
    return item;
  }));
}
