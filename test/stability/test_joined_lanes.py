"""Systems of ropes that share SIMD lanes, against twins of their own: equal to the bit.

A tree (two lines to one load), a loop (a bridle with a bar) and ropes that run over a sheave,
whatever happens to those beside.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lone_twins import (
    SECOND_NS,
    alone,
    assert_equal_members,
    differing,
    differing_ropes,
    sea,
    stepped_both_ways,
)

from rope_twin import load_scene
from rope_twin.core.jit.wide import LANES
from rope_twin.core.joined.line_contact import rope_contact_of
from rope_twin.core.joined.payload_contact import payload_contact_of
from rope_twin.core.lanes.joined_group import joined_kind_of, why_joined_alone
from rope_twin.core.state import ELEMENTS, RELAXATION, TENSION, VELOCITY, Floats
from rope_twin.effects.wake_oscillator import WakeOscillator
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.load import Change
from rope_twin.scene.schema import Scene
from rope_twin.studies.ensemble import make_plan, variations
from rope_twin.studies.study_design import Variable
from rope_twin.twin.ensemble.ensemble import MIN_GROUP, Ensemble, Variation
from rope_twin.twin.ensemble.member import TwinMember
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.winch.commands import CommandSample, WinchCommand

SCENES = ("two_line_lift", "bridle_lift", pytest.param("two_line_loop", marks=pytest.mark.long))
SLACK_M = {"two_line_lift": 4.0, "bridle_lift": 4.0, "two_line_loop": 6.0}  # heights of seas
PARTS = ("load_transfer", "net_screen", "net_wall")  # with a rigid body, with nets between ropes


def member(number: int, height_m: float = 0.4, speed: float = 0.0) -> Variation:
    """One with its own load, water, damping and sea."""
    changes = (
        Change("payloads[*].mass_kg", 1.0 + 0.02 * number, multiply=True),
        Change("effects.drag.normal", 1.0 + 0.1 * number),
        Change("ropes[0].damping.fraction_of_first_axial_mode", 0.01 * number),
    )
    heave = HeaveSeries.of(sea(height_m, 6.0 + 0.3 * number, 30.0))
    commands = tuple(
        CommandSample(k * SECOND_NS, WinchCommand(SPEED, v)) for k, v in ((0, speed), (13, 0.0))
    )
    return Variation(changes, heave.starting_at(number * SECOND_NS // 3), commands)


def unequal(scene: Scene, ensemble: Ensemble, members: list[Variation], seconds: int) -> list[str]:
    """Return the values that differ from those of lone twins, with member and rope."""
    found = []
    for number, variation in enumerate(members):
        snapshot, expected = ensemble.snapshot(number), alone(scene, variation, seconds)
        found += [f"member {number}: {name}" for name in differing(snapshot, expected)]
        found += [f"member {number}: {name}" for name in differing_ropes(snapshot, expected)]
    return found


@pytest.mark.parametrize("name", SCENES)
def test_calm_systems_step_in_lanes(name: str) -> None:
    """All stay in lanes, none repeats a step alone, in any call pattern."""
    scene, members = load_scene(name), [member(number) for number in range(LANES)]
    ensemble = Ensemble(scene, members, threads=1)
    assert ensemble.lanes().members == LANES
    for seconds in (0.5, 2.5, 1.0):
        ensemble.advance(seconds)
    assert not unequal(scene, ensemble, members, 4)
    lanes = ensemble.lanes()
    assert (lanes.steps, lanes.given_up) == (400 * LANES, 0)


@pytest.mark.parametrize("name", SCENES)
def test_slack_and_snapping_systems_in_lanes(name: str) -> None:
    """Some need more corrections than others, the line search, or a halved step."""
    scene = load_scene(name)
    members = [member(number, 0.2 if number % 2 else SLACK_M[name]) for number in range(LANES)]
    ensemble = Ensemble(scene, members, slack_interval_s=0.07, threads=1)
    lone = Ensemble(scene, members, slack_interval_s=0.07, threads=1, max_lanes=1)
    for seconds in (2, 4):
        ensemble.advance(seconds)
        lone.advance(seconds)
    assert not unequal(scene, ensemble, members, 6)
    assert ensemble.figures() == lone.figures()
    lanes = ensemble.lanes()
    assert lanes.steps + lanes.given_up == 600 * LANES
    snapshots = [ensemble.snapshot(number).solver for number in range(LANES)]
    assert max(snapshot.solves_max_per_stage for snapshot in snapshots) > 2
    assert (lanes.given_up > 0) == (name == "bridle_lift")
    assert any(one.slack_share > 0.0 for one in ensemble.figures())


def test_a_step_repeated_alone_at_the_end_of_a_call() -> None:
    """Tensions are those of the step that the member made alone."""
    scene = load_scene("bridle_lift")
    members = [member(number, 0.2 if number % 2 else 4.0) for number in range(LANES)]
    both = [Ensemble(scene, members, threads=1, max_lanes=max_lanes) for max_lanes in (LANES, 1)]
    for one in both:
        one.advance(4)
    before = both[0].lanes().given_up
    for _ in range(100):
        for one in both:
            one.advance(0.01)
        assert all(np.array_equal(*(_tensions(one, k) for one in both)) for k in range(LANES))
    assert both[0].lanes().given_up > before


def _tensions(ensemble: Ensemble, number: int) -> Floats:
    """Return the tension of all elements of a member's ropes [N]."""
    one = ensemble._members[number]
    assert isinstance(one, TwinMember)
    ropes = one.system.ropes
    return np.concatenate([rope.work[TENSION, : rope.state.counts[ELEMENTS]] for rope in ropes])


