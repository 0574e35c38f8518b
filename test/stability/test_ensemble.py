"""Members of an ensemble are bit-identical to single twins, whatever the other members do."""

from __future__ import annotations

import math
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lone_twins import SECOND_NS, alone, differing, sea, variations
from small_scene import SMALL_SCENE, small_scene

import rope_twin.twin.ensemble.member as member_module
from rope_twin import Twin, load_scene
from rope_twin.core.jit.wide import LANES
from rope_twin.core.step import advance
from rope_twin.errors import InputError, SceneError
from rope_twin.scene.load import Change
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.ensemble import Ensemble, Variation
from rope_twin.twin.ensemble.member import Scratch
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.winch.commands import CommandSample, WinchCommand


@settings(max_examples=8, deadline=None)
@given(members=st.lists(variations(), min_size=2, max_size=4), cut=st.integers(1, 9))
def test_each_member_equals_a_single_twin(
    tmp_path_factory: pytest.TempPathFactory, members: list[Variation], cut: int
) -> None:
    """In any division of the ten seconds, and with members of other sizes on the same threads."""
    scene = small_scene(tmp_path_factory.mktemp("scene"))
    ensemble = Ensemble(scene, members, slack_interval_s=0.07, threads=2)
    ensemble.advance(cut)
    ensemble.advance(10 - cut)
    for number, variation in enumerate(members):
        found, expected = ensemble.snapshot(number), alone(scene, variation, 10)
        assert not differing(found, expected)


def lively(scene: Scene) -> list[Variation]:
    """Return members that pay out and haul with splits and merges, go slack, and rest."""
    commands = tuple(
        CommandSample(k * SECOND_NS, WinchCommand(SPEED, v)) for k, v in ((0, 1.5), (9, -1.5))
    )
    slack = (Change("payloads[0].mass_kg", 1700.0),)
    return [
        Variation(heave=HeaveSeries.of(sea(1.0, 8.0, 30.0)), commands=commands),
        Variation(slack, HeaveSeries.of(sea(4.0, 5.0, 30.0))),
        Variation(),
    ]


def test_members_with_splits_merges_slack_and_rest_equal_single_twins(tmp_path: Path) -> None:
    scene = small_scene(tmp_path)
    members = lively(scene)
    ensemble = Ensemble(scene, members)
    ensemble.advance(28)
    paying, slack, resting = (ensemble.snapshot(k) for k in range(3))
    assert paying.solver.splits > 0
    assert paying.solver.merges > 0
    shares = [figures.slack_share for figures in ensemble.figures()]
    assert shares[1] > 0.1
    assert shares[0] == shares[2] == 0.0
    for number, actual in enumerate((paying, slack, resting)):
        assert not differing(actual, alone(scene, members[number], 28))
    reported = ensemble.figures()[2]
    assert reported.steps == 2800
    assert reported.tension_top_max_n == pytest.approx(reported.tension_top_min_n, rel=1e-9)


BODY = """rigid_body:
      size_m: [2.0, 1.5, 1.0]
      hook_mass_kg: 200.0
      slings:
        - {to_m: [0.8, 0.0, 0.5], length_m: 3.0, stiffness_n_per_m: 2.0e+6}
        - {to_m: [-0.8, 0.5, 0.5], length_m: 3.0, stiffness_n_per_m: 2.0e+6}
        - {to_m: [-0.8, -0.5, 0.5], length_m: 3.0, stiffness_n_per_m: 2.0e+6}
"""


@pytest.mark.parametrize(
    "instead",
    [
        BODY,
        "payload: {}\n  - wake_oscillator: {}",
        "payload: {}\n  - strouhal_forcing: {}",
        "payload: {}\n  - modal_vibration: {modes_every_s: 0.5}",
    ],
    ids=["rigid_body", "wake_oscillator", "strouhal_forcing", "modal_vibration"],
)
def test_members_have_separate_bodies_and_wakes(tmp_path: Path, instead: str) -> None:
    """Equal members differ after their own seas, as single twins do."""
    path = tmp_path / "states.yaml"
    path.write_text(SMALL_SCENE.replace("payload: {}", instead), encoding="utf-8")
    scene = load_scene(path)
    commands = (CommandSample(0, WinchCommand(SPEED, 1.5)),)
    members = [
        Variation(heave=HeaveSeries.of(sea(1.0, 8.0, 20.0))),
        Variation(heave=HeaveSeries.of(sea(2.0, 6.0, 20.0)), commands=commands),
        Variation((Change("payloads[0].mass_kg", 9000.0),)),
        Variation(heave=HeaveSeries.of(sea(1.0, 8.0, 20.0))),
    ]
    ensemble = Ensemble(scene, members, slack_interval_s=0.07, threads=2)
    for seconds in (1, 3, 2):
        ensemble.advance(seconds)
    snapshots = [ensemble.snapshot(number) for number in range(4)]
    for actual, variation in zip(snapshots, members, strict=True):
        expected = alone(scene, variation, 6)
        assert not differing(actual, expected)
        assert (actual.body is None) == (expected.body is None)
        if expected.vibration is not None:
            assert actual.vibration is not None
            amplitudes = actual.vibration.cross_flow, expected.vibration.cross_flow
            assert amplitudes[0].tobytes() == amplitudes[1].tobytes()
    assert not differing(snapshots[3], snapshots[0])
    assert "tension_top_n" in differing(snapshots[1], snapshots[0])


