"""Vibration in natural modes: vortices that shake the rope across the current, and its drag then.

[LCD] Le Cunff and Durand (1999), eqs 1-9: the natural modes of the rope as it hangs are locked in
where U/(f·d) lies in a band; there the lift C_l(A/d) drives them (two parabolas, Venugopal 1996),
elsewhere the water damps them. The response is computed beside the step, on places of its own
(rope_twin.viv.modal_response, rope_twin.twin.vibration.drag_amplification), with modes found
again as tension and line out change: elements and step of the scene need not resolve it.

What it does to the rope is in the step: the drag coefficient at each node grows by
a·(2·rms/d)^b (Vandiver 1983: a = 1.043, b = 0.65), the mean of the rope that the node stands for.
"""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.core.vortices.drag_growth import DragGrowthParams, build_growth
from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class ModalVibrationParams(DragGrowthParams):
    """The published figures; lift and growth of the drag are of Venugopal and Vandiver."""

    strouhal: float = quantity("Strouhal number St", "", 0.05, 0.5, default=0.17)
    band: tuple[float, float] = quantity(
        "U/(f·d) between which a mode is locked in", "", 1.0, 30.0, default=(5.0, 7.0)
    )
    lift: tuple[float, float] = quantity(
        "C_l of a rope that keeps still, and the largest", "", 0.0, 3.0, default=(0.3, 0.7)
    )
    lift_at: tuple[float, float] = quantity(
        "A/d at the largest C_l, and where C_l ends", "", 0.01, 10.0, default=(0.5, 1.0)
    )
    viscosity_m2_per_s: float = quantity("of the water, ν", "m²/s", 1e-7, 1e-4, default=1.3e-6)

    def check(self) -> str | None:
        """A band and a lift that rise."""
        if not self.band[0] < self.band[1]:
            return f"band from {self.band[0]:g} to {self.band[1]:g}; give the lower one first"
        if not self.lift_at[0] < self.lift_at[1]:
            return f"lift_at {self.lift_at[0]:g} and {self.lift_at[1]:g}; give the lower one first"
        return None

    @property
    def strouhal_number(self) -> float:
        """What sets the pace of the vortices."""
        return self.strouhal


build = build_growth
