"""Static properties of a lift by hand calculation, before anything is simulated.

For the plausibility checks and for `rope_twin scene show`. All for still water and a rope that
hangs straight down; effects that a scene does not list are included nevertheless.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, dist, inf, pi, sqrt
from typing import Any

import numpy as np

from rope_twin.effects import EFFECTS
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.rigid_body import STEEL, RigidBodyParams
from rope_twin.effects.rope_in_air import WettingParams
from rope_twin.scene.grid import (
    Bar,
    damping_fraction,
    end_mass_kg,
    find_payload,
    first_axial_frequency,
    hanging_bars,
    is_compensated,
    min_line_out_m,
    node_coordinates,
    section_damping,
    weight_n_per_m,
)
from rope_twin.scene.rigging import body_payload, is_joined, places, runs_over_sheave, winch_of
from rope_twin.scene.schema import (
    STEEL_KG_PER_M3,
    WINCH,
    Environment,
    Payload,
    Rope,
    RopeLine,
    Scene,
    Winch,
)
from rope_twin.scene.shapes import NOTHING, PayloadFigures, payload_figures

MIN_ELEMENTS = 2.0  # minimum remaining length of a stretch, in elements


@dataclass(frozen=True)
class SuspendedLoad:
    """Weight of payload and hook as a function of the paid-out length."""

    wet_n: float = 0.0  # submerged payload, and hook
    lift_n: float = 0.0  # the payload's buoyancy, if it can leave the water; else 0
    height_m: float = 1.0  # of the payload
    middle_m: float = 0.0  # height of the payload's middle above the water at zero payout

    def dry_share(self, line_out_m: float) -> float:
        """Return the fraction of the payload above the water, 0 to 1; 0 if treated as submerged."""
        if self.lift_n <= 0.0:
            return 0.0
        return min(max(0.5 + (self.middle_m - line_out_m) / self.height_m, 0.0), 1.0)

    def weight_n(self, line_out_m: float) -> float:
        """Return the static load on the rope's lower end [N]."""
        return self.wet_n + self.dry_share(line_out_m) * self.lift_n


def suspended_load(scene: Scene, figures: PayloadFigures | None) -> SuspendedLoad:
    """Return the suspended load of a single-line scene; in multi-line scenes it is submerged.

    figures: of its payload, or None for a fixed end without a load.
    """
    if figures is None:
        return SuspendedLoad()
    water, body = scene.environment, scene.listed(RigidBodyParams)
    density, g = water.water_density_kg_per_m3, water.gravity_m_per_s2
    lift = density * figures.volume_m3 * g
    hook = body.hook_mass_kg * (1.0 - density / STEEL) * g if body else 0.0
    wet = figures.mass_kg * g - lift + hook
    surfacing = scene.listed(SplashZoneParams)
    if surfacing is None:
        return SuspendedLoad(wet)
    top = scene.ship.hang_off_m[2] - (_below_hook_m(body) if body else 0.0)
    return SuspendedLoad(wet, lift, surfacing.height_m, top)


def _below_hook_m(body: RigidBodyParams) -> float:
    """Return the distance of the body's middle below the rope's end."""
    if body.pinned_at_m is not None:
        return body.pinned_at_m[2]
    drops = [
        sling.to_m[2] + sqrt(max(sling.length_m**2 - sling.to_m[0] ** 2 - sling.to_m[1] ** 2, 0.0))
        for sling in body.slings
    ]
    return sum(drops) / len(drops)


@dataclass(frozen=True)
class SuspendedWeights:
    """Weights in still water."""

    lines: tuple[RopeLine, ...]  # ropes that leave the ship
    ropes: tuple[Rope, ...]  # their topmost sections
    weight_n: float  # of payloads, joints, bars and all paid-out rope at the start
    per_m_n: float  # of the first rope's topmost section: increase with payout [N/m]

    def weight_at(self, line_out_m: float) -> float:
        """Return the weight at a paid-out length of the first rope [N]."""
        return self.weight_n + self.per_m_n * (line_out_m - self.lines[0].length_m)

    @property
    def breaking_load_n(self) -> float:
        """Return the sum of the MBL of the ropes from the ship [N]."""
        return sum(rope.breaking_load_n for rope in self.ropes)


