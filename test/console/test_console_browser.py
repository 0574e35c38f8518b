"""The console in a real browser: offline, equal to the topics, grey when lost, one screen, keys."""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import axe_playwright_python
import pytest
from console_rig import FACTS, TENSION_ALARM, TOKEN, FakeCommander, SnapshotSource
from sample_snapshot import RESIDUAL, hanging_rope, lifted

from rope_twin.alerts.alert_list import Priority, State
from rope_twin.console.control import RequestHandler, Token
from rope_twin.console.pages import Pages
from rope_twin.console.readings import Readings, stale_limits_s
from rope_twin.console.requests import Log, Requests
from rope_twin.console.server import Server
from rope_twin.messages.reports import Level, Status

CHROMIUM = Path("/usr/bin/chromium")
pytestmark = [
    pytest.mark.console,
    pytest.mark.skipif(
        not CHROMIUM.exists(), reason=f"the console in a browser: there is no {CHROMIUM}"
    ),
]
PATIENCE_S = 60.0
FRESHNESS_S = 0.15 + 0.05  # interval at which the page looks at the ages, and a row
PALETTES = "bright", "day", "dusk", "night"
PAGES = "winch", "survey", "engineering", "log"
AXE = Path(axe_playwright_python.__file__).with_name("axe.min.js")


class RunningSource(SnapshotSource):
    """Advances with real time; a fixed snapshot shows the same numbers at every poll."""

    several = False  # ropes

    def poll(self, readings: Readings, now_s: float) -> None:
        if not self.lost:
            time_s = now_s % 1e5
            snapshot = hanging_rope(time_s=time_s, heave_m=0.4)
            fresh = replace(RESIDUAL, at_s=time_s - 0.1)
            if self.several:
                snapshot = replace(lifted(), stamp_ns=snapshot.stamp_ns)
            self.snapshot = replace(snapshot, residuals=(fresh,))
        super().poll(readings, now_s)


class Served:
    """A console served on a free port of the loopback."""

    def __init__(self) -> None:
        self.source = RunningSource()
        self.pages = Pages(self.source, time.monotonic, FACTS)
        self.commander = FakeCommander(self.source)
        self.desk = RequestHandler(
            self.pages, time.monotonic, self.commander, Token(TOKEN, time.monotonic)
        )
        self.desk.further["what_if"] = self.source.compare
        self.pages.before_tick.append(self.desk.update)
        Requests(self.pages, self.desk, self.commander)
        log = Log(self.pages)
        log.connect(self.desk)
        self.server = Server(self.pages, self.desk, log, port=0)
        self.server.start()

    def reset(self) -> None:
        self.source.lost, self.source.alerts = False, []
        self.source.horizon_s, self.source.several = None, False
        self.source.rows = self.source.rows[:1]
        self.source.seat, self.source.mode = "winch: winch_schedule", "winch: speed 0 m/s"


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    made = Served()
    yield made
    made.server.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        made = play.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
        yield made
        made.close()


@pytest.fixture
def open_page(served: Served, browser: Any) -> Iterator[Callable[..., Any]]:
    """Open a page; afterwards no page may have had an error or asked elsewhere."""
    served.reset()
    contexts, faults = [], list[str]()

    def make(path: str = "", palette: str = "day", width: int = 1280, height: int = 800) -> Any:
        context = browser.new_context(viewport={"width": width, "height": height})
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(1e3 * PATIENCE_S)
        page.on("console", lambda one: faults.append(one.text) if one.type == "error" else None)
        page.on("pageerror", lambda one: faults.append(str(one)))
        page.on("request", lambda one: None if one.url.startswith(served.server.address)
                else faults.append(f"asked {one.url}"))  # fmt: skip
        page.add_init_script(f"localStorage.setItem('palette', '{palette}')")
        page.goto(served.server.address + path)
        until(page, "document.getElementById('link').textContent === 'LIVE'")
        until(page, "document.getElementById('tension').textContent !== '–'")
        return page

    yield make
    for context in contexts:
        context.close()
    assert not faults


