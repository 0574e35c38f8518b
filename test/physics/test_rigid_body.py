"""A payload with six degrees of freedom against closed forms and independent computations."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from body_rigs import LINE, Hung, Vector, body_in, scene_of
from rigs import march, sine
from scipy.spatial.transform import Rotation

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.body import state as at
from rope_twin.core.body.step import pose_of, pulls_of
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.twin.monitors import ENERGY

G, RHO = 9.80665, 1025.0
ADRIFT = replace(LINE, gravity=0.0, density=RHO, step=0.01)
SLACK = Sling(to_m=(0.0, 0.0, 0.5), length_m=400.0, stiffness_n_per_m=1e5)
NO_WATER = {"added_inertia_kg_m2": (0.0, 0.0, 0.0), "turning_drag_m5": (0.0, 0.0, 0.0)}


def adrift(body: RigidBodyParams, v: Any, spin: Any, **figures: Any) -> Hung:
    """A body that nothing holds, moving so."""
    hung = Hung(replace(ADRIFT, **figures), body)
    hung.slacken()
    hung.let_go(v, spin, *started_with(hung, v, spin))
    return hung


def started_with(hung: Hung, v: Any, spin: Any) -> tuple[Vector, Vector]:
    """Force and moment on a body adrift in still water, from the figures."""
    pose, body = hung.pose(), hung.body
    c = np.asarray(v) @ pose.turn + np.cross(spin, body.watered)
    k = body.k[:3] + np.array([0.0, 0.0, body.rising_k * np.sign(c[2])])
    drag = -k * np.linalg.norm(c) * c
    turning = np.cross(body.watered, drag) - body.k[3:] * np.abs(spin) * spin
    turning -= np.cross(np.asarray(v) @ pose.turn, body.added[:3] * c)
    return pose.turn @ drag, pose.turn @ turning


def top(inertia: tuple[float, float, float], spin: Any, step: float = 0.01) -> Hung:
    """A freely spinning body."""
    body = RigidBodyParams(
        size_m=(4.0, 3.0, 1.0), inertia_kg_m2=inertia, slings=(SLACK,), **NO_WATER
    )
    return adrift(body, (0.0, 0.0, 0.0), spin, step=step)


def angular_momentum(hung: Hung) -> Vector:
    """Return the angular momentum of a body without water [kg·m²/s], in the frame's directions."""
    pose = hung.pose()
    return np.asarray(pose.turn @ hung.body.inertia @ pose.spin)


