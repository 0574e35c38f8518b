"""Which topics are due at which slot."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from typing import Any

import pytest

from rope_twin.messages import Encoder
from rope_twin.topics import BY_NAME, EXTRA_TOPICS, SNAPSHOT_TOPICS, due_topics


def test_the_topics_made_from_snapshots_are_those_that_the_encoder_knows() -> None:
    made = {topic.name for topic in (*SNAPSHOT_TOPICS, *EXTRA_TOPICS)}
    assert made == set(Encoder(0).topics)


@pytest.mark.parametrize("slot_ms", [5, 10, 12, 18, 20])
def test_no_topic_is_slower_than_the_table_says(slot_ms: int) -> None:
    seconds = 18
    slots = seconds * 1000 // slot_ms
    counts = Counter(
        name for slot in range(1, slots + 1) for name in due_topics(slot, slot_ms * 1_000_000)
    )
    for topic in SNAPSHOT_TOPICS:
        assert counts[topic.name] >= seconds * BY_NAME[topic.name].rate_hz * (1 - 1e-9)
        assert counts[topic.name] <= seconds * topic.rate_hz * 2


def test_in_a_slot_of_20_ms_scalars_come_each_time_and_arrays_every_second() -> None:
    assert "ropes/element_tension" not in due_topics(1, 20_000_000)
    assert "ropes/tension_top" in due_topics(1, 20_000_000)
    assert {topic.name for topic in SNAPSHOT_TOPICS} == set(due_topics(2, 20_000_000))


def test_fatigue_is_published_only_where_there_is_any() -> None:
    nothing: dict[str, Any] = {topic.only_with: None for topic in EXTRA_TOPICS}
    assert due_topics(1, 20_000_000, SimpleNamespace(**nothing)) == due_topics(1, 20_000_000)
    worn = SimpleNamespace(**nothing | {"fatigue": object()})
    reported = [
        slot for slot in range(1, 201) if "ropes/fatigue" in due_topics(slot, 20_000_000, worn)
    ]
    assert reported == [50, 100, 150, 200]
