"""The border: which messages reach the twin's queue, and what is reported of the others."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rope_twin.messages import (
    Level,
    Status,
    encode_current,
    encode_cut,
    encode_heave,
    encode_lower_end,
    encode_measurement,
    encode_order,
)
from rope_twin.messages.cdr import decode, serialise
from rope_twin.messages.inputs import encode_pose
from rope_twin.messages.reports import encode_forecast
from rope_twin.run.border import (
    LATE_S,
    LONGEST_S,
    MESSAGES_ROW,
    SENDERS_ROW,
    InputBorder,
    SelectedSender,
    SenderLags,
)
from rope_twin.run.seat import PRIORITY
from rope_twin.scene.load import load_scene
from rope_twin.topics import FORECAST_RISK
from rope_twin.twin.input_queue import WAITING_LIMIT, InputQueue, LogEntry
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.readings import Measurement
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import WinchCommand

EPOCH_NS = 1_700_000_000_000_000_000


class Rig:
    """A twin at rest behind a border on a clock of the test's own."""

    def __init__(self, scene: str = "shallow_lift") -> None:
        self.now_s = 100.0
        self.applied: list[LogEntry] = []
        twin = Twin(load_scene(scene))
        self.inputs = InputQueue(twin, twin, self.applied.append)
        self.border = InputBorder(twin, self.inputs, PRIORITY, lambda: self.now_s)
        self.border.epoch_ns = EPOCH_NS

    def heave(self, stamp_s: float, sender: str = "mru") -> None:
        stamp_ns = EPOCH_NS + round(stamp_s * 1e9)
        data = encode_heave(stamp_ns, 0.1, 0.0)
        self.border.take_motion("ship/heave", data, sender, stamp_ns + 5_000_000)

    def row(self, name: str) -> Status:
        (found,) = (row for row in self.border.rows() if row.name == name)
        return found

    def calls(self) -> list[tuple[str, tuple[object, ...]]]:
        """Inputs that reached the twin."""
        self.inputs.advance(2)
        made = [(call.method, call.arguments) for entry in self.applied for call in entry.calls]
        return [one for one in made if one[0] != "take_remark"]

    def remarks(self) -> list[str]:
        """Remarks to the quality index on inputs that did not reach the twin."""
        made = [call for entry in self.applied for call in entry.calls]
        return [str(call.arguments[0]) for call in made if call.method == "take_remark"]


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_a_heave_message_reaches_the_queue_in_twin_time(rig: Rig) -> None:
    rig.heave(0.05)
    assert rig.calls() == [("submit_heave", (50_000_000, 0.1, 0.0, 55_000_000))]


@pytest.mark.parametrize("w", [0.0, 2.0, math.nan])
def test_heave_whose_orientation_is_no_rotation_is_refused(rig: Rig, w: float) -> None:
    message = decode("ship/heave", encode_heave(EPOCH_NS + 50_000_000, 0.1, 0.0))
    message.pose.pose.orientation.w = w
    rig.border.take_motion("ship/heave", serialise(message), "mru")
    assert rig.calls() == []
    row = rig.row(MESSAGES_ROW)
    assert row.level == Level.WARN
    assert row.values["ship/heave"] == "1"
    assert f"ship/heave: an orientation of length {w:g}; give a unit quaternion" in row.message


def test_a_service_is_answered_with_what_the_winch_will_do() -> None:
    """A brake that would not be released is not reported as released."""
    rig = Rig("emergency_stop")
    assert rig.border.switch("winch", "release_brake")[0]
    assert rig.border.switch("winch", "emergency_stop") == (True, "winch winch: emergency stop")
    rig.inputs.advance(2)
    done, words = rig.border.switch("winch", "release_brake")
    assert not done
    assert "'release_brake' in an emergency stop; reset it first" in words
    assert rig.border.switch("winch", "reset")[0]
    rig.inputs.advance(2)
    assert rig.border.switch("winch", "release_brake")[0]


