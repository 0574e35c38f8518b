"""What follows from a scene's figures by hand calculation, before anything is stepped.

For the sense checks and for `rope_twin scene show`. All for still water and a rope that hangs
straight down; the effects that a scene leaves out are counted here all the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, dist, inf, pi, sqrt
from typing import Any

from rope_twin.effects import EFFECTS
from rope_twin.scene.build import damping_newton_seconds, find_payload, first_axial_frequency
from rope_twin.scene.schema import RopeLine, Scene, Winch
from rope_twin.scene.shapes import PayloadFigures, payload_figures

SCHEDULE_HORIZON_S = 86400.0  # how far ahead a winch schedule is followed


@dataclass(frozen=True)
class LiftFigures:
    """Figures of one rope and what it carries; a fixed lower end has no payload and no weight."""

    payload: PayloadFigures | None
    rope_weight_n_per_m: float  # in water, negative: it floats
    payload_weight_n: float  # in water, 0 at a fixed end
    element_length_m: float
    axial_wave_speed_m_per_s: float  # √(EA/m)
    first_axial_period_s: float  # x·tan x = m·L/M', T = 2π·L/(c·x)
    damping_newton_seconds: float
    damping_fraction: float  # of critical on the first axial mode
    chord_m: float  # hang-off to a fixed lower end; 0 with a payload

    def top_tension_n(self, line_out_m: float) -> float:
        """Static tension at the hang-off with so much rope out: W + w·L [N]."""
        return self.payload_weight_n + self.rope_weight_n_per_m * line_out_m

    def sinking_speed_m_per_s(self, water_density_kg_per_m3: float) -> float:
        """Steady speed of the payload on a slack rope: √(2·W/(ρ·CdA)) [m/s]; 0 if it floats."""
        if self.payload is None or self.payload_weight_n <= 0.0:
            return 0.0
        resistance = 0.5 * water_density_kg_per_m3 * self.payload.drag_area_m2[2]
        return sqrt(self.payload_weight_n / resistance) if resistance > 0.0 else inf


def lift_figures(scene: Scene) -> LiftFigures:
    """The figures of the scene's rope.

    Raises:
        SceneError: if the payload's figures cannot be known.
    """
    line, water = scene.ropes[0], scene.environment
    rope, density = line.rope, water.water_density_kg_per_m3
    payload = find_payload(scene, line)
    known = payload_figures(payload, density) if payload else None
    area = 0.25 * pi * rope.hydrodynamic_diameter_m**2
    submerged = known.mass_kg - density * known.volume_m3 if known else 0.0
    omega = first_axial_frequency(line, known.mass_kg + known.added_mass_kg[2] if known else inf)
    damping = damping_newton_seconds(line, known)
    return LiftFigures(
        payload=known,
        rope_weight_n_per_m=(rope.mass_kg_per_m - density * area) * water.gravity_m_per_s2,
        payload_weight_n=submerged * water.gravity_m_per_s2,
        element_length_m=line.length_m / line.elements,
        axial_wave_speed_m_per_s=sqrt(rope.axial_stiffness_n / rope.mass_kg_per_m),
        first_axial_period_s=2.0 * pi / omega,
        damping_newton_seconds=damping,
        damping_fraction=0.5 * damping * omega / rope.axial_stiffness_n,
        chord_m=dist(line.fixed_at_m, scene.ship.hang_off_m) if line.fixed_at_m else 0.0,
    )


def stretch_m(figures: LiftFigures, line: RopeLine) -> float:
    """Static stretch of the hanging rope: (W + w·L/2)·L/EA [m]."""
    mean = figures.top_tension_n(0.5 * line.length_m)
    return mean * line.length_m / line.rope.axial_stiffness_n


def listed_effects(scene: Scene) -> dict[str, Any]:
    """Name and parameters of each effect that the scene lists, in the order of EFFECTS."""
    return {
        effect.name: params
        for effect in EFFECTS
        for params in scene.effects
        if type(params) is effect.params
    }


def schedule_meets_limit(winch: Winch, length_m: float) -> tuple[float, float] | None:
    """When [s] the schedule first drives the line out to a limit of the winch, and which [m].

    None if it does not within a day. Acceleration is left out: every start and stop shifts the
    line out by at most ½·v²/a, and equal speeds up and down cancel.
    """
    rows, repeat = winch.schedule, winch.schedule_repeats_every_s
    if not rows:
        return None
    line_out = length_m
    ends = [row.at_s for row in rows[1:]] + [repeat or SCHEDULE_HORIZON_S]
    for cycle in range(ceil(SCHEDULE_HORIZON_S / repeat) if repeat else 1):
        for row, end in zip(rows, ends, strict=True):
            after = line_out + row.speed_m_per_s * (end - row.at_s)
            limit = min(max(after, winch.least_line_out_m), winch.most_line_out_m)
            if abs(after - limit) > 1e-6 * limit:
                start = cycle * (repeat or 0.0) + row.at_s
                return start + (limit - line_out) / row.speed_m_per_s, limit
            line_out = after
    return None
