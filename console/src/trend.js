// Trend of the tension: computed, measured, error interval, forecast band, and limits.

import uPlot from "uplot";
import { $, colour, tick } from "./page.js";
import { allowed, leastTension, rope, stale, state } from "./link.js";
import { force, known, units } from "./units.js";

const WINDOW_S = 60, AHEAD_S = 30;
let chart = null, lines = [], dirty = false, toLimit = false, hasForecast = false, horizonAt = null, legendKey = "";

export function start() {
  build();
  new ResizeObserver(() => resize()).observe($("trend"));
  $("scale").onclick = toggleScale;
}

export function toggleScale() {
  toLimit = !toLimit;
  $("scale").textContent = toLimit ? "Zoom" : "To limit";
  dirty = true;
}

const empty = () => ({ time: [], tension: [], low: [], high: [], measured: [] });

// Columns of each rope, which the server sends when the page connects.
export function fill(trends) {
  lines = trends.map((trend) => ({ time: [...trend.time_s], tension: [...trend.tension_n], low: [...trend.low_n],
    high: [...trend.high_n], measured: [...trend.measured_n] }));
  dirty = true;
}

// Newest row of each rope.
export function add(rows) {
  while (lines.length < rows.length) lines.push(empty());
  rows.forEach((row, number) => append(lines[number], row));
  dirty = true;
}

function append(columns, row) {
  const { time, tension, low, high, measured } = columns;
  if (time.length && row.time_s < time[time.length - 1]) for (const one of Object.values(columns)) one.length = 0;
  time.push(row.time_s);
  tension.push(row.tension_n);
  low.push(row.low_n);
  high.push(row.high_n);
  measured.push(row.measured_n);
  const from = row.time_s - WINDOW_S;
  let old = 0;
  while (time[old] < from) old += 1;
  if (old) for (const one of Object.values(columns)) one.splice(0, old);
}

export function draw() {
  const columns = lines[state.line];
  if (!dirty || !chart || !columns?.time.length) return;
  dirty = false;
  const scale = units().newton, scaled = (values) => values.map((one) => one === null ? null : one * scale);
  const now = columns.time[columns.time.length - 1];
  const band = ahead(now);
  hasForecast = band.length > 0;
  legend(columns);
  horizonAt = hasForecast ? horizon(now) : null;
  const past = (values) => [...scaled(values), ...band.map(() => null)];
  const next = (name) => [...columns.time.map(() => null), ...scaled(band.map((row) => row[name]))];
  chart.setData([[...columns.time.map((one) => one - now), ...band.map((row) => row.at)], past(columns.tension),
    past(columns.measured), past(columns.low), past(columns.high), next("low"), next("median"), next("high")]);
}

// The forecast band after now. Its leads count from its origin, which is older than the newest tension.
function ahead(now) {
  const { forecast, forecast_ropes: ropes } = state.values, origin = (state.line ? ropes : forecast)?.at_s;
  const { lead_s: leads, low_n: low, median_n: median, high_n: high } = (state.line ? ropes?.bands[state.line] : forecast) ?? {};
  if (!known(origin) || !leads || stale(state.line ? "forecast/ropes" : "forecast/tension")) return [];
  return leads.map((lead, number) => ({ at: origin + lead - now, low: low[number], median: median[number], high: high[number] }))
    .filter((row) => row.at > 0 && row.at <= AHEAD_S);
}

// Time after now from which the band is the climatology of this sea; null: unknown, or not within the chart.
function horizon(now) {
  const risk = state.values.risk, origin = risk?.at_s, reach = risk?.rows?.[0]?.horizon_s;
  if (!known(origin) || !known(reach)) return null;
  const at = Math.max(0, origin + reach - now);
  return at < AHEAD_S ? at : null;
}

export const repaint = () => { if (chart) { chart.destroy(); build(); dirty = true; } };

function limits() {
  const most = allowed(), breaking = rope().breaking_load_n, found = [];
  if (known(most)) found.push(["limit", most]);
  if (known(most) && breaking > most * 1.001) found.push(["MBL", breaking]);
  const least = leastTension();
  if (known(least)) found.push(["slack", least]);
  return found;
}

function yRange(self, low, high) {
  if (low === null || high === null) return [0, 1];
  const [limit] = limits();
  if (toLimit && limit) return [0, Math.max(high, limit[1] * units().newton) * 1.05];
  const margin = Math.max(0.15 * (high - low), 0.01 * Math.abs(high), 1e-3);
  return [low - margin, high + margin];
}

