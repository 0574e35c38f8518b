// The list of alerts in the order of bridge displays, each with the icon of its state, and their sound.
//
// An alert is {id, instance, title, priority, category, state, text, since_s, revision, sounds}:
// priority "emergency", "alarm", "warning" or "caution"; state "unacknowledged", "silenced",
// "acknowledged", "transferred" or "rectified"; since_s: time of the twin. The topic `alerts` has them
// in order. In a recording without it, rows of the diagnostics at WARN and ERROR stand in for them, as
// warnings and alarms that nobody can acknowledge. Faults of the console itself always precede the list.

import { $, icon, make, toast, write } from "./page.js";
import { on, request, stale, state } from "./link.js";
import { signIn } from "./control.js";

const began = new Map();
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
  found.sort((one, two) => one.priority.localeCompare(two.priority));
  return listed ? [...found, ...state.values.alerts.filter((one) => !one.shelved)] : found;
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

async function act(action, id) {
  if (!(await signIn())) return;
  const answer = await request({ do: "alert", action, alert: id });
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
  const key = JSON.stringify([allowed, rows.map((one) => [one.id, one.priority, one.state, one.text, one.revision])]);
  if (key === shown) return;
  shown = key;
  write($("alert-count"), rows.length ? String(rows.length) : "");
  $("silence").hidden = !allowed || !rows.some((one) => one.sounds);
  if (!rows.length) {
    $("alerts").replaceChildren(make("li", "none", "No alert"));
    return;
  }
  $("alerts").replaceChildren(...rows.map((one) => {
    const item = make("li", one.state === "unacknowledged" ? "flash" : "");
    item.dataset.priority = one.priority;
    const text = make("div", "text"), side = make("div", "at");
    if (one.title) text.append(make("b", "", one.first_out ? `${one.title} (first)` : one.title));
    text.append(document.createTextNode(one.text));
    text.title = one.text;
    side.append(make("time", "", clock(one.since_s)));
    if (allowed && one.priority !== "caution" && ["unacknowledged", "silenced", "rectified"].includes(one.state)) {
      const button = make("button", "small", "Ack");
      button.title = "Acknowledge";
      button.onclick = () => act("acknowledge", one.id);
      side.append(button);
    }
    item.append(icon(drawing(one)), text, side);
    return item;
  }));
}
