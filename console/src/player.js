// Controls of a recorded run: play, pause, position and rate.

import { $, toast, write } from "./page.js";
import { on, request, state } from "./link.js";
import { duration } from "./units.js";

const RATES = [0.25, 0.5, 1, 2, 5, 10];
let dragging = false;

export function start() {
  $("rate").replaceChildren(...RATES.map((one) => new Option(`× ${one}`, String(one), one === 1)));
  $("play").onclick = async () => {
    const { paused, position_s: at, duration_s: end } = state.source;
    if (!paused && at >= end) await request({ do: "seek", time_s: 0 });
    else await request({ do: paused ? "play" : "pause" });
  };
  $("position").oninput = () => { dragging = true; };
  $("position").onchange = async () => {
    const answer = await request({ do: "seek", time_s: Number($("position").value) });
    dragging = false;
    if (!answer.ok) toast(answer.words, false);
  };
  $("rate").onchange = () => request({ do: "rate", rate: Number($("rate").value) });
  on("hello", draw);
  on("state", draw);
}

function draw() {
  const recording = state.hello?.kind === "recording", { position_s: at, duration_s: end, paused, rate, loaded } = state.source;
  $("player").hidden = !recording;
  document.body.classList.toggle("replay", recording);
  if (!recording) return;
  write($("play"), paused ? "Play" : at >= end && loaded ? "Again" : "Pause");
  $("position").max = String(end);
  if (!dragging) $("position").value = String(at);
  $("rate").value = String(rate);
  write($("position-text"), `${duration(at)} of ${duration(end)}${loaded ? "" : " (reading …)"}`);
}
