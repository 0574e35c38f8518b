"""Condensation of a rope to the connections at both of its ends, from both ends to its middle.

Where ropes form a loop, a rope lies between two connections of the dense system. Lane 0 starts at
its lower end, lane 1 at its upper end. Each has the connection at its end as three additional
right-hand sides: node i has (S + K)·delta_i = f + K·delta_next + P·delta_end, so that with
H = (S + K)⁻¹·P delta_i = y + G·delta_next + H·delta_end, and K·H replaces P at the next node, as
`eliminate_node` does with a force. The Schur complement on the connection is the difference
D - Σ Pᵀ·H: its mass is resolved to 1e-16·K.

**With bending** the chain is block-pentadiagonal. The algebra is that of `core/elimination`: node i
has the block B = c·I - K with the next node and d·I with the second next. A lower connection is
three additional right-hand sides P, which are condensed onto the next two nodes like a force:
delta_i = y - G·delta_{i+1} - S⁻¹·d·delta_{i+2} + F·delta_0 with F = S⁻¹·P. They start with
P_1 = K_0 - c_0·I and P_2 = -d_0·I. A connection is a hinge: bending effects have a moment at inner
nodes only, so that chains connected there are coupled by the connection alone.

**In SIMD lanes** (`..._wide`) algebra and order are the same, so that a lane is bit-identical to a
single system. The factors of a node are in its own column: ELIMINATED as in `core/tridiagonal`, H
by columns in FAR. The middle node has H of the lower end in the rows of the gain, H of the upper
end in FAR.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import (
    INVERSE,
    RECORD,
    add,
    add_nine,
    add_six,
    dot,
    eliminate_coupled_node,
    eliminate_node,
    force_on,
    ground,
    keep_factors,
    keep_nine,
    keep_pair,
    keep_six,
    lanes,
    link_less,
    nine,
    nothing_at,
    onto_next,
    pair_of_nodes,
    pushed_on,
    reduce_pair,
    scaled,
    set_column,
    six,
    six_lanes,
    solve_symmetric,
    spring,
    store_three,
    substitute_pair,
    substituted,
    two,
    two_of_six,
)
from rope_twin.core.jit.decorators import (
    jit,
    jit_exact_within,
    jit_ordered,
    jit_ordered_within,
    jit_within,
)
from rope_twin.core.jit.functions import fused
from rope_twin.core.jit.rows import column, lane, load, pair, row, rows
from rope_twin.core.loads import balance
from rope_twin.core.loads.hooks import couples, selected_by
from rope_twin.core.pentadiagonal import SECOND, keep_node, kept_of
from rope_twin.core.state import (
    BLOCK,
    CORRECTION,
    COUPLED_FAR,
    ELIMINATED,
    FAR,
    LINK,
    RESIDUAL,
    ZERO,
)
from rope_twin.core.tridiagonal import pivot_of, reduce_wide_node, substitute_wide_node

_FAR_RECORD = 18  # numbers: pairs of H by rows
# The record of the middle node: y, H of either end by columns, and its matrix.
_OWN, _LOW, _HIGH, _MATRIX = 0, 3, 12, 21


@jit_within
def less_product(D: Any, P: Any, F: Any) -> Any:
    """Return D - Pᵀ·F, symmetric; P and F by columns."""
    (px, py, pz), (x, y, z) = P, F
    return (
        D[0] - dot(px, x), D[1] - dot(px, y), D[2] - dot(px, z),
        D[3] - dot(py, y), D[4] - dot(py, z), D[5] - dot(pz, z),
    )  # fmt: skip


@jit_within
def plus_product(g: Any, P: Any, f: Any) -> Any:
    """Return g + Pᵀ·f; P by columns."""
    return g[0] + dot(P[0], f), g[1] + dot(P[1], f), g[2] + dot(P[2], f)


@jit_within
def _coupling(Q: Any, H: Any) -> Any:
    """Return Qᵀ·H by columns; Q and H by columns."""
    (x, y, z), (u, v, w) = Q, H
    return (
        (dot(x, u), dot(y, u), dot(z, u)),
        (dot(x, v), dot(y, v), dot(z, v)),
        (dot(x, w), dot(y, w), dot(z, w)),
    )


@jit_within
def ends_of(n: int) -> Any:
    """Return the number of pairs, that of pairs with one where a lane is not used, the middle."""
    return (n - 2) // 2, (n - 1) // 2, 1 + (n - 2) // 2


@jit_within
def _pair(work: Any, i: int, j: int, k: int, state: Any) -> Any:
    """Eliminate node i through the element above it and node j through the one below.

    state: of either lane Z, f, P by columns, D and force on the connection.
    """
    Z, f, (px, py, pz), D, g = state
    S, t, a, b = pair_of_nodes(work, (i, j), (i, j - 1), Z)
    gain, solution, schur, pushed, inverse = eliminate_node(S, pushed_on(work, i, j, f), t, a, b)
    keep_pair(row(work, ELIMINATED, 0), RECORD * k, gain, solution, inverse)
    _, hx, _, to_x, _ = eliminate_node(S, px, t, a, b)
    _, hy, _, to_y, _ = eliminate_node(S, py, t, a, b)
    _, hz, _, to_z, _ = eliminate_node(S, pz, t, a, b)
    far = row(work, FAR, _FAR_RECORD * k)
    store_three(far, 0, (hx[0], hy[0], hz[0]))
    store_three(far, 6, (hx[1], hy[1], hz[1]))
    store_three(far, 12, (hx[2], hy[2], hz[2]))
    P = px, py, pz
    D, g = less_product(D, P, (hx, hy, hz)), plus_product(g, P, solution)
    return schur, pushed, (to_x, to_y, to_z), D, g


@jit_within
def solve_columns(S: Any, P: Any) -> Any:
    return solve_symmetric(S, P[0]), solve_symmetric(S, P[1]), solve_symmetric(S, P[2])


@jit_within
def _columns(P: Any, k: int) -> Any:
    """Return lane k of three columns."""
    return lanes(P[0], k), lanes(P[1], k), lanes(P[2], k)


@jit_within
def _put(record: Any, at: int, vector: Any) -> None:
    record[at], record[at + 1], record[at + 2] = vector


@jit_ordered
def eliminate_between(work: Any, n: int) -> Any:
    """Condense to both ends: return block and force at node n, at node 0, and P by columns.

    P couples them: -P is the block of row n and column 0.
    """
    pairs, rounds, middle = ends_of(n)
    Z, zero = two_of_six(spring(work, ZERO), spring(work, n - 1)), pair(0.0, 0.0)
    none = zero, zero, zero
    xx, xy, xz, yy, yz, zz = Z
    state = Z, none, ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)), Z, none
    for k in range(pairs):
        state = _pair(work, 1 + k, n - 1 - k, k, state)
    below = state
    if rounds > pairs:
        state = _pair(work, middle, middle + 1, pairs, state)
    S = add_six(add_six(six_lanes(below[0], 0), six_lanes(state[0], 1)), six(work, BLOCK, middle))
    record = row(work, ELIMINATED, RECORD * rounds)
    P, Q = _columns(below[2], 0), _columns(state[2], 1)
    H, G = solve_columns(S, P), solve_columns(S, Q)
    for k in range(6):
        record[_MATRIX + k] = S[k]
    for k in range(3):
        _put(record, _LOW + 3 * k, H[k])
        _put(record, _HIGH + 3 * k, G[k])
    D = less_product(six_lanes(below[3], 0), P, H)
    E = less_product(six_lanes(state[3], 1), Q, G)
    sides = add(lanes(below[1], 0), lanes(state[1], 1))
    solution = solve_symmetric(S, add(sides, column(work, RESIDUAL, middle)))
    _put(record, _OWN, solution)
    g = plus_product(lanes(below[4], 0), P, solution)
    h = plus_product(lanes(state[4], 1), Q, solution)
    return E, h, D, g, _coupling(Q, H)


@jit_ordered
def reduce_between(work: Any, n: int) -> Any:
    """Condense the residuals with the existing factors: return the force at node n and node 0."""
    pairs, rounds, middle = ends_of(n)
    records, zero = row(work, ELIMINATED, 0), pair(0.0, 0.0)
    f = g = (zero, zero, zero)
    for k in range(pairs):
        f = pushed_on(work, 1 + k, n - 1 - k, f)
        g = plus_product(g, _far(work, k), f)
        f = reduce_pair(records, RECORD * k, f)
    a, low = lanes(f, 0), lanes(g, 0)
    if rounds > pairs:
        f = pushed_on(work, middle, middle + 1, f)
        g = plus_product(g, _far(work, pairs), f)
        f = reduce_pair(records, RECORD * pairs, f)
    b, high = lanes(f, 1), lanes(g, 1)
    record = row(work, ELIMINATED, RECORD * rounds)
    S = _three(record, _MATRIX) + _three(record, _MATRIX + 3)
    force = add(add(a, b), column(work, RESIDUAL, middle))
    _put(record, _OWN, solve_symmetric(S, force))
    H, G = _kept_columns(record, _LOW), _kept_columns(record, _HIGH)
    return plus_product(high, G, force), plus_product(low, H, force)


@jit_within
def _three(record: Any, at: int) -> Any:
    return record[at], record[at + 1], record[at + 2]


@jit_within
def _kept_columns(record: Any, at: int) -> Any:
    """Return three columns of the middle node's record."""
    return _three(record, at), _three(record, at + 3), _three(record, at + 6)


