"""Orders that a winch takes, in a schedule and over time, and its answers to impossible ones."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from rope_twin.scene.load import load_scene
from rope_twin.scene.rigging import places, winches_by_name
from rope_twin.scene.schema import WINCH
from rope_twin.scene.winch import Brake, ConstantTension, Drive, Drum, EmergencyStop, ScheduleRow
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.state import scene_properties
from rope_twin.twin.winch.commands import (
    COMMANDER_LOST,
    MAX_AT_ONCE,
    MAX_PLANNED,
    NEW_COMMANDER,
    CommandSample,
    TensionFeedback,
    WinchCommand,
    schedule_samples,
)
from rope_twin.twin.winch.winch import Winch, winch_of_rope

S = 1_000_000_000
PLAIN = WinchScene(
    speed_limit_m_per_s=1.0, acceleration_limit_m_per_s2=0.5, min_line_out_m=20.0,
    max_line_out_m=200.0,
)  # fmt: skip
EQUIPPED = WinchScene(
    speed_limit_m_per_s=1.0, acceleration_limit_m_per_s2=0.5, min_line_out_m=20.0,
    max_line_out_m=200.0, drum=Drum(core_radius_m=0.5, turns_per_layer=30.0),
    drive=Drive(inertia_kg_m2=500.0, torque_limit_n_m=60e3),
    brake=Brake(holding_torque_n_m=90e3, delay_s=0.6),
    emergency_stop=EmergencyStop(deceleration_m_per_s2=2.0),
    constant_tension=ConstantTension(gain_m_per_s_per_kn=0.05, integral_time_s=4.0),
)  # fmt: skip
CALM = TensionFeedback(50e3, 50e3, 100.0, 0.0, 0.0, 0.0)  # its tension answers nothing


def stepped(
    winch: Winch, seconds: float, felt: TensionFeedback | None = CALM, begin_s: float = 0.0
) -> None:
    for k in range(round(seconds / 0.01)):
        winch.step(round((begin_s + 0.01 * k) * 1e9), 0.01, 0.0, felt)


@pytest.mark.parametrize(
    ("scene", "order", "kind", "words"),
    [
        (None, WinchCommand("length", 50.0), "impossible", "no winch; add a winch"),
        (PLAIN, WinchCommand("length", math.nan), "non_finite", "it must be a finite number"),
        (
            PLAIN,
            WinchCommand("length", 250.0),
            "impossible",
            "length 250 m; this winch has 20 to 200 m",
        ),
        (PLAIN, WinchCommand("depth", -5.0), "impossible", "depth -5 m; depth counts from"),
        (PLAIN, WinchCommand("depth", math.inf), "non_finite", "depth inf m"),
        (PLAIN, WinchCommand("tension", 1e5), "impossible", "no constant tension; add"),
        (EQUIPPED, WinchCommand("tension", -1.0), "impossible", "a rope pulls with 0 to"),
        (PLAIN, WinchCommand("set_brake"), "impossible", "'set_brake' but this winch has no brake"),
        (PLAIN, WinchCommand("emergency_stop"), "impossible", "has no emergency stop; add"),
        (EQUIPPED, WinchCommand("compensate"), "impossible", "has no heave compensation"),
        (EQUIPPED, WinchCommand("set_break"), "impossible", "did you mean 'set_brake'?"),
        (PLAIN, WinchCommand("speed", 11.0), "impossible", "no winch runs faster than 10 m/s"),
    ],
)
def test_what_cannot_be_gets_one_sentence(
    scene: WinchScene | None, order: WinchCommand, kind: str, words: str
) -> None:
    winch = Winch(scene, 100.0)
    sentence = winch.take(None, order, 0)
    assert words in sentence
    reported = [one for one in winch.health(0).values() if one.refusal == sentence]
    assert len(reported) == 1, "diagnostics tell of it, also where there is nothing to switch"
    assert sentence.startswith("winch command: ")
    assert sum(getattr(health, kind) for health in winch.health(0).values()) == 1
    stepped(winch, 1.0)
    assert winch.line.length_m == 100.0


def test_the_stamps_of_orders_are_judged_as_those_of_speeds() -> None:
    winch = Winch(EQUIPPED, 100.0)
    assert winch.take(2 * S, WinchCommand("length", 120.0), S) == ""
    assert "came twice" in winch.take(2 * S, WinchCommand("speed", 0.1), S)
    assert "order of their stamps" in winch.take(3 * S // 2, WinchCommand("depth", 90.0), S)
    assert "after it was due" in winch.take(4 * S, WinchCommand("tension", 1e4), 5 * S)
    other_clock = winch.take(4 * S, WinchCommand("tension", 1e4), 3600 * S)
    assert "stamp 4.0 s lies 3596.0 s back; sender and twin must share one clock" in other_clock
    assert "25.0 s ahead" in winch.take(30 * S, WinchCommand("speed", 0.1), 5 * S)
    assert winch.take(2 * S, WinchCommand("set_brake"), S) == "", (
        "switches have stamps of their own"
    )


def test_a_switch_at_once_leaves_planned_ones_and_comes_first() -> None:
    winch = Winch(EQUIPPED, 100.0)
    assert winch.take(S, WinchCommand("set_brake"), 0) == ""
    assert winch.take(None, WinchCommand("emergency_stop"), 0) == ""
    assert winch.take(None, WinchCommand("reset"), 0) == ""
    assert winch.take(None, WinchCommand("release_brake"), 0) == ""
    stepped(winch, 1.0)
    assert dict(winch.snapshot().figures)["brake_holds"] == 0.0
    stepped(winch, 0.7, begin_s=1.0)
    assert dict(winch.snapshot().figures)["brake_holds"] == 1.0


def test_in_an_emergency_stop_nothing_moves_until_it_is_reset() -> None:
    winch = Winch(EQUIPPED, 100.0)
    winch.take(None, WinchCommand("speed", 1.0), 0)
    stepped(winch, 3.0)
    assert winch.line.speed_m_per_s == 1.0
    winch.take(None, WinchCommand("emergency_stop"), 3 * S)
    before = winch.line.length_m
    stepped(winch, 1.0, begin_s=3.0)
    assert winch.line.length_m - before == pytest.approx(1.0 / (2.0 * 2.0), abs=1e-9)
    for begin_s, speed in ((4.0, -1.0), (4.5, 0.0)):  # zero speed is what it does
        winch.take(None, WinchCommand("speed", speed), round(begin_s * S))
        stepped(winch, 0.5, begin_s=begin_s)
    assert winch.line.speed_m_per_s == 0.0
    assert winch.snapshot().mode == "emergency_stop"
    moving = winch.health(5 * S)["winch_command"]
    assert moving.impossible == moving.recently_refused == 1
    assert "'speed' in an emergency stop; reset it first" in moving.note
    assert "until it is reset" in winch.at_limit
    winch.take(None, WinchCommand("release_brake"), 5 * S)
    stepped(winch, 1.0, begin_s=5.0)
    assert dict(winch.snapshot().figures)["brake_holds"] == 1.0
    refused = winch.health(6 * S)["winch_switch"]
    assert "'release_brake' in an emergency stop; reset it first" in refused.note
    assert winch.forbids("release_brake") == refused.note
    winch.take(None, WinchCommand("reset"), 6 * S)
    winch.take(None, WinchCommand("release_brake"), 6 * S)
    winch.take(None, WinchCommand("speed", -1.0), 6 * S)
    stepped(winch, 3.0, begin_s=6.0)
    assert winch.line.speed_m_per_s == -1.0
    assert winch.forbids("release_brake") == ""


def test_a_brake_takes_its_delay() -> None:
    winch = Winch(EQUIPPED, 100.0)
    winch.take(None, WinchCommand("speed", 1.0), 0)
    stepped(winch, 3.0)
    winch.take(None, WinchCommand("set_brake"), 3 * S)
    stepped(winch, 0.59, begin_s=3.0)
    assert winch.line.speed_m_per_s == 1.0
    stepped(winch, 1.0, begin_s=3.59)
    assert winch.line.speed_m_per_s == 0.0


def test_a_depth_out_of_the_line_s_reach_is_reported() -> None:
    winch = Winch(PLAIN, 100.0)
    assert winch.take(None, WinchCommand("depth", 400.0), 0) == ""
    stepped(winch, 1.0)
    assert "needs 400.0 m of line; the winch has 20 to 200 m" in winch.at_limit


@pytest.mark.parametrize(
    ("name", "winch_name"), [("deep_lift", WINCH), ("two_line_lift", "aft_sheave")]
)
def test_a_depth_that_no_rope_of_the_winch_reaches_is_refused(name: str, winch_name: str) -> None:
    """Not even as long as it is when it breaks: all of it times 1 + MBL/EA, from the hang-off."""
    scene = load_scene(name)
    line = next(line for line in scene.ropes if line.from_ == winch_name)
    winch, own = winch_of_rope(scene, line), winches_by_name(scene)[winch_name]
    EA = line.made_of[0].rope.axial_stiffness_n
    assert EA is not None
    whole = own.max_line_out_m * (1.0 + line.made_of[0].rope.breaking_load_n / EA)
    reach = whole - places(scene)[winch_name][2]
    assert winch.take(None, WinchCommand("depth", reach - 0.1), 0) == ""
    sentence = winch.take(None, WinchCommand("depth", reach + 0.1), 0)
    assert f"m of rope reach {reach:.1f} m, stretched until it breaks" in sentence
    assert winch.health(0)[winch.counter.name].impossible == 1
    winch.adapt_to_cut(50.0, line.length_m - 50.0)
    assert "stretched" in winch.take(None, WinchCommand("depth", reach - 40.0), 0), (
        "the rope was cut"
    )


def test_a_tension_beyond_the_winch_s_speed_is_reported() -> None:
    winch = Winch(EQUIPPED, 100.0)
    assert winch.take(None, WinchCommand("tension", 10e3), 0) == ""
    stepped(winch, 1.0)
    assert "10 kN would take" in winch.at_limit


def test_a_schedule_tells_more_than_speeds() -> None:
    rows = (
        ScheduleRow(at_s=0.0, line_out_m=120.0),
        ScheduleRow(at_s=0.25, switch="set_brake"),
        ScheduleRow(at_s=0.25, tension_n=5e4),
        ScheduleRow(at_s=0.45, payload_depth_m=90.0),
        ScheduleRow(at_s=0.5, speed_m_per_s=-0.5),
    )
    winch = WinchScene(**{**vars(EQUIPPED), "schedule": rows})
    reported = schedule_samples(winch, 0, round(0.55 * S))
    length, tension = WinchCommand("length", 120.0), WinchCommand("tension", 5e4)
    assert reported == [
        CommandSample(0, length),
        CommandSample(S // 10, length),
        CommandSample(S // 5, length),
        CommandSample(S // 4, WinchCommand("set_brake")),
        CommandSample(S // 4, tension),
        CommandSample(3 * S // 10, tension),
        CommandSample(4 * S // 10, tension),
        CommandSample(9 * S // 20, WinchCommand("depth", 90.0)),
        CommandSample(S // 2, WinchCommand("speed", -0.5)),
    ]


@pytest.mark.parametrize(
    ("stamp_s", "words"),
    [
        (99.9, "came 100 ms after its stamp; it is executed at once"),
        (95.0, "came 5000 ms after it was due"),
        (-1.7e9, "sender and twin must share one clock"),
        (1e9, "sender and twin must share one clock"),
    ],
    ids=["late", "later", "years ago", "years ahead"],
)
def test_an_emergency_stop_is_never_refused_for_its_stamp(stamp_s: float, words: str) -> None:
    """It is executed at once, and flagged."""
    winch = Winch(EQUIPPED, 100.0)
    winch.take(None, WinchCommand("speed", 1.0), 96 * S)
    stepped(winch, 3.0, begin_s=97.0)
    assert winch.take(round(stamp_s * 1e9), WinchCommand("emergency_stop"), 100 * S) == ""
    stepped(winch, 1.0, begin_s=100.0)
    assert winch.line.speed_m_per_s == 0.0
    switch = winch.health(100 * S)["winch_switch"]
    assert (switch.refused, switch.executed_late) == (0, 1)
    assert words in switch.warning


def test_an_emergency_stop_whose_stamp_came_twice_is_executed() -> None:
    winch = Winch(EQUIPPED, 100.0)
    winch.take(None, WinchCommand("speed", 1.0), 0)
    assert winch.take(3 * S, WinchCommand("set_brake"), S) == ""
    for stamp_ns in (3 * S, 2 * S):
        assert winch.take(stamp_ns, WinchCommand("emergency_stop"), 2 * S) == ""
    stepped(winch, 1.0, begin_s=2.0)
    assert winch.snapshot().mode == "emergency_stop"


@pytest.mark.parametrize(
    "order", [WinchCommand("speed", 0.7), WinchCommand("length", 130.0), WinchCommand("set_brake")]
)
def test_an_order_that_is_a_little_late_is_executed_at_once_and_reported(
    order: WinchCommand,
) -> None:
    winch = Winch(EQUIPPED, 100.0)
    assert winch.take(9_400_000_000, order, 10 * S) == ""
    health = next(one for one in winch.health(10 * S).values() if one.accepted)
    assert (health.executed_late, health.refused) == (1, 0)
    assert f"'{order.kind}' came 600 ms after its stamp" in health.warning
    assert not winch.health(71 * S)[next(iter(winch.health(0)))].warning, "for a minute"
    stepped(winch, 1.0, begin_s=10.0)
    moved = winch.line.speed_m_per_s > 0.0 or dict(winch.snapshot().figures)["brake_holds"] == 1.0
    assert moved
    fresh = Winch(EQUIPPED, 100.0)
    assert "after it was due" in fresh.take(9 * S, order, 10 * S), "a second late is too late"


def test_a_late_order_does_not_undo_a_stop_that_was_wanted_at_once() -> None:
    """It was sent before the stop, and came after it."""
    winch = Winch(EQUIPPED, 100.0)
    assert winch.take(None, WinchCommand("speed", 0.0), 10 * S) == ""
    sentence = winch.take(9_900_000_000, WinchCommand("speed", 1.0), 10_100_000_000)
    assert "lies before a command that was executed at once" in sentence
    assert winch.take(10_050_000_000, WinchCommand("speed", 1.0), 10_100_000_000) == ""


def test_orders_that_wait_are_bounded_and_a_stop_still_comes_through() -> None:
    """A flood of switches between two steps, and of planned speeds."""
    winch = Winch(EQUIPPED, 100.0)
    taken = [winch.take(None, WinchCommand("set_brake"), 0) for _ in range(500)]
    assert sum(not words for words in taken) == MAX_AT_ONCE == 100
    assert "100 of them wait already; send commands when they change" in taken[-1]
    for _ in range(500):
        assert winch.take(None, WinchCommand("emergency_stop"), 0) == ""
    assert len(winch._switches.waiting) == MAX_AT_ONCE + 1
    planned = [winch.take(k * 1_000_000, WinchCommand("speed", 0.1), 0) for k in range(1, 5000)]
    assert sum(not words for words in planned) == MAX_PLANNED
    stepped(winch, 1.0)
    assert winch.snapshot().mode == "emergency_stop"


@pytest.mark.parametrize(
    ("wanted", "speed", "brake", "words"),
    [
        ("hold_speed", 1.0, 0.0, "its last command stands"),
        ("ramp_to_zero", 0.0, 0.0, "it ramps to zero speed"),
        ("brake", 0.0, 1.0, "it ramps to zero speed and sets its brake"),
    ],
)
def test_a_winch_does_what_its_scene_says_when_its_commander_is_lost(
    wanted: str, speed: float, brake: float, words: str
) -> None:
    winch = Winch(replace(EQUIPPED, when_commander_lost=wanted), 100.0)
    assert winch.take(S, WinchCommand("speed", 1.0), S) == ""
    assert winch.take(5 * S, WinchCommand("speed", -1.0), S) == "", "a plan that is dropped"
    stepped(winch, 3.0, begin_s=1.0)
    assert winch.line.speed_m_per_s == 1.0
    assert winch.take(None, WinchCommand(COMMANDER_LOST), 4 * S) == ""
    stepped(winch, 3.0, begin_s=4.0)
    assert winch.line.speed_m_per_s == speed
    assert dict(winch.snapshot().figures)["brake_holds"] == brake
    assert words in winch.health(4 * S)["winch_command"].warning


def test_a_new_commander_s_plan_may_begin_before_the_end_of_the_former_one_s() -> None:
    """A stop that was planned stands."""
    winch = Winch(EQUIPPED, 100.0)
    assert winch.take(8 * S, WinchCommand("speed", 1.0), S) == ""
    assert winch.take(9 * S, WinchCommand("emergency_stop"), S) == ""
    assert winch.take(None, WinchCommand(NEW_COMMANDER), S) == ""
    assert winch.take(2 * S, WinchCommand("speed", -0.5), S) == ""
    stepped(winch, 7.9, begin_s=1.0)
    assert winch.line.speed_m_per_s == -0.5
    stepped(winch, 2.0, begin_s=8.9)
    assert winch.snapshot().mode == "emergency_stop"


def test_what_a_winch_does_without_a_commander_is_no_figure_of_its_scene() -> None:
    """Studies and saved states of the scene stay what they are."""
    other = replace(PLAIN, when_commander_lost="hold_speed")
    assert repr(other) == repr(PLAIN)
    assert scene_properties(other) == scene_properties(PLAIN)
