"""Simplified method of DNV-RP-N103 (formerly H103), from the same inputs as the runs.

Everything is linear or quadratic in a characteristic amplitude of the crane tip; no seed, no
history. The formulas, with the sections of DNV-RP-H103 (April 2011), whose text is public:

- Resonance (5.3.5): T0 = 2π·√((M + A33 + m·L/3)/k), k = EA/L.
- Payload on a long rope (5.3.6): η/η_tip = kE/(kE·cos κL + h·sin κL), h = -ω²·(M + A33) + iω·Σ,
  κ = ω·√(m/EA*)·√(1 - iσ/(mω)); Σ and σ are drag of payload and rope, linearised for a Gaussian
  velocity about the lowering speed (Borgman 1967): slope 2·E|v_c + v|.
- Splash zone (4.3): F_hyd = √((F_D + F_slam)² + (F_M - F_ρ)²), with the wave amplitude 0.9·Hs.
- Lift-off (API Spec 2C, 7th ed., 5.4.5; DNV 2.22): DAF = 1 + V_R·√(K/(g·W)), or W + V_R·√(K·M),
  exact for a rope without mass and damping that is hauled at V_R. V_R is the speed of the winch and
  the characteristic speed between crane tip and deck, here from their RAOs in one sea in place of
  the root of both squares. K: rope and slings in series.
- Lateral offset: ∫ H/T over the rope, with the drag H below and the weight T below, small angles.
- Snap (4.7.2): F_snap = v_snap·√(K·(M + A33)), v_snap = v_ff + C·v_r, with the free-fall velocity
  v_ff = √(2·W/(ρ·C_D·A)), C = 1 up to v_ff = 0.2·v_r, cos(π·(v_ff/v_r - 0.2)) up to 0.7, then 0.

Characteristic amplitudes are those that a Rayleigh distribution gives for the percentile and the
exposure of the plan; the method of the rule takes the most probable largest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.estimation.noise import linear_drag
from rope_twin.planning.judgement import rayleigh_factor
from rope_twin.planning.phases import Leg
from rope_twin.planning.seas import (
    PointTransfer,
    RelativeTip,
    SeaState,
    TipTransfer,
    lateral_moments,
    tip_moments,
    tip_spectrum,
)
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.schema import Rope
from rope_twin.sea.spectrum import zero_crossing_period_s
from rope_twin.sea.tables import Vector

Complex = NDArray[np.complex128]

ROUNDS, SETTLED = 60, 1e-6  # of the linearisation
FOOT = 0.3048  # m
OFFSET_POINTS = 400  # along the rope
AMPLITUDE = 0.9  # characteristic wave amplitude over Hs
LOW, HIGH = 0.2, 0.7  # v_ff/v_r between which the correction of the snap velocity falls


@dataclass(frozen=True)
class Lift:
    """Figures of a vertical rope with its payload, in SI units."""

    length_m: float
    EA_n: float
    mass_kg_per_m: float
    rope_damping_newton_seconds: float  # c of EA·strain + c·strain rate
    rope_drag_kg_per_m2: float  # ½·ρ·C_t·π·d
    mass_kg: float  # payload in air
    added_mass_kg: float  # A33
    drag_kg_per_m: float  # ½·ρ·C_D·A
    weight_n: float  # submerged
    displaced_kg: float  # ρ·V
    static_hook_n: float

    @property
    def moved_kg(self) -> float:
        """Return M + A33."""
        return self.mass_kg + self.added_mass_kg

    @property
    def stiffness_n_per_m(self) -> float:
        """Return k = EA/L."""
        return self.EA_n / self.length_m


def lift_of(leg: Leg) -> Lift:
    """Return the figures at the end of a leg; sections of the rope act as springs in series."""
    scene = leg.scene
    figures = lift_figures(scene)
    payload = figures.payload
    assert payload is not None, "checked when the plan was read"
    density = scene.environment.water_density_kg_per_m3
    lengths = scene.ropes[0].lengths_m(leg.line_out_m)
    bars = [
        (bar, length) for bar, length in zip(figures.bars, lengths, strict=True) if length > 0.0
    ]
    length_m = sum(length for _, length in bars)
    EA = length_m / sum(length / bar.stiffness_n for bar, length in bars)
    drag, dry = scene.listed(DragParams), leg.in_air and scene.listed(SplashZoneParams) is not None
    skin = sum(_drag_diameter_m(bar.rope, drag, "tangential") * length for bar, length in bars)
    return Lift(
        length_m=length_m,
        EA_n=EA,
        mass_kg_per_m=sum(bar.inertia_kg_per_m * length for bar, length in bars) / length_m,
        rope_damping_newton_seconds=max(figures.damping_newton_seconds),
        rope_drag_kg_per_m2=0.5 * density * math.pi * skin / length_m,
        mass_kg=payload.mass_kg,
        added_mass_kg=0.0 if dry else payload.added_mass_kg[2],
        drag_kg_per_m=0.0 if dry else 0.5 * density * payload.drag_area_m2[2],
        weight_n=leg.payload_n,
        displaced_kg=density * payload.volume_m3,
        static_hook_n=leg.static_hook_n,
    )


def _drag_diameter_m(rope: Rope, drag: DragParams | None, direction: str) -> float:
    """Return C·d of a rope [m]: its own coefficient on its nominal, else that of the scene.

    along: normal or tangential; the scene's refers to the hydrodynamic diameter.
    """
    factor: float | None = getattr(rope, f"drag_{direction}")
    if drag is None:
        return 0.0
    if factor is not None:
        return rope.diameter_m * factor
    return rope.hydrodynamic_diameter_m * float(getattr(drag, direction))


def resonance_period_s(lift: Lift) -> float:
    """Return T0 = 2π·√((M + A33 + m·L/3)/k)."""
    effective_kg = lift.moved_kg + lift.mass_kg_per_m * lift.length_m / 3.0
    return 2.0 * math.pi * math.sqrt(effective_kg / lift.stiffness_n_per_m)


@dataclass(frozen=True)
class Transfer:
    """Response to the crane tip's height at frequencies ω, (n,) each."""

    payload: Complex  # motion of the payload over that of the tip
    payload_n_per_m: Complex  # dynamic force of the rope on the payload
    hook_n_per_m: Complex  # dynamic force at the crane tip


