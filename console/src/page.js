// Small parts that all pages use: elements, figures, colours of the palette, freshness of numbers.

import icons from "./icons.gen.js";
import { inUnits } from "./units.js";

export const $ = (id) => document.getElementById(id);
const written = new WeakMap();

// Write text only if it has changed: most numbers of a row have not.
export function write(element, text) {
  if (written.get(element) === text) return;
  written.set(element, text);
  element.textContent = text;
}

export function make(tag, className = "", text = "") {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (text) element.textContent = text;
  return element;
}

export function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const use = document.createElementNS("http://www.w3.org/2000/svg", "use");
  use.setAttribute("href", `#icon-${name}`);
  svg.setAttribute("aria-hidden", "true");
  svg.append(use);
  return svg;
}

export function addIcons() {
  const holder = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  holder.setAttribute("class", "sprite");
  holder.innerHTML = icons;
  document.body.append(holder);
}

// A list of labelled figures: rows of [label, text, unit, class], or null for one that is absent.
export function figures(parent, rows) {
  const present = rows.filter(Boolean);
  parent.classList.toggle("dense", present.length > 6);
  const key = present.map(([label, , unit, kind]) => `${label}|${unit}|${kind}`).join("\n");
  if (parent.dataset.key !== key) {
    parent.dataset.key = key;
    parent.replaceChildren(...present.map(([label, , unit, kind]) => {
      const cell = make("div", kind || "");
      const value = make("div", kind === "wide" ? "v text" : "v");
      value.append(make("span"), make("small", "", unit || ""));
      cell.append(make("div", "k", label), value);
      return cell;
    }));
  }
  present.forEach(([, text], number) => {
    const span = parent.children[number].lastChild.firstChild;
    write(span, text);
    span.title = text;
  });
}

const seen = new Map();
export function colour(name) {
  if (!seen.has(name)) {
    seen.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  }
  return seen.get(name);
}
export const forgetColours = () => seen.clear();

let hideToast = 0;
export function toast(text, good = true) {
  const element = $("toast");
  element.textContent = inUnits(text);
  element.classList.toggle("bad", !good);
  element.hidden = false;
  clearTimeout(hideToast);
  hideToast = setTimeout(() => { element.hidden = true; }, good ? 4000 : 9000);
}

// The key or tap that opened a question must not answer it too, nor a key that is held down.
const SETTLE_MS = 350;
let opened = 0;
for (const kind of ["click", "keydown"]) {
  document.addEventListener(kind, (event) => {
    if (!$("dialog").open || !event.target.closest("#dialog")) return;
    const early = performance.now() - opened < SETTLE_MS && event.target.id === "dialog-ok";
    if (early || (event.repeat && event.key === "Enter")) event.preventDefault();
  }, true);
}

// Ask a question; resolves to true (or the text of the input), or to null if it was cancelled.
// Questions follow one another: there is one dialog, and one click must not answer two.
let asked = Promise.resolve();
export const ask = (...question) => (asked = asked.then(() => askNow(...question)));

function askNow(title, text, ok, input = null) {
  const dialog = $("dialog"), field = $("dialog-input");
  $("dialog-title").textContent = title;
  $("dialog-text").textContent = text;
  $("dialog-ok").textContent = ok;
  field.hidden = input === null;
  field.type = input?.secret ? "password" : "text";
  field.value = input?.value ?? "";
  dialog.returnValue = "cancel";
  dialog.showModal();
  opened = input === null ? performance.now() : -Infinity;
  (input === null ? $("dialog-ok") : field).focus();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      const agreed = dialog.returnValue === "ok";
      resolve(agreed ? (input === null ? true : field.value) : null);
      field.value = "";
    }, { once: true });
  });
}

// Draw on a canvas at the resolution of the screen.
export function canvas(element) {
  const ratio = window.devicePixelRatio || 1;
  const width = element.clientWidth, height = element.clientHeight;
  if (element.width !== Math.round(width * ratio) || element.height !== Math.round(height * ratio)) {
    element.width = Math.round(width * ratio);
    element.height = Math.round(height * ratio);
  }
  const context = element.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "12px 'Noto Sans', sans-serif";
  return { context, width, height };
}

// Label of a step.
export const tick = (at) => String(Math.round(at * 100) / 100).replace("-", "−");

// Round steps of an axis, about `count` of them.
export function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw || 1));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= raw) || power;
  const found = [];
  for (let at = Math.ceil(low / step) * step; at <= high + 1e-9 * step; at += step) found.push(at);
  return found;
}
