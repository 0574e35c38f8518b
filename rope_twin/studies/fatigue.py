"""Fatigue along a rope: rainflow counting of each piece of its material, and what damage that does.

The pieces belong to the material: each has its distance from the lower end and keeps it while the
winch pays out or hauls in. A piece that is aboard meets no tension of the sea: its history stands
still until it comes out again. Bending over the sheave is not counted, only tension.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import rainflow
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.scene.composite import ends_m
from rope_twin.scene.schema import Rope, RopeLine
from rope_twin.twin.snapshot import Snapshot

Vector = NDArray[np.float64]
STEEL_KG_PER_M3 = 7850.0
ALL_STEEL_KG_PER_M3 = 7000.0  # mass over displaced volume; less: fibre, or much that is not steel
SAMPLES_KEPT = 2048  # of every piece, before they are reduced to where they turn


@dataclass(frozen=True)
class Cycles:
    """Cycles of a load, each array (cycles,)."""

    range: Vector  # from trough to crest
    mean: Vector
    count: Vector  # 1, or 0.5 for a half cycle


@dataclass(frozen=True)
class Strength:
    """What a curve needs to know of a rope."""

    metal_area_m2: float  # NaN: it is not all of steel
    breaking_load_n: float


class Curve(Protocol):
    """How many cycles a rope endures."""

    def damage(self, cycles: Cycles, strength: Strength) -> float:
        """Miner's sum of cycles of tension [N]; 1: it breaks."""


@dataclass(frozen=True)
class StressCurve:
    """N = constant·S^-exponent, S the range of stress on the metal area [MPa]."""

    constant: float
    exponent: float

    def stress_damage(self, cycles: Cycles) -> float:
        """Miner's sum of cycles of stress [Pa]."""
        endured = self.constant * (1e-6 * cycles.range) ** -self.exponent
        return float(np.sum(cycles.count / endured))

    def damage(self, cycles: Cycles, strength: Strength) -> float:
        """Miner's sum of cycles of tension [N]."""
        area = strength.metal_area_m2
        return self.stress_damage(Cycles(cycles.range / area, cycles.mean / area, cycles.count))


@dataclass(frozen=True)
class TensionCurve:
    """N = K·R^-exponent with log10 K = log10_k + per_mean_load·L_m.

    R is the range of the tension and L_m its mean, both over the breaking load; L_m is taken of
    each cycle by itself.
    """

    log10_k: float
    per_mean_load: float
    exponent: float

    def damage(self, cycles: Cycles, strength: Strength) -> float:
        """Miner's sum of cycles of tension [N]."""
        log10_k = self.log10_k + self.per_mean_load * cycles.mean / strength.breaking_load_n
        endured = 10.0**log10_k * (cycles.range / strength.breaking_load_n) ** -self.exponent
        return float(np.sum(cycles.count / endured))


CURVES: dict[str, StressCurve | TensionCurve] = {
    "stranded_wire": StressCurve(3.4e14, 4.0),  # DNV-OS-E301, six strands
    "spiral_wire": StressCurve(1.7e17, 4.8),  # DNV-OS-E301, spiral strand
    "six_strand_tension": TensionCurve(3.20, -2.79, 4.09),  # API RP 2SK
}


def find_curve(where: str, name: str) -> StressCurve | TensionCurve:
    """A curve of CURVES.

    Raises:
        InputError: there is none of this name; `where` says who asks.
    """
    if name not in CURVES:
        raise InputError(phrase(where, f"no curve '{name}'", did_you_mean(name, CURVES)))
    return CURVES[name]


def strength_of(rope: Rope) -> Strength:
    """Breaking load, and the metal area of a rope that is all of steel."""
    volume = 0.25 * np.pi * rope.hydrodynamic_diameter_m**2
    steel = rope.mass_kg_per_m > ALL_STEEL_KG_PER_M3 * volume
    area = rope.mass_kg_per_m / STEEL_KG_PER_M3 if steel else np.nan
    return Strength(area, rope.breaking_load_n)


def turning_points(series: Vector) -> Vector:
    """The first value, those where the series turns, and the last: all that rainflow looks at.

    Of two parts, one after the other: turning_points([*turning_points(a), *b]) is that of the
    whole.
    """
    if len(series) < 2:
        return series
    distinct = series[np.concatenate(([True], np.diff(series) != 0.0))]
    rising = np.diff(distinct) > 0.0
    turns = np.ones(len(distinct), bool)
    turns[1:-1] = rising[1:] != rising[:-1]
    return distinct[turns]


