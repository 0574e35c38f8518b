"""Condensation of a block-pentadiagonal chain to its end connections, and back-substitution.

The algebra is that of `core/banded/nodes`: node i has the block B = c·I - K with the next node and
d·I with the second next. A lower connection is carried along as three more columns P
of forces, which a node passes on to the next two like its own force: delta_i = own - G·delta_{i+1}
- S⁻¹·d·delta_{i+2} + F·delta_0 with F = S⁻¹·P. The connection's own node begins with P_1 = K_0 -
c_0·I and P_2 = -d_0·I. A connection is a hinge: an effect that bends the rope has a moment at inner
nodes only, so that chains connected there share its force and nothing else.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.banded.nodes import (
    add,
    add_nine,
    add_six,
    eliminate_coupled_node,
    ground,
    link_less,
    onto_next,
    scaled,
    six,
    spring,
    substituted,
)
from rope_twin.core.banded.pentadiagonal import SECOND, keep, kept_of
from rope_twin.core.jit.decorators import jit_ordered, jit_within
from rope_twin.core.jit.rows import column
from rope_twin.core.state import BLOCK, CORRECTION, ELIMINATED, LINK, RESIDUAL

INVERSE = ELIMINATED + 12  # after own and G: 6 rows, S⁻¹ of a node
FAR = LINK + 2  # 9 rows: F of a node, by columns
COUPLED_CHAIN_ROWS = FAR + 9
_NOTHING = (0.0, 0.0, 0.0)
_NIL = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_NONE = (_NOTHING, _NOTHING, _NOTHING)


@jit_within
def set_column(work: Any, first: int, i: int, d: Any) -> None:
    """Set column i of three rows."""
    work[first, i], work[first + 1, i], work[first + 2, i] = d


@jit_within
def _node(work: Any, i: int, state: Any, K: Any, c: float) -> Any:
    """Return pivot, force and block to the next node of node i, whose next element is K.

    state: Schur complement on it, its force, Schur complement on the next node, and between the
    two.
    """
    S, f, _, between = state
    pivot = add_six(add_six(S, six(work, BLOCK, i)), K)
    return pivot, add(f, column(work, RESIDUAL, i)), add_nine(between, link_less(c, K))


@jit_ordered
def _take(work: Any, i: int, state: Any, K: Any, c: float, d: float) -> Any:
    """Eliminate node i onto the next two, through K, c and d; return the remaining state."""
    S, f, B = _node(work, i, state, K, c)
    kept, left = eliminate_coupled_node(S, f, B, d)
    keep(work, INVERSE, i, kept)
    return onto_next(left, state[2], K)


@jit_ordered
def eliminate_coupled_upward(work: Any, first: int, n: int) -> Any:
    """Eliminate from the lower end, free (first = 0) or fixed (1), to node n: block and force."""
    state = ground(work, first), _NOTHING, (_NIL, _NOTHING), _NONE
    for i in range(first, n):
        state = _take(work, i, state, spring(work, i), work[LINK, i], work[SECOND, i])
    return state[0], state[1]


@jit_ordered
def eliminate_coupled_downward(work: Any, n: int) -> Any:
    """Eliminate from the hang-off n, with prescribed motion, to node 0: block and force."""
    state = spring(work, n - 1), _NOTHING, (_NIL, _NOTHING), _NONE
    for i in range(n - 1, 0, -1):
        d = work[SECOND, i - 2] if i > 1 else 0.0
        state = _take(work, i, state, spring(work, i - 1), work[LINK, i - 1], d)
    return state[0], state[1]


@jit_ordered
def _pass_on(pivot: Any, P: Any, after: Any) -> Any:
    """Return S⁻¹·P for columns P of forces on a node, and the columns of the next two nodes.

    pivot: S, B and d of the node; after: the existing columns of the next node.
    """
    S, B, d = pivot
    (x, _, _), (_, to_x, far_x, _, _) = eliminate_coupled_node(S, P[0], B, d)
    (y, _, _), (_, to_y, far_y, _, _) = eliminate_coupled_node(S, P[1], B, d)
    (z, _, _), (_, to_z, far_z, _, _) = eliminate_coupled_node(S, P[2], B, d)
    following = add_nine(after, (to_x, to_y, to_z))
    return (x, y, z), following, (far_x, far_y, far_z)


@jit_within
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit_within
def _lessened(D: Any, P: Any, F: Any) -> Any:
    """Return D - Pᵀ·F, symmetric; P and F by columns."""
    (px, py, pz), (x, y, z) = P, F
    return (
        D[0] - _dot(px, x), D[1] - _dot(px, y), D[2] - _dot(px, z),
        D[3] - _dot(py, y), D[4] - _dot(py, z), D[5] - _dot(pz, z),
    )  # fmt: skip


@jit_ordered
def eliminate_coupled_between(work: Any, n: int) -> Any:
    """Condense to both ends: return block and force at node n, at node 0, and P by columns.

    P couples them: -P is the block of row n and column 0.
    """
    D, d = spring(work, 0), -work[SECOND, 0]
    P = link_less(work[LINK, 0], D)  # symmetric: its rows are its columns
    P = scaled(-1.0, P[0]), scaled(-1.0, P[1]), scaled(-1.0, P[2])
    after, g = ((d, 0.0, 0.0), (0.0, d, 0.0), (0.0, 0.0, d)), _NOTHING
    state = D, _NOTHING, (_NIL, _NOTHING), _NONE
    for i in range(1, n):
        K, c, d = spring(work, i), work[LINK, i], work[SECOND, i]
        S, _, B = _node(work, i, state, K, c)
        F, following, after = _pass_on((S, B, d), P, after)
        state = _take(work, i, state, K, c, d)
        own = column(work, ELIMINATED, i)
        for k in range(3):
            set_column(work, FAR + 3 * k, i, F[k])
        D = _lessened(D, P, F)
        g = add(g, (_dot(P[0], own), _dot(P[1], own), _dot(P[2], own)))
        P = following
    return state[0], state[1], D, g, P


@jit_ordered
def substitute_coupled_upward(work: Any, first: int, n: int) -> None:
    """Back-substitute after `eliminate_coupled_upward`, given the correction of node n."""
    near, far = column(work, CORRECTION, n), _NOTHING
    for i in range(n - 1, first - 1, -1):
        near, far = substituted(kept_of(work, INVERSE, i), near, scaled(work[SECOND, i], far)), near
        set_column(work, CORRECTION, i, near)
    if first == 1:
        set_column(work, CORRECTION, 0, _NOTHING)


@jit_ordered
def substitute_coupled_downward(work: Any, n: int) -> None:
    """Back-substitute after `eliminate_coupled_downward`, given the correction of node 0."""
    near, far = column(work, CORRECTION, 0), _NOTHING
    for i in range(1, n):
        d = work[SECOND, i - 2] if i > 1 else 0.0
        near, far = substituted(kept_of(work, INVERSE, i), near, scaled(d, far)), near
        set_column(work, CORRECTION, i, near)


@jit_ordered
def substitute_coupled_between(work: Any, n: int) -> None:
    """Back-substitute after `eliminate_coupled_between`, given the corrections of both ends."""
    near, far = column(work, CORRECTION, n), _NOTHING
    x, y, z = column(work, CORRECTION, 0)
    for i in range(n - 1, 0, -1):
        own = substituted(kept_of(work, INVERSE, i), near, scaled(work[SECOND, i], far))
        for k, share in enumerate((x, y, z)):
            own = add(own, scaled(share, column(work, FAR + 3 * k, i)))
        near, far = own, near
        set_column(work, CORRECTION, i, near)
