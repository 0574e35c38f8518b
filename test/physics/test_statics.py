"""Static equilibrium: nodal balance recomputed in numpy, for drawn ropes, waters and guesses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from rigs import Rig, Vector

from benchmarks.statics_speed import GUESSES as STUDY_GUESSES
from benchmarks.statics_speed import ON_A_BED, statics_rows
from rope_twin.core import state as rows
from rope_twin.core.state import Rope
from rope_twin.core.statics import solve_statics
from rope_twin.core.still_rope import Equilibrium
from rope_twin.errors import SceneError
from rope_twin.scene.rope_model import build
from rope_twin.twin.statics import solve_scene_statics

ENOUGH = 1e-6  # of the largest tension, mostly the top one: the largest force left at a node
ROUND_OFF = 8.0 * float(np.finfo(float).eps)  # of a place in the water, in an element's length


def drag_forces(rig: Rig, place: Vector, along: Vector, rest: Vector) -> Vector:
    """Morison's cross-flow drag of still nodes, tangents the mean of their elements'; (3, n).

    A rope folded back on itself has no tangent: 1e-12 keeps the mean off 0/0, as in the step.
    """
    mean = along.copy()
    mean[:, 1:] += along[:, :-1]
    tangent = mean / np.sqrt((mean * mean).sum(axis=0) + 1e-12)
    heights = [z for z, _ in reversed(rig.current)]
    water = np.zeros_like(tangent)
    for k in (0, 1):
        speeds = [velocity[k] for _, velocity in reversed(rig.current)]
        water[k] = np.interp(place[2, :-1], heights, speeds)
    skin = (water * tangent).sum(axis=0) * tangent
    across = water - skin
    lump = 0.5 * (rest + np.concatenate([[0.0], rest[:-1]]))
    p = 0.5 * rig.density * rig.diameter * lump
    force = p * rig.drag[0] * np.linalg.norm(across, axis=0) * across
    force += p * math.pi * rig.drag[1] * np.linalg.norm(skin, axis=0) * skin
    force[2] -= rig.weight * lump
    if rig.fixed_at is None:
        area = np.array(rig.area)
        force[:, 0] += 0.5 * rig.density * area * np.linalg.norm(water[:, 0]) * water[:, 0]
        force[2, 0] -= rig.load_weight
    return np.asarray(force)


def left_over(rig: Rig, rope: Rope) -> tuple[float, float]:
    """Largest unbalanced force at a node and largest tension [N], from the places alone."""
    n = rig.elements
    position = rope.state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1]
    rest = np.full(n, rig.length / n)
    span = np.diff(position, axis=1)
    length = np.linalg.norm(span, axis=0)
    along = span / length
    tension = np.maximum(rig.EA * (length - rest) / rest, 0.0)
    force = drag_forces(rig, position, along, rest) + tension * along
    force[:, 1:] -= (tension * along)[:, :-1]
    if rig.fixed_at is not None:
        force[:, 0] = 0.0
    return float(np.linalg.norm(force, axis=0).max()), float(tension.max())


Guess = Callable[[Vector, Rig], None]


def as_built(place: Vector, rig: Rig) -> None:
    """Straight down, or straight to the fixed end."""


def horizontal(place: Vector, rig: Rig) -> None:
    """Straight out at the hang-off's height."""
    place[:, :-1] = 0.0
    place[0, :-1] = np.linspace(rig.length, 0.0, place.shape[1])[:-1]


def half_down(place: Vector, rig: Rig) -> None:
    """Straight down to half the length: slack all over."""
    place[:, :-1] *= 0.5


def coiled(place: Vector, rig: Rig) -> None:
    """A coil of 3 m radius that sinks slowly."""
    s = np.linspace(rig.length, 0.0, place.shape[1])
    place[:] = 3.0 * np.cos(s / 3.0) - 3.0, 3.0 * np.sin(s / 3.0), -0.01 * s


