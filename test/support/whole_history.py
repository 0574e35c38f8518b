"""Reference fatigue damage by the rainflow package, from the whole history of every metre."""

from __future__ import annotations

import numpy as np
import rainflow

from rope_twin.core.state import Floats
from rope_twin.twin.snapshot import Snapshot
from rope_twin.vortex.fatigue import Cycles, StressCurve, Vector
from rope_twin.vortex.results import tension_along


def count_cycles(series: Vector) -> Cycles:
    """Return the cycles of a series (ASTM E1049-85, 5.4.4); the residue as half cycles."""
    changes = np.concatenate(([True], np.diff(series) != 0.0)) if len(series) else series > 0.0
    points = series[changes].tolist()
    # the last value twice: of a series of two the package would not see the second
    extracted = list(rainflow.extract_cycles([*points, *points[-1:]]))
    table = np.array([cycle[:3] for cycle in extracted], float).reshape(-1, 3)
    return Cycles(*table[table[:, 0] > 0.0].T)


class WholeHistory:
    """Stress of every metre of an all-steel rope below a winch, at each snapshot taken."""

    def __init__(self, length_m: float, area_m2: float, over_sheave_pa: float = 0.0) -> None:
        self.middles = np.arange(round(length_m)) + 0.5
        self._area_m2, self._over_sheave_pa = area_m2, over_sheave_pa
        self._aboard: Floats | None = None
        self._rows: list[Floats] = []

    def take(self, seen: Snapshot) -> None:
        """Take the first rope of a snapshot; a metre that passed the sheave was bent there."""
        from_lower_m = (seen.arc_length_m[-1] - seen.arc_length_m)[::-1]
        tension, top_n = seen.element_tension_n[::-1], seen.tension_top_n
        places, values = tension_along(from_lower_m, tension, top_n)
        aboard = self.middles > from_lower_m[-1]
        if self._aboard is not None and self._over_sheave_pa > 0.0:
            straight = np.where(aboard != self._aboard, top_n / self._area_m2, np.nan)
            self._rows += [straight, straight + self._over_sheave_pa, straight]
        self._aboard = aboard
        stress = np.interp(self.middles, places, values, right=np.nan) / self._area_m2
        self._rows.append(stress)

    def damage(self, curve: StressCurve) -> Vector:
        """Return Miner's sum of each metre."""
        histories = np.array(self._rows).T
        cycles = [count_cycles(history[~np.isnan(history)]) for history in histories]
        return np.array([curve.used(counted).sum() for counted in cycles])
