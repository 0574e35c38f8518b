// The first page: what a winch driver needs, on one screen.

import { $, figures, make, write } from "./page.js";
import { allowed, facts, leastTension, limit, own, payload, residual, rope, ropeNames, said, stale, state, winch, winchName, winchRow } from "./link.js";
import { commands, hasWinch } from "./control.js";
import { fixed, force, inUnits, known, metres, speed, units } from "./units.js";

export function draw() {
  const values = state.values;
  bigNumbers(rope(), winch());
  load(values);
  sea(values);
  gear(values, winch());
  risk(values);
  quality(values);
}

// Heave of the minute before the page connected.
export function fill(trend) {
  heaves.length = 0;
  (trend[0]?.heave_m ?? []).forEach((heave, number) => { if (known(heave) && number % 4 === 0) heaves.push([trend[0].time_s[number], heave]); });
}

const percent = (part) => `${Math.max(0, Math.min(100, 100 * part)).toFixed(1)}%`;

function bigNumbers(rope, winch) {
  const length = own("line_out_m"), rate = own("line_speed_m_per_s"), tension = own("tension_n");
  write($("line-out"), metres(length));
  compare($("line-out-measured"), residual("line_out_m"), (one, signed) => `${metres(one, 2, signed)} m`,
    winch ? `${metres(winch.min_line_out_m, 0)} to ${metres(winch.max_line_out_m, 0)} m` : "");
  $("line-out-meter").firstChild.style.width = winch && known(length) ? percent(length / winch.max_line_out_m) : "0%";
  write($("line-speed"), speed(rate, true));
  write($("line-speed-unit"), units().speed);
  const still = 0.5 / units().perSecond / 10 ** units().decimals;
  write($("direction"), !known(rate) || Math.abs(rate) < still ? "stopped" : rate > 0 ? "↓ paying out" : "↑ hauling in");
  write($("line-speed-under"), winch ? `limit ±${speed(winch.speed_limit_m_per_s)} ${units().speed}` : "");
  const share = winch && known(rate) ? Math.max(-1, Math.min(1, rate / winch.speed_limit_m_per_s)) : 0;
  const bar = $("line-speed-meter").firstChild;
  bar.style.left = `${50 + 50 * Math.min(0, share)}%`;
  bar.style.width = `${50 * Math.abs(share)}%`;
  write($("tension"), force(tension));
  const interval = own("error_interval");
  const half = interval && known(interval.upper_n) ? (interval.upper_n - interval.lower_n) / 2 : null;
  const error = half !== null ? `computed ± ${force(half)} ${units().force} (95 %)`
    : known(interval?.rms_pct) ? `computed, error ≤ ${fixed(interval.rms_pct, 2)} % RMS` : "computed";
  compare($("tension-measured"), residual("top_tension_n"), (one, signed) => `${force(one, signed)} ${units().force}`, error);
  const used = own("utilisation"), highest = used?.max_tension_n, top = allowed();
  const meter = $("tension-meter"), full = top ? top * 1.1 : null;
  meter.children[0].style.width = full && known(tension) ? percent(tension / full) : "0%";
  place(meter.children[1], full && known(highest) ? highest / full : null);
  place(meter.children[2], full ? top / full : null);
  meter.classList.toggle("alarm", known(tension) && known(top) && tension > top);
  meter.classList.toggle("warning", known(tension) && known(top) && tension > 0.95 * top && tension <= top);
  const load = used && known(used.utilisation) && used.utilisation > 0 ? highest / used.utilisation : rope.breaking_load_n;
  write($("utilisation"), known(tension) && known(load) ? fixed(100 * tension / load, 1) : "–");
  write($("utilisation-under"), known(load)
    ? `of MBL ${force(load)} ${units().force}${known(used?.utilisation) ? `, max. ${fixed(100 * used.utilisation, 1)} %` : ""}` : "");
  write($("highest"), `${force(highest)} ${units().force}`);
  write($("amplification"), fixed(used?.dynamic_amplification, 2));
  write($("static"), `${force(used?.static_tension_n)} ${units().force}`);
}

function place(mark, share) {
  mark.style.display = share === null ? "none" : "block";
  if (share !== null) mark.style.left = `calc(${percent(share)} - 2px)`;
}

