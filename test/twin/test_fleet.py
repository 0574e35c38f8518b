"""A fleet's members against twins of their own: equal to the bit where mesh and step are equal."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fleet_inputs import Driven, cut, driven, mapped
from small_scene import SMALL_SCENE, small_scene

import rope_twin.twin.ensemble.fleet_ropes as fleet_ropes
from rope_twin.core import state as rows
from rope_twin.core.body.step import pose_of
from rope_twin.core.lanes.group import why_alone
from rope_twin.errors import InputError, RopeTwinError
from rope_twin.planning.run import plan
from rope_twin.scene.load import Change, at_setting, change_scene, load_scene
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import FIGURES, Fleet, FleetInputs
from rope_twin.twin.snapshot_builder import body_of

STEPS, LIVE, LOOK = 700, 350, 10


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """The small scene: 20 elements at 10 ms."""
    return small_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def paying(scene: Scene) -> Driven:
    """A twin that pays out 10 m in waves: its top element splits."""
    return driven(scene, STEPS, speed=1.4, live_at=LIVE)


@pytest.fixture(scope="module")
def fleet(scene: Scene) -> Fleet:
    """Eleven members of the scene's own mesh and step."""
    return Fleet(scene, 11, elements=20, step_s=0.01)


def nodes(fleet: Fleet, member: int) -> np.ndarray:
    """Position, velocity and acceleration of a member's nodes."""
    state = fleet.state(member).rope
    return state.nodes[:, : state.counts[rows.ELEMENTS] + 1]


def test_members_equal_a_twin(fleet: Fleet, paying: Driven) -> None:
    """Tension of each step, samples of each interval, state and solver counts, all to the bit."""
    start = fleet.state(0)
    record = fleet.advance(paying.inputs, LOOK)
    state = paying.twin.rope.state
    n = int(state.counts[rows.ELEMENTS])
    assert n == 21
    assert fleet.time_s == pytest.approx(paying.twin.time_ns * 1e-9, abs=1e-12)
    ends = slice(LOOK - 1, None, LOOK)
    for k in range(len(fleet)):
        assert np.array_equal(record.top_tension_n[:, k], paying.top_n)
        least = paying.min_n.reshape(-1, LOOK).min(axis=1)
        assert np.array_equal(record.min_tension_n[:, k], least)
        assert np.array_equal(record.payload_depth_m[:, k], paying.depth_m[ends])
        assert np.array_equal(record.payload_tension_n[:, k], paying.payload_n[ends])
        assert np.array_equal(nodes(fleet, k), state.nodes[:, : n + 1])
        assert np.array_equal(fleet.state(k).rope.health, state.health)
    assert -state.nodes[rows.POSITION + 2, 0] == paying.depth_m[-1]
    speed = -state.nodes[rows.VELOCITY + 2, 0]
    assert record.payload_speed_m_per_s[-1, 3] == speed
    assert not record.failures
    fleet.restore(start)
    assert fleet.time_s == 0.0


def test_members_equal_the_live_twin_that_they_begin_from(fleet: Fleet, paying: Driven) -> None:
    """On its own mesh, in the middle of paying out, by arrays of each member."""
    assert paying.live is not None
    fleet.begin_from(paying.live)
    own = mapped(cut(paying.inputs, LIVE), lambda one: np.repeat(one[:, None], len(fleet), 1))
    record = fleet.advance(own, 7)
    for k in range(len(fleet)):
        assert np.array_equal(record.top_tension_n[:, k], paying.top_n[LIVE:])
    assert record.min_tension_n.shape == (50, len(fleet))


