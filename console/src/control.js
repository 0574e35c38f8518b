// Seat and commands: every command is confirmed, and answered with what the twin did.

import { $, ask, make, toast, write } from "./page.js";
import { facts, on, request, said, state, winch as winchFacts, winchName, winchRow } from "./link.js";
import { force, metres, speed, units } from "./units.js";

const MODES = {
  speed: { name: "Speed", unit: () => units().speed, si: () => 1 / units().perSecond, show: (value) => `${speed(value, true)} ${units().speed}` },
  length: { name: "Length", unit: () => "m", si: () => 1, show: (value) => `${metres(value)} m of line out` },
  depth: { name: "Depth", unit: () => "m", si: () => 1, show: (value) => `${metres(value)} m payload depth` },
  tension: { name: "Tension", unit: () => units().force, si: () => 1 / units().newton, show: (value) => `${force(value)} ${units().force}` },
};
const SWITCHES = {
  set_brake: "set the brake", release_brake: "release the brake",
  compensate: "switch heave compensation on", stop_compensating: "switch heave compensation off",
  reset: "reset the emergency stop",
};
let mode = "speed", signedIn = false, built = "";

const winch = () => winchFacts() ?? { switches: [], modes: ["speed", "length", "depth"] };
// Without the scene's facts every winch that is heard: the server refuses what a winch cannot do.
const stoppable = () => facts().winches
  ? Object.entries(facts().winches).filter(([, one]) => one.switches.includes("emergency_stop")).map(([name]) => name)
  : (state.values.winches ?? []).map((row) => row.name);
export const hasWinch = () => !facts().winches || Object.keys(facts().winches).length > 0;
const title = (name) => name === "winch" ? "Winch" : `Winch ${name}`;
const holds = () => state.control?.holder !== null && state.control?.holder === state.page;

export function start() {
  $("seat").onclick = seat;
  $("stop").onclick = emergencyStop;
  for (const [what] of Object.entries(LEARNING)) $(`learning-${what}`).onclick = () => learning(what);
  on("hello", async () => {
    signedIn = false;
    const token = sessionStorage.getItem("token");
    if (token && state.control?.allowed) {
      const answer = await request({ do: "sign_in", token });
      signedIn = answer.ok;
      // A token of an earlier start would count as a wrong one each time that the page connects.
      if (!answer.ok && answer.id !== undefined) sessionStorage.removeItem("token");
    }
    draw();
  });
  on("notice", (frame) => toast(frame.words, false));
  on("seat_wanted", async (frame) => {
    const agreed = await ask("Release the seat?", `${frame.by} asks for the seat of the winch.`, "Release");
    if (agreed) toast((await request({ do: "release_seat" })).words);
  });
}

export async function signIn() {
  if (signedIn) return true;
  const token = await ask("Control of the winch", "Token, as printed where the console was started:", "Sign in", { secret: true });
  if (!token) return false;
  const answer = await request({ do: "sign_in", token });
  signedIn = answer.ok;
  if (answer.ok) sessionStorage.setItem("token", token);
  else toast(answer.words, false);
  draw();
  return signedIn;
}

async function seat() {
  if (!state.control?.allowed) {
    toast("This console is read-only. It is started with --control to command the winch.");
    return;
  }
  if (!(await signIn())) return;
  if (holds()) {
    const agreed = await ask("Release the seat?", releaseWords(), "Release");
    if (agreed) toast((await request({ do: "release_seat" })).words);
    return;
  }
  const text = !hasWinch() ? "The scene has no winch: this page may then set limits and command learning." : `Seat of the winch: ${state.values.seat ?? "unknown"}. A schedule that commands the winch stops, and its last command remains in force.`;
  if (!(await ask("Take the seat?", text, "Take the seat"))) return;
  const answer = await request({ do: "take_seat" });
  toast(answer.words, answer.ok);
}

function releaseWords() {
  const then = { hold_speed: "keeps its speed", ramp_to_zero: "ramps to zero", brake: "stops and sets its brake" };
  return `A winch that moves then ${then[winch().when_commander_lost] ?? "does what its scene says"}, and another commander can take the seat.`;
}

async function emergencyStop() {
  if (!(await signIn())) return;
  await Promise.all(stoppable().map((name) => send("emergency_stop", 0, "emergency stop", name)));
}

async function send(kind, value, words, name = winchName()) {
  const answer = await request({ do: "command", winch: name, kind, value },
    (frame) => { if (frame.stage === "sent") toast(`${words}: sent`); });
  toast(answer.words, answer.ok);
}

async function confirmed(kind, value, words) {
  const name = winchName(); // the one that is asked about, whatever is chosen meanwhile
  if (await ask("Confirm the command", `${title(name)}: ${words}`, "Send")) await send(kind, value, words, name);
}

