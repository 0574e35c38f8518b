"""Static equilibrium with every effect, from any guess.

Unknown are the forces S_e that the elements pass on, not the places of the nodes: for given loads
f the balance S_i - S_{i-1} + f_i = 0 fixes them (a fixed lower end leaves three numbers, which
close the chain: a convex problem), and the shape follows by laying the elements along their
forces, x_{e+1} - x_e = l(|S_e|)·S_e/|S_e|. That is the compliance form: a stiff element is no
harder than a soft one, nothing is ever slack in between, and the guess only serves to find the
first loads. Two ways lead to loads that belong to the shape: taking them from the last shape
(fast where weight rules), and Newton with the loads' own change with the shape, which is not
symmetric (drag turns with the tangent). Where both fail, the dynamic step with growing steps
brings the rope nearer, and they try again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rope_twin.core.state import (
    NODE_ROWS,
    PULL_COLUMNS,
    SUBSTEPS_UNCONVERGED,
    VELOCITY,
    Floats,
    Rope,
)
from rope_twin.core.static_forces import Elastic, StillRope
from rope_twin.core.static_shape import (
    STUCK,
    Shape,
    element_forces,
    first_forces,
    largest,
    newton_change,
    shape_of,
)
from rope_twin.core.step import advance

ROUNDS = 60  # of either way; seen: 1 to 4 by weight, up to 9 in strong currents
ENOUGH = 1e-7  # of the largest tension: a rope left with this much force at a node rests
TOLERANCE_N = 1e-6  # enough as well, where tensions are tiny
ROUND_OFF = 4.0 * float(np.finfo(float).eps)  # of the places, in the length of an element
OFF = 1e-6  # of it: a tension this far from the tangent asks for a new one
SURE = 2  # rounds that ask anyway: nearer to the tension in question it is more exact
DEEP = 1e-11  # of it: what is missed by the balance when rounds end; round-off leaves 1e-14
FAST = 0.3  # loads of the last shape serve while each round leaves less than this part
RELAXATIONS, STEP_FIRST, STEP_LAST, STEP_LEAST, GROWTH, SHRINK = 30, 1.0, 3e3, 1e-4, 4.0, 0.1
ATTEMPTS = 5  # of relaxing and Newton in turns


class Equilibrium(NamedTuple):
    """How the search for rest ended."""

    found: bool
    residual_n: float  # largest force left on a node; not finite: neither are the forces
    tension_n: float  # largest tension
    left_m: float  # how far a node may still be from rest: the last move times its gain
    rounds: int


def find_equilibrium(rope: Rope, L: float) -> float:
    """Move the nodes to equilibrium at line out L; returns how far they may still be off [m].

    Infinite: no equilibrium is within reach; `settle` tells more.
    """
    end = settle(rope, L)
    return end.left_m if end.found else float("inf")


def settle(rope: Rope, L: float) -> Equilibrium:
    """Move the nodes to equilibrium at line out L [m].

    The hang-off stays where it is. Without equilibrium the nodes end at the best shape found. The
    counts of the solver's health start from zero afterwards, length offsets of events are gone.
    """
    rope.state.offset[:] = 0.0
    still = StillRope(rope, L)
    with np.errstate(all="ignore"):  # a shape that overflows is one that is no better
        best, place = _settle_forces(still), still.place.copy()
        for attempt in range(ATTEMPTS):
            if best.found or not np.isfinite(best.residual_n):
                break
            end = _relax(rope, still, STEP_LAST * SHRINK**attempt)
            near = still.place.copy()
            best, place = _better(still, end, best, place)
            if not end.found:
                best, place = _better(still, _settle_forces(still, near=True), best, place)
                still.rest_at(near)
        still.rest_at(place)
    return best


def _better(
    still: StillRope, end: Equilibrium, best: Equilibrium, place: Floats
) -> tuple[Equilibrium, Floats]:
    """The search that just ended, with its shape, or the best one before it."""
    if end.found or end.residual_n < best.residual_n:
        return end, still.place.copy()
    return best, place


def _settle_forces(still: StillRope, near: bool = False) -> Equilibrium:
    """From the shape that the nodes are in; leaves them in the best one.

    `near`: the elements already pull about as they will, so Newton can begin with their forces.
    """
    place = still.place.copy()
    law = still.elastic()
    forces = still.forces(place)
    residual, tension = largest(forces.total), float(forces.tension.max())
    round_off = _round_off(still, law)
    if residual <= max(TOLERANCE_N, round_off, ENOUGH * tension):
        still.rest_at(place)
        return Equilibrium(True, residual, tension, 0.0, 0)
    if not np.isfinite(residual):
        return Equilibrium(False, residual, tension, np.inf, 0)
    hold = place[:, 0].copy() if still.first else None
    S = element_forces(place, forces) if near else first_forces(still, hold, forces.load)
    shape = shape_of(still, law, hold, S)
    move, newton, rounds, found = np.inf, near, 0, False
    while rounds < ROUNDS and np.isfinite(shape.size):
        rounds += 1
        if rounds <= SURE or _is_off(law, shape):
            law = _refresh(still, law, shape)
        change = newton_change(still, law, shape) if newton else -np.cumsum(shape.miss, axis=1)
        following, share = _search(still, law, hold, shape, change)
        better = following.size < shape.size
        quick = following.size < FAST * shape.size
        moved = largest(following.place - shape.place)
        if better:
            move = moved * following.size / shape.size
            shape = following
        elif not np.isfinite(move):  # the first shape was right but for round-off
            move = moved
        tension = float(shape.forces.tension.max())
        found = shape.residual <= max(TOLERANCE_N, round_off, ENOUGH * tension)
        if found and not (quick and shape.size > DEEP * tension):
            break
        if newton and share < STUCK:
            break
        newton = newton or not quick
    still.rest_at(shape.place)
    return Equilibrium(found, shape.residual, tension, move, rounds)


def _round_off(still: StillRope, law: Elastic) -> float:
    """Force that round-off of the places makes of an element's length [N]."""
    reach = float(np.abs(still.place[:, -1]).max() + still.rest.sum())
    return ROUND_OFF * float(law.stiffness.max()) * reach