def until(page: Any, condition: str) -> None:
    """Wait for a condition of the page; its policy forbids Playwright to evaluate it there."""
    give_up = time.monotonic() + PATIENCE_S
    while not page.evaluate(condition):
        assert time.monotonic() < give_up, condition
        time.sleep(0.02)


def until_shown(page: Any, name: str, words: str) -> None:
    """Wait until an element shows these words, whatever the white space between them."""
    shown = f"document.getElementById('{name}').innerText.replace(/\\s+/g, ' ')"
    until(page, f"{shown}.includes({json.dumps(words)})")


def text(page: Any, name: str) -> str:
    return str(page.locator(f"#{name}").inner_text())


def test_numbers_are_those_of_the_topics(open_page: Callable[..., Any], served: Served) -> None:
    page, snapshot = open_page(), served.source.snapshot
    for name, words in (
        ("line-out", "3000.0"),
        ("line-speed", "+30.0"),  # 0.5 m/s
        ("tension", f"{snapshot.tension_top_n / 1e3:.1f}"),
        ("direction", "↓ paying out"),
        ("payload-figures", f"{-snapshot.payload_position_m[2]:.1f}"),
        ("tension-measured", "measured 321.0 kN Δ +0.2 kN"),
        ("quality", "0.80"),
        ("risk", "No forecast: none is made in this run"),
    ):
        until_shown(page, name, words)
    page.keyboard.press("u")  # t · m/min
    until_shown(page, "units", "t · m/min")
    until_shown(page, "tension", f"{snapshot.tension_top_n / 9806.65:.2f}")
    page.keyboard.press("u")
    page.keyboard.press("u")
    until_shown(page, "line-speed", "+0.50")


def test_why_there_is_no_forecast(open_page: Callable[..., Any], served: Served) -> None:
    waiting = Status("forecast: worker", Level.OK, "waits for 18 s more of heave", {})
    served.source.rows = [*served.source.rows, waiting]
    page = open_page()
    until_shown(page, "risk", "No forecast: waits for 18 s more of heave")
    served.source.several = True
    until_shown(page, "lines", "starboard 6.0 kN · 8.0 m")
    until_shown(page, "risk", "No forecast: waits for 18 s more of heave")


def test_risk_and_quiet_window_of_a_forecast(open_page: Callable[..., Any], served: Served) -> None:
    served.source.horizon_s = 12.0
    page = open_page()
    for words in ("10 s 20 s 30 s P(> 500 kN) 2 % 4 % 6 % P(slack) 1 % 2 % 3 %",
                  "Heave known climatology",
                  "Quiet 10 s (< 18.0 m/min) in 9 s: 50 %, climatology"):  # fmt: skip
        until_shown(page, "risk", words)
    until_shown(page, "trend-legend", "forecast 5–95 %")
    root = "document.documentElement"
    assert page.evaluate(f"[{root}.scrollWidth, {root}.scrollHeight]") == [1280, 800]


def test_orders_are_compared_on_request(open_page: Callable[..., Any], served: Served) -> None:
    """Signed in, since the console has control; the answer opens by itself, on this page alone."""
    served.source.horizon_s = 12.0
    page, other = open_page(), open_page()
    sign_in_and_take_the_seat(page)
    until_shown(page, "risk", "P(slack)")
    page.click("#what-if")
    until_shown(page, "dialog-title", "What if?")
    page.fill("#dialog-input", "stop lower:0.5")
    page.click("#dialog-ok")
    page.wait_for_selector("#compared[open]")
    rows = page.locator("#orders tbody tr").all_inner_texts()
    assert [row.split("\t") for row in rows] == [
        ["hold", "25 %", "0 %", "–", "–"],
        ["stop", "25 %", "0 %", "–", "+10.0 (+5.5 to +14.5) kN"],
        ["lower:0.5", "25 %", "0 %", "–", "+20.0 (+15.5 to +24.5) kN"],
    ]
    assert not other.locator("#compared").is_visible()
    page.click("#compared button")
    assert not page.locator("#compared").is_visible()


