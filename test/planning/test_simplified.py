"""Formulas of the simplified method by hand, and against modes and limiting cases."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rope_twin.effects.payload import SplashZoneParams
from rope_twin.planning.phases import legs_of, suspended_at
from rope_twin.planning.plan_reader import read_plan
from rope_twin.planning.seas import SeaState
from rope_twin.planning.simplified import (
    Lift,
    lateral_offset_m,
    lift_of,
    resonance_period_s,
    rope_transfer,
    snap_force_n,
    snap_speed,
    splash_force,
)
from rope_twin.scene.error_bound import Setting
from rope_twin.scene.load import load_scene
from rope_twin.studies.modes import find_modes

LIFT = Lift(
    length_m=2000.0,
    EA_n=8.0e7,
    mass_kg_per_m=6.0,
    rope_damping_newton_seconds=0.0,
    rope_drag_kg_per_m2=0.0,
    mass_kg=20_000.0,
    added_mass_kg=30_000.0,
    drag_kg_per_m=9_000.0,
    weight_n=156_000.0,
    displaced_kg=4_100.0,
    static_hook_n=250_000.0,
)


def test_resonance_by_hand() -> None:
    """k = 40 kN/m and 54 t: T0 = 2π·√(54,000/40,000) = 7.30 s."""
    assert resonance_period_s(LIFT) == pytest.approx(7.3003, abs=1e-3)


@pytest.mark.parametrize("depth_m", [200.0, 600.0, 1500.0, 2900.0])
def test_resonance_over_depth_is_that_of_the_twin(depth_m: float) -> None:
    """First axial mode of the scene's mesh within 0.5 %, at each depth."""
    plan, scene = read_plan("deep_installation")
    phase = plan.phases[1]
    assert phase.at_depth is not None
    own = replace(phase, at_depth=replace(phase.at_depth, depth_m=depth_m))
    (leg,) = legs_of(plan, scene, own)
    twin = find_modes(leg.at_setting(Setting(80, 0.05)).scene, 1).axial[0].period_s
    assert resonance_period_s(lift_of(leg)) == pytest.approx(twin, rel=5e-3)


def test_payload_hangs_at_its_depth() -> None:
    """Static stretch is taken off the line: 2,900 m of depth take less line than that."""
    made, depth, height, *_ = suspended_at(load_scene("deep_lift"), 2900.0)
    assert depth == pytest.approx(2900.0, abs=2e-3)
    assert 2880.0 < made.ropes[0].length_m < 2895.0
    assert height is None


def test_drag_along_the_rope_is_that_of_the_twin() -> None:
    """½·ρ·C·π·d: the scene's C on the hydrodynamic diameter, a rope's own on the nominal one."""
    plan, scene = read_plan("deep_installation")
    (leg,) = legs_of(plan, scene, plan.phases[1])
    by_scene = 0.5 * 1025.0 * 0.03 * math.pi * 0.032
    assert lift_of(leg).rope_drag_kg_per_m2 == pytest.approx(by_scene, rel=1e-9)
    (line,) = scene.ropes
    (section,) = line.made_of
    own = replace(section, rope=replace(section.rope, drag_tangential=0.01))
    changed = replace(scene, ropes=(replace(line, rope=None, sections=(own,)),))
    (leg,) = legs_of(plan, changed, plan.phases[1])
    by_rope = 0.5 * 1025.0 * 0.01 * math.pi * 0.04
    assert lift_of(leg).rope_drag_kg_per_m2 == pytest.approx(by_rope, rel=1e-9)


def test_offset_of_a_rope_in_sections_is_that_of_the_twin() -> None:
    """Chain, HMPE and steel wire count by their lengths, diameters and weights."""
    plan, _ = read_plan("deep_installation")
    phase = plan.phases[1]
    assert phase.at_depth is not None
    own = replace(phase, at_depth=replace(phase.at_depth, depth_m=1900.0))
    (leg,) = legs_of(plan, load_scene("hybrid_lift"), own)
    assert lateral_offset_m(leg, lift_of(leg)) == pytest.approx(leg.offset_m, rel=0.01)


def test_rope_transfer_without_drag_is_the_formula() -> None:
    """η/η_tip = kE/(kE·cos kL - ω²·M·sin kL) with kE = ω·√(m·EA), typed out."""
    omega = np.array([0.3, 0.6, 1.1])
    wave = omega * math.sqrt(LIFT.mass_kg_per_m / LIFT.EA_n)
    kE = wave * LIFT.EA_n
    below = kE * np.cos(wave * 2000.0) - omega**2 * 50_000.0 * np.sin(wave * 2000.0)
    found = rope_transfer(LIFT, omega, 0.0, 0.0)
    np.testing.assert_allclose(found.payload, kE / below, rtol=1e-12)
    np.testing.assert_allclose(found.payload_n_per_m, -(omega**2) * 50_000.0 * kE / below)


