"""Heave RAO of a ship: closed-form response of a box-like hull.

Source: Jensen, Mansour, Olsen 2004, Estimation of ship motions using closed-form expressions, Ocean
Engineering 31, 61-85. Heave w of a homogeneously loaded box, wave a·cos ωt at amidships:

    2·(kT/ω²)·ẅ + A²/(k·B·α³·ω)·ẇ + w = a·F·cos ωt
    F = κ·f·(2/(k_e·L))·sin(k_e·L/2),  κ = exp(−k_e·T),  f = √((1 − kT)² + (A²/(k·B·α³))²)
    A = 2·sin(k·B·α²/2)·exp(−k·T·α²),  k = ω²/g

Here at zero speed in head seas: α = 1, k_e = k, encounter frequency ω. B is breadth times block
coefficient, as in the paper for hulls that are not boxes. Amidships pitch causes no vertical
motion, so this is the motion of a hang-off there. Deep water; added mass equals the displaced mass
(hence 2·kT), excitation is in phase with the wave at amidships, no viscous damping: a model for
conceptual design that represents a hull of this size, not a specific ship.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.quantity import Quantity, quantity

_GRAVITY_M_PER_S2 = 9.80665


@dataclasses.dataclass(frozen=True, kw_only=True)
class BoxHull:
    """Hull dimensions; defaults are those of a medium-sized offshore construction vessel.

    Raises:
        InputError: a number out of its range.
    """

    length_m: float = quantity("waterline length", "m", 10.0, 500.0, default=120.0)
    breadth_m: float = quantity("waterline breadth", "m", 2.0, 100.0, default=23.0)
    draught_m: float = quantity("draught", "m", 0.5, 40.0, default=7.0)
    block_coefficient: float = quantity("block coefficient", "", 0.3, 1.0, default=0.7)

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            rule: Quantity = field.metadata["quantity"]
            value = getattr(self, field.name)
            if not rule.admits(value):
                raise InputError(
                    phrase(f"hull {field.name}", f"it is {value}", f"right is {rule.range_text()}")
                )

    def describe(self) -> str:
        """Return the response in one sentence, for the header of a bag."""
        return (
            "heave at amidships by the closed-form expressions of Jensen, Mansour, Olsen 2004, "
            f"head seas, zero speed, length {self.length_m:g} m, breadth {self.breadth_m:g} m, "
            f"draught {self.draught_m:g} m, block coefficient {self.block_coefficient:g}"
        )


def heave_response(hull: BoxHull, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return heave of the hang-off per metre of wave elevation there, for the factor exp(+iωt).

    Frequencies [Hz] above zero, any shape; the result has the same shape. |H| → 1 in long waves and
    → 0 in short ones; a negative angle means that heave lags the wave.
    """
    omega = 2.0 * np.pi * np.asarray(frequency_hz, dtype=np.float64)
    k = omega**2 / _GRAVITY_M_PER_S2
    draught = hull.draught_m
    breadth = hull.breadth_m * hull.block_coefficient
    radiated = 2.0 * np.sin(0.5 * k * breadth) * np.exp(-k * draught)  # A
    damping = radiated**2 / (k * breadth)
    along = np.sinc(0.5 * k * hull.length_m / np.pi)  # sin(x)/x
    force = np.exp(-k * draught) * np.sqrt((1.0 - k * draught) ** 2 + damping**2) * along
    return np.asarray(force / (1.0 - 2.0 * k * draught + 1j * damping))
