"""Multi-line members against twins of their own: equal to the bit on equal mesh and step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fleet_inputs import Driven, cut, driven, elements, mapped, ropes

from rope_twin.core import state as rows
from rope_twin.errors import InputError
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.load import Change, at_setting, change_scene, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import FIGURES, Fleet, FleetInputs, FleetRecord

STEPS, LIVE, LOOK = 300, 150, 10
STEP_S, ELEMENTS = 0.05, 20


def coarse(name: str, elements: int = ELEMENTS, step_s: float = STEP_S) -> Scene:
    """A scene of the repository on the mesh of a fleet."""
    return at_setting(load_scene(name), elements, step_s)


@pytest.fixture(scope="module")
def two_lines() -> Scene:
    """A module on two winches."""
    return coarse("two_line_lift")


@pytest.fixture(scope="module")
def uneven(two_lines: Scene) -> Driven:
    """Main winch down 7.5 m, the other up 4 m: elements are added to one rope."""
    return driven(two_lines, STEPS, speed=0.5, live_at=LIVE, others={"aft_sheave": -0.3})


@pytest.fixture(scope="module")
def lowered(two_lines: Scene) -> Driven:
    """Both winches pay out, the main one 1.5 m more."""
    return driven(two_lines, STEPS, speed=0.5, live_at=LIVE, others={"aft_sheave": 0.4})


def check_equal(fleet: Fleet, record: FleetRecord, expected: Driven, first: int = 0) -> None:
    """Assert that results and states of all members are the twin's to the bit."""
    assert not record.failures
    ends = slice(first + LOOK - 1, None, LOOK)
    assert list(record.suspended_tension_n) == list(expected.hung_n)
    own = ropes(expected.twin)
    for k in range(len(fleet)):
        assert np.array_equal(record.top_tension_n[:, k], expected.top_n[first:])
        for name, hung_n in expected.hung_n.items():
            assert np.array_equal(record.suspended_tension_n[name][:, k], hung_n[first:])
        least = expected.min_n[first:].reshape(-1, LOOK).min(axis=1)
        assert np.array_equal(record.min_tension_n[:, k], least)
        assert np.array_equal(record.payload_depth_m[:, k], expected.depth_m[ends])
        assert np.array_equal(record.payload_speed_m_per_s[:, k], expected.sinking_m_per_s[ends])
        assert np.array_equal(record.payload_tension_n[:, k], expected.payload_n[ends])
        state = fleet.state(k)
        for mine, rope in zip((state.rope, *state.others), own, strict=True):
            n = elements(rope)
            assert mine.counts[rows.ELEMENTS] == n
            assert np.array_equal(mine.nodes[:, : n + 1], rope.state.nodes[:, : n + 1])


def test_members_equal_a_twin(two_lines: Scene, uneven: Driven) -> None:
    """From rest, with a winch at either hang-off; solver counts too."""
    fleet = Fleet(two_lines, 9, elements=ELEMENTS, step_s=STEP_S)
    assert not fleet.why_alone
    start = fleet.state(0)
    record = fleet.advance(uneven.inputs, LOOK)
    check_equal(fleet, record, uneven)
    assert np.array_equal(fleet.state(3).rope.health, ropes(uneven.twin)[0].state.health)
    fleet.restore(start)
    assert fleet.time_s == 0.0
    again = fleet.advance(uneven.inputs, LOOK)
    assert np.array_equal(again.top_tension_n, record.top_tension_n)


def test_members_equal_the_live_twin_that_they_begin_from(two_lines: Scene, uneven: Driven) -> None:
    """On its own mesh, in the middle of paying out, with arrays of each member, on two threads."""
    fleet = Fleet(two_lines, 12, elements=ELEMENTS, step_s=STEP_S, threads=2)
    assert uneven.live is not None
    fleet.begin_from(uneven.live)
    inputs = mapped(cut(uneven.inputs, LIVE), lambda one: np.repeat(one[:, None], 12, 1))
    check_equal(fleet, fleet.advance(inputs, LOOK), uneven, LIVE)