// Ask the server for something that the twin does, and tell what it answers.
async function order(content, words) {
  const answer = await request(content, (frame) => { if (frame.stage === "sent") toast(`${words}: sent`); });
  toast(answer.ok ? `${words}: ${answer.words}` : answer.words, answer.ok);
}

// Set or end a limit of the crew; the value is typed in the units of the screen.
export async function setLimit({ name, label, unit, si }) {
  const typed = await ask(`Limit of the ${label}`, `Stricter than the scene's, in ${unit}. Empty: that of the scene.`, "Set", { value: "" });
  if (typed === null) return;
  const text = typed.trim().replace(",", "."), value = text ? Number(text) * si : null;
  if (text && !(Number.isFinite(value) && value > 0)) { toast(`${text} is not a positive number.`, false); return; }
  await order({ do: "limit", name, value }, `Limit of the ${label}`);
}

const LEARNING = {
  tare: ["Tare the load pin?", "Its zero of now, with an empty hook, is taken as right.", "Tare"],
  apply: ["Take the figures over?", "The twin goes on with the learned figures, by a ramp.", "Take over"],
  acknowledge: ["Acknowledge the fault?", "The alarm ends and learning goes on from the twin's state of now.", "Acknowledge"],
};
async function learning(what) {
  if (await ask(...LEARNING[what])) await order({ do: "learning", what }, LEARNING[what][2]);
}
export const commands = () => holds();

export function draw() {
  const control = state.control ?? {}, own = holds();
  $("stop").hidden = !control.allowed || !stoppable().length;
  const holder = control.holder_name ? `Seat: ${control.holder_name.split(" (")[0]}` : "Take the seat";
  write($("seat"), !control.allowed ? (state.hello?.kind === "recording" ? "Recording" : "Read only") : own ? "In command" : holder);
  $("seat").setAttribute("aria-pressed", String(own));
  $("command").hidden = !own || !hasWinch();
  $("learning").hidden = !own;
  $("command").closest(".tile").classList.toggle("commanding", own);
  if (own && hasWinch()) panel();
}

function panel() {
  const row = winchRow() ?? {}, has = winch().switches;
  const stopped = said(state.values.winch_mode).startsWith("emergency stop");
  if (!winch().modes.includes(mode)) mode = winch().modes[0];
  const key = JSON.stringify([winchName(), mode, has, row.brake_holds, row.compensation_on, stopped, units().name, winch().modes]);
  if (key === built) return;
  built = key;
  const typed = $("set-point")?.value ?? "", field = make("input");
  field.id = "set-point";
  field.inputMode = "decimal";
  field.value = typed;
  field.placeholder = MODES[mode].unit();
  field.setAttribute("aria-label", `${MODES[mode].name} [${MODES[mode].unit()}]`);
  field.onkeydown = (event) => { if (event.key === "Enter") { event.preventDefault(); if (!event.repeat) go(); } };
  const modes = winch().modes.map((one) => press(MODES[one].name, () => { mode = one; draw(); }, mode === one, `of-${winch().modes.length}`));
  const parts = [...modes, field, press("Send …", go, null, "third"), press("STOP", () => send("speed", 0, "stop, speed 0"), null, "halt")];
  parts[parts.length - 1].id = "halt";
  const switches = [];
  if (has.includes("set_brake")) {
    const kind = row.brake_holds ? "release_brake" : "set_brake";
    switches.push([row.brake_holds ? "Brake: set" : "Brake: released", kind]);
  }
  if (has.includes("compensate")) {
    const kind = row.compensation_on ? "stop_compensating" : "compensate";
    switches.push([row.compensation_on ? "AHC: on" : "AHC: off", kind]);
  }
  if (stopped) switches.push(["Reset", "reset"]);
  for (const [text, kind] of switches) {
    parts.push(press(text, () => confirmed(kind, 0, SWITCHES[kind]), null, ["", "whole", "half"][switches.length] ?? ""));
  }
  $("command").replaceChildren(...parts);
}

function press(text, act, pressed = null, kind = "") {
  const button = make("button", kind, text);
  button.onclick = act;
  if (pressed !== null) button.setAttribute("aria-pressed", String(pressed));
  return button;
}

async function go() {
  const text = $("set-point").value.trim().replace(",", ".").replace("−", "-"), value = Number(text);
  if (!text || !Number.isFinite(value)) {
    toast(`${$("set-point").value || "nothing"} is not a number; type the set-point in ${MODES[mode].unit()}.`, false);
    return;
  }
  const si = value * MODES[mode].si();
  const way = mode === "speed" && si !== 0 ? (si > 0 ? ", paying out" : ", hauling in") : "";
  await confirmed(mode, si, `${MODES[mode].name.toLowerCase()} ${MODES[mode].show(si)}${way}`);
}