def test_a_coarse_fleet_follows_the_twin_that_it_begins_from(scene: Scene, paying: Driven) -> None:
    """Like one that ran along from the start, and continuous in tension."""
    fleet = Fleet(scene, 4, elements=10, step_s=0.02)
    along = fleet.advance(cut(paying.inputs, 0, 2)).top_tension_n[LIVE // 2 :, 0]
    assert paying.live is not None
    fleet.begin_from(paying.live)
    begun = fleet.advance(cut(paying.inputs, LIVE, 2)).top_tension_n[:, 0]
    spread = float(np.std(paying.top_n))
    twin = paying.top_n[LIVE + 1 :: 2]
    assert abs(begun - twin)[:5].max() < 0.001 * spread
    assert abs(begun - along)[-50:].max() < 0.01 * spread
    assert np.sqrt(np.mean((begun - twin) ** 2)) < 0.01 * spread


@pytest.mark.parametrize(
    ("factors", "words"),
    [
        ({"weight": 1.0}, "'weight' is none"),
        ({"current": np.nan}, "a factor of nan"),
        ({"payload_drag": 0.0}, "a factor of 0"),
        ({"axial_damping": [1.0, 2.0]}, "2 factors for 11 members"),
    ],
)
def test_wrong_figures_are_refused(fleet: Fleet, factors: dict, words: str) -> None:
    """In one sentence."""
    with pytest.raises(InputError, match=words):
        fleet.set_figures(factors)


@pytest.mark.parametrize(
    ("counts", "words"),
    [
        ({"members": 1.5}, "fleet: 1.5 members; give a whole number, 1 or more"),
        ({"members": math.nan}, "nan members"),
        ({"members": "3"}, "'3' members"),
        ({"members": 0}, "0 members"),
        ({"members": 2, "threads": 1.5}, "1.5 threads"),
        ({"members": 2, "elements": 20.5}, "elements: 20.5 is not a whole number"),
    ],
)
def test_counts_that_are_not_whole_are_refused(scene: Scene, counts: dict, words: str) -> None:
    with pytest.raises(RopeTwinError, match=words):
        Fleet(scene, **counts)


def test_a_member_that_is_not_there_has_no_state(fleet: Fleet) -> None:
    """Nor is -1 the last one; a plan has whole threads too."""
    for member in (11, -1, 0.5):
        with pytest.raises(InputError, match=r"as a member; give a whole number, 0 to 10\."):
            fleet.state(member)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"plan: 1\.5 threads; give a whole number"):
        plan("landing", threads=1.5)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"heave_m": np.zeros(5)}, "heave_rate_m_per_s: shape"),
        ({"heave_rate_m_per_s": np.full(11, np.inf)}, "heave_rate_m_per_s: a value is not finite"),
        ({"line_out_m": np.full(11, 1.0)}, "line_out_m: 1 to 1 m"),
        ({"line_out_m": np.full(11, 202.0)}, "begins at 202 m, member 0 has"),
        ({"line_speed_m_per_s": np.zeros((11, 3))}, "line_speed_m_per_s: shape"),
    ],
)
def test_wrong_inputs_are_refused(fleet: Fleet, wrong: dict, words: str) -> None:
    """Before a member has moved."""
    before = nodes(fleet, 0).copy()
    given = {
        "heave_m": np.zeros(11),
        "heave_rate_m_per_s": np.zeros(11),
        "line_out_m": np.full(11, 200.0),
        "line_speed_m_per_s": np.zeros(11),
    }
    with pytest.raises(InputError, match=words):
        fleet.advance(FleetInputs(**given | wrong))
    assert np.array_equal(nodes(fleet, 0), before)


FIGURES_SCENE = (
    SMALL_SCENE.replace("{fraction_of_first_axial_mode: 0.02}", "{newton_seconds: 400000.0}")
    .replace(
        "displaced_volume_m3: 1.5",
        "displaced_volume_m3: 2.0\n    added_mass_kg: [3000.0, 2000.0, 4000.0]\n"
        "    drag_area_m2: [2.0, 2.0, 4.0]",
    )
    .replace("{step_s: 0.01}", "{step_s: 0.01, newton_tolerance_n: 20.0}")
    + "environment: {water_density_kg_per_m3: 1000.0}\n"
)
# the same as a change of the scene; by powers of two, so that every product is exact
DOUBLED = {
    "submerged_weight": Change("payloads[0].displaced_volume_m3", 5.0),
    "oscillating_mass": Change("payloads[0].added_mass_kg[2]", 16000.0),
    "payload_drag": Change("payloads[0].drag_area_m2[*]", 2.0, multiply=True),
    "axial_stiffness": Change("ropes[0].rope.axial_stiffness_n", 2.0, multiply=True),
    "axial_damping": Change("ropes[0].damping.newton_seconds", 2.0, multiply=True),
    "tangential_drag": Change("effects.drag.tangential", 2.0, multiply=True),
    "current": Change("effects.current.profile[*][1][*]", 2.0, multiply=True),
}


