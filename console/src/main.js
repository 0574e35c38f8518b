// Entry of the page: tabs, palettes, units, keys, and the loop that draws what has changed.

import * as alerts from "./alerts.js";
import * as along from "./along.js";
import * as control from "./control.js";
import * as engineering from "./engineering.js";
import * as log from "./log.js";
import * as player from "./player.js";
import * as sealimits from "./sealimits.js";
import * as survey from "./survey.js";
import * as trend from "./trend.js";
import * as whatif from "./whatif.js";
import * as winch from "./winch.js";
import { $, addIcons, forgetColours, make, write } from "./page.js";
import { age, connect, facts, on, ropeNames, stale, state } from "./link.js";
import { force, metres, nextUnits, units } from "./units.js";

const PALETTES = ["bright", "day", "dusk", "night"], TABS = ["winch", "survey", "engineering", "log"];
const NUMBERS_MS = 100, FRESH_MS = 150;
let tab = "winch", fresh = false, numbersMs = 0, freshMs = 0;

function setPalette(name) {
  document.documentElement.dataset.obcTheme = name;
  localStorage.setItem("palette", name);
  write($("palette"), name[0].toUpperCase() + name.slice(1));
  forgetColours();
  trend.repaint();
  along.repaint();
  survey.repaint();
  fresh = true;
}
const nextPalette = () => setPalette(PALETTES[(PALETTES.indexOf(document.documentElement.dataset.obcTheme) + 1) % 4]);

function setUnits() {
  nextUnits();
  showUnits();
}
function showUnits() {
  write($("units"), units().name);
  for (const one of document.querySelectorAll("[data-force]")) write(one, units().force);
  trend.repaint();
  along.repaint();
  numbersMs = 0;
  fresh = true;
  control.draw();
}

// Of several ropes the pages show one; the strip above them has the tension and line out of each.
function chooseLine(number) {
  state.line = number;
  trend.repaint();
  along.repaint();
  survey.repaint();
  numbersMs = 0;
  fresh = true;
  control.draw();
}
function lines() {
  const names = ropeNames(), strip = $("lines");
  strip.hidden = names.length < 2;
  document.body.classList.toggle("several", names.length > 1);
  if (names.length < 2) { state.line = 0; return; }
  if (state.line >= names.length) chooseLine(0);
  if (strip.dataset.names !== names.join("\n")) {
    strip.dataset.names = names.join("\n");
    strip.replaceChildren(...names.map((name, number) => {
      const button = make("button");
      button.append(make("b", "", name), make("span"));
      button.onclick = () => chooseLine(number);
      return button;
    }));
  }
  names.forEach((_, number) => {
    const button = strip.children[number];
    button.setAttribute("aria-pressed", String(number === state.line));
    write(button.lastChild, `${force(state.values.tension_n?.[number])} ${units().force} · ${metres(state.values.line_out_m?.[number])} m`);
  });
}

function show(name) {
  tab = name;
  for (const one of TABS) {
    $(one).hidden = one !== name;
    $(`tab-${one}`).setAttribute("aria-selected", String(one === name));
    $(`tab-${one}`).tabIndex = one === name ? 0 : -1;
  }
  location.replace(`#${name}`);
  numbersMs = 0;
  fresh = true;
  along.repaint();
  survey.repaint();
}

function keys(event) {
  if (event.target.matches("input, select, textarea") || document.querySelector("dialog[open]") || event.ctrlKey || event.metaKey || event.altKey) return;
  const key = event.key.toLowerCase(), at = TABS.indexOf(tab);
  if (key >= "1" && key <= "4") show(TABS[Number(key) - 1]);
  else if (key === "u") setUnits();
  else if (key === "p") nextPalette();
  else if (key === "s") $("seat").click();
  else if (key === "r") trend.toggleScale();
  else if (key === "l" && ropeNames().length > 1) { chooseLine((state.line + 1) % ropeNames().length); }
  else if (key === "m") { show("log"); $("mark-text").focus(); event.preventDefault(); }
  else if (event.target.matches("[role=tab]") && (key === "arrowright" || key === "arrowleft")) {
    show(TABS[(at + (key === "arrowright" ? 1 : 3)) % 4]);
    $(`tab-${tab}`).focus();
  }
}

// Grey out what is older than its topic allows, and show the age of every number.
function freshness() {
  for (const tile of document.querySelectorAll(`#${tab} [data-topic]`)) {
    const topic = tile.dataset.topic, now = age(topic), text = tile.querySelector("h2 .age");
    tile.classList.toggle("absent", now === null);
    tile.classList.toggle("stale", stale(topic));
    if (text && now !== null) write(text, now < 10 ? `${now.toFixed(1)} s` : now < 120 ? `${Math.round(now)} s` : `${Math.round(now / 60)} min`);
  }
  const link = $("link"), lost = stale("ropes/tension_top"), recording = state.hello?.kind === "recording";
  const words = !state.connected ? "CONSOLE LOST" : state.timeS === null ? "NO TWIN" : recording ? "RECORDING" : lost ? "TWIN LOST" : "LIVE";
  const changed = link.textContent !== words;
  write(link, words);
  if (changed) alerts.draw();
  link.className = `chip ${words === "LIVE" || words === "RECORDING" ? "live" : "lost"}`;
  write($("utc"), `${new Date().toISOString().slice(11, 19)} UTC`);
  write($("twin-time"), state.timeS === null ? "–" : `twin ${state.timeS.toFixed(1)} s`);
}

function numbers() {
  lines();
  if (tab === "winch") { winch.draw(); along.draw(); whatif.draw(); }
  else if (tab === "survey") { survey.draw(); sealimits.draw(); }
  else if (tab === "engineering") engineering.draw();
  else log.draw();
  alerts.draw();
  control.draw();
}

function frame(now) {
  if (fresh) {
    if (tab === "winch") trend.draw();
    if (now - numbersMs >= NUMBERS_MS) { numbersMs = now; numbers(); fresh = false; }
  }
  if (now - freshMs >= FRESH_MS) { freshMs = now; freshness(); alerts.sound(now); }
  requestAnimationFrame(frame);
}

addIcons();
trend.start();
whatif.start();
control.start();
alerts.start();
survey.start();
sealimits.start();
log.start();
player.start();
for (const one of TABS) $(`tab-${one}`).onclick = () => show(one);
$("palette").onclick = nextPalette;
$("units").onclick = setUnits;
document.addEventListener("keydown", keys);
window.addEventListener("resize", () => { along.repaint(); survey.repaint(); fresh = true; });
on("hello", (content) => { trend.fill(content.trend); winch.fill(content.trend); write($("scene"), facts().scene ?? content.source?.name ?? "rope_twin"); trend.repaint(); fresh = true; });
on("row", (row) => { if (row.trend) trend.add(row.trend); fresh = true; });
on("profile", () => { fresh = true; });
on("state", () => { fresh = true; });
setPalette(PALETTES.includes(localStorage.getItem("palette")) ? localStorage.getItem("palette") : "day");
showUnits();
show(TABS.includes(location.hash.slice(1)) ? location.hash.slice(1) : "winch");
connect();
requestAnimationFrame(frame);
