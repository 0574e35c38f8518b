"""Force-decomposition VIV model with amplitude-dependent added mass, and drag amplification.

[GE] Ge, Added mass effect on VIV for flexible risers (2018); [SJTU] thesis on ultra-slender
flexible structures, ch. 5. The component of the lift in phase with the velocity, C_Lv(A/D, f·D/U),
excites the rope where it is positive and damps it elsewhere; the component in antiphase with the
acceleration is an added mass C_a(A/D, f·D/U); both from a table (config/viv, its source is in its
header). A pre-analysis determines which mode each place excites and its natural frequency;
amplitude and frequency are measured from the running motion. All this is decoupled from the step,
on a mesh of its own (rope_twin.vortex.decomposed_response, rope_twin.vortex.coupled), and the
pre-analysis is repeated as tension and paid-out length change: elements and step of the scene need
not resolve it.

The feedback on the rope is in the step: the drag coefficient at each node is multiplied by 1 +
a·(2·rms/d)^b (Vandiver 1983: a = 1.043, b = 0.65), averaged over the rope that the node represents.
"""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.quantity import quantity, text
from rope_twin.vortex.drag_amplification import DragGrowthParams, build_growth
from rope_twin.vortex.shedding import LOCK_IN


@dataclass(frozen=True, kw_only=True)
class DecomposedForceParams(DragGrowthParams):
    """Published coefficients; structural damping, which [GE] does not give, as in [LCD]."""

    band: tuple[float, float] = quantity(
        "range of f·D/U of power-in (lock-in)", "", 0.02, 1.0, default=(0.125, 0.2)
    )
    lock_in: str = text("mode that a place excites: strongest or nearest", "strongest")
    added_mass: float | None = quantity(
        "constant C_a; default: variable, from the table", "", 0.0, 10.0, default=None
    )

    def check(self) -> str | None:
        """Return a fault of the band (ascending) or of lock_in, or None."""
        if self.lock_in not in LOCK_IN:
            return f"unknown lock_in '{self.lock_in}'; give one of {', '.join(LOCK_IN)}"
        if not self.band[0] < self.band[1]:
            return f"band from {self.band[0]:g} to {self.band[1]:g}; give the lower one first"
        return None


build = build_growth
