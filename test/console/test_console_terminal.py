"""The terminal console: the first page's figures as text, its trend, its keys, a plain terminal."""

from __future__ import annotations

import asyncio
import math
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from console_rig import FACTS, TENSION_ALARM, ConsoleRig, recorded_lift
from sample_snapshot import lifted
from textual.pilot import Pilot
from textual.widgets import Digits, Static

from rope_twin.alerts.limits import CrewLimits
from rope_twin.cli import main
from rope_twin.console.figures import (
    UNITS,
    View,
    alert_rows,
    big_figures,
    fixed,
    of_rope,
    payload_figures,
    risk_lines,
    winch_figures,
)
from rope_twin.console.terminal import LABEL, Curve, Styles, TerminalConsole, curves, draw

KN_M_PER_MIN, T_M_PER_MIN, KN_M_PER_S, _ = UNITS
STYLES = Styles("c", "m", "b", "l", "a")
PATIENCE_S = 60.0


def filled(seconds: float = 2.0) -> ConsoleRig:
    """A rig that has run for some time."""
    rig = ConsoleRig()
    rig.source.horizon_s = 12.0
    rig.tick(round(seconds / 0.05))
    return rig


def test_numbers_as_text() -> None:
    assert fixed(-0.04, 1) == "0.0"
    assert fixed(-1.26, 1) == "−1.3"
    assert fixed(1.0, 2, signed=True) == "+1.00"
    assert fixed(None, 1) == fixed(math.nan, 1) == "–"
    assert T_M_PER_MIN.forces(9806.65) == "1.00"
    assert KN_M_PER_S.speeds(0.5, True) == "+0.50"


def test_big_figures_are_those_of_the_topics() -> None:
    rig = filled()
    snapshot, values = rig.source.snapshot, rig.pages.readings.values
    out, speed, tension, used = big_figures(values, FACTS, KN_M_PER_MIN)
    assert (out.text, out.unit, out.note) == ("3000.0", "m", "100 to 3200 m")
    assert (speed.text, speed.note) == ("+30.0", "↓ paying out, limit ±60.0")
    assert tension.text == f"{snapshot.tension_top_n / 1e3:.1f}"
    assert tension.note == "measured 321.0, Δ +0.2"
    assert used.text == f"{snapshot.tension_top_n / 1e4:.1f}"  # of 1 MN
    assert tension.topic == "ropes/tension_top"


def test_nothing_known_is_no_number() -> None:
    figures = big_figures({}, {}, KN_M_PER_MIN) + payload_figures({}, [], {}, KN_M_PER_MIN)
    assert {one.text for one in figures} == {"–"}
    assert alert_rows({}) == risk_lines({}, KN_M_PER_MIN) == []


def test_a_lost_instrument_is_not_compared() -> None:
    rig = filled()
    rig.pages.readings.values["residuals"][0]["age_s"] = 3.1
    tension = big_figures(rig.pages.readings.values, FACTS, KN_M_PER_MIN)[2]
    assert tension.note == "computed ± 0.0 kN (95 %)"


def test_payload_and_risk() -> None:
    rig = filled()
    values, profile = rig.pages.readings.values, rig.pages.profile
    rows = {one.label: one for one in payload_figures(values, profile, FACTS, KN_M_PER_MIN)}
    assert rows["Payload depth"].text == f"{-rig.source.snapshot.payload_position_m[2]:.1f}"
    min_n = min(profile[0]["low_n"])
    assert rows["Slack margin"].text == f"{(min_n - 1e4) / 1e3:.1f}"
    assert risk_lines(values, KN_M_PER_MIN) == [
        "P(> 500.0 kN) in 10/20/30 s: 2/4/6 %",
        "P(slack) in 10/20/30 s: 1/2/3 %, the last by climatology",
    ]


