"""Multi-line systems against a single rope: conservation, order in step, random systems.

All systems here have three ropes, so that they share one compiled step.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from cut_rigs import WATER, fallen
from hypothesis import given, settings
from hypothesis import strategies as some
from joint_rigs import JointBench, Line, Vector, cut, legs
from rigs import Rig

from rope_twin.core import state as rows
from rope_twin.core.joined.joints import LOOSE
from rope_twin.core.joined.statics import solve_joined_statics
from rope_twin.core.step import advance
from rope_twin.scene.rope_model import build
from rope_twin.twin.ropes import CutRope

ROPE = Rig(
    length=100.0, elements=40, mass=3.6, EA=1.5e6, diameter=0.05, damping=1e3, load=500.0,
    tolerance=1e-3,
)  # fmt: skip


def waved(steps: int, amplitude: float, length: float, step: float) -> rows.Boundary:
    """A hang-off that heaves amplitude·sin³(2t) and sways half as much, from rest."""
    t = step * np.arange(steps + 1)
    value, rate = np.zeros((2, steps + 1, rows.MOTIONS))
    value[:, 2] = amplitude * np.sin(2.0 * t) ** 3
    rate[:, 2] = amplitude * 6.0 * np.sin(2.0 * t) ** 2 * np.cos(2.0 * t)
    value[:, 0], rate[:, 0] = 0.5 * value[:, 2], 0.5 * rate[:, 2]
    value[:, rows.LINE] = length
    return rows.Boundary(value, rate)


def both_ways(amplitude: float, steps: int) -> tuple[Vector, JointBench, rows.Rope, Vector]:
    """Pull of one rope, and of the same rope in three parts, under the same motion."""
    rope = build(ROPE.scene())
    n = ROPE.elements
    rope.state.nodes[:3, : n + 1] = np.array([0.0, 0.0, 1.0])[:, None] * (
        rope.state.s[: n + 1] - ROPE.length
    )
    motion = waved(steps, amplitude, ROPE.length, ROPE.step)
    whole = np.zeros((steps, rows.PULL_COLUMNS))
    assert advance(rope, motion, whole, 0.0, steps) == steps
    bench = JointBench(cut(ROPE, (7, 20), (0.0, 0.0, 0.0)))
    still = bench.still(steps)
    still.value[0, :, :3], still.rate[0, :, :3] = motion.value[:, :3], motion.rate[:, :3]
    return whole, bench, rope, bench.follow(still)[0]


def test_a_rope_in_three_parts_equals_the_whole_one() -> None:
    """Massless joints at two nodes leave the equations as they are.

    Four seconds through slack and tension with sway; what is left is the Newton tolerance.
    """
    whole, bench, rope, parts = both_ways(0.1, 400)
    assert whole[:, rows.PULL].max() > 10e3
    assert np.abs(parts - whole).max() < 1e-7 * whole[:, rows.PULL].max()
    position = np.concatenate(
        [bench.nodes(2), bench.nodes(1)[:, 1:], bench.nodes(0)[:, 1:]], axis=1
    )
    assert np.abs(position - rope.state.nodes[:3, : ROPE.elements + 1]).max() < 1e-9


def test_a_rope_in_three_parts_snaps_like_the_whole_one() -> None:
    """Slack for half of the time; compared up to the first snap, before round-off has grown."""
    whole, bench, _, parts = both_ways(2.0, 100)
    assert whole[:, rows.PULL].min() < 50.0
    assert whole[:, rows.PULL].max() > 20e3
    assert np.abs(parts - whole).max() < 1e-6 * whole[:, rows.PULL].max()
    assert bench.health[rows.SUBSTEPS_UNCONVERGED] == 0


def test_connected_ends_coincide_bit_identically() -> None:
    """Position, velocity and acceleration after every step."""
    bench = JointBench(cut(ROPE, (7, 20), (0.0, 0.0, 0.0)))
    for _ in range(20):
        bench.hold(1)
        for first in (rows.POSITION, rows.VELOCITY, rows.ACCELERATION):
            for upper, lower in ((0, 1), (1, 2)):
                assert (bench.nodes(upper, first)[:, 0] == bench.nodes(lower, first)[:, -1]).all()


def star(seed: int) -> JointBench:
    """Three ropes connected at a joint, with loads at their ends, flying freely."""
    random = np.random.default_rng(seed)
    lines = []
    for angle in (0.0, 2.1, 4.2):
        rig = Rig(
            length=10.0, elements=6, mass=2.0, EA=1e5, diameter=0.03, load=random.uniform(10, 40),
            gravity=0.0, step=0.001, tolerance=1e-4,
        )  # fmt: skip
        end = (10.02 * math.cos(angle), 10.02 * math.sin(angle), random.uniform(-3.0, 3.0))
        lines.append(Line(rig=rig, low=end, high=(0.0, 0.0, 0.0), upper=0))
    bench = JointBench(lines)
    spin, drift = random.normal(0.0, 0.3, 3), random.normal(0.0, 1.0, 3)
    for r in range(3):
        bench.nodes(r, rows.VELOCITY)[:] = np.cross(spin, bench.nodes(r).T).T + drift[:, None]
    bench.system.joints.nodes[rows.VELOCITY : rows.VELOCITY + 3, 0] = drift
    return bench


def balance(bench: JointBench) -> tuple[Vector, Vector, float]:
    """Momentum, angular momentum and energy of a bench without weight."""
    momentum, spin, energy = np.zeros(3), np.zeros(3), 0.0
    for r, line in enumerate(bench.lines):
        x, v = bench.nodes(r), bench.nodes(r, rows.VELOCITY)
        rope = bench.system.ropes[r]
        own = np.diff(rope.state.s[: x.shape[1]])
        mass = 0.5 * line.rig.mass * (np.append(own, 0.0) + np.append(0.0, own))
        mass[0] += line.rig.load
        momentum += v @ mass
        spin += np.cross(x.T, v.T).T @ mass
        strain = np.linalg.norm(np.diff(x), axis=0) / own - 1.0
        energy += 0.5 * float(mass @ (v * v).sum(axis=0))
        energy += 0.5 * line.rig.EA * float(own @ np.maximum(strain, 0.0) ** 2)
    return momentum, spin, energy


@pytest.mark.parametrize("seed", [1, 2])
def test_a_free_star_conserves_momentum_and_energy(seed: int) -> None:
    """No hang-off: momentum to round-off, angular momentum and energy to the scheme's order."""
    bench = star(seed)
    momentum, spin, energy = balance(bench)
    bench.hold(1000)
    after, spin_after, energy_after = balance(bench)
    assert after == pytest.approx(momentum, rel=1e-9)
    assert np.linalg.norm(spin_after - spin) < 1e-4 * np.linalg.norm(spin)
    assert energy_after <= energy * (1.0 + 1e-9)
    assert energy_after == pytest.approx(energy, rel=2e-3)


