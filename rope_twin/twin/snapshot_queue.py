"""Snapshot queue between the stepping thread and the publishing thread."""

from __future__ import annotations

import threading
from collections import deque

from rope_twin.twin.snapshot import Snapshot

MAX_DELAY_S = 0.5  # snapshots of this much real time may wait for the publisher


class SnapshotQueue:
    """Bounded queue of snapshots: the newest are kept, and the stepping thread never waits."""

    def __init__(self, depth: int) -> None:
        self._waiting: deque[Snapshot] = deque()
        self._depth = depth
        self._arrived = threading.Condition()
        self._lost = 0

    @property
    def lost(self) -> int:
        """Number of snapshots dropped because the queue was full."""
        return self._lost

    def put(self, snapshot: Snapshot) -> None:
        """Append a snapshot; the oldest is dropped if the publisher is `depth` behind."""
        with self._arrived:
            if len(self._waiting) >= self._depth:
                self._waiting.popleft()
                self._lost += 1
            self._waiting.append(snapshot)
            self._arrived.notify()

    def take(self, timeout_s: float) -> Snapshot | None:
        """Return the oldest waiting snapshot, or None if none came within the time."""
        with self._arrived:
            if not self._waiting:
                self._arrived.wait(timeout_s)
            return self._waiting.popleft() if self._waiting else None


def queue_depth(slot_s: float, speed: float) -> int:
    """Return the depth of the queue: the snapshots of MAX_DELAY_S, at least one."""
    return max(1, round(MAX_DELAY_S * speed / slot_s))
