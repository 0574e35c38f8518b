"""Condensation of a rope to the connections at both of its ends, in SIMD lanes.

The algebra and its order are those of `core/joined/chains`, so that a lane has the numbers of the
lone system to the bit. A node has its factors in its own rows: ELIMINATED as in `core/tridiagonal`,
H by columns in FAR. The middle node has H of the lower end in the rows of the gain, H of the upper
end in FAR.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import (
    INVERSE,
    add,
    add_six,
    dot,
    eliminate_node,
    force_on,
    keep_factors,
    keep_nine,
    keep_six,
    nine,
    nothing_at,
    set_column,
    six,
    solve_symmetric,
    spring,
)
from rope_twin.core.jit.decorators import jit_ordered, jit_ordered_within
from rope_twin.core.jit.rows import column
from rope_twin.core.joined.chains import ends_of, less_product, plus_product, solve_columns
from rope_twin.core.state import BLOCK, CORRECTION, ELIMINATED, FAR, RESIDUAL, ZERO
from rope_twin.core.tridiagonal import pivot_of, push_wide_node, substitute_wide_node

OWN = ELIMINATED + 9  # y of the middle node


@jit_ordered_within
def _take(work: Any, i: int, e: int, state: Any, moved: Any) -> Any:
    """Eliminate node i through element e.

    state: Z, f, P by columns, D and force on the connection behind.
    """
    Z, f, (px, py, pz), D, g = state
    S, t, a, b = pivot_of(work, i, e, Z)
    gain, own, left, pushed, inverse = eliminate_node(S, force_on(work, i, f), t, a, b)
    keep_factors(work, i, (gain[:3], gain[3:6], gain[6:]), own, inverse, moved)
    _, hx, _, to_x, _ = eliminate_node(S, px, t, a, b)
    _, hy, _, to_y, _ = eliminate_node(S, py, t, a, b)
    _, hz, _, to_z, _ = eliminate_node(S, pz, t, a, b)
    H, P = (hx, hy, hz), (px, py, pz)
    keep_nine(work, FAR, i, H, moved)
    return left, pushed, (to_x, to_y, to_z), less_product(D, P, H), plus_product(g, P, own)


@jit_ordered_within
def _start(work: Any, e: int) -> Any:
    """Return the state at the end of a rope whose outermost element is e."""
    Z, none = spring(work, e), nothing_at(work, e)
    xx, xy, xz, yy, yz, zz = Z
    return Z, none, ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)), Z, none


@jit_ordered
def eliminate_between_wide(work: Any, n: int, moved: Any) -> Any:
    """Condense to both ends: return block and force at node n, at node 0, and P by columns."""
    pairs, rounds, middle = ends_of(n)
    below, above = _start(work, ZERO), _start(work, n - 1)
    for k in range(pairs):
        below = _take(work, 1 + k, 1 + k, below, moved)
        above = _take(work, n - 1 - k, n - 2 - k, above, moved)
    if rounds > pairs:
        above = _take(work, middle + 1, middle, above, moved)
    S = add_six(add_six(below[0], above[0]), six(work, BLOCK, middle))
    P, Q = below[2], above[2]
    H, G = solve_columns(S, P), solve_columns(S, Q)
    keep_six(work, INVERSE, middle, S, moved)
    keep_nine(work, ELIMINATED, middle, H, moved)
    keep_nine(work, FAR, middle, G, moved)
    D, E = less_product(below[3], P, H), less_product(above[3], Q, G)
    own = solve_symmetric(S, add(add(below[1], above[1]), column(work, RESIDUAL, middle)))
    set_column(work, OWN, middle, own)
    g, h = plus_product(below[4], P, own), plus_product(above[4], Q, own)
    x, y, z = H
    coupling = (
        (dot(Q[0], x), dot(Q[1], x), dot(Q[2], x)),
        (dot(Q[0], y), dot(Q[1], y), dot(Q[2], y)),
        (dot(Q[0], z), dot(Q[1], z), dot(Q[2], z)),
    )
    return E, h, D, g, coupling


@jit_ordered
def push_between_wide(work: Any, n: int) -> Any:
    """Push the residuals through the factors: return the force at node n and that at node 0."""
    pairs, rounds, middle = ends_of(n)
    f = g = p = q = nothing_at(work, middle)
    for k in range(pairs):
        i, j = 1 + k, n - 1 - k
        g = plus_product(g, nine(work, FAR, i), force_on(work, i, f))
        f = push_wide_node(work, i, f)
        q = plus_product(q, nine(work, FAR, j), force_on(work, j, p))
        p = push_wide_node(work, j, p)
    if rounds > pairs:
        q = plus_product(q, nine(work, FAR, middle + 1), force_on(work, middle + 1, p))
        p = push_wide_node(work, middle + 1, p)
    force = add(add(f, p), column(work, RESIDUAL, middle))
    set_column(work, OWN, middle, solve_symmetric(six(work, INVERSE, middle), force))
    H = nine(work, ELIMINATED, middle)
    G = nine(work, FAR, middle)
    return plus_product(q, G, force), plus_product(g, H, force)


@jit_ordered_within
def _substituted(work: Any, i: int, near: Any, far: Any) -> Any:
    """Store and return delta of node i from that nearer the middle and that of its rope's end."""
    x, y, z = substitute_wide_node(work, i, near)
    hx, hy, hz = nine(work, FAR, i)
    own = (
        x + (hx[0] * far[0] + hy[0] * far[1] + hz[0] * far[2]),
        y + (hx[1] * far[0] + hy[1] * far[1] + hz[1] * far[2]),
        z + (hx[2] * far[0] + hy[2] * far[1] + hz[2] * far[2]),
    )
    set_column(work, CORRECTION, i, own)
    return own


@jit_ordered_within
def _middle_of(own: Any, H: Any, G: Any, low: Any, high: Any) -> Any:
    """Return a component of the middle node's delta; H, G: its row."""
    return (
        own
        + (H[0] * low[0] + H[1] * low[1] + H[2] * low[2])
        + (G[0] * high[0] + G[1] * high[1] + G[2] * high[2])
    )


@jit_ordered
def substitute_between_wide(work: Any, n: int) -> None:
    """Back-substitute, given the corrections of both ends."""
    pairs, rounds, middle = ends_of(n)
    low, high = column(work, CORRECTION, ZERO), column(work, CORRECTION, n)
    own = column(work, OWN, middle)
    a, b, c = nine(work, ELIMINATED, middle)
    u, v, w = nine(work, FAR, middle)
    near = (
        _middle_of(own[0], (a[0], b[0], c[0]), (u[0], v[0], w[0]), low, high),
        _middle_of(own[1], (a[1], b[1], c[1]), (u[1], v[1], w[1]), low, high),
        _middle_of(own[2], (a[2], b[2], c[2]), (u[2], v[2], w[2]), low, high),
    )
    set_column(work, CORRECTION, middle, near)
    further = near
    if rounds > pairs:
        further = _substituted(work, middle + 1, near, high)
    for k in range(pairs - 1, -1, -1):
        near = _substituted(work, 1 + k, near, low)
        further = _substituted(work, n - 1 - k, further, high)
