"""States of an alert: activation, silence, acknowledgement, rectification, shelving, order."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rope_twin.alerts.alert_list import (
    ESCALATIONS,
    REPEAT_NS,
    SECOND,
    SILENCE_NS,
    STANDING_NS,
    Alert,
    AlertList,
    Priority,
    Situation,
    State,
)
from rope_twin.errors import InputError

CAUTION, WARNING, ALARM = Priority.CAUTION, Priority.WARNING, Priority.ALARM


def situation(identifier: int = 10001, priority: Priority = ALARM, where: str = "rope") -> Any:
    """Return a situation."""
    return Situation(identifier, "top tension", "A", where, priority, f"{where} too high")


def only(alerts: AlertList) -> Alert:
    """Return the single alert of a list."""
    (found,) = alerts.listed()
    return found


def test_an_alarm_waits_until_it_is_acknowledged_and_goes_when_its_cause_does() -> None:
    alerts = AlertList()
    (raised,) = alerts.update([situation()], 5 * SECOND)
    assert (raised.state, raised.since_ns, raised.key) == (
        State.UNACKNOWLEDGED, 5 * SECOND, "10001.1"
    )  # fmt: skip
    assert raised.sounds(5 * SECOND)
    assert alerts.update([situation()], 6 * SECOND) == []
    assert alerts.act("acknowledge", "10001.1") == "alert 10001.1 acknowledged"
    assert only(alerts).state is State.ACKNOWLEDGED
    assert not only(alerts).sounds(6 * SECOND)
    (gone,) = alerts.update([], 7 * SECOND)
    assert gone.state is State.NORMAL
    assert alerts.listed() == []


def test_what_nobody_saw_stays_in_the_list_as_rectified() -> None:
    alerts = AlertList()
    alerts.update([situation()], 0)
    alerts.update([], SECOND)
    assert only(alerts).state is State.RECTIFIED
    assert not only(alerts).sounds(SECOND)
    alerts.act("acknowledge", "all")
    assert alerts.listed() == []


def test_silence_ends_after_thirty_seconds() -> None:
    alerts = AlertList()
    alerts.update([situation()], 0)
    alerts.act("silence", "10001.1")
    alerts.update([situation()], SILENCE_NS - 1)
    assert only(alerts).state is State.SILENCED
    alerts.update([situation()], SILENCE_NS)
    assert only(alerts).state is State.UNACKNOWLEDGED
    assert only(alerts).sounds(SILENCE_NS)


def test_a_warning_is_announced_again_and_an_alarm_sounds_on() -> None:
    alerts = AlertList()
    both = [situation(priority=WARNING), situation(10002, ALARM)]
    alerts.update(both, 0)
    for count in range(1, ESCALATIONS + 3):
        changed = alerts.update(both, count * REPEAT_NS)
        if count <= ESCALATIONS:
            assert [one.identifier for one in changed] == [10001]
    counts = {one.identifier: one.escalation for one in alerts.listed()}
    assert counts == {10001: ESCALATIONS, 10002: 0}


def test_a_caution_neither_sounds_nor_waits() -> None:
    alerts = AlertList()
    alerts.update([situation(priority=CAUTION)], 0)
    assert only(alerts).state is State.ACKNOWLEDGED
    assert not only(alerts).sounds(0)
    with pytest.raises(InputError, match="it is acknowledged"):
        alerts.act("acknowledge", "10001.1")
    alerts.update([], 1)
    assert alerts.listed() == []


def test_what_becomes_worse_must_be_acknowledged_again() -> None:
    alerts = AlertList()
    alerts.update([situation(priority=WARNING)], 0)
    alerts.act("acknowledge", "all")
    (worse,) = alerts.update([situation(priority=ALARM)], SECOND)
    assert (worse.state, worse.priority, worse.instance) == (State.UNACKNOWLEDGED, ALARM, 1)
    assert worse.revision == 3
    alerts.act("acknowledge", "all")
    (better,) = alerts.update([situation(priority=WARNING)], 2 * SECOND)
    assert (better.state, better.priority) == (State.ACKNOWLEDGED, WARNING)
    (caution,) = alerts.update([situation(priority=CAUTION)], 3 * SECOND)
    assert caution.state is State.ACKNOWLEDGED
    (back,) = alerts.update([situation(priority=WARNING)], 4 * SECOND)
    assert back.state is State.UNACKNOWLEDGED


@pytest.mark.parametrize("act", ["acknowledge", "silence", None])
def test_a_warning_that_fades_to_a_caution_still_waits(act: str | None) -> None:
    """A sensor that fails and returns is doubtful for a minute, and then sound again."""
    alerts = AlertList()
    alerts.update([situation(priority=WARNING)], 0)
    if act is not None:
        alerts.act(act, "10001.1")
    alerts.update([situation(priority=CAUTION)], SECOND)
    seen = act == "acknowledge"
    assert only(alerts).priority is (CAUTION if seen else WARNING)
    assert only(alerts).waits is not seen
    alerts.update([], 2 * SECOND)
    if seen:
        assert alerts.listed() == []
        return
    assert only(alerts).state is State.RECTIFIED
    alerts.update([situation(priority=CAUTION)], 3 * SECOND)
    assert (only(alerts).priority, only(alerts).waits) == (WARNING, True)
    alerts.update([situation(priority=WARNING)], 4 * SECOND)
    alerts.update([situation(priority=CAUTION)], 5 * SECOND)
    alerts.act("acknowledge", "10001.1")
    alerts.update([situation(priority=CAUTION)], 6 * SECOND)
    assert (only(alerts).priority, only(alerts).waits) == (CAUTION, False)


def test_the_order_is_that_of_bridge_displays() -> None:
    alerts = AlertList()
    six = {
        10001: ALARM, 10002: WARNING, 10003: WARNING, 10004: ALARM, 10005: WARNING, 10006: CAUTION
    }  # fmt: skip
    every = [situation(number, priority) for number, priority in six.items()]
    alerts.update(every, 0)
    for key in ("10004.1", "10005.1"):
        alerts.act("acknowledge", key)
    alerts.update([one for one in every if one.identifier != 10003], SECOND)
    assert [one.identifier for one in alerts.listed()] == [10001, 10002, 10003, 10004, 10005, 10006]
    alerts.update([*every, situation(10001, ALARM, "second")], 2 * SECOND)
    assert [one.key for one in alerts.listed()][:2] == ["10001.2", "10001.1"], "the newest first"


def test_shelving_has_a_limit_and_an_end() -> None:
    alerts = AlertList()
    alerts.update([situation(), situation(10002)], 0)
    alerts.shelve("10001.1", 60.0)
    assert [one.identifier for one in alerts.listed()] == [10002]
    assert [one.identifier for one in alerts.shelved()] == [10001]
    alerts.update([situation(), situation(10002)], 60 * SECOND)
    assert len(alerts.listed()) == 2
    alerts.shelve("10001.1", 3600.0)
    alerts.shelve("10001.1", 0.0)
    assert len(alerts.listed()) == 2
    for wrong in (-1.0, 1e6, float("nan")):
        with pytest.raises(InputError, match="give 0 to 28800 s"):
            alerts.shelve("10001.1", wrong)
    with pytest.raises(InputError, match="listed: "):
        alerts.shelve("10009.1", 60.0)


def test_a_shelved_alert_that_becomes_worse_is_listed_again() -> None:
    """A shelved warning never hides an alarm; one shelved as an alarm may come and go."""
    alerts = AlertList()
    alerts.update([situation(10001, WARNING)], 0)
    alerts.shelve("10001.1", 3600.0)
    alerts.update([situation(10001, WARNING)], SECOND)
    assert not alerts.listed()
    alerts.update([situation(10001, ALARM)], 2 * SECOND)
    assert only(alerts).sounds(2 * SECOND)
    assert not alerts.shelved()
    alerts.shelve("10001.1", 3600.0)
    for k, priority in enumerate((WARNING, ALARM, CAUTION, ALARM), start=3):
        alerts.update([situation(10001, priority)], k * SECOND)
        assert not alerts.listed()
    alerts.update([], 10 * SECOND)
    alerts.shelve("10001.1", 0.0)
    alerts.update([situation(10001, WARNING)], 11 * SECOND)
    alerts.shelve("10001.1", 3600.0)
    alerts.update([], 12 * SECOND)
    alerts.update([situation(10001, ALARM)], 13 * SECOND)
    assert only(alerts).priority is ALARM, "it comes back worse"


def test_the_first_of_several_is_marked_until_nothing_waits() -> None:
    alerts = AlertList()
    alerts.update([situation(10005, WARNING)], 0)
    alerts.update([situation(10005, WARNING), situation(10001)], SECOND)
    assert {one.identifier: one.first_out for one in alerts.listed()} == {10005: True, 10001: False}
    alerts.act("acknowledge", "10005.1")
    assert {one.identifier: one.first_out for one in alerts.listed()} == {10005: False, 10001: True}


def test_a_day_makes_it_standing() -> None:
    alerts = AlertList()
    alerts.update([situation()], 0)
    assert not only(alerts).standing(STANDING_NS - 1)
    assert only(alerts).standing(STANDING_NS)


ACTS = st.one_of(
    st.tuples(st.just("situations"), st.frozensets(st.sampled_from(range(10001, 10004)))),
    st.tuples(st.sampled_from(["acknowledge", "silence", "transfer"]), st.integers(10001, 10003)),
    st.tuples(st.just("shelve"), st.integers(10001, 10003)),
)
PRIORITY = {10001: ALARM, 10002: WARNING, 10003: CAUTION}


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(ACTS, st.integers(0, 100)), max_size=30))
def test_any_course_keeps_the_rules(course: list[Any]) -> None:
    alerts, now_ns, present = AlertList(), 0, frozenset[int]()
    for (act, what), later_s in course:
        now_ns += later_s * SECOND
        if act == "situations":
            present = what
        else:
            try:
                if act == "shelve":
                    alerts.shelve(f"{what}.1", 50.0)
                else:
                    alerts.act(act, f"{what}.1")
            except InputError:
                pass
        before = {one.key: one for one in (*alerts.listed(), *alerts.shelved())}
        alerts.update([situation(one, PRIORITY[one]) for one in sorted(present)], now_ns)
        every = [*alerts.listed(), *alerts.shelved()]
        for one in every:
            assert one.identifier not in present or one.active
            assert one.identifier in present or one.state in (State.RECTIFIED, State.NORMAL)
            assert one.sounds(now_ns) <= (one.priority > CAUTION and one.active)
            assert one.since_ns <= one.changed_ns <= now_ns
            if one.key in before and before[one.key].state is not one.state:
                assert one.revision != before[one.key].revision
        assert {one.identifier for one in every} >= present
        assert sum(one.first_out for one in every) <= 1
