"""Pages: bounded queues, whole frames after a loss, seat and commands, casts."""

from __future__ import annotations

import csv
import io
from dataclasses import replace

import pytest
from console_rig import TENSION_ALARM, TOKEN, ConsoleRig, frames, replies

from rope_twin.console.control import (
    ALIVE_S,
    ENTRIES,
    ENTRIES_WITHIN_S,
    FEEDBACK_S,
    LOST_S,
    TRIES,
    TRIES_WITHIN_S,
)
from rope_twin.console.pages import QUEUE, Pages
from rope_twin.messages import Level, Status
from rope_twin.twin.winch.commands import WinchCommand


def test_a_page_first_receives_everything_and_then_what_changes() -> None:
    rig = ConsoleRig()
    rig.tick(10)
    page = rig.page()
    hello, whole, *_ = frames(page)
    assert hello["type"] == "hello"
    assert len(hello["trend"][0]["time_s"]) == 10
    assert hello["facts"]["ropes"][0]["allowed_n"] == 5.0e5
    assert whole["whole"]
    assert whole["values"]["line_out_m"] == [3000.0]
    rig.tick()
    row = next(one for one in frames(page) if one["type"] == "row")
    assert row["trend"][0]["time_s"] == pytest.approx(rig.source.snapshot.time_s)


def test_a_page_that_reconnects_has_the_last_minute() -> None:
    rig = ConsoleRig(topics=("ropes/tension_top",))
    rig.tick(1500)
    times = frames(rig.page())[0]["trend"][0]["time_s"]
    assert times[-1] - times[0] == pytest.approx(60.0, abs=0.1)


def test_a_slow_page_loses_frames_and_then_receives_a_whole_one() -> None:
    rig = ConsoleRig()
    slow, quick = rig.page(), rig.page()
    frames(slow)
    seen = 0
    for _ in range(3 * QUEUE):
        rig.tick()
        assert slow.queue.qsize() <= QUEUE
        seen += len(frames(quick))
    assert quick.lost == 0
    assert seen > 3 * QUEUE
    assert slow.lost > 0
    assert not slow.behind
    found = frames(slow)
    wholes = [one for one in found if one.get("whole")]
    assert wholes
    assert "tension_n" in wholes[0]["values"]


def test_loss_of_the_twin_shows_in_the_ages() -> None:
    rig = ConsoleRig()
    rig.tick(5)
    page = rig.page()
    rig.source.lost = True
    rig.tick(20)
    last = [one for one in frames(page) if one["type"] == "row"][-1]
    assert last["ages"]["ropes/tension_top"] == pytest.approx(1.0, abs=0.06)
    assert last["trend"] is None
    assert last["values"] == {}


def test_a_console_without_control_refuses_commands() -> None:
    rig = ConsoleRig(control=False)
    page = rig.page()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    rig.desk.take(page, {"do": "command", "kind": "emergency_stop", "winch": "winch", "id": 2})
    assert [(one["ok"], "read-only" in one["words"]) for one in replies(page)] == [
        (False, True)
    ] * 2
    assert not rig.commander.sent


def test_wrong_tokens_are_limited() -> None:
    rig = ConsoleRig()
    page = rig.page()
    for number in range(TRIES + 1):
        rig.desk.take(page, {"do": "sign_in", "token": "guess", "id": number})
    words = [one["words"] for one in replies(page)]
    assert all("not the right one" in one for one in words[:TRIES])
    assert "too many" in words[TRIES]
    rig.desk.take(page, {"do": "sign_in", "token": TOKEN, "id": 9})
    assert not replies(page)[0]["ok"]  # the right one neither, for a minute
    assert not page.authorised
    rig.clock.now_s += TRIES_WITHIN_S + 1.0
    rig.desk.take(page, {"do": "sign_in", "token": TOKEN, "id": 10})
    assert replies(page)[0]["ok"]
    assert page.authorised


@pytest.mark.parametrize("given", [None, 7, "", [], {"a": 1}])
def test_a_token_of_another_type_is_wrong(given: object) -> None:
    rig = ConsoleRig()
    page = rig.page()
    rig.desk.take(page, {"do": "sign_in", "token": given, "id": 1})
    assert not page.authorised


