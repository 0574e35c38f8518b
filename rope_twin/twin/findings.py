"""What a run finds out where it is asked to: energy balance, error band, vibration, fatigue."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
LITTLE = 1e-4


@dataclass(frozen=True)
class EnergyBalance:
    """Energy of rope and payload, and where it came from and went to since the count began [J].

    change = hang_off + passing + water - damped - residual.
    """

    since_s: float  # twin time at which the count began
    kinetic_j: float  # now, with the added mass
    elastic_j: float
    potential_j: float  # weight less buoyancy, 0 at the mean water level
    change_j: float  # of the sum of these three
    hang_off_j: float  # work of ship and winch: force times the material's velocity
    passing_j: float  # brought by rope that was paid out, less what hauled rope took away
    water_j: float  # work of the water: drag, mostly negative
    damped_j: float  # dissipated by the axial damper
    residual_j: float  # the rest: dissipated numerically if positive
    exchanged_j: float  # energy that went from any one of these accounts to another

    @property
    def residual_pct(self) -> float:
        """The residual in per cent of the energy exchanged.

        While little was (a rope at rest, or just set in motion), of a ten-thousandth of what is
        there: a residual is then round-off of that, or of how the work of few steps is summed.
        """
        there = abs(self.kinetic_j) + abs(self.elastic_j) + abs(self.potential_j)
        beside = max(self.exchanged_j, LITTLE * there)
        return 100.0 * self.residual_j / beside if beside > 0.0 else 0.0

    def figures(self) -> dict[str, float]:
        """All of it by name, with the residual in per cent."""
        return {**asdict(self), "residual_pct": self.residual_pct}


@dataclass(frozen=True)
class TensionBand:
    """Where the top tension of a converged solution lies, 95 % of the time (`error_band.py`)."""

    low_n: float
    high_n: float
    bound_n: float  # of the error of tension_top_n; low_n is not below 0
    cost_pct: float  # time that the band has taken, of the time that all else took


@dataclass(frozen=True)
class RopeVibration:
    """How the rope shakes (twin/vibration/in_modes.py). Rows run from the hang-off (row 0) down.

    An amplitude is √2 times the rms over some periods, over the rope's diameter.
    """

    model: str  # "motion": the twin's own; "modes", "decomposed": computed beside it
    cross_flow: Vector  # amplitude across current and rope [diameters], (nodes,)
    cross_flow_hz: Vector  # its frequency; 0 where nothing moves, (nodes,)
    in_line: Vector | None  # likewise with the current; None: the model has no such motion
    in_line_hz: Vector | None
    drag_amplification: Vector  # what it multiplies the rope's mean drag by; 1: none, (nodes,)
    every_s: float  # how often a model beside the twin finds the rope's modes again; 0: it has none
    solves: int  # how often it has
    note: str  # one sentence if the modes could not be found again
    cost_pct: float = 0.0  # time that watching the rope has taken, of the twin's time

    @property
    def worst(self) -> int:
        """The node that moves most."""
        return int(self.cross_flow.argmax())


@dataclass(frozen=True)
class MaterialFatigue:
    """Fatigue used of each metre of the rope's material (`wear.py`), from the lower end up."""

    curve: str  # name of the S-N curve
    counted_s: float  # over this time
    from_lower_end_m: Vector  # middle of each metre, unstretched
    from_hang_off_m: Vector  # where that is now; negative: aboard
    used: Vector  # Miner's sum; 1: it breaks
    bending: bool  # with the stress of bending

    @property
    def worst(self) -> int:
        """The metre that has used most."""
        return int(self.used.argmax())