def rope_transfer(lift: Lift, omega: Vector, payload_slope: float, rope_slope: float) -> Transfer:
    """Return the response of payload and rope with linear drag.

    payload_slope, rope_slope: of `linear_drag` [m/s].
    """
    EA = lift.EA_n + 1j * omega * lift.rope_damping_newton_seconds
    sigma = lift.rope_drag_kg_per_m2 * rope_slope
    kappa = np.sqrt((lift.mass_kg_per_m * omega**2 - 1j * omega * sigma) / EA)
    damping = lift.drag_kg_per_m * payload_slope
    h = -(omega**2) * lift.moved_kg + 1j * omega * damping
    c, s = np.cos(kappa * lift.length_m), np.sin(kappa * lift.length_m)
    payload = 1.0 / (c + h / (EA * kappa) * s)
    return Transfer(payload, h * payload, payload * (h * c - EA * kappa * s))


@dataclass(frozen=True)
class Simplified:
    """Characteristic values by the simplified method; None where it has none."""

    tip_m: float  # amplitude of the crane tip
    tip_m_per_s: float
    tip_period_s: float
    hook_n: float  # largest hook load
    payload_min_n: float  # least load of the payload
    payload_max_n: float
    uplift_share: float  # hydrodynamic force over the submerged weight
    snap_n: float  # snap force should the rope go slack; NaN: in air
    payload_m_per_s: float  # speed of the payload, with that of the winch
    re_hit_m_per_s: float  # by which the deck is faster than the winch, on a rigid rope; 0: none
    offset_m: float  # lateral, at rest
    words: str  # which formulas


def simplified(leg: Leg, tip: TipTransfer, sea: SeaState, percentile: float) -> Simplified:
    """Return the characteristic values of a leg in a sea, over its exposure."""
    lift, moments = lift_of(leg), tip_moments(tip, sea)
    factor = rayleigh_factor(leg.window_s / moments.crossing_period_s, percentile)
    amplitude, speed, acceleration = (
        factor * rms for rms in (moments.rms_m, moments.rms_m_per_s, moments.rms_m_per_s2)
    )
    zone, re_hit = leg.scene.listed(SplashZoneParams), 0.0
    if leg.deck_m is not None:
        closing = relative_speed(leg, tip, sea, percentile)
        relative = closing - leg.speed_m_per_s
        hook, low = lift_off_n(leg, lift, relative), lift.weight_n
        high = hook - leg.static_hook_n + lift.weight_n
        re_hit = max(closing + leg.speed_m_per_s, 0.0)
        formula, snap = "lift-off, API Spec 2C 5.4.5", hook - leg.static_hook_n
    elif leg.from_m <= 0.0 and zone is not None and not leg.in_air:
        relative, hydro = splash_force(lift, leg, zone, sea, (amplitude, speed, acceleration))
        hook = leg.static_hook_n + hydro
        low, high = lift.weight_n - hydro, lift.weight_n + hydro
        formula, snap = "splash zone, 4.3", snap_force_n(lift, relative)
    else:
        hook, (low, high), relative = _on_long_rope(lift, leg, tip, sea, percentile)
        formula, snap = "rope with payload, 5.3.6", snap_force_n(lift, relative)
        if leg.in_air:  # the free fall of the formula is that in water
            snap = math.nan
    return Simplified(
        tip_m=amplitude,
        tip_m_per_s=speed,
        tip_period_s=moments.crossing_period_s,
        hook_n=hook,
        payload_min_n=low,
        payload_max_n=high,
        uplift_share=1.0 - low / lift.weight_n,
        snap_n=snap,
        payload_m_per_s=relative,
        re_hit_m_per_s=re_hit,
        offset_m=lateral_offset_m(leg, lift),
        words=formula,
    )


