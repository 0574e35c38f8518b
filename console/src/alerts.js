// The list of alerts, in the order of bridge displays, each with the icon of its state.
//
// An alert is {id, instance, priority, category, state, text, since, revision}: priority "alarm",
// "warning" or "caution"; state "unacknowledged", "silenced", "acknowledged" or "rectified"; since:
// seconds of Unix time. Until the twin publishes alerts, rows of the diagnostics at WARN and ERROR
// stand in for them as warnings and alarms that nobody can acknowledge.

import { $, icon, make, write } from "./page.js";
import { state } from "./link.js";

const ORDER = [
  ["alarm", "unacknowledged"], ["alarm", "silenced"], ["warning", "unacknowledged"],
  ["warning", "silenced"], ["alarm", "rectified"], ["warning", "rectified"],
  ["alarm", "acknowledged"], ["warning", "acknowledged"],
].map((one) => one.join(" "));
const rank = (alert) => alert.priority === "caution" ? ORDER.length : ORDER.indexOf(`${alert.priority} ${alert.state}`);
const began = new Map();
let shown = "";

export function current() {
  if (Array.isArray(state.values.alerts)) return state.values.alerts;
  const found = [];
  for (const [key, row] of Object.entries(state.values)) {
    const diagnosed = key.startsWith("diagnostics ");
    if (!diagnosed && !(key.startsWith("fault ") && row)) continue;
    if (diagnosed && !row.level) { began.delete(key); continue; }
    const bad = diagnosed ? row.level >= 2 : true;
    if (!began.has(key)) began.set(key, Date.now() / 1000);
    found.push({
      id: key, instance: 1, priority: bad ? "alarm" : "warning", category: "B", state: "acknowledged",
      title: diagnosed ? key.slice(12).replace(/^simulation: /, "") : key,
      text: diagnosed ? row.message : row, since: began.get(key), revision: 0,
    });
  }
  return found;
}

export function draw() {
  const rows = current().sort((one, two) => rank(one) - rank(two) || two.since - one.since);
  const key = JSON.stringify(rows.map((one) => [one.id, one.instance, one.priority, one.state, one.text, one.revision]));
  if (key === shown) return;
  shown = key;
  write($("alert-count"), rows.length ? String(rows.length) : "");
  if (!rows.length) {
    $("alerts").replaceChildren(make("li", "none", "No alert"));
    return;
  }
  $("alerts").replaceChildren(...rows.map((one) => {
    const item = make("li", one.state === "unacknowledged" ? "flash" : "");
    item.dataset.priority = one.priority;
    item.append(icon(one.priority === "caution" ? "caution" : `${one.priority}-${one.state}`));
    const text = make("div", "text");
    if (one.title) text.append(make("b", "", one.title));
    text.append(document.createTextNode(one.text));
    text.title = one.text;
    item.append(text, make("time", "", new Date(one.since * 1000).toISOString().slice(11, 19)));
    return item;
  }));
}