def test_one_of_several_ropes_is_shown_as_chosen(
    open_page: Callable[..., Any], served: Served
) -> None:
    served.source.several = True
    page = open_page()
    until_shown(page, "lines", "starboard 6.0 kN · 8.0 m")
    assert_one_screen(page, 1280, 800)
    until_shown(page, "tension", f"{served.source.snapshot.tension_top_n / 1e3:.1f}")
    page.keyboard.press("l")
    until_shown(page, "tension", "6.0")
    until_shown(page, "line-out", "8.0")
    page.click("#lines button:first-child")
    until_shown(page, "line-out", "100.0")
    assert page.locator("#lines button[aria-pressed=true]").inner_text().startswith("hoist")


def test_limits_of_a_winch_are_its_own(open_page: Callable[..., Any], served: Served) -> None:
    limits = "at its speed limit; 190 kN would take -2.5 m/s; renders"
    served.source.mode = f"winch: tension 190 kN ({limits}); aft: speed 1 m/s"
    page = open_page()
    until_shown(page, "mode", "tension 190 kN")
    until_shown(page, "winch-limit", limits.replace("-2.5 m/s", "−150.0 m/min"))


def test_loss_of_the_twin_goes_grey_within_a_second(
    open_page: Callable[..., Any], served: Served
) -> None:
    page = open_page()
    fresh = "!document.querySelector('#winch .big').classList.contains('stale')"
    until(page, fresh)
    served.source.lost = True
    until(page, f"!({fresh})")
    ages = [float(one) for one in re.findall(r"([\d.]+) s", text(page, "winch"))]
    assert text(page, "link") == "TWIN LOST"
    until_shown(page, "alerts", "Twin lost")
    assert max(ages) >= 0.7
    assert page.locator("#winch .big.stale").count() == 4
    assert page.evaluate("document.querySelectorAll('#winch .tile.stale').length") >= 6
    # the age at which a page greys out, whatever the load of this machine
    limits_s = stale_limits_s()
    assert limits_s["ropes/tension_top"] + FRESHNESS_S < 1.0


@pytest.mark.parametrize(("width", "height"), [(1024, 768), (1280, 720), (1920, 1080)])
def test_one_screen_without_scrolling(
    open_page: Callable[..., Any], width: int, height: int
) -> None:
    assert_one_screen(open_page(width=width, height=height), width, height)


def assert_one_screen(page: Any, width: int, height: int) -> None:
    """Check that the first page needs no scrolling, and that nothing on it is cut off."""
    root = "document.documentElement"
    assert page.evaluate(f"[{root}.scrollWidth, {root}.scrollHeight]") == [width, height]
    outside = page.evaluate(
        """() => [...document.querySelectorAll('#winch .tile, #winch output')].filter((one) => {
             const box = one.getBoundingClientRect();
             return box.right > innerWidth + 1 || box.bottom > innerHeight + 1 || box.width < 20;
           }).map((one) => one.className || one.id)"""
    )
    assert outside == []
    cut = page.evaluate(
        """() => [...document.querySelectorAll('#winch .big, #winch .figures, #winch .quality')]
             .filter((one) => one.scrollHeight > one.clientHeight + 2)
             .map((one) => one.id || one.getAttribute('aria-label'))"""
    )
    assert cut == []
    shortened = page.evaluate(
        """() => [...document.querySelectorAll('#winch .v:not(.text), #winch dd')]
             .filter((one) => one.scrollWidth > one.clientWidth + 1).map((one) => one.innerText)"""
    )
    assert shortened == []


def luminance(colour: str) -> float:
    """Relative luminance of a CSS colour (WCAG 2.2)."""
    parts = [float(one) / 255.0 for one in re.findall(r"[\d.]+", colour)[:3]]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize("palette", PALETTES)