def relative_speed(leg: Leg, tip: TipTransfer, sea: SeaState, percentile: float) -> float:
    """Return the characteristic vertical speed between crane tip and deck [m/s]."""
    moments = tip_moments(_over_deck(leg, tip), sea)
    factor = rayleigh_factor(leg.window_s / moments.crossing_period_s, percentile)
    return factor * moments.rms_m_per_s


def relative_offset_m(leg: Leg, tip: TipTransfer, sea: SeaState, percentile: float) -> float:
    """Return the characteristic horizontal motion of the crane tip against the deck [m]."""
    moments = lateral_moments(_over_deck(leg, tip), sea)
    if moments.rms_m == 0.0:
        return 0.0
    return rayleigh_factor(leg.window_s / moments.crossing_period_s, percentile) * moments.rms_m


def _over_deck(leg: Leg, tip: TipTransfer) -> PointTransfer:
    return tip if leg.deck is None else RelativeTip(tip, leg.deck)


def lift_off_n(leg: Leg, lift: Lift, relative_m_per_s: float) -> float:
    """Return the hook load as a rope takes an object off a deck at a relative speed [N]."""
    body = leg.scene.listed(RigidBodyParams)
    assert body is not None, "checked when the plan was read"
    g, rope = leg.scene.environment.gravity_m_per_s2, lift.EA_n / leg.scene.ropes[0].length_m
    flexible = 1.0 / rope + 1.0 / vertical_stiffness_n_per_m(body)
    mass = lift.weight_n / g  # of object and hook; buoyancy in air is nothing
    return leg.static_hook_n + relative_m_per_s * math.sqrt(mass / flexible)


def vertical_stiffness_n_per_m(body: RigidBodyParams) -> float:
    """Return the stiffness of a body's slings below the hook, Σ k·cos² of their inclination."""
    if body.pinned_at_m is not None:
        return body.pin_stiffness_n_per_m
    flat = [math.hypot(sling.to_m[0], sling.to_m[1]) / sling.length_m for sling in body.slings]
    parts = zip(body.slings, flat, strict=True)
    return sum(one.stiffness_n_per_m * max(1.0 - sin**2, 0.0) for one, sin in parts)


def lift_off_speed(height_m: float) -> float:
    """Return the least hoisting speed for a lift off a supply vessel at this Hs [m/s].

    API Spec 2C, 7th ed., 5.4.5.2: 0.033 + 0.098·Hs up to 6 ft, above 0.067·(Hs + 3.3), in ft and s.
    """
    feet = height_m / FOOT
    return FOOT * (0.033 + 0.098 * feet if feet <= 6.0 else 0.067 * (feet + 3.3))


def lateral_offset_m(leg: Leg, lift: Lift) -> float:
    """Return the horizontal offset of the payload from the crane tip in the scene's current [m].

    Small angles: with the drag H of all below and the weight T of all below, ∫ H/T over the rope.
    """
    current, drag = leg.scene.listed(CurrentParams), leg.scene.listed(DragParams)
    if current is None or leg.to_m <= 0.0:
        return 0.0
    figures = lift_figures(leg.scene)
    payload = figures.payload
    assert payload is not None, "checked when the plan was read"
    half = 0.5 * leg.scene.environment.water_density_kg_per_m3
    z, *velocity = current.table[::-1, :3].T
    s = np.linspace(0.0, lift.length_m, OFFSET_POINTS)  # from the payload up
    height = -leg.to_m + s
    flow = np.stack([np.interp(height, z, component) for component in velocity])
    flow[:, height > 0.0] = 0.0
    force = flow * np.hypot(*flow)
    lengths = leg.scene.ropes[0].lengths_m(leg.line_out_m)
    section = np.searchsorted(np.cumsum(lengths)[:-1], s, side="right")
    drag_diameters = np.array([_drag_diameter_m(bar.rope, drag, "normal") for bar in figures.bars])
    heavy = np.array([bar.weight_n_per_m for bar in figures.bars])[section]
    per_m, step = half * drag_diameters[section] * force, s[1] - s[0]
    below = np.zeros_like(flow)
    below[:, 1:] = step * np.cumsum(0.5 * (per_m[:, 1:] + per_m[:, :-1]), axis=1)
    tension_n = lift.weight_n + np.append(0.0, step * np.cumsum(0.5 * (heavy[1:] + heavy[:-1])))
    area = np.array(payload.drag_area_m2[:2])[:, None]
    lean = (half * area * force[:, :1] + below) / tension_n
    return float(np.hypot(*np.trapezoid(lean, s, axis=1)))