def test_one_page_at_a_time_has_the_seat() -> None:
    rig = ConsoleRig()
    first, second = rig.page(True), rig.page(True)
    rig.tick()
    rig.desk.take(first, {"do": "take_seat", "id": 1})
    rig.desk.take(second, {"do": "take_seat", "id": 2})
    rig.desk.take(
        second, {"do": "command", "kind": "speed", "value": 1.0, "winch": "winch", "id": 3}
    )
    assert [one["ok"] for one in replies(second)][-2:] == [False, False]
    assert any(one["type"] == "seat_wanted" for one in frames(first))
    assert not rig.commander.sent
    rig.desk.take(first, {"do": "release_seat", "id": 4})
    rig.desk.take(second, {"do": "take_seat", "id": 5})
    assert replies(second)[-1]["ok"]
    assert rig.desk.state()["holder"] == second.number


def test_a_command_is_answered_with_what_the_twin_did() -> None:
    rig = ConsoleRig()
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    rig.desk.take(page, {"do": "command", "kind": "speed", "value": 0.5, "winch": "winch", "id": 2})
    rig.tick(2)
    sent, done = [one for one in replies(page) if one["id"] == 2]
    assert (sent["stage"], done["stage"], done["ok"]) == ("sent", "done", True)
    assert "winch: speed 0.5 m/s" in done["words"]


def test_a_set_point_is_repeated_until_an_emergency_stop_which_makes_it_zero() -> None:
    rig = ConsoleRig()
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    rig.desk.take(page, {"do": "command", "kind": "speed", "value": 0.5, "winch": "winch", "id": 2})
    rig.tick(40)
    speeds = [command.value for _, command in rig.commander.sent]
    assert set(speeds) == {0.5}
    assert len(speeds) == pytest.approx(21, abs=2)  # 10 Hz
    rig.commander.sent.clear()
    rig.commander.obeys = False
    rig.source.mode = "winch: emergency stop"  # of somebody else
    rig.tick(20)
    assert {command for _, command in rig.commander.sent[2:]} == {WinchCommand("speed", 0.0)}
    rig.source.mode = "winch: speed 0 m/s"  # reset: the winch does not start again by itself
    rig.tick(20)
    assert rig.commander.sent[-1][1] == WinchCommand("speed", 0.0)
    rig.desk.take(page, {"do": "release_seat", "id": 3})
    rig.commander.sent.clear()
    rig.tick(20)
    assert rig.commander.sent == []


@pytest.mark.parametrize("runs_at", [None, 0.2])
def test_a_lost_twin_is_commanded_to_stop_only(runs_at: float | None) -> None:
    """When it comes back it does as before: no page has seen any effect since."""
    rig = ConsoleRig()
    rig.source.alerts, rig.source.seat = [TENSION_ALARM], "winch: console"
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    speed = {"do": "command", "kind": "speed", "winch": "winch"}
    if runs_at is not None:
        rig.desk.take(page, {**speed, "value": runs_at, "id": 2})
        rig.tick(4)
    rig.commander.obeys, rig.source.lost = False, True
    rig.tick()
    rig.desk.take(page, {**speed, "value": 0.5, "id": 3})  # before the loss is known
    rig.tick(round(FEEDBACK_S / 0.05) + 2)
    words = replies(page)[-1]["words"]
    assert "no effect seen within 2.5 s; the twin has sent nothing for 2.6 s" in words
    rig.commander.sent.clear()
    for number, request in enumerate((
        {**speed, "value": 0.3}, {**speed, "kind": "set_brake"},
        {"do": "alert", "action": "acknowledge", "alert": "all"},
        {"do": "limit", "name": "tension_n", "value": 4e5},
    )):  # fmt: skip
        rig.desk.take(page, {**request, "id": 10 + number})
        answer = replies(page)[-1]
        assert not answer["ok"]
        assert "the twin has sent nothing for 2.6 s; wait until it is back" in answer["words"]
    assert rig.commander.alert_words == []
    rig.tick(10)
    assert {one.value for _, one in rig.commander.sent} == ({runs_at} if runs_at else set())
    rig.desk.take(page, {**speed, "value": 0.0, "id": 20})
    rig.desk.take(page, {**speed, "kind": "emergency_stop", "id": 21})
    rig.tick(60)
    assert rig.commander.sent[-1][1] == WinchCommand("speed", 0.0), "a stop is repeated"
    assert "emergency_stop" in {one.kind for _, one in rig.commander.sent}