def suspended_weights(scene: Scene) -> SuspendedWeights | None:
    """Return the weights of a multi-line scene; None with a fixed end or a tether."""
    if scene.sheaves or any(line.fixed_at_m for line in scene.ropes):
        return None
    water = scene.environment
    density, g = water.water_density_kg_per_m3, water.gravity_m_per_s2
    loads = point_figures(scene).values()
    weight = sum((load.mass_kg - density * load.volume_m3) * g for load in loads)
    for line in scene.ropes:
        lengths = zip(line.made_of, line.lengths_m(line.length_m), strict=True)
        weight += sum(weight_n_per_m(section.rope, water) * length for section, length in lengths)
    tips = places(scene)
    from_ship = tuple(line for line in scene.ropes if line.from_ in tips)
    tops = tuple(line.made_of[-1].rope for line in from_ship)
    for line, top in zip(from_ship, tops, strict=True):
        weight += _lift_n_per_m(top, water) * min(_dry_m(scene, tips[line.from_]), line.length_m)
    return SuspendedWeights(from_ship, tops, weight, weight_n_per_m(tops[0], water))


SCHEDULE_HORIZON_S = 86400.0  # time horizon for following a winch schedule


@dataclass(frozen=True)
class LiftFigures:
    """Properties of one rope and its load; a fixed lower end has no payload and no weight."""

    line: RopeLine
    payload: PayloadFigures | None
    bars: tuple[Bar, ...]  # the sections at the start, from the lower end up
    rope_weight_n_per_m: float  # in water, mean over the paid-out length; negative: buoyant
    payload_weight_n: float  # in water, 0 at a fixed end
    suspended: SuspendedLoad  # suspended load: payload and hook, heavier above the water
    longest_element_m: float
    shortest_element_m: float
    axial_wave_speed_m_per_s: float  # √(EA/m); for several sections length over travel time
    first_axial_period_s: float  # x·tan x = m·L/M', T = 2π·L/(c·x)
    damping_newton_seconds: tuple[float, ...]  # of each section
    damping_fraction: float  # damping ratio of the first axial mode
    chord_m: float  # hang-off to a fixed lower end; 0 with a payload
    dry_m: float  # length of rope above the water that has its weight in air (`wetting`)
    lifts_n_per_m: tuple[float, ...]  # buoyancy of each section in water

    @property
    def rises(self) -> bool:
        """Return whether payload and rope together are buoyant."""
        return self.payload is not None and self.top_tension_n(self.line.length_m) < 0.0

    def top_tension_n(self, line_out_m: float) -> float:
        """Return the static tension at the hang-off for a paid-out length: W(L) + w·L [N]."""
        return self.upper_ends(line_out_m)[-1][1]

    def upper_ends(self, line_out_m: float) -> list[tuple[Rope, float]]:
        """Return each paid-out section and the static tension at its upper end [N]."""
        ends, tension, above_m = [], self.suspended.weight_n(line_out_m), line_out_m
        lengths = self.line.lengths_m(line_out_m)
        for bar, lift, length in zip(self.bars, self.lifts_n_per_m, lengths, strict=True):
            above_m -= length
            tension += bar.weight_n_per_m * length
            tension += lift * min(max(self.dry_m - above_m, 0.0), length)
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
    elements = np.diff(node_coordinates(line, min_line_out_m(scene), is_compensated(scene)))
    return LiftFigures(
        line=line,
        payload=known,
        bars=tuple(bars),
        rope_weight_n_per_m=sum(b.weight_n_per_m * b.length_m for b in bars) / line.length_m,
        payload_weight_n=weight,
        suspended=SuspendedLoad(weight) if joined else suspended_load(scene, known),
        longest_element_m=float(elements.max()),
        shortest_element_m=float(elements.min()),
        axial_wave_speed_m_per_s=line.length_m / sum(bar.travel_s for bar in bars),
        first_axial_period_s=2.0 * pi / first_axial_frequency(bars, mass),
        damping_newton_seconds=tuple(damping),
        damping_fraction=damping_fraction(bars, damping, mass),
        chord_m=dist(line.fixed_at_m, scene.ship.hang_off_m) if line.fixed_at_m else 0.0,
        dry_m=_dry_m(scene, scene.ship.hang_off_m),
        lifts_n_per_m=tuple(_lift_n_per_m(section.rope, water) for section in line.made_of),
    )


