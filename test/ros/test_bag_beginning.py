"""Bag of a recorder that joins a run: it begins when its recording does."""

from __future__ import annotations

import pytest

from rope_twin.ros.recorder_node import BagBeginning, Stored

pytestmark = pytest.mark.ros
SECOND = 1_000_000_000
HOUR_NS = 3600 * SECOND


def message(topic: str, stamp_ns: int) -> Stored:
    return topic, stamp_ns, topic.encode(), 7


def test_latched_messages_of_long_ago_begin_with_the_first_result() -> None:
    """Inputs may be stamped by another machine's clock, and begin nothing."""
    beginning, early = BagBeginning(), HOUR_NS // 2
    assert beginning.take(message("twin/epoch", early)) == []
    assert beginning.take(message("alerts", HOUR_NS - SECOND)) == []
    for topic in ("ship/heave", "twin/session"):
        assert beginning.take(message(topic, 5)) == [message(topic, 5)]
    first = message("ropes/tension_top", HOUR_NS)
    assert beginning.take(first) == [
        message("twin/epoch", HOUR_NS), message("alerts", HOUR_NS - SECOND), first,
    ]  # fmt: skip
    later = message("ropes/tension_top", HOUR_NS + SECOND)
    assert beginning.take(later) == [later]
    assert beginning.take(message("winch/seat", early)) == [message("winch/seat", HOUR_NS)]
    assert beginning.rest() == []


def test_a_run_without_a_result_keeps_what_was_latched() -> None:
    beginning = BagBeginning()
    assert beginning.take(message("twin/epoch", SECOND)) == []
    assert beginning.rest() == [message("twin/epoch", SECOND)]
