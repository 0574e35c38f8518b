"""Vibration and fatigue of a run: what it asks for, its results, and the count of damage.

Damage is that of each metre of rope material. A metre belongs to the material: it keeps its
distance from the lower end, and its damage, while the winch hauls it in and pays it out again.
Aboard it sees no load of the sea, so its history pauses, as it does below a cut.

A metre that runs over a sheave in either direction is bent and straightened: one cycle of the outer
wires' E·δ/(D + d) on top of the tension there, by a stress curve. Every wire comes to the outside
within a lay of the strands, so the cycle applies all around the rope. `fatigue.BendCount` counts
the bends, over the drum too, with a life of their own.

Stress curve: tension over the metal area and, if the rope has a bending stiffness, E·d/2 times its
curvature, at eight points around the circumference, of which the worst counts. For a stranded rope,
whose wires slide, this is an upper bound. The circumference is that of a rope that leans over
without twisting. Tension curve: tension alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.errors import InputError, did_you_mean
from rope_twin.vortex.fatigue import (
    CURVES,
    OWN,
    BendCount,
    BendPlace,
    BendResult,
    Curve,
    Endurance,
    RainflowCount,
    RopeLine,
    StressCurve,
    TensionCurve,
    check_all_steel,
    find_curve,
    metal_area,
)

TIME_DOMAIN = "time-domain"  # the scene's own VIV model
FREQUENCY_DOMAIN = "frequency-domain"  # natural modes of the line, without feedback on it
MODELS = (TIME_DOMAIN, FREQUENCY_DOMAIN)


@dataclass(frozen=True)
class MonitorSettings:
    """Vibration and fatigue monitors that a run asks for.

    Raises:
        InputError: there is no such model or curve.
    """

    vibration: str = ""  # one of MODELS, or "" for none
    fatigue: str = ""  # name of an S-N curve, OWN for those of the ropes, or "" for none

    def __post_init__(self) -> None:
        if self.vibration and self.vibration not in MODELS:
            problem = f"no model '{self.vibration}'"
            raise InputError("vibration", problem, did_you_mean(self.vibration, MODELS))
        if self.fatigue and self.fatigue not in (known := (OWN, *CURVES)):
            problem = f"no curve '{self.fatigue}'"
            raise InputError("fatigue", problem, did_you_mean(self.fatigue, known))

    def __bool__(self) -> bool:
        return bool(self.vibration or self.fatigue)


class CoupledSettings(NamedTuple):
    """VIV model that a scene lists, and its water."""

    name: str  # of the effect; "": none
    params: Any  # of the effect if it is loosely coupled, else None
    strouhal: float
    density: float  # of the water [kg/m³]
    step_s: float  # of the run


Vector = NDArray[np.float64]


@dataclass(frozen=True)
class RopeVibration:
    """VIV response along the rope; rows run from the hang-off (row 0) down.

    An amplitude is √2 times the rms over some periods, divided by the rope's diameter.
    """

    model: str  # "time-domain": measured in the twin; else the loosely coupled model
    cross_flow: Vector  # amplitude across current and rope [diameters], (nodes,)
    cross_flow_hz: Vector  # its frequency; 0 where the rope does not vibrate, (nodes,)
    in_line: Vector | None  # amplitude along the current; None: not in the model
    in_line_hz: Vector | None
    drag_amplification: Vector  # factor on the mean drag; 1: none, (nodes,)
    every_s: float  # interval between solutions of the rope's modes; 0: the model has none
    solves: int  # number of these solutions
    note: str  # message if the modes could not be solved
    cost_pct: float = 0.0  # CPU time of the monitor, relative to the twin's

    @property
    def worst(self) -> int:
        """Index of the node with the largest cross-flow amplitude."""
        return int(self.cross_flow.argmax())

    def upside_down(self) -> RopeVibration:
        """Return the response with its rows in reverse order."""
        names = ("cross_flow", "cross_flow_hz", "in_line", "in_line_hz", "drag_amplification")
        rows = {name: values for name in names if (values := getattr(self, name)) is not None}
        return replace(self, **{name: values[::-1].copy() for name, values in rows.items()})


@dataclass(frozen=True)
class MaterialFatigue:
    """Accumulated Miner damage per metre of rope material (`damage.py`), from the lower end up."""

    curve: str  # name of the S-N curve
    counted_s: float  # duration of the count
    from_lower_end_m: Vector  # middle of each metre, unstretched
    from_hang_off_m: Vector  # its present distance below the hang-off; negative: aboard
    used: Vector  # Miner damage D; 1: failure
    bending: bool  # whether bending stress is included
    bent: BendResult | None = None  # bends over sheaves and drum; None without any

    @property
    def worst(self) -> int:
        """Index of the metre with the largest damage."""
        return int(self.used.argmax())

    @property
    def most_bent(self) -> int:
        """Index of the metre with the largest bending damage, else with the most bends."""
        assert self.bent is not None
        damage = np.nan_to_num(self.bent.damage)
        return int((damage if damage.any() else self.bent.bends).argmax())


SEGMENT_M = 1.0
OUT, ABOARD, UNKNOWN = 0, 1, 2
CIRCUMFERENCE_POINTS = 8  # points around the circumference


@dataclass(frozen=True)
class DamageSettings:
    """Settings of the fatigue count."""

    curve: str  # name of a fatigue curve
    bends: bool  # whether curvature is given in addition to tension
    wires: tuple[tuple[float, float], ...] = ()  # sheaves: distance inboard, stress of the wires
    own: TensionCurve | None = None  # the rope's own curve, instead of the named one
    path: tuple[BendPlace, ...] = ()  # sheaves and drum that bend the rope
    endurance: tuple[Endurance, ...] = ()  # of each section, with a path
    reach_m: float = 0.0  # rope inboard of the maximum payout that is counted too
    piece_m: float = SEGMENT_M  # length of a piece of the count


def tension_along(s: Floats, tension: Floats, upper_n: float) -> tuple[Floats, Floats]:
    """Return points along a rope from its lower end up [m], and their tensions [N].

    s: of the nodes, (n + 1,); tension: of the elements, at their middles, (n,); upper_n: at the
    upper end. At the lower end it is extrapolated from the two lowest elements, at least 0.
    """
    points = np.concatenate((s[:1], 0.5 * (s[1:] + s[:-1]), s[-1:]))
    lower = tension[0]
    if len(tension) > 1:
        slope = (tension[1] - tension[0]) / (points[2] - points[1])
        lower = max(lower - slope * (points[1] - points[0]), 0.0)
    return points, np.concatenate(([lower], tension, [upper_n]))


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
        max_line_out_m: float,
        settings: DamageSettings,
        EI: float,
    ) -> None:
        """Start without damage; ends_m: upper ends of the sections, from the lower end up [m]."""
        pieces = max(1, round(max_line_out_m / settings.piece_m))
        length_m = max_line_out_m / pieces
        pieces += ceil(settings.reach_m / length_m)
        self.middles: Floats = (np.arange(pieces) + np.float64(0.5)) * length_m
        self.name = settings.curve
        self._curve: Curve = settings.own or find_curve("fatigue", settings.curve)
        by_stress = isinstance(self._curve, StressCurve)
        if by_stress:
            check_all_steel(line, EI)
        section_of = np.searchsorted(ends_m, self.middles, side="right").astype(np.int64)
        materials = [section.rope for section in line.made_of]
        area = np.array([metal_area(rope, EI) for rope in materials])
        strength = area if by_stress else np.array([rope.breaking_load_n for rope in materials])
        fibre = np.array([0.5 * rope.tangent_n(0.0) * rope.diameter_m for rope in materials]) / area
        self._per_tension = 1.0 / strength[section_of]
        bends = by_stress and settings.bends
        self._per_curvature = fibre[section_of] if bends else np.zeros(pieces)
        self._wires = settings.wires if by_stress else ()
        self._aboard = np.full((len(self._wires), pieces), UNKNOWN)
        points = np.arange(CIRCUMFERENCE_POINTS if self.bends else 1)
        angle = 2.0 * np.pi / CIRCUMFERENCE_POINTS * points
        self._around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        self._count = RainflowCount(len(angle) * pieces)
        self._lost_m = 0.0
        self._over: BendCount | None = None
        if settings.path:
            self._over = BendCount(
                settings.path, settings.endurance, section_of, length_m, max_line_out_m
            )

    @property
    def bends(self) -> bool:
        """Whether curvature counts."""
        return bool(self._per_curvature.any())

    def cut_off(self, lost_m: float) -> None:
        """Set the length below a cut [m]; its damage no longer changes."""
        self._lost_m = lost_m

    def take(self, rope: Rope, pull_n: float, curvature: Floats | None = None) -> None:
        """Add one sample of the rope; the sampling must resolve the crests of the load.

        pull_n: tension at the hang-off [N]; curvature: of each metre across the rope, in the
        components of `turned` [1/m], (2, metres).
        """
        s, tension = _tensions(rope)
        self.take_tensions(self._lost_m + s, tension, pull_n, curvature)

    def take_tensions(
        self, from_lower_m: Floats, tension_n: Floats, upper_n: float,
        curvature: Floats | None = None,
    ) -> None:  # fmt: skip
        """Add one sample of a rope: nodes from its lower end up, (n + 1,), and elements, (n,)."""
        profile = tension_along(from_lower_m, tension_n, upper_n)
        self._take(profile, float(from_lower_m[-1]), upper_n, curvature)

    def take_over_sheave(self, first: Rope, other: Rope, pulls_n: tuple[float, float]) -> None:
        """Add one sample of two ropes that run as one over the sheave at their upper ends.

        The material is that of the first from its lower end, then that of the other to its lower
        end; pulls_n: tension of each at the sheave [N].
        """
        points, values = tension_along(*_tensions(first), pulls_n[0])
        beyond, beyond_values = tension_along(*_tensions(other), pulls_n[1])
        whole_m = points[-1] + beyond[-1]
        material = np.concatenate((points, whole_m - beyond[::-1]))
        profile = material, np.concatenate((values, beyond_values[::-1]))
        self._take(profile, float(points[-1]), max(pulls_n), None)

    def _take(
        self, profile: tuple[Floats, Floats], top_m: float, pull_n: float, curvature: Floats | None
    ) -> None:
        """Add tensions [N] along the material [m]; the material at `top_m` is on the sheave."""
        load = np.interp(self.middles, *profile, np.nan, np.nan) * self._per_tension
        self._bend_wires(top_m, pull_n)
        if self._over is not None:
            self._over.take(top_m, pull_n)
        if curvature is None:
            loads = np.tile(load, len(self._around))
        else:
            loads = (load + self._around @ (curvature * self._per_curvature)).ravel()
        self._count.take(loads, self._curve.used)

    def _bend_wires(self, top_m: float, pull_n: float) -> None:
        """Count a bending cycle for material that passed a sheave since the last sample."""
        for number, (inboard_m, stress_pa) in enumerate(self._wires):
            aboard = np.where(self.middles > top_m + inboard_m, ABOARD, OUT)
            passed = (aboard != self._aboard[number]) & (self._aboard[number] != UNKNOWN)
            self._aboard[number] = aboard
            if not passed.any():
                continue
            straight = np.where(passed, pull_n * self._per_tension, np.nan)
            for load in (straight, straight + stress_pa, straight):
                self._count.take(np.tile(load, len(self._around)), self._curve.used)

    def snapshot(self, line_out_m: float, counted_s: float) -> MaterialFatigue:
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


def _tensions(rope: Rope) -> tuple[Floats, Floats]:
    """Return nodes from the lower end up [m], and the tension of the elements [N]."""
    n = int(rope.state.counts[rows.ELEMENTS])
    return rope.state.s[: n + 1], rope.work[rows.TENSION, :n]
