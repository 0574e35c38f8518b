"""Direct solver of a block-pentadiagonal chain (a node couples to the next two).

The elimination of one node is in `coupled_node`. `eliminate_coupled_plainly` proceeds from the
lower end to the hang-off. Compiled code uses `core/solve/coupled_fold`, the two-sided (twisted)
factorisation; a test compares both with a dense solver.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit, jit_ordered, jit_within
from rope_twin.core.jit.rows import column, row
from rope_twin.core.solve.coupled_node import (
    add,
    add_nine,
    eliminate_coupled_node,
    link_less,
    onto_next,
    push_coupled_node,
    scaled,
    substituted,
)
from rope_twin.core.solve.elimination import add_six, ground, hold_ends, six, spring
from rope_twin.core.state import (
    BLOCK,
    CORRECTION,
    ELIMINATED,
    FACTOR,
    LINK,
    RESIDUAL,
)

SECOND = LINK + 1  # coupling with the second next node


@jit_ordered
def single_node(work: Any, i: int, state: Any, K: Any, c: float, d: float) -> Any:
    """Eliminate node i of one chain, with its next element K and its couplings c and d.

    state: Schur complement on it, its force, Schur complement on the next node, and between the
    two.
    """
    S, f, carried, between = state
    S = add_six(add_six(S, six(work, BLOCK, i)), K)
    f = add(f, column(work, RESIDUAL, i))
    kept, left = eliminate_coupled_node(S, f, add_nine(between, link_less(c, K)), d)
    return kept, onto_next(left, carried, K)


@jit_within
def keep(work: Any, factors: int, i: int, kept: Any) -> None:
    """Store the factors of node i for the back-substitution; S⁻¹ from row `factors` on."""
    own, G, inverse = kept
    for k in range(3):
        work[ELIMINATED + k, i] = own[k]
        work[ELIMINATED + 3 + k, i] = G[0][k]
        work[ELIMINATED + 6 + k, i] = G[1][k]
        work[ELIMINATED + 9 + k, i] = G[2][k]
    for k in range(6):
        work[factors + k, i] = inverse[k]


@jit_within
def kept_of(work: Any, factors: int, i: int) -> Any:
    """Load the factors of node i that `keep` stored."""
    G = (
        column(work, ELIMINATED + 3, i), column(work, ELIMINATED + 6, i),
        column(work, ELIMINATED + 9, i),
    )  # fmt: skip
    return column(work, ELIMINATED, i), G, six(work, factors, i)


@jit_within
def set_correction(work: Any, i: int, delta: Any) -> None:
    """Set the correction of a node."""
    for k in range(3):
        work[CORRECTION + k, i] = delta[k]


@jit_ordered
def eliminate_coupled_plainly(work: Any, first: int, n: int) -> None:
    """Solve for the corrections of the nodes first <= i < n; they are 0 at n and below first."""
    nothing = (0.0, 0.0, 0.0)
    nil = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    state = ground(work, first), nothing, (nil, nothing), (nothing, nothing, nothing)
    for i in range(first, n):
        c, d = work[LINK, i], work[LINK + 1, i]
        kept, state = single_node(work, i, state, spring(work, i), c, d)
        keep(work, FACTOR, i, kept)
    _substitute_plainly(work, first, n)


@jit_ordered
def push_coupled_plainly(work: Any, first: int, n: int) -> None:
    """Solve for another residual with the factors of `eliminate_coupled_plainly`."""
    f = carried = (0.0, 0.0, 0.0)
    for i in range(first, n):
        _, G, I = kept_of(work, FACTOR, i)
        force = add(f, column(work, RESIDUAL, i))
        own, pushed, far = push_coupled_node(force, G, I, work[SECOND, i])
        f, carried = add(carried, pushed), far
        for k in range(3):
            work[ELIMINATED + k, i] = own[k]
    _substitute_plainly(work, first, n)


@jit_ordered
def _substitute_plainly(work: Any, first: int, n: int) -> None:
    """Back-substitute from the hang-off down."""
    near = far = (0.0, 0.0, 0.0)
    for i in range(n - 1, first - 1, -1):
        d = work[SECOND, i]
        near, far = substituted(kept_of(work, FACTOR, i), near, scaled(d, far)), near
        set_correction(work, i, near)
    hold_ends(work, first, n)


@jit
def take_links(work: Any, n: int) -> None:
    """Subtract the effect of the couplings on the corrections from the residual."""
    c, d = row(work, LINK, 0), row(work, SECOND, 0)
    for k in range(3):
        R, delta = work[RESIDUAL + k], work[CORRECTION + k]
        for i in range(n):
            R[i] -= c[i] * delta[i + 1]
        for i in range(1, n):
            R[i] -= c[i - 1] * delta[i - 1]
        for i in range(n - 1):
            R[i] -= d[i] * delta[i + 2]
        for i in range(2, n):
            R[i] -= d[i - 2] * delta[i - 2]
