"""Error estimate of the tension at the upper end of a rope that hangs from the ship."""

from __future__ import annotations

from collections.abc import Sequence

from rope_twin.core.state import Boundary, Floats
from rope_twin.twin.accuracy.error_bound import (
    EVERY,
    Border,
    ErrorBand,
    acceleration_jumps,
    border_before,
)
from rope_twin.twin.accuracy.out_of_step import OutOfStep


class Top:
    """Error estimate of one rope, and the second last boundary of its prescribed motion."""

    def __init__(
        self,
        rope: int,
        band: ErrorBand,
        now: tuple[Floats, Floats],
        step_s: float,
        vortices: OutOfStep | None = None,
    ) -> None:
        """Start at `now`, value and rate of the prescribed motion.

        vortices: phase drift, if self-excited.
        """
        self.rope, self.band, self.vortices = rope, band, vortices
        self._before: Border = border_before(*now, step_s)

    def jumps(self, boundary: Boundary, done: int, step_s: float) -> list[float]:
        """Jumps of the prescribed acceleration at the beginning of the steps just done [m/s²]."""
        value, rate = (table[: done + 1] for table in boundary)
        found = acceleration_jumps(self._before, value, rate, step_s)
        self._before = value[done - 1].tolist(), rate[done - 1].tolist()
        return found

    def no_jumps(self, boundary: Boundary, done: int, step_s: float) -> list[float]:
        """Return zero jumps, for a payout that responds to the tension and has a kink each step."""
        value, rate = boundary
        self._before = value[done - 1].tolist(), rate[done - 1].tolist()
        return [0.0] * done

    def judge(
        self,
        times: tuple[float, float],
        jumps: Sequence[float],
        own: Sequence[float],
        followed: Sequence[float],
        waiting: int,
    ) -> None:
        """Take the steps just done and the coarse solution's tensions.

        times: of the last step, and step length [s]; own, followed: top tensions [N]; waiting:
        steps that the coarse solution had not done before.
        """
        now_s, h = times
        band, done = self.band, len(own)
        for k, jump in enumerate(jumps):
            at_s = now_s - (done - 1 - k) * h
            band.take(at_s, jump, own[k])
            turn, between = divmod(waiting + k + 1, EVERY)
            if not between:
                band.compare(at_s, abs(followed[turn - 1] - own[k]))
                if self.vortices is not None:
                    self.vortices.take(at_s, own[k], followed[turn - 1])

    def bound_n(self, time_s: float) -> float:
        """Return the 95 % bound on the error of the newest step's tension [N]."""
        bound = self.band.bound_n(time_s)
        return bound if self.vortices is None else max(bound, self.vortices.bound_n(time_s))