@jit_within
def _far(work: Any, k: int) -> Any:
    """Return H of a pair by columns."""
    far = row(work, FAR, _FAR_RECORD * k)
    return (
        (load(far, 0), load(far, 6), load(far, 12)),
        (load(far, 2), load(far, 8), load(far, 14)),
        (load(far, 4), load(far, 10), load(far, 16)),
    )


@jit_within
def _substitute(work: Any, k: int, p: Any, d: Any) -> Any:
    """Return delta of a pair from that of the nodes nearer the middle and that of both ends."""
    x, y, z = substitute_pair(row(work, ELIMINATED, 0), RECORD * k, p)
    hx, hy, hz = _far(work, k)
    return (
        x + (hx[0] * d[0] + hy[0] * d[1] + hz[0] * d[2]),
        y + (hx[1] * d[0] + hy[1] * d[1] + hz[1] * d[2]),
        z + (hx[2] * d[0] + hy[2] * d[1] + hz[2] * d[2]),
    )


@jit_within
def _middle_of(record: Any, k: int, low: Any, high: Any) -> Any:
    """Return component k of the middle node's delta."""
    a, b = _LOW + k, _HIGH + k
    return (
        record[_OWN + k]
        + (record[a] * low[0] + record[a + 3] * low[1] + record[a + 6] * low[2])
        + (record[b] * high[0] + record[b + 3] * high[1] + record[b + 6] * high[2])
    )


