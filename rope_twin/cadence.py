"""Publishing schedule: which topics are due at which cycle, the same for every runner.

A cycle is one publish period of the twin. Scalars are due at each cycle, slower topics at every
n-th, with n such that the topic is never slower than the table states (if cycles are not).
"""

from __future__ import annotations

from rope_twin.topics import TOPICS
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.snapshot import Snapshot

SNAPSHOT_TOPICS = tuple(one for one in TOPICS if one.of_snapshot and not one.only_with)
EXTRA_TOPICS = tuple(one for one in TOPICS if one.of_snapshot and one.only_with)
DIAGNOSTICS_PERIOD_NS = 1_000_000_000


def every(rate_hz: float, slot_ns: int) -> int:
    """Return n of the n-th cycles at which a topic is due; 1 for a topic published on change."""
    if rate_hz == 0.0:
        return 1
    return max(1, int(1e9 / (rate_hz * slot_ns) + 1e-9))


def slot_of(snapshot: Snapshot) -> tuple[int, int]:
    """Return number and length [ns] of the cycle that the snapshot ends, from its time step."""
    slot_ns = steps_in_slot(snapshot.step_s) * round(snapshot.step_s * 1e9)
    return snapshot.stamp_ns // slot_ns, slot_ns


def due_topics(slot: int, slot_ns: int, snapshot: Snapshot | None = None) -> list[str]:
    """Return the topics due from the snapshot at the end of a cycle (the first is cycle 1).

    Without the snapshot: those that every one has.
    """
    topics = SNAPSHOT_TOPICS
    if snapshot is not None:
        given = (t for t in EXTRA_TOPICS if getattr(snapshot, t.only_with))
        topics = (*SNAPSHOT_TOPICS, *given)
    return [topic.name for topic in topics if slot % every(topic.rate_hz, slot_ns) == 0]
