"""Bends of a rope's material over sheaves and drum, and the life that they use.

Where a sheave begins and where it ends, and where the rope meets the drum, its curvature changes:
material that passes such a place is bent or straightened, half a cycle. A passage over a whole
sheave is a cycle; material that turns back on the sheave has one too, and material that moves to
and fro within the arc of contact none. The places are at fixed distances inboard of the hang-off.

Life (Miner 1945, each half cycle uses 1/(2·N)): N = 10^a·(T/MBL)^-m·((D/d)/(D/d)_0)^k, the straight
line of log N over log T that cyclic bend-over-sheave tests are reported by, all constants from the
rope's maker. T is the tension at the hang-off, on all sheaves.

Material is followed at points 0.1 m apart; a piece (a metre in runs) has the count of its most bent
point, since heave compensation runs lengths below a metre to and fro.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
SPACING_M = 0.1  # of the points of material
HALF = 0.5  # cycle at each change of curvature


class Layers(Protocol):
    """Layers of rope on a drum, as in rope_twin.scene.winch."""

    def radius_m(self, layer: int, diameter_m: float) -> float: ...
    def layer_of(self, stored_m: float, diameter_m: float) -> int: ...


class BendPlace(NamedTuple):
    """A place inboard of the hang-off where the curvature of the rope changes."""

    inboard_m: float  # distance along the rope from the hang-off
    diameter_m: float  # D of the groove; of a drum that of the bare drum
    weight: float  # cycles that a passage over the whole sheave counts as
    drum: Layers | None = None  # its layers, if it is a drum


class Endurance(NamedTuple):
    """Constants of a section's life in bending, and its discard value."""

    diameter_m: float
    breaking_load_n: float
    log10_a: float | None = None  # None: no life is known
    exponent: float = 0.0  # m
    d_ratio: float = 1.0  # (D/d)_0
    d_ratio_exponent: float = 0.0  # k
    discard_bends: float | None = None
    source: str = ""

    def used(self, tension_n: float, diameter_m: float) -> float:
        """Return 1/N of a cycle at a tension [N] over a diameter D [m]; 0 without tension."""
        if self.log10_a is None or tension_n <= 0.0:
            return 0.0
        ratio = diameter_m / self.diameter_m / self.d_ratio
        load = tension_n / self.breaking_load_n
        return float(load**self.exponent / (10.0**self.log10_a * ratio**self.d_ratio_exponent))


@dataclass(frozen=True)
class BendResult:
    """Bends of each metre of a rope, from the lower end up."""

    bends: Vector  # cycles
    damage: Vector  # Miner's sum; NaN: no life is known
    discard: Vector  # cycles over the discard value; NaN: none is given
    source: str  # of the constants


def reach_m(path: Sequence[BendPlace]) -> float:
    """Return the distance from the hang-off to the furthest place [m]; 0: there is none."""
    return max((place.inboard_m for place in path), default=0.0)


class BendCount:
    """Bends and Miner's sum of points of material; the sum does not depend on the sampling.

    All that turns back within a sample is lost: samples must resolve the winch's motion.
    """

    def __init__(
        self,
        path: Sequence[BendPlace],
        sections: Sequence[Endurance],
        section_of: NDArray[np.int64],
        piece_m: float,
        whole_m: float,
    ) -> None:
        """Start without bends.

        section_of: section of each piece of the count, from the lower end up, (pieces,); piece_m:
        its length; whole_m: rope out when the drum is empty.
        """
        self.path, self.sections = tuple(path), tuple(sections)
        self._points = max(1, round(piece_m / SPACING_M))  # in a piece
        self._section = np.repeat(section_of, self._points)
        self._spacing, self._whole_m = piece_m / self._points, whole_m
        self.bends, self.damage = np.zeros((2, len(self._section)))
        self._at = np.full(len(self.path), -1)  # points below each place; -1: not known yet

    def take(self, top_m: float, tension_n: float) -> None:
        """Take the material coordinate at the hang-off [m] and the tension there [N]."""
        for number, place in enumerate(self.path):
            # points at (k + 0.5)·spacing; one that is exactly at the place is above it
            below = ceil((top_m + place.inboard_m) / self._spacing - 0.5)
            now, before = min(max(below, 0), len(self.bends)), int(self._at[number])
            self._at[number] = now
            if before in (now, -1):
                continue
            passed = slice(min(now, before), max(now, before))
            half = HALF * place.weight
            self.bends[passed] += half
            used = np.array([own.used(tension_n, self._bent(place, top_m, own.diameter_m))
                             for own in self.sections])  # fmt: skip
            self.damage[passed] += half * used[self._section[passed]]

    def _bent(self, place: BendPlace, top_m: float, diameter_m: float) -> float:
        """Return the diameter below the rope [m], of a drum that of its present layer."""
        if place.drum is None:
            return place.diameter_m
        stored_m = max(self._whole_m - top_m, 0.0)
        layer = place.drum.layer_of(stored_m, diameter_m)
        return 2.0 * place.drum.radius_m(layer, diameter_m) - diameter_m

    def result(self) -> BendResult:
        """Return the bends of each piece, which are those of its most bent point."""
        first = self._section[:: self._points]
        known = np.array([own.log10_a is not None for own in self.sections])
        discard = np.array([own.discard_bends or np.nan for own in self.sections])
        bends, damage = (
            part.reshape(-1, self._points).max(axis=1) for part in (self.bends, self.damage)
        )
        sources = dict.fromkeys(own.source for own in self.sections if own.source)
        return BendResult(
            bends, np.where(known[first], damage, np.nan), bends / discard[first],
            "; ".join(sources),
        )  # fmt: skip
