"""A rigid body on the seabed: rests, falls flat, sticks and slides by closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from body_rigs import LINE, Adrift, aground, between, body_in
from rigs import march, still
from scipy.spatial.transform import Rotation

from rope_twin import Twin
from rope_twin.core.bed import Grid
from rope_twin.core.bed_shape import clearance
from rope_twin.core.body import state as at
from rope_twin.core.body.components import bed_forces
from rope_twin.core.body.loads import component_of
from rope_twin.core.body.state import GridBed, PlaneBed, RigidBody
from rope_twin.core.body.step import Pose, pose_of
from rope_twin.effects.bed_friction import BedFrictionParams
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.effects.seabed import SeabedParams, Soundings
from rope_twin.errors import SceneError
from rope_twin.scene.rope_model import build_effects
from rope_twin.scene.schema import Winch
from rope_twin.scene.shapes import payload_figures

G, MASS, RHO, VOLUME = 9.80665, 2000.0, 1025.0, 0.6
WEIGHT = (MASS - RHO * VOLUME) * G
BED = SeabedParams(depth_m=30.0, payload_penetration_m=0.02, damping_s_per_m=1.0, friction=0.5)
SLACK = Sling(to_m=(0.0, 0.0, 0.6), length_m=400.0, stiffness_n_per_m=1e5)
LOOSE = RigidBodyParams(size_m=(4.0, 3.0, 1.2), slings=(SLACK,))
SLINGS = tuple(
    Sling(to_m=(x, y, 0.6), length_m=5.0, stiffness_n_per_m=4e6, damping_newton_seconds_per_m=2e4)
    for x in (1.8, -1.8)
    for y in (1.2, -1.2)
)
SUBMERGED = replace(LINE, density=RHO, volume=VOLUME, step=0.0025)


def test_a_box_at_rest_on_a_flat_bed() -> None:
    """Reactions sum to m·g - ρ·g·V, with their centre below that of weight less buoyancy."""
    body = replace(LOOSE, centre_of_gravity_m=(0.3, 0.0, -0.1))
    twin = Twin(between(SUBMERGED, body, BED))
    snapshot = twin.snapshot()
    assert snapshot.body is not None
    assert snapshot.seabed is not None
    assert snapshot.seabed.payload_landed
    assert snapshot.body.leg_tension_n.max() == 0.0
    assert snapshot.seabed.payload_reaction_n == pytest.approx(WEIGHT, rel=1e-4)
    own = body_in(twin)
    pose = pose_of(own)
    _, push, _ = bed_forces(component_of(own, PlaneBed), own, pose)
    at_corners, floats = pose.place(own.corners)[:, 0], pose.place(own.buoyed)[0]
    middle = (MASS * pose.centre[0] - RHO * VOLUME * floats) / (MASS - RHO * VOLUME)
    assert middle - floats == pytest.approx(0.3 * MASS / (MASS - RHO * VOLUME), rel=1e-2)
    assert push @ at_corners / push.sum() == pytest.approx(middle, abs=1e-5)
    assert push.min() == 0.0, "the upper corners touch nothing"
    assert snapshot.payload_position_m[2] == pytest.approx(-30.0 + 0.6 - 0.02, abs=1e-4)


def test_soundings_below_a_body_are_those_below_the_rope() -> None:
    """Depths of the same grid by the rope's seabed function; to round-off."""
    given = Soundings(
        x_m=(-9.0, 0.0, 7.0), y_m=(-9.0, 8.0), depth_m=((30.0, 31.5, 29.0), (33.0, 30.5, 28.0))
    )
    bed = replace(BED, depth_m=None, soundings=given)
    scene = between(SUBMERGED, LOOSE, bed)
    effects = build_effects(scene, payload_figures(scene.payloads[0], RHO))
    (grid,) = (effect for effect in effects if isinstance(effect, Grid))
    (body,) = (effect for effect in effects if isinstance(effect, RigidBody))
    pose = Pose(
        np.array([2.0, 1.0, -29.0]), np.zeros(3), np.zeros(4), np.zeros(3),
        Rotation.from_rotvec([0.4, -0.7, 1.0]).as_matrix(),
    )  # fmt: skip
    above, _, _ = bed_forces(component_of(body, GridBed), body, pose)
    expected = clearance(grid, pose.place(body.corners).T)
    assert above == pytest.approx(expected, abs=1e-12)