def test_a_command_without_effect_is_reported() -> None:
    rig = ConsoleRig()
    rig.commander.obeys = False
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    rig.desk.take(page, {"do": "command", "kind": "speed", "value": 0.5, "winch": "winch", "id": 2})
    rig.tick(round(FEEDBACK_S / 0.05) + 2)
    done = [one for one in replies(page) if one["id"] == 2][-1]
    assert not done["ok"]
    assert "winch_schedule" in done["words"]


def test_a_switch_without_effect_is_answered_with_its_own_refusal() -> None:
    """Not with that of a motion, and as one sentence."""
    rig = ConsoleRig()
    page = rig.page(signed_in=True)
    rig.desk.take(page, {"id": 1, "do": "take_seat"})
    rig.source.seat = "winch: console"
    why = "last: winch command: 'release_brake' in an emergency stop; reset it first."
    rig.source.rows = [
        Status("simulation: input winch command", Level.WARN, "last: 'speed' is refused."),
        Status("simulation: input winch switch", Level.WARN, why),
    ]
    rig.tick()
    replies(page)
    rig.desk.take(page, {"id": 2, "do": "command", "winch": "winch", "kind": "release_brake"})
    rig.tick(60)
    words = replies(page)[-1]["words"]
    assert words == f"release brake: no effect seen within 2.5 s; {why}"


def test_a_set_point_that_the_seat_refuses_is_not_repeated() -> None:
    """The seat of a second console has the same name; its words say which one commands."""
    rig = ConsoleRig()
    rig.commander.obeys, rig.source.seat = False, "winch: console"
    why = "winch winch: 'speed' from a second node console rejected: console has the seat; ask."
    seat = Status("simulation: seat winch", Level.WARN, "", {"refused": "0", "last rejection": ""})
    rig.source.rows = [seat]
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    rig.desk.take(page, {"do": "command", "kind": "speed", "value": 0.5, "winch": "winch", "id": 2})
    values = {"refused": "20", "last rejection": why}
    rig.source.rows = [replace(seat, values=values)]
    rig.tick(round(FEEDBACK_S / 0.05) + 2)
    words = replies(page)[-1]["words"]
    assert words == f"speed +0.5 m/s: no effect seen within 2.5 s; {why}"
    rig.commander.sent.clear()
    rig.tick(10)
    assert not rig.commander.sent


def test_a_set_point_ends_when_a_second_console_takes_over() -> None:
    """Repeated further, it would start the winch once that one is gone. A refused STOP is repeated:
    what was in force before it is not.
    """
    rig = ConsoleRig()
    seat = Status("simulation: seat winch", Level.OK, "", {"refused": "3"})
    rig.source.rows = [seat]
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    speed = {"do": "command", "kind": "speed", "winch": "winch"}
    rig.desk.take(page, {**speed, "value": 0.5, "id": 2})
    rig.tick(10)
    rig.commander.obeys, rig.source.mode = False, "winch: speed 0.1 m/s"
    rig.source.rows = [replace(seat, values={"refused": "4"})]
    rig.desk.take(page, {**speed, "value": 0.0, "id": 3})
    rig.source.rows = [replace(seat, values={"refused": "9"})]
    frames(page)
    rig.tick(round(FEEDBACK_S / 0.05))
    assert rig.commander.sent[-1][1] == WinchCommand("speed", 0.0)
    rig.tick(3)
    (notice,) = [one for one in frames(page) if one["type"] == "notice"]
    assert "another commander has it" in notice["words"]
    rig.commander.sent.clear()
    rig.tick(60)
    assert not rig.commander.sent


@pytest.mark.parametrize("command", [
    {"kind": "speed", "value": "fast"}, {"kind": "speed", "value": float("nan")},
    {"kind": "speed", "value": 10**400},
    {"kind": "speed", "value": True}, {"kind": "speed"}, {"kind": "new_commander"},
    {"kind": "speed", "value": -10.1}, {"kind": "length", "value": 99.9},
    {"kind": "length", "value": 3200.1}, {"kind": "tension", "value": 1e5},
    {"kind": ["speed"], "value": 1.0}, {"kind": "speed", "value": 1.0, "winch": "other"},
    {"kind": "speed", "value": 1.0, "winch": {}},
])  # fmt: skip
def test_a_faulty_command_is_refused_in_words(command: dict[str, object]) -> None:
    rig = ConsoleRig()
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    rig.desk.take(page, {"do": "command", "winch": "winch", "id": 2, **command})
    answer = replies(page)[-1]
    assert not answer["ok"]
    assert answer["words"].startswith("command: ")
    assert not rig.commander.sent


