"""Fatigue of ropes: curves of stress and tension, Miner's sum, rainflow counting, bends.

The curves, S-N (stress) and T-N (tension), are those of DNV-OS-E301 (stress on the metal area) and
API RP 2SK (tension over the breaking load). Miner (1945): a cycle uses the fraction 1/N of the
fatigue life; failure is at 1.

Rainflow counting is incremental, of many series (ASTM E1049-85, 5.4.4). For each series only the
turning points of open ranges are stored. At each new turning point the last two ranges are
compared: a range covered by the next one is a cycle, or half a cycle if it contains the first
point. Ranges still open count as half cycles when the total is requested. All series are processed
together as arrays; the sum does not depend on how the samples were grouped.

**Bends** of a rope's material over sheaves and drum, and the life that they use. Where a sheave
begins and where it ends, and where the rope meets the drum, its curvature changes: material that
passes such a place is bent or straightened, half a cycle. A passage over a whole sheave is a cycle;
material that turns back on the sheave has one too, and material that moves to and fro within the
arc of contact none. The places are at fixed distances inboard of the hang-off.

Life (Miner 1945, each half cycle uses 1/(2·N)): N = 10^a·(T/MBL)^-m·((D/d)/(D/d)_0)^k, the straight
line of log N over log T that cyclic bend-over-sheave tests are reported by, all constants from the
rope's maker. T is the tension at the hang-off, on all sheaves.

Material is followed at points 0.1 m apart; a piece (a metre in runs) has the count of its most bent
point, since heave compensation runs lengths below a metre to and fro.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, log10
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean, phrase

Vector = NDArray[np.float64]
STEEL_KG_PER_M3 = 7850.0
MIN_STEEL_DENSITY_KG_PER_M3 = 7000.0  # minimum mass over displaced volume of an all-steel rope


@dataclass(frozen=True)
class Cycles:
    """Cycles of a load, each array (cycles,)."""

    range: Vector  # double amplitude, from trough to crest
    mean: Vector
    count: Vector  # 1, or 0.5 for a half cycle


class Rope(Protocol):
    """Properties of a rope that fatigue needs, as in rope_twin.scene.schema."""

    @property
    def diameter_m(self) -> float: ...
    @property
    def hydrodynamic_diameter_m(self) -> float: ...
    @property
    def mass_kg_per_m(self) -> float: ...
    @property
    def breaking_load_n(self) -> float: ...
    def tangent_n(self, tension_n: float) -> float: ...


class Section(Protocol):
    """Section of a line, of one rope."""

    @property
    def rope(self) -> Rope: ...


class RopeLine(Protocol):
    """A line and its sections, as in rope_twin.scene.schema."""

    @property
    def name(self) -> str: ...
    @property
    def made_of(self) -> Sequence[Section]: ...


@dataclass(frozen=True)
class StressCurve:
    """S-N curve N = constant·S^-exponent, S the stress range on the metal area [MPa]."""

    constant: float
    exponent: float

    def used(self, cycles: Cycles) -> Vector:
        """Return the damage of each cycle of stress [Pa], (cycles,)."""
        used: Vector = cycles.count * (1e-6 * cycles.range) ** self.exponent / self.constant
        return used


@dataclass(frozen=True)
class TensionCurve:
    """T-N curve N = K·R^-exponent with log10 K = log10_k + per_mean_load·L_m.

    R is the range of the tension and L_m its mean, both over the breaking load; L_m is the mean of
    each individual cycle.
    """

    log10_k: float
    per_mean_load: float
    exponent: float

    def used(self, cycles: Cycles) -> Vector:
        """Return the damage of each cycle of tension over breaking load, (cycles,)."""
        endured = 10.0 ** (self.log10_k + self.per_mean_load * cycles.mean)
        used: Vector = cycles.count * cycles.range**self.exponent / endured
        return used


Curve = StressCurve | TensionCurve
CURVES: dict[str, Curve] = {
    "stranded_wire": StressCurve(3.4e14, 4.0),  # DNV-OS-E301, six strands
    "spiral_wire": StressCurve(1.7e17, 4.8),  # DNV-OS-E301, spiral strand
    "six_strand_tension": TensionCurve(3.20, -2.79, 4.09),  # API RP 2SK
    # DNV-OS-E301 (2010): N = 0.259·R^-13.46, R over the characteristic strength of 0.95 MBL
    "polyester_tension": TensionCurve(log10(0.259) + 13.46 * log10(0.95), 0.0, 13.46),
}
FIBRE = "polyester_tension"
NOT_STEEL = "not all of steel"
OWN = "own"  # the rope's own curve of tension, by keys of the scene
STRESS_CURVES = {name: one for name, one in CURVES.items() if isinstance(one, StressCurve)}


def find_curve(where: str, name: str) -> Curve:
    """Return a curve of CURVES; where: the option or key that names it, for messages.

    Raises:
        InputError: there is none of this name.
    """
    if name not in CURVES:
        raise InputError(where, f"no curve '{name}'", did_you_mean(name, CURVES))
    return CURVES[name]


def find_stress_curve(where: str, name: str) -> StressCurve:
    """Return a curve of STRESS_CURVES; where: the option or key that names it, for messages.

    Raises:
        InputError: there is none of this name.
    """
    if name in STRESS_CURVES:
        return STRESS_CURVES[name]
    if name in CURVES:
        remedy = f"give one of stress: {', '.join(sorted(STRESS_CURVES))}"
        raise InputError(where, f"'{name}' is a curve of tension", remedy)
    raise InputError(where, f"no curve '{name}'", did_you_mean(name, STRESS_CURVES))


def pipe_area(EI: float, EA: float, diameter: float) -> float:
    """Metal area of the pipe with these stiffnesses [m²]; 0: there is none.

    From EI/EA = (d² + d_i²)/16: a rope with the bending stiffness of a pipe of its diameter is
    treated as that pipe.
    """
    inner = 16.0 * EI / EA - diameter**2
    return 0.25 * np.pi * (diameter**2 - inner) if 0.0 < inner < diameter**2 else 0.0


def metal_area(rope: Rope, EI: float) -> float:
    """Metal area of a rope with this bending stiffness (0: none) [m²]; NaN: not all steel."""
    if (pipe_m2 := pipe_area(EI, rope.tangent_n(0.0), rope.diameter_m)) > 0.0:
        return pipe_m2
    volume = 0.25 * np.pi * rope.hydrodynamic_diameter_m**2
    steel = rope.mass_kg_per_m > MIN_STEEL_DENSITY_KG_PER_M3 * volume
    return rope.mass_kg_per_m / STEEL_KG_PER_M3 if steel else np.nan


def other_material(rope: Rope, EI: float) -> str:
    """Return the type of a rope other than steel wire in words; "" for steel wire.

    A chain displaces more than a bar of its diameter, a wire rope less.
    """
    if pipe_area(EI, rope.tangent_n(0.0), rope.diameter_m) > 0.0:
        return "a pipe"
    if np.isnan(metal_area(rope, EI)):
        return NOT_STEEL
    return "chain" if rope.hydrodynamic_diameter_m > rope.diameter_m else ""


def wire_curve_warning(line: RopeLine, name: str, EI: float) -> str:
    """Return a warning on sections that a curve does not cover; "" if there are none."""
    if name == OWN:
        return ""
    material, kinds = "wire", [other_material(section.rope, EI) for section in line.made_of]
    if name == FIBRE:
        material = "polyester"
        kinds = ["" if kind == NOT_STEEL else kind or "steel" for kind in kinds]
    excluded = [f"section {number} is {kind}" for number, kind in enumerate(kinds, 1) if kind]
    if not excluded:
        return ""
    problem = (
        f"{name} is a curve of {material} rope, and of rope '{line.name}' {', '.join(excluded)}"
    )
    return phrase("fatigue", problem, "damage there compares places, and is no fatigue life")


def check_all_steel(line: RopeLine, EI: float = 0.0) -> None:
    """Reject a rope for which a stress curve cannot be used.

    Raises:
        InputError: a section of the rope is neither all steel nor a pipe.
    """
    for number, section in enumerate(line.made_of):
        if np.isnan(metal_area(section.rope, EI)):
            tensions = [name for name, curve in CURVES.items() if isinstance(curve, TensionCurve)]
            remedy = f"take a curve of tension ({', '.join(tensions)}), if it holds for this rope"
            where = f"rope '{line.name}', section {number + 1}"
            raise InputError(where, "it is not all of steel: no stress is known", remedy)


Numbers = NDArray[np.int64]
Damage = Callable[[Cycles], Vector]  # damage of each cycle
INITIAL_CAPACITY = 16  # initial capacity for open turning points of a series


class RainflowCount:
    """Rainflow count of several series; NaN values are skipped."""

    def __init__(self, series: int) -> None:
        self.used = np.zeros(series)  # damage by closed cycles
        self.cycles = np.zeros(series)  # number of closed cycles
        self._last = np.full(series, np.inf)  # newest value, inf: none yet
        self._way = np.zeros(series)  # direction: 1 up, -1 down, 0 not known yet
        self._open = np.zeros((series, INITIAL_CAPACITY))  # turning points
        self._count = np.zeros(series, np.int64)

    def take(self, values: Vector, cost: Damage) -> None:
        """Add the next value of each series, (series,)."""
        has_value = np.isfinite(self._last)
        current = np.where(np.isnan(values), self._last, values)
        with np.errstate(invalid="ignore"):
            direction = np.where(has_value, np.sign(current - self._last), 0.0)
        reversals = np.flatnonzero((direction != 0.0) & (direction != self._way))
        if len(reversals):
            self._push(reversals, self._last[reversals], cost)
            self._way[reversals] = direction[reversals]
        self._last = current

    def total(self, cost: Damage) -> Vector:
        """Return the damage of all cycles, with the open ones as half cycles, (series,)."""
        final = copy.deepcopy(self)
        non_empty = np.flatnonzero(final._count > 0)
        final._push(non_empty, final._last[non_empty], cost)
        for k in range(int(final._count.max(initial=0)) - 1):
            open_now = np.flatnonzero(final._count > k + 1)
            begin, end = final._open[open_now, k : k + 2].T
            final._close(open_now, begin, end, 0.5, cost)
        return final.used

    def _push(self, series: Numbers, points: Vector, cost: Damage) -> None:
        """Add a turning point to these series, and close the cycles that it completes."""
        if int(self._count.max(initial=0)) + 1 >= self._open.shape[1]:
            self._open = np.hstack([self._open, np.zeros_like(self._open)])
        open_points, count = self._open, self._count
        open_points[series, count[series]] = points
        count[series] += 1
        series = series[count[series] >= 3]
        while len(series):
            depth = count[series]
            first_point, mid_point, last_point = (open_points[series, depth - k] for k in (3, 2, 1))
            is_closed = np.abs(last_point - mid_point) >= np.abs(mid_point - first_point)
            series, depth = series[is_closed], depth[is_closed]
            first_point, mid_point, last_point = (
                point[is_closed] for point in (first_point, mid_point, last_point)
            )
            is_first = depth == 3
            self._close(series, first_point, mid_point, np.where(is_first, 0.5, 1.0), cost)
            half_cycles, full_cycles = series[is_first], series[~is_first]
            open_points[half_cycles, 0] = mid_point[is_first]
            open_points[half_cycles, 1] = last_point[is_first]
            count[half_cycles] -= 1
            open_points[full_cycles, depth[~is_first] - 3] = last_point[~is_first]
            count[full_cycles] -= 2
            series = series[count[series] >= 3]

    def _close(
        self, series: Numbers, begin: Vector, end: Vector, count: Vector | float, cost: Damage
    ) -> None:
        if len(series):
            counts = np.broadcast_to(np.asarray(count, dtype=np.float64), begin.shape)
            cycles = Cycles(np.abs(end - begin), 0.5 * (begin + end), counts)
            self.used[series] += cost(cycles)
            self.cycles[series] += counts


def damage_of_series(values: Vector, used: Damage) -> Vector:
    """Return Miner's sum of each of several series, (series,); values: (samples, series)."""
    count = RainflowCount(values.shape[1])
    for row in values:
        count.take(row, used)
    return count.total(used)


