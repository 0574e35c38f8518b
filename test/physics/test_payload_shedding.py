"""The transverse force of a payload's vortices: frequency and amplitude in closed form."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from body_rigs import body_in, scene_of
from ramp_rigs import in_time
from rigs import Rig, march, still
from scene_text import GOOD

from rope_twin import load_scene
from rope_twin.core.body.components import PHASE, Shedding, power_shedding
from rope_twin.core.body.loads import component_of
from rope_twin.core.body.step import pose_of
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.fluid_ramp import FluidRampParams, LoadCurve
from rope_twin.effects.payload_shedding import PayloadShedding, PayloadSheddingParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.errors import SceneError
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.schema import Scene
from rope_twin.twin.monitors import ENERGY
from rope_twin.twin.twin import Twin

SPEED, WIDE, LENGTH, MASS, ADDED, AREA = 0.5, 1.0, 20.0, 2000.0, 500.0, 2.0
SHEDS = PayloadSheddingParams(strouhal=0.2, lift_coefficient=0.003, diameter_m=WIDE, area_m2=1.0)
PENDULUM = Rig(  # on a rope without mass and drag; the payload has no drag along the current
    length=LENGTH, elements=2, mass=1e-3, EA=1e9, diameter=1e-4, damping=1e5, load=MASS,
    volume=0.25, density=1025.0, added=(ADDED,) * 3, area=(0.0, AREA, 0.0), step=0.02,
    tolerance=1e-7, current=((0.0, (SPEED, 0.0, 0.0)),),
)  # fmt: skip
STEADY = ((0.0, 1.0), (1.0, 1.0))  # factors over time


def shedding(
    rig: Rig = PENDULUM,
    over_time: tuple[tuple[float, float], ...] = STEADY,
    factor: float = 1.0,
    **changes: float,
) -> Scene:
    """The rig's scene, whose payload sheds vortices, with a factor on the current and on these."""
    scene = rig.scene()
    current = replace(scene.effects[0], over_time=over_time)
    assert isinstance(current, CurrentParams)
    ramp = FluidRampParams(vortices=LoadCurve(over_time=((0.0, factor),)))
    return in_time(scene, current, replace(SHEDS, **changes), ramp)


def of_payload(twin: Twin) -> PayloadShedding:
    """The kernel data of the vortices."""
    (found,) = (effect for effect in twin.rope.effects if isinstance(effect, PayloadShedding))
    return found


def test_a_pendulum_is_driven_at_the_strouhal_frequency() -> None:
    """M·y'' + ½ρCdA·U·y' + W/L·y = -½ρ·C_L·A·U²·sin ωt from rest, to 0.2 % of the largest y.

    The steady part has the amplitude F/√((K - Mω²)² + (cω)²) and ω = 2π·St·U/D, 0.1 %.
    """
    twin, seconds = Twin(shedding()), 200.0
    snapshots = list(march(twin, still, seconds, every=5))
    t = np.array([snapshot.time_s for snapshot in snapshots])
    y = np.array([snapshot.payload_position_m[1] for snapshot in snapshots])
    M, c = MASS + ADDED, 0.5 * 1025.0 * AREA * SPEED
    K = PENDULUM.load_weight / LENGTH
    F, w = -0.5 * 1025.0 * 0.003 * 1.0 * SPEED**2, 2.0 * math.pi * 0.2 * SPEED / WIDE
    steady = F / (K - M * w * w + 1j * c * w)
    decay = 0.5 * c / M
    own = math.sqrt(K / M - decay**2)
    cosine = -steady.imag  # y(0) = 0, y'(0) = 0
    sine = (decay * cosine - w * steady.real) / own
    exact = (steady * np.exp(1j * w * t)).imag
    exact += np.exp(-decay * t) * (cosine * np.cos(own * t) + sine * np.sin(own * t))
    assert np.abs(y - exact).max() < 2e-3 * np.abs(exact).max()
    late = t > 120.0  # the free swing has decayed to 5e-6
    assert y[late].max() == pytest.approx(abs(steady), rel=1e-3)
    spectrum = np.abs(np.fft.rfft(y[late] * np.hanning(late.sum()), 1 << 18))
    frequency = np.fft.rfftfreq(1 << 18, float(t[1] - t[0]))[spectrum.argmax()]
    assert frequency == pytest.approx(0.2 * SPEED / WIDE, rel=1e-3)


