"""Data of a rope from its maker: axial stiffness table, fatigue in bending and tension.

The table is tension over strain, as a monotone cubic between its points. For a fibre rope it is the
static curve, beside a dynamic stiffness and a working curve (core/axial_law, core/fibre).

Fatigue data, its life over sheaves and under varying tension, judge only: no result but those of
`--fatigue` depends on them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rope_twin.core.state import Floats, Table
from rope_twin.errors import InputError
from rope_twin.quantity import SparingRepr, quantity, text
from rope_twin.vortex.fatigue import CURVES, OWN, Endurance, TensionCurve

if TYPE_CHECKING:
    from rope_twin.scene.schema import RopeLine

SAFETY_FACTOR = 3.0  # MBL over static load, common for lifting wire
MAX_STRAIN = 1.0
MAX_STIFFNESS_N = 1e12
STRAIN_TOL = 1e-12  # relative tolerance of the inverse, in strain


class _Working(NamedTuple):
    """Working curve T = u·(initial + bend·u), u = strain - lower, below the strain `upper`."""

    highest: float  # tension at its upper end [N]
    upper: float
    lower: float
    initial: float  # [N]
    bend: float  # [N]


@dataclass(frozen=True, kw_only=True)
class DynamicStiffness:
    """Stiffness of a fibre rope for fast motion, E_d = constant + b·mean tension - c·amplitude."""

    constant_n: float = quantity("constant part of the dynamic stiffness", "N", 0.0, 1e12)
    per_mean_tension: float = quantity(
        "increase per mean tension, N per N", "", 0.0, 1e3, default=0.0
    )
    per_tension_amplitude: float = quantity(
        "decrease per tension amplitude, N per N", "", 0.0, 1e3, default=0.0
    )
    relaxation_s: float = quantity(
        "time in which the tension returns to the static curve", "s", 1.0, 1e7
    )

    def stiffness_n(self, mean_n: float) -> float:
        """Return the dynamic stiffness [N] at a mean tension [N], for small amplitudes."""
        return self.constant_n + self.per_mean_tension * max(mean_n, 0.0)


@dataclass(frozen=True, kw_only=True)
class WorkingCurve:
    """Static curve below the maximum mean tension so far; the table is the original curve."""

    permanent: float = quantity(
        "permanent strain over the strain at the maximum mean tension", "", 1e-3, 0.99
    )
    curvature: float = quantity(
        "m in T = T_h·ξ·(1 - m + m·ξ); 0: a straight line", "", 0.0, 0.95, default=0.0
    )
    max_mean_tension_n: float = quantity(
        "maximum mean tension before the start, e.g. at installation", "N", 0.0, 1e9, default=0.0
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class StiffnessTable(SparingRepr):
    """Points of strain and elastic tension; linear extrapolation beyond the last one."""

    _later = frozenset(("dynamic", "working_curve"))

    table: tuple[tuple[float, float], ...] = quantity("rows of strain and tension [N]", "")
    dynamic: DynamicStiffness | None = text("dynamic stiffness of a fibre rope", None)
    working_curve: WorkingCurve | None = text("working curve of a fibre rope", None)

    def check(self) -> str | None:
        """Return the fault of the points and its remedy, or None."""
        if len(self.table) < 2:
            return "it has fewer than two rows; give at least [0, 0] and one [strain, tension]"
        if self.table[0] != (0.0, 0.0):
            return "its first row is not [0, 0]; begin there, at zero strain and tension"
        for (low, less), (high, more) in pairwise(self.table):
            if not (high > low and more > less):
                return (
                    f"[{high:g}, {more:g}] follows [{low:g}, {less:g}]; "
                    "strain and tension must ascend from row to row"
                )
            if (more - less) / (high - low) > MAX_STIFFNESS_N:
                return f"from strain {low:g} to {high:g} its slope exceeds 1e12 N; check the units"
        if self.table[-1][0] > MAX_STRAIN:
            return f"a strain of {self.table[-1][0]:g} is given; 1 % is 0.01, give at most 1"
        if self.working_curve is not None and self.dynamic is None:
            return "it has a working_curve without dynamic; give the dynamic stiffness too"
        return None

    @cached_property
    def cubics(self) -> Table:
        """Return the cubics between its points, as a table of one section."""
        return cubics([self.table])

    def tension_n(self, strain: float) -> float:
        """Return the static tension [N] at a strain, negative below 0."""
        works = self._working
        if works is not None and strain < works.upper:
            u = strain - works.lower
            return u * (works.initial + works.bend * max(u, 0.0))
        return self._tension_and_tangent(strain)[0]

    def tangent_n(self, tension_n: float) -> float:
        """Return dT/dstrain [N] at a static tension."""
        works, strain = self._working, self.strain_at(tension_n)
        if works is not None and strain < works.upper:
            return works.initial + 2.0 * works.bend * max(strain - works.lower, 0.0)
        return self._tension_and_tangent(strain)[1]

    def dynamic_n(self, tension_n: float) -> float:
        """Return the stiffness [N] that fast motion about a mean tension meets."""
        tangent = self.tangent_n(tension_n)
        return max(tangent, self.dynamic.stiffness_n(tension_n)) if self.dynamic else tangent

    def strain_at(self, tension_n: float) -> float:
        """Return the strain at a static tension [N]; 0 without tension."""
        works = self._working
        if works is None or tension_n >= works.highest:
            return self._original_strain(tension_n)
        tension = max(tension_n, 0.0)
        root = sqrt(works.initial**2 + 4.0 * works.bend * tension)
        return works.lower + 2.0 * tension / (works.initial + root)

    @cached_property
    def _working(self) -> _Working | None:
        """Return the working curve at the start, if there is one."""
        working = self.working_curve
        if working is None or working.max_mean_tension_n == 0.0:
            return None
        highest, m = working.max_mean_tension_n, working.curvature
        top = self._original_strain(highest)
        span = (1.0 - working.permanent) * top
        return _Working(
            highest, top, working.permanent * top, highest * (1.0 - m) / span, highest * m / span**2
        )

    def _original_strain(self, tension_n: float) -> float:
        strain, tension = self.table[-1]
        if tension_n <= 0.0:
            return 0.0
        if tension_n >= tension:
            return strain + (tension_n - tension) / self._tension_and_tangent(strain)[1]
        low, high = 0.0, strain
        while high - low > STRAIN_TOL * high:
            middle = 0.5 * (low + high)
            low, high = (
                (middle, high)
                if self._tension_and_tangent(middle)[0] < tension_n
                else (low, middle)
            )
        return 0.5 * (low + high)

    def _tension_and_tangent(self, strain: float) -> tuple[float, float]:
        """Return tension and tangent [N]."""
        law = self.cubics
        j = max(int(np.searchsorted(law.knot[0], strain, side="right")) - 1, 0)
        u = strain - law.knot[0, j]
        v = max(u, 0.0)
        slope, curve, bend = law.slope[0, j], law.curve[0, j], law.bend[0, j]
        tension = law.tension[0, j] + slope * u + v * v * (curve + bend * v)
        return float(tension), float(slope + v * (2.0 * curve + 3.0 * bend * v))


def cubics(tables: list[tuple[tuple[float, float], ...]]) -> Table:
    """Return the core's table of several sections, each with its own points."""
    width = max(len(table) for table in tables)
    law = Table(*(np.zeros((len(tables), width)) for _ in Table._fields))
    law.knot[:] = np.inf
    for k, table in enumerate(tables):
        points = np.array(table)
        strain, tension = points.T
        count, rise = len(table), np.diff(strain)
        secant = np.diff(tension) / rise
        slope = _slopes(rise, secant)
        law.knot[k, :count], law.tension[k, :count], law.slope[k, :count] = strain, tension, slope
        law.curve[k, : count - 1] = (3.0 * secant - 2.0 * slope[:-1] - slope[1:]) / rise
        law.bend[k, : count - 1] = (slope[:-1] + slope[1:] - 2.0 * secant) / rise**2
    return law


