"""Hang-off motion of a ship with six degrees of freedom, and by prescribed motion from a table."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from box_motion import box_responses, table_of
from hypothesis import given
from hypothesis import strategies as st
from rigs import Rig
from scipy.spatial.transform import Rotation

from rope_twin.core import state as rows
from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.files import share_dir
from rope_twin.recording.motion_source import FIRST_NS, ShipOnWaves, open_sea, series_of, submit
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import OnWaves, Scene, SeaState, Ship
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.ship_motion import BoxHull, heave_response
from rope_twin.sea.spectrum import Waves
from rope_twin.studies.accuracy_run import MotionWindow
from rope_twin.twin.motion.ship_motion import ShipPose, hang_off_motion
from rope_twin.twin.twin import Twin

Triple = tuple[float, float, float]
numbers = st.floats(-1.0, 1.0)
triples = st.tuples(numbers, numbers, numbers)


@given(axis=triples, angle=st.floats(0.05, 1.0), arm=triples, rate=st.floats(-1.0, 1.0))
def test_lever_arm_rotation_by_rodrigues_formula(
    axis: Triple, angle: float, arm: Triple, rate: float
) -> None:
    """About a fixed axis k: R·r = r·cos θ + (k × r)·sin θ + k·(k·r)·(1 - cos θ), ω × (R·r)."""
    k = np.array(axis)
    k[2] += 2.0
    k /= np.linalg.norm(k)
    r = 20.0 * np.array(arm)
    turn = (*(math.sin(0.5 * angle) * k), math.cos(0.5 * angle))
    pose = ShipPose(0, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0), turn, tuple(rate * k))
    position, velocity = hang_off_motion(pose, tuple(r))
    turned = r * math.cos(angle) + np.cross(k, r) * math.sin(angle)
    turned += k * (k @ r) * (1.0 - math.cos(angle))
    assert position == pytest.approx(turned - r + np.arange(1.0, 4.0), abs=1e-12)
    assert velocity == pytest.approx(rate * np.cross(k, turned), abs=1e-12)


def on_waves(heading_deg: float = 30.0) -> tuple[ShipOnWaves, Waves]:
    """The ship of the scene ship_6dof at another heading, and its waves."""
    scene = load_scene("ship_6dof")
    riding = OnWaves(responses="vessel_120m", heading_deg=heading_deg)
    scene = replace(scene, sea_state=SeaState(on_waves=riding))
    waves = next(effect for effect in scene.effects if isinstance(effect, WavesParams))
    sea = open_sea(scene)
    assert isinstance(sea, ShipOnWaves)
    return sea, components_of(waves, scene.environment.gravity_m_per_s2)


def test_motion_variances_by_rao_times_spectrum() -> None:
    """m0 of each motion is Σ |A|²·a²/2 of the waves' components; the wave's is Hs²/16."""
    sea, waves = on_waves()
    times = np.arange(0.0, 20_000.0, 1.7)
    moved, rate = np.array([sea.freedoms(t) for t in times]).transpose(1, 2, 0)
    table = read_responses("vessel_120m")
    answer = table.at(waves.omega / (2.0 * np.pi), waves.heading - math.radians(30.0))
    variance = 0.5 * (np.abs(answer) ** 2 * waves.amplitude_m**2).sum(axis=1)
    assert moved.var(axis=1) == pytest.approx(variance, rel=0.02)
    fast = 0.5 * (np.abs(answer) ** 2 * (waves.omega * waves.amplitude_m) ** 2).sum(axis=1)
    assert rate.var(axis=1) == pytest.approx(fast, rel=0.02)
    assert 8.0 * waves.amplitude_m @ waves.amplitude_m == pytest.approx(2.5**2, rel=0.01)


def test_a_ship_follows_long_waves() -> None:
    """A wave of 4 km from the beam: heave and sway are the water's, roll is its slope.

    η = a·cos(k·y - ω·t) at the hull gives heave a, sway a quarter behind it and roll +∂η/∂y.
    """
    hull, f = BoxHull(), np.array([0.02])
    k = (2.0 * math.pi * 0.02) ** 2 / 9.80665
    answer = box_responses(hull, np.array([0.0, 90.0, 180.0]), f).answer[:, :, 0]
    assert answer[:3, 1] == pytest.approx([0.0, -1j, 1.0], abs=0.05)
    assert answer[3, 1] == pytest.approx(-1j * k, rel=0.15)
    assert answer[4, 2] == pytest.approx(-1j * k, rel=0.05)  # waves from ahead: bow up first
    assert answer[2, 2] == pytest.approx(heave_response(hull, f)[0], rel=1e-12)


def test_the_shipped_rao_table_is_reproducible() -> None:
    """config/responses/vessel_120m.csv is made by box_responses, to its digits."""
    path = share_dir() / "config" / "responses" / "vessel_120m.csv"
    read = read_responses("vessel_120m")
    made = box_responses(BoxHull(), read.heading_deg, read.frequency_hz)
    assert path.read_text() == table_of(made)
    assert np.abs(read.answer - made.answer).max() < 1e-4


def test_mirrored_waves_mirror_the_motions() -> None:
    """From the other side: surge, heave and pitch alike, sway, roll and yaw turned round."""
    table, f = read_responses("vessel_120m"), np.array([0.08, 0.11, 0.2])
    port, starboard = (table.at(f, np.full(3, side)) for side in (1.1, -1.1))
    assert starboard == pytest.approx(port * np.array([[1], [-1], [1], [-1], [1], [-1]]))


def test_pose_rates_are_derivatives_of_the_pose() -> None:
    """Over 10 ms the orientation changes by the body's rate of turn, position by the velocity."""
    sea, _ = on_waves()
    step = 1e-2
    stamps = np.arange(0, 20_000_000_000, 250_000_000)
    for stamp in stamps.tolist():
        before, now, after = (sea.pose(stamp + late) for late in (-5_000_000, 0, 5_000_000))
        turn = Rotation.from_quat(before.orientation).inv() * Rotation.from_quat(after.orientation)
        assert turn.as_rotvec() / step == pytest.approx(now.rate_rad_per_s, abs=2e-6)
        moved = (np.array(after.position_m) - before.position_m) / step
        ship = Rotation.from_quat(now.orientation).apply(now.velocity_m_per_s)
        assert moved == pytest.approx(ship, abs=2e-5)


