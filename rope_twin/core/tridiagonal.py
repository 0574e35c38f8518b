"""Block-tridiagonal solver of the node equations, in O(n).

The elimination from one end is limited by the latency of its recursion, so the matrix is factorised
from both ends at once (twisted factorisation), one side per SIMD lane: pair k is the nodes
first + k and n - 1 - k, and both sides meet in the middle. The factors of a pair form a record
(core/elimination); records are contiguous in the rows ELIMINATED.

`reduce` solves for another residual with the factors of the last elimination.

`eliminate_wide` and `reduce_wide` do the same for a batch of ropes (core/lanes), one per lane, in
the order of operations of a single rope.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import (
    INVERSE,
    RECORD,
    add,
    add_six,
    eliminate_node,
    eliminate_pair,
    force_on,
    ground,
    hold_ends,
    keep_factors,
    keep_six,
    lanes,
    nine,
    nothing_at,
    pushed_on,
    reduce_node,
    reduce_pair,
    set_column,
    six,
    six_lanes,
    solve_symmetric,
    spring,
    substitute_pair,
    two,
    two_of_six,
)
from rope_twin.core.jit.decorators import jit_ordered, jit_ordered_within
from rope_twin.core.jit.rows import column, lane, pair, row, rows, span
from rope_twin.core.state import (
    AXIAL,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELIMINATED,
    GEOMETRIC,
    RESIDUAL,
    Floats,
)


@jit_ordered
def eliminate(work: Floats, first: int, n: int) -> None:
    """Factorise and solve for the corrections of the nodes first <= i < n.

    With an even number of nodes the upper one of the middle pair is eliminated onto the lower one,
    in an extra round whose first lane is unused.
    """
    pairs, rounds = (n - first - 1) // 2, (n - first) // 2
    middle = first + pairs
    records, at = row(work, ELIMINATED, 0), RECORD * pairs
    Z = two_of_six(ground(work, first), spring(work, n - 1))
    f = (pair(0.0, 0.0), pair(0.0, 0.0), pair(0.0, 0.0))
    for k in range(pairs):
        i, j = first + k, n - 1 - k
        Z, f = eliminate_pair(work, records, RECORD * k, (i, j), (i, j - 1), (Z, f))
    Z_below, f_below = Z, f
    if rounds > pairs:
        Z, f = eliminate_pair(work, records, at, (middle, middle + 1), (middle, middle), (Z, f))
    S = add_six(add_six(six_lanes(Z_below, 0), six_lanes(Z, 1)), six(work, BLOCK, middle))
    record = row(work, ELIMINATED, RECORD * rounds)
    for k in range(6):
        record[k] = S[k]
    _substitute_all(work, first, n, lanes(f_below, 0), lanes(f, 1))


@jit_ordered
def reduce(work: Floats, first: int, n: int) -> None:
    """Solve for another residual with the records of `eliminate`."""
    pairs, rounds = (n - first - 1) // 2, (n - first) // 2
    middle = first + pairs
    records = row(work, ELIMINATED, 0)
    f = (pair(0.0, 0.0), pair(0.0, 0.0), pair(0.0, 0.0))
    for k in range(pairs):
        f = reduce_pair(records, RECORD * k, pushed_on(work, first + k, n - 1 - k, f))
    f_below = f
    if rounds > pairs:
        f = reduce_pair(records, RECORD * pairs, pushed_on(work, middle, middle + 1, f))
    _substitute_all(work, first, n, lanes(f_below, 0), lanes(f, 1))


@jit_ordered
def _substitute_all(work: Floats, first: int, n: int, low: Any, high: Any) -> None:
    """Back-substitute from the middle outward; low, high: condensed force of either side."""
    dx, dy, dz = rows(work, CORRECTION, 0)
    pairs, rounds = (n - first - 1) // 2, (n - first) // 2
    middle = first + pairs
    record = row(work, ELIMINATED, RECORD * rounds)
    S = (record[0], record[1], record[2], record[3], record[4], record[5])
    force = (
        low[0] + high[0] + work[RESIDUAL, middle],
        low[1] + high[1] + work[RESIDUAL + 1, middle],
        low[2] + high[2] + work[RESIDUAL + 2, middle],
    )
    mx, my, mz = solve_symmetric(S, force)
    dx[middle], dy[middle], dz[middle] = mx, my, mz
    records = row(work, ELIMINATED, 0)
    p = two((mx, my, mz), (mx, my, mz))
    if rounds > pairs:
        ax, ay, az = lanes(substitute_pair(records, RECORD * pairs, p), 1)
        dx[middle + 1], dy[middle + 1], dz[middle + 1] = ax, ay, az
        p = two((mx, my, mz), (ax, ay, az))
    for k in range(pairs - 1, -1, -1):
        p = substitute_pair(records, RECORD * k, p)
        px, py, pz = p
        i, j = first + k, n - 1 - k
        dx[i], dx[j] = lane(px, 0), lane(px, 1)
        dy[i], dy[j] = lane(py, 0), lane(py, 1)
        dz[i], dz[j] = lane(pz, 0), lane(pz, 1)
    hold_ends(work, first, n)


@jit_ordered_within
def eliminate_wide_node(work: Any, i: int, e: int, Z: Any, f: Any, moved: Any) -> Any:
    """Eliminate node i through element e; return Z and condensed force on the neighbour.

    Only lanes in the mask `moved` update their factors.
    """
    S, t, a, b = pivot_of(work, i, e, Z)
    gain, solution, schur, pushed, inverse = eliminate_node(S, force_on(work, i, f), t, a, b)
    keep_factors(work, i, (gain[:3], gain[3:6], gain[6:]), solution, inverse, moved)
    return schur, pushed


@jit_ordered_within
def pivot_of(work: Any, i: int, e: int, Z: Any) -> Any:
    """Return Ŝ of node i, and direction, AXIAL and GEOMETRIC of element e."""
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    x, y, z = rows(work, DIRECTION, 0)
    axial, geometric = row(work, AXIAL, 0), row(work, GEOMETRIC, 0)
    b = geometric[e]
    S = (
        Z[0] + (Axx[i] + b), Z[1] + Axy[i], Z[2] + Axz[i],
        Z[3] + (Ayy[i] + b), Z[4] + Ayz[i], Z[5] + (Azz[i] + b),
    )  # fmt: skip
    return S, (x[e], y[e], z[e]), axial[e], b


@jit_ordered_within
def reduce_wide_node(work: Any, i: int, f: Any) -> Any:
    """Return the condensed force on the neighbour of node i, with its existing factors."""
    gain = six(work, ELIMINATED, i) + column(work, ELIMINATED + 6, i)
    solution, pushed = reduce_node(gain, six(work, INVERSE, i), force_on(work, i, f))
    set_column(work, ELIMINATED + 9, i, solution)
    return pushed


@jit_ordered_within
def substitute_wide_node(work: Any, i: int, d: Any) -> Any:
    """Store and return delta of node i, given that of its neighbour nearer the middle."""
    (x, y, z), (a, b, c) = column(work, ELIMINATED + 9, i), nine(work, ELIMINATED, i)
    delta = (
        (x + a[0] * d[0]) + (a[1] * d[1] + a[2] * d[2]),
        (y + b[0] * d[0]) + (b[1] * d[1] + b[2] * d[2]),
        (z + c[0] * d[0]) + (c[1] * d[1] + c[2] * d[2]),
    )
    set_column(work, CORRECTION, i, delta)
    return delta


@jit_ordered
def eliminate_wide(work: Any, first: int, n: int, moved: Any) -> None:
    """Eliminate from both ends at once and solve for the one or two nodes in the middle.

    moved: lanes whose factors are updated; the others keep theirs.
    """
    pairs, rounds = (n - first - 1) // 2, (n - first) // 2
    middle = first + pairs
    Z_low, Z_high = ground(work, first), spring(work, n - 1)
    f_low = f_high = nothing_at(work, middle)
    for k in range(pairs):
        i, j = first + k, n - 1 - k
        Z_low, f_low = eliminate_wide_node(work, i, i, Z_low, f_low, moved)
        Z_high, f_high = eliminate_wide_node(work, j, j - 1, Z_high, f_high, moved)
    if rounds > pairs:
        Z_high, f_high = eliminate_wide_node(work, middle + 1, middle, Z_high, f_high, moved)
    S = add_six(add_six(Z_low, Z_high), six(work, BLOCK, middle))
    keep_six(work, INVERSE, middle, S, moved)
    _solve_middle(work, first, n, f_low, f_high)


@jit_ordered
def reduce_wide(work: Any, first: int, n: int) -> None:
    """Solve for another residual with the existing factors of each lane, up to the middle nodes."""
    pairs, rounds = (n - first - 1) // 2, (n - first) // 2
    middle = first + pairs
    f_low = f_high = nothing_at(work, middle)
    for k in range(pairs):
        f_low = reduce_wide_node(work, first + k, f_low)
        f_high = reduce_wide_node(work, n - 1 - k, f_high)
    if rounds > pairs:
        f_high = reduce_wide_node(work, middle + 1, f_high)
    _solve_middle(work, first, n, f_low, f_high)


@jit_ordered_within
def _solve_middle(work: Any, first: int, n: int, f_low: Any, f_high: Any) -> None:
    """Solve for the one or two nodes in the middle; f: condensed force from either side."""
    pairs, rounds = (n - first - 1) // 2, (n - first) // 2
    middle = first + pairs
    force = add(add(f_low, f_high), column(work, RESIDUAL, middle))
    d = solve_symmetric(six(work, INVERSE, middle), force)
    set_column(work, CORRECTION, middle, d)
    if rounds > pairs:
        substitute_wide_node(work, middle + 1, d)
    hold_ends(work, first, n)


@jit_ordered
def substitute_wide(work: Any, first: int, n: int, low: int, high: int) -> None:
    """Back-substitute the pairs low <= k < high from the middle outward.

    Pair k is the nodes first + k and n - 1 - k.
    """
    below = column(work, CORRECTION, first + high)
    above = column(work, CORRECTION, n - 1 - high)
    for k in range(high - 1, low - 1, -1):
        below = substitute_wide_node(work, first + k, below)
        above = substitute_wide_node(work, n - 1 - k, above)