def test_a_tilted_box_falls_flat_and_makes_no_energy() -> None:
    """Released on edge half a metre up; energy, the soil's included, falls all the time."""
    hung = Adrift(SUBMERGED, LOOSE, BED)
    hung.lay((0.0, 0.0, -27.9), (0.35, -0.2, 0.4))
    own, bed, energy = hung.body, component_of(hung.body, PlaneBed), []
    for _ in range(200):
        hung.twin.advance(20)
        pose = hung.pose()
        above, push, _ = bed_forces(bed, own, pose)
        assert push.min() >= 0.0
        sunk = np.maximum(-above, 0.0)
        moving = MASS * pose.velocity @ pose.velocity + pose.spin @ own.inertia @ pose.spin
        energy.append(0.5 * moving + WEIGHT * pose.centre[2] + 0.5 * bed.k * sunk @ sunk)
    drop = energy[0] - energy[-1]
    assert drop > 0.5 * WEIGHT
    assert np.diff(energy).max() < 2e-4 * drop
    assert hung.pose().turn[2, 2] > 1.0 - 1e-8, "it lies flat"
    assert hung.twin.snapshot().seabed.payload_reaction_n == pytest.approx(WEIGHT, rel=1e-3)


@pytest.mark.parametrize("mirrored", [False, True])
def test_landing_is_invariant_under_rotation_and_mirroring(mirrored: bool) -> None:
    """A box in a slope's shallows, turned by 211° or mirrored in x."""
    turn = Rotation.from_rotvec([0.0, 0.0, 0.0 if mirrored else 3.683]).as_matrix()
    side = -1.0 if mirrored else 1.0
    own, other = aground(np.eye(3), 1.0), aground(turn, side)
    follow = turn @ np.diag([side, 1.0, 1.0])
    scale = np.abs(own).max(axis=(0, 2), keepdims=True)[0]
    for expected, actual in zip(own, other, strict=True):
        assert np.abs(actual[:2] - expected[:2] @ follow.T).max() < 1e-8 * scale.max()
        spin = side * expected[2] @ follow.T  # an axial vector
        assert np.abs(actual[2] - spin).max() < 1e-8 * scale[2].max()


@pytest.mark.parametrize("length_m", [400.0, 12.0])
def test_a_box_creeps_on_a_slope_below_the_friction_angle(length_m: float) -> None:
    """Slings slack: creep velocity of the closed form, equal a second later.

    It leans downhill against its corners' springs: F·h over 4·k·b² - W·h, F along its own x and y.
    """
    slack = replace(LOOSE, slings=(replace(SLACK, length_m=length_m),))
    twin = Twin(between(SUBMERGED, slack, replace(BED, slope=(0.2, 0.1), friction=0.5)))
    normal = np.array([-0.2, -0.1, 1.0]) / math.sqrt(1.05)
    down = np.array([-0.2, -0.1, -0.05]) / math.sqrt(0.0525)
    r = math.hypot(0.2, 0.1) / 0.5
    for _ in range(2):
        pose, snapshot = pose_of(body_in(twin)), twin.snapshot()
        assert pose.velocity == pytest.approx(0.01 * r / math.sqrt(1 - r * r) * down, abs=1e-8)
        pull = WEIGHT * np.hypot(0.2, 0.1) / math.sqrt(1.05) * down @ pose.turn
        springs = WEIGHT / 0.02 * np.array([2.0, 1.5]) ** 2 - WEIGHT * 0.6
        assert (normal @ pose.turn)[:2] == pytest.approx(-pull[:2] * 0.6 / springs, rel=1e-3)
        assert pose.turn[1, 0] == pytest.approx(0.0, abs=0.02), "it keeps its heading"
        assert snapshot.body.leg_tension_n.max() == 0.0
        assert snapshot.seabed.payload_reaction_n == pytest.approx(
            WEIGHT / math.sqrt(1.05), rel=1e-6
        )
        twin.advance(400)


