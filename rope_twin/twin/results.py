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
    damped_j: float  # dissipated by the axial damper
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


@dataclass(frozen=True)
class RopeVibration:
    """VIV response along the rope; rows run from the hang-off (row 0) down.

    An amplitude is √2 times the rms over some periods, divided by the rope's diameter.
    """

    model: str  # "motion": measured in the twin; "modes", "decomposed": loosely coupled model
    cross_flow: Vector  # amplitude across current and rope [diameters], (nodes,)
    cross_flow_hz: Vector  # its frequency; 0 where the rope does not vibrate, (nodes,)
    in_line: Vector | None  # amplitude along the current; None: not in the model
    in_line_hz: Vector | None
    drag_amplification: Vector  # factor on the mean drag; 1: none, (nodes,)
    every_s: float  # interval between solutions of the rope's modes; 0: the model has none
    solves: int  # number of these solutions
    note: str  # message if the modes could not be solved
    cost_pct: float = 0.0  # CPU time of the monitor, relative to the twin's

    @property
    def worst(self) -> int:
        """Index of the node with the largest cross-flow amplitude."""
        return int(self.cross_flow.argmax())


@dataclass(frozen=True)
class MaterialFatigue:
    """Accumulated Miner damage per metre of rope material (`damage.py`), from the lower end up."""

    curve: str  # name of the S-N curve
    counted_s: float  # duration of the count
    from_lower_end_m: Vector  # middle of each metre, unstretched
    from_hang_off_m: Vector  # its present distance below the hang-off; negative: aboard
    used: Vector  # Miner damage D; 1: failure
    bending: bool  # whether bending stress is included

    @property
    def worst(self) -> int:
        """Index of the metre with the largest damage."""
        return int(self.used.argmax())