function marks(self) {
  const { ctx, bbox } = self, ratio = window.devicePixelRatio || 1;
  ctx.save();
  ctx.font = `600 ${12 * ratio}px 'Noto Sans', sans-serif`;
  ctx.textAlign = "right";
  for (const [name, newton] of limits()) {
    const y = self.valToPos(newton * units().newton, "y", true);
    const text = `${name} ${force(newton)} ${units().force}`;
    ctx.strokeStyle = ctx.fillStyle = colour("--bad");
    if (y >= bbox.top && y <= bbox.top + bbox.height) {
      ctx.lineWidth = 2 * ratio;
      ctx.setLineDash([8 * ratio, 5 * ratio]);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
      ctx.fillText(text, bbox.left + bbox.width - 6 * ratio, y - 5 * ratio);
    } else if (name === "limit") {
      ctx.fillText(`${text} ▲`.replace("▲", y < bbox.top ? "↑" : "↓"), bbox.left + bbox.width - 6 * ratio,
        y < bbox.top ? bbox.top + 15 * ratio : bbox.top + bbox.height - 6 * ratio);
    }
  }
  if (hasForecast) {
    const x = self.valToPos(0, "x", true);
    ctx.setLineDash([]);
    ctx.lineWidth = ratio;
    ctx.strokeStyle = colour("--element-inactive-color");
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    if (horizonAt !== null) {
      const from = self.valToPos(horizonAt, "x", true);
      ctx.setLineDash([3 * ratio, 4 * ratio]);
      ctx.beginPath();
      ctx.moveTo(from, bbox.top);
      ctx.lineTo(from, bbox.top + bbox.height);
      ctx.stroke();
      ctx.textAlign = "left";
      ctx.fillStyle = colour("--element-neutral-color");
      if (bbox.left + bbox.width - from > 80 * ratio) ctx.fillText("climatology", from + 5 * ratio, bbox.top + bbox.height - 6 * ratio);
    }
  }
  ctx.restore();
}

// Only of what is drawn.
function legend({ measured, low }) {
  const rows = [["computed", "computed"]];
  if (measured.some(known)) rows.push(["measured", "measured"]);
  if (low.some(known)) rows.push(["band computed", "95 %"]);
  if (hasForecast) rows.push(["band computed", "forecast 5–95 %"]);
  const key = rows.join();
  if (key === legendKey) return;
  legendKey = key;
  $("trend-legend").replaceChildren(...rows.map(([kind, text]) => {
    const span = document.createElement("span");
    span.className = kind;
    span.textContent = text;
    return span;
  }));
}

function faint(name, share) {
  const found = colour(name).match(/[\d.]+/g);
  return found ? `rgba(${found.slice(0, 3).join(",")},${share})` : colour(name);
}

function build() {
  const holder = $("trend"), line = colour("--instrument-enhanced-primary-color");
  const axis = { stroke: colour("--element-neutral-color"), font: "13px 'Noto Sans', sans-serif",
    grid: { stroke: colour("--border-outline-color"), width: 1 }, ticks: { show: false } };
  const none = { show: true, stroke: "transparent", width: 0, points: { show: false } };
  chart = new uPlot({
    width: Math.max(holder.clientWidth, 100), height: Math.max(holder.clientHeight, 80),
    cursor: { show: false }, legend: { show: false }, padding: [8, 18, 0, 0],
    scales: { x: { time: false, range: () => [-WINDOW_S, hasForecast ? AHEAD_S : 0] }, y: { range: yRange } },
    axes: [
      { ...axis, values: (_, at) => at.map((one) => one === 0 ? "now" : `${one > 0 ? "+" : "−"}${Math.abs(one)} s`), size: 28, gap: 6 },
      { ...axis, values: (_, at) => at.map(tick), size: 58, gap: 4 },
    ],
    series: [
      {},
      { stroke: line, width: 2, points: { show: false } },
      { stroke: colour("--alert-warning-color"), width: 2, points: { show: false }, spanGaps: true },
      none, none, none,
      { stroke: line, width: 2, dash: [6, 4], points: { show: false } },
      none,
    ],
    bands: [
      { series: [4, 3], fill: faint("--instrument-enhanced-primary-color", 0.25) },
      { series: [7, 5], fill: faint("--instrument-enhanced-primary-color", 0.18) },
    ],
    hooks: { draw: [marks] },
  }, [[], [], [], [], [], [], [], []], holder);
}

function resize() {
  const holder = $("trend");
  if (chart && holder.clientWidth > 50 && holder.clientHeight > 50) {
    chart.setSize({ width: holder.clientWidth, height: holder.clientHeight });
  }
}