def test_a_free_asymmetric_top_tumbles_and_conserves_momentum() -> None:
    """About the axis of the middle moment it tumbles; energy is off by the square of the step."""
    off = []
    for step in (0.02, 0.01):
        hung = top((800.0, 1300.0, 2000.0), (0.01, 2.0, 0.02), step)
        L0, I = angular_momentum(hung), np.diag(hung.body.inertia)
        energy, along = 0.5 * I @ hung.pose().spin ** 2, []
        for _ in range(120):
            hung.twin.advance(round(0.2 / step))
            along.append(hung.pose().spin[1])
        assert np.abs(angular_momentum(hung) - L0).max() < 1e-9 * np.linalg.norm(L0)
        assert min(along) < -1.9, "the middle axis turns over"
        assert max(along[len(along) // 2 :]) > 1.9, "and back"
        off.append(0.5 * I @ hung.pose().spin ** 2 / energy - 1.0)
    assert abs(off[1]) < 1e-5
    assert off[0] / off[1] > 3.6


def test_a_symmetric_top_precesses() -> None:
    """Its axis goes round the angular momentum at |L|/I₁ (Goldstein, Classical Mechanics, 5.6)."""
    hung, seconds = top((800.0, 800.0, 1500.0), (0.5, 0.0, 2.0)), 6.0
    L, axis = angular_momentum(hung), hung.pose().turn[:, 2]
    hung.twin.advance(round(seconds / hung.twin.step_s))
    rate = np.linalg.norm(L) / 800.0
    expected = Rotation.from_rotvec(rate * seconds * L / np.linalg.norm(L)).apply(axis)
    assert np.abs(hung.pose().turn[:, 2] - expected).max() < 2e-4
    assert np.linalg.norm(hung.pose().quaternion) == pytest.approx(1.0, abs=1e-15)


def test_a_free_body_in_still_water_conserves_kirchhoffs_momenta() -> None:
    """Kirchhoff: P, L about a point that stays, and energy, with other added mass along each axis.

    The moment (v - u) × p turns it broadside: without it neither L nor energy would be kept.
    """
    figures = {"added": (500.0, 1200.0, 3000.0), "volume": 1.2}
    body = RigidBodyParams(
        size_m=(4.0, 3.0, 1.0), slings=(SLACK,), centre_of_drag_m=(0.3, -0.1, 0.2),
        turning_drag_m5=(0.0, 0.0, 0.0),
    )  # fmt: skip
    off = []
    for step in (0.02, 0.01):
        hung = adrift(body, (0.8, 0.3, -0.5), (0.2, -0.4, 0.3), step=step, **figures)
        first, turn = kirchhoff(hung), hung.pose().turn
        hung.twin.advance(round(8.0 / step))
        now = kirchhoff(hung)
        assert np.abs(hung.pose().turn - turn).max() > 0.5, "the case must turn it"
        assert np.abs(now[1] - first[1]).max() < 5.0 * step**2 / 8.0 * np.linalg.norm(first[1])
        off.append(now[2] / first[2] - 1.0)
    assert np.abs(kirchhoff(hung)[0] - first[0]).max() < 1e-8 * np.linalg.norm(first[0])
    assert abs(off[1]) < 1e-4
    assert off[0] / off[1] > 3.6


def kirchhoff(hung: Hung) -> tuple[Vector, Vector, float]:
    """P, L about the origin, and energy, from the figures."""
    pose, body = hung.pose(), hung.body
    h = body.watered
    c = pose.velocity @ pose.turn + np.cross(pose.spin, h)
    p = body.added[:3] * c
    P = body.m * pose.velocity + pose.turn @ p
    inertia = body.inertia + np.diag(body.added[3:])
    L = pose.turn @ (inertia @ pose.spin + np.cross(h, p)) + np.cross(pose.centre, P)
    energy = 0.5 * (
        body.m * pose.velocity @ pose.velocity + p @ c + pose.spin @ inertia @ pose.spin
    )
    return P, L, energy


def test_drag_decay_of_spin_and_drift_per_axis() -> None:
    """x(t) = x₀/(1 + k·|x₀|·t/M) about and along each axis, other figures rising than sinking."""
    body = RigidBodyParams(
        size_m=(4.0, 3.0, 1.0), slings=(SLACK,), turning_drag_m5=(20.0, 30.0, 40.0)
    )
    figures: dict[str, Any] = {
        "added": (500.0, 1200.0, 3000.0), "area": (4.0, 5.0, 9.0), "volume": 1.2, "step": 0.005
    }  # fmt: skip
    for axis in range(3):
        spin = np.zeros(3)
        spin[axis] = 0.8
        hung = adrift(body, (0.0, 0.0, 0.0), spin, **figures)
        M = hung.body.inertia[axis, axis] + hung.body.added[3 + axis]
        hung.twin.advance(1000)
        k = 0.5 * RHO * (20.0, 30.0, 40.0)[axis]
        assert hung.pose().spin[axis] == pytest.approx(0.8 / (1.0 + k * 0.8 * 5.0 / M), rel=1e-5)
        for start in (0.6, -0.6):
            v = np.zeros(3)
            v[axis] = start
            hung = adrift(body, v, (0.0, 0.0, 0.0), **figures)
            hung.twin.advance(1000)
            M = 2000.0 + figures["added"][axis]
            k = 0.5 * RHO * figures["area"][axis]
            expected = start / (1.0 + k * 0.6 * 5.0 / M)
            assert hung.pose().velocity[axis] == pytest.approx(expected, rel=1e-5)


PIN = RigidBodyParams(size_m=(3.0, 2.0, 1.5), pinned_at_m=(0.0, 0.0, 2.5), **NO_WATER)


def test_rope_and_body_swing_like_a_double_pendulum() -> None:
    """Both modes of (g - L·ω²)·α = d·ω²·β, m·g·d·β = ω²·(m·L·d·α + (I + m·d²)·β); 3e-4.

    α: the rope's lean, β: the body's, d: from pin to centre of gravity. With a short rope the lower
    one is that of the physical pendulum.
    """
    m, d = 2000.0, 2.5
    I = m / 12.0 * (3.0**2 + 1.5**2)
    for length in (20.0, 1.0):
        inertia = np.array([[m * length**2, m * length * d], [m * length * d, I + m * d * d]])
        squares, shapes = np.linalg.eig(
            np.linalg.solve(inertia, np.diag([m * G * length, m * G * d]))
        )
        for square, (alpha, beta) in zip(squares, shapes.T, strict=True):
            period = 2.0 * math.pi / math.sqrt(square)
            rig = replace(LINE, length=length, step=period / 400.0, tolerance=1e-3)
            hung = Hung(rig, PIN)
            lean(hung, 1e-3 * alpha, 1e-3 * beta, square)
            turns = []
            for _ in range(1600):
                hung.twin.advance(1)
                turns.append(hung.pose().quaternion[1])
            computed = (
                math.sqrt(square) * crossing_period(np.array(turns), rig.step) / (2 * math.pi)
            )
            assert computed == pytest.approx(1.0, abs=3e-4)


def lean(hung: Hung, alpha: float, beta: float, square: float) -> None:
    """Rope and body lean about y in a mode at rest, with the forces that it has there."""
    state, n = hung.twin.rope.state, int(hung.twin.rope.state.counts[rows.ELEMENTS])
    position = state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1]
    top_z = position[2, -1]
    state.nodes[rows.VELOCITY : rows.NODE_ROWS, :n] = 0.0
    position[0] = -alpha * (top_z - position[2])
    state.nodes[rows.ACCELERATION, :n] = -square * position[0, :n]
    record, body = hung.record, hung.body
    arm = position[2, 0] - record[at.X + 2]
    record[at.X] = position[0, 0] - arm * beta
    record[at.Q : at.Q + 4] = Rotation.from_rotvec([0.0, beta, 0.0]).as_quat()
    hung.let_go((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    record[at.FORCE] = -square * body.m * record[at.X]
    record[at.MOMENT + 1] = -square * body.inertia[1, 1] * beta


def crossing_period(x: Vector, step: float) -> float:
    """Mean period [s] of a series by its zero crossings, linear in between."""
    i = np.flatnonzero(x[:-1] * x[1:] < 0.0)
    at_zero = i + x[i] / (x[i] - x[i + 1])
    return float(2.0 * step * (at_zero[-1] - at_zero[0]) / (len(at_zero) - 1))


def test_heave_period_of_a_body_on_sling_and_rope() -> None:
    """ω² = k/(m + M_z), rope and sling in series; 2e-4."""
    sling = Sling(to_m=(0.0, 0.0, 0.5), length_m=6.0, stiffness_n_per_m=4e5)
    rig = replace(LINE, length=50.0, EA=2e7, density=RHO, added=(1e3, 1e3, 5e3), tolerance=1e-3)
    body = RigidBodyParams(size_m=(3.0, 2.0, 1.0), slings=(sling,))
    k = 1.0 / (50.0 / 2e7 + 1.0 / 4e5)
    period = 2.0 * math.pi / math.sqrt(k / 7e3)
    hung = Hung(replace(rig, step=period / 200.0), body)
    rest = hung.record[at.X + 2]
    hung.record[at.V + 2] = 0.02
    heights = []
    for _ in range(1000):
        hung.twin.advance(1)
        heights.append(hung.pose().centre[2] - rest)
    assert crossing_period(np.array(heights), period / 200.0) == pytest.approx(period, rel=2e-4)


def test_static_attitude_on_one_sling() -> None:
    """(m·r_G - ρV·r_B)/(m - ρV) hangs plumb under the pin, and the rope carries the rest; 1e-6."""
    g, b = np.array([0.35, -0.15, -0.3]), np.array([-0.2, 0.1, 0.15])
    rig = replace(LINE, density=RHO, volume=0.9)
    body = replace(PIN, centre_of_gravity_m=tuple(g), centre_of_buoyancy_m=tuple(b))
    twin = Twin(scene_of(rig, body))
    m, displaced = 2000.0, RHO * 0.9
    heavy = (m * g - displaced * b) / (m - displaced) - np.array([0.0, 0.0, 2.5])
    snapshot = twin.snapshot()
    assert snapshot.body is not None
    plumb = Rotation.from_quat(snapshot.body.quaternion).apply(heavy)
    assert plumb == pytest.approx([0.0, 0.0, -np.linalg.norm(heavy)], abs=1e-5)
    assert snapshot.tension_payload_n == pytest.approx((m - displaced) * G, rel=3e-5)


def test_static_lean_in_a_current() -> None:
    """tan β = drag·3/(W·2.5) with drag 0.5 m below the centre of gravity; 1e-4."""
    body = replace(PIN, centre_of_drag_m=(0.0, 0.0, -0.5))
    rig = replace(LINE, density=RHO, area=(3.0, 3.0, 3.0), current=((0.0, (0.7, 0.0)),), volume=0.2)
    twin = Twin(scene_of(rig, replace(body, centre_of_buoyancy_m=(0.0, 0.0, 0.0))))
    drag, weight = 0.5 * RHO * 3.0 * 0.7**2, (2000.0 - RHO * 0.2) * G
    snapshot = twin.snapshot()
    assert snapshot.body is not None
    lean_rad = Rotation.from_quat(snapshot.body.quaternion).as_rotvec()
    assert math.tan(-lean_rad[1]) == pytest.approx(3.0 * drag / (2.5 * weight), rel=1e-4)


SLINGS = tuple(
    Sling(to_m=(x, y, 0.6), length_m=5.0 + extra, stiffness_n_per_m=4e6,
          damping_newton_seconds_per_m=2e4)
    for (x, y), extra in zip(
        ((1.8, 1.2), (1.8, -1.2), (-1.8, 1.2), (-1.8, -1.2)), (0.0, 0.004, -0.01, 0.03), strict=True
    )
)  # fmt: skip
TEMPLATE = RigidBodyParams(
    size_m=(4.0, 3.0, 1.2), centre_of_gravity_m=(0.5, 0.2, -0.1), slings=SLINGS, hook_mass_kg=50.0
)


def test_static_equilibrium_on_four_slings() -> None:
    """Force and moment of springs at scipy's attitude are nil, and any change stores energy.

    Of four slings of other lengths three carry it and one is slack.
    """
    twin = Twin(scene_of(LINE, TEMPLATE))
    pose, body = pose_of(body_in(twin)), body_in(twin)
    hook = twin.rope.state.nodes[rows.POSITION : rows.POSITION + 3, 0]
    r, L = body.legs[:, :3], body.legs[:, at.LENGTH]

    def springs(x: Vector) -> tuple[Vector, Vector, float]:
        arms = Rotation.from_rotvec(x[3:]).apply(r)
        toward = -(x[:3] + arms)
        length = np.linalg.norm(toward, axis=1)
        stretch = np.maximum(length - L, 0.0)
        pull = (4e6 * stretch / length)[:, None] * toward
        return arms, pull, float(2000.0 * G * x[2] + 0.5 * 4e6 * stretch @ stretch)

    rest = np.concatenate([pose.centre - hook, Rotation.from_quat(pose.quaternion).as_rotvec()])
    arms, pull, energy = springs(rest)
    assert pull.sum(axis=0) == pytest.approx([0.0, 0.0, 2000.0 * G], abs=0.1)
    assert np.cross(arms, pull).sum(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=0.1)
    for change in np.vstack([np.eye(6), -np.eye(6)])[[0, 1, 2, 3, 4, 6, 7, 8, 9, 10]]:
        assert springs(rest + 1e-4 * change)[2] > energy
    force, _, _ = pulls_of(body, hook, np.zeros(3))
    computed = np.linalg.norm(force, axis=1)
    assert computed == pytest.approx(np.linalg.norm(pull, axis=1), abs=0.1)
    assert computed.min() == 0.0 < np.sort(computed)[1]


def test_slack_slings_have_no_force_and_the_energy_balance_closes() -> None:
    """Heave that slackens the slings: no pull below 0, and energy is neither made nor lost."""
    rig = replace(
        LINE, length=40.0, mass=3.0, diameter=0.03, EA=2e7, damping=2e4, density=RHO, volume=0.25,
        added=(600.0, 900.0, 4000.0), area=(3.0, 4.0, 11.0), step=0.0025, drag=(1.2, 0.02),
        added_mass=1.0, current=((0.0, (0.6, 0.2)), (-100.0, (0.2, 0.3))), ramp=4.0,
    )  # fmt: skip
    twin = Twin(scene_of(rig, TEMPLATE), ENERGY)
    pulls, snapshot = [], twin.snapshot()
    for snapshot in march(twin, sine(1.6, 4.5), 12.0, every=20):
        assert snapshot.body is not None
        pulls.append(snapshot.body.leg_tension_n)
        assert snapshot.body.leg_tension_n.min() >= 0.0
    assert np.min(np.max(pulls, axis=1)) == 0.0, "the case must slacken all of them"
    assert np.max(pulls) > 1e4, "and snap"
    assert snapshot.energy is not None
    assert abs(snapshot.energy.residual_pct) < 1.0
    assert snapshot.energy.exchanged_j > 1e4


def test_a_light_body_on_stiff_slings_converges() -> None:
    """10 kg on four slings of 1e7 N/m, whose bounce has 16 periods in a step: all converge."""
    slings = tuple(replace(one, length_m=5.0, stiffness_n_per_m=1e7) for one in SLINGS)
    body = replace(TEMPLATE, slings=slings, hook_mass_kg=0.0)
    rig = replace(LINE, load=10.0, mass=0.05, step=0.05, tolerance=0.01, ramp=2.0)
    twin = Twin(scene_of(rig, body))
    tensions = [snapshot.tension_payload_n for snapshot in march(twin, sine(0.3, 5.0), 20.0)]
    assert twin.snapshot().solver.unconverged_substeps == 0
    assert max(tensions) < 1.3 * 10.0 * G
    assert min(tensions) > 0.7 * 10.0 * G


def test_a_body_resumes_bit_identically() -> None:
    """Restored and branched, beside the run that was not interrupted."""
    scene = scene_of(replace(LINE, ramp=1.0), TEMPLATE)
    twin = Twin(scene)
    for _ in march(twin, sine(0.5, 4.0), 2.0, every=40):
        pass
    others = [Twin.restore(twin.capture(), scene), twin.branch()]
    for one in (twin, *others):
        for _ in march(one, sine(0.5, 4.0), 1.0, every=40):
            pass
    expected = pose_of(body_in(twin))
    for one in others:
        for actual, wanted in zip(pose_of(body_in(one)), expected, strict=True):
            assert (actual == wanted).all()
