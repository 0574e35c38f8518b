"""Static properties of a lift by hand calculation, before anything is simulated.

For the plausibility checks and for `rope_twin scene show`. All for still water and a rope that
hangs straight down; effects that a scene does not list are included nevertheless.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, dist, inf, pi, sqrt
from typing import Any

import numpy as np

from rope_twin.effects import EFFECTS
from rope_twin.scene.arrays.build import find_payload, hanging_bars, section_damping
from rope_twin.scene.arrays.composite import (
    Bar,
    damping_fraction,
    end_mass_kg,
    first_axial_frequency,
)
from rope_twin.scene.arrays.grid import least_line_out_m, node_coordinates
from rope_twin.scene.arrays.joined import alone
from rope_twin.scene.hung_load import HungLoad, hung_load
from rope_twin.scene.rules.rigging import is_joined
from rope_twin.scene.schema import Rope, RopeLine, Scene, Winch
from rope_twin.scene.shapes.shapes import PayloadFigures, payload_figures

SCHEDULE_HORIZON_S = 86400.0  # time horizon for following a winch schedule


@dataclass(frozen=True)
class LiftFigures:
    """Properties of one rope and its load; a fixed lower end has no payload and no weight."""

    line: RopeLine
    payload: PayloadFigures | None
    bars: tuple[Bar, ...]  # the sections at the start, from the lower end up
    rope_weight_n_per_m: float  # in water, mean over the paid-out length; negative: buoyant
    payload_weight_n: float  # in water, 0 at a fixed end
    hung: HungLoad  # suspended load: payload and hook, heavier above the water
    longest_element_m: float
    shortest_element_m: float
    axial_wave_speed_m_per_s: float  # √(EA/m); for several sections length over travel time
    first_axial_period_s: float  # x·tan x = m·L/M', T = 2π·L/(c·x)
    damping_newton_seconds: tuple[float, ...]  # of each section
    damping_fraction: float  # damping ratio of the first axial mode
    chord_m: float  # hang-off to a fixed lower end; 0 with a payload

    @property
    def rises(self) -> bool:
        """Return whether payload and rope together are buoyant."""
        return self.payload is not None and self.top_tension_n(self.line.length_m) < 0.0

    def top_tension_n(self, line_out_m: float) -> float:
        """Return the static tension at the hang-off for a paid-out length: W(L) + w·L [N]."""
        return self.upper_ends(line_out_m)[-1][1]

    def upper_ends(self, line_out_m: float) -> list[tuple[Rope, float]]:
        """Return each paid-out section and the static tension at its upper end [N]."""
        ends, tension = [], self.hung.weight_n(line_out_m)
        for bar, length in zip(self.bars, self.line.lengths_m(line_out_m), strict=True):
            tension += bar.weight_n_per_m * length
            if length > 0.0:
                ends.append((bar.rope, tension))
        return ends

    def weakest(self, line_out_m: float) -> tuple[Rope, float]:
        """Return the section with the smallest safety factor, and its upper static tension [N]."""
        ends = self.upper_ends(line_out_m)
        return max(ends, key=lambda end: end[1] / end[0].breaking_load_n)

    def sinking_speed_m_per_s(self, water_density_kg_per_m3: float) -> float:
        """Return the terminal velocity of the payload on a slack rope, √(2·W/(ρ·CdA)) [m/s].

        It is 0 if the payload is buoyant.
        """
        if self.payload is None or self.payload_weight_n <= 0.0:
            return 0.0
        resistance = 0.5 * water_density_kg_per_m3 * self.payload.drag_area_m2[2]
        return sqrt(self.payload_weight_n / resistance) if resistance > 0.0 else inf


def lift_figures(scene: Scene) -> LiftFigures:
    """Return the properties of the scene's rope; in a multi-line scene of the first one.

    The first rope then carries the total suspended load.

    Raises:
        SceneError: the payload's properties are incomplete.
    """
    joined = is_joined(scene)
    if joined:
        scene = alone(scene, 0)
    line, water = scene.ropes[0], scene.environment
    density = water.water_density_kg_per_m3
    payload = find_payload(scene, line)
    known = payload_figures(payload, density) if payload else None
    submerged = known.mass_kg - density * known.volume_m3 if known else 0.0
    weight = submerged * water.gravity_m_per_s2
    mass, bars = end_mass_kg(known), hanging_bars(scene, line, known, line.length_m)
    damping = section_damping(scene, line, known)
    elements = np.diff(node_coordinates(line, least_line_out_m(scene)))
    return LiftFigures(
        line=line,
        payload=known,
        bars=tuple(bars),
        rope_weight_n_per_m=sum(b.weight_n_per_m * b.length_m for b in bars) / line.length_m,
        payload_weight_n=weight,
        hung=HungLoad(weight) if joined else hung_load(scene, known),
        longest_element_m=float(elements.max()),
        shortest_element_m=float(elements.min()),
        axial_wave_speed_m_per_s=line.length_m / sum(bar.travel_s for bar in bars),
        first_axial_period_s=2.0 * pi / first_axial_frequency(bars, mass),
        damping_newton_seconds=tuple(damping),
        damping_fraction=damping_fraction(bars, damping, mass),
        chord_m=dist(line.fixed_at_m, scene.ship.hang_off_m) if line.fixed_at_m else 0.0,
    )


def stretch_m(figures: LiftFigures) -> float:
    """Return the static elongation of the hanging rope: (W + w·L/2)·L/EA of each section [m]."""
    return sum(bar.stretch_m for bar in figures.bars)


def listed_effects(scene: Scene) -> dict[str, Any]:
    """Return name and parameters of each effect that the scene lists, in the order of EFFECTS."""
    return {
        effect.name: params
        for effect in EFFECTS
        for params in scene.effects
        if type(params) is effect.params
    }


def schedule_meets_limit(winch: Winch, length_m: float) -> tuple[float, float] | None:
    """Return when [s] the schedule first reaches a payout limit of the winch, and which [m].

    None if it does not within a day. Acceleration is neglected: every start and stop shifts the
    paid-out length by at most ½·v²/a, and equal speeds up and down cancel. Only rows with a speed
    are considered.
    """
    repeat = winch.schedule_repeats_every_s
    rows = [(row.at_s, row.speed_m_per_s) for row in winch.schedule if not row.switch]
    if not rows:
        return None
    line_out = length_m
    ends = [at_s for at_s, _ in rows[1:]] + [repeat or SCHEDULE_HORIZON_S]
    for cycle in range(ceil(SCHEDULE_HORIZON_S / repeat) if repeat else 1):
        for (at_s, speed), end in zip(rows, ends, strict=True):
            if speed is None:
                return None
            after = line_out + speed * (end - at_s)
            limit = min(max(after, winch.least_line_out_m), winch.most_line_out_m)
            if abs(after - limit) > 1e-6 * limit:
                start = cycle * (repeat or 0.0) + at_s
                return start + (limit - line_out) / speed, limit
            line_out = after
    return None
