"""Robustness tests as cases: values, each with an upper limit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from validation.case import Case, Finding, Found, limited
from validation.state_bench import Vector


def hard_case(
    name: str, about: str, reference: str, run: Callable[[], list[Finding]], seconds: float,
    quick: bool = False,
) -> Case:  # fmt: skip
    """Return a robustness test; reference: what its values are compared with."""
    return Case(name, about, reference, lambda: Found(tuple(run())), seconds, quick=quick)


def front_pct(acceleration: float) -> float:
    """Return the RMS error of the top tension that steps of the acceleration may cause [%].

    The front of such a step is of first order in time: 0.05 % for steel at 10 ms and 0.3 m/s², the
    limit that payout is held to, and in proportion to the step.
    """
    return 0.05 * acceleration / 0.3


def off(quantity: str, value: float, expected: float, limit_pct: float) -> Finding:
    """Limit the relative error of a value [%]."""
    return limited(quantity, 100.0 * float(abs(value / expected - 1.0)), limit_pct)


def rms_off(quantity: str, values: Vector, expected: Vector, limit_pct: float) -> Finding:
    """Limit the RMS difference of two series over the mean of the expected one [%]."""
    difference = float(np.sqrt(np.mean((values - expected) ** 2)))
    return limited(quantity, 100.0 * difference / abs(float(expected.mean())), limit_pct)


def all_converged(unconverged: int) -> Finding:
    """Require that no substep was accepted without convergence."""
    return limited("substeps accepted without convergence", unconverged, 0.0, "")