@pytest.mark.parametrize("name", SCENES)
def test_splits_in_some_members(name: str) -> None:
    """Members that pay out get other meshes than their neighbours, and leave the lanes."""
    scene = load_scene(name)
    members = [member(number, speed=0.5 if number < MIN_GROUP else 0.0) for number in range(LANES)]
    ensemble = Ensemble(scene, members, threads=1)
    for seconds in (1, 14):
        ensemble.advance(seconds)
    assert not unequal(scene, ensemble, members, 15)
    snapshots = [ensemble.snapshot(number).solver for number in range(LANES)]
    assert [bool(snapshot.splits) for snapshot in snapshots] == [
        number < MIN_GROUP for number in range(LANES)
    ]
    lanes = ensemble.lanes()
    assert lanes.steps + lanes.given_up == 1500 * LANES


def test_a_failing_system_does_not_change_its_neighbours() -> None:
    """It reports when it stopped, and the others are bit-identical."""
    scene, members = load_scene("bridle_lift"), [member(number) for number in range(LANES)]
    ensemble = Ensemble(scene, members, threads=1)
    ensemble.advance(1)
    broken = ensemble._members[3]
    assert isinstance(broken, TwinMember)
    broken.system.ropes[2].state.nodes[VELOCITY, 4] = np.inf
    ensemble.advance(2)
    reported = [figures.failure for figures in ensemble.figures()]
    assert reported[3].startswith("step 101 at 1.00 s: the rope's next state is not finite")
    assert ensemble.figures()[3].steps == 100
    for number in set(range(LANES)) - {3}:
        assert not reported[number]
        assert not differing(ensemble.snapshot(number), alone(scene, members[number], 3))


def test_systems_of_two_sizes_form_two_groups() -> None:
    """One group is full; too few of the other kind are left for a group."""
    few = MIN_GROUP - 1
    small = (Change("ropes[1].elements", 50),)
    members = [Variation()] * LANES + [Variation(small)] * few
    reported = Ensemble(load_scene("two_line_lift"), members, threads=1).lanes()
    assert reported.members == LANES
    assert reported.alone == {"": few}


def over_the_sheave(number: int, speed: float) -> Variation:
    """Return a member with its own sheave and winches that run the skip below 30 m of rope."""
    variation, runs = member(number), (("winch", speed), ("hang_offs[0].winch", -speed))
    changes = [
        Change("ropes[0].length_m", 1470.0),
        Change("ropes[1].length_m", 30.0),
        Change("ropes[1].elements", 3),
        Change("winch.max_line_out_m", 1600.0),
        Change("sheaves[0].friction", 0.01 + 0.02 * number),
        Change("sheaves[0].mass_kg", 1000.0 + 100.0 * number),
        Change("sheaves[0].wheel_inertia_kg", 50.0 + 20.0 * number),
    ]
    for winch, v in runs:
        changes += [
            Change(f"{winch}.schedule[1].at_s", 1.0),
            Change(f"{winch}.schedule[1].speed_m_per_s", v),
        ]
    return Variation((*variation.changes, *changes), variation.heave)