@pytest.fixture(scope="module")
def figured(tmp_path_factory: pytest.TempPathFactory) -> Fleet:
    """A fleet of the scene with every number given."""
    path = tmp_path_factory.mktemp("scene") / "figures.yaml"
    path.write_text(FIGURES_SCENE)
    return Fleet(path, 5, elements=20, step_s=0.01)


@pytest.mark.parametrize("figure", FIGURES)
def test_a_figure_is_a_change_of_the_scene(figured: Fleet, figure: str) -> None:
    """Those of one member, against a twin of the changed scene, from the state of that twin."""
    factor = 0.5 if figure == "submerged_weight" else 2.0
    expected = driven(change_scene(figured.scene, [DOUBLED[figure]]), 160, (2.0, 5.0), live_at=60)
    figured.set_figures(dict.fromkeys(FIGURES, 1.0) | {figure: [1.0, factor, 1.0, factor, 1.0]})
    assert expected.live is not None
    own = expected.live.rope._replace(effects=build(figured.scene).effects)  # the scene's current
    figured.begin_from(replace(expected.live, rope=own))
    record = figured.advance(cut(expected.inputs, 60), 10)
    for k in (1, 3):
        assert np.array_equal(record.top_tension_n[:, k], expected.top_n[60:])
    assert not np.array_equal(record.top_tension_n[:, 0], expected.top_n[60:])


def test_all_figures_are_those_of_the_scene(figured: Fleet, tmp_path: Path) -> None:
    """Named, so that an estimator knows what there is to learn."""
    assert figured.figures == FIGURES
    path = tmp_path / "still.yaml"
    path.write_text(re.sub(r"  - current: .*\n", "", SMALL_SCENE))
    still = Fleet(path, 4, elements=20, step_s=0.01)
    assert still.figures == FIGURES[:-1]
    with pytest.raises(InputError, match="current: the scene has no such number"):
        still.set_figures({"current": 1.1})


def test_states_are_given_back_one_by_one(figured: Fleet) -> None:
    """Each member goes on from its own, and again with the same bits."""
    weights = {"submerged_weight": [1.0, 1.1, 0.9, 1.0, 1.2]}
    figured.set_figures(dict.fromkeys(FIGURES, 1.0) | weights)
    still = FleetInputs(np.zeros(41), np.zeros(41), np.full(41, 200.0), np.zeros(41))
    figured.restore(figured.state(0))
    figured.advance(still)
    states = [figured.state(k) for k in range(len(figured))]
    first = figured.advance(still).top_tension_n
    figured.restore(states)
    assert np.array_equal(figured.advance(still).top_tension_n, first)
    assert len({float(top) for top in first[-1]}) == 4  # 0 and 3 are equal
    with pytest.raises(InputError, match="3 states for 5 members"):
        figured.restore(states[:3])
    with pytest.raises(InputError, match="different times"):
        figured.restore([*states[:4], figured.state(4)])
    with pytest.raises(InputError, match="a state with space for"):
        figured.restore(replace(states[0], rope=states[0].rope._replace(nodes=np.zeros((9, 7)))))


def test_a_member_that_fails_leaves_the_others_alone(figured: Fleet) -> None:
    """Its values are NaN from then on, theirs are those of a fleet without it."""
    figured.set_figures(dict.fromkeys(FIGURES, 1.0))
    still = FleetInputs(np.zeros(61), np.zeros(61), np.full(61, 200.0), np.zeros(61))
    start = figured.state(0)
    figured.restore(start)
    whole = figured.advance(still, 20)
    broken = replace(start, rope=start.rope.copy())
    broken.rope.nodes[rows.VELOCITY, 5] = np.inf
    figured.restore([start, start, broken, start, start])
    record = figured.advance(still, 20)
    assert list(record.failures) == [2]
    assert "the rope's next state is not finite" in record.failures[2]
    assert np.isnan(record.top_tension_n[:, 2]).all()
    assert np.isnan(record.min_tension_n[:, 2]).all()
    others = [0, 1, 3, 4]
    assert np.array_equal(record.top_tension_n[:, others], whole.top_tension_n[:, others])
    figured.advance(still)
    figured.restore(start)
    assert not figured.advance(still).failures