def _slopes(rise: Floats, secant: Floats) -> Floats:
    """Return dT/dstrain at the points: a monotone cubic (Fritsch and Butland 1984, eq. 4).

    At the ends the slope of the parabola through three points, limited to between a third and three
    times the secant there (above three times a cubic would not be monotone; a third keeps the
    initial stiffness positive).
    """
    if len(secant) == 1:
        return np.repeat(secant, 2)
    before, after = rise[:-1], rise[1:]
    share = (before + 2.0 * after) / (3.0 * (before + after))
    inner = secant[:-1] * secant[1:] / (share * secant[1:] + (1.0 - share) * secant[:-1])
    first = _end(rise[0], rise[1], secant[0], secant[1])
    last = _end(rise[-1], rise[-2], secant[-1], secant[-2])
    slopes: Floats = np.concatenate([[first], inner, [last]])
    return slopes


def _end(near: float, next_to: float, secant: float, beyond: float) -> float:
    """Return the slope at an end, from the two adjacent intervals."""
    slope = ((2.0 * near + next_to) * secant - near * beyond) / (near + next_to)
    return float(min(max(slope, secant / 3.0), 3.0 * secant))


@dataclass(frozen=True, kw_only=True)
class BendingLife:
    """Cycles of bending to failure, N = 10^a·(T/MBL)^-m·((D/d)/(D/d)_0)^k."""

    log10_a: float = quantity(
        "a: log10 of the cycles at D/d of the tests, extrapolated to T = MBL", "", -20.0, 20.0
    )
    exponent: float = quantity("m, on tension over MBL", "", 0.0, 50.0)
    d_ratio: float = quantity("(D/d)_0: sheave over rope diameter of the tests", "", 1.0, 1e3)
    d_ratio_exponent: float = quantity(
        "k, on D/d over that of the tests; 0: the sheaves are those of the tests", "", 0.0, 20.0
    )