def test_a_rope_has_its_own_winch_payload_and_limit() -> None:
    facts = {
        "ropes": [{"name": "fore", "winch": "winch", "payload": "module", "allowed_n": 5e5},
                  {"name": "aft", "winch": "aft_sheave", "payload": "frame", "allowed_n": 4e5}],
        "winches": {"winch": {"speed_limit_m_per_s": 1.0},
                    "aft_sheave": {"speed_limit_m_per_s": 0.5}},
    }  # fmt: skip
    values = {
        "ropes": ["fore", "aft"], "tension_n": [2e5, 3e5], "line_out_m": [600.0, 601.0],
        "winch_mode": "winch: brake; aft_sheave: speed 0.2 m/s", "seat": "winch: a; aft_sheave: b",
        "payloads": [{"name": "module", "place_m": [0.0, 0.0, -1.0], "velocity_m_per_s": None},
                     {"name": "frame", "place_m": [0.0, 0.0, -2.0], "velocity_m_per_s": None}],
        "residuals": [{"quantity": "top_tension_n", "name": "winch", "measured": 1e5, "age_s": 0.1,
                       "residual": 0.0}],
    }  # fmt: skip
    view = of_rope(View(values, facts, [{"min_n": 1e3}, {"min_n": 2e3}]), 1)
    out, speed, tension, _ = big_figures(view.values, view.facts, KN_M_PER_MIN)
    assert (out.text, tension.text, tension.warns) == ("601.0", "300.0", False)
    assert "±30.0" in speed.note
    assert "measured" not in tension.note  # that is the other winch's
    texts = [one.text for one in winch_figures(view.values, view.facts)]
    assert texts == ["speed 0.2 m/s", "b"]
    depth, *_, slack = payload_figures(view.values, view.profile, view.facts, KN_M_PER_MIN)
    assert (depth.text, slack.text) == ("2.0", "2.0")
    crew = CrewLimits({})
    crew.set("tension_n", "250000")
    row = {"level": 0, "message": "", "values": dict(crew.row().values)}
    values["diagnostics simulation: crew limits"] = row
    view = of_rope(View(values, facts, []), 1)
    assert view.facts["ropes"][0]["allowed_n"] == 250e3
    assert big_figures(view.values, view.facts, KN_M_PER_MIN)[2].warns


def test_the_next_rope_is_shown_by_a_key() -> None:
    rig = ConsoleRig()
    rig.source.snapshot = lifted()
    rig.pages.tick_or_report()

    async def steps(app: TerminalConsole, pilot: Pilot[None]) -> None:
        app.draw()
        assert app.query(Digits)[0].value == "100.0"
        await pilot.press("l")
        assert app.query(Digits)[0].value == "8.0"
        assert "port" in shown(app, "#top")
        await pilot.press("l", "l")
        assert app.query(Digits)[0].value == "100.0"

    piloted(rig, steps)


def test_faults_precede_alerts_and_diagnostics_stand_in_for_them() -> None:
    rig = filled()
    rig.source.alerts = [TENSION_ALARM]
    rig.tick()
    values = dict(rig.pages.readings.values) | {"fault residuals": "no such table"}
    assert [one.title for one in alert_rows(values)] == ["fault residuals", "top tension"]
    del values["alerts"]
    values["diagnostics simulation: pacing"] = {"level": 1, "message": "late", "values": {}}
    assert [(one.priority, one.text) for one in alert_rows(values)] == [
        ("alarm", "no such table"),
        ("warning", "late"),
    ]


def characters(text: Any) -> list[str]:
    """The rows of a chart without its labels and without the axis."""
    return [row[LABEL:] for row in text.plain.split("\n")[:-1]]


def test_a_rising_line_goes_from_the_lower_left_to_the_upper_right() -> None:
    points = [(0.5 * k - 60.0, float(k)) for k in range(121)]
    rows = characters(draw([Curve(points, "c")], [], LABEL + 30, 11, STYLES))
    assert len(rows) == 10
    firsts = [next((k for k, one in enumerate(row) if one != "⠀"), None) for row in rows]
    shown = [one for one in firsts if one is not None]
    assert shown == sorted(shown, reverse=True)
    assert len(shown) >= 7  # the margins above and below stay empty
    assert shown[-1] == 0
    inked = sum(one != "⠀" for row in rows for one in row)
    assert 30 <= inked <= 40  # one line through every column


def test_a_chart_goes_up_to_the_limit_if_it_is_asked_to() -> None:
    points = [(0.5 * k - 60.0, 10.0) for k in range(121)]
    near = draw([Curve(points, "c")], [40.0], 60, 12, STYLES)
    far = draw([Curve(points, "c")], [40.0], 60, 12, STYLES, to_limit=True)
    assert "l" not in {str(span.style) for span in near.spans}
    assert "l" in {str(span.style) for span in far.spans}
    assert far.plain.split("\n")[0].strip().startswith("42.0")


def test_a_forecast_stands_ahead_of_now_and_an_old_one_nowhere() -> None:
    rig = filled()
    forecast = rig.pages.readings.values["forecast"]
    columns = rig.pages.trend.columns()
    shown = curves(columns, forecast, KN_M_PER_MIN, STYLES)
    ahead = [at for curve in shown for at, _ in curve.points if at > 0.0]
    assert max(ahead) == pytest.approx(30.0, abs=0.5)
    assert "+30 s" in draw(shown, [], 60, 12, STYLES).plain
    old = dict(forecast) | {"at_s": forecast["at_s"] - 5.0}
    shown = curves(columns, old, KN_M_PER_MIN, STYLES)
    assert not [at for curve in shown for at, _ in curve.points if at > 0.0]


def piloted(
    rig: ConsoleRig,
    steps: Callable[[TerminalConsole, Pilot[None]], Awaitable[None]],
    size: tuple[int, int] = (120, 34),
) -> None:
    """Run the console of a rig, whose clock stands still unless a step moves it."""

    async def run() -> None:
        app = TerminalConsole(rig.pages, rig.clock)
        async with app.run_test(size=size) as pilot:
            await steps(app, pilot)

    asyncio.run(run())


