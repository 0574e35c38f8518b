"""Which stretch of twin time is due to be published by a node that feeds the twin.

Pure arithmetic: the epoch comes from twin/epoch, the clocks from the caller.
"""

from __future__ import annotations

_JOIN_LATE_S = 0.5  # younger than this, the twin still gets everything from the beginning
_LOOK_BACK_S = 0.1  # a twin that runs already gets samples from a little before now
PIECE_NS = 500_000_000  # of twin time at once: five commands, where a listener keeps ten


class Feed:
    """Follows one epoch after another; each instant of twin time is due exactly once per epoch."""

    def __init__(self, lead_s: float, speed: float, first_ns: int = 0) -> None:
        self._lead_ns = round(lead_s * max(1.0, speed) * 1e9)
        self._speed = speed
        self._first_ns = first_ns
        self._epoch_ns: int | None = None
        self._steady_at_zero_ns = 0
        self._sent_ns = 0

    @property
    def epoch_ns(self) -> int | None:
        """The epoch that is followed, if there is one yet."""
        return self._epoch_ns

    def follow(self, epoch_ns: int, ros_now_ns: int, steady_now_ns: int) -> None:
        """A twin has said when its t = 0 is (or has gone on after a pause with a new one)."""
        if epoch_ns == self._epoch_ns:
            return
        self._epoch_ns = epoch_ns
        # From here on the steady clock counts: a step of the system clock moves nothing.
        self._steady_at_zero_ns = steady_now_ns - (ros_now_ns - epoch_ns)
        now_ns = self._twin_time_ns(steady_now_ns)
        fresh = now_ns < _JOIN_LATE_S * max(1.0, self._speed) * 1e9
        self._sent_ns = self._first_ns if fresh else now_ns - round(_LOOK_BACK_S * 1e9)

    def due(self, steady_now_ns: int) -> tuple[int, int]:
        """The stretch [from, to) of twin time [ns] to publish now; empty if from = to.

        A long one comes in pieces, one at each call: who listens takes each before the next.
        """
        if self._epoch_ns is None:
            return 0, 0
        wanted_ns = self._twin_time_ns(steady_now_ns) + self._lead_ns
        until_ns = min(max(self._sent_ns, wanted_ns), self._sent_ns + PIECE_NS)
        stretch = self._sent_ns, until_ns
        self._sent_ns = until_ns
        return stretch

    def _twin_time_ns(self, steady_now_ns: int) -> int:
        return round((steady_now_ns - self._steady_at_zero_ns) * self._speed)