RIG = Rig(length=50.0, elements=5, step=0.02, density=0.0)


def test_hang_off_motion_by_pose_and_lever_arm() -> None:
    """Roll ±10° in 8 s under an arm of 18 m to port: heave and way aside, and their speeds."""
    scene = replace(RIG.scene(), ship=Ship(reference_m=(0.0, -18.0, -12.0), motion_ramp_s=0.0))
    twin, omega, most = Twin(scene), 2.0 * math.pi / 8.0, math.radians(10.0)
    for k in range(-2, 120):
        t = 0.05 * k
        angle, rate = most * math.sin(omega * t), most * omega * math.cos(omega * t)
        turn = (math.sin(0.5 * angle), 0.0, 0.0, math.cos(0.5 * angle))
        still = (0.0, 0.0, 0.0)
        pose = ShipPose(50_000_000 * k, still, still, turn, (rate, 0.0, 0.0))
        assert twin.submit_pose(pose) == ""
    for _ in range(200):
        twin.advance(1)
        t = twin.time_ns * 1e-9
        angle, rate = most * math.sin(omega * t), most * omega * math.cos(omega * t)
        y, z = (
            18.0 * math.cos(angle) - 12.0 * math.sin(angle),
            18.0 * math.sin(angle) + 12.0 * math.cos(angle),
        )
        value, speed = (table[0, : rows.LINE] for table in twin.inspect().boundary)
        assert value == pytest.approx([0.0, y - 18.0, z - 12.0], abs=2e-6)
        assert speed == pytest.approx([0.0, -rate * z, rate * y], abs=2e-4)
    assert twin.snapshot().node_position_m[0] == pytest.approx(value, abs=1e-12)


