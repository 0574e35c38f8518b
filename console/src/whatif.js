// Orders to the winch compared on the forecast's seas, asked for by this page. Nothing is commanded.

import { $, ask, make, toast } from "./page.js";
import { request, ropeNames, state } from "./link.js";
import { fixed, force, known, units } from "./units.js";

const SPAN_S = 30;
const WORDS = "hold is compared with: stop, lower:SPEED, haul:SPEED, land:SPEED in m/s, compensation:on or compensation:off, up to six of them; stop@WINCH is for one winch alone. Nothing is commanded.";
let awaited = null, typed = "stop lower:0.5 haul:0.5";

export function start() {
  $("what-if").onclick = async () => {
    const words = await ask("What if?", WORDS, "Compare", { value: typed });
    if (words === null || !words.trim()) return;
    typed = words.trim();
    const answer = await request({ do: "what_if", orders: typed });
    if (!answer.ok) { toast(answer.words, false); return; }
    awaited = state.values.orders?.at_s ?? -Infinity;
    toast("Asked; the next forecast answers.");
  };
}

export function draw() {
  $("what-if").hidden = state.hello?.kind === "recording" || !(state.values.risk?.rows ?? []).length;
  const found = state.values.orders;
  if (awaited === null || !found || found.at_s === awaited) return;
  awaited = null;
  const rows = found.rows.filter((row) => row.span_s === SPAN_S);
  const several = rows.some((row) => row.rope !== rows[0].rope);
  const chance = (value) => known(value) ? `${fixed(100 * value, 0)} %` : "–";
  const change = (row, name) => force(row[`peak_change_${name}_n`], true);
  $("orders").tBodies[0].replaceChildren(...rows.map((row) => {
    const line = make("tr");
    const name = several ? `${row.name}, ${ropeNames()[row.rope] ?? row.rope}` : row.name;
    const cells = [name, chance(row.tension), chance(row.slack), chance(row.contact),
      row.name === "hold" ? "–" : `${change(row, 50)} (${change(row, 5)} to ${change(row, 95)}) ${units().force}`];
    line.append(...cells.map((text) => make("td", "", text)));
    return line;
  }));
  $("compared").showModal();
}