def shown(app: TerminalConsole, name: str) -> str:
    """Text of a part of the screen."""
    return str(app.query_one(name, Static).content)


@pytest.mark.parametrize("size", [(80, 24), (120, 34), (200, 60)])
def test_the_screen_shows_the_values(size: tuple[int, int]) -> None:
    rig = filled()

    async def steps(app: TerminalConsole, pilot: Pilot[None]) -> None:
        app.draw()
        await pilot.pause()
        digits = [one.value for one in app.query(Digits)]
        assert digits == ["3000.0", "+30.0", "312.5", "31.2"]
        assert "LIVE" in shown(app, "#top")
        assert "No alert" in shown(app, "#alerts")
        for one in app.query("Static, Digits"):
            region = one.region
            assert region.right <= size[0]
            assert region.bottom <= size[1]
        await pilot.press("u")
        assert app.query(Digits)[2].value == f"{312500 / 9806.65:.2f}"
        before = app.theme
        await pilot.press("p")
        assert app.theme != before

    piloted(rig, steps, size)


def test_loss_of_the_twin_shows_and_its_return_too() -> None:
    rig = filled()

    async def steps(app: TerminalConsole, pilot: Pilot[None]) -> None:
        rig.source.lost = True
        rig.clock.now_s += 1.0
        app.draw()
        await pilot.pause()
        assert "TWIN LOST" in shown(app, "#top")
        assert all(one.has_class("old") for one in list(app.query("_Big"))[:3])
        rig.source.lost = False
        rig.tick()
        app.draw()
        assert "LIVE" in shown(app, "#top")
        assert not any(one.has_class("old") for one in app.query("_Big"))

    piloted(rig, steps)


def test_an_alarm_rings_until_the_bell_is_off(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = filled()
    rings: list[float] = []
    monkeypatch.setattr(TerminalConsole, "bell", lambda self: rings.append(rig.clock.now_s))

    async def steps(app: TerminalConsole, pilot: Pilot[None]) -> None:
        rig.source.alerts = [TENSION_ALARM]
        rig.tick()
        app.draw()
        assert "!!ALARM top tension" in shown(app, "#alerts")
        assert len(rings) == 1
        app.draw()
        assert len(rings) == 1
        rig.tick(50)
        app.draw()
        assert len(rings) == 2
        await pilot.press("b")
        rig.tick(50)
        app.draw()
        assert len(rings) == 2

    piloted(rig, steps)


def test_a_fault_of_the_source_is_an_alert_not_an_end() -> None:
    rig = filled()

    async def steps(app: TerminalConsole, pilot: Pilot[None]) -> None:
        rig.source.broken = True
        rig.tick()
        app.draw()
        assert "no such subscription" in shown(app, "#alerts")
        assert app.is_running

    piloted(rig, steps)


@pytest.mark.parametrize(
    ("more", "words"),
    [((), "ssh -t"), (("--control",), "leave --control out"), (("--json",), "leave --json out"),
     (("--address", "8500"), "leave --address out")],
)  # fmt: skip
def test_it_wants_a_terminal_and_shows_only(
    more: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["console", "--terminal", *more]) == 1
    (sentence,) = capsys.readouterr().err.strip().splitlines()
    assert words in sentence


def test_a_recording_in_a_plain_terminal(tmp_path: Path) -> None:
    """From a real command in a pseudo-terminal: it draws, and `q` ends it with code 0."""
    bag = str(recorded_lift(tmp_path / "lift", 20.0))
    leader, follower = pty.openpty()
    command = [sys.executable, "-m", "rope_twin", "console", "--terminal", bag]
    environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "100", "LINES": "30"}
    process = subprocess.Popen(command, stdin=follower, stdout=follower, stderr=follower,
                               env=environment, start_new_session=True)  # fmt: skip
    os.close(follower)
    seen, give_up = b"", time.monotonic() + PATIENCE_S
    try:
        while b"RECORDING" not in seen or b"Tension" not in seen:
            assert time.monotonic() < give_up, seen[-2000:]
            if select.select([leader], [], [], 0.1)[0]:
                seen += os.read(leader, 65536)
        os.write(leader, b"q")
        while process.poll() is None:
            assert time.monotonic() < give_up
            if select.select([leader], [], [], 0.1)[0]:
                seen += _rest(leader)
        assert process.returncode == 0
        assert re.search(rb"\x1b\[\?1049l", seen)  # the terminal is given back
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            process.wait()
        os.close(leader)


def _rest(leader: int) -> bytes:
    """Read what is left; on Linux the end of the other side is an error."""
    try:
        return os.read(leader, 65536)
    except OSError:
        return b""