def test_an_emergency_stop_needs_no_seat() -> None:
    rig = ConsoleRig()
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "command", "kind": "emergency_stop", "winch": "winch", "id": 1})
    rig.tick()
    assert [command.kind for _, command in rig.commander.sent] == ["emergency_stop"]
    assert "emergency stop" in replies(page)[-1]["words"]


def test_a_reset_does_not_end_an_emergency_stop_that_is_not_shown_yet() -> None:
    """One page stops while the one with the seat resets: the stop stays."""
    rig = ConsoleRig()
    page, other = rig.page(True), rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    reset = {"do": "command", "kind": "reset", "winch": "winch", "id": 2}
    rig.desk.take(other, {"do": "command", "kind": "emergency_stop", "winch": "winch", "id": 1})
    rig.desk.take(page, reset)
    assert "no emergency stop is in force" in replies(page)[-1]["words"]
    rig.source.mode = "winch: emergency stop"
    rig.tick()
    rig.desk.take(page, reset)
    assert [command.kind for _, command in rig.commander.sent] == ["emergency_stop", "reset"]


def test_a_page_that_is_lost_gives_up_the_seat() -> None:
    rig = ConsoleRig()
    page, other = rig.page(True), rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    rig.desk.leave(page)
    rig.pages.disconnect(page)
    rig.tick(round(LOST_S / 0.05) - 2)
    assert rig.commander.released == 0
    rig.tick(4)
    assert rig.commander.released == 1
    assert rig.desk.state()["holder"] is None
    rig.desk.take(other, {"do": "take_seat", "id": 2})
    assert replies(other)[-1]["ok"]


def test_alerts_are_shown_and_acknowledged_with_the_token() -> None:
    rig = ConsoleRig()
    rig.source.alerts = [TENSION_ALARM]
    page, other = rig.page(True), rig.page()
    rig.tick()
    (row,) = rig.pages.readings.values["alerts"]
    assert (row["id"], row["priority"], row["state"]) == ("10001.1", "alarm", "unacknowledged")
    assert row["sounds"]
    for asked, action, which in ((other, "acknowledge", "10001.1"), (page, "delete", "10001.1"),
                                 (page, "acknowledge", "10009.7")):  # fmt: skip
        rig.desk.take(asked, {"do": "alert", "action": action, "alert": which, "id": 1})
        assert not replies(asked)[-1]["ok"]
    assert rig.commander.alert_words == []
    rig.desk.take(page, {"do": "alert", "action": "acknowledge", "alert": "10001.1", "id": 2})
    assert rig.commander.alert_words == ["acknowledge 10001.1"]


def test_casts_hold_their_extremes_and_markers_their_time() -> None:
    rig = ConsoleRig()
    page = rig.page(True)
    rig.tick(5)
    frames(page)
    rig.desk.take(page, {"do": "mark", "text": " lift off \n", "id": 1})
    rig.desk.take(page, {"do": "mark", "text": "", "id": 2})
    rig.desk.take(page, {"do": "mark", "text": "=1+1", "id": 3})
    rig.desk.take(page, {"do": "new_cast", "id": 4})
    assert [one["ok"] for one in replies(page)] == [True, False, True, True]
    rig.tick(5)
    first, second = rig.log.casts
    assert not first.open
    assert second.open
    assert first.ropes[0].max_n == pytest.approx(rig.source.snapshot.tension_top_n)
    assert first.ropes[0].deepest_m == pytest.approx(-rig.source.snapshot.payload_position_m[2])
    rows = list(csv.DictReader(io.StringIO(rig.log.markers_csv())))
    assert [row["text"] for row in rows] == ["lift off", "'=1+1"]
    assert float(rows[0]["time_s"]) == pytest.approx(2.75)
    assert len(list(csv.DictReader(io.StringIO(rig.log.trend_csv())))) == 10
    assert len(list(csv.DictReader(io.StringIO(rig.log.casts_csv())))) == 2


