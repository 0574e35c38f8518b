"""Forces of vortices taken apart in phase, with varying added mass, and the drag of the rope then.

[GE] Ge, Added mass effect on VIV for flexible risers (2018); [SJTU] thesis on ultra-slender
flexible structures, ch. 5. The part of the lift in phase with the motion, C_Lv(A/D, f·D/U), drives
the rope where it is positive and damps it elsewhere, the part against it is an added mass
C_a(A/D, f·D/U); both from a table (config/viv, whose head tells where it comes from). A
pre-analysis tells which mode each place drives and at which true frequency; amplitude and frequency
are read from the running motion. All this is computed beside the step, on places of its own
(rope_twin.viv.decomposed_response, rope_twin.twin.vibration.drag_amplification), and the
pre-analysis is made again as tension and line out change: elements and step of the scene need not
resolve it.

What it does to the rope is in the step: the drag coefficient at each node grows by
a·(2·rms/d)^b (Vandiver 1983: a = 1.043, b = 0.65), the mean of the rope that the node stands for.
"""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.core.vortices.drag_growth import DragGrowthParams, build_growth
from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class DecomposedForceParams(DragGrowthParams):
    """The published figures; structural damping, which [GE] does not print, is as in [LCD]."""

    band: tuple[float, float] = quantity(
        "f·D/U between which a mode can be locked in", "", 0.02, 1.0, default=(0.125, 0.2)
    )
    added_mass: float | None = quantity(
        "C_a everywhere; absent: that of the table, which varies", "", 0.0, 10.0, default=None
    )

    def check(self) -> str | None:
        """A band that rises."""
        if not self.band[0] < self.band[1]:
            return f"band from {self.band[0]:g} to {self.band[1]:g}; give the lower one first"
        return None


build = build_growth