def test_one_screen_and_contrast_in_every_palette(
    open_page: Callable[..., Any], palette: str
) -> None:
    """Big numbers 7:1, text 4.5:1, notes 3:1 (WCAG 2.2, 1.4.3 and 1.4.6); night stays dark."""
    page = open_page(palette=palette)
    assert_one_screen(page, 1280, 800)
    for selector, least in (("#tension", 7.0), ("#tension-measured", 4.5), (".big h2", 4.5),
                            ("#payload-figures .k", 3.0), ("#risk", 3.0)):  # fmt: skip
        front, back = page.evaluate(
            """(selector) => {
                 const one = document.querySelector(selector), tile = one.closest('.tile');
                 return [getComputedStyle(one).color, getComputedStyle(tile).backgroundColor];
               }""",
            selector,
        )
        bright, dark = sorted((luminance(front), luminance(back)), reverse=True)
        assert (bright + 0.05) / (dark + 0.05) >= least, (selector, front, back)
        if palette == "night":
            assert bright < 0.55
    if palette == "night":
        ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert luminance(ground) < 0.01


AXE_RUN = """axe.run(document, {resultTypes: ["violations"]}).then((found) => found.violations
  .map((one) => `${one.impact} ${one.id}: ${one.nodes.map((node) => node.target).join(", ")}`))"""


@pytest.mark.parametrize("palette", PALETTES)
def test_axe_finds_nothing_in_any_page(
    open_page: Callable[..., Any], served: Served, palette: str
) -> None:
    """Rules of axe-core 4 on every page, with an alert, the panel of commands and a question."""
    served.source.alerts, served.source.horizon_s = [TENSION_ALARM], 12.0
    page = open_page(palette=palette)
    page.evaluate(AXE.read_text())
    until_shown(page, "alerts", "510 kN")
    for key, name in enumerate(PAGES, 1):
        page.keyboard.press(str(key))
        until(page, f"!document.getElementById('{name}').hidden")
        assert page.evaluate(AXE_RUN) == [], name
    page.keyboard.press("1")
    sign_in_and_take_the_seat(page)
    until_shown(page, "seat", "In command")
    page.fill("#set-point", "12")
    page.press("#set-point", "Enter")
    until_shown(page, "dialog-title", "Confirm the command")
    assert page.evaluate(AXE_RUN) == []


def test_a_tablet_is_used_by_touch_alone(browser: Any, served: Served) -> None:
    served.reset()
    size = {"width": 1024, "height": 768}
    context = browser.new_context(viewport=size, has_touch=True)
    page = context.new_page()
    page.goto(served.server.address)
    until_shown(page, "link", "LIVE")
    for name in (*PAGES[1:], PAGES[0]):
        page.tap(f"#tab-{name}")
        until(page, f"!document.getElementById('{name}').hidden")
    small = page.evaluate(
        """() => [...document.querySelectorAll('button, .button, input, select')].filter((one) => {
             const box = one.getBoundingClientRect();
             return box.width && (box.width < 24 || box.height < 24);
           }).map((one) => one.id)"""
    )
    assert small == []  # WCAG 2.2, 2.5.8
    page.tap("#palette")
    until_shown(page, "palette", "Dusk")
    page.tap("#stop")
    until_shown(page, "dialog-title", "Control of the winch")
    context.close()


def test_keys_reach_every_page(open_page: Callable[..., Any]) -> None:
    page = open_page()
    for key in (2, 3, 4, 1):
        page.keyboard.press(str(key))
        until(page, f"!document.getElementById('{PAGES[key - 1]}').hidden")
    page.focus("#tab-winch")
    page.keyboard.press("ArrowRight")
    until(page, "document.activeElement.id === 'tab-survey'")
    reached = set()
    for _ in range(20):  # the Tab key alone
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id"))
    assert {"units", "palette", "seat", "stop", "true-scale"} <= reached
    page.keyboard.press("3")
    until(page, "document.querySelector('#diagnostics tbody').rows.length > 0")
    page.keyboard.press("p")
    until(page, "document.documentElement.dataset.obcTheme === 'dusk'")
    page.keyboard.press("m")
    page.keyboard.type("lift off")
    page.keyboard.press("Enter")
    sign_in(page)  # with control, the log belongs to those who may command
    until_shown(page, "marks", "lift off")


