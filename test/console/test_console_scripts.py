"""Scripts of the page, run by Node.js on a small stand-in for the browser's document."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[2] / "console" / "src"
BROWSER = """
class Element extends EventTarget {
  constructor() { super(); this.dataset = {}; this.style = {}; this.reset(); }
  reset() { this.children = []; this.text = ""; this.classList = { toggle() {} }; }
  set textContent(text) { this.text = text; this.children = []; }
  get textContent() {
    return this.text + this.children.map((one) => one.textContent ?? one).join("");
  }
  replaceChildren(...parts) { this.text = ""; this.children = parts; }
  append(...parts) { this.children.push(...parts); }
  setAttribute() {} focus() {} closest() { return this; }
  showModal() { if (this.open) throw new Error("open already"); this.open = true; }
  close(answer) {
    this.returnValue = answer;
    this.open = false;
    this.dispatchEvent(new Event("close"));
  }
}
const elements = new Map();
globalThis.element = (id) => {
  if (!elements.has(id)) elements.set(id, new Element());
  return elements.get(id);
};
globalThis.document = Object.assign(new EventTarget(), {
  getElementById: globalThis.element, createElement: () => new Element(),
  createTextNode: (text) => text, documentElement: new Element(),
});
const store = new Map([["token", "of an earlier start"]]);
globalThis.sessionStorage = globalThis.localStorage = {
  getItem: (key) => store.get(key) ?? null, setItem: (key, value) => store.set(key, value),
  removeItem: (key) => store.delete(key),
};
globalThis.location = { protocol: "http:", host: "here", hash: "" };
globalThis.sockets = [];
globalThis.WebSocket = class {
  static OPEN = 1;
  readyState = 1;
  sent = [];
  constructor() { sockets.push(this); }
  send(text) { this.sent.push(JSON.parse(text)); }
  give(...frames) { this.onmessage({ data: JSON.stringify(frames) }); }
};
globalThis.settle = () => new Promise((done) => setImmediate(done));
globalThis.window = globalThis;
"""
HELLO = """{ type: "hello", protocol: 2, page: 1, kind: "live", facts: {}, source: {},
  control: { allowed: true, holder: 1 } }"""
READER = HELLO.replace("holder: 1", "holder: null")
ROW = """{ type: "row", seq: 1, ages: {}, time_s: 1, values: {} }"""


def run(tmp_path: Path, script: str) -> object:
    """Run a script beside the page's modules; return what it passes to `report`."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("Node.js is not installed")
    folder = tmp_path / "src"
    shutil.copytree(SOURCES, folder)
    (folder / "icons.gen.js").write_text('export default "";\n')
    (folder / "package.json").write_text('{"type": "module"}\n')
    (folder / "browser.js").write_text(BROWSER)
    report = "const report = (found) => { console.log(JSON.stringify(found)); process.exit(0); };"
    (folder / "try.js").write_text(f'import "./browser.js";\n{report}\n{script}')
    done = subprocess.run(
        [node, "try.js"], cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_one_click_does_not_answer_two_questions(tmp_path: Path) -> None:
    script = """
const { ask } = await import("./page.js");
const answers = [];
ask("First?", "", "Yes").then((one) => answers.push(["first", one]));
ask("Second?", "", "Yes").then((one) => answers.push(["second", one]));
await settle();
const titles = [element("dialog-title").textContent];
element("dialog").close("ok");
await settle();
titles.push(element("dialog-title").textContent, answers.length);
element("dialog").close("cancel");
await settle();
report([titles, answers]);
"""
    assert run(tmp_path, script) == [
        ["First?", "Second?", 1],
        [["first", True], ["second", None]],
    ]


def test_a_lost_load_cell_is_not_shown_as_measured(tmp_path: Path) -> None:
    script = """
const { compare } = await import("./winch.js");
const cell = element("tension-measured"), shown = [];
const row = { measured: 200, residual: 1, lower: -5, upper: 5 };
for (const age_s of [0.1, 9, 0.1, 9]) {
  compare(cell, { ...row, age_s }, (value) => String(value), "computed");
  shown.push(cell.textContent);
}
report(shown);
"""
    live = "measured 200  Δ 1"
    assert run(tmp_path, script) == [live, "computed", live, "computed"]


def test_the_page_with_the_seat_says_that_it_is_alive(tmp_path: Path) -> None:
    script = f"""
const {{ connect }} = await import("./link.js");
connect();
sockets[0].give({HELLO}, {ROW}, {ROW});
report(sockets[0].sent);
"""
    assert run(tmp_path, script) == [{"do": "alive"}]


def test_a_token_that_is_refused_is_forgotten(tmp_path: Path) -> None:
    script = f"""
const {{ connect }} = await import("./link.js");
const {{ start }} = await import("./control.js");
start();
connect();
sockets[0].give({READER});
const asked = sockets[0].sent.at(-1), kept = sessionStorage.getItem("token");
sockets[0].give({{ type: "reply", id: asked.id, ok: false, words: "wrong", stage: "done" }});
await settle();
report([asked.do, kept, sessionStorage.getItem("token")]);
"""
    assert run(tmp_path, script) == ["sign_in", "of an earlier start", None]


def test_a_request_without_an_answer_ends(tmp_path: Path) -> None:
    script = """
const wait = globalThis.setTimeout;
globalThis.setTimeout = (act) => wait(act, 1);
const { connect, request } = await import("./link.js");
connect();
report((await request({ do: "take_seat" })).ok);
"""
    assert run(tmp_path, script) is False
