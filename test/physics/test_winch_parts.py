"""Winch components on a rope against closed forms: AHC, rendering drum, brake."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from rope_twin import Twin, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.scene.winch import (
    Brake,
    ConstantTension,
    Drive,
    Drum,
    EmergencyStop,
    HeaveCompensation,
)
from rope_twin.twin.monitors import ENERGY
from rope_twin.twin.winch.commands import WinchCommand

HEAVE_M, PERIOD_S = 1.0, 8.0
OMEGA = 2.0 * math.pi / PERIOD_S
DRUM = Drum(core_radius_m=0.8, turns_per_layer=40.0)
CORE = """\
about: a rope on a winch
source: made up
look_at: nothing
ropes:
  - name: hoist
    rope: steel_wire_40mm
    length_m: 200.0
    elements: 20
    damping: {fraction_of_first_axial_mode: 0.02}
    to: tool
payloads:
  - {name: tool, mass_kg: 8000.0, shape: {box: {length_m: 2.0, width_m: 1.5, height_m: 1.0}},
     displaced_volume_m3: 1.5}
winch:
  speed_limit_m_per_s: 1.5
  acceleration_limit_m_per_s2: 0.3
  min_line_out_m: 20.0
  max_line_out_m: 1000.0
ship: {motion_ramp_s: 2.0}
effects:
  - current: {profile: [[0.0, [0.0, 0.0]], [-900.0, [0.0, 0.0]]]}
  - weight: {}
  - drag: {normal: 1.5, tangential: 0.03}
  - added_mass: {normal: 1.0}
  - payload: {}
time: {step_s: 0.01}
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return read(tmp_path_factory.mktemp("scenes"), CORE)


def read(folder: Path, text: str) -> Scene:
    path = folder / "winch.yaml"
    path.write_text(text)
    return load_scene(path)


def with_parts(scene: Scene, **parts: object) -> Scene:
    assert scene.winch is not None
    return replace(scene, winch=replace(scene.winch, **parts))


def heaved(twin: Twin, amplitude_m: float, seconds: float) -> Twin:
    """The twin with so much of a sine heave ahead."""
    for k in range(-2, round(seconds / 0.05) + 5):
        t = 0.05 * k
        z, v = amplitude_m * math.sin(OMEGA * t), amplitude_m * OMEGA * math.cos(OMEGA * t)
        assert twin.submit_heave(round(t * 1e9), z, v) == ""
    return twin


def ran(twin: Twin, seconds: float) -> NDArray[np.float64]:
    """Time, top tension, line out, payout speed and hang-off after each step."""
    rows = []
    for _ in range(round(seconds / twin.step_s)):
        twin.advance(1)
        snapshot = twin.snapshot()
        rows.append((snapshot.time_s, snapshot.tension_top_n, snapshot.line_out_m,
                     snapshot.payout_speed_m_per_s, snapshot.hang_off_position_m[2]))  # fmt: skip
    return np.array(rows)


def figures(twin: Twin) -> dict[str, float]:
    (winch,) = twin.snapshot().winches
    return dict(winch.figures)


def amplitude(t: NDArray[np.float64], x: NDArray[np.float64]) -> float:
    """Return the amplitude at the heave's frequency in a series over whole periods."""
    columns = np.column_stack([np.cos(OMEGA * t), np.sin(OMEGA * t), np.ones_like(t)])
    c, s, _ = np.linalg.lstsq(columns, x, rcond=None)[0]
    return math.hypot(c, s)