def check_equal_to_twin(fleet: Fleet, expected: Driven, at: int, interval: int) -> None:
    """Assert that all values are the twin's to the bit, also after step `at` from it, and again."""
    runs = [(fleet.advance(expected.inputs, interval), 0)]
    assert expected.live is not None
    fleet.begin_from(expected.live)
    start = fleet.state(0)
    runs.append((fleet.advance(cut(expected.inputs, at), interval), at))
    fleet.restore(start)
    runs.append((fleet.advance(cut(expected.inputs, at), interval), at))
    for record, first in runs:
        assert not record.failures
        ends = slice(first + interval - 1, None, interval)
        for k in range(len(fleet)):
            assert np.array_equal(record.top_tension_n[:, k], expected.top_n[first:])
            least = expected.min_n[first:].reshape(-1, interval).min(axis=1)
            assert np.array_equal(record.min_tension_n[:, k], least)
            assert np.array_equal(record.payload_depth_m[:, k], expected.depth_m[ends])
            assert np.array_equal(
                record.payload_speed_m_per_s[:, k], expected.sinking_m_per_s[ends]
            )
            assert np.array_equal(record.payload_tension_n[:, k], expected.payload_n[ends])


VORTICES = """\
  - wake_oscillator: {}
  - payload_shedding: {strouhal: 0.2, lift_coefficient: 0.3, diameter_m: 2.0, area_m2: 3.0}
  - net: {width_m: 1.0, height_m: 1.0, solidity: 0.2}
  - fairing: {face_m2: 1.0}
  - fluid_ramp:
      water: {ramp_s: 2.0}
      vortices: {over_time: [[0.1, 0.4], [0.5, 1.0]]}
      fairings: {ramp_s: 0.3}
"""