def test_winches_that_are_not_named_hold(two_lines: Scene) -> None:
    """Their lines stay as they are, as in a twin without commands."""
    expected = driven(two_lines, 60, speed=0.5)
    fleet = Fleet(two_lines, 4, elements=ELEMENTS, step_s=STEP_S)
    check_equal(fleet, fleet.advance(expected.inputs, LOOK), expected)


@pytest.mark.parametrize(
    ("name", "alone"),
    [
        ("bridle_lift", ""),
        pytest.param("two_line_landing", "", marks=pytest.mark.long),
        pytest.param("two_line_loop", "", marks=pytest.mark.long),
        pytest.param("load_transfer", "", marks=pytest.mark.long),
        pytest.param("net_screen", "", marks=pytest.mark.long),
        pytest.param("cage_and_clump", "", marks=pytest.mark.long),
    ],
)
def test_systems_of_other_scenes(name: str, alone: str) -> None:
    """With struts, on a bed in waves, over a sheave, with a body or nets, with loads that touch."""
    scene = coarse(name, 8, 0.02)
    expected = driven(scene, 120, speed=0.3, live_at=40)
    fleet = Fleet(scene, 4 if not alone else 2, elements=8, step_s=0.02)
    assert fleet.why_alone == alone
    check_equal(fleet, fleet.advance(expected.inputs, LOOK), expected)
    assert expected.live is not None
    fleet.begin_from(expected.live)
    check_equal(fleet, fleet.advance(cut(expected.inputs, 40), LOOK), expected, 40)


@pytest.mark.long
def test_members_with_internal_variables(tmp_path: Path) -> None:
    """Wake oscillators on both ropes, stepped in lanes."""
    path = tmp_path / "wakes.yaml"
    text = (Path("config/scenes") / "two_line_lift.yaml").read_text()
    path.write_text(text.replace("  - payload: {}\n", "  - wake_oscillator: {}\n  - payload: {}\n"))
    scene = at_setting(load_scene(path), 8, 0.02)
    expected = driven(scene, 120, speed=0.3, live_at=40)
    fleet = Fleet(scene, 4, elements=8, step_s=0.02)
    assert not fleet.why_alone
    check_equal(fleet, fleet.advance(expected.inputs, LOOK), expected)
    assert expected.live is not None
    fleet.begin_from(expected.live)
    start = fleet.state(0)
    check_equal(fleet, fleet.advance(cut(expected.inputs, 40), LOOK), expected, 40)
    fleet.restore(start)
    check_equal(fleet, fleet.advance(cut(expected.inputs, 40), LOOK), expected, 40)


DOUBLED = {
    "tangential_drag": Change("effects.drag.tangential", 2.0, multiply=True),
    "current": Change("effects.current.profile[*][1][*]", 2.0, multiply=True),
}


@pytest.mark.parametrize("figure", DOUBLED)
def test_a_figure_is_a_change_of_the_scene(two_lines: Scene, figure: str) -> None:
    """Those of some members, against a twin of the changed scene, from the state of that twin."""
    expected = driven(change_scene(two_lines, [DOUBLED[figure]]), 80, live_at=20)
    fleet = Fleet(two_lines, 4, elements=ELEMENTS, step_s=STEP_S)
    assert fleet.figures == FIGURES
    fleet.set_figures({figure: [1.0, 2.0, 1.0, 2.0]})
    live = expected.live
    assert live is not None
    effects = build_joined(two_lines).system.ropes[0].effects  # the scene's current
    fleet.begin_from(replace(live, rope=live.rope._replace(effects=effects)))
    record = fleet.advance(cut(expected.inputs, 20), LOOK)
    for k in (1, 3):
        assert np.array_equal(record.top_tension_n[:, k], expected.top_n[20:])
    assert not np.array_equal(record.top_tension_n[:, 0], expected.top_n[20:])


def still(steps: int, line_out_m: float) -> FleetInputs:
    """Inputs of a ship at rest whose winches hold."""
    zero = np.zeros(steps + 1)
    return FleetInputs(zero, zero, np.full(steps + 1, line_out_m), zero)


