"""Inputs wait for the next slot, are applied in their order, and survive the log with every bit."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rope_twin import Twin, load_scene
from rope_twin.errors import InputError
from rope_twin.recording.session import (
    InputLog,
    SessionStart,
    SkippedSnapshots,
    encode_json,
    read_log,
)
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.topics import INPUT_LOG_TOPIC, SESSION_TOPIC
from rope_twin.twin.input_queue import (
    WAITING_LIMIT,
    Call,
    InputQueue,
    LogEntry,
    apply,
    calls_of,
    plain_calls,
)
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.winch.commands import WinchCommand

POSE = ShipPose(5, (0.1, -0.0, 3.0), (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), (0.1, 0.2, 0.3))


@pytest.fixture
def twin() -> Twin:
    return Twin(load_scene("shallow_lift"))


def again(calls: tuple[Call, ...]) -> tuple[Call, ...]:
    return calls_of(json.loads(json.dumps(plain_calls(calls))))


@given(st.integers(-(2**62), 2**62), st.floats(), st.floats())
def test_numbers_come_back_with_every_bit(stamp_ns: int, position: float, speed: float) -> None:
    call = Call("submit_heave", (stamp_ns, position, np.float64(speed)), {"received_ns": None})
    (back,) = again((call,))
    assert back.named == {"received_ns": None}
    assert back.arguments[0] == stamp_ns
    for value, other in zip((position, speed), back.arguments[1:], strict=True):
        same = math.isnan(value) and math.isnan(other)
        assert same or np.float64(value).tobytes() == np.float64(other).tobytes()


def test_every_kind_of_input_comes_back() -> None:
    profile = np.array([[0.0, 0.1, math.nan], [-10.0, math.inf, 0.0]])
    calls = (
        Call("submit_pose", (POSE,), {}),
        Call("submit_command", (None, WinchCommand("length", 3.0), "winch"), {}),
        Call("submit_cut", (7, math.inf, ""), {}),
        Call("submit_current", (profile,), {}),
        Call("invalidate_inputs", (), {}),
        Call("set_level", (AccuracyLevel(5_000_000, 1),), {}),
    )
    back = again(calls)
    assert back[:3] + back[4:] == calls[:3] + calls[4:]
    assert isinstance(back[1].arguments[1], WinchCommand)
    assert np.array_equal(back[3].arguments[0], profile, equal_nan=True)


@pytest.mark.parametrize(
    "plain",
    [
        [["save", ["/tmp/x"], {}]],
        [["submit_heave"]],
        3,
        [["submit_pose", [{"Path": {}}], {}]],
    ],
)
def test_a_log_cannot_call_anything_else(plain: Any) -> None:
    with pytest.raises(ValueError, match=r"is no input|no calls|not enough values"):
        calls_of(plain)


def test_inputs_are_applied_at_the_next_slot_and_logged(twin: Twin) -> None:
    log: list[LogEntry] = []
    queue = InputQueue(twin, twin, log.append)
    queue.advance(2)
    assert log == []
    assert queue.submit_command(None, WinchCommand("speed", 0.3), "winch") == ""
    assert queue.submit_heave(10_000_000, math.nan, 0.0) == ""  # the twin refuses it, and counts
    assert queue.snapshot().inputs["heave"].refused == 0
    queue.advance(2)
    queue.advance(2)
    (entry,) = log
    assert entry.time_ns == 20_000_000
    assert [call.method for call in entry.calls] == ["submit_command", "submit_heave"]
    assert queue.snapshot().inputs["heave"].refused == 1
    other = Twin(load_scene("shallow_lift"))
    other.advance(2)
    apply(other, again(entry.calls))
    other.advance(4)
    assert other.snapshot().line_out_m == twin.snapshot().line_out_m > 200.0


def test_other_elements_are_logged_ahead_of_the_inputs(twin: Twin) -> None:
    log: list[LogEntry] = []
    queue = InputQueue(twin, twin, log.append)
    queue.advance(2)
    twin.set_level(AccuracyLevel(20_000_000))
    queue.submit_heave(0, 0.0, 0.0)
    queue.advance(1)
    assert [call.method for call in log[0].calls] == ["set_level", "submit_heave"]
    twin.set_level(AccuracyLevel(50_000_000))
    queue.begin()  # who describes the session says it
    queue.advance(1)
    assert len(log) == 1


def test_what_waits_is_bounded(twin: Twin) -> None:
    queue = InputQueue(twin, twin)
    profile = np.zeros((WAITING_LIMIT // 5, 3))
    assert queue.submit_current(profile) == ""
    assert "wait for the next slot" in queue.submit_current(profile)
    assert queue.refused == 1
    queue.advance(1)
    assert queue.submit_heave(0, 0.0, 0.0) == ""


def test_a_twin_that_raises_on_an_input_is_stepped_on(twin: Twin) -> None:
    class Strict:
        def submit_heave(self, *_: Any) -> str:
            raise InputError("no")

    apply(Strict(), (Call("submit_heave", (0, 0.0, 0.0), {}),))  # type: ignore[arg-type]


def test_snapshots_that_were_thrown_out_are_in_the_log(twin: Twin) -> None:
    log = InputLog("a")
    log.begin(0)
    snapshots = []
    for _ in range(4):
        twin.advance(2)
        snapshots.append(twin.snapshot())
    assert list(log.messages(snapshots[0])) == []
    log.take(LogEntry(40_000_000, ()))
    later = LogEntry(160_000_000, ())
    log.take(later)  # of the slot after that snapshot
    (_, first), (_, second) = log.messages(snapshots[3])
    assert read_log(encode_json(first))[0] == ("a", 1)
    assert read_log(encode_json(second))[1] == SkippedSnapshots(2, 20_000_000, 80_000_000)
    ((topic, content),) = log.messages(None)
    assert topic == INPUT_LOG_TOPIC
    assert (content["time_ns"], content["number"]) == (later.time_ns, 3)


def test_a_session_that_begins_on_the_way_counts_its_log_from_one(twin: Twin) -> None:
    log = InputLog("a")
    assert log.begin(0)["session"] == 1
    log.take(LogEntry(0, ()))
    log.take(SessionStart(20_000_000, {"scene": "here"}))
    log.take(LogEntry(20_000_000, ()))
    first, mark, second = log.messages(None)
    assert mark == (
        SESSION_TOPIC, {"scene": "here", "run": "a", "session": 2, "logged_before": 1},
    )  # fmt: skip
    assert [content["number"] for _, content in (first, second)] == [1, 1]
    assert [content["session"] for _, content in (first, second)] == [1, 2]
