"""A floating rigid body against naval architecture's closed forms for a box.

Draught T = m/(ρ·a·b), metacentre GM = T/2 + b²/(12·T) - KG above the centre of gravity.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from body_rigs import LINE, Adrift, Vector, between
from rigs import Rig, march, sine

from rope_twin import Twin
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.effects.seabed import SeabedParams
from rope_twin.twin.monitors import ENERGY

G, RHO, MASS = 9.80665, 1025.0, 6000.0
LENGTH, WIDTH, HEIGHT = 4.0, 3.0, 1.2
AREA = LENGTH * WIDTH
DRAUGHT = MASS / (RHO * AREA)
DEEP = SeabedParams(depth_m=100.0)
SLACK = Sling(to_m=(0.0, 0.0, 0.6), length_m=60.0, stiffness_n_per_m=1e5)
DRY = {"added_inertia_kg_m2": (0.0, 0.0, 0.0), "turning_drag_m5": (0.0, 0.0, 0.0)}
BARGE = RigidBodyParams(size_m=(LENGTH, WIDTH, HEIGHT), slings=(SLACK,), **DRY)
AT_SEA = replace(
    LINE, density=RHO, load=MASS, volume=AREA * HEIGHT, step=0.01, hang_off=(0.0, 0.0, 24.0)
)
RESTS = HEIGHT / 2.0 - DRAUGHT  # of its middle


def inertia(across: float) -> float:
    """Moment of inertia about an axis along which the box is not `across` wide [kg·m²]."""
    return MASS / 12.0 * (across**2 + HEIGHT**2)


def period_of(series: Vector, step: float) -> float:
    """Return the period by linearly interpolated zero crossings [s]."""
    i = np.flatnonzero(series[:-1] * series[1:] < 0.0)
    at_zero = i + series[i] / (series[i] - series[i + 1])
    return float(2.0 * step * (at_zero[-1] - at_zero[0]) / (len(at_zero) - 1))


def swing(hung: Adrift, seconds: float, reported: Any) -> Vector:
    """Return the reported pose after each step."""
    seen = []
    for _ in range(round(seconds / hung.twin.step_s)):
        hung.twin.advance(1)
        seen.append(reported(hung.pose()))
    return np.array(seen)


def test_a_box_floats_at_its_draught() -> None:
    """It rests upright on a slack sling; 1e-6 m."""
    snapshot = Twin(between(AT_SEA, BARGE, DEEP)).snapshot()
    assert snapshot.body is not None
    assert snapshot.body.leg_tension_n.max() == 0.0
    assert snapshot.payload_position_m[2] == pytest.approx(RESTS, abs=1e-6)
    assert snapshot.body.turn[2, 2] == pytest.approx(1.0, abs=1e-12)


def test_heave_period_of_a_floating_box() -> None:
    """ω² = ρ·g·a·b/(m + β·M_z), β = T/H the submergence ratio; 0.1 %, no energy gained in 25 s."""
    added = 9e3
    hung = Adrift(replace(AT_SEA, added=(1e3, 2e3, added)), BARGE, DEEP)
    hung.lay((0.0, 0.0, RESTS + 0.02), (0.0, 0.0, 0.0))
    z = swing(hung, 25.0, lambda pose: pose.centre[2] - RESTS)
    omega = math.sqrt(RHO * G * AREA / (MASS + DRAUGHT / HEIGHT * added))
    assert period_of(z, 0.01) == pytest.approx(2.0 * math.pi / omega, rel=1e-3)
    assert 0.99 * 0.02 < z[-300:].max() <= 0.02 * (1.0 + 1e-4)
    # down it goes 1 % farther, with more added mass: 1 + 2·κ·z/3, κ that of β·M_z over m + β·M_z
    kappa = added / HEIGHT / (MASS + DRAUGHT / HEIGHT * added)
    assert -z[:300].min() == pytest.approx(0.02 * (1.0 + 2.0 * kappa * 0.02 / 3.0), rel=1e-3)


@pytest.mark.parametrize("axis", [0, 1])
def test_roll_period_of_a_floating_box(axis: int) -> None:
    """ω² = m·g·GM/I about either axis, KG 0.5 m; 0.2 %, no energy gained in 20 s."""
    across, KG = (WIDTH, LENGTH)[axis], 0.5
    hung = Adrift(
        AT_SEA,
        replace(
            BARGE,
            centre_of_gravity_m=(0.0, 0.0, KG - HEIGHT / 2.0),
            inertia_kg_m2=(inertia(WIDTH), inertia(LENGTH), 12500.0),
        ),
        DEEP,
    )
    turn = np.zeros(3)
    turn[axis] = 0.01
    hung.lay((0.0, 0.0, KG - DRAUGHT), turn)
    angle = swing(hung, 20.0, lambda pose: 2.0 * pose.quaternion[axis])
    GM = DRAUGHT / 2.0 + across**2 / (12.0 * DRAUGHT) - KG
    omega = math.sqrt(MASS * G * GM / inertia(across))
    assert period_of(angle, 0.01) == pytest.approx(2.0 * math.pi / omega, rel=2e-3)
    assert 0.95 * 0.01 < np.abs(angle[-200:]).max() <= 0.01 * (1.0 + 1e-3)


def test_righting_arm_of_a_wall_sided_box() -> None:
    """GZ = (GM + BM/2·tan²φ)·sin φ at 8° (Barrass and Derrett 2012, Ship Stability); 0.2 %."""
    heel, step = math.radians(8.0), 1e-3
    hung = Adrift(replace(AT_SEA, step=step), BARGE, DEEP)
    hung.lay((0.0, RESTS * -math.sin(heel), RESTS * math.cos(heel)), (heel, 0.0, 0.0))
    BM = WIDTH**2 / (12.0 * DRAUGHT)
    GZ = (DRAUGHT / 2.0 + BM - HEIGHT / 2.0 + 0.5 * BM * math.tan(heel) ** 2) * math.sin(heel)
    spin = swing(hung, 0.01, lambda pose: pose.spin[0])
    computed = (spin[-1] - spin[-6]) / (5.0 * step)
    assert computed == pytest.approx(-MASS * G * GZ / inertia(WIDTH), rel=2e-3)


def test_slamming_force_at_water_entry() -> None:
    """½·ρ·C_s·A·v² upward on entry, beside weight and ρ·g·A·d; 1 %. None on the way up."""
    step, deep = 1e-4, 0.01
    for v in (-1.5, 1.5):
        hung = Adrift(replace(AT_SEA, step=step), BARGE, DEEP, AREA)
        hung.lay((0.0, 0.0, HEIGHT / 2.0 - deep), (0.0, 0.0, 0.0), (0.0, 0.0, v))
        speed = swing(hung, 1e-3, lambda pose: pose.velocity[2])
        computed = (speed[-1] - speed[-6]) / (5.0 * step)
        sunk = deep - v * 7.5 * step
        slam = 0.5 * RHO * 5.0 * AREA * speed[-4] ** 2 if v < 0.0 else 0.0
        assert computed == pytest.approx((slam + RHO * G * AREA * sunk) / MASS - G, rel=1e-2)


def test_energy_balance_through_the_surface() -> None:
    """Heaved through the surface on slings with slamming, drag and added mass; 1 %."""
    slings = tuple(
        Sling(to_m=(x, y, 0.6), length_m=5.0, stiffness_n_per_m=4e6,
              damping_newton_seconds_per_m=2e4)
        for x, y in ((1.8, 1.2), (1.8, -1.2), (-1.8, 1.0), (-1.8, -1.2))
    )  # fmt: skip
    rig = replace(
        AT_SEA, added=(1e3, 2e3, 9e3), area=(4.0, 5.0, 12.0), step=0.0025, volume=3.0, ramp=2.0,
        hang_off=(0.0, 0.0, 25.0), mass=1.0, EA=2e7, damping=2e4,
    )  # fmt: skip
    body = replace(BARGE, slings=slings, hook_mass_kg=50.0, added_inertia_kg_m2=None)
    twin = Twin(between(rig, body, DEEP, AREA), ENERGY)
    heights = []
    for snapshot in march(twin, sine(0.9, 5.0), 7.0, every=20):
        heights.append(snapshot.payload_position_m[2])
    assert max(heights) > 0.6 > -0.6 > min(heights), "from air to water and back"
    assert snapshot.energy is not None
    assert snapshot.energy.exchanged_j > 1e5
    assert abs(snapshot.energy.residual_pct) < 1.0


def test_a_box_laid_on_its_side_rights_itself() -> None:
    """It ends upright at its draught; energy falls all the way."""
    rig: Rig = replace(AT_SEA, added=(1e3, 2e3, 9e3), area=(4.0, 5.0, 12.0))
    wet = replace(BARGE, added_inertia_kg_m2=None, turning_drag_m5=None)
    hung = Adrift(rig, wet, DEEP)
    hung.lay((0.0, 0.0, RESTS), (math.radians(80.0), 0.1, 0.0))
    hung.twin.advance(6000)
    pose = hung.pose()
    assert pose.turn[2, 2] == pytest.approx(1.0, abs=1e-3)
    assert pose.centre[2] == pytest.approx(RESTS, abs=1e-2)