def test_a_rope_too_slack_for_its_modes_is_marked(tmp_path: Path) -> None:
    """A loosely coupled model needs a taut rope to begin with; the other member goes on."""
    path = tmp_path / "slack.yaml"
    effects = SMALL_SCENE.replace("payload: {}", "payload: {}\n  - modal_vibration: {}")
    path.write_text(effects, encoding="utf-8")
    scene = load_scene(path)
    light = Variation((Change("payloads[0].mass_kg", 0.0), Change("ropes[0].length_m", 50.0)))
    ensemble = Ensemble(scene, [light, Variation()])
    ensemble.advance(0.5)
    assert [one.steps for one in ensemble.figures()] == [0, 50]


@pytest.mark.parametrize("name", ["bridle_lift", "two_line_lift"])
def test_multi_line_members_equal_single_twins(name: str) -> None:
    """Two in other seas, one of another mass; the first winch pays out."""
    scene = load_scene(name)
    commands = tuple(
        CommandSample(k * SECOND_NS, WinchCommand(SPEED, v)) for k, v in ((0, 0.3), (2, 0.0))
    )
    heavier = (Change("payloads[0].mass_kg", 1.1, multiply=True),)
    members = [
        Variation(heave=HeaveSeries.of(sea(0.5, 8.0, 20.0)), commands=commands),
        Variation(heavier, HeaveSeries.of(sea(0.8, 7.0, 20.0)), commands=commands),
        Variation(commands=commands),
    ]
    ensemble = Ensemble(scene, members, slack_interval_s=0.1, threads=2)
    assert ensemble.lanes().alone == {"": 3}
    for seconds in (1, 3):
        ensemble.advance(seconds)
    for number, variation in enumerate(members):
        found, expected = ensemble.snapshot(number), alone(scene, variation, 4)
        assert not differing(found, expected)
        for rope, other in zip(found.ropes, expected.ropes, strict=True):
            assert rope.node_position_m.tobytes() == other.node_position_m.tobytes()
    figures = ensemble.figures()
    assert all(one.steps == ensemble.steps and not one.failure for one in figures)
    assert all(one.tension_top_max_n > one.tension_top_min_n for one in figures[:2])


def test_extremes_cover_every_step(tmp_path: Path) -> None:
    """Against a twin that is sampled after each step."""
    scene = small_scene(tmp_path)
    members = lively(scene)[0]
    ensemble = Ensemble(scene, [members])
    ensemble.advance(5)
    twin = Twin(scene)
    for stamp, z, v in sea(1.0, 8.0, 30.0):
        twin.submit_heave(stamp, z, v)
    twin.submit_speed(0, 1.5)
    tops = []
    for _ in range(500):
        twin.advance(1)
        tops.append(twin.snapshot().tension_top_n)
    (found,) = ensemble.figures()
    assert (found.tension_top_max_n, found.tension_top_min_n) == (max(tops), min(tops))
    assert found.tension_top_mean_n == pytest.approx(np.mean(tops), rel=1e-12)