def test_figures_of_load_and_ropes_apply_to_the_whole_system(two_lines: Scene) -> None:
    """A heavier load pulls at both winches, softer ropes let it down on both."""
    fleet = Fleet(two_lines, 3, elements=ELEMENTS, step_s=STEP_S)
    factors = {"submerged_weight": [1.0, 1.1, 1.0], "axial_stiffness": [1.0, 1.0, 0.5]}
    fleet.set_figures(factors | {"axial_damping": 20.0})
    record = fleet.advance(still(1200, 600.0), LOOK)
    fore, aft = (record.suspended_tension_n[name][-1] for name in ("fore", "aft"))
    load_n = (25000.0 - 5.0 * 1025.0) * 9.80665
    assert (fore + aft)[1] - (fore + aft)[0] == pytest.approx(0.1 * load_n, rel=0.01)
    assert fore[1] - fore[0] == pytest.approx(aft[1] - aft[0], rel=0.05)
    assert (fore + aft)[2] == pytest.approx((fore + aft)[0], rel=1e-5)
    stretch_m = record.payload_depth_m[-1, 0] - 600.0 * np.cos(6.0 / 600.0)
    deeper_m = record.payload_depth_m[-1, 2] - record.payload_depth_m[-1, 0]
    assert deeper_m == pytest.approx(stretch_m, rel=0.03)


def test_figures_apply_to_members_that_have_stepped(two_lines: Scene, uneven: Driven) -> None:
    """Their lanes take the new ones, also while elements are added: as in a fleet of that load."""
    fleets = [Fleet(two_lines, 3, elements=4 * ELEMENTS, step_s=STEP_S) for _ in range(2)]
    start = fleets[0].state(0)
    plain = fleets[0].advance(uneven.inputs).top_tension_n
    fleets[0].restore(start)
    tops = []
    for fleet in fleets:
        fleet.set_figures({"submerged_weight": [1.0, 1.1, 1.2]})
        tops.append(fleet.advance(uneven.inputs).top_tension_n)
        now = fleet.state(1)
        assert sum(int(own.health[rows.SPLITS]) for own in (now.rope, *now.others)) > 0
    assert np.array_equal(*tops)
    assert np.array_equal(tops[0][:, 0], plain[:, 0])
    assert not np.array_equal(tops[0][:, 1], plain[:, 1])


def test_members_at_speeds_of_their_own(two_lines: Scene) -> None:
    """Elements are added to each at other steps: as to a member that is alone in its fleet."""
    times = STEP_S * np.arange(STEPS + 1)[:, None]
    rate = np.minimum(0.2 * times, np.linspace(0.3, 1.5, 5))
    out = 600.0 + STEP_S * (np.cumsum(rate, axis=0) - rate)
    together = Fleet(two_lines, 5, elements=4 * ELEMENTS, step_s=STEP_S)
    zero = np.zeros_like(out)
    inputs = FleetInputs(zero, zero, out, rate)
    record = together.advance(inputs, LOOK)
    counts = []
    for k in range(5):
        lone = Fleet(two_lines, 1, elements=4 * ELEMENTS, step_s=STEP_S)
        own = lone.advance(mapped(inputs, lambda one, k=k: one[:, k : k + 1]), LOOK)
        for name in ("top_tension_n", "min_tension_n", "payload_depth_m", "payload_tension_n"):
            assert np.array_equal(getattr(record, name)[:, k], getattr(own, name)[:, 0]), name
        assert np.array_equal(together.state(k).rope.health, lone.state(0).rope.health)
        counts.append(int(lone.state(0).rope.counts[rows.ELEMENTS]))
    assert len(set(counts)) > 1


