"""Figures that a run takes over: ramp, equality with a scene of these figures, state, replay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import small_scene

from rope_twin import Twin
from rope_twin.core.state import Table
from rope_twin.effects.depth_profiles import DepthProfilesParams
from rope_twin.effects.payload_oscillation import PayloadOscillationParams
from rope_twin.errors import InputError
from rope_twin.scene.load import Change, change_scene, load_scene
from rope_twin.twin.ensemble.fleet import Fleet
from rope_twin.twin.ensemble.live_state import live_state
from rope_twin.twin.figures import FIGURES, FigureBase, LearnedFigures
from rope_twin.twin.input_queue import InputQueue, LogEntry, apply, calls_of, plain_calls
from rope_twin.twin.snapshot_builder import body_of


@pytest.fixture
def twin(tmp_path: Path) -> Twin:
    """Return a twin of the small scene."""
    return Twin(small_scene(tmp_path))


def test_the_rope_comes_to_the_equilibrium_of_its_new_weight(twin: Twin) -> None:
    """5 % more weight ends at 5 % of it more tension; after a jump it would reach twice as much."""
    before = twin.top_tension_n
    weight_n = 9.80665 * (8000.0 - 1.5 * 1025.0)
    assert twin.submit_figures(ramp_s=4.0, submerged_weight=1.05) == ""
    seen = []
    for _ in range(60):
        twin.advance(20)
        seen.append(twin.top_tension_n - before)
    assert seen[-1] == pytest.approx(0.05 * weight_n, rel=0.01)
    assert max(seen) < 1.1 * 0.05 * weight_n
    assert seen[9] == pytest.approx(0.5 * 0.05 * weight_n, rel=0.1)  # half of the ramp
    note = twin.snapshot().inputs["figures"].note
    assert "submerged_weight 1.05" in note


def test_figures_are_those_of_a_scene_with_them(tmp_path: Path, twin: Twin) -> None:
    """A twin that took over 1.3 times the drag moves as one whose scene has it, to the bit."""
    scene = small_scene(tmp_path)
    area = "payloads[0].drag_area_m2"
    base = twin.rope.effects
    other = change_scene(scene, [Change("payloads[0].shape.box.height_m", 1.0)])
    assert twin.submit_figures(ramp_s=0.0, payload_drag=1.3, axial_stiffness=0.9) == ""
    twin.advance(1)
    changed = {type(e).__name__: e for e in twin.rope.effects}
    before = {type(e).__name__: e for e in base}
    assert changed["Payload"].kz == 1.3 * before["Payload"].kz
    assert changed["Payload"].W == before["Payload"].W
    assert changed["Drag"] == before["Drag"]
    fresh = Twin(other)
    assert np.array_equal(twin.rope.sections[1], 0.9 * fresh.rope.sections[1]), area


@pytest.mark.parametrize(
    "params",
    [
        PayloadOscillationParams(size_m=(2.0, 2.0, 2.0), drag=((0.0, 2.0),)),
        DepthProfilesParams(density_kg_per_m3=((0.0, 1025.0), (-300.0, 1060.0))),
    ],
)
def test_payload_drag_is_also_that_of_effects_which_add_to_it(tmp_path: Path, params: Any) -> None:
    """With twice the payload's own drag by `payload_oscillation`, 1.5 times it were 1.25 times."""
    plain = small_scene(tmp_path)
    twin = Twin(replace(plain, effects=(*plain.effects, params)))
    before = {type(effect): effect for effect in twin.rope.effects}
    assert twin.submit_figures(ramp_s=0.0, payload_drag=1.5) == ""
    twin.advance(1)
    (added,) = (effect for effect in twin.rope.effects if hasattr(effect, "Ax"))
    for name in ("kx", "ky", "kz"):
        own = getattr(before[type(added)], name)
        assert own > 0.0
        assert getattr(added, name) == 1.5 * own


def test_a_saved_state_goes_on_within_the_ramp(tmp_path: Path, twin: Twin) -> None:
    """A run that resumes half-way up the ramp is bit-identical to one that was not interrupted."""
    twin.submit_figures(ramp_s=2.0, submerged_weight=1.1, payload_drag=0.8, axial_damping=1.5)
    twin.advance(77)
    state = twin.capture()
    again = Twin.restore(state, twin.scene)
    for one in (twin, again):
        one.advance(300)
    assert np.array_equal(twin.rope.state.nodes, again.rope.state.nodes)
    assert again.rope.effects[-1] == twin.rope.effects[-1]
    parts = Twin.restore(state, twin.scene)
    for steps in (3, 40, 1, 256):
        parts.advance(steps)
    assert np.array_equal(twin.rope.state.nodes, parts.rope.state.nodes)
    branch = twin.branch()
    for one in (twin, branch):
        one.submit_figures(ramp_s=1.0, submerged_weight=0.9)
        one.advance(50)
    assert np.array_equal(twin.rope.state.nodes, branch.rope.state.nodes)


def test_taking_over_is_logged_and_repeated(tmp_path: Path) -> None:
    """The log of a queue, written as JSON and read, gives the same run to the bit."""
    scene = small_scene(tmp_path)
    log: list[LogEntry] = []
    twin = Twin(scene)
    queue = InputQueue(twin, twin, log.append)
    queue.advance(10)
    assert queue.submit_figures(ramp_s=1.0, submerged_weight=1.02) == ""
    queue.advance(200)
    (entry,) = log
    again = Twin(scene)
    again.advance(10)
    apply(again, calls_of(plain_calls(entry.calls)))
    again.advance(200)
    assert np.array_equal(twin.rope.state.nodes, again.rope.state.nodes)