// Measured beside computed with the residual, or other words where nothing is measured.
export function compare(element, row, text, other) {
  // A residual keeps the last reading of an instrument that is lost: only its age tells.
  if (!row || !known(row.measured) || row.age_s > 3) {
    delete element.dataset.key;
    if (element.textContent !== other) element.textContent = other;
    return;
  }
  const outside = known(row.upper) && (row.residual > row.upper || row.residual < row.lower);
  const key = `measured ${text(row.measured, false)}  Δ ${text(row.residual, true)}`;
  if (element.dataset.key === key + outside) return;
  element.dataset.key = key + outside;
  element.replaceChildren("measured ", make("b", "", text(row.measured, false)), "  Δ ",
    make("b", outside ? "out" : "", text(row.residual, true)));
}

const LANDING_M = 20; // above the bed: from there on a crew watches the speed of landing
const most = (value, text) => known(value) ? ` ≤ ${text(value)}` : "";
const beyond = (is, value) => known(value) && is ? "bad" : "";

export function offset(values) {
  const [x, y] = payload().place_m, [x0 = 0, y0 = 0] = values.hang_off_m ?? [];
  return ["Offset", metres(Math.hypot(x - x0, y - y0)), "m"];
}

export function payloadRows(values) {
  const one = payload(), bed = values.bed?.[0];
  if (!one) return [["Depth", "–", "m"]];
  const [, , z] = one.place_m, [vx, vy, vz] = one.velocity_m_per_s;
  const body = values.body?.[0], held = known(bed?.payload_reaction_n) && bed.payload_reaction_n > 0;
  const bedZ = facts().bed_m, height = known(bed?.payload_height_m) ? bed.payload_height_m : known(bedZ) ? z - bedZ : null;
  const fast = Math.hypot(vx, vy, vz), deepest = limit("payload_depth_m"), fastest = limit("payload_speed_m_per_s");
  const clear = limit("bed_clearance_m"), landing = limit("landing_speed_m_per_s");
  return [
    [`Depth${most(deepest, (one) => metres(one, 0))}`, metres(known(z) ? -z : null), "m", beyond(-z > deepest, deepest)],
    [known(fastest) ? `Speed${most(fastest, speed)}` : "Vertical speed", known(vz) ? `${vz < 0 ? "↓" : "↑"} ${speed(Math.abs(vz))}` : "–", units().speed, beyond(fast > fastest, fastest)],
    height === null ? null : [known(clear) ? `Height ≥ ${metres(clear, 0)}` : "Above the bed", metres(height), "m", beyond(height < clear, clear)],
    known(landing) && known(height) && height < LANDING_M && !held ? [`Landing${most(landing, speed)}`, speed(Math.max(0, -vz)), units().speed, beyond(-vz > landing, landing)] : null,
    body ? null : offset(values),
    body ? ["Roll, pitch", `${fixed(one.attitude_deg[0], 1, true)}, ${fixed(one.attitude_deg[1], 1, true)}`, "°"] : null,
    body ? ["Heading", fixed((90 - one.attitude_deg[2] + 720) % 360, 0), "°"] : null,
    height === null && !body ? ["Speed", speed(Math.hypot(vx, vy, vz)), units().speed] : null,
    held ? ["On the bed", force(bed.payload_reaction_n), units().force] : null,
  ];
}

function load(values) {
  write($("payload-name"), rope().payload || payload()?.name || "");
  const depth = residual("payload_depth_m"), rows = payloadRows(values);
  if (depth && known(depth.measured)) rows.push(["Measured, Δ", `${metres(depth.measured)}, ${metres(depth.residual, 1, true)}`, "m"]);
  const line = state.profile[state.line], least = leastTension();
  const weight = ropeNames().length < 2 ? facts().payloads?.[0]?.submerged_n : null; // else lines share it
  if (line && known(line.min_n)) {
    const margin = line.min_n - (known(least) ? least : 0);
    rows.push(["Slack margin", force(margin, margin < 0), units().force, margin < 0 ? "bad" : ""]);
    if (known(weight) && weight > 0) rows.push(["Margin/weight", fixed(100 * line.min_n / weight, 0), "%"]);
  }
  figures($("payload-figures"), rows);
}