def test_shedding_phase_in_a_varying_current() -> None:
    """2π·St/D times the distance that the water has moved past the payload; 0.1 %."""
    slower = ((0.0, 1.0), (10.0, 0.2), (20.0, 0.2))
    twin = Twin(shedding(over_time=slower, lift_coefficient=1e-3))
    twin.advance(1000)
    way = SPEED * (10.0 * 0.6 + 10.0 * 0.2)
    assert of_payload(twin).memory[0, 0] == pytest.approx(2.0 * math.pi * 0.2 * way, rel=1e-3)


def test_axial_flow_sheds_no_force() -> None:
    """In a vertical current the payload hangs still, at any speed."""
    twin = Twin(shedding(replace(PENDULUM, current=((0.0, (0.0, 0.0, 1.5)),)), lift_coefficient=1))
    twin.advance(500)
    assert np.abs(twin.snapshot().payload_position_m[:2]).max() < 1e-9
    assert of_payload(twin).memory[0, 0] > 10.0


def test_the_shedding_force_is_normal_to_flow_and_rope() -> None:
    """In a current to the north-east the swing is north-west and south-east."""
    part = SPEED * math.sqrt(0.5)
    rig = replace(PENDULUM, current=((0.0, (part, part, 0.0)),), area=(0.0, 0.0, 0.0))
    snapshots = march(Twin(shedding(rig)), still, 20.0, every=10)
    x, y, _ = np.array([snapshot.payload_position_m for snapshot in snapshots]).T
    assert np.abs(x + y).max() < 2e-2 * np.abs(x - y).max()
    assert np.abs(x - y).max() > 1e-4


def test_energy_balance_of_payload_shedding() -> None:
    """The balance closes to 0.1 % of what is exchanged."""
    for snapshot in march(Twin(shedding(), ENERGY), still, 60.0, every=500):
        balance = snapshot.energy
    assert balance is not None
    assert balance.exchanged_j > 1e-3
    assert abs(balance.residual_j) < 1e-3 * balance.exchanged_j


def test_a_fluid_ramp_scales_the_shedding_force() -> None:
    """Half the factor gives half the swing."""
    swings = []
    for factor in (1.0, 0.5):
        snapshots = march(Twin(shedding(factor=factor)), still, 30.0, every=10)
        swings.append(max(abs(snapshot.payload_position_m[1]) for snapshot in snapshots))
    assert swings[1] == pytest.approx(0.5 * swings[0], rel=2e-3)


def test_one_of_several_payloads_may_shed() -> None:
    scene = load_scene("two_line_lift")
    names = [payload.name for payload in scene.payloads]
    for payload in ("", *names):
        sheds = replace(SHEDS, payload=payload)
        ropes = build_joined(replace(scene, effects=(*scene.effects, sheds))).system.ropes
        strong = [rope.effects[-1].k > 0.0 for rope in ropes]
        assert sum(strong) == (len(names) if payload == "" else 1)


OWN = "payload_shedding: {strouhal: 0.2, lift_coefficient: 0.3, diameter_m: 2, area_m2: 4"


@pytest.mark.parametrize(
    ("own", "words"),
    [
        (f"{OWN}, payload: another}}", "there is no payload 'another'"),
        (OWN.replace(", area_m2: 4", "") + "}", "area_m2: it is missing; give the projected area"),
        (OWN.replace("0.2", "7") + "}", "0.01 to 1"),
    ],
)
def test_invalid_payload_shedding_is_rejected(tmp_path: Path, own: str, words: str) -> None:
    path = tmp_path / "sheds.yaml"
    path.write_text(GOOD.replace("  - weight: {}\n", f"  - weight: {{}}\n  - {own}\n"))
    with pytest.raises(SceneError, match=words):
        load_scene(str(path))


