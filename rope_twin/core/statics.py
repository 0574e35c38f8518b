"""Static equilibrium by proximal steps of the convex energy, with the stage solver itself.

Each step solves M·a = F(x + p·a) at rest (v = 0 but for the water's drag), a Newton step for the
energy with the mass as a regulariser M/p; p grows until it is negligible. It starts from any shape,
slack ropes included.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

from rope_twin.core.assembly import set_lengths
from rope_twin.core.jit import jit_entry
from rope_twin.core.rows import copy, fill
from rope_twin.core.stage import solve_stage
from rope_twin.core.state import (
    ACCELERATION,
    ELEMENTS,
    POSITION,
    POSITION_HAT,
    VELOCITY,
    VELOCITY_HAT,
    Stage,
)

ROUNDS = 400
P_FIRST, P_LAST = 1.0, 1e8  # s²
GROWTH, SHRINK = 4.0, 0.1


@jit_entry
def find_equilibrium(rope: Any, L: float) -> float:
    """Move the nodes to equilibrium at line out L; returns the largest last move [m].

    The hang-off stays where it is. A result that is not small (or NaN) means that there
    is no equilibrium within reach: the caller must look.
    """
    state, work = rope.state, rope.work
    n, first = state.counts[ELEMENTS], rope.model.first_free
    copy(state.nodes, POSITION, work, POSITION, 3, n + 1)
    fill(work, VELOCITY, 0.0, 0, n + 1)
    fill(work, VELOCITY_HAT, 0.0, 0, n + 1)
    set_lengths(work, state.s, n, L)
    p, move = P_FIRST, 1e300
    small = 1e-12 * L
    for _ in range(ROUNDS):
        fill(work, ACCELERATION, 0.0, 0, n + 1)
        copy(state.nodes, POSITION, work, POSITION_HAT, 3, n + 1)
        ok = solve_stage(rope, Stage(0.0, p, 0.0, 0.0), 1e-3)
        if not ok:
            if p < 1e-6:
                return move
            p *= SHRINK
            continue
        move = 0.0
        for k in range(3):
            for i in range(first, n):
                move = max(move, abs(work[POSITION + k, i] - state.nodes[POSITION + k, i]))
                state.nodes[POSITION + k, i] = work[POSITION + k, i]
        if not isfinite(move):
            return move
        if move <= small and p >= P_LAST:
            break
        p = min(p * GROWTH, P_LAST)
    fill(work, ACCELERATION, 0.0, 0, n + 1)
    fill(state.nodes, VELOCITY, 0.0, 0, n + 1)
    fill(state.nodes, ACCELERATION, 0.0, 0, n + 1)
    for k in range(state.health.shape[0]):
        state.health[k] = 0
    return move