const heaves = [];
function sea(values) {
  const place = values.hang_off_m, rate = values.hang_off_m_per_s, mean = facts().hang_off_m?.[2];
  const heave = known(place?.[2]) ? place[2] - (known(mean) ? mean : 0) : null;
  if (known(heave) && known(state.timeS)) {
    const last = heaves[heaves.length - 1];
    if (last && state.timeS < last[0]) heaves.length = 0;
    if (!last || state.timeS > last[0] + 0.15) heaves.push([state.timeS, heave]);
    while (heaves.length && heaves[0][0] < state.timeS - 600) heaves.shift();
  }
  const given = facts().sea ?? {}, spread = deviation(heaves.map((one) => one[1]));
  const unit = values.compensator?.[0];
  figures($("sea-figures"), [
    ["Heave", metres(heave, 2, true), "m"],
    ["Heave rate", fixed(rate?.[2], 2, true), "m/s"],
    heaves.length > 100 ? ["Sign. heave, 4σ", metres(4 * spread, 1), "m"] : null,
    known(values.elevation_m) ? ["Sea surface", metres(values.elevation_m, 2, true), "m"] : null,
    known(given.significant_height_m) ? ["Sea Hs, Tp", `${metres(given.significant_height_m)}, ${fixed(given.peak_period_s, 1)}`, "m, s"] : null,
    unit ? ["Hook compensator", metres(unit.stroke_m, 2), "m stroke"] : null,
  ]);
}

function deviation(values) {
  const mean = values.reduce((sum, one) => sum + one, 0) / values.length;
  return Math.sqrt(values.reduce((sum, one) => sum + (one - mean) ** 2, 0) / values.length);
}

const within = (value, unit) => known(value) ? ` ±${fixed(value, 1)} ${unit}` : "";