def test_each_hang_off_has_its_own_lever_arm() -> None:
    """Two winches 12 m apart on a ship that rolls, pitches and turns: each as a point of it does.

    Also as studies prescribe it, and from a saved state on.
    """
    scene = load_scene("two_line_lift")
    riding = replace(scene.ship, reference_m=(-20.0, -18.0, -12.0), motion_ramp_s=0.0)
    waves = next(
        effect for effect in load_scene("ship_6dof").effects if isinstance(effect, WavesParams)
    )
    sea = SeaState(on_waves=OnWaves(responses="vessel_120m", heading_deg=30.0))
    posed = replace(
        scene, ship=riding, sea_state=sea, effects=(*scene.effects, replace(waves, ramp_s=0.0))
    )
    ship, twin = open_sea(posed), Twin(replace(posed, effects=scene.effects))
    assert isinstance(ship, ShipOnWaves)
    for sample in ship.between(FIRST_NS, 2_000_000_000):
        assert submit(twin, sample) == ""
    twin.advance(round(0.5 / twin.step_s))
    other = Twin.restore(twin.capture(), twin.scene)
    for run in (twin, other):
        run.advance(round(0.5 / twin.step_s))
        snapshot, pose = run.snapshot(), ship.pose(1_000_000_000)
        for rope, at in ((0, scene.ship.hang_off_m), (1, scene.hang_offs[0].at_m)):
            arm = np.array(at) - riding.reference_m
            moved, _ = hang_off_motion(pose, tuple(arm))
            computed = snapshot.ropes[rope].node_position_m[0] - at
            assert computed == pytest.approx(moved, abs=1e-6)
            assert np.abs(computed[:2]).max() > 1e-3, "it moves aside too"
    course = MotionWindow(posed, 1.0, 0.1).motion(twin.step_s)
    for rope in (0, 1):
        ends = twin.snapshot().ropes[rope].node_position_m[0]
        assert course.value[rope, -1, : rows.LINE] == pytest.approx(ends, abs=1e-12)


def test_prescribed_motion_from_a_table() -> None:
    """A circle given every 5 s: the spline is off by 5·(ω·Δt)⁴/384 of the radius at most."""
    scene = replace(load_scene("deep_tow_turn"), ship=Ship(motion_ramp_s=0.0))
    sea, twin = open_sea(scene), Twin(scene)
    assert sea is not None
    for sample in sea.between(FIRST_NS, 3_000_000_000):
        assert submit(twin, sample) == ""
    turning = sea.between(400_000_000_000, 800_000_000_000)
    x, y = np.array([one.lateral[:2] for one in turning if one.lateral]).T
    assert np.hypot(x - 120.0, y - 200.0) == pytest.approx(np.full(len(x), 200.0), abs=2e-3)
    speeds = [math.hypot(*one.lateral[2:]) for one in turning if one.lateral]
    assert speeds == pytest.approx([0.75] * len(speeds), abs=2e-3)
    twin.advance(200)
    assert twin.inspect().boundary.value[0, 0] == pytest.approx(
        sea.between(2_000_000_000, 2_000_000_001)[0].lateral[0], abs=1e-9
    )


def fed(scene: Scene, until_ns: int) -> Twin:
    """A twin that has its scene's own sea up to then."""
    sea, twin = open_sea(scene), Twin(scene)
    assert sea is not None
    for sample in sea.between(FIRST_NS, until_ns):
        assert submit(twin, sample) == ""
    return twin


def test_studies_and_live_twins_use_the_same_motion() -> None:
    """A course, as accuracy studies step it, prescribes what a twin that is fed prescribes."""
    scene = load_scene("ship_6dof")
    twin = fed(scene, 2_000_000_000)
    course = MotionWindow(scene, 1.0, 0.1).motion(scene.time.step_s)
    for row in range(1, 51):
        twin.advance(1)
        assert (twin.inspect().boundary.value[0] == course.value[row]).all()
        assert (twin.inspect().boundary.rate[0] == course.rate[row]).all()


def test_a_saved_state_keeps_the_horizontal_motion() -> None:
    """A twin that goes on from a saved state moves on as the one that was saved."""
    scene = load_scene("deep_tow_turn")
    twin = fed(scene, 4_000_000_000)
    twin.advance(100)
    other = Twin.restore(twin.capture(), scene)
    for run in (twin, other):
        run.advance(100)
    assert (other.inspect().boundary.value[0] == twin.inspect().boundary.value[0]).all()
    assert twin.inspect().boundary.value[0, 0] > 0.0
    assert other.snapshot().tension_top_n == twin.snapshot().tension_top_n


def test_motion_series_have_horizontal_columns() -> None:
    """Samples of a prescribed motion become a series with east and north columns."""
    sea = open_sea(load_scene("deep_tow_turn"))
    assert sea is not None
    series = series_of(sea.between(FIRST_NS, 10_000_000_000))
    assert series is not None
    assert series.lateral is not None
    assert series.lateral.shape == (4, len(series.stamp_ns))
    u = 9.95 / 60.0  # of the minute in which it gathers way: v = 3u² - 2u³
    assert series.lateral[0, -1] == pytest.approx(45.0 * (u**3 - 0.5 * u**4), abs=1e-3)
