"""What the water does to a rope that its vortices shake: lock-in, lift and damping by amplitude.

[LCD] is Le Cunff and Durand (1999), who take lift and hydrodynamic damping from Venugopal (1996).
A mode of frequency f is locked in where the reduced velocity U/(f·d) lies in a band; there the
lift drives it, elsewhere the water damps it. What [LCD] leaves open, and the variants tried, stands
in docs/validation.md (L1, L2): with the band and zones here both of its largest amplitudes are met.
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
TIE = 0.1  # modes that differ by less share a place

STILL, STILL_SQUARE, SLOW, FAST = 0.25, 2.0 * sqrt(2.0), 0.18, 0.2  # Venugopal (1996)


@dataclass(frozen=True)
class Lift:
    """C_l(A/d) of two parabolas that meet at the largest; beyond `zero` it takes power.

    The shape is Venugopal's (1996), as SHEAR7 has used it: from C_l at rest to the largest and
    down through zero. His table is not in public material; the corner points here are the ones
    usually told of it.
    """

    at_rest: float = 0.3
    largest: float = 0.7
    largest_at: float = 0.5  # [d]
    zero: float = 1.0  # [d]

    def __call__(self, amplitude: Floats) -> Floats:
        """C_l at an amplitude in diameters."""
        off = amplitude - self.largest_at
        low = (self.largest - self.at_rest) / self.largest_at**2
        high = self.largest / (self.zero - self.largest_at) ** 2
        return np.asarray(self.largest - np.where(off < 0.0, low, high) * off * off)


def nearest_zones(frequency: Floats, shedding: Floats, locked: Floats, moved: Floats) -> Floats:
    """Each place drives the mode nearest to its Strouhal frequency, if that one is locked in."""
    if not len(frequency):
        return locked
    nearer_below = parts_below(shedding, 0.5 * (frequency[1:] + frequency[:-1]))
    none, whole = np.zeros((len(shedding), 1)), np.ones((len(shedding), 1))
    near = np.diff(np.concatenate([none, nearer_below, whole], axis=1), axis=1)
    return np.minimum(near, locked)


def all_zones(frequency: Floats, shedding: Floats, locked: Floats, moved: Floats) -> Floats:
    """Each place drives every mode that is locked in there."""
    return locked


def dominant_zones(frequency: Floats, shedding: Floats, locked: Floats, moved: Floats) -> Floats:
    """The mode with most shedding near it (by f_s³) takes its whole band, the next what is left."""
    near = nearest_zones(frequency, shedding, locked, moved)
    return share_out((shedding[:, None] ** 3 * near).sum(axis=0), locked, TIE)


def leading_zones(frequency: Floats, shedding: Floats, locked: Floats, moved: Floats) -> Floats:
    """The mode that moves most takes its whole band, the next what is left.

    Which that is tells a response in which each place drives the two modes that its Strouhal
    frequency lies between, the nearer one more.
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


# Of the modes' frequencies, the places' own of shedding, the part of each place that a mode is
# locked in over, and how far a place that drives a mode moves it, over C_l [m], (places, modes):
# the part of each place that drives a mode.
Zones = Callable[[Floats, Floats, Floats, Floats], Floats]


@dataclass(frozen=True)
class Shedding:
    """Everything that the water's side of the modal approach needs."""

    strouhal: float = 0.17
    band: tuple[float, float] = (5.0, 7.0)  # of U/(f·d) in which a mode is locked in
    density: float = 1025.0  # [kg/m³]
    viscosity: float = 1.3e-6  # [m²/s]
    structural: float = 0.015  # of critical, of every mode
    lift: Callable[[Floats], Floats] = Lift()
    zones: Zones = leading_zones

    def still_water(self, omega: Floats, diameter: Floats) -> tuple[Floats, Floats]:
        """Damping per metre in still water, c0 + c2·(A/d)² [N·s/m²]; (places, modes)."""
        d = diameter[:, None]
        own = 0.5 * pi * self.density * d
        return own * (STILL_SQUARE * np.sqrt(omega * self.viscosity)), own * d * (STILL * omega)

    def damping(
        self, omega: Floats, diameter: Floats, speed: Floats, below: Floats, above: Floats
    ) -> tuple[Floats, Floats]:
        """Damping per metre outside the band, c0 + c2·(A/d)² [N·s/m²]; (places, modes).

        Below it still water's and 0.18·ρ·d·U, above it 0.2·ρ·U²/ω (Venugopal 1996); `below`,
        `above`: the parts of the places that are.
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
        """Parts of places at which U/(f·d) is below the band, and above; (places, modes).

        Elsewhere modes are locked in.
        """
        turned = 2.0 * pi * speed / diameter
        up_to = parts_below(turned, self.band[1] * omega)
        return parts_below(turned, self.band[0] * omega), 1.0 - up_to