def test_shared_scratch_holds_no_member_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Scratch full of NaN makes no difference."""
    scene = small_scene(tmp_path)
    members = lively(scene)
    monkeypatch.setattr(Scratch, "work", lambda self, shape: np.full(shape, np.nan))
    ensemble = Ensemble(scene, members, threads=1)
    for _ in range(6):
        ensemble.advance(1)
    for number, variation in enumerate(members):
        assert not differing(ensemble.snapshot(number), alone(scene, variation, 6))


def test_a_failing_member_does_not_stop_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It keeps its last good state and the time; the others stay bit-identical."""
    scene = small_scene(tmp_path)
    members = lively(scene)
    ensemble = Ensemble(scene, members)
    doomed = ensemble._members[1].rope.state.nodes

    def breaking(rope: Any, boundary: Any, pull: Any, time: float, steps: int) -> int:
        first = round(time / 0.01)
        good = max(0, min(steps, 137 - first)) if rope.state.nodes is doomed else steps
        return int(advance(rope, boundary, pull, time, good))

    monkeypatch.setattr(member_module, "advance", breaking)
    ensemble.advance(3)
    reported = [figures.failure for figures in ensemble.figures()]
    assert reported[0] == reported[2] == ""
    assert reported[1].startswith("step 138 at 1.37 s: the rope's next state is not finite")
    assert ensemble.snapshot(1).step == 137
    for number in (0, 2):
        assert not differing(ensemble.snapshot(number), alone(scene, members[number], 3))


def test_an_interrupted_ensemble_is_not_stepped_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while members take turns: no further turn begins, and no later call goes on."""
    ensemble = Ensemble(small_scene(tmp_path), [Variation()] * 50, threads=2, max_lanes=1)
    turns = []

    def interrupted(*_: Any) -> int:
        turns.append(0)
        sleep(0.5)  # so that the others still wait when the first one is over
        raise KeyboardInterrupt

    monkeypatch.setattr(member_module, "advance", interrupted)
    with pytest.raises(KeyboardInterrupt):
        ensemble.advance(1.0)
    assert len(turns) < 50
    monkeypatch.undo()
    with pytest.raises(InputError, match=r"ensemble: it was interrupted .*; build it again"):
        ensemble.advance(1.0)


def test_a_member_without_equilibrium_is_marked(tmp_path: Path) -> None:
    """A payload that floats."""
    scene = small_scene(tmp_path)
    light = Variation((Change("payloads[0].mass_kg", 0.0), Change("ropes[0].length_m", 50.0)))
    ensemble = Ensemble(scene, [light, Variation()])
    ensemble.advance(0.5)
    figures = ensemble.figures()
    assert "ropes[0]: " in figures[0].failure
    assert [one.steps for one in figures] == [0, 50]
    with pytest.raises(InputError, match="member 0: it never started"):
        ensemble.snapshot(0)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("time.step_s", 0.02, "member 1: time.step_s: all members have it in common; vary"),
        ("sea_state.start_s", 3.0, "member 1: sea_state.start_s: a sea moves no ship .*; give the"),
        ("payloads[0].mass_kg", -1.0, "member 1: .*payloads.0..mass_kg: -1 kg is out of range"),
    ],
)
def test_invalid_members_are_rejected(tmp_path: Path, path: str, value: float, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        Ensemble(small_scene(tmp_path), [Variation(), Variation((Change(path, value),))])


def test_invalid_times_are_rejected(tmp_path: Path) -> None:
    scene = small_scene(tmp_path)
    with pytest.raises(
        InputError, match=r"slack_interval_s: 0\.0 s is not possible; give a whole number"
    ):
        Ensemble(scene, [Variation()], slack_interval_s=0.0)
    with pytest.raises(InputError, match="ensemble: 0 members; give a whole number, 1 or more"):
        Ensemble(scene, [], threads=2)
    for counts, problem in (
        ({"threads": 1.5}, "1.5 threads; give a whole number, 1 or more"),
        ({"threads": 0}, "0 threads"),
        ({"max_lanes": 2.0}, f"2.0 ropes in one step; give a whole number, 1 to {LANES}"),
    ):
        with pytest.raises(InputError, match=f"ensemble: {problem}"):
            Ensemble(scene, [Variation()], **counts)
    ensemble = Ensemble(scene, [Variation(heave=HeaveSeries.of(sea(1.0, 8.0, 2.0)))])
    for seconds in (0.0, -1.0, math.nan, 0.015):
        with pytest.raises(InputError, match="is not possible; give a whole number of steps"):
            ensemble.advance(seconds)
    with pytest.raises(InputError, match="inf s is too long; give at most"):
        ensemble.advance(math.inf)
    with pytest.raises(InputError, match=r"heave: samples from -0\.1 s to 2\.25 s, wanted"):
        ensemble.advance(3.0)
    assert ensemble.steps == 0
    with pytest.raises(InputError, match="no winch runs faster"):
        Ensemble(scene, [Variation(commands=(CommandSample(0, WinchCommand(SPEED, 50.0)),))])
    with pytest.raises(InputError, match="ms after it was due"):
        Ensemble(scene, [Variation(commands=(CommandSample(-(10**9), WinchCommand(SPEED, 0.5)),))])