def test_a_current_profile_and_a_coarser_mesh_keep_the_figures(twin: Twin) -> None:
    """Both change the effects in use; the factors stay, and the profile too."""
    twin.submit_figures(ramp_s=0.0, payload_drag=1.2)
    twin.advance(2)
    drag = next(e.kz for e in twin.rope.effects if hasattr(e, "kz"))
    assert twin.submit_current([[0.0, 0.2, 0.0], [-300.0, 0.0, 0.0]]) == ""
    twin.advance(2)
    assert next(e.kz for e in twin.rope.effects if hasattr(e, "kz")) == drag
    flow = next(e for e in twin.rope.effects if hasattr(e, "U"))
    assert flow.U.max() == 0.2


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"weight": 1.1}, "no figure 'weight'"),
        ({"current": 1.1}, "no figure 'current'"),
        ({"submerged_weight": 9.0}, "0.2 to 5 times"),
        ({"submerged_weight": float("nan")}, "times the scene's"),
        ({"submerged_weight": 1.1, "ramp_s": -1.0}, "a ramp of -1 s"),
        ({}, "no figure is given"),
    ],
)
def test_impossible_figures_are_refused(twin: Twin, given: dict[str, float], words: str) -> None:
    """One sentence; nothing changes."""
    with pytest.raises(InputError, match=words):
        twin.submit_figures(**given)
    assert not twin.inputs.figures.active
    assert twin.snapshot().inputs["figures"].accepted == 0


def test_a_second_ramp_begins_where_the_first_is(twin: Twin) -> None:
    """Factors are continuous when a new target comes within a ramp."""
    figures = LearnedFigures()
    rope = twin.rope
    assert not figures.submit(rope, {"submerged_weight": 1.2}, 10.0, 0, False)
    assert figures.at(5_000_000_000)["submerged_weight"] == pytest.approx(1.1)
    assert not figures.submit(rope, {"payload_drag": 2.0}, 10.0, 5_000_000_000, False)
    then = figures.at(5_000_000_000)
    assert then["submerged_weight"] == pytest.approx(1.1)
    assert then["payload_drag"] == pytest.approx(1.0)
    assert figures.at(60_000_000_000)["payload_drag"] == 2.0
    assert "cut" in figures.submit(rope, {"payload_drag": 1.0}, 1.0, 0, True)


def test_figures_change_at_stairs_only() -> None:
    """A ramp of 0.25 s ends at the stair of 0.3 s, however the steps are divided."""
    figures = LearnedFigures()
    figures._target = 2.0 * figures._before
    figures.active, figures.ramp_ns = True, 250_000_000
    seen = [figures.at(k * 10_000_000)["submerged_weight"] for k in range(40)]
    changes = [k for k in range(1, 40) if seen[k] != seen[k - 1]]
    assert changes == [10, 20, 30]
    assert seen[30] == 2.0


def test_a_stiffness_table_is_scaled_and_a_live_state_has_its_own(twin: Twin) -> None:
    """All tensions of the table times the factor, from the scene's each time; copies stay."""
    rope = twin.rope
    knots = np.array([[0.0, 0.01]])
    table = Table(knots, *(np.array([[1.0, 2.0]]) * k for k in (0.0, 1e7, 2e7, 3e7)))
    rope = rope._replace(law=table, sections=rope.sections.copy())
    first = [one.copy() for one in table]
    base = FigureBase(rope)
    for share in (1.2, 0.9):
        factors = dict.fromkeys(FIGURES, 1.0) | {"axial_stiffness": share}
        base.apply(factors, rope, rope.effects)
        assert np.array_equal(table.knot, first[0])
        for mine, own in zip(table[1:], first[1:], strict=True):
            np.testing.assert_allclose(mine, share * own)
    twin.advance(1)
    live = live_state(twin)
    assert not np.shares_memory(live.rope.sections, twin.rope.sections)


def test_a_rigid_body_takes_figures_over() -> None:
    """Weight is in the tension, mass along z; a saved state goes on with both."""
    scene = change_scene(load_scene("manifold_lift"), [Change("ropes[0].length_m", 60.0)])
    scaled, plain = Twin(scene), Twin(scene)
    before = body_of(plain.rope)
    assert before is not None
    assert scaled.submit_figures(ramp_s=1.0, submerged_weight=1.05, oscillating_mass=1.1) == ""
    scaled.advance(200)
    again = Twin.restore(scaled.capture(), scene)
    for twin in (scaled, again, plain):
        twin.advance(600 if twin is not plain else 800)
    assert scaled.top_tension_n == again.top_tension_n
    weight_n = (before.m - before.displaced) * before.g + before.hook_weight
    assert scaled.top_tension_n - plain.top_tension_n == pytest.approx(0.05 * weight_n, rel=0.05)
    body = body_of(scaled.rope)
    assert body is not None
    moved_kg = before.hook + before.m + before.added[2]
    assert body.added[2] == pytest.approx(before.added[2] + 0.1 * moved_kg)
    assert list(body.added[[0, 1, 3, 4, 5]]) == list(before.added[[0, 1, 3, 4, 5]])
    fleet = Fleet(scene, 1)
    fleet.begin_from(live_state(scaled))  # its figures are the scene's, and not scaled twice
    base = body_of(fleet._members.ropes[0])
    assert base is not None
    assert base.added[2] == before.added[2]
