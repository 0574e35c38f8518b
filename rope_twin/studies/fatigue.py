"""Fatigue along a rope: rainflow counting of each piece of its material, and what damage that does.

The pieces belong to the material: each has its distance from the lower end and keeps it while the
winch pays out or hauls in. A piece that is aboard meets no tension of the sea: its history stands
still until it comes out again. Where the winch has a sheave, each passage bends and straightens it
once (rope_twin.vortex.damage), by a curve of stress.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rainflow
from numpy.typing import NDArray

from rope_twin.scene.model.grid import ends_m
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.scene.validation.rigging import winch_of
from rope_twin.twin.snapshot import Snapshot
from rope_twin.vortex.damage import tension_along
from rope_twin.vortex.fatigue import (
    CURVES,
    Curve,
    Cycles,
    StressCurve,
    Vector,
    check_all_steel,
    strength_of,
)

SAMPLES_KEPT = 2048  # of every piece, before they are reduced to where they turn


def turning_points(series: Vector) -> Vector:
    """Return the turning points of a series with its first and last value, as rainflow needs them.

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
    """Count rainflow cycles of a series (ASTM E1049-85, 5.4.4); residue as half cycles."""
    points = turning_points(series)
    # the last value twice: of a series of two the package would not see the second
    found = list(rainflow.extract_cycles([*points.tolist(), *points[-1:].tolist()]))
    table = np.array([cycle[:3] for cycle in found], float).reshape(-1, 3)
    return Cycles(*table[table[:, 0] > 0.0].T)


def stress_damage(stress_pa: Vector, curve: StressCurve) -> Vector:
    """Return the damage (places,) from the stress at many places (samples, places)."""
    return np.array([curve.stress_damage(count_cycles(place)) for place in stress_pa.T])


@dataclass(frozen=True)
class RopeDamage:
    """Damage of the rope in a run; rows are pieces of material, from the lower end up."""

    from_lower_end_m: Vector  # (pieces,) middle of the piece, unstretched
    damage: Vector  # (pieces,) Miner's sum over the run
    cycles: Vector  # (pieces,) counted
    largest_range_n: Vector  # (pieces,) of tension

    @property
    def worst(self) -> int:
        """Return the index of the piece with the maximum damage."""
        return int(np.argmax(self.damage))


class RopeFatigue:
    """Follows the tension of every piece of a rope's material through a run.

    Raises:
        InputError: the curve is one of stress, and a part of the rope is not all of steel.
    """

    def __init__(
        self, line: RopeLine, most_line_out_m: float, piece_m: float, curve: Curve,
        over_sheave_pa: float = 0.0,
    ):  # fmt: skip
        """Divide the rope, up to the maximum line out, into pieces of about `piece_m`."""
        pieces = max(1, round(most_line_out_m / piece_m))
        self._middles = (np.arange(pieces) + 0.5) * most_line_out_m / pieces
        self._curve = curve
        of_section = [strength_of(section.rope) for section in line.made_of]
        if isinstance(curve, StressCurve):
            check_all_steel(line)
        which = np.searchsorted(ends_m(line), self._middles, side="right")
        self._strength = [of_section[number] for number in which]
        over = over_sheave_pa if isinstance(curve, StressCurve) else 0.0
        areas = np.array([own.metal_area_m2 for own in self._strength])
        self._over_sheave_n = over * areas if over else np.zeros(pieces)
        self._aboard: NDArray[np.bool_] | None = None
        self._rows = np.full((SAMPLES_KEPT, pieces), np.nan)
        self._filled = 0
        self._turns: list[list[Vector]] = [[np.zeros(0)] for _ in range(pieces)]

    def take(self, seen: Snapshot) -> None:
        """Take a sample of the first rope; sample often enough to resolve the peaks."""
        from_lower = (seen.arc_length_m[-1] - seen.arc_length_m)[::-1]
        self.take_tensions(from_lower, seen.element_tension_n[::-1], seen.tension_top_n)

    def take_tensions(self, from_lower: Vector, tension: Vector, upper_n: float) -> None:
        """Take a sample of a rope from its lower end up.

        from_lower: material coordinates of its nodes [m], (nodes,); tension: of its elements [N],
        (elements,); upper_n: at its upper end [N].
        """
        places, values = tension_along(from_lower, tension, upper_n)
        aboard = self._middles > from_lower[-1]
        if self._aboard is not None and self._over_sheave_n.any():
            passed = aboard != self._aboard
            straight = np.where(passed, upper_n, np.nan)
            for load in (straight, straight + self._over_sheave_n, straight):
                if passed.any():
                    self._keep(load)
        self._aboard = aboard
        self._keep(np.interp(self._middles, places, values, right=np.nan))

    def _keep(self, tensions: Vector) -> None:
        """Append a row to the history; NaN: no new value."""
        if self._filled == SAMPLES_KEPT:
            self._reduce()
        self._rows[self._filled] = tensions
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
        """Return the damage accumulated in the run."""
        self._reduce()
        counted = [count_cycles(np.concatenate(kept)) for kept in self._turns]
        pairs = zip(counted, self._strength, strict=True)
        return RopeDamage(
            from_lower_end_m=self._middles.copy(),
            damage=np.array([self._curve.damage(cycles, own) for cycles, own in pairs]),
            cycles=np.array([cycles.count.sum() for cycles in counted]),
            largest_range_n=np.array([max(cycles.range, default=0.0) for cycles in counted]),
        )


def fatigue_of(scene: Scene, line: RopeLine, curve: str, piece_m: float) -> RopeFatigue:
    """Return the count of a scene's rope, with the passages over its winch's sheave.

    Raises:
        InputError: the curve is one of stress, and a part of the rope is not all of steel.
    """
    winch = winch_of(scene, line)
    most = winch.most_line_out_m if winch else line.length_m
    sheave = winch.sheave if winch else None
    bent_pa = sheave.bending_stress_pa(line.made_of[0].rope.diameter_m) if sheave else 0.0
    return RopeFatigue(line, most, piece_m, CURVES[curve], bent_pa)