def test_an_area_key_for_a_rigid_body_is_rejected(tmp_path: Path) -> None:
    scene = Path("config/scenes/manifold_lift.yaml")
    path = tmp_path / "body.yaml"
    path.write_text(
        scene.read_text().replace("  - weight: {}\n", f"  - weight: {{}}\n  - {OWN}}}\n")
    )
    with pytest.raises(SceneError, match="area of a rigid body follows from its size"):
        load_scene(str(path))


HUNG = RigidBodyParams(size_m=(2.0, 1.0, 0.5), pinned_at_m=(0.0, 0.0, 2.0), heading_deg=30.0)
BODY_RIG = Rig(  # a rope without weight to speak of
    length=20.0, elements=4, mass=0.01, EA=1e8, diameter=0.001, load=MASS, step=0.02,
    density=1025.0, volume=0.25, added=(ADDED,) * 3, area=(4.0,) * 3, tolerance=1e-5,
    current=((0.0, (SPEED, 0.0)),),
)  # fmt: skip


def with_body(**changes: float) -> Scene:
    """A box in the current, which sheds vortices."""
    scene = scene_of(BODY_RIG, HUNG)
    sheds = replace(SHEDS, area_m2=None, **changes)
    return replace(scene, effects=(*scene.effects, sheds))


@pytest.mark.long
def test_a_body_sheds_with_its_projected_area() -> None:
    """F = ½ρ·C_L·(Σ a_k·|w_k|)·(w × n)·sin φ, moment and derivatives against differences of it."""
    twin = Twin(with_body(lift_coefficient=0.4))
    twin.advance(40)
    body = body_in(twin)
    part = component_of(body, Shedding)
    assert part is not None
    record = body.records[int(body.memory[0, 0])]
    way = 2.0 * math.pi * 0.2 / WIDE * SPEED * twin.snapshot().time_s
    assert record[PHASE] == pytest.approx(way, rel=2e-2)
    pose = pose_of(body)
    w = np.array([SPEED, 0.0, 0.0]) - pose.velocity
    inward = w @ pose.turn
    faces = np.abs(inward) @ [0.5, 1.0, 2.0]
    force = 0.5 * 1025.0 * 0.4 * faces * math.sin(record[PHASE]) * np.cross(w, [0.0, 0.0, 1.0])
    assert power_shedding(part, body, pose) == pytest.approx(float(force @ pose.velocity), rel=1e-3)
    assert np.linalg.norm(force) > 10.0


@pytest.mark.long
def test_a_body_swings_at_the_strouhal_frequency() -> None:
    """Cross-flow swing at that frequency and energy balance; 0.1 %."""
    twin = Twin(with_body(), ENERGY)
    snapshots = list(march(twin, still, 400.0, every=25))
    y = np.array(
        [snapshot.payload_position_m[1] for snapshot in snapshots if snapshot.body is not None]
    )
    late = y[len(y) // 3 :]
    spectrum = np.abs(np.fft.rfft(late * np.hanning(len(late)), 1 << 18))
    frequency = np.fft.rfftfreq(1 << 18, 0.5)[spectrum.argmax()]
    assert frequency == pytest.approx(0.2 * SPEED / WIDE, rel=1e-3)
    balance = snapshots[-1].energy
    assert balance is not None
    assert abs(balance.residual_j) < 1e-3 * balance.exchanged_j


@pytest.mark.long
def test_a_body_in_still_water_sheds_no_force() -> None:
    scene = scene_of(replace(BODY_RIG, current=((0.0, (0.0, 0.0)),)), HUNG)
    twin = Twin(replace(scene, effects=(*scene.effects, replace(SHEDS, area_m2=None))))
    twin.advance(200)
    snapshot = twin.snapshot()
    assert snapshot.body is not None
    assert np.abs(snapshot.payload_position_m[:2]).max() < 1e-6
