"""Effects that branch, in SIMD lanes: equal to the bit to the members alone, and not given up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lone_twins import SECOND_NS, differing, sea, stepped_both_ways
from small_scene import SMALL_SCENE

from rope_twin import load_scene
from rope_twin.core.axial_law import CARRIED, TOP, Fibre
from rope_twin.core.body.components import bed_forces
from rope_twin.core.body.loads import component_of
from rope_twin.core.body.state import SUBMERGED, GridBed, PlaneBed, RigidBody
from rope_twin.core.body.step import pose_of
from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.group import why_alone
from rope_twin.core.lanes.step import PAYLOAD_DEPTH, PAYLOAD_DESCENT
from rope_twin.core.state import ELEMENTS, Floats
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.ensemble import Ensemble, Variation
from rope_twin.twin.ensemble.member import Member
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.winch.commands import CommandSample, WinchCommand

EVERYTHING = """\
about: a load in the splash zone or on the bed, on a rope of a stiffness table
source: made up
look_at: nothing
ropes:
  - name: hoist
    rope:
      about: a wire, stiffer under load
      diameter_m: 0.05
      mass_kg_per_m: 9.0
      hydrodynamic_diameter_m: 0.05
      axial_stiffness: {table: [[0.0, 0.0], [0.001, 6.0e+4], [0.003, 2.5e+5], [0.01, 1.2e+6]]}
      breaking_load_n: 1500000.0
    length_m: 12.0
    elements: 8
    damping: {fraction_of_first_axial_mode: 0.05}
    to: tool
payloads:
  - name: tool
    mass_kg: 8000.0
    shape: {box: {length_m: 2.0, width_m: 1.5, height_m: 1.0}}
    displaced_volume_m3: 1.5
ship:
  hang_off_m: [0.0, 0.0, 12.0]
  motion_ramp_s: 2.0
effects:
  - current:
      profile: [[0.0, [0.5, 0.1]], [-3.0, [0.3, 0.3]], [-50.0, [0.0, 0.0]]]
      over_time: [[0.0, 0.5], [1.0, 1.0], [3.0, 0.8]]
  - waves:
      jonswap: {significant_height_m: 0.6, peak_period_s: 5.0}
      components: 32
      depth_m: 8.0
      ramp_s: 1.0
  - wetting: {}
  - wind: {velocity_m_per_s: [9.0, -4.0]}
  - weight: {}
  - drag:
      normal: 1.2
      tangential: 0.03
      over_reynolds: [[1.0e+3, 1.0], [1.0e+5, 1.2], [1.0e+6, 0.6]]
  - added_mass: {normal: 1.0}
  - wake_oscillator: {}
  - seabed: {depth_m: 8.0}
  - payload: {}
  - splash_zone: {height_m: 1.0, bottom_area_m2: 3.0}
  - net: {width_m: 1.0, height_m: 1.0, solidity: 0.2}
  - fairing: {face_m2: 1.0}
