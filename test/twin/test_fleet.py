"""A fleet's members against twins of their own: equal to the bit where mesh and step are equal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fleet_inputs import Driven, cut, driven
from small_scene import small_scene

from rope_twin.core import state as rows
from rope_twin.errors import InputError
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs

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
    """Tension of each step, folds of each look, state and solver counts, all to the bit."""
    start = fleet.state(0)
    record = fleet.advance(paying.inputs, LOOK)
    state = paying.twin.rope.state
    n = int(state.counts[rows.ELEMENTS])
    assert n == 21
    assert fleet.time_s == pytest.approx(paying.twin.time_ns * 1e-9, abs=1e-12)
    ends = slice(LOOK - 1, None, LOOK)
    for k in range(len(fleet)):
        assert np.array_equal(record.top_tension_n[:, k], paying.top_n)
        least = paying.least_n.reshape(-1, LOOK).min(axis=1)
        assert np.array_equal(record.least_tension_n[:, k], least)
        assert np.array_equal(record.payload_depth_m[:, k], paying.depth_m[ends])
        assert np.array_equal(record.payload_tension_n[:, k], paying.lowest_n[ends])
        assert np.array_equal(nodes(fleet, k), state.nodes[:, : n + 1])
        assert np.array_equal(fleet.state(k).rope.health, state.health)
    speed = -state.nodes[rows.VELOCITY + 2, 0]
    assert record.payload_speed_m_per_s[-1, 3] == speed
    assert not record.failures
    fleet.restore(start)
    assert fleet.time_s == 0.0


def test_members_equal_the_live_twin_that_they_begin_from(fleet: Fleet, paying: Driven) -> None:
    """On its own mesh, in the middle of paying out, by arrays of each member."""
    assert paying.live is not None
    fleet.begin_from(paying.live)
    own = [
        np.repeat(one[:, None], len(fleet), 1) for one in vars(cut(paying.inputs, LIVE)).values()
    ]
    record = fleet.advance(FleetInputs(*own), 7)
    for k in range(len(fleet)):
        assert np.array_equal(record.top_tension_n[:, k], paying.top_n[LIVE:])
    assert record.least_tension_n.shape == (50, len(fleet))


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
    ("wrong", "words"),
    [
        ({"heave_m": np.zeros(5)}, "heave_rate_m_per_s: shape"),
        ({"heave_rate_m_per_s": np.full(11, np.inf)}, "heave_rate_m_per_s: a value is not finite"),
        ({"line_out_m": np.full(11, 1.0)}, "line_out_m: 1 to 1 m"),
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


def test_a_scene_of_ropes_that_meet_is_refused() -> None:
    """With the way out."""
    with pytest.raises(InputError, match=r"the ropes of .* meet"):
        Fleet(Path("config/scenes") / "two_line_lift.yaml", 4)
