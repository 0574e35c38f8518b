"""Which topics are due at which slot, the same for every runner.

A slot is one publish period of the twin. Scalars are due at each slot, slower topics at every
n-th, n chosen so that the topic is never slower than the table says (if slots are not).
"""

from __future__ import annotations

from rope_twin.topics import TOPICS

SNAPSHOT_TOPICS = tuple(
    topic for topic in TOPICS if topic.publisher == "simulation" and topic.rate_hz >= 5.0
)
DIAGNOSTICS_PERIOD_NS = 1_000_000_000


def every(rate_hz: float, slot_ns: int) -> int:
    """A topic of this rate is due at every n-th slot."""
    return max(1, int(1e9 / (rate_hz * slot_ns) + 1e-9))


def due_topics(slot: int, slot_ns: int) -> list[str]:
    """Names of the topics made from the snapshot at the end of a slot (the first is slot 1)."""
    return [topic.name for topic in SNAPSHOT_TOPICS if slot % every(topic.rate_hz, slot_ns) == 0]