time: {step_s: 0.01}
"""
SHIPPED = (
    "rov_tether", "hybrid_lift", "landing", "wave_zone", "splash_zone", "viv_in_heave",
    "tow_with_net", "lift_off", "riser_300m", "strouhal_lift",
    "active_over_passive_lift", "cable_waves", "chain_on_bottom",
    "moonpool_lift", "net_curtain", "polyester_lift",
)  # fmt: skip
PLACES = (12.0, 16.0, 18.5, 20.02)  # through the surface, below it, and from the bed on


def member(number: int) -> Variation:
    """One with its own length, water and motion."""
    changes = (
        Change("ropes[0].length_m", PLACES[number % len(PLACES)]),
        Change("effects.drag.normal", 1.0 + 0.1 * number),
        Change("effects.waves.seed", float(number)),
        Change("effects.seabed.friction", 0.2 + 0.1 * number),
    )
    heave = HeaveSeries.of(sea(0.15, 5.0 + 0.3 * number, 30.0))
    return Variation(changes, heave.starting_at(number * SECOND_NS // 3))


@pytest.mark.long
def test_branching_effects_in_lanes(tmp_path: Path) -> None:
    """A table, waves, wetting, wind, splash zone, seabed, net, fairing and VIV together."""
    path = tmp_path / "everything.yaml"
    path.write_text(EVERYTHING)
    scene = load_scene(path)
    assert not why_alone(build(scene))
    members = [member(number) for number in range(LANES)]
    ensemble = Ensemble(scene, members, threads=1)
    assert ensemble.lanes().members == LANES
    lone = Ensemble(scene, members, threads=1, max_lanes=1)
    for seconds in (1, 3):
        ensemble.advance(seconds)
        lone.advance(seconds)
    for number in range(LANES):
        assert not differing(ensemble.snapshot(number), lone.snapshot(number)), number
    lanes = ensemble.lanes()
    assert lanes.steps + lanes.given_up == 400 * LANES
    assert lanes.given_up <= 0.01 * lanes.steps  # the first step, with internal variables


@pytest.mark.long
@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenes_in_lanes(name: str) -> None:
    """Equal states, internal variables and figures in lanes and without them."""
    scene = load_scene(name)
    members = [heaving(scene, number) for number in range(LANES)]
    together = Ensemble(scene, members, threads=1)
    lone = Ensemble(scene, members, threads=1, max_lanes=1)
    assert together.lanes().members == LANES
    steps = round(6.0 / scene.time.step_s)
    for some in (1, steps // 4, steps - 1 - steps // 4):
        together.advance(some * scene.time.step_s)
        lone.advance(some * scene.time.step_s)
    assert together.figures() == lone.figures()
    for number in range(LANES):
        assert not differing(together.snapshot(number), lone.snapshot(number)), number
    lanes = together.lanes()
    assert lanes.given_up < 0.1 * lanes.steps


@pytest.mark.long
def test_wakes_that_start_during_payout_in_lanes(tmp_path: Path) -> None:
    """The first step is each member's own: nothing of the lanes' attempt at it is left behind."""
    path = tmp_path / "vortices.yaml"
    path.write_text(
        SMALL_SCENE.replace("  - payload: {}", "  - wake_oscillator: {}\n  - payload: {}")
    )
    scene = load_scene(path)
    commands = (CommandSample(0, WinchCommand(SPEED, 0.5)),)
    members = [Variation(heave=heaving(scene, k).heave, commands=commands) for k in range(LANES)]
    together = Ensemble(scene, members, threads=1)
    lone = Ensemble(scene, members, threads=1, max_lanes=1)
    assert together.lanes().members == LANES
    for one in (together, lone):
        one.advance(1.0)
    for number in range(LANES):
        assert not differing(together.snapshot(number), lone.snapshot(number)), number


KEULEGAN_CARPENTER = """\
  - drag:
      normal: 1.5
      tangential: 0.03
      over_keulegan_carpenter:
        tables: [{roughness: 0.001, rows: [[2.0, 0.8], [12.0, 1.4], [60.0, 0.7]]}]
        window_s: 8.0
  - payload_oscillation:
      size_m: [1.0, 1.0, 1.5]
      drag: [[1.0, 2.0], [10.0, 1.2], [40.0, 0.9]]
      added_mass: [[0.5, 0.6], [3.0, 1.5]]
      window_s: 8.0
"""
GROWING = """\
  - drag: {normal: 1.5, tangential: 0.03}
  - fluid_ramp:
      water: {ramp_s: 3.0}
      vortices: {over_time: [[0.5, 0.2], [1.0, 1.0], [3.0, 0.6]]}
  - depth_profiles:
      density_kg_per_m3: [[-5.0, 1005.0], [-80.0, 1060.0], [-195.0, 1064.0]]
      drag_factor: [[0.0, 1.6], [-40.0, 0.8]]
  - payload_shedding: {strouhal: 0.18, lift_coefficient: 0.4, diameter_m: 1.2, area_m2: 1.5}
