"""Figures that a multi-line run takes over: as a fleet's, in states and after cuts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fleet_inputs import driven, ropes

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.effects.payload import Payload
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.scene.load import at_setting, load_scene
from rope_twin.scene.rope_data import StiffnessTable
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import Fleet

ELEMENTS, STEP_S, STEPS, LOOK = 20, 0.05, 200, 10
FACTORS = {
    "submerged_weight": 1.125, "oscillating_mass": 0.875, "payload_drag": 1.5,
    "axial_stiffness": 0.75, "axial_damping": 1.5, "tangential_drag": 2.0,
}  # fmt: skip
TABLE = StiffnessTable(table=((0.0, 0.0), (0.002, 0.1e6), (0.004, 0.3e6), (0.008, 0.8e6)))


@pytest.fixture(scope="module")
def bridle() -> Scene:
    """A spreader bar with two loads, on the mesh of a fleet."""
    return at_setting(load_scene("bridle_lift"), ELEMENTS, STEP_S)


def tabled(scene: Scene) -> Scene:
    """The scene with a table in place of the stiffness of each rope."""
    made = []
    for line in scene.ropes:
        assert line.rope is not None
        own = replace(line.rope, axial_stiffness_n=None, axial_stiffness=TABLE)
        made.append(replace(line, rope=own))
    return replace(scene, ropes=tuple(made))


@pytest.mark.parametrize(
    ("change", "members"),
    [
        pytest.param(lambda scene: scene, 4, id="number"),
        pytest.param(tabled, 1, id="table", marks=pytest.mark.long),
        pytest.param(tabled, 4, id="table in lanes", marks=pytest.mark.long),
    ],
)
def test_a_twin_with_figures_is_a_member_with_them(bridle: Scene, change, members: int) -> None:
    """Top tension and the nodes of all ropes are equal to the bit, while the winch pays out."""
    scene = change(bridle)
    expected = driven(scene, STEPS, speed=0.5, figures=FACTORS)
    fleet = Fleet(scene, members, elements=ELEMENTS, step_s=STEP_S)
    assert not fleet.why_alone
    fleet.set_figures(FACTORS)
    record = fleet.advance(expected.inputs, LOOK)
    for member in record.top_tension_n.T:
        assert np.array_equal(member, expected.top_n)
    state = fleet.state(0)
    for mine, rope in zip((state.rope, *state.others), ropes(expected.twin), strict=True):
        n = int(mine.counts[rows.ELEMENTS])
        assert np.array_equal(mine.nodes[:, : n + 1], rope.state.nodes[:, : n + 1])
    plain = driven(scene, 5, speed=0.5)
    assert not np.array_equal(plain.top_n, expected.top_n[:5])


def weights_n(twin: Twin) -> list[float]:
    """Submerged weight at the lower end of each rope."""
    return [own.W for rope in ropes(twin) for own in rope.effects if isinstance(own, Payload)]


def stiffness_n(twin: Twin) -> list[float]:
    """Axial stiffness of each rope."""
    return [float(rope.sections[rows.EA, 0]) for rope in ropes(twin)]


def nodes(twin: Twin) -> list[rows.Floats]:
    """Motion of the nodes of all ropes."""
    return [rope.state.nodes for rope in ropes(twin)]


def same(one: Twin, other: Twin) -> bool:
    """Return whether all nodes of two twins are bit-identical."""
    return all(np.array_equal(a, b) for a, b in zip(nodes(one), nodes(other), strict=True))


def test_a_saved_state_goes_on_within_the_ramp(bridle: Scene) -> None:
    """A resumed run repeats the rest of the ramp, and takes further figures over."""
    twin = Twin(bridle)
    assert not twin.submit_figures(ramp_s=4.0, **FACTORS)
    twin.advance(30)
    again = Twin.restore(twin.capture(), bridle)
    for one in (twin, again):
        one.advance(100)
    assert same(twin, again)
    for one in (twin, again):
        assert not one.submit_figures(ramp_s=0.0, axial_stiffness=0.5)
        one.advance(20)
    assert same(twin, again)


def test_another_mesh_keeps_the_figures_of_all_ropes(bridle: Scene) -> None:
    """Weight and stiffness of each stay those of the scene times the factors."""
    twin = Twin(bridle)
    weights, stiff = weights_n(twin), stiffness_n(twin)
    assert not twin.submit_figures(ramp_s=0.0, **FACTORS)
    twin.advance(2)
    twin.set_level(AccuracyLevel(2 * twin.step_ns, 1))
    twin.advance(2)
    assert weights_n(twin) == pytest.approx([1.125 * one for one in weights])
    assert stiffness_n(twin) == pytest.approx([0.75 * one for one in stiff])


def test_a_cut_system_keeps_the_figures_of_before(bridle: Scene) -> None:
    """A run that resumes after the cut of a sling is the one that was not interrupted."""
    twin = Twin(bridle)
    whole = weights_n(twin)
    assert not twin.submit_figures(ramp_s=0.0, **FACTORS)
    twin.advance(5)
    assert not twin.submit_cut(None, 3.0, "sling_port")
    twin.advance(5)
    assert twin.cut is not None
    assert sum(weights_n(twin)) == pytest.approx(1.125 * sum(whole))
    again = Twin.restore(twin.capture(), bridle)
    assert weights_n(again) == weights_n(twin)
    for one in (twin, again):
        one.advance(40)
    assert same(twin, again)
