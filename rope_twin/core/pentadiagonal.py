"""Block-pentadiagonal solver of the node equations, in O(n), for ropes with bending stiffness.

The matrix is factorised from both ends at once, one side per SIMD lane, as in `core/tridiagonal`:
pair k is the nodes first + k and n - 1 - k; the two or three middle nodes are eliminated one by
one. The factors of a pair are a record of 36 numbers, 24 in the rows ELIMINATED and 12 in FACTOR;
records are contiguous. In ELIMINATED the Schur complements of both sides on the middle follow.

`eliminate_coupled_wide` and `reduce_coupled_wide` do the same for a batch of ropes (core/lanes),
one per lane, in the order of operations of a single rope. The factors of a node are then in its own
column, as in a tridiagonal system; the Schur complements of both sides on the middle are in the
columns of its lowest and highest node.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import (
    INVERSE,
    add,
    add_nine,
    add_six,
    eliminate_coupled_node,
    force_on,
    ground,
    hold_ends,
    keep_factors,
    keep_six,
    lanes,
    link_less,
    load_three,
    nine,
    nothing_at,
    onto_next,
    pushed_on,
    reduce_coupled_node,
    scaled,
    set_column,
    six,
    six_lanes,
    solve_symmetric,
    spring,
    store_three,
    substituted,
    two,
    two_of_six,
)
from rope_twin.core.jit.decorators import jit, jit_ordered, jit_ordered_within, jit_within
from rope_twin.core.jit.rows import column, gather, lane, pair, row, rows, span
from rope_twin.core.jit.wide import choose
from rope_twin.core.state import (
    AXIAL,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELIMINATED,
    FACTOR,
    GEOMETRIC,
    LINK,
    RESIDUAL,
    Floats,
)

SECOND = LINK + 1  # coupling with the second next node


@jit_ordered_within
def single_node(work: Floats, i: int, state: Any, K: Any, c: float, d: float) -> Any:
    """Eliminate node i of one chain, with its next element K and its couplings c and d.

    state: Schur complement and condensed force on node i, those on the next node, and their
    coupling.
    """
    S, f, carried, cross = state
    S = add_six(add_six(S, six(work, BLOCK, i)), K)
    f = add(f, column(work, RESIDUAL, i))
    factors, schur = eliminate_coupled_node(S, f, add_nine(cross, link_less(c, K)), d)
    return factors, onto_next(schur, carried, K)


@jit_within
def keep_node(work: Any, i: int, factors: Any) -> None:
    """Store the factors of node i for the back-substitution."""
    solution, G, inverse = factors
    for k in range(3):
        set_column(work, ELIMINATED + 3 * k, i, G[k])
    set_column(work, ELIMINATED + 9, i, solution)
    for k in range(6):
        work[INVERSE + k, i] = inverse[k]


@jit_within
def kept_of(work: Any, i: int) -> Any:
    """Load the factors of node i."""
    return column(work, ELIMINATED + 9, i), nine(work, ELIMINATED, i), six(work, INVERSE, i)


@jit
def take_links(work: Floats, n: int) -> None:
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


RECORD, MORE = 24, 12  # numbers of a pair in ELIMINATED, and in FACTOR


@jit_within
def _gathered_six(work: Floats, i: int, j: int) -> Any:
    """Return the blocks of the nodes i and j."""
    xx, xy, xz, yy, yz, zz = span(work, BLOCK, 6, 0)
    return (
        gather(xx, i, j), gather(xy, i, j), gather(xz, i, j), gather(yy, i, j), gather(yz, i, j),
        gather(zz, i, j),
    )  # fmt: skip


@jit_ordered_within
def _springs(work: Floats, i: int, e: int) -> Any:
    """Return K of the elements i and e."""
    tx, ty, tz = rows(work, DIRECTION, 0)
    x, y, z = gather(tx, i, e), gather(ty, i, e), gather(tz, i, e)
    a, b = gather(row(work, AXIAL, 0), i, e), gather(row(work, GEOMETRIC, 0), i, e)
    ax, ay = a * x, a * y
    return ax * x + b, ax * y, ax * z, ay * y + b, ay * z, (a * z) * z + b


@jit_ordered_within
def _paired_node(work: Floats, i: int, j: int, k: int, state: Any) -> Any:
    """Eliminate node i onto those above it and node j onto those below; store record k."""
    S, f, carried, cross = state
    K = _springs(work, i, j - 1)
    S = add_six(add_six(S, _gathered_six(work, i, j)), K)
    f = pushed_on(work, i, j, f)
    B = add_nine(cross, link_less(gather(row(work, LINK, 0), i, j - 1), K))
    factors, schur = eliminate_coupled_node(S, f, B, gather(row(work, SECOND, 0), i, j - 2))
    _store(work, k, factors)
    return onto_next(schur, carried, K)


@jit_within
def _store(work: Floats, k: int, factors: Any) -> None:
    """Store record k."""
    solution, G, I = factors
    record, more = row(work, ELIMINATED, RECORD * k), row(work, FACTOR, MORE * k)
    store_three(record, 0, solution)
    store_three(record, 6, G[0])
    store_three(record, 12, G[1])
    store_three(record, 18, G[2])
    store_three(more, 0, I[:3])
    store_three(more, 6, I[3:])


@jit_within
def _stored(work: Floats, k: int) -> Any:
    """Load record k."""
    r, m = row(work, ELIMINATED, RECORD * k), row(work, FACTOR, MORE * k)
    G = load_three(r, 6), load_three(r, 12), load_three(r, 18)
    return load_three(r, 0), G, load_three(m, 0) + load_three(m, 6)


@jit_within
def _lanes_of(state: Any, k: int) -> Any:
    """Return lane k of the elimination state; see `single_node`."""
    S, f, (second, far), (x, y, z) = state
    carried = (six_lanes(second, k), lanes(far, k))
    return six_lanes(S, k), lanes(f, k), carried, (lanes(x, k), lanes(y, k), lanes(z, k))


@jit_ordered_within
def _solve_middle(work: Floats, middle: int, rest: int, below: Any, above: Any) -> Any:
    """Solve the 2 or 3 nodes from `middle` on; return delta of the lowest and highest two.

    The highest two are ordered inwards. below, above: Schur complements of both sides on the lowest
    and the highest of them.
    """
    zero = nothing_at(work, middle)
    zeros = zero + zero
    high, low = middle + rest - 1, middle + rest - 2
    factors = zero, (zero, zero, zero), zeros
    if rest == 3:
        c, d = work[LINK, middle], work[LINK + 1, middle]
        factors, below = single_node(work, middle, below, spring(work, middle), c, d)
    S, f, (S_next, f_next), cross = below
    S_high, f_high, (S_low, f_low), (x, y, z) = above
    transposed = (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])
    after = add_six(S_next, S_high), add(f_next, f_high)
    state = add_six(S, S_low), add(f, f_low), after, add_nine(cross, transposed)
    kept_low, state = single_node(work, low, state, spring(work, low), work[LINK, low], 0.0)
    (delta_high, _, _), _ = single_node(work, high, state, zeros, 0.0, 0.0)
    delta_low = substituted(kept_low, delta_high, zero)
    set_column(work, CORRECTION, high, delta_high)
    set_column(work, CORRECTION, low, delta_low)
    near, far = delta_low, delta_high
    if rest == 3:
        d = work[SECOND, middle]
        near, far = substituted(factors, delta_low, scaled(d, delta_high)), delta_low
        set_column(work, CORRECTION, middle, near)
    return near, far, delta_high, delta_low


@jit_ordered
def eliminate_coupled(work: Floats, first: int, n: int) -> None:
    """Factorise and solve for the corrections of the nodes first <= i < n; others get 0."""
    if n - first == 1:
        _solve_one(work, first, n)
        return
    pairs = (n - first - 2) // 2
    zero = pair(0.0, 0.0)
    zeros = (zero, zero, zero)
    S = two_of_six(ground(work, first), spring(work, n - 1))
    state = S, zeros, ((zero, zero, zero, zero, zero, zero), zeros), (zeros, zeros, zeros)
    for k in range(pairs):
        state = _paired_node(work, first + k, n - 1 - k, k, state)
    _store_middle(work, pairs, state)
    _substitute_folded(work, first, n, state)


@jit_ordered
def _solve_one(work: Floats, i: int, n: int) -> None:
    """Solve for the correction of the only free node."""
    S = add_six(add_six(ground(work, i), spring(work, i)), six(work, BLOCK, i))
    set_column(work, CORRECTION, i, solve_symmetric(S, column(work, RESIDUAL, i)))
    hold_ends(work, i, n)


@jit_within
def _store_middle(work: Floats, pairs: int, state: Any) -> None:
    """Store the Schur complements on the middle, after the records of the pairs."""
    S, _, (second, _), (x, y, z) = state
    record = row(work, ELIMINATED, RECORD * pairs)
    store_three(record, 0, S[:3])
    store_three(record, 6, S[3:])
    store_three(record, 12, second[:3])
    store_three(record, 18, second[3:])
    store_three(record, 24, x)
    store_three(record, 30, y)
    store_three(record, 36, z)


@jit_within
def _stored_middle(work: Floats, pairs: int, f: Any, far: Any) -> Any:
    """Load the Schur complements on the middle; f, far: forces on it and on the next node."""
    r = row(work, ELIMINATED, RECORD * pairs)
    S, second = load_three(r, 0) + load_three(r, 6), load_three(r, 12) + load_three(r, 18)
    return S, f, (second, far), (load_three(r, 24), load_three(r, 30), load_three(r, 36))


@jit_ordered
def reduce_coupled(work: Floats, first: int, n: int) -> None:
    """Solve for another residual with the records of `eliminate_coupled`."""
    if n - first == 1:
        _solve_one(work, first, n)
        return
    pairs = (n - first - 2) // 2
    f = carried = (pair(0.0, 0.0), pair(0.0, 0.0), pair(0.0, 0.0))
    for k in range(pairs):
        i, j = first + k, n - 1 - k
        _, G, I = _stored(work, k)
        force = pushed_on(work, i, j, f)
        d = gather(row(work, SECOND, 0), i, j - 2)
        solution, pushed, far = reduce_coupled_node(force, G, I, d)
        f, carried = add(carried, pushed), far
        store_three(row(work, ELIMINATED, RECORD * k), 0, solution)
    _substitute_folded(work, first, n, _stored_middle(work, pairs, f, carried))


@jit_ordered
def _substitute_folded(work: Floats, first: int, n: int, state: Any) -> None:
    """Back-substitute from the middle outward; state: the Schur complements of both sides there."""
    dx, dy, dz = rows(work, CORRECTION, 0)
    pairs = (n - first - 2) // 2
    near_low, far_low, near_high, far_high = _solve_middle(
        work, first + pairs, n - first - 2 * pairs, _lanes_of(state, 0), _lanes_of(state, 1)
    )
    near, far = two(near_low, near_high), two(far_low, far_high)
    for k in range(pairs - 1, -1, -1):
        i, j = first + k, n - 1 - k
        d = gather(row(work, SECOND, 0), i, j - 2)
        near, far = substituted(_stored(work, k), near, scaled(d, far)), near
        x, y, z = near
        dx[i], dx[j] = lane(x, 0), lane(x, 1)
        dy[i], dy[j] = lane(y, 0), lane(y, 1)
        dz[i], dz[j] = lane(z, 0), lane(z, 1)
    hold_ends(work, first, n)


@jit_ordered
def eliminate_coupled_wide(work: Any, first: int, n: int, moved: Any) -> None:
    """Factorise and solve, as `eliminate_coupled`, in all lanes.

    moved: mask of the lanes whose factors are updated.
    """
    if n - first == 1:
        _solve_one(work, first, n)
        return
    pairs, zeros = (n - first - 2) // 2, nothing_at(work, first)
    low = ground(work, first), zeros, (zeros + zeros, zeros), (zeros, zeros, zeros)
    high = spring(work, n - 1), zeros, (zeros + zeros, zeros), (zeros, zeros, zeros)
    for k in range(pairs):
        i, j = first + k, n - 1 - k
        factors, low = single_node(work, i, low, spring(work, i), work[LINK, i], work[SECOND, i])
        _keep_chosen(work, i, factors, moved)
        K, c, d = spring(work, j - 1), work[LINK, j - 1], work[SECOND, j - 2]
        factors, high = single_node(work, j, high, K, c, d)
        _keep_chosen(work, j, factors, moved)
    _keep_side(work, first + pairs, low, moved)
    _keep_side(work, n - 1 - pairs, high, moved)
    _substitute_wide(work, first, n, low, high)


@jit_within
def _keep_chosen(work: Any, i: int, factors: Any, moved: Any) -> None:
    """Store the factors of node i in the lanes of `moved`, its solution in all lanes."""
    solution, G, inverse = factors
    keep_factors(work, i, G, solution, inverse, moved)


@jit_within
def _keep_side(work: Any, i: int, state: Any, moved: Any) -> None:
    """Store the Schur complements of one side on the middle in column i, in the lanes `moved`."""
    S, f, (second, _), cross = state
    _keep_chosen(work, i, (f, cross, second), moved)
    keep_six(work, FACTOR, i, S, moved)


@jit_within
def _kept_side(work: Any, i: int, f: Any, far: Any) -> Any:
    """Load what `_keep_side` stored; f, far: forces on the middle's outer node and the next."""
    _, cross, second = kept_of(work, i)
    return six(work, FACTOR, i), f, (second, far), cross


