"""Results of a robustness test: values, each with a limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from validation.state_bench import Vector


@dataclass(frozen=True)
class Check:
    """One figure of a case; it holds if it is not above its limit (NaN never holds)."""

    what: str
    figure: float
    limit: float
    unit: str = "%"

    @property
    def ok(self) -> bool:
        """Return whether the value is within its limit."""
        return bool(self.figure <= self.limit)

    @property
    def strain(self) -> float:
        """Return value over limit; inf if a limit of 0 is violated."""
        if self.limit > 0.0 and not np.isnan(self.figure):
            return float(self.figure / self.limit)
        return 0.0 if self.ok else float("inf")


@dataclass(frozen=True)
class Case:
    """One robustness test."""

    id: str
    about: str  # what is hard about it
    reference: str  # what its figures are held against
    run: Callable[[], list[Check]]
    seconds: float  # what it takes, roughly
    quick: bool = False  # part of the short subset


def front_pct(acceleration: float) -> float:
    """Return the RMS error of the top tension that steps of the acceleration may cause [%].

    The front of such a step is of first order in time: 0.05 % for steel at 10 ms and 0.3 m/s², the
    limit that payout is held to, and in proportion to the step.
    """
    return 0.05 * acceleration / 0.3


def off(what: str, found: float, expected: float, limit_pct: float) -> Check:
    """Return the relative error of a value [%]."""
    return Check(what, 100.0 * float(abs(found / expected - 1.0)), limit_pct)


def rms_off(what: str, found: Vector, expected: Vector, limit_pct: float) -> Check:
    """Return the RMS difference of two series over the mean of the expected one [%]."""
    difference = float(np.sqrt(np.mean((found - expected) ** 2)))
    return Check(what, 100.0 * difference / abs(float(expected.mean())), limit_pct)


def all_converged(unconverged: int) -> Check:
    """Check that no substep was accepted without convergence."""
    return Check("substeps accepted without convergence", float(unconverged), 0.0, "")