"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("effects", "variants"),
    [
        (KEULEGAN_CARPENTER, (("payload_oscillation.size_m[2]", 0.8, 0.3),)),
        (GROWING, (("fluid_ramp.water.ramp_s", 1.0, 1.0),)),
    ],
    ids=["oscillating", "growing"],
)
def test_time_varying_forces_in_lanes(
    tmp_path: Path, effects: str, variants: tuple[tuple[str, float, float], ...]
) -> None:
    """By Keulegan-Carpenter numbers, or by ramps, in layers; calm, paid out, and snapping ones."""
    path, drag = tmp_path / "changing.yaml", "  - drag: {normal: 1.5, tangential: 0.03}\n"
    assert drag in SMALL_SCENE
    path.write_text(SMALL_SCENE.replace(drag, effects))
    scene = load_scene(path)
    members = []
    for k in range(LANES):
        changes = [Change(f"effects.{name}", first + step * k) for name, first, step in variants]
        light = Change("payloads[0].mass_kg", 1700.0 if k % 3 == 2 else 8000.0)
        heave = HeaveSeries.of(sea((0.5, 1.0, 4.0)[k % 3], 5.0 + 0.3 * k, 30.0))
        speed = CommandSample(0, WinchCommand(SPEED, 1.5 if k % 3 == 1 else 0.0))
        members.append(Variation((*changes, light), heave, (speed,)))
    together, _ = stepped_both_ways(scene, members)
    snapshots = [together.snapshot(number).solver for number in range(LANES)]
    assert snapshots[1].splits > 0
    assert max(snapshot.solves_max_per_stage for snapshot in snapshots[2::3]) > 4
    lanes = together.lanes()
    assert lanes.given_up < 0.2 * lanes.steps


SOUNDINGS = """\
seabed:
      soundings:
        x_m: [100.0, 150.0, 163.0, 180.0, 191.0, 300.0]
        y_m: [-40.0, -2.0, 3.0, 40.0]
        depth_m:
          - [300.3, 299.8, 300.4, 300.1, 300.2, 300.0]
          - [300.0, 300.2, 299.7, 300.3, 299.9, 300.0]
          - [300.2, 299.9, 300.1, 299.8, 300.3, 300.1]
          - [299.8, 300.3, 300.0, 300.2, 299.9, 300.0]"""