@pytest.mark.parametrize(
    ("efficiency", "lag_s", "delay_s"), [(0.95, 0.0, 0.0), (0.95, 0.3, 0.0), (0.9, 0.2, 0.15)]
)
def test_residual_heave_of_active_compensation(
    scene: Scene, efficiency: float, lag_s: float, delay_s: float
) -> None:
    """Residual of a heave of 1 m: |1 - η·e^(-iωδ)/(1 + iωτ)|; 1e-4 m is the step's own error."""
    part = HeaveCompensation(
        efficiency=efficiency, lag_s=lag_s, delay_s=delay_s, stroke_m=4.0,
        speed_limit_m_per_s=3.0, acceleration_limit_m_per_s2=3.0,
    )  # fmt: skip
    answered = ran(heaved(Twin(with_parts(scene, heave_compensation=part)), HEAVE_M, 24.0), 24.0)[
        -800:
    ]
    t, tension, line, _, z = answered.T
    share = efficiency * cmath.exp(-1j * OMEGA * delay_s) / (1.0 + 1j * OMEGA * lag_s)
    assert amplitude(t, z - line) == pytest.approx(HEAVE_M * abs(1.0 - share), abs=2e-5)
    bare = ran(heaved(Twin(scene), HEAVE_M, 24.0), 24.0)[-800:]
    # tension follows the motion of the end, but for drag, of which little motion has less a share
    left = amplitude(t, tension) / amplitude(t, bare[:, 1])
    assert left == pytest.approx(abs(1.0 - share), abs=0.02)


def test_compensation_reports_its_stroke_limit(scene: Scene) -> None:
    part = HeaveCompensation(
        efficiency=1.0, lag_s=0.0, stroke_m=0.6, speed_limit_m_per_s=3.0,
        acceleration_limit_m_per_s2=3.0,
    )  # fmt: skip
    twin = heaved(Twin(with_parts(scene, heave_compensation=part)), HEAVE_M, 16.0)
    begun, messages = twin.snapshot().line_out_m, set()
    for _ in range(80):
        line = ran(twin, 0.2)[:, 2]
        assert np.abs(line - begun).max() <= 0.6 + 1e-9
        messages.add(twin.snapshot().winch_at_limit)
    assert "heave compensation at the end of its stroke, 0.6 m" in messages


@pytest.mark.parametrize("inertia", [1e-3, 1.0, 1e3])
def test_tension_at_a_rendering_drum_is_torque_over_radius(scene: Scene, inertia: float) -> None:
    """However light the drum; the load is twice the torque's and sinks at its drag's speed."""
    drive = Drive(inertia_kg_m2=inertia, torque_limit_n_m=40e3)
    twin = Twin(with_parts(scene, drum=DRUM, drive=drive))
    tension = ran(twin, 20.0)[:, 1]
    read_off = figures(twin)
    held = 40e3 / read_off["drum_radius_m"]
    assert tension[-1] == pytest.approx(held, rel=5e-4)
    assert read_off["motor_torque_n_m"] == 40e3
    assert tension[-500:].std() < 1e-3 * held, "it is steady"
    words = twin.snapshot().winch_at_limit
    assert "renders: " in words
    assert (
        f"line {twin.snapshot().payout_speed_m_per_s:+.2f} m/s where +0.00 m/s is wanted" in words
    )
    if inertia < 1.0:
        assert np.abs(tension[100:] / held - 1.0).max() < 0.02, "a light drum does not ring"


@pytest.mark.parametrize(("elements", "step_s"), [(4, 0.01), (150, 0.02), (20, 0.02), (20, 0.004)])
def test_a_massless_drum_is_stable_on_any_mesh(scene: Scene, elements: int, step_s: float) -> None:
    line = replace(scene.ropes[0], elements=elements)
    coarse = replace(scene, ropes=(line,), time=replace(scene.time, step_s=step_s))
    drive = Drive(inertia_kg_m2=1e-6, torque_limit_n_m=40e3)
    twin = Twin(with_parts(coarse, drum=DRUM, drive=drive))
    tension = ran(twin, 10.0)[:, 1]
    held = 40e3 / figures(twin)["drum_radius_m"]
    assert np.abs(tension[-round(5.0 / step_s) :] / held - 1.0).max() < 0.02


def test_acceleration_of_a_drum_with_inertia(scene: Scene) -> None:
    """(J/r²)·dV/dt = F - P, of the drum alone: both sides are measured."""
    drive = Drive(inertia_kg_m2=2e5, torque_limit_n_m=60e3)
    twin = Twin(with_parts(scene, drum=DRUM, drive=drive))
    rows = ran(twin, 8.0)
    r = figures(twin)["drum_radius_m"]
    pull = np.trapezoid(rows[:, 1] - 60e3 / r, rows[:, 0])
    gained = 2e5 / r**2 * (rows[-1, 3] - rows[0, 3])
    assert gained == pytest.approx(pull, rel=2e-3)