@pytest.mark.parametrize("elements_", [7, 40])
def test_another_mesh_keeps_connections_and_tension(
    two_lines: Scene, lowered: Driven, elements_: int
) -> None:
    """Coarser and finer, while both winches pay out, one faster than the other."""
    fleet = Fleet(two_lines, 1, elements=elements_, step_s=STEP_S)
    live = lowered.live
    assert live is not None
    fleet.begin_from(live)
    state = fleet.state(0)
    assert np.array_equal(state.joints, live.joints)
    for mine, own in zip((state.rope, *state.others), (live, *live.others), strict=True):
        n, m = int(mine.counts[rows.ELEMENTS]), elements(own.rope)
        assert mine.s[n] == own.line_out_m
        assert np.array_equal(mine.nodes[:, 0], own.rope.state.nodes[:, 0])
        assert np.array_equal(mine.nodes[:, n], own.rope.state.nodes[:, m])
    record = fleet.advance(cut(lowered.inputs, LIVE), LOOK)
    for name, hung_n in lowered.hung_n.items():
        away = record.suspended_tension_n[name][:, 0] - hung_n[LIVE:]
        spread = float(np.std(hung_n))
        assert abs(away[0]) < 0.001 * spread
        assert np.sqrt(np.mean(away**2)) < 0.01 * spread


def test_a_bridle_on_another_mesh() -> None:
    """Ropes between connections are as tense as before."""
    fine = coarse("bridle_lift", 40, 0.02)
    expected = driven(fine, 200, speed=0.5, live_at=100)
    fleet = Fleet(fine, 1, elements=20, step_s=0.02)
    assert expected.live is not None
    fleet.begin_from(expected.live)
    record = fleet.advance(cut(expected.inputs, 100), LOOK)
    away = record.top_tension_n[:, 0] - expected.top_n[100:]
    assert np.sqrt(np.mean(away**2)) < 0.02 * float(np.std(expected.top_n))
    slings = record.payload_tension_n[:, 0] - expected.payload_n[100 + LOOK - 1 :: LOOK]
    assert np.sqrt(np.mean(slings**2)) < 0.02 * float(np.std(expected.payload_n))


def test_a_member_that_fails_leaves_the_others_alone(two_lines: Scene) -> None:
    """Its values are NaN from then on, theirs are those of a fleet without it."""
    fleet = Fleet(two_lines, 4, elements=8, step_s=STEP_S)
    inputs, start = still(40, 600.0), fleet.state(0)
    whole = fleet.advance(inputs)
    broken = replace(start, others=(start.others[0].copy(),))
    broken.others[0].nodes[rows.VELOCITY, 5] = np.inf
    fleet.restore([start, start, broken, start])
    record = fleet.advance(inputs)
    assert list(record.failures) == [2]
    for values in (record.top_tension_n, record.min_tension_n, record.suspended_tension_n["aft"]):
        assert np.isnan(values[:, 2]).all()
    others = [0, 1, 3]
    assert np.array_equal(record.top_tension_n[:, others], whole.top_tension_n[:, others])
    fleet.restore(start)
    assert not fleet.advance(inputs).failures


def test_wrong_inputs_and_states_are_refused(two_lines: Scene, uneven: Driven) -> None:
    """In one sentence, before a member has moved."""
    fleet = Fleet(two_lines, 3, elements=8, step_s=STEP_S)
    good, start = still(10, 600.0), fleet.state(0)
    held = good.line_out_m, good.line_speed_m_per_s
    wrong = [
        ({"aft": held}, "no other winch 'aft'"),
        ({"winch": held}, "no other winch 'winch'"),
        ({"aft_sheave": (held[0] + 2.0, held[1])}, "line_out_m of aft_sheave: it begins at 602 m"),
        ({"aft_sheave": (held[0][1:], held[1])}, "line_out_m of aft_sheave: shape"),
        ({"aft_sheave": (held[0], held[1] * np.nan)}, "line_speed_m_per_s of aft_sheave: a value"),
        ({"aft_sheave": (held[0] + 900.0, held[1])}, "at most"),
    ]
    for lines, words in wrong:
        with pytest.raises(InputError, match=words):
            fleet.advance(replace(good, lines=lines))
    with pytest.raises(InputError, match="a state of 1 ropes, not 2"):
        fleet.restore(replace(start, others=()))
    with pytest.raises(InputError, match="other connections"):
        fleet.restore(replace(start, joints=None))
    other = Fleet(coarse("bridle_lift", 8), 1, elements=8, step_s=STEP_S)
    assert uneven.live is not None
    with pytest.raises(InputError, match="that of a twin of 'two_line_lift'"):
        other.begin_from(uneven.live)
    assert np.array_equal(fleet.state(0).rope.nodes, start.rope.nodes)