def count_cycles(series: Vector) -> Cycles:
    """Rainflow counting of a series (ASTM E1049-85, 5.4.4); the residue counts as half cycles."""
    points = turning_points(series)
    # the last value twice: of a series of two the package would not see the second
    found = list(rainflow.extract_cycles([*points.tolist(), *points[-1:].tolist()]))
    table = np.array([cycle[:3] for cycle in found], float).reshape(-1, 3)
    return Cycles(*table[table[:, 0] > 0.0].T)


def stress_damage(stress_pa: Vector, curve: StressCurve) -> Vector:
    """Damage at each of many places from the stress there: (samples, places) to (places,)."""
    return np.array([curve.stress_damage(count_cycles(place)) for place in stress_pa.T])


@dataclass(frozen=True)
class RopeDamage:
    """What a run did to the rope. Rows are pieces of material, from the lower end up."""

    from_lower_end_m: Vector  # (pieces,) middle of the piece, unstretched
    damage: Vector  # (pieces,) Miner's sum over the run
    cycles: Vector  # (pieces,) counted
    largest_range_n: Vector  # (pieces,) of tension

    @property
    def worst(self) -> int:
        """Number of the piece that suffered most."""
        return int(np.argmax(self.damage))


class RopeFatigue:
    """Follows the tension of every piece of a rope's material through a run.

    Raises:
        InputError: the curve is one of stress, and a part of the rope is not all of steel.
    """

    def __init__(self, line: RopeLine, most_line_out_m: float, piece_m: float, curve: Curve):
        """Pieces of about `piece_m` up to the most line out that the winch has."""
        pieces = max(1, round(most_line_out_m / piece_m))
        self._middles = (np.arange(pieces) + 0.5) * most_line_out_m / pieces
        self._curve = curve
        of_section = [strength_of(section.rope) for section in line.made_of]
        if isinstance(curve, StressCurve):
            _refuse_fibre(line, of_section)
        which = np.searchsorted(ends_m(line), self._middles, side="right")
        self._strength = [of_section[number] for number in which]
        self._rows = np.full((SAMPLES_KEPT, pieces), np.nan)
        self._filled = 0
        self._turns: list[list[Vector]] = [[np.zeros(0)] for _ in range(pieces)]

    def take(self, seen: Snapshot) -> None:
        """One instant; call it often enough to meet the crests of what is to be counted."""
        from_lower = (seen.arc_length_m[-1] - seen.arc_length_m)[::-1]
        tension = seen.element_tension_n[::-1]
        places = np.concatenate(([0.0], 0.5 * (from_lower[1:] + from_lower[:-1]), from_lower[-1:]))
        values = np.concatenate(([seen.tension_payload_n], tension, [seen.tension_top_n]))
        if self._filled == SAMPLES_KEPT:
            self._reduce()
        self._rows[self._filled] = np.interp(self._middles, places, values, right=np.nan)
        self._filled += 1

    def _reduce(self) -> None:
        """Keep of the newest samples only where they turn; the last two may turn yet."""
        for kept, column in zip(self._turns, self._rows[: self._filled].T, strict=True):
            out = column[~np.isnan(column)]
            if len(out):
                known = np.concatenate([kept.pop(), out])
                points = turning_points(known)
                kept += [points[:-2], points[-2:]]
        self._filled = 0

    def damage(self) -> RopeDamage:
        """What the run did so far."""
        self._reduce()
        counted = [count_cycles(np.concatenate(kept)) for kept in self._turns]
        pairs = zip(counted, self._strength, strict=True)
        return RopeDamage(
            from_lower_end_m=self._middles.copy(),
            damage=np.array([self._curve.damage(cycles, own) for cycles, own in pairs]),
            cycles=np.array([cycles.count.sum() for cycles in counted]),
            largest_range_n=np.array([max(cycles.range, default=0.0) for cycles in counted]),
        )


def _refuse_fibre(line: RopeLine, strengths: Iterable[Strength]) -> None:
    for number, own in enumerate(strengths):
        if np.isnan(own.metal_area_m2):
            tensions = [name for name, one in CURVES.items() if isinstance(one, TensionCurve)]
            right = f"take a curve of tension ({', '.join(tensions)}), if it holds for this rope"
            where = f"rope '{line.name}', section {number + 1}"
            raise InputError(phrase(where, "it is not all of steel: no stress is known", right))