@pytest.mark.long
def test_meshes_change_at_a_sheave_in_lanes() -> None:
    """Rope runs over it either way: some get more elements there, some run out of them and fail."""
    scene = load_scene("two_line_loop")
    speeds = [1.5 if number < MIN_GROUP else -1.0 for number in range(LANES)]
    members = [over_the_sheave(number, speed) for number, speed in enumerate(speeds)]
    ensemble, lone = stepped_both_ways(scene, members, (1, 20))
    assert [bool(one.failure) for one in lone.figures()] == [speed > 0.0 for speed in speeds]
    for number in range(LANES):
        elements = len(ensemble.snapshot(number).ropes[1].element_tension_n)
        assert elements == 2 if speeds[number] > 0.0 else elements > 3


POLYESTER = """{diameter_m: 0.1, mass_kg_per_m: 6.8, hydrodynamic_diameter_m: 0.08,
      axial_stiffness: {table: [[0.0, 0.0], [0.01, 2.5e+5], [0.05, 2.2e+6]],
        dynamic: {constant_n: 3.6e+7, per_mean_tension: 40.0, relaxation_s: 20.0},
        working_curve: {permanent: 0.3, max_mean_tension_n: 6.0e+4}},
      breaking_load_n: 3082000.0}"""


@pytest.mark.long
def test_wakes_of_systems_in_lanes(tmp_path: Path) -> None:
    """Wakes that oscillate at all nodes, also at the connection, of ropes of which one relaxes.

    All but the first step are in lanes.

    A member gets other elements on the way, and its wakes are interpolated to them by itself.
    """
    text = load_scene("two_line_lift").path.read_text()
    path = tmp_path / "vortices.yaml"
    text = text.replace("rope: steel_wire_40mm", f"rope: {POLYESTER}", 1)
    path.write_text(text.replace("  - payload: {}", "  - wake_oscillator: {}\n  - payload: {}"))
    scene = load_scene(path)
    assert [rope.rope.is_fibre for rope in scene.ropes] == [True, False]
    members = [member(number, speed=0.5 if number == 1 else 0.0) for number in range(LANES)]
    ensemble = Ensemble(scene, members, threads=1)
    assert ensemble.lanes().members == LANES
    for seconds in (1, 14):
        ensemble.advance(seconds)
    assert not unequal(scene, ensemble, members, 15)
    assert [bool(ensemble.snapshot(k).solver.splits) for k in range(3)] == [False, True, False]
    memories = [_memory_of(ensemble, number) for number in (0, 0, 2)]
    assert np.array_equal(memories[0], memories[1])
    assert not np.array_equal(memories[0], memories[2])
    lone = Ensemble(scene, members, threads=1, max_lanes=1)
    lone.advance(15)
    for number in range(LANES):
        assert np.array_equal(_memory_of(ensemble, number), _memory_of(lone, number)), number


def _memory_of(ensemble: Ensemble, number: int) -> Floats:
    """Return the wakes of both ropes now."""
    one = ensemble._members[number]
    assert isinstance(one, TwinMember)
    ropes = one.system.ropes
    counts = [int(rope.state.counts[ELEMENTS]) + 1 for rope in ropes]
    positions = [[type(e) for e in rope.effects].index(WakeOscillator) for rope in ropes]
    parts = zip(ropes, counts, positions, strict=True)
    return np.concatenate([rope.effects[i].memory[:2, :n].ravel() for rope, n, i in parts])


GROWING = """\
  - fluid_ramp: {water: {ramp_s: 3.0}, vortices: {over_time: [[0.5, 0.2], [4.0, 1.0]]}}
  - payload_shedding: {strouhal: 0.18, lift_coefficient: 0.4, diameter_m: 1.2, area_m2: 1.5}
"""


@pytest.mark.long
def test_effects_without_wide_kernels_in_lanes(tmp_path: Path) -> None:
    """Waves, splash zone and seabed, of two ropes with one load, which enters the water.

    The forces of the water grow, and so do those of the vortices that the load sheds.

    Some leave the surface in one stage and solve the next with the existing factors, others do not.
    """
    path, text = tmp_path / "growing.yaml", load_scene("two_line_landing").path.read_text()
    assert "  - payload: {}\n" in text
    path.write_text(text.replace("  - payload: {}\n", f"{GROWING}  - payload: {{}}\n"))
    scene = load_scene(path)
    height = Variable(
        path="effects.waves.jonswap.significant_height_m", from_=0.9, to=1.0, multiply=True
    )
    drag = Variable(path="effects.drag.normal", from_=0.95, to=1.05, multiply=True)
    members = variations(scene, make_plan([drag, height], LANES, 1), 16.0)
    ensemble, _ = stepped_both_ways(scene, members, (14,))
    lanes = ensemble.lanes()
    assert lanes.given_up < 0.1 * lanes.steps