def test_a_brake_slips_above_its_holding_capacity(scene: Scene) -> None:
    drive = Drive(inertia_kg_m2=2e3, torque_limit_n_m=150e3)
    for capacity, slips in ((120e3, False), (50e3, True)):
        brake = Brake(holding_torque_n_m=capacity, delay_s=0.2)
        twin = Twin(with_parts(scene, drum=DRUM, drive=drive, brake=brake))
        assert twin.submit_command(None, WinchCommand("set_brake")) == ""
        rows = ran(twin, 20.0)
        read_off = figures(twin)
        assert read_off["brake_holds"] == 1.0
        assert read_off["motor_torque_n_m"] == 0.0
        if slips:
            assert rows[-1, 1] == pytest.approx(capacity / read_off["drum_radius_m"], rel=5e-3)
            assert "slips at 50 kN·m" in twin.snapshot().winch_at_limit
        else:
            assert rows[-1, 2] == 200.0
            expected = rows[-1, 1] * read_off["drum_radius_m"]
            assert read_off["brake_torque_n_m"] == pytest.approx(expected, rel=1e-6)


def test_stopping_distance_of_an_emergency_stop(scene: Scene) -> None:
    stop = EmergencyStop(deceleration_m_per_s2=2.0)
    twin = Twin(with_parts(scene, emergency_stop=stop))
    twin.submit_speed(None, 1.0)
    before = ran(twin, 5.0)[-1, 2]
    assert twin.submit_command(None, WinchCommand("emergency_stop")) == ""
    rows = ran(twin, 2.0)
    assert rows[-1, 2] - before == pytest.approx(1.0**2 / (2.0 * 2.0), abs=1e-9)
    assert rows[-1, 3] == 0.0


def test_constant_tension_follows_the_heave(scene: Scene) -> None:
    """A gain far above what feedback of the last step's tension would bear, 1/(21 kN·s/m)."""
    part = ConstantTension(gain_m_per_s_per_kn=1.0, integral_time_s=10.0)
    kept = Twin(with_parts(scene, constant_tension=part, acceleration_limit_m_per_s2=3.0))
    rest = kept.snapshot().tension_top_n
    assert kept.submit_command(None, WinchCommand("tension", rest)) == ""
    swung = ran(heaved(Twin(scene), HEAVE_M, 24.0), 24.0)[-800:, 1]
    held = ran(heaved(kept, HEAVE_M, 24.0), 24.0)[-800:, 1]
    assert held.mean() == pytest.approx(rest, rel=5e-3)
    assert held.std() < 0.1 * swung.std()
    assert np.abs(np.diff(held, 2)).max() < 1e-3 * rest, "it does not swing from step to step"


def test_depth_control_reaches_its_depth_with_little_overshoot(scene: Scene) -> None:
    twin = Twin(scene)
    depth = -twin.snapshot().payload_position_m[2] + 15.0
    assert twin.submit_command(None, WinchCommand("depth", depth)) == ""
    lines = ran(twin, 50.0)[:, 2]
    assert -twin.snapshot().payload_position_m[2] == pytest.approx(depth, abs=5e-3)
    # while it sinks, drag takes some load and so some stretch off the rope: 2 cm of line
    assert lines.max() - lines[-1] < 0.025


def test_energy_balance_of_a_rendering_winch(scene: Scene) -> None:
    drive = Drive(inertia_kg_m2=3e3, torque_limit_n_m=60e3)
    twin = Twin(with_parts(scene, drum=DRUM, drive=drive), ENERGY)
    ran(twin, 10.0)
    balance = twin.snapshot().energy
    assert balance is not None
    assert balance.hang_off_j < 0.0, "the drum takes energy from the rope"
    assert abs(balance.residual_pct) < 0.5