SPACING_M = 0.1  # of the points of material
HALF = 0.5  # cycle at each change of curvature


class Layers(Protocol):
    """Layers of rope on a drum, as in rope_twin.scene.winch."""

    def radius_m(self, layer: int, diameter_m: float) -> float: ...
    def layer_of(self, stored_m: float, diameter_m: float) -> int: ...


class BendPlace(NamedTuple):
    """Point inboard of the hang-off at which the curvature of the rope changes."""

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
    """Return the distance from the hang-off to the furthest sheave or drum [m]; 0 without any."""
    return max((place.inboard_m for place in path), default=0.0)


class BendCount:
    """Bends and Miner's sum of points of material; the sum does not depend on the sampling.

    Reversals within a sampling interval are lost: samples must resolve the motion of the winch.
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
        self._at = np.full(len(self.path), -1)  # points below each sheave; -1: not known yet

    def take(self, top_m: float, tension_n: float) -> None:
        """Add a sample: material coordinate at the hang-off [m] and the tension there [N]."""
        for number, place in enumerate(self.path):
            # points at (k + 0.5)·spacing; one exactly at the sheave is above it
            below = ceil((top_m + place.inboard_m) / self._spacing - 0.5)
            current, previous = min(max(below, 0), len(self.bends)), int(self._at[number])
            self._at[number] = current
            if previous in (current, -1):
                continue
            passed = slice(min(current, previous), max(current, previous))
            half = HALF * place.weight
            self.bends[passed] += half
            used = np.array([section.used(tension_n, self._bent(place, top_m, section.diameter_m))
                             for section in self.sections])  # fmt: skip
            self.damage[passed] += half * used[self._section[passed]]

    def _bent(self, place: BendPlace, top_m: float, diameter_m: float) -> float:
        """Return the bending diameter under the rope [m]; on a drum, that of its present layer."""
        if place.drum is None:
            return place.diameter_m
        stored_m = max(self._whole_m - top_m, 0.0)
        layer = place.drum.layer_of(stored_m, diameter_m)
        return 2.0 * place.drum.radius_m(layer, diameter_m) - diameter_m

    def result(self) -> BendResult:
        """Return the bends of each piece: those of its most bent point."""
        section_of = self._section[:: self._points]
        has_life = np.array([section.log10_a is not None for section in self.sections])
        discard = np.array([section.discard_bends or np.nan for section in self.sections])
        bends, damage = (
            values.reshape(-1, self._points).max(axis=1) for values in (self.bends, self.damage)
        )
        sources = dict.fromkeys(section.source for section in self.sections if section.source)
        return BendResult(
            bends, np.where(has_life[section_of], damage, np.nan), bends / discard[section_of],
            "; ".join(sources),
        )  # fmt: skip