def _is_off(law: Elastic, shape: Shape) -> bool:
    """Whether tensions are others than the law said: it is a tangent, the rope may have a table."""
    size = np.sqrt((shape.S * shape.S).sum(axis=0))
    return bool((np.abs(shape.forces.tension - size) > OFF * size.max()).any())


def _refresh(still: StillRope, law: Elastic, shape: Shape) -> Elastic:
    """The elements' tangent at the shape's lengths; that of before where they are slack."""
    length = np.sqrt((np.diff(shape.place, axis=1) ** 2).sum(axis=0))
    new = still.elastic(np.maximum(length, still.rest))
    taut = new.stiffness > 0.0
    return Elastic(
        np.where(taut, new.slack, law.slack), np.where(taut, new.stiffness, law.stiffness)
    )


def _search(
    still: StillRope, law: Elastic, hold: Floats | None, shape: Shape, change: Floats
) -> tuple[Shape, float]:
    """The shape after the largest share of the change that lessens the miss, and the share."""
    share = 1.0
    while True:
        following = shape_of(still, law, hold, shape.S + share * change)
        if following.size <= (1.0 - 1e-4 * share) * shape.size or share < STUCK:
            return following, share
        share *= 0.5


def _relax(rope: Rope, still: StillRope, longest: float) -> Equilibrium:
    """Rest by dynamic steps that grow up to the longest [s], with zero velocity after each.

    Each is a Newton solve of the convex energy with the mass over the step squared as a
    regulariser: slow, but slack elements, which carry no force and so have no direction, are no
    harder for it than taut ones.
    """
    law, boundary = still.elastic(still.rest * 1.001), still.boundary
    round_off = _round_off(still, law)
    model = rope.model._replace(
        split_above=np.inf, merge_below=0.0, tolerance=max(TOLERANCE_N, round_off)
    )
    pull = np.zeros((1, PULL_COLUMNS))
    nodes, health, step = rope.state.nodes, rope.state.health, STEP_FIRST
    end, last = Equilibrium(False, np.inf, 0.0, np.inf, 0), np.inf
    for rounds in range(RELAXATIONS):
        before = still.place.copy()
        nodes[VELOCITY:NODE_ROWS] = 0.0
        health[:] = 0
        done = advance(rope._replace(model=model._replace(step=step)), boundary, pull, 0.0, 1)
        if done < 1 or health[SUBSTEPS_UNCONVERGED] > 0:
            still.rest_at(before)
            step *= SHRINK
            if step < STEP_LEAST:
                break
            continue
        place = still.place.copy()
        end = _rest_at(still, place, largest(place - before), rounds, round_off)
        if end.found and not end.left_m < FAST * last:  # no nearer: round-off
            break
        last = end.left_m if end.found else np.inf
        step = min(step * GROWTH, longest)
    return end


def _rest_at(
    still: StillRope, place: Floats, move: float, rounds: int, round_off: float
) -> Equilibrium:
    """What is left of forces at `place`, where the nodes then are."""
    forces = still.forces(place)
    still.rest_at(place)
    residual, tension = largest(forces.total), float(forces.tension.max())
    found = residual <= max(TOLERANCE_N, round_off, ENOUGH * tension)
    return Equilibrium(found, residual, tension, move, rounds)