def test_a_multi_line_system_is_of_second_order_in_the_step() -> None:
    """A smooth motion at steps h, h/2 and h/4 against h/16: the error falls by four."""

    def end(step: float) -> Vector:
        base = replace(ROPE, length=10.0, elements=5, mass=2.0, step=step, tolerance=1e-8, EA=1e5)
        bench = JointBench(legs(base, base, (-6.0, 0.0, 0.0), (6.0, 0.0, 0.0), EA=1e5))
        bench = JointBench([replace(line, rig=replace(line.rig, step=step, tolerance=1e-8))
                            for line in bench.lines])  # fmt: skip
        solve_joined_statics(bench.system, bench.still(0).value[:, 0])
        steps = round(1.0 / step)
        t = step * np.arange(steps + 1)
        motion = bench.still(steps)
        motion.value[0, :, 2] += 0.2 * (1.0 - np.cos(2.0 * t)) ** 2
        motion.rate[0, :, 2] = 0.8 * (1.0 - np.cos(2.0 * t)) * np.sin(2.0 * t)
        bench.follow(motion)
        return np.concatenate([bench.joints.ravel(), bench.nodes(2)[:, 0]])

    exact = end(0.02 / 16)
    errors = [np.linalg.norm(end(step) - exact) for step in (0.02, 0.01, 0.005)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.85).all()
    assert (orders < 2.3).all()


@settings(max_examples=15, deadline=None)
@given(
    masses=some.lists(some.floats(0.0, 2e4), min_size=3, max_size=3),
    slack=some.lists(some.floats(0.8, 1.5), min_size=3, max_size=3),
    heave=some.floats(0.0, 3.0),
    between=some.booleans(),
)
def test_random_systems_stay_finite(
    masses: list[float], slack: list[float], heave: float, between: bool
) -> None:
    """Ropes too short or too long for their ends, with or without loads, in motion."""
    positions = [(-5.0, 0.0, 0.0), (5.0, 1.0, 0.0), (0.0, 0.0, -15.0), (2.0, 0.0, -25.0)]
    ends = [(0, 2, LOOSE, 0), (1, 2, LOOSE, 0), (2, 3, 0, LOOSE)]
    if between:
        ends = [(0, 2, LOOSE, 0), (1, 3, LOOSE, 1), (2, 3, 0, 1)]
    lines = []
    for (top, foot, upper, lower), mass, more in zip(ends, masses, slack, strict=True):
        high, low = positions[top], positions[foot]
        rig = Rig(length=more * math.dist(high, low), elements=8, mass=3.0, EA=2e7,
                  diameter=0.04, damping=2e4, load=mass, step=0.02)  # fmt: skip
        lines.append(Line(rig=rig, low=low, high=high, lower=lower, upper=upper))
    bench = JointBench(lines)
    motion = bench.still(100)
    t = 0.02 * np.arange(101)
    motion.value[:2, :, 2] += heave * np.sin(t) ** 2
    motion.rate[:2, :, 2] = heave * np.sin(2.0 * t)
    pull = bench.follow(motion)
    assert np.isfinite(pull).all()
    for r in range(3):
        assert np.isfinite(bench.nodes(r)).all()
        assert (bench.tension(r) >= 0.0).all()


def test_a_fallen_part_equals_a_rope_on_a_free_joint() -> None:
    """Its end is free: the twin's own step against the joints', in a current."""
    rig = replace(WATER, current=((0.0, (0.8, 0.0)), (-300.0, (0.2, 0.4))), tolerance=1e-3)
    twin = rig.twin()
    twin.split(120.0)  # at a node
    lengths = replace(rig, length=120.0, elements=12)
    bench = JointBench([Line(rig=lengths, low=(0.0,) * 3, high=(0.0,) * 3, upper=0)])
    bench.system.ropes[0].state.nodes[:, :13] = fallen(twin).state.nodes[:, :13]
    bench.system.joints.nodes[:, 0] = fallen(twin).state.nodes[:, 12]
    assert isinstance(twin.inspect().ropes, CutRope)
    twin.inspect().ropes._fresh = False  # the bench takes its first step in one piece
    for _ in range(40):
        twin.advance(10)
        bench.hold(10)
        apart = np.abs(fallen(twin).state.nodes[:3, :13] - bench.nodes(0)).max()
        assert apart < 2e-6 * WATER.length, "found 6e-7: the end's tangent is that of its last step"
