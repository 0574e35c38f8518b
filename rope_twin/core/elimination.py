"""The O(N) direct solve of (A + K)·delta = R for a chain of 3×3 blocks.

A_i are the symmetric node blocks, K_e = root·rootᵀ + b·I the element blocks (root = √AXIAL·t,
b = GEOMETRIC). Nodes are eliminated one after the other; what an eliminated part leaves on its
neighbour is Z = K - K·(S + K)⁻¹·K, formed with the adjugate of S and one division, never as that
difference: K over the mass reaches 1e6 for short stiff elements and would cancel.

With Ŝ = S + b·I, C = adj Ŝ, det = det Ŝ, u = C·root, Δ = det + root·u and Q = adj(Ŝ + root·rootᵀ):
(S + K)⁻¹ = Q/Δ, (S + K)⁻¹·K = (u·rootᵀ + b·Q)/Δ,
Z = b·I + (det·root·rootᵀ - b·(u·rootᵀ + root·uᵀ) - b²·Q)/Δ.

`eliminate` goes from both ends at once, one chain in each SIMD lane, since a single chain is bound
by the latency of its own recursion; the chains meet in the middle. `eliminate_plainly` is its
readable twin, from the lower end to the hang-off: plain Python uses it, a test holds them equal.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from numba.core import config

from rope_twin.core.jit import jit, jit_ordered, jit_within
from rope_twin.core.rows import row, rows, span
from rope_twin.core.simd import gather, lane, load, pair, store
from rope_twin.core.state import (
    AXIAL,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELIMINATED,
    GEOMETRIC,
    RESIDUAL,
    ROOT,
    ZERO,
)


@jit
def root_stiffness(work: Any, low: int, high: int) -> None:
    """root = √AXIAL·t of the elements low <= e < high."""
    axial = row(work, AXIAL, low)
    tx, ty, tz = rows(work, DIRECTION, low)
    x, y, z = rows(work, ROOT, low)
    for e in range(high - low):
        size = sqrt(axial[e])
        x[e] = size * tx[e]
        y[e] = size * ty[e]
        z[e] = size * tz[e]


@jit_within
def eliminate_node(S: Any, f: Any, root: Any, b: Any) -> Any:
    """Eliminate a node through its next element.

    S: xx, xy, xz, yy, yz, zz of Ŝ; f: its force. Returns (S + K)⁻¹·K by rows, (S + K)⁻¹·f, and Z
    and force for the neighbour.
    """
    sxx, sxy, sxz, syy, syz, szz = S
    fx, fy, fz = f
    x, y, z = root
    pxx, pyy, pzz, pxy, pxz, pyz = x * x, y * y, z * z, x * y, x * z, y * z
    cxx = syy * szz - syz * syz
    cxy = sxz * syz - sxy * szz
    cxz = sxy * syz - sxz * syy
    cyy = sxx * szz - sxz * sxz
    cyz = sxy * sxz - sxx * syz
    czz = sxx * syy - sxy * sxy
    ux = (cxx * x + cxy * y) + cxz * z
    uy = (cxy * x + cyy * y) + cyz * z
    uz = (cxz * x + cyz * y) + czz * z
    det = (sxx * cxx + sxy * cxy) + sxz * cxz
    # root·u from the products of root, which are ready before C: the division waits for it
    diagonal = (cxx * pxx + cyy * pyy) + (det + czz * pzz)
    inverse = 1.0 / (diagonal + ((cxy * (pxy + pxy) + cxz * (pxz + pxz)) + cyz * (pyz + pyz)))
    qxx = (cxx + pzz * syy) + (pyy * szz - (pyz + pyz) * syz)
    qyy = (cyy + pzz * sxx) + (pxx * szz - (pxz + pxz) * sxz)
    qzz = (czz + pyy * sxx) + (pxx * syy - (pxy + pxy) * sxy)
    qxy = (cxy - pzz * sxy) + ((pxz * syz + pyz * sxz) - pxy * szz)
    qxz = (cxz - pyy * sxz) + ((pyz * sxy + pxy * syz) - pxz * syy)
    qyz = (cyz - pxx * syz) + ((pxz * sxy + pxy * sxz) - pyz * sxx)
    # what this node leaves on the next: the matrix Z ...
    rx, ry, rz = b * ux, b * uy, b * uz
    kx, ky, kz = det * x - rx, det * y - ry, det * z - rz
    bb = b * b
    zxx = b + inverse * ((kx - rx) * x - bb * qxx)
    zyy = b + inverse * ((ky - ry) * y - bb * qyy)
    zzz = b + inverse * ((kz - rz) * z - bb * qzz)
    zxy = inverse * (kx * y - (ry * x + bb * qxy))
    zxz = inverse * (kx * z - (rz * x + bb * qxz))
    zyz = inverse * (ky * z - (rz * y + bb * qyz))
    # ... and the force
    gx = qxx * fx + qxy * fy + qxz * fz
    gy = qxy * fx + qyy * fy + qyz * fz
    gz = qxz * fx + qyz * fy + qzz * fz
    along = ux * fx + uy * fy + uz * fz
    ib = inverse * b
    wx, wy, wz = inverse * ux, inverse * uy, inverse * uz
    gain = (
        wx * x + ib * qxx, wx * y + ib * qxy, wx * z + ib * qxz,
        wy * x + ib * qxy, wy * y + ib * qyy, wy * z + ib * qyz,
        wz * x + ib * qxz, wz * y + ib * qyz, wz * z + ib * qzz,
    )  # fmt: skip
    own = (inverse * gx, inverse * gy, inverse * gz)
    force = (
        inverse * (along * x + b * gx),
        inverse * (along * y + b * gy),
        inverse * (along * z + b * gz),
    )
    return gain, own, (zxx, zxy, zxz, zyy, zyz, zzz), force


@jit_within
def spring(work: Any, e: int) -> Any:
    """K of element e: xx, xy, xz, yy, yz, zz."""
    x, y, z, b = work[ROOT, e], work[ROOT + 1, e], work[ROOT + 2, e], work[GEOMETRIC, e]
    return x * x + b, x * y, x * z, y * y + b, y * z, z * z + b


@jit_within
def _ground(work: Any, first: int) -> Any:
    """Z of the lowest free node: nothing, or the element to the fixed node below it."""
    xx, xy, xz, yy, yz, zz = spring(work, ZERO)
    tied = 1.0 if first == 1 else 0.0
    return tied * xx, tied * xy, tied * xz, tied * yy, tied * yz, tied * zz


@jit_within
def _plain_node(work: Any, i: int, e: int, Z: Any, f: Any) -> Any:
    """Eliminate node i through element e, one chain."""
    zxx, zxy, zxz, zyy, zyz, zzz = Z
    fx, fy, fz = f
    b = work[GEOMETRIC, e]
    S = (
        zxx + (work[BLOCK, i] + b), zxy + work[BLOCK + 1, i], zxz + work[BLOCK + 2, i],
        zyy + (work[BLOCK + 3, i] + b), zyz + work[BLOCK + 4, i], zzz + (work[BLOCK + 5, i] + b),
    )  # fmt: skip
    force = (
        fx + work[RESIDUAL, i], fy + work[RESIDUAL + 1, i], fz + work[RESIDUAL + 2, i],
    )  # fmt: skip
    root = (work[ROOT, e], work[ROOT + 1, e], work[ROOT + 2, e])
    return eliminate_node(S, force, root, b)


@jit_ordered
def eliminate_plainly(work: Any, first: int, n: int) -> None:
    """Corrections of the nodes first <= i < n; they are 0 at n and below first."""
    Z, f = _ground(work, first), (0.0, 0.0, 0.0)
    for i in range(first, n):
        gain, own, Z, f = _plain_node(work, i, i, Z, f)
        for k in range(9):
            work[ELIMINATED + k, i] = gain[k]
        for k in range(3):
            work[ELIMINATED + 9 + k, i] = own[k]
    dx = dy = dz = 0.0
    for i in range(n - 1, first - 1, -1):
        G = work[ELIMINATED : ELIMINATED + 12]
        dx, dy, dz = (
            G[9, i] + G[0, i] * dx + G[1, i] * dy + G[2, i] * dz,
            G[10, i] + G[3, i] * dx + G[4, i] * dy + G[5, i] * dz,
            G[11, i] + G[6, i] * dx + G[7, i] * dy + G[8, i] * dz,
        )
        work[CORRECTION, i], work[CORRECTION + 1, i], work[CORRECTION + 2, i] = dx, dy, dz
    hold_ends(work, first, n)


@jit_within
def hold_ends(work: Any, first: int, n: int) -> None:
    """No correction where motion is prescribed."""
    for k in range(3):
        work[CORRECTION + k, n] = 0.0
        if first == 1:
            work[CORRECTION + k, 0] = 0.0


@jit_within
def _paired_node(work: Any, i: int, j: int, at: int, Z: Any, f: Any) -> Any:
    """Eliminate node i through the element above it and node j through the one below.

    What the substitution wants of them goes to columns at, at + 1 of ELIMINATED; Z and force for
    the neighbours are returned.
    """
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    x, y, z = rows(work, ROOT, 0)
    e = j - 1
    b = gather(row(work, GEOMETRIC, 0), i, e)
    S = (
        Z[0] + (gather(Axx, i, j) + b), Z[1] + gather(Axy, i, j), Z[2] + gather(Axz, i, j),
        Z[3] + (gather(Ayy, i, j) + b), Z[4] + gather(Ayz, i, j), Z[5] + (gather(Azz, i, j) + b),
    )  # fmt: skip
    force = (f[0] + gather(Rx, i, j), f[1] + gather(Ry, i, j), f[2] + gather(Rz, i, j))
    root = (gather(x, i, e), gather(y, i, e), gather(z, i, e))
    gain, own, left, pushed = eliminate_node(S, force, root, b)
    gxx, gxy, gxz, gyx, gyy, gyz, gzx, gzy, gzz, px, py, pz = span(work, ELIMINATED, 12, at)
    store(gxx, 0, gain[0])
    store(gxy, 0, gain[1])
    store(gxz, 0, gain[2])
    store(gyx, 0, gain[3])
    store(gyy, 0, gain[4])
    store(gyz, 0, gain[5])
    store(gzx, 0, gain[6])
    store(gzy, 0, gain[7])
    store(gzz, 0, gain[8])
    store(px, 0, own[0])
    store(py, 0, own[1])
    store(pz, 0, own[2])
    return left, pushed


@jit_ordered
def solve_symmetric(S: Any, f: Any) -> Any:
    """x of S·x = f for a symmetric 3×3 matrix (xx, xy, xz, yy, yz, zz), by LDLᵀ."""
    sxx, sxy, sxz, syy, syz, szz = S
    fx, fy, fz = f
    l10, l20 = sxy / sxx, sxz / sxx
    d1, m = syy - l10 * sxy, syz - l10 * sxz
    l21 = m / d1
    d2 = szz - l20 * sxz - l21 * m
    fy -= l10 * fx
    fz -= l20 * fx + l21 * fy
    dz = fz / d2
    dy = fy / d1 - l21 * dz
    return fx / sxx - l10 * dy - l20 * dz, dy, dz


@jit_within
def _six(work: Any, first: int, i: int) -> Any:
    """Column i of six rows."""
    return (
        work[first, i], work[first + 1, i], work[first + 2, i], work[first + 3, i],
        work[first + 4, i], work[first + 5, i],
    )  # fmt: skip


@jit_within
def _lanes(p: Any, k: int) -> Any:
    """Lane k of three pairs."""
    return lane(p[0], k), lane(p[1], k), lane(p[2], k)


@jit_within
def _six_lanes(p: Any, k: int) -> Any:
    """Lane k of six pairs."""
    return lane(p[0], k), lane(p[1], k), lane(p[2], k), lane(p[3], k), lane(p[4], k), lane(p[5], k)


@jit_within
def add_six(a: Any, b: Any) -> Any:
    """Sum of two symmetric matrices."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@jit_within
