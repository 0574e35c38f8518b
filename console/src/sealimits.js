// What the load chart of a plan allows in the sea that a page has entered.

import { $, make, toast, write } from "./page.js";
import { signIn } from "./control.js";
import { request, state } from "./link.js";
import { fixed, known } from "./units.js";
import { table } from "./engineering.js";

const FIELDS = ["hs", "tp", "heading"];

export function start() {
  $("sea").onsubmit = async (event) => {
    event.preventDefault();
    if (state.control?.allowed && !(await signIn())) return; // with control, entries need the token
    const [hs_m, tp_s, heading_deg] = FIELDS.map((name) => $(`sea-${name}`).valueAsNumber);
    const answer = await request({ do: "sea", hs_m, tp_s, heading_deg });
    if (!answer.ok) toast(answer.words, false);
  };
}

export function draw() {
  const chart = state.sea_limits, sea = chart?.sea;
  $("sea-limits").hidden = !chart;
  if (!chart) return;
  const about = chart.other_scene ? `plan ${chart.plan} is of scene ${chart.scene}, not of this one` : `plan ${chart.plan}`;
  const age = sea ? `, sea entered ${fixed(sea.age_s / 60, 0)} min ago` : "";
  write($("sea-note"), about + age);
  $("sea-note").classList.toggle("fault", chart.other_scene);
  table("sea-table", chart.rows.map((row) => {
    const depths = row.from_m === row.to_m ? fixed(row.from_m, 0) : `${fixed(row.from_m, 0)} to ${fixed(row.to_m, 0)}`;
    const verdict = row.may === null ? "enter the sea" : row.may ? "allowed" : "NOT ALLOWED";
    return [row.here ? make("strong", "", `${row.phase}, here`) : row.phase, `${depths} m`,
      known(row.allowed_hs_m) ? `${fixed(row.allowed_hs_m, 2)} m` : "–",
      row.may === false ? make("strong", "fault", verdict) : verdict];
  }));
}