@pytest.mark.long
@pytest.mark.parametrize("friction", ["", "  - bed_friction: {axial: 0.3, lateral: 0.6}\n"])
def test_chains_on_soundings_in_lanes(tmp_path: Path, friction: str) -> None:
    """Laid down, dragged and lifted over soundings, at another position in each lane."""
    text = load_scene("chain_on_bottom").path.read_text()
    sticks = next(line for line in text.splitlines(keepends=True) if "bed_friction" in line)
    path = tmp_path / "uneven.yaml"
    path.write_text(text.replace("seabed: {depth_m: 300.0}", SOUNDINGS).replace(sticks, friction))
    scene, members = load_scene(path), []
    # one schedule: lanes with other numbers of elements would part, and step alone
    starts = ((0, 0.5), (5 * SECOND_NS, -0.5))
    commands = tuple(CommandSample(at_ns, WinchCommand(SPEED, speed)) for at_ns, speed in starts)
    for k in range(LANES):
        changes = (
            Change("ropes[0].fixed_at_m[0]", 200.0 - 2.0 * k),
            Change("ropes[0].fixed_at_m[2]", -299.9),
            Change("effects.seabed.soundings.depth_m[*][*]", 1.0 + 1e-4 * k, multiply=True),
            Change("effects.seabed.friction", 0.1 + 0.1 * k),
        )
        heave = HeaveSeries.of(sea((0.5, 1.0, 4.0)[k % 3], 5.0 + 0.3 * k, 30.0))
        members.append(Variation(changes, heave.starting_at(k * SECOND_NS // 3), commands))
    together, lone = stepped_both_ways(scene, members)
    for number in range(LANES):
        snapshot = lone.snapshot(number)
        assert (snapshot.node_position_m[:, 2] < -299.0).sum() > 5
    lanes = together.lanes()
    assert lanes.given_up < 0.02 * lanes.steps


POLYESTER_BELOW_WIRE = """\
    sections:
      - length_m: 93.0
        rope:
          diameter_m: 0.1
          mass_kg_per_m: 6.8
          hydrodynamic_diameter_m: 0.08
          axial_stiffness:
            table: [[0.0, 0.0], [0.01, 2.5e+5], [0.05, 2.2e+6]]
            dynamic: {constant_n: 3.6e+7, per_mean_tension: 40.0, per_tension_amplitude: 30.0,
                      relaxation_s: 20.0}
            working_curve: {permanent: 0.3, curvature: 0.4, max_mean_tension_n: 7.0e+4}
          breaking_load_n: 3082000.0
      - rope: {diameter_m: 0.05, mass_kg_per_m: 9.0, hydrodynamic_diameter_m: 0.05,
               axial_stiffness: {table: [[0.0, 0.0], [0.001, 6.0e+4], [0.01, 8.0e+5]]},
               breaking_load_n: 1500000.0}
"""


@pytest.mark.long
def test_fibre_rope_below_wire_in_lanes(tmp_path: Path) -> None:
    """Where the wire has yet to come over the sheave, or comes; calm, moving, and slack ones.

    Some are loaded beyond their maximum tension so far, others below it on working curves.
    """
    path = tmp_path / "polyester.yaml"
    text = SMALL_SCENE.replace("    rope: steel_wire_40mm\n", POLYESTER_BELOW_WIRE)
    path.write_text(text.replace("length_m: 200.0", "length_m: 90.0"))
    scene, members = load_scene(path), []
    for k in range(LANES):
        changes = (
            Change("payloads[0].mass_kg", (3000.0 if k % 3 == 2 else 7000.0) + 400.0 * k),
            Change("ropes[0].sections[0].rope.axial_stiffness.dynamic.relaxation_s", 5.0 + 2.0 * k),
        )
        heave = HeaveSeries.of(sea((0.5, 0.3, 4.0)[k % 3], 5.0 + 0.3 * k, 30.0))
        speed = CommandSample(0, WinchCommand(SPEED, 0.6 if k % 3 == 1 else 0.0))
        back = CommandSample(8 * SECOND_NS, WinchCommand(SPEED, -0.6 if k % 3 == 1 else 0.0))
        members.append(Variation(changes, heave.starting_at(k * SECOND_NS // 3), (speed, back)))
    together = Ensemble(scene, members, threads=1)
    lone = Ensemble(scene, members, threads=1, max_lanes=1)
    assert together.lanes().members == LANES
    for seconds in (1, 14):
        together.advance(seconds)
        lone.advance(seconds)
    assert together.figures() == lone.figures()
    memories = []
    for number in range(LANES):
        assert not differing(together.snapshot(number), lone.snapshot(number)), number
        found, expected = _fibre_of(together, number), _fibre_of(lone, number)
        assert np.array_equal(found, expected), number
        memories.append(found)
    tops = [memory[TOP].max() for memory in memories]
    assert max(tops) > min(tops) > 0.0
    assert any(one.slack_share > 0.0 for one in together.figures())
    snapshots = [together.snapshot(number).solver for number in range(LANES)]
    assert snapshots[1].splits > 0
    lanes = together.lanes()
    assert lanes.given_up < 0.2 * lanes.steps


def _fibre_of(ensemble: Ensemble, number: int) -> Floats:
    """Return the internal variables of a member's elements, (CARRIED, elements)."""
    member = ensemble._members[number]
    assert isinstance(member, Member)
    fibre = next(effect for effect in member.rope.effects if isinstance(effect, Fibre))
    return fibre.memory[:CARRIED, : member.rope.state.counts[ELEMENTS]]


def _body_of(ensemble: Ensemble, number: int) -> RigidBody:
    member = ensemble._members[number]
    assert isinstance(member, Member)
    return next(effect for effect in member.rope.effects if isinstance(effect, RigidBody))


def _check_bodies(together: Ensemble, lone: Ensemble) -> None:
    for number in range(LANES):
        assert not differing(together.snapshot(number), lone.snapshot(number)), number
        watched = together.watched(number)
        np.testing.assert_array_equal(watched, lone.watched(number))
        found, expected = _body_of(together, number), _body_of(lone, number)
        pose = pose_of(found)
        depth, sinking = -pose.place(found.middle)[2], -pose.speed(found.middle)[2]
        assert watched[-1, 1 + PAYLOAD_DEPTH] == pytest.approx(depth, rel=1e-9)
        assert watched[-1, 1 + PAYLOAD_DESCENT] == pytest.approx(sinking, rel=1e-9, abs=1e-12)
        assert np.array_equal(found.records, expected.records), number
        assert np.array_equal(found.memory[:, :1], expected.memory[:, :1]), number


@pytest.mark.long
def test_lift_off_in_lanes() -> None:
    """Slings tighten and fall slack, corners touch and come off: bit-identical, step by step."""
    scene = load_scene("lift_off")
    members = [heaving(scene, number) for number in range(LANES)]
    together = Ensemble(scene, members, threads=1, watched=True)
    lone = Ensemble(scene, members, threads=1, max_lanes=1, watched=True)
    assert together.lanes().members == LANES
    heights = []
    for seconds in (1, 13, 12):
        together.advance(seconds)
        lone.advance(seconds)
        _check_bodies(together, lone)
        heights.append(min(pose_of(_body_of(lone, k)).centre[2] for k in range(LANES)))
    assert heights[-1] > heights[0] + 0.5
    lanes = together.lanes()
    assert lanes.steps > lanes.given_up


SHEDS = "  - payload_shedding: {strouhal: 0.15, lift_coefficient: 0.8, diameter_m: 4.0}\n"
UNEVEN = """\
seabed:
      payload_penetration_m: 0.1
      soundings:
        x_m: [-60.0, -2.0, 0.5, 3.0, 60.0]
        y_m: [-60.0, -1.0, 2.0, 60.0]
        depth_m: [[45.0, 45.2, 45.1, 45.0, 45.0], [45.1, 44.9, 45.1, 45.0, 45.2],
                  [45.2, 45.1, 44.9, 45.2, 45.0], [45.0, 45.1, 45.0, 45.1, 45.1]]"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("line_out_m", "bed"), [(29.5, PlaneBed), (70.6, PlaneBed), (70.6, GridBed)]
)
def test_body_at_the_surface_and_on_the_bed_in_lanes(
    tmp_path: Path, line_out_m: float, bed: type
) -> None:
    """Columns stand partly in the waves, or corners bear on the bed, in each lane otherwise.

    The one on soundings sheds vortices too.
    """
    scene = load_scene("manifold_lift")
    if bed is GridBed:
        plane = "seabed: {depth_m: 45.0, payload_penetration_m: 0.1}"
        path, text = tmp_path / "uneven.yaml", scene.path.read_text()
        assert plane in text
        path.write_text(
            text.replace(plane, UNEVEN).replace("  - splash_zone", f"{SHEDS}  - splash_zone")
        )
        scene = load_scene(path)
    scene = change_scene(scene, (Change("ropes[0].length_m", line_out_m),))
    members = [Variation((Change("effects.waves.seed", float(k)),)) for k in range(LANES)]
    together = Ensemble(scene, members, threads=1, watched=True)
    lone = Ensemble(scene, members, threads=1, max_lanes=1, watched=True)
    assert together.lanes().members == LANES
    for seconds in (1, 3):
        together.advance(seconds)
        lone.advance(seconds)
        _check_bodies(together, lone)
    bodies = [_body_of(together, number) for number in range(LANES)]
    pushes = [bed_forces(component_of(body, bed), body, pose_of(body))[1] for body in bodies]
    stands = line_out_m > 50.0
    assert all((body.stage[SUBMERGED] < 1.0) != stands for body in bodies)
    assert all((push.sum() > 0.0) == stands for push in pushes)
    lanes = together.lanes()
    assert lanes.given_up < 0.1 * lanes.steps


def heaving(scene: Scene, number: int) -> Variation:
    """One with a motion of its own, small where the rope is held and would fall slack."""
    held = scene.ropes[0].fixed_at_m is not None
    heave = HeaveSeries.of(sea(0.05 if held else 0.4, 6.0 + 0.3 * number, 30.0))
    return Variation(heave=heave.starting_at(number * SECOND_NS // 3))