def _on_long_rope(
    lift: Lift, leg: Leg, tip: TipTransfer, sea: SeaState, percentile: float
) -> tuple[float, tuple[float, float], float]:
    """Return hook load, least and largest load of the payload [N], and its largest speed [m/s]."""
    frequency, density = tip_spectrum(tip, sea)
    omega = 2.0 * np.pi * frequency

    def rms(response: NDArray[Any]) -> float:
        return math.sqrt(float(np.trapezoid(np.abs(response) ** 2 * density, frequency)))

    tip_speed = rms(1j * omega)
    speed, line_speed = tip_speed, np.array([leg.speed_m_per_s])
    for _ in range(ROUNDS):
        sigma = np.array([speed, 0.5 * (speed + tip_speed)])  # of the payload and of the rope
        slopes = linear_drag(sigma, line_speed)
        answer = rope_transfer(lift, omega, float(slopes[0]), float(slopes[1]))
        response_speed = rms(1j * omega * answer.payload)
        if abs(response_speed - speed) <= SETTLED * tip_speed:
            break
        speed = 0.5 * (speed + response_speed)
    period = 2.0 * math.pi * rms(answer.payload) / speed if speed > 0.0 else math.inf
    factor = rayleigh_factor(leg.window_s / period, percentile)
    steady = (lift.drag_kg_per_m + lift.rope_drag_kg_per_m2 * lift.length_m) * leg.speed_m_per_s**2
    held = lift.drag_kg_per_m * leg.speed_m_per_s**2  # takes load off the payload
    hook = lift.static_hook_n - steady + factor * rms(answer.hook_n_per_m)
    mean, change = lift.weight_n - held, factor * rms(answer.payload_n_per_m)
    return hook, (mean - change, mean + change), leg.speed_m_per_s + factor * speed


def splash_force(
    lift: Lift,
    leg: Leg,
    zone: SplashZoneParams,
    sea: SeaState,
    motion: tuple[float, float, float],
) -> tuple[float, float]:
    """Return relative speed [m/s] and characteristic hydrodynamic force [N] in the splash zone.

    The larger of two load cases: the bottom at the still water level, with slamming and varying
    buoyancy; and the payload just submerged, with drag and mass force.

    motion: characteristic amplitude, speed and acceleration of the crane tip.
    """
    eta, speed, acceleration = motion
    water = leg.scene.environment
    density, g = water.water_density_kg_per_m3, water.gravity_m_per_s2
    period = zero_crossing_period_s(sea.spectrum())
    omega = 2.0 * math.pi / period
    wave = AMPLITUDE * sea.height_m
    middle = math.exp(-(omega**2) * 0.5 * zone.height_m / g)
    surface_speed = leg.speed_m_per_s + math.hypot(speed, wave * omega)
    slam = 0.5 * density * zone.slamming * zone.bottom_area_m2 * surface_speed**2
    column = lift.displaced_kg / zone.height_m  # ρ·A_w
    buoyancy = column * g * min(math.hypot(wave, eta), 0.5 * zone.height_m)
    entering = math.hypot(slam, buoyancy)
    relative = leg.speed_m_per_s + math.hypot(speed, wave * omega * middle)
    drag = lift.drag_kg_per_m * relative**2
    mass = math.hypot(
        lift.moved_kg * acceleration,
        (lift.displaced_kg + lift.added_mass_kg) * wave * omega**2 * middle,
    )
    return relative, max(entering, math.hypot(drag, mass))


def snap_force_n(lift: Lift, relative_m_per_s: float) -> float:
    """Return v_snap·√(K·(M + A33)); 0 for a payload that does not sink."""
    if lift.weight_n <= 0.0 or lift.drag_kg_per_m <= 0.0:
        return 0.0
    fall = math.sqrt(lift.weight_n / lift.drag_kg_per_m)
    return snap_speed(fall, relative_m_per_s) * math.sqrt(lift.stiffness_n_per_m * lift.moved_kg)


def snap_speed(fall_m_per_s: float, relative_m_per_s: float) -> float:
    """Return v_snap = v_ff + C·v_r [m/s]."""
    if relative_m_per_s <= 0.0:
        return fall_m_per_s
    ratio = fall_m_per_s / relative_m_per_s
    if ratio < LOW:
        factor = 1.0
    elif ratio < HIGH:
        factor = math.cos(math.pi * (ratio - LOW))
    else:
        factor = 0.0
    return fall_m_per_s + factor * relative_m_per_s
