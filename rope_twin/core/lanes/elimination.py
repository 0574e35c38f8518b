"""The direct solve of `core/elimination` for ropes in lanes, in the same order of operations."""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import (
    add_six,
    eliminate_node,
    ground,
    hold_ends,
    solve_symmetric,
    spring,
)
from rope_twin.core.jit import jit_ordered, jit_ordered_within
from rope_twin.core.rows import row, rows, span
from rope_twin.core.state import (
    AXIAL,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELIMINATED,
    GEOMETRIC,
    RESIDUAL,
)


@jit_ordered_within
def _eliminate(work: Any, i: int, e: int, Z: Any, f: Any) -> Any:
    """Eliminate node i through element e; Z and force for the neighbour are returned."""
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    x, y, z = rows(work, DIRECTION, 0)
    axial, geometric = row(work, AXIAL, 0), row(work, GEOMETRIC, 0)
    b = geometric[e]
    S = (
        Z[0] + (Axx[i] + b), Z[1] + Axy[i], Z[2] + Axz[i],
        Z[3] + (Ayy[i] + b), Z[4] + Ayz[i], Z[5] + (Azz[i] + b),
    )  # fmt: skip
    force = (f[0] + Rx[i], f[1] + Ry[i], f[2] + Rz[i])
    t = (x[e], y[e], z[e])
    gain, own, left, pushed = eliminate_node(S, force, t, axial[e], b)
    gxx, gxy, gxz, gyx, gyy, gyz, gzx, gzy, gzz, px, py, pz = span(work, ELIMINATED, 12, 0)
    gxx[i] = gain[0]
    gxy[i] = gain[1]
    gxz[i] = gain[2]
    gyx[i] = gain[3]
    gyy[i] = gain[4]
    gyz[i] = gain[5]
    gzx[i] = gain[6]
    gzy[i] = gain[7]
    gzz[i] = gain[8]
    px[i] = own[0]
    py[i] = own[1]
    pz[i] = own[2]
    return left, pushed


@jit_ordered_within
def _substitute(work: Any, i: int, d: Any) -> Any:
    """delta of node i from that of its neighbour nearer the middle, kept and returned."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz, x, y, z = span(work, ELIMINATED, 12, 0)
    dx, dy, dz = rows(work, CORRECTION, 0)
    px, py, pz = d
    qx = (x[i] + xx[i] * px) + (xy[i] * py + xz[i] * pz)
    qy = (y[i] + yx[i] * px) + (yy[i] * py + yz[i] * pz)
    qz = (z[i] + zx[i] * px) + (zy[i] * py + zz[i] * pz)
    dx[i] = qx
    dy[i] = qy
    dz[i] = qz
    return qx, qy, qz


@jit_ordered
def eliminate_wide(work: Any, first: int, n: int) -> None:
    """Eliminate from both ends at once; corrections of the one or two nodes in the middle."""
    pairs, rounds = (n - first - 1) // 2, (n - first) // 2
    middle = first + pairs
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    Z_low, Z_high = ground(work, first), spring(work, n - 1)
    zero = Rx[middle] * 0.0
    f_low, f_high = (zero, zero, zero), (zero, zero, zero)
    for k in range(pairs):
        i, j = first + k, n - 1 - k
        Z_low, f_low = _eliminate(work, i, i, Z_low, f_low)
        Z_high, f_high = _eliminate(work, j, j - 1, Z_high, f_high)
    if rounds > pairs:
        Z_high, f_high = _eliminate(work, middle + 1, middle, Z_high, f_high)
    A = (Axx[middle], Axy[middle], Axz[middle], Ayy[middle], Ayz[middle], Azz[middle])
    S = add_six(add_six(Z_low, Z_high), A)
    force = (
        f_low[0] + f_high[0] + Rx[middle],
        f_low[1] + f_high[1] + Ry[middle],
        f_low[2] + f_high[2] + Rz[middle],
    )
    d = solve_symmetric(S, force)
    dx, dy, dz = rows(work, CORRECTION, middle)
    dx[0] = d[0]
    dy[0] = d[1]
    dz[0] = d[2]
    if rounds > pairs:
        _substitute(work, middle + 1, d)
    hold_ends(work, first, n)


@jit_ordered
def substitute_wide(work: Any, first: int, n: int, low: int, high: int) -> None:
    """Corrections of the pairs low <= k < high, once those nearer the middle are there.

    Pair k is the nodes first + k and n - 1 - k.
    """
    dx, dy, dz = rows(work, CORRECTION, 0)
    i, j = first + high, n - 1 - high
    below, above = (dx[i], dy[i], dz[i]), (dx[j], dy[j], dz[j])
    for k in range(high - 1, low - 1, -1):
        below = _substitute(work, first + k, below)
        above = _substitute(work, n - 1 - k, above)
