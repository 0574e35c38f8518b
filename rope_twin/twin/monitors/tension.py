"""Monitor of tension: extremes at the upper end of every rope, and the share of time with slack."""

from __future__ import annotations

from collections.abc import Iterator

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.twin.monitors.monitor import Chunk, Monitor, TwinView
from rope_twin.twin.snapshot_builder import Extremes


class TensionMonitor(Monitor):
    """Monitor of the tension at the upper ends, in every step, and of slack, at intervals.

    A saved state does not hold its results: in a restored twin they start again.
    """

    _upper: list[Extremes]
    _static: list[float]

    def __init__(self, slack_steps: int) -> None:
        """Check for slack after every `slack_steps` steps."""
        self._slack_steps = slack_steps
        self._checks = self._slack_checks = 0

    def start(self, now: TwinView, present: Chunk) -> None:
        """Start in static equilibrium."""
        self._static = present.pull[:, rows.PULL].tolist()
        self._upper = [Extremes() for _ in self._static]

    def steps_to_observation(self, now: TwinView) -> int:
        """Return the number of steps until the next check for slack."""
        return self._slack_steps - now.clock.steps % self._slack_steps

    def observe(self, now: TwinView, chunk: Chunk) -> None:
        """Take the tensions of the steps just done, and check for slack if that is due."""
        for upper, pulls in zip(self._upper, chunk.pulls, strict=True):
            upper.take(pulls[: chunk.done, rows.PULL].tolist())
        if chunk.done and chunk.steps % self._slack_steps == 0:
            self._checks += 1
            self._slack_checks += any(bool(one.min() <= 0.0) for one in _tensions(chunk))

    def cut(self, now: TwinView) -> None:
        """Continue with the parts; the lower one of a multi-line system is a further rope."""
        if now.joined is not None:
            self._upper.append(Extremes())
            self._static.append(0.0)

    @property
    def upper_n(self) -> list[Extremes]:
        """Tension at the upper end of each rope in all steps [N]; before the first, the static."""
        found = []
        for upper, static in zip(self._upper, self._static, strict=True):
            if upper.empty:
                upper = Extremes()
                upper.take([static])
            found.append(upper)
        return found

    @property
    def slack_share(self) -> float:
        """Fraction of the checks that found an element without tension, of any rope."""
        return self._slack_checks / self._checks if self._checks else 0.0


def _tensions(chunk: Chunk) -> Iterator[Floats]:
    """Yield the tension of the elements of each rope [N]."""
    ropes = (chunk.ropes,) if isinstance(chunk.ropes, Rope) else chunk.ropes.ropes
    for rope in ropes:
        yield rope.work[rows.TENSION, : rope.state.counts[rows.ELEMENTS]]
