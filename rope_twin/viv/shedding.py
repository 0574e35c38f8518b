"""Hydrodynamics of the modal VIV model: lock-in, lift and damping as functions of amplitude.

[LCD] is Le Cunff and Durand (1999), who take lift and hydrodynamic damping from Venugopal (1996). A
mode of frequency f is locked in where the reduced velocity U/(f·d) lies in a band; there the lift
excites it, elsewhere the water damps it. Choices that [LCD] leaves open, and the variants tried,
are in docs/validation.md (L1, L2): with this band and these zones both of its largest amplitudes
are reproduced.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from rope_twin.core.modes.sharing import parts_below, share_out
from rope_twin.viv.span import Floats

Mask = NDArray[np.bool_]
TIE = 0.1  # relative difference of response below which modes share a place

STILL, STILL_SQUARE, SLOW, FAST = 0.25, 2.0 * sqrt(2.0), 0.18, 0.2  # Venugopal (1996)


@dataclass(frozen=True)
class Lift:
    """C_l(A/d) of two parabolas that meet at the maximum; negative beyond `zero`.

    The shape is Venugopal's (1996), as used by SHEAR7: from C_l at zero amplitude to the maximum
    and down through zero. His table is not public; the corner points here are commonly quoted
    values.
    """

    at_rest: float = 0.3
    largest: float = 0.7
    largest_at: float = 0.5  # [d]
    zero: float = 1.0  # [d]

    def __call__(self, amplitude: Floats) -> Floats:
        """Return C_l at an amplitude in diameters."""
        off = amplitude - self.largest_at
        low = (self.largest - self.at_rest) / self.largest_at**2
        high = self.largest / (self.zero - self.largest_at) ** 2
        return np.asarray(self.largest - np.where(off < 0.0, low, high) * off * off)


def nearest_zones(frequency: Floats, shedding: Floats, locked: Floats, moved: Floats) -> Floats:
    """Assign each place to the mode nearest to its Strouhal frequency, if it is locked in."""
    if not len(frequency):
        return locked
    nearer_below = parts_below(shedding, 0.5 * (frequency[1:] + frequency[:-1]))
    none, whole = np.zeros((len(shedding), 1)), np.ones((len(shedding), 1))
    near = np.diff(np.concatenate([none, nearer_below, whole], axis=1), axis=1)
    return np.minimum(near, locked)


def all_zones(frequency: Floats, shedding: Floats, locked: Floats, moved: Floats) -> Floats:
    """Assign each place to every mode that is locked in there."""
    return locked


def dominant_zones(frequency: Floats, shedding: Floats, locked: Floats, moved: Floats) -> Floats:
    """Assign its band to the mode with most shedding near it (by f_s³), the rest to the next."""
    near = nearest_zones(frequency, shedding, locked, moved)
    return share_out((shedding[:, None] ** 3 * near).sum(axis=0), locked, TIE)


def leading_zones(frequency: Floats, shedding: Floats, locked: Floats, moved: Floats) -> Floats:
    """Assign its whole band to the mode with the largest response, the remainder to the next.

    The response is estimated with each place exciting the two modes adjacent to its Strouhal
    frequency, the nearer one more.
    """
    if not len(frequency):
        return locked
    between = np.interp(shedding, frequency, np.arange(len(frequency)))
    lower, place = between.astype(int), np.arange(len(shedding))
    upper, nearer = np.minimum(lower + 1, len(frequency) - 1), between - lower
    size = np.zeros(len(frequency))
    for mode, share in ((lower, 1.0 - nearer), (upper, nearer)):
        feeds = share * moved[place, mode] * locked[place, mode]
        size += np.bincount(mode, feeds, len(frequency))
    return share_out(size, locked, TIE)


# f(mode frequencies, shedding frequencies of the places, fraction of each place with lock-in of a
# mode, displacement of a mode by a place over C_l [m], (places, modes)) -> fraction of each place
# that excites a mode.
Zones = Callable[[Floats, Floats, Floats, Floats], Floats]


@dataclass(frozen=True)
class Shedding:
    """Parameters of the hydrodynamic side of the modal VIV model."""

    strouhal: float = 0.17
    band: tuple[float, float] = (5.0, 7.0)  # lock-in range of U/(f·d)
    density: float = 1025.0  # [kg/m³]
    viscosity: float = 1.3e-6  # [m²/s]
    structural: float = 0.015  # damping ratio of every mode
    lift: Callable[[Floats], Floats] = Lift()
    zones: Zones = leading_zones

    def still_water(self, omega: Floats, diameter: Floats) -> tuple[Floats, Floats]:
        """Return damping per metre in still water, c0 + c2·(A/d)² [N·s/m²]; (places, modes)."""
        d = diameter[:, None]
        own = 0.5 * pi * self.density * d
        return own * (STILL_SQUARE * np.sqrt(omega * self.viscosity)), own * d * (STILL * omega)

    def damping(
        self, omega: Floats, diameter: Floats, speed: Floats, below: Floats, above: Floats
    ) -> tuple[Floats, Floats]:
        """Return damping per metre outside the band, c0 + c2·(A/d)² [N·s/m²]; (places, modes).

        Below the band that of still water plus 0.18·ρ·d·U, above it 0.2·ρ·U²/ω (Venugopal 1996);
        `below`, `above`: the respective fractions of the places.
        """
        U, d = speed[:, None], diameter[:, None]
        c0, c2 = self.still_water(omega, diameter)
        c0 += SLOW * self.density * d * U
        c0 *= below
        c0 += above * (FAST * self.density * U * U / omega)
        return c0, below * c2

    def below_and_above(
        self, omega: Floats, diameter: Floats, speed: Floats
    ) -> tuple[Floats, Floats]:
        """Return fractions of places with U/(f·d) below and above the band; (places, modes).

        Elsewhere modes are locked in.
        """
        turned = 2.0 * pi * speed / diameter
        up_to = parts_below(turned, self.band[1] * omega)
        return parts_below(turned, self.band[0] * omega), 1.0 - up_to
