"""A winch with all its components in a twin: call patterns, saved states, branches, ensembles."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from small_scene import digest, small_scene

from rope_twin import Twin
from rope_twin.errors import InputError
from rope_twin.scene.schema import Scene
from rope_twin.scene.winch import (
    Brake,
    ConstantTension,
    Drive,
    Drum,
    EmergencyStop,
    HeaveCompensation,
)
from rope_twin.twin.ensemble.ensemble import Ensemble, Variation
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.winch.commands import CommandSample, WinchCommand

S = 1_000_000_000
HEAVE = tuple((k * S // 20, math.sin(0.04 * k), 0.8 * math.cos(0.04 * k)) for k in range(-2, 400))
ORDERS = (
    (S, WinchCommand("speed", 1.0)),
    (3 * S, WinchCommand("depth", 210.0)),
    (6 * S, WinchCommand("tension", 7e4)),
    (7 * S, WinchCommand("length", 205.0)),
    (8 * S, WinchCommand("set_brake")),
    (9 * S, WinchCommand("release_brake")),
    (19 * S // 2, WinchCommand("emergency_stop")),
)
COMPENSATION = HeaveCompensation(
    efficiency=0.95, lag_s=0.1, delay_s=0.07, stroke_m=2.5, speed_limit_m_per_s=3.0,
    acceleration_limit_m_per_s2=3.0,
)  # fmt: skip


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    plain = small_scene(tmp_path)
    assert plain.winch is not None
    winch = replace(
        plain.winch, jerk_limit_m_per_s3=0.5, heave_compensation=COMPENSATION,
        drum=Drum(core_radius_m=0.8, turns_per_layer=40.0),
        drive=Drive(inertia_kg_m2=3e3, torque_limit_n_m=75e3),
        brake=Brake(holding_torque_n_m=90e3, delay_s=0.3),
        emergency_stop=EmergencyStop(deceleration_m_per_s2=2.0),
        constant_tension=ConstantTension(gain_m_per_s_per_kn=0.02, integral_time_s=5.0),
    )  # fmt: skip
    return replace(plain, winch=winch)


def fed(twin: Twin) -> Twin:
    for sample in HEAVE:
        assert twin.submit_heave(*sample) == ""
    for stamp_ns, order in ORDERS:
        assert twin.submit_command(stamp_ns, order) == ""
    return twin


def test_a_winch_run_is_independent_of_the_call_pattern(scene: Scene) -> None:
    whole, pieces = fed(Twin(scene)), fed(Twin(scene))
    whole.advance(1000)
    for steps in (1, 255, 2, 300, 442):
        pieces.advance(steps)
    one, other = whole.snapshot(), pieces.snapshot()
    assert one.winches == other.winches
    assert one.winches[0].mode == "emergency_stop"
    assert one.payload_position_m.tobytes() == other.payload_position_m.tobytes()
    assert one.tension_top_n == other.tension_top_n


@pytest.mark.parametrize("steps", [350, 650, 845])
def test_saved_and_branched_winch_runs_are_bit_identical(
    scene: Scene, steps: int, tmp_path: Path
) -> None:
    """In the middle of a depth, of a tension, and while the brake holds."""
    twin = fed(Twin(scene))
    twin.advance(steps)
    twin.save(tmp_path / "winch.state")
    restored, branch = Twin.restore(tmp_path / "winch.state", scene), twin.branch()
    twin.snapshot()
    branch.snapshot()
    for run in (twin, restored, branch):
        run.advance(1000 - steps)
    snapshots = [run.snapshot() for run in (twin, restored, branch)]
    assert digest(snapshots[:1]) == digest(snapshots[2:])
    assert snapshots[0].winches == snapshots[1].winches == snapshots[2].winches
    assert snapshots[0].node_position_m.tobytes() == snapshots[1].node_position_m.tobytes()
    assert snapshots[0].winches[0].figures


def test_heave_compensation_in_an_ensemble_equals_a_twin(scene: Scene) -> None:
    assert scene.winch is not None
    winch = replace(scene.winch, drum=None, drive=None, brake=None)
    own = replace(scene, winch=winch)
    series = HeaveSeries.of(HEAVE)
    commands = (
        CommandSample(S, WinchCommand("length", 203.0)),
        CommandSample(5 * S, WinchCommand("stop_compensating")),
    )
    plain = tuple((t, 0.5 * z, 0.5 * v) for t, z, v in HEAVE)
    variations = [
        Variation(heave=heave, commands=commands) for heave in (series, HeaveSeries.of(plain))
    ]
    ensemble = Ensemble(own, variations)
    ensemble.advance(8.0)
    twin = Twin(own)
    for sample in HEAVE:
        twin.submit_heave(*sample)
    for command in commands:
        assert twin.submit_command(command.stamp_ns, command.command) == ""
    twin.advance(800)
    one, other, alone = ensemble.snapshot(0), ensemble.snapshot(1), twin.snapshot()
    assert one.line_out_m == alone.line_out_m
    assert one.tension_top_n == alone.tension_top_n
    assert other.line_out_m != one.line_out_m, "each member answers its own heave"


def test_members_with_tension_feedback_equal_a_twin(scene: Scene) -> None:
    """Drive and brake, and commands by depth and tension; equal to the bit."""
    commands = tuple(CommandSample(*one) for one in ORDERS)
    ensemble = Ensemble(scene, [Variation(heave=HeaveSeries.of(HEAVE), commands=commands)])
    assert ensemble.lanes().alone == {"tension feedback of the winch": 1}
    ensemble.advance(10.0)
    twin = fed(Twin(scene))
    twin.advance(1000)
    found, expected = ensemble.snapshot(0), twin.snapshot()
    assert found.winches == expected.winches
    assert digest([found]) == digest([expected])


def test_an_ensemble_rejects_invalid_commands(scene: Scene) -> None:
    """It says so before the first step, in a sentence."""
    commands = (CommandSample(0, WinchCommand("speed", 50.0)),)
    with pytest.raises(InputError, match="no winch runs faster"):
        Ensemble(scene, [Variation(commands=commands)])
