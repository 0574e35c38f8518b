"""Linear solve of multi-line systems against a dense one: trees, loops and links."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from joint_rigs import STIFF, JointBench, Line, Vector, legs, tie

from rope_twin.core import state as rows
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.joined.joints import (
    ANCHORED,
    AXIAL,
    GEOMETRIC,
    LOOSE,
    SECOND,
    TOWARDS,
    Joined,
    System,
    add_ties,
    clear,
    gather_ends,
    renew_plan,
)
from rope_twin.core.joined.linear_solver import reduce_system, solve_system
from rope_twin.core.joined.plan import (
    A_WAY,
    B_WAY,
    BETWEEN,
    COUNT,
    DENSE,
    ONTO,
    ROOTS,
    SPANS,
    A,
    B,
)

RESIDUAL = slice(rows.RESIDUAL, rows.RESIDUAL + 3)
CORRECTION = slice(rows.CORRECTION, rows.CORRECTION + 3)
PLACES = [(0.0, 0.0, 0.0), (9.0, 0.0, 0.0), (4.0, 1.0, -9.0), (4.0, 0.0, -19.0), (0.0, 3.0, -30.0)]
# Ropes as elements, place and connection at the lower end, the same at the upper end:
Ends = tuple[int, int, int, int, int]
SYSTEMS: dict[str, list[Ends]] = {
    "a free rope": [(7, 2, LOOSE, 0, LOOSE)],
    "two ropes that do not meet": [(2, 2, LOOSE, 0, LOOSE), (5, 3, LOOSE, 1, LOOSE)],
    "a cut rope": [(4, 2, 0, 0, LOOSE), (3, 3, 1, 2, 0), (9, 4, LOOSE, 3, 1)],
    "short ropes": [(2, 2, 0, 0, LOOSE), (2, 2, 0, 1, LOOSE), (2, 3, LOOSE, 2, 0)],
    "a star": [(3, 3, LOOSE, 2, 0), (6, 4, LOOSE, 2, 0), (5, 2, 0, 1, LOOSE), (70, 2, 0, 0, LOOSE)],
    "a tree": [
        (6, 2, 0, 0, LOOSE), (4, 3, 1, 2, 0), (5, 3, 2, 2, 0), (2, 4, LOOSE, 3, 1),
        (3, 4, LOOSE, 3, 1), (8, 4, LOOSE, 3, 2),
    ],
    "a loop": [(5, 2, 0, 0, LOOSE), (4, 3, 1, 2, 0), (5, 3, 1, 2, 0), (3, 4, LOOSE, 3, 1)],
    "two loops": [
        (5, 2, 0, 0, LOOSE), (2, 3, 1, 2, 0), (3, 3, 1, 2, 0), (4, 4, 2, 3, 1), (4, 4, 2, 3, 1),
    ],
    "a closed rope": [(5, 2, 0, 0, LOOSE), (6, 2, 0, 2, 0)],
}  # fmt: skip
HELD = {"a cut rope": 2, "two ropes that do not meet": 1}  # a rope with a fixed lower end


@jit_entry
def solve(system: Any, again: bool) -> None:
    """Return corrections for the residuals; again: by the factors of the last call."""
    clear(system.joints)
    gather_ends(system)
    add_ties(system.joints.ties, system.joints.work, system.joints.matrix)
    if again:
        reduce_system(system)
    else:
        solve_system(system)


def system_of(name: str, tied: Vector | None = None) -> System:
    lines = [
        Line(
            rig=replace(STIFF, elements=n, length=10.0), low=PLACES[foot], high=PLACES[head],
            lower=low, upper=high, held=HELD.get(name) == r,
        )
        for r, (n, foot, low, head, high) in enumerate(SYSTEMS[name])
    ]  # fmt: skip
    return JointBench(lines, tied).system


def fill(system: System, seed: int) -> None:
    """Fill in random elements, blocks and residuals; stiffness over mass up to 1e5."""
    random = np.random.default_rng(seed)
    for rope in system.ropes:
        work, n = rope.work, int(rope.state.counts[rows.ELEMENTS])
        t = random.normal(size=(3, n))
        work[rows.DIRECTION : rows.DIRECTION + 3, :n] = t / np.linalg.norm(t, axis=0)
        work[rows.AXIAL, :n] = 10.0 ** random.uniform(-1, 5, n)
        work[rows.GEOMETRIC, :n] = 10.0 ** random.uniform(-2, 1, n)
        for i in range(n + 1):
            part = random.normal(size=(3, 3))
            block = part @ part.T + 0.1 * np.eye(3)
            work[rows.BLOCK : rows.BLOCK + 6, i] = block[np.triu_indices(3)]
    for rope in system.ropes:
        rope.work[RESIDUAL] = random.normal(size=rope.work[RESIDUAL].shape)


def unknowns(system: System) -> list[list[int]]:
    """Return the unknown of each node of each rope, -1 where its motion is prescribed."""
    joints, found = system.joints, []
    count = joints.nodes.shape[1]
    for r, rope in enumerate(system.ropes):
        n = int(rope.state.counts[rows.ELEMENTS])
        own = list(range(count, count + n + 1))
        count += n + 1
        if joints.lower[r] != LOOSE:
            own[0] = int(joints.lower[r])
        elif rope.model.first_free == 1:
            own[0] = -1
        own[n] = int(joints.upper[r])
        found.append(own)
    return found


def dense(system: System) -> list[Vector]:
    """Return the dense solution for all nodes of every rope, (3, n + 1) each."""
    at = unknowns(system)
    size = 3 * (1 + max(max(own) for own in at))
    matrix, right = np.zeros((size, size)), np.zeros(size)

    def add(a: int, b: int, block: Vector) -> None:
        if min(a, b) >= 0:
            matrix[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] += block

    for rope, own in zip(system.ropes, at, strict=True):
        work = rope.work
        for i, a in enumerate(own):
            block = np.zeros((3, 3))
            block[np.triu_indices(3)] = work[rows.BLOCK : rows.BLOCK + 6, i]
            add(a, a, block + np.triu(block, 1).T)
            if a >= 0:
                right[3 * a : 3 * a + 3] += work[RESIDUAL, i]
        for e, (a, b) in enumerate(pairwise(own)):
            t = work[rows.DIRECTION : rows.DIRECTION + 3, e]
            K = work[rows.AXIAL, e] * np.outer(t, t) + work[rows.GEOMETRIC, e] * np.eye(3)
            for c, d, sign in ((a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)):
                add(c, d, sign * K)
    for link in system.joints.ties.T:
        t = link[TOWARDS : TOWARDS + 3]
        K = link[AXIAL] * np.outer(t, t) + link[GEOMETRIC] * np.eye(3)
        assert link[SECOND] == ANCHORED
        add(0, 0, K)
    free = np.diag(matrix) > 0.0
    x = np.zeros(size)
    x[free] = np.linalg.solve(matrix[np.ix_(free, free)], right[free])
    x = np.append(x, np.zeros(3)).reshape(-1, 3).T
    return [x[:, own] for own in at]


def largest_difference(system: System) -> float:
    """Return the largest difference to the dense corrections, relative to the largest."""
    expected = dense(system)
    scale = max(float(np.abs(one).max()) for one in expected)
    return max(
        float(np.abs(rope.work[CORRECTION, : one.shape[1]] - one).max()) / scale
        for rope, one in zip(system.ropes, expected, strict=True)
    )


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_system_solve_equals_the_dense_solve(name: str) -> None:
    system = system_of(name)
    renew_plan(system)
    joined = Joined(system.stack, system.joints, None)
    # a rope in a loop leaves a difference on its connections: their mass is resolved to 1e-16·K
    error = 1e-6 if system.joints.plan.sizes[BETWEEN] else 1e-9
    for seed in range(3):
        fill(system, 10 * seed)
        solve(joined, False)
        assert largest_difference(system) < error
        for rope in system.ropes:
            rope.work[RESIDUAL] *= rope.work[RESIDUAL]
        assert largest_difference(system) > 0.1
        solve(joined, True)
        assert largest_difference(system) < error


def test_each_mesh_has_its_own_elimination_plan() -> None:
    """A plan is found again for the same mesh, and not used for another."""
    tree, loop = system_of("a tree"), system_of("a loop")
    renew_plan(tree)
    renew_plan(loop)
    plan = tree.joints.plan
    spans, ends = plan.spans.copy(), plan.ends.copy()
    elements = tree.stack.counts[:, rows.ELEMENTS]
    elements[0] -= 2
    assert renew_plan(tree)
    assert not np.array_equal(plan.spans, spans)
    elements[0] += 2
    assert renew_plan(tree)
    plan.spans[plan.sizes[SPANS] :] = spans[plan.sizes[SPANS] :]  # rows not in use
    assert np.array_equal(plan.spans, spans)
    assert np.array_equal(plan.ends, ends)


def test_a_tether_enters_the_reduced_system() -> None:
    """The tie belongs to the connection onto which the trees are eliminated."""
    held = tie(0, anchor=(0.0, 0.0, -20.0))
    held[TOWARDS : TOWARDS + 3, 0], held[AXIAL, 0], held[GEOMETRIC, 0] = (0.6, 0.0, 0.8), 40.0, 3.0
    system = system_of("a tree", held)
    renew_plan(system)
    fill(system, 5)
    solve(Joined(system.stack, system.joints, None), False)
    assert largest_difference(system) < 1e-9
    assert system.joints.plan.sizes[[ROOTS, BETWEEN, ONTO, DENSE]].tolist() == [0, 0, 3, 1]


def test_equal_legs_are_eliminated_in_parallel() -> None:
    """Three legs of equal length take half of their nodes' time, all but the root."""
    rig = replace(STIFF, length=20.0, elements=100)
    lines = legs(rig, rig, (-6.0, 0.0, 0.0), (6.0, 0.0, 0.0))
    system = JointBench([replace(line, rig=rig) for line in lines]).system
    assert renew_plan(system)
    assert not renew_plan(system)
    plan = system.joints.plan
    spans = plan.spans[: plan.sizes[SPANS]]
    assert 149 <= spans[:, COUNT].sum() <= 151
    lanes = ((A, A_WAY), (B, B_WAY))
    nodes = {
        int(span[first] + k * span[way]) for span in spans for first, way in lanes
        for k in range(span[COUNT])
    }  # fmt: skip
    assert len(nodes) == 298
    assert plan.sizes[[ROOTS, BETWEEN, ONTO, DENSE]].tolist() == [1, 0, 0, 0]
