"""Hydrodynamics of the modal VIV model: lock-in, lift and damping as functions of amplitude.

[LCD] is Le Cunff and Durand (1999), who take lift and hydrodynamic damping from Venugopal (1996). A
mode of frequency f is locked in where the reduced velocity U/(f·d) lies in a band; there the lift
excites it, elsewhere the water damps it. Of several modes that are locked in at a place the one
nearest to its Strouhal frequency is excited ([LCD], section 2.1: "le mode en lock-in à une position
donnée de la structure est le mode le plus proche de la fréquence f_R"). Choices that the paper
leaves open, and the variants tried, are in docs/validation.md (L1, L2).

Mode competition, a variant of ours: of several locked-in modes the largest is excited. A place
that mode k is locked in over the fraction l_k is assigned to it by l_k·Π(1 - l_j·b_jk) over the
other modes j, with b_jk = 1 where j is larger, 0 where it is smaller; the result is scaled so that
all together receive the locked-in fraction 1 - Π(1 - l_j), which is already the sum where each b is
0 or 1. Two modes whose amplitudes agree within a factor of 1 + `tie` share: b varies smoothly from
0 to 1 with the logarithm of their ratio, so that assignments do not jump where one outgrows the
other.

A place excites a mode by the fraction of it over which the rule holds, so that nothing jumps where
the flow changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import log, pi, sqrt
from typing import Any

import numpy as np

from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.state import Floats

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
        difference = amplitude - self.largest_at
        low = (self.largest - self.at_rest) / self.largest_at**2
        high = self.largest / (self.zero - self.largest_at) ** 2
        return np.asarray(
            self.largest - np.where(difference < 0.0, low, high) * difference * difference
        )


def nearest_zones(frequency: Floats, shedding: Floats, locked: Floats, moved: Floats) -> Floats:
    """Assign each place to the mode nearest to its Strouhal frequency, if that is locked in."""
    if not len(frequency):
        return locked
    nearer_below = parts_below(shedding, 0.5 * (frequency[1:] + frequency[:-1]))
    zeros, ones = np.zeros((len(shedding), 1)), np.ones((len(shedding), 1))
    nearest = np.diff(np.concatenate([zeros, nearer_below, ones], axis=1), axis=1)
    return np.minimum(nearest, locked)


def leading_zones(frequency: Floats, shedding: Floats, locked: Floats, moved: Floats) -> Floats:
    """Assign its whole band to the mode with the largest response, the remainder to the next.

    The response is estimated with each place exciting the two modes adjacent to its Strouhal
    frequency, the nearer one more.
    """
    if not len(frequency):
        return locked
    mode_number = np.interp(shedding, frequency, np.arange(len(frequency)))
    lower, points = mode_number.astype(int), np.arange(len(shedding))
    upper, nearer = np.minimum(lower + 1, len(frequency) - 1), mode_number - lower
    response = np.zeros(len(frequency))
    for mode, weight in ((lower, 1.0 - nearer), (upper, nearer)):
        contribution = weight * moved[points, mode] * locked[points, mode]
        response += np.bincount(mode, contribution, len(frequency))
    return share_out(response, locked, TIE)


# f(mode frequencies, shedding frequencies of the places, fraction of each place with lock-in of a
# mode, displacement of a mode by a place over C_l [m], (places, modes)) -> fraction of each place
# that excites a mode.
Zones = Callable[[Floats, Floats, Floats, Floats], Floats]
LOCK_IN: dict[str, Zones] = {"nearest": nearest_zones, "strongest": leading_zones}


@dataclass(frozen=True)
class Shedding:
    """Parameters of the hydrodynamic side of the modal VIV model."""

    strouhal: float = 0.17
    band: tuple[float, float] = (5.0, 7.0)  # lock-in range of U/(f·d)
    density: float = 1025.0  # [kg/m³]
    viscosity: float = 1.3e-6  # [m²/s]
    structural: float = 0.0075  # damping ratio of every mode: [LCD] 1.5 %, as a loss factor
    lift: Callable[[Floats], Floats] = Lift()
    factor: float = 1.0  # C_c of the lift, for phase and extent of the excited zone; not printed
    zones: Zones = nearest_zones

    def still_water(self, omega: Floats, diameter: Floats) -> tuple[Floats, Floats]:
        """Return damping per metre in still water, c0 + c2·(A/d)² [N·s/m²]; (places, modes)."""
        d = diameter[:, None]
        factor = 0.5 * pi * self.density * d
        return factor * (STILL_SQUARE * np.sqrt(omega * self.viscosity)), factor * d * (
            STILL * omega
        )

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
        rate = 2.0 * pi * speed / diameter
        up_to = parts_below(rate, self.band[1] * omega)
        return parts_below(rate, self.band[0] * omega), 1.0 - up_to


def share_out(strength: Floats, locked: Floats, tie: float) -> Floats:
    """Return the fraction of each place assigned to each mode, 0 to 1, (places, modes).

    strength: amplitude of the modes (0: assigned nothing); locked: fraction of each place with
    lock-in of a mode.
    """
    assigned, larger = np.zeros_like(locked), np.zeros((len(strength), len(strength)))
    _share_out(np.ascontiguousarray(strength), locked, log(1.0 + tie), larger, assigned)
    return assigned


@jit_entry
def _share_out(strength: Any, locked: Any, width: float, larger: Any, assigned: Any) -> None:
    modes = strength.shape[0]
    for j in range(modes):
        for k in range(modes):
            larger[j, k] = 0.0 if j == k else _larger(strength[j], strength[k], width)
    for p in range(locked.shape[0]):
        first, last = modes, -1
        for k in range(modes):
            if locked[p, k] > 0.0 and strength[k] > 0.0:
                first, last = min(first, k), k
        unlocked, total = 1.0, 0.0
        for k in range(first, last + 1):
            if strength[k] > 0.0:
                claim = locked[p, k]
                unlocked *= 1.0 - claim
                for j in range(first, last + 1):
                    claim *= 1.0 - locked[p, j] * larger[j, k]
                assigned[p, k] = claim
                total += claim
        for k in range(first, last + 1):
            assigned[p, k] *= (1.0 - unlocked) / total


@jit
def _larger(first: float, second: float, width: float) -> float:
    """Return 1 where one is larger than the other, 0 where it is smaller, smooth within a tie."""
    if first <= 0.0 or second <= 0.0:
        return 0.0
    x = log(first / second) / width
    if x <= -1.0:
        return 0.0
    if x >= 1.0:
        return 1.0
    return 0.5 + x * (0.75 - 0.25 * x * x)


def parts_below(values: Floats, limits: Floats) -> Floats:
    """Return the fraction of each place where `values`, linear between places, are below a limit.

    A place extends halfway to its neighbours. Result: (places, limits).
    """
    ends = np.concatenate([values[:1], 0.5 * (values[1:] + values[:-1]), values[-1:]])
    low, high = np.minimum(ends[1:], ends[:-1]), np.maximum(ends[1:], ends[:-1])
    fractions = np.empty((len(values), len(limits)))
    _parts_below(low, high, np.ascontiguousarray(limits), fractions)
    return fractions


@jit_entry
def _parts_below(low: Any, high: Any, limits: Any, fractions: Any) -> None:
    for p in range(low.shape[0]):
        width = high[p] - low[p]
        for k in range(limits.shape[0]):
            above = limits[k] - low[p]
            if above <= 0.0:
                fractions[p, k] = 0.0
            else:
                fractions[p, k] = 1.0 if above >= width else above / width