def _dry_m(scene: Scene, hang_off_m: tuple[float, float, float]) -> float:
    """Return the length of a rope straight down from a hang-off that is weighed in air [m]."""
    return max(hang_off_m[2], 0.0) if scene.listed(WettingParams) is not None else 0.0


def _lift_n_per_m(rope: Rope, water: Environment) -> float:
    """Return a rope's buoyancy per unstretched metre [N/m]."""
    return rope.mass_kg_per_m * water.gravity_m_per_s2 - weight_n_per_m(rope, water)


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
            limit = min(max(after, winch.min_line_out_m), winch.max_line_out_m)
            if abs(after - limit) > 1e-6 * limit:
                start = cycle * (repeat or 0.0) + at_s
                return start + (limit - line_out) / speed, limit
            line_out = after
    return None


def room_for(scene: Scene, line: RopeLine) -> Winch:
    """Return the range of a stretch's length, as limits of a winch at its end."""
    both = sum(candidate.length_m for candidate in scene.ropes if candidate.to == line.to)
    return Winch(
        speed_limit_m_per_s=1.0,
        acceleration_limit_m_per_s2=1.0,
        min_line_out_m=max(1.0, MIN_ELEMENTS * line.length_m / line.elements),
        max_line_out_m=both,
    )


def alone(scene: Scene, number: int) -> Scene:
    """Return a scene of one rope, with all payloads and connections at its lower end."""
    line = scene.ropes[number]
    winch = winch_of(scene, line)
    if runs_over_sheave(scene, line):
        winch = room_for(scene, line)
    total = NOTHING
    for figures in point_figures(scene).values():
        total = _sum(total, figures)
    load = Payload(
        name="load",
        mass_kg=total.mass_kg,
        displaced_volume_m3=total.volume_m3,
        added_mass_kg=total.added_mass_kg,
        drag_area_m2=total.drag_area_m2,
    )
    top = places(scene).get(line.from_, scene.ship.hang_off_m)
    return replace(
        scene,
        ropes=(replace(line, from_=WINCH, to="load", fixed_at_m=None),),
        payloads=(load,),
        joints=(),
        struts=(),
        sheaves=(),
        hang_offs=(),
        winch=winch,
        ship=replace(scene.ship, hang_off_m=top),
    )


def point_figures(scene: Scene) -> dict[str, PayloadFigures]:
    """Return the properties of each payload and connection, with half the mass of its bars.

    Those of a rigid body include its hook.
    """
    density = scene.environment.water_density_kg_per_m3
    figures = {payload.name: payload_figures(payload, density) for payload in scene.payloads}
    figures |= {joint.name: _steel(joint.mass_kg) for joint in scene.joints}
    for strut in scene.struts:
        for name in strut.between:
            figures[name] = _sum(figures[name], _steel(0.5 * strut.mass_kg))
    body, carried = scene.listed(RigidBodyParams), body_payload(scene)
    if body is not None and carried is not None:
        figures[carried] = _sum(figures[carried], _steel(body.hook_mass_kg))
    return figures


def _steel(mass_kg: float) -> PayloadFigures:
    return replace(NOTHING, mass_kg=mass_kg, volume_m3=mass_kg / STEEL_KG_PER_M3)


def _sum(first: PayloadFigures, second: PayloadFigures) -> PayloadFigures:
    x, y, z = (a + b for a, b in zip(first.added_mass_kg, second.added_mass_kg, strict=True))
    u, v, w = (a + b for a, b in zip(first.drag_area_m2, second.drag_area_m2, strict=True))
    return PayloadFigures(
        mass_kg=first.mass_kg + second.mass_kg,
        volume_m3=first.volume_m3 + second.volume_m3,
        added_mass_kg=(x, y, z),
        drag_area_m2=(u, v, w),
        added_mass_rising_kg=first.rising_added_mass_kg + second.rising_added_mass_kg,
        drag_area_rising_m2=first.rising_drag_area_m2 + second.rising_drag_area_m2,
    )