def test_values_decoded_between_ticks_reach_the_pages() -> None:
    rig = ConsoleRig()
    rig.tick(5)
    page = rig.page()
    frames(page)
    rig.source.mode = "winch: speed 0.5 m/s"
    rig.source.rows = [Status("simulation: pacing", Level.WARN, "late")]
    rig.tick()
    values = next(one for one in frames(page) if one["type"] == "row")["values"]
    assert values["winch_mode"] == "winch: speed 0.5 m/s"
    assert values["diagnostics simulation: pacing"]["message"] == "late"
    assert values["tension_n"]


def test_a_set_point_ends_with_the_seat_of_its_winch() -> None:
    rig = ConsoleRig()
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    rig.desk.take(page, {"do": "command", "kind": "speed", "value": 0.5, "winch": "winch", "id": 2})
    rig.tick(80)
    frames(page)
    assert rig.commander.sent[-1][1] == WinchCommand("speed", 0.5)
    rig.commander.obeys = False
    rig.source.seat = "winch: local_panel"
    rig.tick(3)
    (notice,) = [one for one in frames(page) if one["type"] == "notice"]
    assert "another commander" in notice["words"]
    rig.commander.sent.clear()
    rig.source.seat = "winch: nobody"  # the panel leaves: the winch must not start by itself
    rig.tick(60)
    assert rig.commander.sent == []


def test_a_set_point_that_the_twin_refuses_is_not_repeated() -> None:
    """The one in force is repeated again; without one, none is."""
    for in_force in (True, False):
        rig = ConsoleRig()
        page = rig.page(True)
        rig.source.seat = "winch: console"
        rig.tick()
        command = {"do": "command", "winch": "winch"}
        rig.desk.take(page, {"do": "take_seat", "id": 1})
        if in_force:
            rig.desk.take(page, command | {"kind": "speed", "value": 0.5, "id": 2})
            rig.tick(20)
        rig.commander.obeys = False
        rig.desk.take(page, command | {"kind": "depth", "value": 5000.0, "id": 3})
        sentence = "winch command: depth 5000 m; this winch's 3200 m of rope reach 3251.2 m."
        refused = Status("simulation: input winch command", Level.WARN, sentence, {"refused": "9"})
        rig.source.rows = [refused]
        rig.tick(round(FEEDBACK_S / 0.05) + 2)
        answer = replies(page)[-1]
        assert (answer["id"], answer["ok"]) == (3, False)
        assert "3251.2 m" in answer["words"]
        rig.commander.sent.clear()
        rig.tick(20)
        kept = {WinchCommand("speed", 0.5)} if in_force else set()
        assert {sent for _, sent in rig.commander.sent} == kept


def test_another_page_does_not_inherit_a_set_point() -> None:
    rig = ConsoleRig()
    first, second = rig.page(True), rig.page(True)
    rig.tick()
    rig.desk.take(first, {"do": "take_seat", "id": 1})
    rig.desk.take(
        first, {"do": "command", "kind": "speed", "value": 0.5, "winch": "winch", "id": 2}
    )
    rig.tick(10)
    rig.desk.leave(first)
    rig.pages.disconnect(first)
    rig.desk.take(second, {"do": "take_seat", "id": 3})
    rig.commander.sent.clear()
    rig.tick(20)
    assert rig.commander.sent == []


def test_a_page_that_hangs_gives_up_the_seat() -> None:
    rig = ConsoleRig()
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    rig.tick(200)
    assert rig.desk.state()["holder"] == page.number
    rig.silent.add(page.number)
    rig.tick(round((ALIVE_S + LOST_S) / 0.05) - 4)
    assert rig.commander.released == 0
    rig.tick(8)
    assert rig.commander.released == 1
    assert rig.desk.state()["holder"] is None


def test_a_page_that_answers_again_in_time_keeps_the_seat() -> None:
    rig = ConsoleRig()
    page = rig.page(True)
    rig.tick()
    rig.desk.take(page, {"do": "take_seat", "id": 1})
    rig.silent.add(page.number)
    rig.tick(round((ALIVE_S + LOST_S / 2.0) / 0.05))
    rig.silent.clear()
    rig.tick(200)
    assert rig.commander.released == 0
    assert rig.desk.state()["holder"] == page.number


