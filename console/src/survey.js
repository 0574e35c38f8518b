// Second page: profile to scale, touchdown, bend radius.

import { $, canvas, colour, figures, tick, ticks, write } from "./page.js";
import { crewLimit, facts, limit, payload, ropeNames, state } from "./link.js";
import { fixed, force, known, metres, units } from "./units.js";
import { offset, payloadRows } from "./winch.js";

let trueScale = false, drawn = null;
export const repaint = () => { drawn = null; };
export function start() {
  $("true-scale").onclick = () => {
    trueScale = !trueScale;
    $("true-scale").textContent = trueScale ? "Fill" : "True scale";
    drawn = null;
    draw();
  };
}

export function draw() {
  const values = state.values, one = payload(), name = ropeNames()[state.line];
  const named = (rows) => rows?.find((row) => row.name === name);
  const down = named(values.touchdowns), bend = named(values.bends);
  const least = bend ? Math.max(bend.minimum_radius_m ?? 0, crewLimit("bend_radius_m") ?? 0) || null : null; // the rope's or the crew's
  const [nearest, ...crossings] = values.crossings ?? []; // of two lines around a sheave
  figures($("survey-payload"), [
    ...payloadRows(values),
    one && values.body ? offset(values) : null,
    one ? ["East", metres(one.place_m[0], 1, true), "m"] : null,
    one ? ["North", metres(one.place_m[1], 1, true), "m"] : null,
  ]);
  figures($("survey-touchdown"), down ? [
    ["Layback", metres(down.layback_m), "m"], ["Line out to it", metres(down.line_out_m), "m"],
    ["Tension there", force(down.tension_n), units().force], ["Angle to the bed", fixed(down.angle_deg, 1), "°"],
    ["East", metres(down.x, 1, true), "m"], ["North", metres(down.y, 1, true), "m"], ["Depth", metres(known(down.z) ? -down.z : null), "m"],
  ] : [["Touchdown", values.touchdowns ? "none" : "no seabed in this scene", "", "wide"]]);
  figures($("survey-bend"), bend ? [
    ["Smallest now", metres(bend.radius_m, 2), "m", known(bend.radius_m) && known(least) && bend.radius_m < least ? "bad" : ""], ["Since the start", metres(bend.smallest_radius_m, 2), "m"],
    known(least) ? ["Minimum (MBR)", metres(least, 2), "m"] : null, ["At line out", metres(bend.line_out_m), "m"],
  ] : [["Bend radius", "not monitored", "", "wide"]]);
  const apart = limit("line_clearance_m");
  $("survey-lines").hidden = !nearest;
  if (nearest) figures($("survey-crossings"), [
    ["Crossings", String(crossings.length), ""], [`Nearest${known(apart) ? ` ≥ ${metres(apart, 1)}` : ""}`, metres(nearest.distance_m, 2), "m", known(apart) && nearest.distance_m < apart ? "bad" : ""],
    known(nearest.angle_deg) ? ["Angle there", fixed(nearest.angle_deg, 1), "°"] : null, ["Depth there", metres(known(nearest.z) ? -nearest.z : null), "m"],
  ]);
  shape();
}