def test_rope_transfer_balances() -> None:
    """The force at the tip is that on all masses: M·a of the payload, and ∫m·a of the rope."""
    omega = np.array([0.5])
    found = rope_transfer(LIFT, omega, 0.0, 0.0)
    wave = float(omega[0]) * math.sqrt(LIFT.mass_kg_per_m / LIFT.EA_n)
    s = np.linspace(0.0, LIFT.length_m, 20_001)
    slope = found.payload_n_per_m[0] / (LIFT.EA_n * wave)
    motion = found.payload[0] * np.cos(wave * s) + slope * np.sin(wave * s)
    assert motion[-1] == pytest.approx(1.0, rel=1e-9)
    force = -(omega[0] ** 2) * LIFT.mass_kg_per_m * np.trapezoid(motion, s)
    total = found.payload_n_per_m[0] + force
    assert found.hook_n_per_m[0] == pytest.approx(total, rel=1e-6)


def test_stiff_rope_carries_the_tip_along() -> None:
    """Far below resonance the payload follows the tip, and the force is M·ω²·η."""
    stiff = replace(LIFT, EA_n=1e12)
    found = rope_transfer(stiff, np.array([0.4]), 0.0, 0.0)
    assert abs(found.payload[0]) == pytest.approx(1.0, rel=1e-4)
    assert found.hook_n_per_m[0].real == pytest.approx(-0.16 * (50_000.0 + 12_000.0), rel=1e-3)


def test_drag_takes_the_peak_off_resonance() -> None:
    """At resonance a light rope's payload moves by kη/(ω·Σ), the closed form of one mass."""
    light = replace(LIFT, mass_kg_per_m=1e-6)
    omega = np.array([math.sqrt(light.stiffness_n_per_m / light.moved_kg)])
    found = rope_transfer(light, omega, 0.5, 0.0)
    one_mass = light.stiffness_n_per_m / (omega[0] * 9_000.0 * 0.5)
    assert abs(found.payload[0]) == pytest.approx(one_mass, rel=1e-6)


@pytest.mark.parametrize(
    ("fall", "relative", "speed"),
    [
        (0.3, 2.0, 2.3),  # 0.15: C = 1
        (0.9, 2.0, 0.9 + 2.0 * math.cos(math.pi * 0.25)),  # 0.45
        (1.6, 2.0, 1.6),  # 0.8: C = 0
        (1.6, 0.0, 1.6),
    ],
)
def test_snap_speed_by_hand(fall: float, relative: float, speed: float) -> None:
    """v_snap = v_ff + C·v_r on each of the three branches."""
    assert snap_speed(fall, relative) == pytest.approx(speed)


def test_snap_force_by_hand() -> None:
    """v_ff = √(156,000/9,000) = 4.163 m/s alone: 4.163·√(40,000·50,000) = 186.2 kN."""
    assert snap_force_n(LIFT, 1.0) == pytest.approx(186.2e3, rel=1e-3)
    assert snap_force_n(replace(LIFT, weight_n=-1.0), 1.0) == 0.0


def test_splash_force_by_hand() -> None:
    """Slamming and buoyancy, or drag and mass force: typed out for Hs 2 m."""
    plan, scene = read_plan("splash_zone")
    (leg,) = legs_of(plan, scene, plan.phases[0])
    zone = scene.listed(SplashZoneParams)
    assert zone is not None
    lift, sea = lift_of(leg), SeaState(2.0, 8.0, 180.0, 1.0)
    relative, force = splash_force(lift, leg, zone, sea, (1.0, 0.7, 0.5))
    period = 8.0 / 1.405  # Tp/Tz of Pierson-Moskowitz over the band that is used
    omega, wave = 2.0 * math.pi / period, 0.9 * 2.0
    fade = math.exp(-(omega**2) * 1.25 / 9.80665)
    entry = 0.3 + math.hypot(0.7, wave * omega)
    slam = 0.5 * 1025.0 * 5.0 * 12.0 * entry**2
    buoyancy = 1025.0 * 6.0 / 2.5 * 9.80665 * 1.25  # the wave is higher than half the payload
    speed = 0.3 + math.hypot(0.7, wave * omega * fade)
    added = lift.added_mass_kg
    inertia = math.hypot((20_000.0 + added) * 0.5, (6_150.0 + added) * wave * omega**2 * fade)
    drag = lift.drag_kg_per_m * speed**2
    expected = max(math.hypot(slam, buoyancy), math.hypot(drag, inertia))
    assert relative == pytest.approx(speed, rel=0.02)
    assert force == pytest.approx(expected, rel=0.04)