@jit_ordered
def substitute_between(work: Any, n: int) -> None:
    """Back-substitute, given the corrections of both ends."""
    pairs, rounds, middle = ends_of(n)
    dx, dy, dz = rows(work, CORRECTION, 0)
    record = row(work, ELIMINATED, RECORD * rounds)
    low, high = (dx[0], dy[0], dz[0]), (dx[n], dy[n], dz[n])
    d = two(low, high)
    mx = _middle_of(record, 0, low, high)
    my = _middle_of(record, 1, low, high)
    mz = _middle_of(record, 2, low, high)
    dx[middle], dy[middle], dz[middle] = mx, my, mz
    p = two((mx, my, mz), (mx, my, mz))
    if rounds > pairs:
        ax, ay, az = lanes(_substitute(work, pairs, p, d), 1)
        dx[middle + 1], dy[middle + 1], dz[middle + 1] = ax, ay, az
        p = two((mx, my, mz), (ax, ay, az))
    for k in range(pairs - 1, -1, -1):
        p = _substitute(work, k, p, d)
        i, j = 1 + k, n - 1 - k
        px, py, pz = p
        dx[i], dx[j] = lane(px, 0), lane(px, 1)
        dy[i], dy[j] = lane(py, 0), lane(py, 1)
        dz[i], dz[j] = lane(pz, 0), lane(pz, 1)


