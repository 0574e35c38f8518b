"""The commander's seat of a winch: who gets it, who is refused, and when a commander is lost."""

from __future__ import annotations

import pytest

from rope_twin.messages import Level
from rope_twin.run.seat import (
    AWAITED_NS,
    GONE_S,
    PRIORITY,
    QUIET_S,
    RESERVED_S,
    SILENT_NS,
    STREAM_COMMANDS,
    Command,
    CommandSeat,
    Seats,
)
from rope_twin.scene.load import load_scene
from rope_twin.topics import service_name
from rope_twin.twin.winch.commands import COMMANDER_LOST, NEW_COMMANDER, WinchCommand

S = 1_000_000_000
SPEED = WinchCommand("speed", 0.5)


def seat(when_lost: str = "ramp_to_zero") -> CommandSeat:
    return CommandSeat("winch", PRIORITY, when_lost)


def test_the_first_that_commands_takes_it_and_an_equal_one_is_reported_who_has_it() -> None:
    own = seat()
    assert own.judge("bench", SPEED, 0.0).refusal == ""
    verdict = own.judge("other", SPEED, 1.0)
    assert "'speed' from node other rejected: bench has the seat" in verdict.refusal
    assert "winch/take_seat" in verdict.refusal
    row = own.row(1.0)
    assert (row.level, row.values["refused"]) == (Level.WARN, "1")
    assert "bench in command; 1 rejected since the start" in row.message
    assert own.row(100.0).level == Level.OK, "a refusal is warned of for a minute"
    assert own.words() == "winch: bench"


def test_priority_is_local_panel_console_anybody_schedule() -> None:
    """Each takes it from those below at once, and from none above."""
    own, names = seat(), ("winch_schedule", "bench", "console", "local_panel")
    for number, name in enumerate(names):
        verdict = own.judge(name, SPEED, 0.0)
        assert (verdict.refusal, verdict.is_new) == ("", number > 0)
        assert own.holder == name
        assert all(own.judge(below, SPEED, 0.0).refusal for below in names[:number])
    assert own.rank("/port/console") == own.rank("console"), "in any namespace"
    assert CommandSeat("winch", "console", "brake").rank("bench") > 0


def test_a_stop_is_everybody_s_and_its_reset_the_commander_s() -> None:
    own = seat()
    own.judge("console", SPEED, 0.0)
    assert own.judge("bench", WinchCommand("emergency_stop"), 1.0).refusal == ""
    assert own.holder == "console"
    assert (
        "'reset' from node bench rejected" in own.judge("bench", WinchCommand("reset"), 2.0).refusal
    )
    assert own.judge("console", WinchCommand("reset"), 3.0).refusal == ""


def test_a_seat_that_is_asked_for_goes_to_the_next_of_its_priority() -> None:
    own = seat()
    own.judge("one", SPEED, 0.0)
    assert own.ask(1.0)[0]
    assert own.judge("winch_schedule", SPEED, 1.1).refusal, "which is below"
    assert own.judge("one", SPEED, 1.2).refusal == ""
    assert own.judge("two", SPEED, 2.0).is_new
    assert own.judge("one", SPEED, 2.1).refusal
    own.ask(3.0)
    assert own.judge("one", SPEED, 3.1 + RESERVED_S).refusal, "too late"


def test_a_seat_is_released_when_its_commander_is_quiet() -> None:
    """Then the winch does as without one, unless it stands."""
    own = seat()
    assert own.release(0.0)[0] is False
    own.judge("one", SPEED, 0.0)
    own.note(SPEED, None, 0, 0.0)
    done, words, kinds = own.release(0.5)
    assert (done, kinds) == (False, ())
    assert "commanded winch 0.5 s ago" in words
    assert own.release(2.0)[2] == (COMMANDER_LOST,)
    assert own.judge("two", SPEED, 2.1).is_new
    own.note(WinchCommand("speed", 0.0), None, S, 2.1)
    assert own.release(5.0)[2] == (NEW_COMMANDER,)


def test_a_commander_that_leaves_the_network_is_lost() -> None:
    """After a moment out of sight; one that comes back in time is not."""
    own = seat("brake")
    own.judge("console", SPEED, 0.0)
    own.note(SPEED, None, 0, 0.0)
    assert own.check(set(), S, 1.0) == ()
    assert own.check({"console"}, S, 1.2) == ()
    assert own.check(set(), S, 2.0) == ()
    assert own.check(set(), 3 * S, 2.0 + GONE_S) == (COMMANDER_LOST,)
    assert own.words() == "winch: free (console left the network at 3.0 s: brake)"
    assert own.row(4.0).level == Level.ERROR
    assert own.judge("bench", SPEED, 5.0).is_new
    assert own.row(6.0).level == Level.OK