@jit_ordered
def reduce_coupled_wide(work: Any, first: int, n: int) -> None:
    """Solve for another residual with the factors of each lane, as `reduce_coupled`."""
    if n - first == 1:
        _solve_one(work, first, n)
        return
    pairs = (n - first - 2) // 2
    low = high = far_low = far_high = nothing_at(work, first)
    for k in range(pairs):
        i, j = first + k, n - 1 - k
        low, far_low = _reduce_node(work, i, work[SECOND, i], low, far_low)
        high, far_high = _reduce_node(work, j, work[SECOND, j - 2], high, far_high)
    below = _kept_side(work, first + pairs, low, far_low)
    _substitute_wide(work, first, n, below, _kept_side(work, n - 1 - pairs, high, far_high))


@jit_ordered_within
def _reduce_node(work: Any, i: int, d: Any, f: Any, carried: Any) -> Any:
    """Store the solution of node i; return the forces on the next node and the second next."""
    _, G, I = kept_of(work, i)
    solution, pushed, far = reduce_coupled_node(force_on(work, i, f), G, I, d)
    set_column(work, ELIMINATED + 9, i, solution)
    return add(carried, pushed), far


@jit_ordered
def _substitute_wide(work: Any, first: int, n: int, below: Any, above: Any) -> None:
    """Back-substitute from the middle outward; below, above: Schur complements of both sides."""
    pairs = (n - first - 2) // 2
    near_low, far_low, near_high, far_high = _solve_middle(
        work, first + pairs, n - first - 2 * pairs, below, above
    )
    for k in range(pairs - 1, -1, -1):
        i, j = first + k, n - 1 - k
        pushed = scaled(work[SECOND, i], far_low)
        near_low, far_low = substituted(kept_of(work, i), near_low, pushed), near_low
        set_column(work, CORRECTION, i, near_low)
        pushed = scaled(work[SECOND, j - 2], far_high)
        near_high, far_high = substituted(kept_of(work, j), near_high, pushed), near_high
        set_column(work, CORRECTION, j, near_high)
    hold_ends(work, first, n)


@jit
def take_links_wide(work: Any, n: int, chosen: Any) -> None:
    """Subtract the effect of the couplings from the residual in the lanes `chosen`."""
    c, d = row(work, LINK, 0), row(work, SECOND, 0)
    for k in range(3):
        for i in range(n):
            R = work[RESIDUAL + k, i] - c[i] * work[CORRECTION + k, i + 1]
            if i > 0:
                R -= c[i - 1] * work[CORRECTION + k, i - 1]
            if i < n - 1:
                R -= d[i] * work[CORRECTION + k, i + 2]
            if i > 1:
                R -= d[i - 2] * work[CORRECTION + k, i - 2]
            work[RESIDUAL + k, i] = choose(chosen, R, work[RESIDUAL + k, i])
