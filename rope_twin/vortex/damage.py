"""Accumulated fatigue damage per metre of rope material, during a run.

A metre belongs to the material: it keeps its distance from the lower end, and its damage, while the
winch hauls it in and pays it out again. Aboard it sees no load of the sea, so its history pauses,
as it does below a cut.

If the winch has a sheave, a metre that runs over it in either direction is bent and straightened:
one cycle of the outer wires' E·δ/(D + d) on top of the tension there, by a stress curve. Every wire
comes to the outside within a lay of the strands, so the cycle applies all around the rope. Inboard
sheaves and the drum do not count there; `bends.py` counts the bends over all of them, with a life
of their own.

Stress curve: tension over the metal area and, if the rope has a bending stiffness, E·d/2 times its
curvature, at eight points around the circumference, of which the worst counts. For a stranded rope,
whose wires slide, this is an upper bound. The circumference is that of a rope that leans over
without twisting. Tension curve: tension alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.vortex.bends import BendCount, BendPlace, Endurance, reach_m
from rope_twin.vortex.fatigue import (
    Curve,
    RainflowCount,
    RopeLine,
    StressCurve,
    TensionCurve,
    check_all_steel,
    find_curve,
    metal_area,
)
from rope_twin.vortex.results import MaterialFatigue

SEGMENT_M = 1.0
OUT, ABOARD, UNKNOWN = 0, 1, 2
CIRCUMFERENCE_POINTS = 8  # points around the circumference


@dataclass(frozen=True)
class DamageSettings:
    """Settings of the fatigue count."""

    curve: str  # name of a fatigue curve
    bends: bool  # whether curvature is given in addition to tension
    over_sheave_pa: float = 0.0  # bending stress over the sheave; 0: not counted
    own: TensionCurve | None = None  # the rope's own curve, instead of the named one
    path: tuple[BendPlace, ...] = ()  # where the rope is bent and straightened
    endurance: tuple[Endurance, ...] = ()  # of each section, with a path


def tension_along(s: Floats, tension: Floats, upper_n: float) -> tuple[Floats, Floats]:
    """Return places along a rope from its lower end up [m], and the tension there [N].

    s: of the nodes, (n + 1,); tension: of the elements, at whose middles it holds, (n,); upper_n:
    at the upper end. At the lower end it goes on as between the two lowest elements, at least 0.
    """
    places = np.concatenate((s[:1], 0.5 * (s[1:] + s[:-1]), s[-1:]))
    lower = tension[0]
    if len(tension) > 1:
        slope = (tension[1] - tension[0]) / (places[2] - places[1])
        lower = max(lower - slope * (places[1] - places[0]), 0.0)
    return places, np.concatenate(([lower], tension, [upper_n]))


class RopeDamage:
    """Damage of each metre, from the lower end up to the maximum payout.

    Raises:
        InputError: there is no such curve, or it is a stress curve and a part of the rope is
            neither all steel nor a pipe.
    """

    def __init__(
        self,
        line: RopeLine,
        ends_m: Sequence[float],
        most_line_out_m: float,
        settings: DamageSettings,
        EI: float,
    ) -> None:
        """Start without damage; ends_m: upper ends of the sections, from the lower end up [m].

        What lies on the path when all is paid out counts beside the maximum payout.
        """
        pieces = max(1, round(most_line_out_m / SEGMENT_M))
        metre_m = most_line_out_m / pieces
        pieces += ceil(reach_m(settings.path) / metre_m)
        self.middles: Floats = (np.arange(pieces) + np.float64(0.5)) * metre_m
        self.name = settings.curve
        self._curve: Curve = settings.own or find_curve("fatigue", settings.curve)
        by_stress = isinstance(self._curve, StressCurve)
        if by_stress:
            check_all_steel(line, EI)
        which = np.searchsorted(ends_m, self.middles, side="right").astype(np.int64)
        made = [section.rope for section in line.made_of]
        area = np.array([metal_area(rope, EI) for rope in made])
        strength = area if by_stress else np.array([rope.breaking_load_n for rope in made])
        fibre = np.array([0.5 * rope.tangent_n(0.0) * rope.diameter_m for rope in made]) / area
        self._per_tension = 1.0 / strength[which]
        self._per_curvature = fibre[which] if by_stress and settings.bends else np.zeros(pieces)
        self._over_sheave_pa = settings.over_sheave_pa if by_stress else 0.0
        self._aboard = np.full(pieces, UNKNOWN)
        points = np.arange(CIRCUMFERENCE_POINTS if self.bends else 1)
        angle = 2.0 * np.pi / CIRCUMFERENCE_POINTS * points
        self._around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        self._count = RainflowCount(len(angle) * pieces)
        self._lost_m = 0.0
        self._over: BendCount | None = None
        if settings.path:
            self._over = BendCount(
                settings.path, settings.endurance, which, metre_m, most_line_out_m
            )

    @property
    def bends(self) -> bool:
        """Whether curvature counts."""
        return bool(self._per_curvature.any())

    def cut_off(self, lost_m: float) -> None:
        """Set the length below a cut [m]; its damage no longer changes."""
        self._lost_m = lost_m

    def take(self, rope: Rope, pull_n: float, bent: Floats | None = None) -> None:
        """Take one instant of the rope; the sampling must resolve the crests of the load.

        pull_n: tension at the hang-off [N]; bent: curvature of each metre across the rope, in the
        components of `turned` [1/m], (2, metres).
        """
        n = int(rope.state.counts[rows.ELEMENTS])
        s, tension = self._lost_m + rope.state.s[: n + 1], rope.work[rows.TENSION, :n]
        places, values = tension_along(s, tension, pull_n)
        load = np.interp(self.middles, places, values, np.nan, np.nan) * self._per_tension
        self._run_over_sheave(s[-1], pull_n)
        if self._over is not None:
            self._over.take(float(s[-1]), pull_n)
        if bent is None:
            loads = np.tile(load, len(self._around))
        else:
            loads = (load + self._around @ (bent * self._per_curvature)).ravel()
        self._count.take(loads, self._curve.used)

    def _run_over_sheave(self, top_m: float, pull_n: float) -> None:
        """Count a bending cycle for material that passed the hang-off since the last sample."""
        aboard = np.where(self.middles > top_m, ABOARD, OUT)
        passed = (aboard != self._aboard) & (self._aboard != UNKNOWN)
        self._aboard = aboard
        if self._over_sheave_pa == 0.0 or not passed.any():
            return
        straight = np.where(passed, pull_n * self._per_tension, np.nan)
        for load in (straight, straight + self._over_sheave_pa, straight):
            self._count.take(np.tile(load, len(self._around)), self._curve.used)

    def shot(self, line_out_m: float, counted_s: float) -> MaterialFatigue:
        """Return the accumulated damage; open cycles count half."""
        shape = (len(self._around), len(self.middles))
        return MaterialFatigue(
            curve=self.name,
            counted_s=counted_s,
            from_lower_end_m=self.middles,
            from_hang_off_m=line_out_m + self._lost_m - self.middles,
            used=self._count.total(self._curve.used).reshape(shape).max(axis=0),
            bending=self.bends,
            bent=None if self._over is None else self._over.result(),
        )