def upward(place: Vector, rig: Rig) -> None:
    """Standing on its head."""
    place[2] *= -1.0


def folded(place: Vector, rig: Rig) -> None:
    """Down and back up to the hang-off."""
    s = np.linspace(rig.length, 0.0, place.shape[1])
    place[:] = 0.3 * s, 0.0 * s, -np.minimum(s, rig.length - s)


GUESSES: list[Guess] = [as_built, horizontal, half_down, coiled, upward, folded]


def rest_of(rig: Rig, guess: Guess = as_built) -> tuple[Rope, Equilibrium]:
    """The rig's rope at rest, from a guess; a fixed lower end stays where it is."""
    rope = build(rig.scene())
    position = rope.state.nodes[rows.POSITION : rows.POSITION + 3, : rig.elements + 1]
    low = position[:, 0].copy()
    guess(position, rig)
    if rig.fixed_at is not None:
        position[:, 0] = low
    return rope, solve_statics(rope, rig.length)


def check(rig: Rig, guess: Guess) -> None:
    """At rest to 1e-6 of the largest tension, or to what round-off of places makes of forces."""
    rope, end = rest_of(rig, guess)
    left, top = left_over(rig, rope)
    element = rig.length / rig.elements
    round_off = ROUND_OFF * rig.EA / element * (rig.length + float(np.abs(rope.state.nodes).max()))
    assert left <= max(ENOUGH * top, round_off)
    assert end.found
    assert end.tension_n >= 0.999 * top
    assert end.residual_n == pytest.approx(left, abs=round_off)


ropes = st.builds(
    Rig,
    length=st.floats(20.0, 6000.0),
    elements=st.integers(3, 150),
    mass=st.floats(1.5, 25.0),
    EA=st.sampled_from([5e6, 65e6, 235e6, 6.5e10]),
    diameter=st.floats(0.02, 0.08),
    density=st.just(1025.0),
    load=st.floats(600.0, 1e5),
    volume=st.floats(0.0, 0.5),
    area=st.tuples(*[st.floats(0.0, 20.0)] * 3),
    added=st.just((1e3, 1e3, 2e3)),
    drag=st.tuples(st.floats(0.0, 2.5), st.floats(0.0, 0.05)),
    added_mass=st.just(1.0),
    current=st.tuples(
        st.tuples(st.just(0.0), st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))),
        st.tuples(st.just(-300.0), st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))),
        st.tuples(st.just(-3000.0), st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))),
    ),
)


@settings(max_examples=80, deadline=None)
@given(rig=ropes, guess=st.sampled_from(GUESSES))
def test_a_rope_with_a_payload_is_in_static_equilibrium(rig: Rig, guess: Guess) -> None:
    """Whatever the rope, the water and the guess: heavy, light, floating, in storm currents.

    Left out is what a twin refuses: a rope that floats with more than its payload weighs.
    """
    assume(rig.load_weight + min(rig.weight, 0.0) * rig.length > 0.1 * rig.load_weight)
    check(rig, guess)


@settings(max_examples=60, deadline=None)
@given(
    rig=ropes,
    guess=st.sampled_from(GUESSES),
    slack=st.floats(0.99, 3.0),
    bearing=st.floats(0.0, 6.3),
    dip=st.floats(0.0, 1.3),
)
def test_a_rope_between_two_points_is_in_static_equilibrium(
    rig: Rig, guess: Guess, slack: float, bearing: float, dip: float
) -> None:
    """From taut to three times the distance between its ends, up to 75° steep.

    Steeper and in still water a slack rope turns back on itself within an element, which then
    carries nothing: the dynamic steps find that, but not always to 1e-6.
    """
    far = rig.length / slack
    low = np.array([math.cos(bearing) * math.cos(dip), math.sin(bearing) * math.cos(dip), -math.sin(dip)])  # fmt: skip # noqa: E501
    x, y, z = (float(far * c) for c in low)
    check(replace(rig, fixed_at=(x, y, z)), guess)