def streamed(own: CommandSeat, name: str, order: WinchCommand = SPEED) -> int:
    """Send commands at 10 Hz; return the twin time of the last."""
    own.judge(name, order, 0.0)
    for k in range(STREAM_COMMANDS + 1):
        own.note(order, None, k * S // 10, 0.1 * k)
    return STREAM_COMMANDS * S // 10


def test_a_commander_whose_stream_ends_is_lost() -> None:
    """Seen twice: what waits in the middleware is taken before the second look."""
    own = seat()
    last_ns = streamed(own, "console")
    assert own.check({"console"}, last_ns + SILENT_NS, 3.0) == ()
    assert own.check({"console"}, last_ns + SILENT_NS + 1, 3.5) == ()
    for k in range(STREAM_COMMANDS):  # which waited
        own.note(SPEED, last_ns + k * S // 10, last_ns + SILENT_NS + 2, 3.6)
    later_ns = last_ns + 2 * SILENT_NS + 3
    assert own.check({"console"}, later_ns - 2, 4.0) == ()
    assert own.check({"console"}, later_ns, 5.0) == ()
    assert own.check({"console"}, later_ns, 5.5) == (COMMANDER_LOST,)
    assert "console stopped sending" in own.words()


@pytest.mark.parametrize(
    "order", [WinchCommand("speed", 0.0), None], ids=["stands", "a single order"]
)
def test_a_quiet_commander_without_need_to_speak_is_not_lost(order: WinchCommand | None) -> None:
    own = seat()
    if order is None:
        own.judge("console", WinchCommand("length", 100.0), 0.0)
        own.note(WinchCommand("length", 100.0), None, 0, 0.0)
    else:
        streamed(own, "console", order)
    for k in range(100):
        assert own.check({"console"}, k * S, float(k)) == ()
    assert own.holder == "console"


def test_a_schedule_that_yields_is_not_lost() -> None:
    """Its last command stands until the newcomer commands; without a newcomer it is lost."""
    own = seat()
    last_ns = streamed(own, "winch_schedule")
    for k in range(10):
        at_ns = last_ns + SILENT_NS + k * S
        assert own.check({"winch_schedule", "bench"}, at_ns, float(k)) == ()
    row = own.row(20.0)
    assert row.level == Level.WARN
    assert "until bench commands" in row.message
    assert own.check({"winch_schedule"}, last_ns + 20 * S, 20.0) == (COMMANDER_LOST,)


def test_a_commander_does_not_yield_to_a_publisher_that_may_be_its_own() -> None:
    """A schedule that was killed and starts again has no name in the graph at first."""
    own = seat()
    present, late_ns = {"winch_schedule", "publisher 010f78fd"}, streamed(own, "winch_schedule")
    assert own.check(present, late_ns + 2 * SILENT_NS, 5.0) == ()
    assert own.check(present, late_ns + 2 * SILENT_NS, 5.5) == (COMMANDER_LOST,)
    assert "winch_schedule stopped sending" in own.words()


def test_after_a_restart_a_winch_that_runs_awaits_its_commander() -> None:
    """Its scene says what it does if none comes; one that comes takes the seat."""
    lost, found = seat("brake"), seat("brake")
    for own in (lost, found):
        own.await_former(60 * S)
        assert own.watched
        assert own.check({"console"}, 60 * S + AWAITED_NS - 1, 5.0) == ()
    found.judge("console", SPEED, 5.0)
    assert found.check({"console"}, 60 * S + AWAITED_NS, 6.0) == ()
    assert lost.check({"console"}, 60 * S + AWAITED_NS, 6.0) == (COMMANDER_LOST,)
    words = "the commander of before the restart has not come back at 65.0 s: brake"
    assert lost.words() == f"winch: free ({words})"
    assert lost.row(7.0).level == Level.ERROR
    assert not lost.watched


def test_after_a_pause_silence_counts_from_then_on() -> None:
    own = seat()
    last_ns = streamed(own, "console")
    own.resume(last_ns + 10 * S)
    for _ in range(2):
        assert own.check({"console"}, last_ns + 11 * S, 3.0) == ()


def test_each_winch_of_a_scene_has_a_seat() -> None:
    ordered: list[tuple[str, str]] = []
    scene = load_scene("two_line_lift")
    seats = Seats(scene, PRIORITY, lambda order, winch: ordered.append((order.kind, winch)))
    first, second = seats.winches
    assert seats.admit(first, Command(SPEED, None, "one"), 0)
    assert seats.admit(second, Command(SPEED, None, "two"), 0)
    assert seats.admit(first, Command(SPEED, None, "two"), 0) is None
    assert ordered == []
    assert seats.admit(second, Command(SPEED, None, "console"), 0)
    assert ordered == [(NEW_COMMANDER, second)]
    assert seats.words() == f"{first}: one; {second}: console"
    assert service_name(first, "take_seat") == "winch/take_seat"
    assert service_name(second, "take_seat") == f"winch/{second}/take_seat"


def test_a_stop_that_is_not_planned_is_executed_at_once_whatever_its_stamp() -> None:
    """By a clock that is ahead it would come later; the schedule plans its stops."""
    seats = Seats(load_scene("emergency_stop"), PRIORITY, lambda order, winch: None)
    stop = WinchCommand("emergency_stop")
    for name, stamp_ns in (("bench", None), ("console", None), ("winch_schedule", 9 * S)):
        admitted = seats.admit("winch", Command(stop, 9 * S, name), S)
        assert admitted is not None
        assert admitted.stamp_ns == stamp_ns


def test_a_sender_whose_name_becomes_known_keeps_its_seat_and_gets_its_priority() -> None:
    seats = Seats(load_scene("deep_lift"), PRIORITY, lambda order, winch: None)
    assert seats.admit("winch", Command(SPEED, None, "publisher 01"), 0)
    seats.name_holders(lambda holder: "")
    assert seats.words() == "winch: publisher 01"
    seats.name_holders(lambda holder: {"publisher 01": "winch_schedule"}[holder])
    assert seats.words() == "winch: winch_schedule"
    compensate = WinchCommand("compensate")  # which comes by another publisher
    assert seats.admit("winch", Command(compensate, None, "winch_schedule"), 0)
    assert seats.admit("winch", Command(SPEED, None, "bench"), 0)


@pytest.mark.parametrize(
    ("name", "ahead_s", "level"),
    [
        ("console", 9, Level.WARN),
        ("console", 0.5, Level.OK),
        ("winch_schedule", 9, Level.OK),  # it sends its commands before their time
    ],
)
def test_a_commander_whose_clock_is_ahead_is_warned_of(
    name: str, ahead_s: float, level: Level
) -> None:
    own = seat()
    own.judge(name, SPEED, 0.0)
    own.note(SPEED, round((2 + ahead_s) * S), 2 * S, 0.0)
    row = own.row(0.0)
    assert row.level == level
    assert ("stamped 9.0 s ahead" in row.message) == (level == Level.WARN)


def test_a_hole_in_a_stream_of_commands_is_warned_of_for_a_minute() -> None:
    """A lost link while the winch moves; a pause of a winch that stands still is none."""
    for order, level in ((SPEED, Level.WARN), (WinchCommand("speed", 0.0), Level.OK)):
        own = seat()
        own.judge("console", order, 0.0)
        for k in range(STREAM_COMMANDS + 1):
            own.note(order, None, k * S // 10, 0.1 * k)
        own.note(order, None, STREAM_COMMANDS * S // 10 + S, 2.0)
        row = own.row(2.0)
        assert row.level == level
        assert ("interrupted for 1.0 s" in row.message) == (level == Level.WARN)
        assert own.row(100.0).level == Level.OK


def test_a_switch_by_service_is_for_a_free_seat_and_a_stop_for_everybody() -> None:
    own = seat()
    assert own.permit("reset", 0.0) == ""
    own.judge("console", SPEED, 0.0)
    assert own.permit("emergency_stop", 1.0) == ""
    refusal = own.permit("reset", 1.0)
    assert "'reset' by service rejected: console has the seat" in refusal
    assert "stop it there and release the seat by winch/release_seat" in refusal, "it sends on"
    assert own.row(1.0).values["refused"] == "1"
    assert own.holder == "console"


def test_a_switch_by_service_needs_its_component() -> None:
    seats = Seats(load_scene("deep_lift"), PRIORITY, lambda order, winch: None)
    assert "no brake; add `brake` to it" in seats.permit("winch", "set_brake")


def test_a_second_node_of_the_commander_s_name_is_another_commander() -> None:
    """Two consoles: their set-points would alternate. A node that has started again goes on."""
    own = seat()
    assert not own.judge("console", SPEED, 0.0, process=b"1").refusal
    own.note(SPEED, None, 0, 0.0)
    refusal = own.judge("console", SPEED, 0.5, process=b"2").refusal
    assert "'speed' from a second node console rejected: console has the seat" in refusal
    assert not own.judge("console", WinchCommand("emergency_stop"), 0.5, process=b"2").refusal
    assert not own.judge("console", SPEED, 0.6, process=b"1").refusal
    own.note(SPEED, None, 0, 0.6)
    own.ask(0.7)
    assert own.judge("console", SPEED, 0.8, process=b"2").is_new
    own.note(SPEED, None, 0, 0.8)
    assert own.judge("console", SPEED, 0.9, process=b"1").refusal
    assert not own.judge("console", SPEED, 0.8 + QUIET_S, process=b"3").refusal