def test_a_fault_of_a_row_is_shown_and_ends() -> None:
    rig = ConsoleRig()
    page = rig.page()
    rig.tick(3)
    frames(page)
    rig.source.broken = True
    rig.tick(20)
    rows = [one for one in frames(page) if one["type"] == "row"]
    assert len(rows) == 20
    assert "no such subscription" in rows[0]["values"]["fault console"]
    rig.source.broken = False
    rig.tick(3)
    rows = [one for one in frames(page) if one["type"] == "row"]
    assert rows[-1]["trend"] is not None
    assert rig.pages.readings.values["fault console"] == ""


def test_a_slow_page_is_sent_the_state_again() -> None:
    rig = ConsoleRig()
    slow, other = rig.page(True), rig.page(True)
    rig.tick()
    frames(slow)
    rig.desk.take(other, {"do": "take_seat", "id": 1})
    for _ in range(3):
        slow.submit("{}")  # fill its queue up to the loss of what waits
        while not slow.behind:
            slow.submit("{}")
        rig.tick()
    hellos = [one for one in frames(slow) if one.get("type") == "hello"]
    assert hellos
    assert hellos[-1]["control"]["holder"] == other.number


def test_with_control_only_a_signed_in_page_writes_the_log() -> None:
    rig = ConsoleRig()
    stranger, page = rig.page(), rig.page(True)
    rig.tick()
    casts = len(rig.log.casts)
    frames(stranger)
    for what in ("mark", "new_cast"):
        rig.desk.take(stranger, {"do": what, "text": "words", "id": 1})
        assert "token" in replies(stranger)[-1]["words"]
    assert (len(rig.log.casts), rig.log.markers) == (casts, [])
    for number in range(ENTRIES + 1):
        rig.desk.take(page, {"do": "mark", "text": f"{number}", "id": number})
    assert "too many" in replies(page)[-1]["words"]
    assert len(rig.log.markers) == ENTRIES
    rig.clock.now_s += ENTRIES_WITHIN_S
    rig.desk.take(page, {"do": "mark", "text": "later", "id": 99})
    assert replies(page)[-1]["ok"]


def test_heave_counts_from_the_mean_hang_off() -> None:
    rig = ConsoleRig()
    rig.pages.facts = {**rig.pages.facts, "hang_off_m": [0.0, 0.0, 12.0]}
    rig.tick(3)
    height_m = rig.pages.readings.values["hang_off_m"][2]
    assert rig.pages.trend.columns()["heave_m"][-1] == pytest.approx(height_m - 12.0)


def test_the_trend_shows_no_reading_of_a_dead_instrument() -> None:
    rig = ConsoleRig()
    rig.tick(2)
    row = {"quantity": "top_tension_n", "name": "winch", "measured": 2.0e5, "age_s": 0.4}
    for age_s, expected in ((0.4, 2.0e5), (5.0, None)):
        rig.pages.readings.values["residuals"] = [{**row, "age_s": age_s}]
        rig.source.topics = ("ropes/tension_top",)
        rig.tick()
        assert rig.pages.trend.columns()["measured_n"][-1] == expected


def test_a_session_that_cannot_be_read_is_said_on_the_pages() -> None:
    rig = ConsoleRig()
    facts: list[dict[str, object]] = [
        {"reason": "twin/session: made by another program"},
        {"bed_m": 1},
    ]
    pages = Pages(rig.source, rig.clock, None, lambda data: facts.pop(0))
    for said in ("twin/session: made by another program", ""):
        pages.readings.take("twin/session", b"x", rig.clock())
        rig.clock.now_s += 0.05
        pages.tick()
        assert pages.readings.values["fault twin/session"] == said


@pytest.mark.parametrize("seconds", [None, 0, -1.0, 1e6, float("nan"), True, "600"])
def test_shelving_needs_one_alert_and_a_time_within_a_shift(seconds: object) -> None:
    rig = ConsoleRig()
    rig.source.alerts = [TENSION_ALARM]
    rig.tick(5)
    page = rig.page(True)
    replies(page)
    for number, alert in enumerate(("10001.1", "all")):
        rig.desk.take(
            page,
            {"do": "alert", "action": "shelve", "alert": alert, "seconds": seconds, "id": number},
        )
    assert [one["ok"] for one in replies(page)] == [False, False]
    assert rig.commander.alert_words == []
    content = {"do": "alert", "action": "shelve", "alert": "10001.1", "seconds": 600, "id": 9}
    rig.desk.take(page, content)
    assert rig.commander.alert_words == ["shelve 10001.1 600"]