DEEP = Rig(
    length=2000.0, elements=1000, density=1025.0, volume=3.0, drag=(1.2, 0.03), added_mass=1.0,
    area=(4.0, 4.0, 6.0), current=((0.0, (0.8, 0.0)), (-2000.0, (0.1, 0.2))),
)  # fmt: skip
LIGHT = replace(DEEP, load=550.0, volume=0.5, drag=(1.5, 0.05), current=((0.0, (2.0, 0.0)),))


@pytest.mark.parametrize("rig", [DEEP, LIGHT], ids=["20 t", "50 kg in 2 m/s"])
def test_all_initial_guesses_give_one_static_shape(rig: Rig) -> None:
    """1,000 elements, to a micrometre, within a dozen rounds (one costs some 3 ms at most)."""
    positions = []
    for guess in GUESSES:
        rope, end = rest_of(rig, guess)
        assert end.rounds <= 12
        assert end.left_m <= 1e-9 * rig.length
        positions.append(rope.state.nodes[:3, : rig.elements + 1].copy())
    assert np.abs(np.array(positions) - positions[0]).max() < 1e-6


def test_statics_leave_an_equilibrium_unchanged() -> None:
    """A second search starts at rest and moves nothing; so does a slack rope without weight."""
    rope, _ = rest_of(DEEP)
    before = rope.state.nodes.copy()
    assert solve_statics(rope, DEEP.length).rounds == 0
    assert (rope.state.nodes == before).all()
    neutral = replace(DEEP, density=0.0, gravity=0.0, fixed_at=(500.0, 0.0, -300.0))
    rope, end = rest_of(neutral)
    assert (end.found, end.rounds, end.tension_n) == (True, 0, 0.0)


def test_missing_equilibrium_is_reported() -> None:
    """Forces that are not finite leave no shape at rest: one sentence, and no start."""
    scene = replace(DEEP, elements=10).scene()
    rope = build(scene)
    rope.state.nodes[2, 3] = np.nan
    with pytest.raises(
        SceneError, match=r"no static equilibrium \(forces on the rope are not finite\); check"
    ):
        solve_scene_statics(scene, rope)


def test_static_equilibrium_on_a_seabed_from_any_guess() -> None:
    """Moored partly on the bed, slack on it, landed, with loose rope beside: one tension, at rest.

    300 elements; how a slack moored rope ends is a catenary of no horizontal pull: T_top = w·h.
    """
    computed = list(statics_rows(ON_A_BED, nodes=300))
    assert all(row["found"] and row["residual_n"] < 1e-7 * row["tension_n"] for row in computed)
    assert max(row["rounds"] for row in computed) <= 40  # one costs 2 ms with 1,000 elements
    for name in ON_A_BED:
        tensions = [row["tension_n"] for row in computed if row["scene"] == name]
        assert tensions == pytest.approx([tensions[0]] * len(tensions), rel=1e-6)
        if name == "moored slack":
            weight = (20.0 - 1025.0 * math.pi * 0.05**2 / 4.0) * 9.80665
            element = 345.0 / 300.0  # the topmost tells of its middle, the lowest half lies
            assert weight * (100.0 - 1.5 * element) < tensions[0] < weight * 100.0


def test_statics_timing_rows_have_scene_guess_and_residual() -> None:
    """`statics_rows`: every guess ends at rest in the same tension; times are shown, not judged."""
    computed = list(statics_rows(["smooth_2km"], nodes=100))
    assert [row["guess"] for row in computed] == list(STUDY_GUESSES)
    assert all(row["found"] and row["residual_n"] < 1e-6 * row["tension_n"] for row in computed)
    tensions = [row["tension_n"] for row in computed]
    assert tensions == pytest.approx([tensions[0]] * len(tensions), rel=1e-8)
