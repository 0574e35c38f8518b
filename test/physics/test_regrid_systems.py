"""Remeshing of ropes with a body or VIV models and of multi-line systems, and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import digest

from rope_twin import load_scene
from rope_twin.core import state as rows
from rope_twin.core.body.state import RigidBody
from rope_twin.core.body.step import pose_of
from rope_twin.core.joined.joints import loaded_ends
from rope_twin.core.loads.memory import variable_count
from rope_twin.core.state import Floats, Rope
from rope_twin.effects.coupled_vibration import ModalVibrationParams
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.recording.motion_source import FIRST_NS, open_sea, submit
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.scene.rigging import winches_by_name
from rope_twin.studies.driven_twin import with_effect
from rope_twin.twin.level import OverloadProtection, elements_at, levels_of, scene_level
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import schedule_samples

SECOND_NS = 1_000_000_000
SHAKEN = {  # multi-line scenes that get a VIV model
    "bridle_lift shaken by modes": ModalVibrationParams(),
    "two_line_loop with strumming": StrouhalForcingParams(),  # as two_line_ascent
}
SCENES = ["manifold_lift", "viv_calm", "vortices_modal", "bridle_lift", "two_line_loop", *SHAKEN]
WITH_VARIABLES = ["viv_calm", "vortices_modal", *SHAKEN]  # of their effects, at the nodes


@pytest.fixture(scope="module", params=SCENES)
def moving(request: pytest.FixtureRequest) -> Twin:
    """A shipped scene four seconds into its own sea and schedule, with inputs for four more."""
    scene = load_scene(request.param.split()[0])
    if request.param in SHAKEN:
        scene = with_effect(scene, SHAKEN[request.param])
    twin = Twin(scene)
    sea = open_sea(twin.scene)
    for second in range(4):
        until_ns = (second + 1) * SECOND_NS if second < 3 else 8 * SECOND_NS
        from_ns = FIRST_NS if second == 0 else twin.time_ns
        for sample in sea.between(from_ns, until_ns) if sea else ():
            submit(twin, sample)
        for name, winch in winches_by_name(twin.scene).items():
            for command in schedule_samples(winch, max(from_ns, 0), until_ns):
                twin.submit_command(command.stamp_ns, command.command, name)
        twin.advance(round(1.0 / twin.step_s))
    return twin


def halved(twin: Twin, halvings: int = 1, times: int = 1) -> AccuracyLevel:
    """A level with fewer elements and a longer step than the scene's."""
    return AccuracyLevel(times * scene_level(twin.scene).step_ns, halvings)


def ropes_of(twin: Twin) -> tuple[Rope, ...]:
    return (twin.rope,) if twin.joined is None else twin.joined.system(twin.rope).ropes


def elements(twin: Twin) -> list[int]:
    return [int(rope.state.counts[rows.ELEMENTS]) for rope in ropes_of(twin)]


def tops_n(twin: Twin) -> Floats:
    """Tension at the upper end of each rope."""
    if twin.joined is None:
        return twin.inspect().pull[None, rows.PULL].copy()
    return twin.joined.pull[:, rows.PULL].copy()


def motion_kept(twin: Twin) -> list[Floats]:
    """Motion of lower ends, connections, hang-off and body, which remeshing must not change."""
    kept = [rope.state.nodes[: rows.VELOCITY, 0].copy() for rope in ropes_of(twin)]
    kept += [table[0].copy() for table in twin.inspect().boundary]
    kept.append(tops_n(twin))
    if twin.joined is not None:
        kept.append(twin.joined.system(twin.rope).joints.nodes.copy())
    for effect in twin.rope.effects:
        if isinstance(effect, RigidBody):
            pose = pose_of(effect)
            kept += [pose.place(effect.corners), pose.speed(effect.middle), pose.quaternion]
    return kept


