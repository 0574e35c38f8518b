// Fourth page: casts and markers of this console, and their export.

import { $, ask, make, toast, write } from "./page.js";
import { crewLimit, facts, request, rope, ropeNames, state } from "./link.js";
import { commands, setLimit, signIn } from "./control.js";
import { duration, fixed, force, known, metres, speed, units } from "./units.js";
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
  $("print").onclick = () => window.print();
  window.addEventListener("beforeprint", sheet);
  window.addEventListener("afterprint", () => { $("sheet").hidden = true; });
  $("new-cast").onclick = async () => {
    if (!(await ask("Begin a new cast?", "Maxima and minima of the cast start again.", "Begin"))) return;
    if (!(await mayWrite())) return;
    const answer = await request({ do: "new_cast" });
    if (!answer.ok) toast(answer.words, false);
  };
}

// Head of the printed sheet: what was lifted, when, and what the twin said of it then.
function sheet() {
  const values = state.values, alerts = (values.alerts ?? []).filter((one) => !one.shelved);
  const quality = (values.quality ?? []).map((row) => `${row.name.replace("_", " ")} ${fixed(row.index, 2)}`);
  const lines = [
    `Printed ${new Date().toISOString().slice(0, 16).replace("T", " ")} UTC, twin ${fixed(state.timeS, 1)} s. Extremes are those that the console has seen${ropeNames().length > 1 ? `, of ${ropeNames()[state.line]}` : ""}.`,
    `Quality index: ${quality.join(", ") || "none"}. Alerts: ${alerts.map((one) => `${one.priority} ${one.title}: ${one.text} (${one.state})`).join("; ") || "none"}.`,
  ];
  $("sheet").replaceChildren(make("h2", "", `${facts().scene ?? state.source?.name ?? "rope_twin"}: casts`), ...lines.map((one) => make("p", "", one)));
  $("sheet").hidden = false;
}

const FORCE = { unit: () => units().force, si: () => 1 / units().newton, show: force };
const SPEED = { unit: () => units().speed, si: () => 1 / units().perSecond, show: speed };
const METRES = { unit: () => "m", si: () => 1, show: (value) => metres(value) };
const LIMITS = {
  tension_n: { label: "tension", ...FORCE }, min_tension_n: { label: "minimum tension", ...FORCE },
  utilisation: { label: "utilisation", unit: () => "% of MBL", si: () => 0.01, show: (value) => fixed(100 * value, 1) },
  bend_radius_m: { label: "bend radius", ...METRES }, payload_depth_m: { label: "payload's depth", ...METRES },
  payload_speed_m_per_s: { label: "payload's speed", ...SPEED }, landing_speed_m_per_s: { label: "landing speed", ...SPEED },
  bed_clearance_m: { label: "height above the bed", ...METRES }, line_clearance_m: { label: "distance of the two lines", ...METRES },
};

// Limits of scene and crew; whoever has the seat may set stricter ones than the scene's.
function limits() {
  const possible = (facts().crew_limits ?? []).filter((one) => LIMITS[one.name]);
  write($("limits-note"), commands() ? "" : "set by the page with the seat");
  table("limits", possible.map(({ name, at_least: least, scene, lacks }) => {
    const one = LIMITS[name], text = (value) => known(value) ? `${least ? "≥" : "≤"} ${one.show(value)} ${one.unit()}` : "none";
    const row = [one.label[0].toUpperCase() + one.label.slice(1), text(name === "tension_n" ? rope().allowed_n : scene), text(crewLimit(name)), "–"];
    if (lacks) row[2] = `needs ${lacks}`;
    else if (commands()) {
      row[3] = make("button", "small", "Set …");
      row[3].setAttribute("aria-label", `Set the limit of the ${one.label}`);
      row[3].onclick = () => setLimit({ name, label: one.label, unit: one.unit(), si: one.si() });
    }
    return row;
  }), "The scene is not known");
}

// With control, entries need the token: the log belongs to those who may command.
const mayWrite = async () => !state.control?.allowed || signIn();

const clock = (seconds) => seconds === null || seconds === undefined ? "–" : new Date(seconds * 1000).toISOString().slice(5, 19).replace("T", " ");

export function draw() {
  limits();
  const log = state.log ?? { casts: [], markers: [] };
  table("casts", log.casts.map((one) => {
    const own = one.ropes[state.line] ?? {};
    return [String(one.number), clock(one.from_s), one.open ? "running" : clock(one.to_s),
      duration(one.to_s - one.from_s), `${metres(own.deepest_m)} m`, `${metres(own.longest_m)} m`,
      `${force(own.max_n)} ${units().force}`, `${force(own.min_n)} ${units().force}`];
  }), "No cast yet");
  table("marks", [...log.markers].reverse().map((one) => [clock(one.at_s), `${one.time_s === null ? "–" : one.time_s.toFixed(1)} s`, one.text, one.page]), "No marker yet");
}
