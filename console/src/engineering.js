// Third page: diagnostics, residuals, components of the quality index, learned figures, solver and link.

import { $, figures, icon, make, write } from "./page.js";
import { state } from "./link.js";
import { fixed, force, known, metres, units } from "./units.js";

const NAMES = { top_tension_n: "Top tension", line_out_m: "Line out", payload_depth_m: "Payload depth" };
const shown = new Map();

export function draw() {
  const values = state.values;
  const rows = Object.entries(values).filter(([key]) => key.startsWith("diagnostics "))
    .sort(([one, a], [other, b]) => b.level - a.level || one.localeCompare(other));
  table("diagnostics", rows.map(([key, row]) => [level(row.level), key.slice(12), row.message]));
  table("residuals", (values.residuals ?? []).map((row) => {
    const newton = row.quantity.endsWith("_n");
    const text = (value, signed = false) => newton ? `${force(value, signed)} ${units().force}` : `${metres(value, 2, signed)} m`;
    return [`${NAMES[row.quantity] ?? row.quantity} (${row.name})`, text(row.measured), text(row.computed),
      text(row.residual, true), known(row.upper) ? `±${text(row.upper)}` : "–", text(row.rms),
      known(row.outside) ? `${fixed(100 * row.outside, 0)} %` : "–"];
  }), "Nothing is measured");
  table("components", (values.quality ?? []).map((row) => [row.name.replace("_", " "), fixed(row.index, 2),
    ...["input", "numerics", "discretisation", "validity", "residual", "history"].map((one) => fixed(row[one], 2))]), "No index");
  learned(values);
  const run = diagnosed("solver"), accuracy = diagnosed("accuracy level"), error = values.error_interval?.[0];
  const pace = diagnosed("pacing") ?? diagnosed("pace");
  figures($("solver-figures"), [
    run ? ["Solver", run.message, "", "wide"] : null,
    ...Object.entries(pace?.values ?? {}).filter(([, text]) => text.length < 16).slice(0, 6).map(([label, text]) => [label, text, ""]),
    ...Object.entries(accuracy?.values ?? {}).filter(([, text]) => text.length < 16).slice(0, 4).map(([label, text]) => [label, text, ""]),
    ["Error bound, RMS", fixed(error?.rms_pct, 2), "%"],
    ["95 % interval", known(error?.lower_n) ? `${force(error.lower_n)} to ${force(error.upper_n)}` : "–", known(error?.lower_n) ? units().force : ""],
    ["Rows received", String(state.rows), ""], ["Rows lost", String(state.lost), ""],
  ]);
}

// Figures learned from the measured tension, and the alarm of the fault tests beside learning.
function learned(values) {
  const until = values.learned?.at_s, alarm = values.fault_alarm;
  write($("learned-until"), known(until) ? `until ${fixed(until, 0)} s` : "");
  write($("fault-alarm"), alarm ? `Fault alarm: ${alarm}` : alarm === "" ? "Fault alarm acknowledged" : "No fault alarm");
  $("fault-alarm").className = alarm ? "fault" : "quiet";
  table("learned", (values.learned?.rows ?? []).map((row) => {
    const unit = row.unit === "-" ? "" : ` ${row.unit}`;
    return [row.name.replaceAll("_", " "), digits(row.value) + unit, `${digits(row.low)} to ${digits(row.high)}`,
      digits(row.prior), row.state, fixed(row.correlation, 2, true)];
  }), "Nothing is learned");
}

// Four significant digits, with an exponent from a million up.
function digits(value) {
  if (!known(value)) return "–";
  return (Math.abs(value) < 1e6 ? String(Number(value.toPrecision(4))) : value.toExponential(3).replace("e+", "e")).replaceAll("-", "−");
}

const diagnosed = (name) => state.values[`diagnostics simulation: ${name}`];

function level(number) {
  const cell = make("span", "dot");
  if (number) cell.append(icon(number >= 2 ? "alarm-acknowledged" : "warning-acknowledged"));
  cell.append(["OK", "WARN", "ERROR", "STALE"][number] ?? String(number));
  return cell;
}

// Fill a table with rows of text or elements, if they have changed.
export function table(id, rows, empty = "–") {
  const key = JSON.stringify(rows.map((row) => row.map((one) => one instanceof Node ? one.textContent : one)));
  if (shown.get(id) === key) return;
  shown.set(id, key);
  const body = $(id).tBodies[0];
  if (!rows.length) {
    const row = make("tr"), cell = make("td", "quiet", empty);
    cell.colSpan = $(id).tHead.rows[0].cells.length;
    row.append(cell);
    body.replaceChildren(row);
    return;
  }
  body.replaceChildren(...rows.map((cells) => {
    const row = make("tr");
    for (const one of cells) {
      const cell = make("td", String(one.textContent ?? one).length < 18 ? "n" : "");
      cell.append(one);
      row.append(cell);
    }
    return row;
  }));
}
