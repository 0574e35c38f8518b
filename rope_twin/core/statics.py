"""Static equilibrium: the dynamic step itself, from rest, with steps that grow without bound.

A TR-BDF2 step from rest is a Newton solve of the convex energy with the mass over the step squared
as a regulariser; with the velocity set to zero after each and the step growing, it becomes the
static problem. It starts from any shape, slack ropes included, and needs no code of its own.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.state import (
    EA,
    ELEMENTS,
    LINE,
    MOTIONS,
    NODE_ROWS,
    POSITION,
    PULL_COLUMNS,
    SUBSTEPS_UNCONVERGED,
    VELOCITY,
    Boundary,
    C,
    Rope,
)
from rope_twin.core.step import advance

ROUNDS = 150
STEP_FIRST, STEP_LAST, STEP_LEAST = 1.0, 3e3, 1e-4  # s
GROWTH, SHRINK = 4.0, 0.1
TOLERANCE_N = 1e-6
SMALL = 1e-12  # of the line out: a last move that ends the search
ENOUGH, PATIENCE = 1e-6, 10  # so does this move, once it has not halved for so many rounds


def find_equilibrium(rope: Rope, L: float) -> float:
    """Move the nodes to equilibrium at line out L; returns the largest last move [m].

    The hang-off stays where it is. A result that is not small means that no equilibrium is within
    reach; the caller must look. The counts of the solver's health start from zero afterwards.
    """
    n = int(rope.state.counts[ELEMENTS])
    nodes, health = rope.state.nodes, rope.state.health
    boundary = Boundary(np.zeros((2, MOTIONS)), np.zeros((2, MOTIONS)))
    boundary.value[:, :LINE] = nodes[POSITION : POSITION + 3, n]
    boundary.value[:, LINE] = L
    pull = np.zeros((1, PULL_COLUMNS))
    # no split or merge while it settles
    tolerance = max(
        TOLERANCE_N, 1e-14 * n * rope.sections[EA].max()
    )  # what round-off in the places allows
    still = rope.model._replace(tolerance=tolerance, split_above=np.inf, merge_below=0.0)
    undamped = rope.sections.copy()
    undamped[C] = 0.0
    rope = rope._replace(sections=undamped)
    step, move, best, idle = STEP_FIRST, np.inf, np.inf, 0
    for _ in range(ROUNDS):
        before = nodes[POSITION : POSITION + 3, : n + 1].copy()
        nodes[VELOCITY:NODE_ROWS] = 0.0
        health[:] = 0
        done = advance(rope._replace(model=still._replace(step=step)), boundary, pull, 0.0, 1)
        if done < 1 or health[SUBSTEPS_UNCONVERGED] > 0:
            nodes[POSITION : POSITION + 3, : n + 1] = before
            step *= SHRINK
            if step < STEP_LEAST:
                break
            continue
        move = float(np.abs(nodes[POSITION : POSITION + 3, : n + 1] - before).max())
        best, idle = (move, 0) if move < 0.5 * best else (best, idle + 1)
        settled = move <= SMALL * L or (move <= ENOUGH * L and idle >= PATIENCE)
        if settled and step >= STEP_LAST:
            break
        step = min(step * GROWTH, STEP_LAST)
    nodes[VELOCITY:NODE_ROWS] = 0.0
    health[:] = 0
    return move