@jit_within
def _begun(Z: Any, zero: Any) -> Any:
    """Return the initial state (see `_node`) of a chain with Schur complement Z."""
    return Z, zero, (zero + zero, zero), (zero, zero, zero)


@jit_within
def _node(work: Any, i: int, state: Any, K: Any, c: float) -> Any:
    """Return pivot, force and block to the next node of node i, whose next element is K.

    state: Schur complement and condensed force on node i, those on the next node, and their
    coupling.
    """
    S, f, _, cross = state
    pivot = add_six(add_six(S, six(work, BLOCK, i)), K)
    return pivot, add(f, column(work, RESIDUAL, i)), add_nine(cross, link_less(c, K))


@jit_ordered
def _take(work: Any, i: int, state: Any, K: Any, c: float, d: float) -> Any:
    """Eliminate node i onto the next two, through K, c and d; return the state there."""
    S, f, B = _node(work, i, state, K, c)
    factors, schur = eliminate_coupled_node(S, f, B, d)
    keep_node(work, i, factors)
    return onto_next(schur, state[2], K)


@jit_ordered
def eliminate_coupled_upward(work: Any, first: int, n: int) -> Any:
    """Eliminate from the lower end, free (first = 0) or fixed (1), to node n: block and force."""
    state = _begun(ground(work, first), nothing_at(work, first))
    for i in range(first, n):
        state = _take(work, i, state, spring(work, i), work[LINK, i], work[SECOND, i])
    return state[0], state[1]


@jit_ordered
def eliminate_coupled_downward(work: Any, n: int) -> Any:
    """Eliminate from the hang-off n, with prescribed motion, to node 0: block and force."""
    state = _begun(spring(work, n - 1), nothing_at(work, 0))
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


@jit_exact_within
def _exact_dot(a: Any, b: Any) -> Any:
    """Return the inner product of two vectors, rounded equally for a single rope and in lanes."""
    return fused(a[2], b[2], fused(a[0], b[0], a[1] * b[1]))


@jit_ordered
def eliminate_coupled_between(work: Any, n: int) -> Any:
    """Condense to both ends: return block and force at node n, at node 0, and P by columns.

    P couples them: -P is the block of row n and column 0.
    """
    D, d = spring(work, 0), -work[SECOND, 0]
    P = link_less(work[LINK, 0], D)  # symmetric: its rows are its columns
    P = scaled(-1.0, P[0]), scaled(-1.0, P[1]), scaled(-1.0, P[2])
    g = nothing_at(work, 0)
    nil = g[0]
    after, state = ((d, nil, nil), (nil, d, nil), (nil, nil, d)), _begun(D, g)
    for i in range(1, n):
        K, c, d = spring(work, i), work[LINK, i], work[SECOND, i]
        S, _, B = _node(work, i, state, K, c)
        F, following, after = _pass_on((S, B, d), P, after)
        state = _take(work, i, state, K, c, d)
        solution = column(work, ELIMINATED + 9, i)
        for k in range(3):
            set_column(work, COUPLED_FAR + 3 * k, i, F[k])
        D = less_product(D, P, F)
        g = add(
            g, (_exact_dot(P[0], solution), _exact_dot(P[1], solution), _exact_dot(P[2], solution))
        )
        P = following
    return state[0], state[1], D, g, P


@jit_ordered
def substitute_coupled_upward(work: Any, first: int, n: int) -> None:
    """Back-substitute after `eliminate_coupled_upward`, given the correction of node n."""
    near, far = column(work, CORRECTION, n), nothing_at(work, 0)
    for i in range(n - 1, first - 1, -1):
        near, far = substituted(kept_of(work, i), near, scaled(work[SECOND, i], far)), near
        set_column(work, CORRECTION, i, near)
    if first == 1:
        set_column(work, CORRECTION, 0, nothing_at(work, 0))