def test_motion_and_tension_are_continuous_through_remeshing(moving: Twin) -> None:
    """The bounds of a single rope: 0.1 % at the first step, down and up, at every upper end."""
    same, down, up = (moving.branch() for _ in range(3))
    down.set_level(halved(moving))
    up.set_level(halved(moving, 2))
    up.set_level(scene_level(moving.scene))
    for other in (down, up):
        pairs = zip(motion_kept(other), motion_kept(same), strict=True)
        assert all(np.array_equal(*pair) for pair in pairs)
    counts = [[int(rope.state.counts[rows.ELEMENTS]) for rope in ropes_of(run)]
              for run in (same, down, up)]  # fmt: skip
    assert counts[2] == counts[0]
    assert all(
        less in (count // 2, (count + 1) // 2) for count, less in zip(*counts[:2], strict=True)
    )
    for run in (same, down, up):
        run.advance(1)
    scale = tops_n(same)
    for other in (down, up):
        assert (np.abs(tops_n(other) - scale) < 1e-3 * scale).all()


def test_coarser_step_and_mesh_stay_close(moving: Twin) -> None:
    """Twice the step and half the elements for a second, and back for another."""
    same, other = moving.branch(), moving.branch()
    for level in (halved(moving, times=2), scene_level(moving.scene)):
        other.set_level(level)
        for run in (same, other):
            run.advance(SECOND_NS // run.step_ns)
        assert other.time_ns == same.time_ns
        assert other.top_tension_n == pytest.approx(same.top_tension_n, rel=2e-3)
    snapshots = [run.snapshot() for run in (same, other)]
    assert snapshots[1].solver.unconverged_substeps == snapshots[0].solver.unconverged_substeps
    if snapshots[0].body is not None and snapshots[1].body is not None:
        quaternions = [
            snapshot.body.quaternion for snapshot in snapshots if snapshot.body is not None
        ]
        assert np.allclose(*quaternions, rtol=0.0, atol=1e-3)


def test_a_saved_state_of_any_level_resumes_bit_identically(moving: Twin, tmp_path: Path) -> None:
    """Two levels down, one up, and on the scene's own again after both."""
    twin = moving.branch()
    for number, halvings in enumerate((2, 1, 0)):
        twin.set_level(halved(twin, halvings, 2))
        twin.advance(20)
        path = tmp_path / f"{number}.state"
        twin.save(path)
        twin.snapshot()
        again = Twin.restore(path, twin.scene)
        again.snapshot()
        assert again.level == twin.level
        for run in (twin, again):
            run.advance(20)
        assert digest([again.snapshot()]) == digest([twin.snapshot()])


def memory_of(rope: Rope) -> Floats:
    """The internal variables of the one effect that has them."""
    (found,) = [effect.memory for effect in rope.effects if variable_count(type(effect))]
    return np.asarray(found)


def wakes(twin: Twin) -> list[tuple[Any, int]]:
    """Memories of the effects at the nodes, with the number of their variables."""
    return [
        (effect.memory, variable_count(type(effect)))
        for effect in twin.rope.effects
        if variable_count(type(effect)) and not isinstance(effect, RigidBody)
    ]


@pytest.mark.parametrize("moving", list(SHAKEN), indirect=True)
def test_internal_variables_survive_remeshing(moving: Twin) -> None:
    """At nodes that stay, and where it ends at a connection, which carries loads too."""
    twin = moving.branch()
    before = [(rope, memory_of(rope)) for rope in ropes_of(moving)]
    twin.set_level(halved(moving))
    assert twin.joined is not None
    loaded = loaded_ends(twin.joined.system(twin.rope))
    assert sum(loaded) >= 2
    for (old, fine), rope, end in zip(before, ropes_of(twin), loaded, strict=True):
        k = next(filter(None, (variable_count(type(effect)) for effect in rope.effects)))
        n, coarse = int(rope.state.counts[rows.ELEMENTS]), memory_of(rope)
        assert coarse[3 * k, -1] == n + end
        m = int(fine[3 * k, -1])
        assert m == int(old.state.counts[rows.ELEMENTS]) + end
        at = np.abs(old.state.s[:m, None] - rope.state.s[: n + end]).argmin(axis=0)
        assert rope.state.s[: n + end] == pytest.approx(old.state.s[at], abs=1e-9)
        assert coarse[:k, : n + end] == pytest.approx(fine[:k, at], abs=1e-2)
    assert max(np.abs(fine[:1]).max() for _, fine in before) > 0.0


@pytest.mark.parametrize("moving", WITH_VARIABLES, indirect=True)
def test_internal_variables_move_with_the_material(moving: Twin) -> None:
    """At nodes that stay they are kept; between, they lie between those of the neighbours."""
    assert wakes(moving)
    twin = moving.branch()
    s = twin.rope.state.s[: len(twin.inspect().tension)].copy()
    twin.set_level(halved(moving))
    left = twin.rope.state.s[: len(twin.inspect().tension)].copy()
    at = np.searchsorted(s, left)
    assert np.array_equal(s[at], left)
    for (fine, k), (coarse, _) in zip(wakes(moving), wakes(twin), strict=True):
        assert np.abs(fine[:k, : len(s)]).max() > 0.0
        assert np.array_equal(coarse[:k, : len(left)], fine[:k, at])
    twin.set_level(scene_level(moving.scene))
    for (fine, k), (again, _) in zip(wakes(moving), wakes(twin), strict=True):
        assert np.array_equal(again[:k, at], fine[:k, at])
        for row, was in zip(again[:k], fine[:k], strict=True):
            assert row[: len(s)].max() <= was[: len(s)].max()
            assert row[: len(s)].min() >= was[: len(s)].min()


def test_levels_of_a_system_halve_every_rope_that_can_be() -> None:
    """bridle_lift: 100 elements, 8 and 6 in the legs, which keep three."""
    scene = load_scene("bridle_lift")
    assert [elements_at(scene, halvings) for halvings in range(3)] == [
        (100, 8, 8, 6, 6), (50, 4, 4, 3, 3), (25, 2, 2, 3, 3),
    ]  # fmt: skip
    assert max(level.halvings for level in levels_of(scene)) == 2
    twin = Twin(scene)
    protection = OverloadProtection(twin)
    assert protection.start_at(100.0)
    assert twin.level == levels_of(scene)[-1]
    assert "35 elements in place of 128 and steps of 50 ms" in protection.words()
