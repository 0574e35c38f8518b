"""The shipped multi-line scenes: static equilibrium, heave, commands, saved states."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_scene import digest

from rope_twin import Snapshot, load_scene
from rope_twin.core import state as rows
from rope_twin.core.joined.statics import solve_joined_statics
from rope_twin.effects.current import CurrentParams
from rope_twin.errors import SceneError
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.lift import point_figures
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import variant
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import WinchCommand

SAMPLE_NS, AHEAD_NS = 50_000_000, 200_000_000


def heaved(twin: Twin, steps: int, every: int = 10) -> list[Snapshot]:
    """Run under a heave of 1 m every 8 s; return a snapshot each so many steps."""
    snapshots, omega = [], 2.0 * math.pi / 8.0
    for _ in range(steps):
        due = twin.time_ns + AHEAD_NS
        if due % SAMPLE_NS == 0:
            t = due * 1e-9
            assert not twin.submit_heave(due, math.sin(omega * t), omega * math.cos(omega * t))
        twin.advance(1)
        if twin.steps % every == 0:
            snapshots.append(twin.snapshot())
    return snapshots


@pytest.fixture(scope="module")
def bridle() -> Scene:
    return load_scene("bridle_lift")


@pytest.fixture(scope="module")
def two_lines() -> Scene:
    return load_scene("two_line_lift")


def top_tension(snapshot: Snapshot, name: str) -> float:
    return next(rope.tension_top_n for rope in snapshot.ropes if rope.name == name)


def test_static_tensions_of_a_bridle(bridle: Scene) -> None:
    """In still water: legs W/(2·cos α) on the bar, the bar W·tan α, the total at the top."""
    calm = CurrentParams(profile=((0.0, (0.0, 0.0)),))
    effects = tuple(calm if isinstance(e, CurrentParams) else e for e in bridle.effects)
    snapshot = Twin(replace(bridle, effects=effects)).snapshot()
    figures = point_figures(bridle)
    g, rho = bridle.environment.gravity_m_per_s2, bridle.environment.water_density_kg_per_m3
    weight = {name: (f.mass_kg - rho * f.volume_m3) * g for name, f in figures.items()}
    rope = bridle.ropes[0].made_of[0].rope
    per_metre = (rope.mass_kg_per_m - rho * 0.25 * math.pi * rope.hydrodynamic_diameter_m**2) * g
    half = weight["half_port"] + 6.0 * per_metre + weight["bar_port"]
    cosine = math.sqrt(3.0) / 2.0
    assert snapshot.ropes[1].element_tension_n[-1] == pytest.approx(
        half / cosine + 0.5 * per_metre, rel=1e-3
    )
    push = (half + 4.0 * per_metre) * math.tan(math.radians(30.0))
    assert snapshot.struts[0].pull_n == pytest.approx(-push, rel=2e-3)
    everything = sum(weight.values()) + (1000.0 + 16.0 + 12.0) * per_metre
    assert snapshot.tension_top_n == pytest.approx(everything, rel=1e-6)
    assert snapshot.ropes[0].tension_top_n == snapshot.tension_top_n
    assert len(snapshot.payloads) == 2
    assert snapshot.payloads[0].position_m[2] == pytest.approx(-1013.0 - 2.8, abs=1.0)


def test_static_equilibrium_from_an_inverted_guess(bridle: Scene) -> None:
    """On 1,000 elements, from a guess in which every rope stands on its head."""
    rests = []
    for sign in (1.0, -1.0):
        built = build_joined(variant(bridle, 780))
        system = built.system
        position = np.zeros((len(system.ropes), rows.MOTIONS))
        position[:, : rows.LINE] = np.nan_to_num(built.hang_off_m)
        position[:, rows.LINE] = [line.length_m for line in bridle.ropes]
        for rope in system.ropes:
            rope.state.nodes[rows.Z] *= sign
        system.joints.nodes[rows.Z] *= sign
        end = solve_joined_statics(system, position)
        assert end.found
        rests.append(end.tension_n)
    assert rests[1] == pytest.approx(rests[0], rel=1e-6)


def test_rope_ends_stay_at_their_joints(bridle: Scene) -> None:
    """Twenty seconds of heave and payout: every end at its joint, each step converged."""
    twin = Twin(bridle)
    assert twin.submit_speed(None, 1.0) == ""
    snapshots = heaved(twin, 2000, 100)
    for snapshot in snapshots:
        hoist, port, starboard, low_port, low_starboard = snapshot.ropes
        assert (hoist.node_position_m[-1] == port.node_position_m[0]).all()
        assert (hoist.node_position_m[-1] == starboard.node_position_m[0]).all()
        assert (port.node_position_m[-1] == low_port.node_position_m[0]).all()
        assert (starboard.node_position_m[-1] == low_starboard.node_position_m[0]).all()
        assert not snapshot.not_converged
        bar = snapshot.struts[0].ends_m
        assert np.linalg.norm(bar[1] - bar[0]) == pytest.approx(8.0, abs=5e-3)
    assert snapshots[-1].line_out_m > 1015.0
    assert snapshots[-1].solver.splits > 0
    assert np.ptp([snapshot.tension_top_n for snapshot in snapshots]) > 5e3


def test_each_winch_is_commanded_by_its_name(two_lines: Scene) -> None:
    """Paying out one of two winches moves the load to the other line."""
    twin = Twin(two_lines)
    before = twin.snapshot()
    refusal = twin.submit_speed(None, 0.1, "aft_sheaf")
    assert "there is no winch 'aft_sheaf'; did you mean 'aft_sheave'?" in refusal
    assert twin.snapshot().inputs["winch_command"].refusal == refusal, "nobody else tells of it"
    stop = WinchCommand("emergency_stop")
    refusal = twin.submit_command(None, stop, "hook")
    reported = twin.snapshot().inputs["winch_switch"]
    assert (reported.impossible, reported.refusal) == (1, refusal)
    assert twin.submit_speed(None, 0.1, "aft_sheave") == ""
    for _ in range(20):
        twin.advance(100)
    after = twin.snapshot()
    assert after.line_out_m == before.line_out_m
    assert after.ropes[1].line_out_m == pytest.approx(602.0, abs=0.1)
    assert after.ropes[1].payout_speed_m_per_s == pytest.approx(0.1)
    assert top_tension(after, "fore") > top_tension(before, "fore") + 20e3
    assert top_tension(after, "aft") < top_tension(before, "aft") - 20e3
    assert after.inputs["winch_command aft_sheave"].accepted == 1


def test_a_multi_line_twin_resumes_bit_identically(two_lines: Scene, tmp_path: Path) -> None:
    """With splits at both winches on the way."""
    twin = Twin(two_lines)
    for winch in ("winch", "aft_sheave"):
        assert twin.submit_speed(None, 0.5, winch) == ""
    heaved(twin, 300)
    twin.save(tmp_path / "saved")
    branch, restored = twin.branch(), Twin.restore(tmp_path / "saved", two_lines)
    expected = heaved(twin, 900)
    for other in (branch, restored):
        snapshots = heaved(other, 900)
        assert digest(snapshots) == digest(expected)
        for snapshot, wanted in zip(snapshots, expected, strict=True):
            for rope, same in zip(snapshot.ropes, wanted.ropes, strict=True):
                assert rope.node_position_m.tobytes() == same.node_position_m.tobytes()
                assert rope.element_tension_n.tobytes() == same.element_tension_n.tobytes()
                assert rope.tension_top_n == same.tension_top_n
    assert expected[-1].solver.splits >= 2


def test_a_cut_system_resumes_with_the_figures_of_each_part(
    two_lines: Scene, tmp_path: Path
) -> None:
    """The lower part has a tolerance of its own, from the tension at the cut."""
    twin = Twin(two_lines)
    assert twin.submit_cut(1_000_000_000, 0.6 * two_lines.ropes[0].length_m) == ""
    heaved(twin, 300)
    assert twin.cut is not None
    twin.save(tmp_path / "saved")
    restored = Twin.restore(tmp_path / "saved", two_lines)
    assert [rope.model for rope in restored.all_ropes] == [rope.model for rope in twin.all_ropes]
    assert digest(heaved(restored, 600)) == digest(heaved(twin, 600))


def test_building_one_rope_rejects_a_multi_line_scene(bridle: Scene) -> None:
    with pytest.raises(SceneError, match="ropes meet here; give a scene of one rope"):
        build(bridle)


def test_a_weak_sling_is_reported(bridle: Scene, caplog: pytest.LogCaptureFixture) -> None:
    """A flat bridle loads its legs far more than their share of the weight."""
    Twin(bridle)
    assert not caplog.messages
    leg = bridle.ropes[1]
    assert leg.rope is not None
    weak = replace(leg, rope=replace(leg.rope, breaking_load_n=200e3))
    Twin(replace(bridle, ropes=(bridle.ropes[0], weak, *bridle.ropes[2:])))
    (sentence,) = caplog.messages
    assert "ropes[1]: 'leg_port' carries 82 kN at rest" in sentence
    assert "a safety factor of 2.4" in sentence
