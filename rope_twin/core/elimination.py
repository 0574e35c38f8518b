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

from rope_twin.core.jit import jit, jit_inline, jit_ordered
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
)


@jit
def root_stiffness(work: Any, n: int) -> None:
    """root = √AXIAL·t per element."""
    for e in range(n):
        size = sqrt(work[AXIAL, e])
        work[ROOT, e] = size * work[DIRECTION, e]
        work[ROOT + 1, e] = size * work[DIRECTION + 1, e]
        work[ROOT + 2, e] = size * work[DIRECTION + 2, e]


@jit_inline
def _eliminate_node(S: Any, f: Any, root: Any, b: Any) -> Any:
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
    inverse = 1.0 / ((det + ux * x) + (uy * y + uz * z))
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


@jit_inline
def _spring(work: Any, e: int) -> Any:
    """K of element e: xx, xy, xz, yy, yz, zz."""
    x, y, z, b = work[ROOT, e], work[ROOT + 1, e], work[ROOT + 2, e], work[GEOMETRIC, e]
    return x * x + b, x * y, x * z, y * y + b, y * z, z * z + b


@jit_inline
def _ground(work: Any, first: int) -> Any:
    """Z of the lowest free node: nothing, or the element to the fixed node below it."""
    xx, xy, xz, yy, yz, zz = _spring(work, 0)
    tied = 1.0 if first == 1 else 0.0
    return tied * xx, tied * xy, tied * xz, tied * yy, tied * yz, tied * zz


@jit_inline
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
    return _eliminate_node(S, force, root, b)


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
    _hold_ends(work, first, n)


@jit_inline
def _hold_ends(work: Any, first: int, n: int) -> None:
    """No correction where motion is prescribed."""
    for k in range(3):
        work[CORRECTION + k, n] = 0.0
        if first == 1:
            work[CORRECTION + k, 0] = 0.0


@jit_inline
def _paired_node(work: Any, i: int, j: int, Z: Any, f: Any) -> Any:
    """Eliminate node i through the element above it and node j through the one below."""
    zxx, zxy, zxz, zyy, zyz, zzz = Z
    fx, fy, fz = f
    e = j - 1
    b = gather(work[GEOMETRIC], i, e)
    S = (
        zxx + (gather(work[BLOCK], i, j) + b),
        zxy + gather(work[BLOCK + 1], i, j),
        zxz + gather(work[BLOCK + 2], i, j),
        zyy + (gather(work[BLOCK + 3], i, j) + b),
        zyz + gather(work[BLOCK + 4], i, j),
        zzz + (gather(work[BLOCK + 5], i, j) + b),
    )
    force = (
        fx + gather(work[RESIDUAL], i, j),
        fy + gather(work[RESIDUAL + 1], i, j),
        fz + gather(work[RESIDUAL + 2], i, j),
    )
    root = (
        gather(work[ROOT], i, e), gather(work[ROOT + 1], i, e), gather(work[ROOT + 2], i, e),
    )  # fmt: skip
    return _eliminate_node(S, force, root, b)


@jit_inline
def _solve_middle(work: Any, i: int, Z: Any, f: Any) -> Any:
    """The correction of the node where the chains meet, by LDLᵀ of its 3×3 block."""
    sxx, sxy, sxz = Z[0] + work[BLOCK, i], Z[1] + work[BLOCK + 1, i], Z[2] + work[BLOCK + 2, i]
    syy, syz, szz = Z[3] + work[BLOCK + 3, i], Z[4] + work[BLOCK + 4, i], Z[5] + work[BLOCK + 5, i]
    fx, fy, fz = (
        f[0] + work[RESIDUAL, i],
        f[1] + work[RESIDUAL + 1, i],
        f[2] + work[RESIDUAL + 2, i],
    )
    l10, l20 = sxy / sxx, sxz / sxx
    d1, m = syy - l10 * sxy, syz - l10 * sxz
    l21 = m / d1
    d2 = szz - l20 * sxz - l21 * m
    fy -= l10 * fx
    fz -= l20 * fx + l21 * fy
    dz = fz / d2
    dy = fy / d1 - l21 * dz
    return fx / sxx - l10 * dy - l20 * dz, dy, dz