function shape() {
  const ropes = state.profile;
  if (!ropes.length || ropes === drawn || !$("shape").clientWidth) return;
  drawn = ropes;
  const { context, width, height } = canvas($("shape"));
  const first = ropes[0], body = state.values.payloads ?? [], bed = facts().bed_m;
  // the horizontal axis points from the upper end of the first rope to its lower end
  const east = first.x_m[first.x_m.length - 1] - first.x_m[0], north = first.y_m[first.y_m.length - 1] - first.y_m[0];
  const reach = Math.hypot(east, north), [ue, un] = reach > 1e-6 ? [east / reach, north / reach] : [1, 0];
  const along = (x, y) => (x - first.x_m[0]) * ue + (y - first.y_m[0]) * un;
  const across = ropes.flatMap((rope) => rope.x_m.map((x, k) => along(x, rope.y_m[k])));
  const depths = ropes.flatMap((rope) => rope.z_m), low = Math.min(...depths, bed ?? 0), high = Math.max(...depths, 0);
  const span = Math.max(...across) - Math.min(...across), deep = high - low || 1;
  const box = { left: 56, right: width - 16, top: 22, bottom: height - 34 };
  const vertical = (box.bottom - box.top) / (deep * 1.06);
  const horizontal = trueScale ? vertical : (box.right - box.left) / Math.max(span * 1.15, 1e-3, deep * 0.01);
  const middle = (Math.max(...across) + Math.min(...across)) / 2, centre = (box.left + box.right) / 2;
  const x = (at) => centre + (at - middle) * horizontal, y = (z) => box.top + (high - z) * vertical;
  const factor = horizontal / vertical;
  write($("shape-note"), `bearing ${fixed((90 - Math.atan2(un, ue) * 180 / Math.PI + 360) % 360, 0)}°, horizontal ×${fixed(factor, factor < 10 ? 1 : 0)}`);
  context.strokeStyle = colour("--border-outline-color");
  context.fillStyle = colour("--element-neutral-color");
  context.lineWidth = 1;
  context.textAlign = "right";
  for (const at of ticks(low, high, 8)) {
    stroke(context, [[box.left, y(at)], [box.right, y(at)]]);
    context.fillText(tick(-at), box.left - 6, y(at) + 4);
  }
  context.textAlign = "center";
  const half = (box.right - box.left) / 2 / horizontal;
  for (const at of ticks(middle - half, middle + half, 6)) {
    stroke(context, [[x(at), box.top], [x(at), box.bottom]]);
    context.fillText(tick(at), x(at), box.bottom + 16);
  }
  context.fillText("m from the sheave", centre, height - 4);
  context.textAlign = "left";
  context.fillText("m deep", 0, 10);
  context.lineWidth = 2;
  context.strokeStyle = colour("--instrument-enhanced-secondary-color");
  stroke(context, [[box.left, y(0)], [box.right, y(0)]]);
  if (known(bed)) {
    context.strokeStyle = colour("--element-inactive-color");
    context.lineWidth = 4;
    stroke(context, [[box.left, y(bed)], [box.right, y(bed)]]);
  }
  const clear = limit("bed_clearance_m"), deepest = limit("payload_depth_m");
  context.strokeStyle = context.fillStyle = colour("--bad");
  context.lineWidth = 2;
  context.setLineDash([8, 5]);
  context.textAlign = "right";
  for (const [name, z] of [["clearance", known(bed) && known(clear) ? bed + clear : null], ["depth limit", known(deepest) ? -deepest : null]]) {
    if (z === null || z < low || z > high) continue;
    stroke(context, [[box.left, y(z)], [box.right, y(z)]]);
    context.fillText(name, box.right - 4, y(z) - 5);
  }
  context.setLineDash([]);
  ropes.forEach((rope, number) => {
    context.strokeStyle = colour("--instrument-enhanced-primary-color");
    context.lineWidth = number === state.line && ropes.length > 1 ? 5 : 2.5;
    stroke(context, rope.x_m.map((at, k) => [x(along(at, rope.y_m[k])), y(rope.z_m[k])]));
  });
  context.fillStyle = colour("--alert-warning-color");
  for (const one of body) {
    const [px, py, pz] = one.place_m;
    context.fillRect(x(along(px, py)) - 8, y(pz) - 6, 16, 12);
  }
  for (const one of state.values.touchdowns ?? []) {
    context.beginPath();
    context.arc(x(along(one.x, one.y)), y(one.z), 6, 0, 7);
    context.fill();
  }
}

function stroke(context, points) {
  context.beginPath();
  for (const [x, y] of points) context.lineTo(x, y);
  context.stroke();
}
