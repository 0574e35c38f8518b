// Fourth page: casts and markers of this console, and their export.

import { $, ask, toast } from "./page.js";
import { request, state } from "./link.js";
import { signIn } from "./control.js";
import { duration, force, metres, units } from "./units.js";
import { table } from "./engineering.js";

export function start() {
  $("mark").onsubmit = async (event) => {
    event.preventDefault();
    const text = $("mark-text").value.trim();
    if (!text || !(await mayWrite())) return;
    const answer = await request({ do: "mark", text });
    if (answer.ok) $("mark-text").value = "";
    else toast(answer.words, false);
  };
  $("new-cast").onclick = async () => {
    if (!(await ask("Begin a new cast?", "Highest and lowest values of the cast start again.", "Begin"))) return;
    if (!(await mayWrite())) return;
    const answer = await request({ do: "new_cast" });
    if (!answer.ok) toast(answer.words, false);
  };
}

// With control, entries need the token: the log belongs to those who may command.
const mayWrite = async () => !state.control?.allowed || signIn();

const clock = (seconds) => seconds === null || seconds === undefined ? "–" : new Date(seconds * 1000).toISOString().slice(0, 19).replace("T", " ");

export function draw() {
  const log = state.log ?? { casts: [], markers: [] };
  table("casts", log.casts.map((one) => [String(one.number), clock(one.from_s), one.open ? "running" : clock(one.to_s),
    duration(one.to_s - one.from_s), `${metres(one.deepest_m)} m`, `${metres(one.longest_m)} m`,
    `${force(one.highest_n)} ${units().force}`, `${force(one.lowest_n)} ${units().force}`]), "No cast yet");
  table("marks", [...log.markers].reverse().map((one) => [clock(one.at_s), `${one.time_s === null ? "–" : one.time_s.toFixed(1)} s`, one.text, one.page]), "No marker yet");
}
