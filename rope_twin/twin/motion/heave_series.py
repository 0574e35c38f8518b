"""Heave known in advance, evaluated for many steps at once.

The polynomial is that of `HeaveTrack` between the same samples, in the same order of operations, so
that both are bit-identical. A series has no gaps, so nothing is extrapolated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.twin.motion.heave_track import (
    HEAVE_LIMIT_M,
    JUMP_M,
    STALE_NS,
    VELOCITY_LIMIT_M_PER_S,
)


@dataclass(frozen=True, eq=False)
class HeaveSeries:
    """Samples in the order of their stamps; twin time 0 is at `start_ns` of the stamps.

    Raises:
        InputError: the samples are out of order, have a gap, or are beyond a ship's limits.
    """

    stamp_ns: NDArray[np.int64]
    position_m: NDArray[np.float64]  # of the hang-off above its mean position, + up
    velocity_m_per_s: NDArray[np.float64]
    start_ns: int = 0
    aside: NDArray[np.float64] | None = None  # east, north [m] and their rates [m/s], (4, samples)

    def __post_init__(self) -> None:
        """Check the samples."""
        if self.aside is not None and self.aside.shape != (4, len(self.stamp_ns)):
            what = f"east and north of shape {self.aside.shape}"
            right = f"give (4, {len(self.stamp_ns)}), as many as samples"
            raise InputError(phrase("hang-off", what, right))
        shapes = {self.stamp_ns.shape, self.position_m.shape, self.velocity_m_per_s.shape}
        if len(shapes) != 1 or self.stamp_ns.ndim != 1 or len(self.stamp_ns) < 2:
            raise InputError(
                phrase("heave", f"arrays of shapes {shapes}", "give three of one length, 2 or more")
            )
        for fault in (self._order_fault(), self._motion_fault()):
            if fault:
                raise InputError(fault)

    @classmethod
    def of(
        cls,
        samples: Iterable[tuple[int, float, float]],
        aside: Sequence[tuple[float, float, float, float]] = (),
    ) -> HeaveSeries:
        """Return a series from stamp [ns], position [m] and velocity [m/s] of each sample.

        aside: x, y [m] and their rates [m/s] of each sample, if the hang-off moves laterally.
        """
        stamps, positions, velocities = zip(*samples, strict=True)
        moved = np.array(aside).T if aside else None
        heave = np.array(positions), np.array(velocities)
        return cls(np.array(stamps, np.int64), *heave, aside=moved)

    def starting_at(self, start_ns: int) -> HeaveSeries:
        """Return the same samples with twin time 0 at this stamp; arrays are shared."""
        return replace(self, start_ns=start_ns)

    @property
    def end_ns(self) -> int:
        """Twin time of the last sample [ns]."""
        return int(self.stamp_ns[-1]) - self.start_ns

    def check_reach(self, first_ns: int, last_ns: int) -> None:
        """Check that the series covers the first to the last twin time.

        Raises:
            InputError: it does not.
        """
        known = self.stamp_ns[0] - self.start_ns, self.stamp_ns[-1] - self.start_ns
        if first_ns <= known[0] or last_ns > known[1]:
            raise InputError(
                phrase(
                    "heave",
                    f"samples from {int(known[0]) * 1e-9:g} s to {self.end_ns * 1e-9:g} s, wanted "
                    f"from {first_ns * 1e-9:g} s to {last_ns * 1e-9:g} s",
                    "give a longer series",
                )
            )

    def at(self, time_ns: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return position [m] and velocity [m/s] at rising twin times, of the same shape.

        Raises:
            InputError: the series does not cover the times.
        """
        return self._between(time_ns, self.position_m, self.velocity_m_per_s)

    def aside_at(
        self, time_ns: NDArray[np.int64]
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Return lateral motion, east and north, as `at` does; empty if the series has none.

        Raises:
            InputError: the series does not cover the times.
        """
        if self.aside is None:
            return []
        return [self._between(time_ns, self.aside[k], self.aside[k + 2]) for k in (0, 1)]

    def _between(
        self, time_ns: NDArray[np.int64], z: NDArray[np.float64], v: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the cubic Hermite polynomials of values z with rates v at the samples."""
        self.check_reach(int(time_ns[0]), int(time_ns[-1]))
        on = time_ns + self.start_ns
        k = np.searchsorted(self.stamp_ns, on, side="left")
        t0, t1 = self.stamp_ns[k - 1], self.stamp_ns[k]
        z0, z1 = z[k - 1], z[k]
        v0, v1 = v[k - 1], v[k]
        h = (t1 - t0) * 1e-9
        u = (on - t0) / (t1 - t0)
        d0, d1 = v0 * h, v1 * h
        c2, c3 = 3.0 * (z1 - z0) - 2.0 * d0 - d1, 2.0 * (z0 - z1) + d0 + d1
        # + 0.0: a track adds the remainder of a gap, which turns -0 into 0
        value = z0 + u * (d0 + u * (c2 + u * c3)) + 0.0
        return value, (d0 + u * (2.0 * c2 + u * 3.0 * c3)) / h + 0.0

    def _order_fault(self) -> str:
        steps_ns = np.diff(self.stamp_ns)
        late = np.flatnonzero(steps_ns <= 0)
        if late.size:
            at_s = self.stamp_ns[late[0] + 1] * 1e-9
            return phrase("heave", f"the stamp {at_s:.3f} s is not after the one before it",
                          "give samples in the order of their stamps")  # fmt: skip
        gap = int(np.argmax(steps_ns))
        if steps_ns[gap] > STALE_NS:
            return phrase(
                "heave",
                f"{steps_ns[gap] * 1e-9:.2f} s without a sample after "
                f"{self.stamp_ns[gap] * 1e-9:.2f} s",
                f"an ensemble takes heave with gaps of at most {STALE_NS * 1e-9:g} s",
            )
        return ""

    def _motion_fault(self) -> str:
        z, v = self.position_m, self.velocity_m_per_s
        possible = (np.abs(z) <= HEAVE_LIMIT_M) & (np.abs(v) <= VELOCITY_LIMIT_M_PER_S)  # NaN: not
        if not possible.all():
            k = int(np.argmin(possible))
            return phrase(
                "heave", f"position {z[k]:g} m, velocity {v[k]:g} m/s at sample {k}",
                f"a ship stays within ±{HEAVE_LIMIT_M:g} m and ±{VELOCITY_LIMIT_M_PER_S:g} m/s")  # fmt: skip # noqa: E501
        most = VELOCITY_LIMIT_M_PER_S * np.diff(self.stamp_ns) * 1e-9 + JUMP_M
        jumps = np.flatnonzero(np.abs(np.diff(z)) > most)
        if jumps.size:
            at_s = self.stamp_ns[jumps[0]] * 1e-9
            return phrase("heave", f"it jumps by {np.diff(z)[jumps[0]]:.2f} m at {at_s:.2f} s",
                          f"a ship moves by at most {VELOCITY_LIMIT_M_PER_S:g} m/s")  # fmt: skip
        return ""
