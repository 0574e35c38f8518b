// Tension along the rope with its range of the last minute, over the length down from the sheave.

import { $, canvas, colour, tick, ticks } from "./page.js";
import { allowed, leastTension, state } from "./link.js";
import { force, known, units } from "./units.js";

let drawn = null;
export const repaint = () => { drawn = null; };

export function draw() {
  const rope = state.profile[state.line];
  if (!rope || rope === drawn || !$("along").clientWidth) return;
  drawn = rope;
  const { context, width, height } = canvas($("along"));
  const limit = allowed(), least = leastTension();
  const low = Math.min(0, ...rope.low_n), high = Math.max(...rope.high_n) * 1.08;
  const length = rope.along_m[rope.along_m.length - 1];
  const box = { left: 44, right: width - 10, top: 22, bottom: height - 20 };
  const x = (newton) => box.left + (newton - low) / (high - low) * (box.right - box.left);
  const y = (metres) => box.top + metres / length * (box.bottom - box.top);
  context.lineWidth = 1;
  context.fillStyle = colour("--element-neutral-color");
  context.strokeStyle = colour("--border-outline-color");
  const scale = units().newton;
  context.textAlign = "center";
  for (const at of ticks(low * scale, high * scale, 3)) {
    line(context, x(at / scale), box.top, x(at / scale), box.bottom);
    if (x(at / scale) < width - 44) context.fillText(tick(at), x(at / scale), box.top - 6); // beside the unit
  }
  context.textAlign = "right";
  for (const at of ticks(0, length, 5)) {
    line(context, box.left, y(at), box.right, y(at));
    context.fillText(tick(at), box.left - 6, y(at) + 4);
  }
  context.fillText(`${units().force}`, width - 2, 12);
  context.textAlign = "left";
  context.fillText("m", 0, 12);
  context.fillStyle = colour("--instrument-enhanced-primary-color");
  context.globalAlpha = 0.28;
  context.beginPath();
  rope.along_m.forEach((at, k) => context.lineTo(x(rope.low_n[k]), y(at)));
  for (let k = rope.along_m.length - 1; k >= 0; k -= 1) context.lineTo(x(rope.high_n[k]), y(rope.along_m[k]));
  context.fill();
  context.globalAlpha = 1;
  context.strokeStyle = colour("--instrument-enhanced-primary-color");
  context.lineWidth = 2.5;
  context.beginPath();
  rope.along_m.forEach((at, k) => context.lineTo(x(rope.tension_n[k]), y(at)));
  context.stroke();
  context.strokeStyle = context.fillStyle = colour("--bad");
  context.setLineDash([6, 4]);
  context.lineWidth = 2;
  for (const value of [limit, least]) {
    if (known(value) && value < high) line(context, x(value), box.top, x(value), box.bottom);
  }
  context.setLineDash([]);
  context.fillStyle = colour("--element-neutral-color");
  context.textAlign = "left";
  const text = `${Math.round(rope.span_s)} s: min ${force(rope.min_n)} ${units().force} at ${Math.round(rope.min_at_m)} m`;
  context.fillText(text, 0, height - 3);
}

function line(context, x1, y1, x2, y2) {
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.stroke();
}