@jit_ordered
def substitute_coupled_downward(work: Any, n: int) -> None:
    """Back-substitute after `eliminate_coupled_downward`, given the correction of node 0."""
    near, far = column(work, CORRECTION, 0), nothing_at(work, 0)
    for i in range(1, n):
        d = work[SECOND, i - 2] if i > 1 else 0.0
        near, far = substituted(kept_of(work, i), near, scaled(d, far)), near
        set_column(work, CORRECTION, i, near)


@jit_ordered
def substitute_coupled_between(work: Any, n: int) -> None:
    """Back-substitute after `eliminate_coupled_between`, given the corrections of both ends."""
    near, far = column(work, CORRECTION, n), nothing_at(work, 0)
    x, y, z = column(work, CORRECTION, 0)
    for i in range(n - 1, 0, -1):
        solution = substituted(kept_of(work, i), near, scaled(work[SECOND, i], far))
        for k, share in enumerate((x, y, z)):
            solution = add(solution, scaled(share, column(work, COUPLED_FAR + 3 * k, i)))
        near, far = solution, near
        set_column(work, CORRECTION, i, near)


@jit
def _couple(effects: Any, work: Any, stage: Any, n: int, upto: int) -> None:
    """Add the couplings; preserve the loads of node n (if upto > n), which they clear."""
    R, S = column(work, RESIDUAL, n), (column(work, BLOCK, n), column(work, BLOCK + 3, n))
    balance.add_couplings(effects, work, stage, n)
    if upto > n:
        for k in range(3):
            work[RESIDUAL + k, n] += R[k]
            work[BLOCK + k, n] += S[0][k]
            work[BLOCK + 3 + k, n] += S[1][k]


# Add the forces of effects between nodes that are not adjacent, after the loads; upto: number of
# nodes that carry loads, n, or n + 1 if the upper end is at a connection.
add_couplings = selected_by(
    couples,
    lambda effects, work, stage, n, upto: _couple(effects, work, stage, n, upto),
    lambda effects, work, stage, n, upto: None,
)


_WIDE_OWN = ELIMINATED + 9  # y of the middle node


@jit_ordered_within
def _take_wide(work: Any, i: int, e: int, state: Any, moved: Any) -> Any:
    """Eliminate node i through element e.

    state: Z, f, P by columns, D and force on the connection behind.
    """
    Z, f, (px, py, pz), D, g = state
    S, t, a, b = pivot_of(work, i, e, Z)
    gain, solution, schur, pushed, inverse = eliminate_node(S, force_on(work, i, f), t, a, b)
    keep_factors(work, i, (gain[:3], gain[3:6], gain[6:]), solution, inverse, moved)
    _, hx, _, to_x, _ = eliminate_node(S, px, t, a, b)
    _, hy, _, to_y, _ = eliminate_node(S, py, t, a, b)
    _, hz, _, to_z, _ = eliminate_node(S, pz, t, a, b)
    H, P = (hx, hy, hz), (px, py, pz)
    keep_nine(work, FAR, i, H, moved)
    return schur, pushed, (to_x, to_y, to_z), less_product(D, P, H), plus_product(g, P, solution)


@jit_ordered_within
def _start_wide(work: Any, e: int) -> Any:
    """Return the state at the end of a rope whose outermost element is e."""
    Z, zero = spring(work, e), nothing_at(work, e)
    xx, xy, xz, yy, yz, zz = Z
    return Z, zero, ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)), Z, zero