@pytest.mark.long
@pytest.mark.parametrize("name", PARTS)
def test_systems_with_shared_parts_in_lanes(name: str) -> None:
    """Parts that one rope has for all, or that act between ropes: the same states and figures."""
    check_members(load_scene(name))


@pytest.mark.long
@pytest.mark.parametrize("name", SCENES)
def test_bent_systems_in_lanes(tmp_path: Path, name: str) -> None:
    """Clamped at hang-offs, hinged at connections."""
    check_members(bent(tmp_path, name))


def bent(folder: Path, name: str) -> Scene:
    """Return a shipped scene with ropes that have bending stiffness."""
    path = folder / "bent.yaml"
    bending = "bending: {stiffness_n_m2: 3.0e+5, clamped_along: [0.1, 0.0, -1.0]}"
    text = load_scene(name).path.read_text()
    path.write_text(text.replace("  - payload: {}", f"  - {bending}\n  - payload: {{}}"))
    return load_scene(path)


def test_bent_ropes_step_in_lanes(tmp_path: Path) -> None:
    """All kernels of bending take wide numbers."""
    assert not why_joined_alone(build_joined(bent(tmp_path, "bridle_lift")).system)


def check_members(scene: Scene) -> None:
    """Assert that members in lanes, of different lengths, are equal to those without them."""
    members = []
    for number in range(LANES):
        longer = Change("ropes[0].length_m", scene.ropes[0].length_m + 0.05 * number)
        one = member(number, 0.3 + 0.2 * number)
        members.append(replace(one, changes=(*one.changes, longer), commands=None))
    ensemble, _ = stepped_both_ways(scene, members)
    lanes = ensemble.lanes()
    assert lanes.given_up < 0.01 * lanes.steps  # such as the first one, with internal variables


THIRD = """\
  - name: third_line
    rope: {about: 20 mm steel wire, diameter_m: 0.02, mass_kg_per_m: 1.6,
           hydrodynamic_diameter_m: 0.016, axial_stiffness_n: 1.6e+7, breaking_load_n: 250.0e+3}
    length_m: 30.0
    elements: 12
    damping: {fraction_of_first_axial_mode: 0.02}
    from: third_sheave
    to: block

hang_offs:
  - {name: third_sheave, at_m: [3.0, 1.0, 0.0]}
"""
BLOCK = """\
  - name: block
    mass_kg: 1800.0
    shape: {box: {length_m: 0.9, width_m: 0.9, height_m: 0.5}}

winch:
"""