@dataclass(frozen=True, kw_only=True)
class TensionLife:
    """Cycles of tension to failure, N = 10^(log10_k + b·L_m)·R^-m; range R, mean L_m over MBL."""

    log10_k: float = quantity("log10 of the cycles at R = 1 and L_m = 0", "", -20.0, 20.0)
    exponent: float = quantity("m, on the range over MBL", "", 0.1, 50.0)
    per_mean_load: float = quantity("b, per mean tension over MBL", "", -50.0, 50.0, default=0.0)


@dataclass(frozen=True, kw_only=True)
class FatigueData:
    """Fatigue data of a rope, and where they come from."""

    source: str = text("where these figures come from; shown with every result")
    bending: BendingLife | None = text("life in bending over sheaves and drum", None)
    tension: TensionLife | None = text("life under varying tension, for `--fatigue own`", None)
    discard_bends: float | None = quantity(
        "bends of a metre at which the maker has it discarded", "", 1.0, 1e9, default=None
    )

    def check(self) -> str | None:
        """Return a fault if nothing is given, or None."""
        if not self.source.strip():
            return "the source is empty; name the test report, data sheet or paper"
        if self.bending is None and self.tension is None and self.discard_bends is None:
            return "no figure is given; give bending, tension or discard_bends, or remove the key"
        return None

    def curve(self) -> TensionCurve | None:
        """Return the curve of tension, or None."""
        if self.tension is None:
            return None
        tension = self.tension
        return TensionCurve(tension.log10_k, tension.per_mean_load, tension.exponent)


def _data(line: RopeLine) -> list[FatigueData | None]:
    """Return the fatigue data of each section, from the lower end up."""
    return [section.fatigue or line.fatigue for section in line.made_of]


def endurance(line: RopeLine) -> tuple[Endurance, ...]:
    """Return the life in bending of each section, from the lower end up."""
    sections = []
    for section, data in zip(line.made_of, _data(line), strict=True):
        figures = Endurance(section.rope.diameter_m, section.rope.breaking_load_n)
        if data is not None:
            figures = figures._replace(discard_bends=data.discard_bends, source=data.source)
            if (life := data.bending) is not None:
                figures = figures._replace(
                    log10_a=life.log10_a, exponent=life.exponent, d_ratio=life.d_ratio,
                    d_ratio_exponent=life.d_ratio_exponent,
                )  # fmt: skip
        sections.append(figures)
    return tuple(sections)


def own_curve(line: RopeLine) -> TensionCurve:
    """Return the line's own curve of tension.

    Raises:
        InputError: it has none, or its sections have different ones.
    """
    curves = {data.curve() if data else None for data in _data(line)}
    where = f"fatigue {OWN}: rope '{line.name}'"
    if None in curves:
        remedy = f"give it `fatigue: {{tension: {{...}}}}`, or take one of {', '.join(CURVES)}"
        raise InputError(where, "it has no curve of tension of its own", remedy)
    if len(curves) > 1:
        problem = "its sections have different curves of tension"
        raise InputError(where, problem, "give all of them the same")
    (curve,) = curves
    assert curve is not None
    return curve
