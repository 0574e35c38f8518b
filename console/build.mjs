// Build the console's page into rope_twin/console/page: `npm ci && npm run build`.
//
// Of OpenBridge the page takes palettes, icons and font. Its web components set style attributes,
// which the page's content security policy forbids, so none of them is bundled: icons become SVG
// with classes, and only the variables that the page uses are taken from the palettes.

import { build } from "esbuild";
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";

const modules = "node_modules", openbridge = `${modules}/@oicl/openbridge-webcomponents/dist`;
const out = "../rope_twin/console/page";
const ICONS = {
  "alarm-unacknowledged": "alarm-unacknowledged-iec", "alarm-silenced": "alarm-silenced-iec",
  "alarm-acknowledged": "alarm-acknowledged-iec", "alarm-rectified": "alarm-rectified-iec",
  "warning-unacknowledged": "warning-unacknowledged-iec", "warning-silenced": "warning-silenced-iec",
  "warning-acknowledged": "warning-acknowledged-iec", "warning-rectified": "warning-rectified-iec",
  "caution": "caution-color-iec", "take": "command-take", "locked": "command-locked",
  "winch": "crane", "heave": "heave", "palette": "palette-dimming",
};

mkdirSync(out, { recursive: true });
mkdirSync(`${out}/licences`, { recursive: true });

// icons: the drawing of each module, its style attributes turned into classes
const fills = new Set();
const drawings = Object.entries(ICONS).map(([name, file]) => {
  const text = readFileSync(`${openbridge}/icons/icon-${file}.js`, "utf8");
  const drawing = /this\.iconCss = svg`\s*<svg[^>]*>([\s\S]*?)<\/svg>/.exec(text)[1];
  const classed = drawing
    .replace(/\s*style="stroke: var\([^)]*\)"/g, "")
    .replace(/style="fill: var\(--([a-z-]+)\)"/g, (_, variable) => {
      fills.add(variable);
      return `class="fill-${variable}"`;
    })
    .replace(/\n/g, "");
  if (/style=/.test(classed)) throw new Error(`icon ${file}: a style attribute is left`);
  return `<symbol id="icon-${name}" viewBox="0 0 24 24" fill="none">${classed}</symbol>`;
});
writeFileSync(`${out}/icons.svg`,
  `<svg xmlns="http://www.w3.org/2000/svg">${drawings.join("\n")}</svg>\n`);
writeFileSync("src/icons.gen.js",
  `// Made by build.mjs from the icons of OpenBridge.\nexport default ${JSON.stringify(drawings.join(""))};\n`);

await build({
  entryPoints: ["src/main.js"], bundle: true, minify: true, format: "esm", target: "es2022",
  outfile: `${out}/console.js`, legalComments: "eof",
});
const own = readFileSync("src/style.css", "utf8") +
  [...fills].map((one) => `.fill-${one}{fill:var(--${one})}\n`).join("");
writeFileSync("src/style.gen.css", readFileSync(`${modules}/uplot/dist/uPlot.min.css`, "utf8") + own);
const sheetOf = await build({ entryPoints: ["src/style.gen.css"], minify: true, write: false });

// palettes: the variables that the page uses, and those that they refer to
const sheet = readFileSync(`${openbridge}/openbridge.css`, "utf8");
const used = new Set();
const uses = (text) => [...text.matchAll(/--[a-z0-9-]+/g)].map((one) => one[0]);
const block = (head) => {
  const start = sheet.indexOf(head);
  return sheet.slice(sheet.indexOf("{", start) + 1, sheet.indexOf("\n}", start));
};
const rows = (text) => new Map([...text.matchAll(/(--[a-z0-9-]+):\s*([^;]+);/g)]
  .map(([, name, value]) => [name, value.replace(/\s+/g, " ").trim()]));
const themes = ["bright", "day", "dusk", "night"]
  .map((name) => [name, rows(block(`:root[data-obc-theme="${name}"]`))]);
const wanted = [...uses(own), ...uses(readFileSync(`${out}/console.js`, "utf8"))];
while (wanted.length) {
  const name = wanted.pop();
  if (used.has(name)) continue;
  used.add(name);
  for (const [, known] of themes) if (known.has(name)) wanted.push(...uses(known.get(name)));
}
const palettes = themes.map(([name, known]) =>
  `:root[data-obc-theme="${name}"]{color-scheme:${["dusk", "night"].includes(name) ? "dark" : "light"};` +
  [...known].filter(([one]) => used.has(one)).map(([one, value]) => `${one}:${value}`).join(";") +
  "}\n").join("");
writeFileSync(`${out}/console.css`, palettes + sheetOf.outputFiles[0].text); // one request for both

copyFileSync("src/index.html", `${out}/index.html`);
copyFileSync("font/NotoSans-latin.woff", `${out}/NotoSans-latin.woff`);
for (const [from, to] of [
  [`${modules}/uplot/LICENSE`, "uPlot.txt"],
  ["licences/OpenBridge-Apache-2.0.txt", "OpenBridge-Apache-2.0.txt"],
  ["licences/NotoSans-OFL-1.1.txt", "NotoSans-OFL-1.1.txt"],
]) copyFileSync(from, join(out, "licences", to));
