"""Results of the optional analyses of a run: energy, error interval, vibration, fatigue."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
MIN_EXCHANGED_FRACTION = 1e-4


@dataclass(frozen=True)
class EnergyBalance:
    """Energy of rope and payload, its sources and its sinks, since the balance was opened [J].

    change = hang_off + passing + water - damped - residual.
    """

    since_s: float  # twin time at which the balance was opened
    kinetic_j: float  # now, with the added mass
    elastic_j: float
    potential_j: float  # weight less buoyancy, 0 at the mean water level
    change_j: float  # change of the sum of these three
    hang_off_j: float  # work of ship and winch: force times material velocity
    passing_j: float  # energy of rope paid out, less that of rope hauled in
    water_j: float  # work of the water: drag, mostly negative
    damped_j: float  # dissipated by the axial damper and a compensator, less what one drives
    residual_j: float  # remainder: numerical dissipation if positive
    exchanged_j: float  # energy moved between any two of these terms

    @property
    def residual_pct(self) -> float:
        """Residual as a percentage of the energy exchanged.

        While little was exchanged (a rope in static equilibrium, or just set in motion), the
        reference is a ten-thousandth of the stored energy: the residual is then its round-off, or
        that of the quadrature over few steps.
        """
        there = abs(self.kinetic_j) + abs(self.elastic_j) + abs(self.potential_j)
        beside = max(self.exchanged_j, MIN_EXCHANGED_FRACTION * there)
        return 100.0 * self.residual_j / beside if beside > 0.0 else 0.0

    def figures(self) -> dict[str, float]:
        """Return all values by name, with the residual in per cent."""
        return {**asdict(self), "residual_pct": self.residual_pct}


@dataclass(frozen=True)
class TensionInterval:
    """95 % discretisation-error interval of the top tension (`accuracy/error_interval.py`)."""

    low_n: float
    high_n: float
    bound_n: float  # half-width: bound of the error of tension_top_n; low_n is at least 0
    cost_pct: float  # CPU time of the interval, relative to all other work