@pytest.mark.parametrize(
    ("effects", "lanes"),
    [
        pytest.param("  - wake_oscillator: {}\n", True, marks=pytest.mark.long),
        ("  - wake_oscillator: {}\n", False),
        pytest.param(VORTICES, True, marks=pytest.mark.long),
        pytest.param(VORTICES, False, marks=pytest.mark.long),
    ],
)
def test_members_with_internal_variables(
    tmp_path: Path, effects: str, lanes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In lanes, or by themselves: equal to the twin to the bit."""
    path = tmp_path / "vortices.yaml"
    text = SMALL_SCENE.replace("  - payload: {}\n", f"{effects}  - payload: {{}}\n")
    path.write_text(text.replace("elements: 20", "elements: 8"))
    scene = load_scene(path)
    assert not why_alone(build(scene))
    if not lanes:
        monkeypatch.setattr(fleet_ropes, "kind_of", lambda rope: None)
    expected = driven(scene, 60, live_at=20)
    check_equal_to_twin(Fleet(path, 2, elements=8, step_s=0.01), expected, 20, 5)


@pytest.mark.long
def test_members_with_a_body_are_stepped_in_lanes() -> None:
    """Depth and speed are those of its middle, not those of the hook above its slings."""
    hanging = Change("ropes[0].length_m", 16.0)
    scene = change_scene(at_setting(load_scene("lift_off"), 6, 0.0025), [hanging])
    assert not why_alone(build(scene))
    expected = driven(scene, 800, speed=0.3, live_at=400)
    rope = expected.twin.rope
    body, hook_m = body_of(rope), -rope.state.nodes[rows.POSITION + 2, 0]
    assert body is not None
    pose = pose_of(body)
    assert expected.depth_m[-1] - hook_m > 5.0
    assert expected.depth_m[-1] == pytest.approx(-pose.place(body.middle)[2], rel=1e-12)
    sinking = -pose.speed(body.middle)[2]
    assert expected.sinking_m_per_s[-1] == pytest.approx(sinking, rel=1e-9)
    assert abs(sinking + pose.velocity[2]) > 1e-6 * abs(sinking)
    check_equal_to_twin(Fleet(scene, 3, elements=6, step_s=0.0025), expected, 400, 5)


@pytest.mark.long
def test_members_with_a_body_have_figures_of_their_own() -> None:
    """Weight is in the mean tension; mass and drag change how it moves, each member by itself."""
    hanging = Change("ropes[0].length_m", 16.0)
    scene = change_scene(at_setting(load_scene("lift_off"), 6, 0.0025), [hanging])
    body = body_of(build(scene))
    assert body is not None
    kinds = "submerged_weight", "oscillating_mass", "payload_drag"
    factors = {name: np.where(np.arange(4) == k, 1.1, 1.0) for k, name in enumerate(kinds, 1)}
    times = 0.0025 * np.arange(801)
    wave = 0.2 * np.sin(np.pi * times) ** 2, 0.2 * np.pi * np.sin(2.0 * np.pi * times)
    inputs = FleetInputs(*wave, np.full(801, 16.0), np.zeros(801))
    fleet = Fleet(scene, 4, elements=6, step_s=0.0025)
    fleet.set_figures(factors)
    found = fleet.advance(inputs, interval_steps=100).top_tension_n
    for k in range(4):
        alone = Fleet(scene, 1, elements=6, step_s=0.0025)
        alone.set_figures({name: float(factors[name][k]) for name in kinds})
        own = alone.advance(inputs, interval_steps=100).top_tension_n[:, 0]
        assert np.array_equal(own, found[:, k])
    more = found.mean(axis=0) - found[:, 0].mean()
    assert more[1] == pytest.approx(0.1 * body.W, rel=0.02)
    moved = np.abs(found - found[:, :1]).max(axis=0)
    assert moved[2] > 0.01 * body.W  # it is heaved
    assert moved[3] > 0.0  # drag of the air


def test_orders_side_by_side(scene: Scene, paying: Driven) -> None:
    """Members that pay out, hold and haul in among each other, on two threads."""
    runs = [paying, driven(scene, STEPS), driven(scene, STEPS, speed=-1.4)]
    fleet = Fleet(scene, 10, elements=20, step_s=0.01, threads=2)
    order = [k % 3 for k in range(len(fleet))]
    names = ("heave_m", "heave_rate_m_per_s", "line_out_m", "line_speed_m_per_s")
    own = [np.array([getattr(runs[k].inputs, name) for k in order]).T for name in names]
    record = fleet.advance(FleetInputs(*own), LOOK)
    for member, k in enumerate(order):
        assert np.array_equal(record.top_tension_n[:, member], runs[k].top_n)
        least = runs[k].min_n.reshape(-1, LOOK).min(axis=1)
        assert np.array_equal(record.min_tension_n[:, member], least)
    counts = [int(fleet.state(k).rope.counts[rows.ELEMENTS]) for k in range(3)]
    assert counts == [21, 20, 19]


@pytest.mark.parametrize("elements", [7, 40])
def test_another_mesh_keeps_ends_and_tension(scene: Scene, paying: Driven, elements: int) -> None:
    """Coarser and finer, 5 m further out than the mesh was made for."""
    fleet = Fleet(scene, 1, elements=elements, step_s=0.01)
    live = paying.live
    assert live is not None
    fleet.begin_from(live)
    state, own = fleet.state(0).rope, live.rope.state
    n, m = int(state.counts[rows.ELEMENTS]), int(own.counts[rows.ELEMENTS])
    assert state.s[n] == live.line_out_m
    assert np.array_equal(state.nodes[:, 0], own.nodes[:, 0])
    assert np.array_equal(state.nodes[:, n], own.nodes[:, m])
    lengths = np.diff(state.s[: n + 1])
    assert 0.4 * 200.0 / elements < lengths.min()
    assert lengths.max() < 1.5 * 200.0 / elements + 1e-9
    record = fleet.advance(cut(paying.inputs, LIVE))
    away = record.top_tension_n[:, 0] - paying.top_n[LIVE:]
    spread = float(np.std(paying.top_n))
    assert abs(away[0]) < 0.001 * spread
    assert np.sqrt(np.mean(away**2)) < 0.02 * spread