def test_an_emergency_stop_in_a_pause_is_latched() -> None:
    """By topic or service it holds from the first step after the pause, and is reported."""
    for by_service in (True, False):
        rig = Rig("emergency_stop")
        rig.border.epoch_ns = None
        latched = "winch winch: emergency stop latched, in force once the simulation goes on"
        for _ in range(3):
            if by_service:
                assert rig.border.switch("winch", "emergency_stop") == (True, latched)
            else:
                order = encode_order(0, WinchCommand("emergency_stop"))
                rig.border.take_order(*order, "/panel")
        assert (rig.row(MESSAGES_ROW).level, rig.row(MESSAGES_ROW).message) == (Level.WARN, latched)
        assert not rig.border.switch("winch", "reset")[0]
        rig.border.epoch_ns = EPOCH_NS
        assert [name for name, _ in rig.calls()] == ["submit_command"]
        assert rig.inputs.snapshot().winches[0].mode == "emergency_stop"
        assert rig.row(MESSAGES_ROW).level == Level.OK


def test_a_stop_finds_room_beside_the_currents_of_a_long_pause() -> None:
    """A profiler sends on for hours: the newest profile applies, and the stop is executed."""
    rig = Rig("emergency_stop")
    rig.border.epoch_ns = None
    many = encode_current(np.zeros((WAITING_LIMIT // 6, 3)).tolist())
    for _ in range(3):
        rig.border.take_current(many)
    assert rig.border.switch("winch", "emergency_stop")[0]
    rig.border.take_current(encode_current([(0.0, 0.1, 0.0), (-500.0, 0.0, 0.0)]))
    rig.border.epoch_ns = EPOCH_NS
    assert sorted(name for name, _ in rig.calls()) == ["submit_command", "submit_current"]
    snapshot = rig.inputs.snapshot()
    assert snapshot.winches[0].mode == "emergency_stop"
    assert (snapshot.inputs["current"].accepted, snapshot.inputs["current"].refused) == (1, 0)


def test_a_stop_finds_room_where_nothing_is_taken_out() -> None:
    """The queue is full, as in a long step: other switches are refused by their service."""
    rig = Rig("emergency_stop")
    rig.border.take_current(encode_current(np.zeros((WAITING_LIMIT // 4, 4)).tolist()))
    done, words = rig.border.switch("winch", "set_brake")
    assert (done, "wait for the next slot" in words) == (False, True)
    assert rig.border.switch("winch", "emergency_stop")[0]
    rig.inputs.advance(2)
    assert rig.inputs.snapshot().winches[0].mode == "emergency_stop"


def test_a_stop_that_no_winch_executes_is_not_reported_as_latched(rig: Rig) -> None:
    """Nor is a stop of the schedule, which restarts with the next epoch."""
    rig.border.epoch_ns = None
    assert "add `emergency_stop` to it" in rig.border.switch("winch", "emergency_stop")[1]
    order = WinchCommand("emergency_stop")
    rig.border.take_order(*encode_order(0, order, "no such winch"), "/panel")
    rig.border.take_order(*encode_order(EPOCH_NS, order), "winch_schedule")
    assert rig.row(MESSAGES_ROW).level == Level.OK
    assert rig.row(MESSAGES_ROW).values["ignored while not active"] == "1"
    rig.border.epoch_ns = EPOCH_NS
    assert [name for name, _ in rig.calls()] == ["submit_command"]
    assert "no winch 'no such winch'" in rig.inputs.snapshot().inputs["winch_switch"].refusal


def test_a_seat_is_reserved_only_while_commands_are_taken(rig: Rig) -> None:
    rig.border.take_order(*encode_order(0, WinchCommand(SPEED, 0.1)), "/panel")
    assert rig.border.ask_seat("winch") == rig.border.seats.ask("winch")
    rig.border.epoch_ns = None
    words = "winch winch: seat not reserved, the simulation is not active"
    assert rig.border.ask_seat("winch") == (False, words)


def test_of_two_senders_of_motion_the_first_is_heard(rig: Rig) -> None:
    for k in range(4):
        rig.heave(0.05 * k + 0.05, "mru")
        rig.heave(0.05 * k + 0.06, "stranger")
        rig.now_s += 0.05
    assert [arguments[0] for _, arguments in rig.calls()] == [
        50_000_000, 100_000_000, 150_000_000, 200_000_000,
    ]  # fmt: skip
    row = rig.row(SENDERS_ROW)
    assert row.level == Level.ERROR
    assert "a second sender publishes it too" in row.message
    assert row.values["ship/heave: of others"] == "4"
    (remark,) = rig.remarks()
    assert "a second sender publishes it too" in remark
    assert rig.border.mixed.startswith("ship/heave")
    rig.now_s += 61.0
    assert rig.row(SENDERS_ROW).level == Level.OK, "a minute later it has healed"


def test_a_listener_hears_motion_as_it_comes(rig: Rig) -> None:
    """In twin time, samples that the twin will refuse too, but none of a second sender."""
    heard: list[tuple[int, float]] = []
    rig.border.motion_listener = lambda stamp_ns, height_m: heard.append((stamp_ns, height_m))
    for sender in ("mru", "stranger"):
        rig.heave(0.05, sender)
    data = encode_pose(EPOCH_NS, ShipPose(0, (1.0, 2.0, 0.3), (0.0, 0.0, 0.0)))
    rig.border.take_motion("ship/odometry", data)
    assert heard == [(50_000_000, 0.1), (0, 0.3)]


def test_a_sender_that_takes_over_is_followed() -> None:
    """It is not heard while the first one still is, and the two do not count as mixed."""
    sender = SelectedSender()
    assert sender.admit("one", 0.0)
    assert not sender.admit("other", 0.4)
    assert sender.admit("other", 0.6)
    assert sender.admit("other", 0.7)
    assert not sender.mixed


def measured(rig: Rig, sender: str, stamp_s: float, **values: float) -> None:
    reading = Measurement.of_winch(0, **values)
    topic, data = encode_measurement(EPOCH_NS + round(stamp_s * 1e9), reading)
    rig.border.take_measurement(topic, data, sender)


def test_of_two_senders_of_a_measured_quantity_the_first_is_heard(rig: Rig) -> None:
    """A mean of two load cells is no residual of either."""
    for k in range(4):
        measured(rig, "monitor", 0.02 * k, line_out_m=200.0, tension_n=167e3)
        measured(rig, "spare", 0.02 * k + 0.01, line_out_m=200.1, tension_n=170e3)
        rig.now_s += 0.02
    taken = [arguments[0].rows[0] for _, arguments in rig.calls()]
    assert taken == [("winch", 200.0, None, 167e3)] * 4
    row = rig.row(SENDERS_ROW)
    assert row.level == Level.WARN
    assert "a second sender publishes line out and tension of 'winch' too" in row.message
    assert row.values["winch/measured: of others"] == "4"
    assert rig.border.mixed.startswith("winch/measured")


def test_two_senders_may_share_a_topic_with_a_quantity_each(rig: Rig) -> None:
    for k in range(4):
        measured(rig, "counter", 0.02 * k, line_out_m=200.0)
        measured(rig, "cell", 0.02 * k + 0.01, tension_n=167e3)
        rig.now_s += 0.02
    assert len(rig.calls()) == 8
    assert rig.row(SENDERS_ROW).level == Level.OK


def test_a_slow_sensor_keeps_its_topic_between_its_readings() -> None:
    """Each of two sensors at 0.5 Hz is silent for a second before the other sends."""
    sender = SelectedSender(LONGEST_S)
    assert sender.admit("one", 0.0)
    assert sender.admit("one", 2.0)
    for second in (3.0, 5.0, 7.0):
        assert not sender.admit("other", second)
        assert sender.admit("one", second + 1.0)
    assert sender.mixed
    assert sender.admit("other", 15.0), "one has been silent for more than three intervals"


@pytest.mark.parametrize(
    "take",
    [
        lambda border: border.take_motion("ship/heave", b"\x00\x01garbage"),
        lambda border: border.take_motion("ship/odometry", b""),
        lambda border: border.take_order("winch/speed_command", b"\x00", "console"),
        lambda border: border.take_cut(b"\x07" * 40),
        lambda border: border.take_current(encode_current([(0.0, 0.1, 0.0)])[:-4]),
    ],
    ids=["heave", "odometry", "order", "cut", "current"],
)
def test_garbage_is_counted_and_heals(rig: Rig, take: Callable[[InputBorder], None]) -> None:
    take(rig.border)
    assert rig.calls() == []
    kept_out = rig.inputs.snapshot().inputs.get("border")
    assert ([kept_out.warning] if kept_out else []) == rig.remarks()
    assert len(rig.remarks()) == (0 if "cut" in rig.row(MESSAGES_ROW).message else 1)
    row = rig.row(MESSAGES_ROW)
    assert row.level == Level.WARN
    assert "1 malformed" in row.message
    rig.now_s += 61.0
    row = rig.row(MESSAGES_ROW)
    assert row.level == Level.OK
    assert "1 malformed since the start" in row.message


def test_without_an_epoch_nothing_is_taken(rig: Rig) -> None:
    rig.border.epoch_ns = None
    rig.heave(0.05)
    assert rig.calls() == []
    assert rig.row(MESSAGES_ROW).values["ignored while not active"] == "1"


def test_what_was_sent_before_a_restart_is_not_taken_for_the_present(rig: Rig) -> None:
    """Samples and readings of the time that is not simulated may wait in the subscriber's queue."""
    for _ in range(50):
        rig.inputs.advance(10)
    rig.border.epoch_ns = None
    rig.border.epoch_ns = EPOCH_NS
    for stamp_s, taken in ((4.95, 0), (5.1, 2)):
        rig.heave(stamp_s)
        reading = Measurement.of_winch(0, 200.0, tension_n=1e5)
        stamp_ns = EPOCH_NS + round(stamp_s * 1e9)
        rig.border.take_measurement(*encode_measurement(stamp_ns, reading), "load pin")
        assert len(rig.calls()) == taken
    stamp_ns = EPOCH_NS + 4_950_000_000
    rig.border.take_order(*encode_order(stamp_ns, WinchCommand(SPEED, 0.2)), "winch_schedule")
    assert len(rig.calls()) == 2
    rig.border.take_order(*encode_order(stamp_ns, WinchCommand(SPEED, 0.0)), "/panel")
    assert len(rig.calls()) == 3, "what a person commanded meanwhile is executed"
    assert rig.row(MESSAGES_ROW).values["ignored while not active"] == "3"
    assert rig.inputs.snapshot().inputs["heave"].refused == 0


def test_who_has_not_the_seat_is_refused(rig: Rig) -> None:
    topic, data = encode_order(0, WinchCommand(SPEED, 0.2))
    rig.border.take_order(topic, data, "console")
    rig.border.take_order(topic, data, "stranger")
    assert [arguments[0] for method, arguments in rig.calls() if method == "submit_command"] == [
        None
    ]
    assert rig.row("simulation: seat winch").level == Level.WARN


def test_what_became_of_forecasts_reaches_the_quality_index(rig: Rig) -> None:
    """One score for each message; a malformed one is counted, and is no fault of an input."""
    row = {"span_s": 10.0, "coverage": 0.88, "judged": 40.0, "factor": 1.25, "age_s": 0.5}
    data = encode_forecast(FORECAST_RISK, EPOCH_NS, "map", [row, row | {"span_s": 60.0}])
    rig.border.take_forecast(data)
    assert [name for name, _ in rig.calls()] == ["submit_forecast_score"]
    (one,) = (q for q in rig.inputs.snapshot().quality if q.element == "forecast")
    assert one.components[4] == 1.0
    rig.border.take_forecast(data[:40])
    rig.border.take_forecast(encode_forecast(FORECAST_RISK, EPOCH_NS, "map", []))
    assert rig.row(MESSAGES_ROW).values[FORECAST_RISK] == "2"
    assert not rig.remarks()


def test_a_lower_end_that_the_scene_does_not_let_move_is_reported(rig: Rig) -> None:
    rig.border.take_lower_end(encode_lower_end(EPOCH_NS, (0.0, 0.0, -200.0), (0.0, 0.0, 0.0)))
    assert rig.calls() == []
    row = rig.row(MESSAGES_ROW)
    assert (row.level, row.values["lower_end/odometry"]) == (Level.WARN, "1")
    assert "give its rope `end_motion: {from_outside: true}`" in row.message


COMMANDS_NS = 100_000_000  # a stream at 10 Hz


@pytest.mark.parametrize("fault", ["nan", "fast", "other clock"])
def test_a_controller_that_sends_only_what_is_rejected_is_lost(rig: Rig, fault: str) -> None:
    """It pays out at 0.4 m/s, then its output is NaN, too fast or stamped an hour ahead."""
    border, twin = rig.border, rig.border._twin
    value = {"nan": math.nan, "fast": 1e9, "other clock": 0.4}[fault]
    ahead_ns = 3_600 * 10**9 if fault == "other clock" else 0
    for k in range(60):
        is_sound = k < 20
        at_ns = EPOCH_NS + k * COMMANDS_NS + (0 if is_sound else ahead_ns) + 1
        order = WinchCommand(SPEED, 0.4 if is_sound else value)
        border.take_order(*encode_order(at_ns, order), "controller")
        rig.inputs.advance(10)
        if k % 5 == 4:
            border.seats.check({"controller"}, twin.time_ns)
        if k == 20:
            assert twin.snapshot().payout_speed_m_per_s == pytest.approx(0.4)
    assert twin.snapshot().payout_speed_m_per_s == 0.0
    seat = rig.row("simulation: seat winch")
    assert seat.level == Level.ERROR
    assert "controller stopped sending valid commands" in seat.message
    assert "ramp to zero" in seat.message


def test_a_command_that_no_winch_executes_takes_no_seat(rig: Rig) -> None:
    """The schedule keeps a seat that an operator has only sent nonsense for."""
    border = rig.border
    border.take_order(*encode_order(0, WinchCommand(SPEED, 0.2)), "winch_schedule")
    border.take_order(*encode_order(0, WinchCommand(SPEED, math.nan)), "console")
    border.take_order(*encode_order(EPOCH_NS + 10**14, WinchCommand(SPEED, 0.1)), "console")
    border.take_order(*encode_order(0, WinchCommand("set_brake")), "console")
    rig.inputs.advance(2)
    assert border.seats.words() == "winch: winch_schedule"
    assert rig.border._twin.inputs.winch.counter.refused == 2, "counted all the same"
    border.take_order(*encode_order(0, WinchCommand(SPEED, 0.1)), "console")
    assert border.seats.words() == "winch: console"


def test_a_command_that_was_held_up_is_not_executed() -> None:
    """Not as long after its sender has seen no effect; a stop is, by its button or by speed 0."""
    rig = Rig("emergency_stop")
    border, late_s = rig.border, LATE_S + 0.1
    for order in (WinchCommand(SPEED, 0.3), WinchCommand("set_brake")):
        border.take_order(*encode_order(0, order), "/panel", late_s)
        assert rig.calls() == []
        assert border.seats.words() == "winch: free"
        row = rig.row(MESSAGES_ROW)
        assert row.level == Level.WARN
        assert f"'{order.kind}' was sent 2.1 s ago and is not executed any more; " in row.message
    border.take_cut(encode_cut(0, 10.0)[1], late_s)
    assert not rig.calls()
    assert "ropes/cut: 'cut' was sent 2.1 s ago" in rig.row(MESSAGES_ROW).message
    border.take_order(*encode_order(0, WinchCommand(SPEED, 0.3)), "/panel", LATE_S - 0.1)
    border.take_order(*encode_order(EPOCH_NS, WinchCommand(SPEED, 0.2)), "/panel", late_s)
    border.take_order(*encode_order(0, WinchCommand(SPEED, 0.0)), "/panel", late_s)
    border.take_order(*encode_order(0, WinchCommand("emergency_stop")), "/panel", late_s)
    kinds = [arguments[1] for name, arguments in rig.calls() if name == "submit_command"]
    assert kinds == [WinchCommand(SPEED, 0.3), WinchCommand(SPEED, 0.2), WinchCommand(SPEED, 0.0),
                     WinchCommand("emergency_stop")]  # fmt: skip


def test_a_clock_that_lags_is_no_command_that_waited() -> None:
    lags = SenderLags()

    def ages(sender: str, *came: tuple[float, float]) -> list[float]:
        return [round(lags.since_sent_s(sender, age_s, at_s), 3) for at_s, age_s in came]

    assert ages("lagging", (0.0, 3.0), (0.5, 3.1), (1.0, 3.0), (1.5, 3.1)) == [3.0, 3.1, 0.0, 0.1]
    assert ages("lagging", (30.0, 17.0), (30.0, 10.0)) == [13.997, 6.997], "it waited, too"
    assert ages("lagging", (3630.0, 3.3)) == [0.0], "clocks drift"
    assert ages("sound", (0.0, 0.01), (5.0, 0.01), (60.0, 20.0)) == [0.01, 0.0, 19.985]
    queue = [(100.0 + 0.001 * k, 14.0 - 0.02 * k) for k in range(500)]
    assert min(ages("new", *queue)) == 4.02, "all of a queue are as old as they are"
    assert ages("new", (101.0, 0.0), (102.1, 0.0), (140.0, 8.0)) == [0.0, 0.0, 7.996]