def _substitute(work: Any, at: int, px: Any, py: Any, pz: Any) -> Any:
    """delta of a pair of nodes from that of their neighbours nearer the middle."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz, x, y, z = span(work, ELIMINATED, 12, at)
    return (
        (load(x, 0) + load(xx, 0) * px) + (load(xy, 0) * py + load(xz, 0) * pz),
        (load(y, 0) + load(yx, 0) * px) + (load(yy, 0) * py + load(yz, 0) * pz),
        (load(z, 0) + load(zx, 0) * px) + (load(zy, 0) * py + load(zz, 0) * pz),
    )


@jit_ordered
def _eliminate_folded(work: Any, first: int, n: int) -> None:
    """Corrections of the nodes first <= i < n, from both ends at once.

    Pair k is the nodes first + k and n - 1 - k. The chains meet in the middle; with an even number
    of nodes the upper of the two there is eliminated onto the lower, in a round of its own whose
    first lane is not used.
    """
    dx, dy, dz = rows(work, CORRECTION, 0)
    pairs, rounds = (n - first - 1) // 2, (n - first) // 2
    middle = first + pairs
    below, above = _ground(work, first), spring(work, n - 1)
    Z = (
        pair(below[0], above[0]), pair(below[1], above[1]), pair(below[2], above[2]),
        pair(below[3], above[3]), pair(below[4], above[4]), pair(below[5], above[5]),
    )  # fmt: skip
    f = (pair(0.0, 0.0), pair(0.0, 0.0), pair(0.0, 0.0))
    for k in range(pairs):
        Z, f = _paired_node(work, first + k, n - 1 - k, 2 * k, Z, f)
    Z_below, f_below = Z, f
    if rounds > pairs:
        Z, f = _paired_node(work, middle, middle + 1, 2 * pairs, Z, f)
    S = add_six(add_six(_six_lanes(Z_below, 0), _six_lanes(Z, 1)), _six(work, BLOCK, middle))
    low, high = _lanes(f_below, 0), _lanes(f, 1)
    force = (
        low[0] + high[0] + work[RESIDUAL, middle],
        low[1] + high[1] + work[RESIDUAL + 1, middle],
        low[2] + high[2] + work[RESIDUAL + 2, middle],
    )
    mx, my, mz = solve_symmetric(S, force)
    dx[middle], dy[middle], dz[middle] = mx, my, mz
    px, py, pz = pair(mx, mx), pair(my, my), pair(mz, mz)
    if rounds > pairs:
        qx, qy, qz = _substitute(work, 2 * pairs, px, py, pz)
        ax, ay, az = lane(qx, 1), lane(qy, 1), lane(qz, 1)
        dx[middle + 1], dy[middle + 1], dz[middle + 1] = ax, ay, az
        px, py, pz = pair(mx, ax), pair(my, ay), pair(mz, az)
    for k in range(pairs - 1, -1, -1):
        px, py, pz = _substitute(work, 2 * k, px, py, pz)
        i, j = first + k, n - 1 - k
        dx[i], dx[j] = lane(px, 0), lane(px, 1)
        dy[i], dy[j] = lane(py, 0), lane(py, 1)
        dz[i], dz[j] = lane(pz, 0), lane(pz, 1)
    hold_ends(work, first, n)


eliminate = eliminate_plainly if config.DISABLE_JIT else _eliminate_folded