@pytest.mark.long
def test_payload_contact_in_lanes(tmp_path: Path) -> None:
    """Three spheres hit, press, slide along each other and part, differently in each lane."""
    text = load_scene("cage_and_clump").path.read_text()
    text = text.replace("\nhang_offs:\n", THIRD).replace("\nwinch:\n", BLOCK)
    clump = "        - {name: clump, radius_m: 0.45}\n"
    assert clump in text
    path = tmp_path / "three.yaml"
    path.write_text(text.replace(clump, f"{clump}        - {{name: block, radius_m: 0.5}}\n"))
    scene, members = load_scene(path), []
    for k in range(LANES):
        changes = (
            Change("effects.current.profile[*][1][*]", 0.8 + 0.06 * k, multiply=True),
            Change("effects.payload_contact.stiffness_n_per_m", 1e5 * (k + 1)),
            Change("effects.payload_contact.friction", 0.1 * k),
        )
        heave = HeaveSeries.of(sea((0.2, 0.5, 1.0)[k % 3], 5.0 + 0.3 * k, 30.0))
        members.append(Variation(changes, heave.starting_at(k * SECOND_NS // 3)))
    ensemble = Ensemble(scene, members, threads=1)
    lone = Ensemble(scene, members, threads=1, max_lanes=1)
    assert ensemble.lanes().members == LANES
    touches = []
    for _ in range(10):
        for one in (ensemble, lone):
            one.advance(1)
        touches.append([_touches(ensemble, number) for number in range(LANES)])
    assert_equal_members(ensemble, lone)
    assert {0, 1, 2} <= set(np.ravel(touches))
    assert any(len(set(some)) > 1 for some in touches)  # not alike in all lanes
    lanes = ensemble.lanes()
    assert lanes.given_up < 0.1 * lanes.steps


def _touches(ensemble: Ensemble, number: int) -> int:
    """Return how many contacts between ropes or payloads there are now."""
    one = ensemble._members[number]
    assert isinstance(one, TwinMember)
    touch = rope_contact_of(one.system) or payload_contact_of(one.system)
    assert touch is not None
    return touch.contacts


def crossing(folder: Path) -> Scene:
    """Return a scene of three lines that a turning current sets against each other."""
    text = load_scene("cage_and_clump").path.read_text()
    bodies, rest = text.index("  - payload_contact:"), text.index("time: {step_s")
    text = f"{text[:bodies]}\n{text[rest:]}"
    turning = "over_time: [[0.5, 1.0], [1.0, -1.0], [4.0, -1.0], [5.0, 2.0]]"
    changes = (
        ("  - current:\n", f"  - current:\n      {turning}\n"),
        ("  - payload: {}\n", "  - line_contact: {distance_m: 0.1}\n  - payload: {}\n"),
        ("at_m: [3.4, 0.0, 0.0]", "at_m: [0.8, 0.05, 0.0]"),
        ("\nhang_offs:\n", THIRD.replace("[3.0, 1.0, 0.0]", "[1.4, -0.05, 0.0]")),
        ("\nwinch:\n", BLOCK),
    )
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "crossing.yaml"
    path.write_text(text)
    return load_scene(path)


@pytest.mark.long
def test_rope_contact_in_lanes(tmp_path: Path) -> None:
    """Three lines hit, press, slide along each other and part, at other elements in each lane."""
    scene, members = crossing(tmp_path), []
    for k in range(LANES):
        changes = (
            Change("effects.current.profile[*][1][*]", 0.6 + 0.2 * (k % 4), multiply=True),
            Change("effects.line_contact.distance_m", 0.06 + 0.02 * (k % 4)),
            Change("effects.line_contact.stiffness_n_per_m", 2e4 * (k + 1)),
            Change("effects.line_contact.friction", 0.1 * k),
        )
        heave = HeaveSeries.of(sea((0.2, 0.5, 1.0)[k % 3], 5.0 + 0.3 * k, 30.0))
        members.append(Variation(changes, heave.starting_at(k * SECOND_NS // 3)))
    ensemble = Ensemble(scene, members, threads=1)
    lone = Ensemble(scene, members, threads=1, max_lanes=1)
    assert ensemble.lanes().members == LANES
    touches = []
    for _ in range(10):
        for one in (ensemble, lone):
            one.advance(1)
        touches.append([_touches(ensemble, number) for number in range(LANES)])
        for number in range(LANES):
            assert ensemble.snapshot(number).contacts == lone.snapshot(number).contacts
    assert_equal_members(ensemble, lone)
    assert {0, 1, 2} <= set(np.ravel(touches))
    assert any(len(set(some)) > 2 for some in touches)  # not alike in all lanes
    lanes = ensemble.lanes()
    assert lanes.given_up < 0.1 * lanes.steps


def test_systems_with_rope_contact_step_in_lanes(tmp_path: Path) -> None:
    """Its kernel has a variant for lanes."""
    system = build_joined(crossing(tmp_path)).system
    assert not why_joined_alone(system)
    assert joined_kind_of(system) is not None


@pytest.mark.parametrize(
    "name",
    [*SCENES, *PARTS, "cage_and_clump", "two_line_landing", "two_line_ascent", "two_line_14km"],
)
def test_multi_line_scenes_step_in_lanes(name: str) -> None:
    """All their effects have kernels for it."""
    system = build_joined(load_scene(name)).system
    assert not why_joined_alone(system)
    assert joined_kind_of(system) is not None


def test_a_fibre_rope_and_a_steel_rope_in_one_system_step_in_lanes(tmp_path: Path) -> None:
    """Their effects are those of one system: of the same types in all ropes."""
    text, path = load_scene("two_line_lift").path.read_text(), tmp_path / "unlike.yaml"
    path.write_text(text.replace("rope: steel_wire_40mm", f"rope: {POLYESTER}", 1))
    fore, aft = build_joined(load_scene(path)).system.ropes
    assert list(map(type, fore.effects)) == list(map(type, aft.effects))
    assert fore.sections[RELAXATION] > 0.0 == aft.sections[RELAXATION]