@jit_ordered
def _eliminate_folded(work: Any, first: int, n: int) -> None:
    """Corrections of the nodes first <= i < n, from both ends at once."""
    pairs = (n - first - 1) // 2  # nodes first + k and n - 1 - k; one or two are left in the middle
    below, above = _ground(work, first), _spring(work, n - 1)
    Z = (
        pair(below[0], above[0]), pair(below[1], above[1]), pair(below[2], above[2]),
        pair(below[3], above[3]), pair(below[4], above[4]), pair(below[5], above[5]),
    )  # fmt: skip
    f = (pair(0.0, 0.0), pair(0.0, 0.0), pair(0.0, 0.0))
    for k in range(pairs):
        g, own, Z, f = _paired_node(work, first + k, n - 1 - k, Z, f)
        at = 2 * k
        store(work[ELIMINATED], at, g[0])
        store(work[ELIMINATED + 1], at, g[1])
        store(work[ELIMINATED + 2], at, g[2])
        store(work[ELIMINATED + 3], at, g[3])
        store(work[ELIMINATED + 4], at, g[4])
        store(work[ELIMINATED + 5], at, g[5])
        store(work[ELIMINATED + 6], at, g[6])
        store(work[ELIMINATED + 7], at, g[7])
        store(work[ELIMINATED + 8], at, g[8])
        store(work[ELIMINATED + 9], at, own[0])
        store(work[ELIMINATED + 10], at, own[1])
        store(work[ELIMINATED + 11], at, own[2])
    below = (
        lane(Z[0], 0),
        lane(Z[1], 0),
        lane(Z[2], 0),
        lane(Z[3], 0),
        lane(Z[4], 0),
        lane(Z[5], 0),
    )
    above = (
        lane(Z[0], 1),
        lane(Z[1], 1),
        lane(Z[2], 1),
        lane(Z[3], 1),
        lane(Z[4], 1),
        lane(Z[5], 1),
    )
    force, load_above = (lane(f[0], 0), lane(f[1], 0), lane(f[2], 0)), (lane(f[0], 1), lane(f[1], 1), lane(f[2], 1))  # fmt: skip # noqa: E501
    middle = first + pairs
    two = n - pairs - 1 > middle
    gain, own_above = (0.0,) * 9, (0.0, 0.0, 0.0)
    if two:
        gain, own_above, above, load_above = _plain_node(
            work, middle + 1, middle, above, load_above
        )
    Z_middle = (
        below[0] + above[0], below[1] + above[1], below[2] + above[2],
        below[3] + above[3], below[4] + above[4], below[5] + above[5],
    )  # fmt: skip
    f_middle = (force[0] + load_above[0], force[1] + load_above[1], force[2] + load_above[2])
    dx, dy, dz = _solve_middle(work, middle, Z_middle, f_middle)
    work[CORRECTION, middle], work[CORRECTION + 1, middle], work[CORRECTION + 2, middle] = (
        dx,
        dy,
        dz,
    )
    ax, ay, az = dx, dy, dz
    if two:
        ax = own_above[0] + gain[0] * dx + gain[1] * dy + gain[2] * dz
        ay = own_above[1] + gain[3] * dx + gain[4] * dy + gain[5] * dz
        az = own_above[2] + gain[6] * dx + gain[7] * dy + gain[8] * dz
        i = middle + 1
        work[CORRECTION, i], work[CORRECTION + 1, i], work[CORRECTION + 2, i] = ax, ay, az
    px, py, pz = pair(dx, ax), pair(dy, ay), pair(dz, az)
    for k in range(pairs - 1, -1, -1):
        at = 2 * k
        qx = (load(work[ELIMINATED + 9], at) + load(work[ELIMINATED], at) * px) + (
            load(work[ELIMINATED + 1], at) * py + load(work[ELIMINATED + 2], at) * pz
        )
        qy = (load(work[ELIMINATED + 10], at) + load(work[ELIMINATED + 3], at) * px) + (
            load(work[ELIMINATED + 4], at) * py + load(work[ELIMINATED + 5], at) * pz
        )
        qz = (load(work[ELIMINATED + 11], at) + load(work[ELIMINATED + 6], at) * px) + (
            load(work[ELIMINATED + 7], at) * py + load(work[ELIMINATED + 8], at) * pz
        )
        px, py, pz = qx, qy, qz
        i, j = first + k, n - 1 - k
        work[CORRECTION, i], work[CORRECTION, j] = lane(px, 0), lane(px, 1)
        work[CORRECTION + 1, i], work[CORRECTION + 1, j] = lane(py, 0), lane(py, 1)
        work[CORRECTION + 2, i], work[CORRECTION + 2, j] = lane(pz, 0), lane(pz, 1)
    _hold_ends(work, first, n)


eliminate = eliminate_plainly if config.DISABLE_JIT else _eliminate_folded
