"""Modal VIV model: cross-flow vibration in natural modes, and drag amplification.

[LCD] Le Cunff and Durand (1999), eqs 1-9: the natural modes of the rope in its present shape are
locked in where U/(f·d) lies in a band; there the lift C_c·C_l(A/d) excites them (two parabolas,
Venugopal 1996), elsewhere the water damps them. A place excites the mode nearest to its shedding
frequency (`lock_in: nearest`, the rule that the paper prints) or, of those locked in there, the one
with the largest response (`strongest`). The response is decoupled from the step, on a mesh
of its own (rope_twin.vortex.modal_response, rope_twin.vortex.coupled), with the modal analysis
repeated as tension and paid-out length change: elements and step of the scene need not resolve it.

The feedback on the rope is in the step: the drag coefficient at each node is multiplied by 1 +
a·(2·rms/d)^b (Vandiver 1983: a = 1.043, b = 0.65), averaged over the rope that the node represents.
"""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.quantity import quantity, text
from rope_twin.vortex.drag_amplification import DragGrowthParams, build_growth
from rope_twin.vortex.shedding import LOCK_IN


@dataclass(frozen=True, kw_only=True)
class ModalVibrationParams(DragGrowthParams):
    """Published coefficients; lift by Venugopal (1996), drag amplification by Vandiver (1983)."""

    damping_fraction: float = quantity(
        "structural damping ratio of every mode; 1.5 % of the paper is read as a loss factor", "",
        0.0, 0.5, default=0.0075,
    )  # fmt: skip
    strouhal: float = quantity("Strouhal number St", "", 0.05, 0.5, default=0.17)
    band: tuple[float, float] = quantity(
        "lock-in range of the reduced velocity U/(f·d)", "", 1.0, 30.0, default=(5.0, 7.0)
    )
    lift: tuple[float, float] = quantity(
        "C_l at zero amplitude, and its maximum", "", 0.0, 3.0, default=(0.3, 0.7)
    )
    lift_at: tuple[float, float] = quantity(
        "A/d at the maximum of C_l, and at C_l = 0", "", 0.01, 10.0, default=(0.5, 1.0)
    )
    lift_factor: float = quantity(
        "factor C_c of the lift, for its phase and the extent of the excited zone", "", 0.01, 1.0,
        default=1.0,
    )  # fmt: skip
    lock_in: str = text("mode that a place excites: nearest or strongest", "nearest")
    viscosity_m2_per_s: float = quantity(
        "kinematic viscosity ν of water", "m²/s", 1e-7, 1e-4, default=1.3e-6
    )

    def check(self) -> str | None:
        """Return a fault of band or lift_at (ascending) or of lock_in, or None."""
        if self.lock_in not in LOCK_IN:
            return f"unknown lock_in '{self.lock_in}'; give one of {', '.join(LOCK_IN)}"
        if not self.band[0] < self.band[1]:
            return f"band from {self.band[0]:g} to {self.band[1]:g}; give the lower one first"
        if not self.lift_at[0] < self.lift_at[1]:
            return f"lift_at {self.lift_at[0]:g} and {self.lift_at[1]:g}; give the lower one first"
        return None

    @property
    def strouhal_number(self) -> float:
        """Return the Strouhal number of the vortex shedding."""
        return self.strouhal


build = build_growth