def agree(page: Any, question: str) -> None:
    """Answer a question; the page takes no answer in its first moments, which may be accidents."""
    title = "document.getElementById('dialog-title').textContent"
    asked = f"document.getElementById('dialog').open && {title} === {json.dumps(question)}"
    until(page, asked)
    until(page, f"(document.getElementById('dialog-ok').click(), !({asked}))")


def sign_in(page: Any) -> None:
    until_shown(page, "dialog-title", "Control of the winch")
    page.fill("#dialog-input", TOKEN)
    page.click("#dialog-ok")


def sign_in_and_take_the_seat(page: Any) -> None:
    page.click("#seat")
    sign_in(page)
    agree(page, "Take the seat?")


def test_two_pages_ask_for_the_seat_and_a_command_is_confirmed(
    open_page: Callable[..., Any], served: Served
) -> None:
    first, second = open_page(), open_page()
    assert first.locator("#stop").is_visible()
    sign_in_and_take_the_seat(first)
    until_shown(first, "seat", "In command")
    sign_in_and_take_the_seat(second)
    until_shown(second, "toast", "has it")
    until_shown(first, "dialog-text", "asks for the seat")
    first.click("#dialog-cancel")
    served.commander.sent.clear()
    first.fill("#set-point", "-12")
    first.press("#set-point", "Enter")
    until_shown(first, "dialog-text", "hauling in")
    assert not served.commander.sent  # nothing before it is confirmed
    agree(first, "Confirm the command")
    until_shown(first, "toast", "reports")
    ((winch, command),) = set(served.commander.sent)  # repeated at 10 Hz
    assert (winch, command.kind) == ("winch", "speed")
    assert command.value == pytest.approx(-0.2)
    second.click("#stop")  # from a page without the seat
    until_shown(second, "toast", "emergency stop")
    assert any(command.kind == "emergency_stop" for _, command in served.commander.sent)


def test_a_crew_sets_a_limit_and_tares(open_page: Callable[..., Any], served: Served) -> None:
    page = open_page()
    sign_in_and_take_the_seat(page)
    until_shown(page, "seat", "In command")
    page.keyboard.press("4")
    until_shown(page, "limits", "Tension ≤ 500.0 kN none Set …")
    page.click("#limits tbody tr:first-child button")
    until_shown(page, "dialog-title", "Limit of the tension")
    page.fill("#dialog-input", "450")
    page.click("#dialog-ok")
    until_shown(page, "limits", "Tension ≤ 500.0 kN ≤ 450.0 kN Set …")
    assert served.commander.alert_words[-1] == "limit tension_n 450000.0"
    page.keyboard.press("3")
    page.click("#learning-tare")
    agree(page, "Tare the load pin?")
    until_shown(page, "toast", "estimate/tare: done")


def test_the_log_is_printed_black_on_white(open_page: Callable[..., Any], served: Served) -> None:
    page = open_page(palette="night")
    page.keyboard.press("4")
    until_shown(page, "casts", "running")
    assert page.pdf().startswith(b"%PDF")
    page.emulate_media(media="print")
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    until_shown(page, "sheet", "deep_lift: casts")
    assert not page.locator("#tab-log").is_visible()
    assert page.locator("#casts").is_visible()
    colours = page.evaluate(
        """[getComputedStyle(document.querySelector("#casts td")).color,
            getComputedStyle(document.body).backgroundColor]"""
    )
    assert colours == ["rgb(0, 0, 0)", "rgb(255, 255, 255)"]