@jit_ordered
def eliminate_between_wide(work: Any, n: int, moved: Any) -> Any:
    """Condense to both ends: return block and force at node n, at node 0, and P by columns."""
    pairs, rounds, middle = ends_of(n)
    below, above = _start_wide(work, ZERO), _start_wide(work, n - 1)
    for k in range(pairs):
        below = _take_wide(work, 1 + k, 1 + k, below, moved)
        above = _take_wide(work, n - 1 - k, n - 2 - k, above, moved)
    if rounds > pairs:
        above = _take_wide(work, middle + 1, middle, above, moved)
    S = add_six(add_six(below[0], above[0]), six(work, BLOCK, middle))
    P, Q = below[2], above[2]
    H, G = solve_columns(S, P), solve_columns(S, Q)
    keep_six(work, INVERSE, middle, S, moved)
    keep_nine(work, ELIMINATED, middle, H, moved)
    keep_nine(work, FAR, middle, G, moved)
    D, E = less_product(below[3], P, H), less_product(above[3], Q, G)
    solution = solve_symmetric(S, add(add(below[1], above[1]), column(work, RESIDUAL, middle)))
    set_column(work, _WIDE_OWN, middle, solution)
    g, h = plus_product(below[4], P, solution), plus_product(above[4], Q, solution)
    return E, h, D, g, _coupling(Q, H)


@jit_ordered
def reduce_between_wide(work: Any, n: int) -> Any:
    """Push the residuals through the factors: return the force at node n and that at node 0."""
    pairs, rounds, middle = ends_of(n)
    f = g = p = q = nothing_at(work, middle)
    for k in range(pairs):
        i, j = 1 + k, n - 1 - k
        g = plus_product(g, nine(work, FAR, i), force_on(work, i, f))
        f = reduce_wide_node(work, i, f)
        q = plus_product(q, nine(work, FAR, j), force_on(work, j, p))
        p = reduce_wide_node(work, j, p)
    if rounds > pairs:
        q = plus_product(q, nine(work, FAR, middle + 1), force_on(work, middle + 1, p))
        p = reduce_wide_node(work, middle + 1, p)
    force = add(add(f, p), column(work, RESIDUAL, middle))
    set_column(work, _WIDE_OWN, middle, solve_symmetric(six(work, INVERSE, middle), force))
    H = nine(work, ELIMINATED, middle)
    G = nine(work, FAR, middle)
    return plus_product(q, G, force), plus_product(g, H, force)


@jit_ordered_within
def _substituted_wide(work: Any, i: int, near: Any, far: Any) -> Any:
    """Store and return delta of node i from that nearer the middle and that of its rope's end."""
    x, y, z = substitute_wide_node(work, i, near)
    hx, hy, hz = nine(work, FAR, i)
    solution = (
        x + (hx[0] * far[0] + hy[0] * far[1] + hz[0] * far[2]),
        y + (hx[1] * far[0] + hy[1] * far[1] + hz[1] * far[2]),
        z + (hx[2] * far[0] + hy[2] * far[1] + hz[2] * far[2]),
    )
    set_column(work, CORRECTION, i, solution)
    return solution


@jit_ordered_within
def _middle_of_wide(solution: Any, H: Any, G: Any, low: Any, high: Any) -> Any:
    """Return a component of the middle node's delta; H, G: its row."""
    return (
        solution
        + (H[0] * low[0] + H[1] * low[1] + H[2] * low[2])
        + (G[0] * high[0] + G[1] * high[1] + G[2] * high[2])
    )


@jit_ordered
def substitute_between_wide(work: Any, n: int) -> None:
    """Back-substitute, given the corrections of both ends."""
    pairs, rounds, middle = ends_of(n)
    low, high = column(work, CORRECTION, ZERO), column(work, CORRECTION, n)
    solution = column(work, _WIDE_OWN, middle)
    a, b, c = nine(work, ELIMINATED, middle)
    u, v, w = nine(work, FAR, middle)
    near = (
        _middle_of_wide(solution[0], (a[0], b[0], c[0]), (u[0], v[0], w[0]), low, high),
        _middle_of_wide(solution[1], (a[1], b[1], c[1]), (u[1], v[1], w[1]), low, high),
        _middle_of_wide(solution[2], (a[2], b[2], c[2]), (u[2], v[2], w[2]), low, high),
    )
    set_column(work, CORRECTION, middle, near)
    further = near
    if rounds > pairs:
        further = _substituted_wide(work, middle + 1, near, high)
    for k in range(pairs - 1, -1, -1):
        near = _substituted_wide(work, 1 + k, near, low)
        further = _substituted_wide(work, n - 1 - k, further, high)
