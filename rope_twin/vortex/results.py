"""Results of the vibration and fatigue analyses of a run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rope_twin.vortex.bends import BendResult

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class RopeVibration:
    """VIV response along the rope; rows run from the hang-off (row 0) down.

    An amplitude is √2 times the rms over some periods, divided by the rope's diameter.
    """

    model: str  # "time-domain": measured in the twin; else the loosely coupled model
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

    def upside_down(self) -> RopeVibration:
        """Return the response with its rows in reverse order."""
        return replace(
            self,
            cross_flow=self.cross_flow[::-1].copy(),
            cross_flow_hz=self.cross_flow_hz[::-1].copy(),
            in_line=None if self.in_line is None else self.in_line[::-1].copy(),
            in_line_hz=None if self.in_line_hz is None else self.in_line_hz[::-1].copy(),
            drag_amplification=self.drag_amplification[::-1].copy(),
        )


@dataclass(frozen=True)
class MaterialFatigue:
    """Accumulated Miner damage per metre of rope material (`damage.py`), from the lower end up."""

    curve: str  # name of the S-N curve
    counted_s: float  # duration of the count
    from_lower_end_m: Vector  # middle of each metre, unstretched
    from_hang_off_m: Vector  # its present distance below the hang-off; negative: aboard
    used: Vector  # Miner damage D; 1: failure
    bending: bool  # whether bending stress is included
    bent: BendResult | None = None  # bends over sheaves and drum; None: the rope has none

    @property
    def worst(self) -> int:
        """Index of the metre with the largest damage."""
        return int(self.used.argmax())

    @property
    def most_bent(self) -> int:
        """Index of the metre with the largest bending damage, else with the most bends."""
        assert self.bent is not None
        known = np.nan_to_num(self.bent.damage)
        return int((known if known.any() else self.bent.bends).argmax())