def test_an_alert_flashes_until_it_is_acknowledged(
    open_page: Callable[..., Any], served: Served
) -> None:
    page = open_page()
    until_shown(page, "alerts", "No alert")
    served.source.alerts = [TENSION_ALARM]
    until(page, "document.querySelector('#alerts li.flash[data-priority=alarm]')")
    until_shown(page, "alerts", "510 kN")
    page.click("#alerts li button")
    sign_in(page)
    until_shown(page, "toast", "sent")
    assert served.commander.alert_words[-1] == "acknowledge 10001.1"
    served.source.alerts = [replace(TENSION_ALARM, state=State.ACKNOWLEDGED, revision=1)]
    until(page, "!document.querySelector('#alerts li.flash')")
    until_shown(page, "alerts", "Shelve")
    page.click("#alerts li button")
    until_shown(page, "dialog-title", "Shelve the alert?")
    page.fill("#dialog-input", "10")
    page.click("#dialog-ok")
    until_shown(page, "toast", "shelve 10001.1 600: sent")
    assert served.commander.alert_words[-1] == "shelve 10001.1 600"
    later_ns = 3600 * 1_000_000_000
    shelved = replace(TENSION_ALARM, state=State.ACKNOWLEDGED, revision=2)
    served.source.alerts = [replace(shelved, shelved_until_ns=10**6 * later_ns)]
    until_shown(page, "alert-count", "1 SHELVED")  # as its heading is drawn
    page.click("#alerts li.shelved button")
    until_shown(page, "toast", "unshelve 10001.1: sent")
    assert served.commander.alert_words[-1] == "unshelve 10001.1"


HEAR_TONES = """window.tones = [];
const make = AudioContext.prototype.createOscillator;
AudioContext.prototype.createOscillator = function () {
  const one = make.call(this);
  window.tones.push(one);
  return one;
};
null"""


def test_alarms_and_warnings_sound_until_they_are_silenced(
    open_page: Callable[..., Any], served: Served
) -> None:
    """Three tones of 960 Hz for an alarm, two of 620 Hz for a warning; only after a touch."""
    page = open_page()
    page.evaluate(HEAR_TONES)
    served.source.alerts = [TENSION_ALARM]
    until_shown(page, "alerts", "510 kN")
    assert page.locator("#sound-off").is_visible()
    assert page.evaluate("window.tones.length") == 0
    page.click("#winch .big h2")
    until(page, "document.getElementById('sound-off').hidden && window.tones.length >= 3")
    assert page.evaluate("window.tones.map((one) => one.frequency.value)")[:3] == [960.0] * 3
    served.source.alerts = [replace(TENSION_ALARM, state=State.SILENCED, revision=2)]
    until(page, "!document.querySelector('#alerts li.flash')")
    page.evaluate("window.tones.length = 0")
    time.sleep(4.5)  # more than from one sound to the next
    assert page.evaluate("window.tones.length") == 0
    served.source.alerts = [replace(TENSION_ALARM, priority=Priority.WARNING, revision=3)]
    until(page, "window.tones.length === 2")
    assert page.evaluate("window.tones.map((one) => one.frequency.value)") == [620.0] * 2


def test_a_page_reconnects_when_its_server_comes_back(browser: Any) -> None:
    served = Served()
    context = browser.new_context()
    page = context.new_page()
    page.set_default_timeout(1e3 * PATIENCE_S)
    try:
        page.goto(served.server.address)
        until(page, "document.getElementById('link').textContent === 'LIVE'")
        port = served.server.port
        served.server.close()
        until(page, "document.getElementById('link').textContent === 'CONSOLE LOST'")
        log = Log(served.pages)
        again = Server(served.pages, served.desk, log, port=port)
        threading.Timer(0.2, again.start).start()
        until(page, "document.getElementById('link').textContent === 'LIVE'")
        again.close()
    finally:
        context.close()