function gear(values, winch) {
  const row = winchRow() ?? {};
  const [, mode = "–", limit = ""] = /^([^(]*?)(?: \((.*)\))?$/.exec(said(values.winch_mode)) ?? [];
  const name = ropeNames().length > 1 ? `${winchName()} · ` : "";
  write($("mode"), hasWinch() ? name + (inUnits(mode) || "–") : "none in this scene");
  write($("winch-limit"), limit && inUnits(limit));
  $("winch-limit").title = limit;
  const seat = said(values.seat);
  write($("winch-seat"), seat && `Seat: ${seat}`);
  const turn = layer(row.drum_radius_m, winch);
  const rows = [
    "brake_holds" in row && !commands() ? ["Brake", row.brake_holds ? "set" : "released", ""] : null, // else on its button
    "compensation_on" in row && !commands() ? ["Compensation", row.compensation_on ? "on" : "off", ""] : null,
    "compensation_m" in row && known(row.compensation_m) ? [`AHC${within(winch?.compensation_stroke_m, "m")}`, metres(row.compensation_m, 2, true), "m"] : null,
    known(row.compensation_m_per_s) ? [`AHC${within(winch?.compensation_speed_m_per_s, "m/s")}`, fixed(row.compensation_m_per_s, 2, true), "m/s"] : null,
    turn === null ? null : ["Drum layer", String(turn), `r ${metres(row.drum_radius_m, 2)} m`],
    known(row.drum_radius_m) && turn === null ? ["Drum radius", metres(row.drum_radius_m, 2), "m"] : null,
    known(row.motor_torque_n_m) ? ["Motor torque", fixed(row.motor_torque_n_m / 1000, 0, true), "kN·m"] : null,
    known(row.brake_torque_n_m) && row.brake_holds ? ["Brake torque", fixed(row.brake_torque_n_m / 1000, 0, true), "kN·m"] : null,
  ];
  figures($("winch-figures"), rows);
}

// Layer of the drum from the radius at which the rope runs: 0.9 d more for each (facts of the scene).
function layer(radius, winch) {
  if (!known(radius) || !known(winch?.drum_radius_m) || !known(winch?.layer_rise_m)) return null;
  return Math.max(1, Math.round((radius - winch.drum_radius_m) / winch.layer_rise_m + 0.5));
}

const SPANS = [10, 20, 30];
function risk(values) {
  const rows = SPANS.map((span) => values.risk?.rows.find((row) => row.span_s === span)).filter(Boolean), holder = $("risk");
  const why = rows.length ? "" : notForecast(values);
  const last = stale("forecast/risk") ? notForecast(values) : quiet(values), key = JSON.stringify([rows, last, units().name, why]);
  if (holder.dataset.key === key) return;
  holder.dataset.key = key;
  holder.className = rows.length ? "known" : "empty";
  if (!rows.length) {
    holder.replaceChildren(why);
    return;
  }
  const limit = rows[0].tension_limit_n, heads = rows.map((row) => `${row.span_s} s`);
  const line = (label, texts, kind) => [make("span", "k", label), ...texts.map((text) => make("span", kind, text))];
  const chance = (name) => rows.map((row) => known(row[name]) ? `${fixed(100 * row[name], 0)} %` : "–");
  const guess = make("span", "k", "climatology"), sure = rows.filter((row) => !row.climatology);
  guess.style.gridColumn = `span ${Math.max(1, rows.length - sure.length)}`;
  holder.replaceChildren(
    ...line("", heads, "k"), ...line(`P(> ${fixed(limit * units().newton, 0)} ${units().force})`, chance("tension"), "v"),
    ...line("P(slack)", chance("slack"), "v"),
    ...line("Heave", sure.map(() => "known"), "k"), ...(sure.length < rows.length ? [guess] : []),
    make("div", "k all", last));
}

// Why no forecast comes, in the words of the node that makes them.
function notForecast(values) {
  const worker = values["diagnostics forecast: worker"];
  if (worker) return `No forecast: ${worker.message}`;
  return state.hello?.kind === "recording" ? "No forecast in this recording" : "No forecast: none is made in this run";
}

// The surest quiet window, or the first of those that are equally sure; begins are from the origin.
function quiet(values) {
  const windows = (values.quiet?.rows ?? []).filter((row) => known(row.probability));
  if (!windows.length) return "Quiet window unknown";
  const best = windows.reduce((one, other) => other.probability > one.probability ? other : one);
  const begin = known(values.quiet.at_s) && known(state.timeS) ? values.quiet.at_s + best.begin_s - state.timeS : best.begin_s;
  const from = begin < 0.5 ? "now" : `in ${fixed(begin, 0)} s`, reach = values.risk?.rows[0]?.horizon_s;
  const doubt = known(reach) && best.begin_s + best.length_s <= reach ? "" : ", climatology";
  return `Quiet ${fixed(best.length_s, 0)} s (< ${speed(best.speed_limit_m_per_s)} ${units().speed}) ${from}: ${fixed(100 * best.probability, 0)} %${doubt}`;
}

const LABELS = { top_tension: "Top tension", payload_depth: "Payload depth", slack: "Slack", fatigue: "Fatigue", forecast: "Forecast" };
function quality(values) {
  const rows = values.quality ?? [], holder = $("quality");
  if (!rows.length) { if (!holder.classList.contains("empty")) { holder.className = "empty"; holder.textContent = "No index"; } return; }
  const message = values["diagnostics simulation: quality"]?.message ?? "";
  const reason = message.replace(/^lowest index [\d.]+ \(([^)]*)\),? ?/, (_, one) => `${one[0].toUpperCase()}${one.slice(1)} `);
  const key = JSON.stringify([rows.map((row) => [row.name, row.index, row.cause]), reason]);
  if (holder.dataset.key === key) return;
  holder.dataset.key = key;
  holder.className = "";
  holder.replaceChildren(...rows.map((row) => {
    const line = make("div", "index"), bar = make("div", "bar2"), full = make("i");
    if (row.index < 0.5) bar.classList.add("warning"); // as their alerts
    else if (row.index < 0.7 - 1e-6) bar.classList.add("caution");
    full.style.width = percent(row.index ?? 0);
    bar.append(full);
    line.append(make("span", "", LABELS[row.name] ?? row.name), make("b", "", fixed(row.index, 2)), bar);
    return line;
  }), make("div", "reason", reason));
}