@pytest.mark.parametrize(("own", "of_bed"), [(0.5, 0.1), (None, 0.5)])
def test_friction_that_sticks_leaves_a_box_its_own(own: float | None, of_bed: float) -> None:
    """Beside `bed_friction` it creeps with the coefficient across the rope, by the closed form."""
    slack = replace(LOOSE, slings=(replace(SLACK, length_m=12.0),))
    bed = replace(BED, slope=(0.2, 0.1), friction=of_bed)
    scene = between(SUBMERGED, slack, bed)
    index = scene.effects.index(bed) + 1
    sticks = BedFrictionParams(lateral=own)
    effects = (*scene.effects[:index], sticks, *scene.effects[index:])
    twin = Twin(replace(scene, effects=effects))
    down = np.array([-0.2, -0.1, -0.05]) / math.sqrt(0.0525)
    r = math.hypot(0.2, 0.1) / 0.5
    creep = 0.01 * r / math.sqrt(1 - r * r)
    for _ in range(2):
        assert pose_of(body_in(twin)).velocity == pytest.approx(creep * down, abs=1e-8)
        twin.advance(100)


def test_a_box_above_the_friction_angle_needs_slings() -> None:
    """With slack slings the start is refused; with taut ones it rests."""
    steep = replace(BED, slope=(0.2, 0.0), friction=0.1)
    long = replace(LOOSE, size_m=(1.0, 0.8, 1.2), slings=(replace(SLACK, length_m=500.0),))
    with pytest.raises(SceneError, match="friction does not hold it and its slings are slack"):
        Twin(between(SUBMERGED, long, steep))  # it would slide for 480 m
    short = replace(LOOSE, slings=(replace(SLACK, length_m=12.0),))
    twin = Twin(between(SUBMERGED, short, steep))
    assert twin.snapshot().body.leg_tension_n.max() > 0.2 * WEIGHT
    assert np.abs(pose_of(body_in(twin)).velocity).max() == 0.0


def on_slope(friction: float) -> tuple[Adrift, Any]:
    """Return a body at rest on a slope of 0.2, and the downhill direction."""
    short = replace(LOOSE, slings=(replace(SLACK, length_m=4.0),))
    hung = Adrift(SUBMERGED, short, replace(BED, slope=(0.2, 0.0), friction=friction))
    hung.body.legs[0, at.LENGTH] = 400.0
    lean = math.atan(0.2)
    off = 0.6 - 0.02 * math.cos(lean)
    hung.lay((-off * math.sin(lean), 0.0, -30.0 + off * math.cos(lean)), (0.0, -lean, 0.0))
    return hung, np.array([-math.cos(lean), 0.0, -math.sin(lean)])


def test_creep_velocity_on_a_slope() -> None:
    """Creep at v_0·r/√(1 - r²), r the slope over μ: 4 mm/s; 1 %."""
    hung, down = on_slope(0.5)
    hung.twin.advance(1600)
    r = 0.2 / 0.5
    assert hung.pose().velocity @ down == pytest.approx(0.01 * r / math.sqrt(1 - r * r), rel=1e-2)


def test_acceleration_of_a_sliding_box() -> None:
    """Acceleration (W/m)·(sin - μ·cos); 1 %."""
    hung, down = on_slope(0.1)
    hung.twin.advance(800)
    lean = math.atan(0.2)
    expected = WEIGHT / MASS * (math.sin(lean) - 0.1 * math.cos(lean)) * 2.0
    assert hung.pose().velocity @ down == pytest.approx(expected, rel=1e-2)


def test_rope_and_slings_go_slack_after_landing() -> None:
    """Lowered 1 m: the bed carries the body, the rope the hook; tension is never negative."""
    winch = Winch(speed_limit_m_per_s=0.5, acceleration_limit_m_per_s2=0.5, min_line_out_m=5.0,
                  max_line_out_m=30.0)  # fmt: skip
    rig = replace(SUBMERGED, mass=1.0, EA=2e7, damping=2e4, ramp=1.0, winch=winch)
    body = replace(LOOSE, slings=SLINGS, hook_mass_kg=50.0)
    twin = Twin(between(rig, body, replace(BED, depth_m=26.3)))
    first = twin.snapshot()
    assert first.seabed is not None
    assert 0.4 < first.seabed.payload_height_m < 1.0
    lowered = march(twin, still, 8.0, every=40, speeds=[(0.5, 0.3), (4.5, 0.0)])
    for snapshot in lowered:
        assert snapshot.seabed.payload_reaction_n >= 0.0
        assert snapshot.body.leg_tension_n.min() >= 0.0
    assert snapshot.body.leg_tension_n.max() == 0.0
    assert snapshot.seabed.payload_reaction_n == pytest.approx(WEIGHT, rel=1e-3)
    assert snapshot.solver.unconverged_substeps == 0
