"""O(N) direct solver of (A + K)·delta = R for a chain of 3×3 blocks (block-tridiagonal).

A_i are the symmetric node blocks, K_e = a·t·tᵀ + b·I the element blocks (a = AXIAL, b = GEOMETRIC).
Nodes are eliminated one after the other; the Schur complement of an eliminated part, S, on its
neighbour is Z = K - K·(S + K)⁻¹·K, never formed as that difference: K over the mass reaches 1e6 for
short stiff elements and would cancel. It is S and K in series, and K consists of two: b·I along
which S acts, then a. With Ŝ = S + b·I, C = adj Ŝ, det = det Ŝ, u = C·t, Δ = det + a·t·u, k = det·t
- b·u and w = a/(det·Δ):

Z = b·I - (b²/det)·C + w·k·kᵀ, (S + K)⁻¹ = C/det - w·u·uᵀ, (S + K)⁻¹·K = (b/det)·C + w·u·kᵀ.

`eliminate_plainly` proceeds from the lower end to the hang-off. Compiled code uses
`core/solve/fold`, the two-sided (twisted) factorisation; a test compares it with a dense solver.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit_ordered, jit_ordered_within, jit_within
from rope_twin.core.state import (
    AXIAL,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELIMINATED,
    GEOMETRIC,
    RESIDUAL,
    ZERO,
)


@jit_ordered_within
def eliminate_node(S: Any, f: Any, t: Any, a: Any, b: Any) -> Any:
    """Eliminate a node through its next element.

    S: xx, xy, xz, yy, yz, zz of Ŝ; f: its force. Returns (S + K)⁻¹·K by rows, (S + K)⁻¹·f, Z and
    force for the neighbour, and (S + K)⁻¹.
    """
    sxx, sxy, sxz, syy, syz, szz = S
    fx, fy, fz = f
    x, y, z = t
    cxx = syy * szz - syz * syz
    cxy = sxz * syz - sxy * szz
    cxz = sxy * syz - sxz * syy
    cyy = sxx * szz - sxz * sxz
    cyz = sxy * sxz - sxx * syz
    czz = sxx * syy - sxy * sxy
    det = (sxx * cxx + sxy * cxy) + sxz * cxz
    # a·t·C·t from the products of t, which are ready before u: the division depends on it
    ax, ay, az, xx, yy = a * x, a * y, a * z, x + x, y + y
    diagonal = (ax * x * cxx + ay * y * cyy) + az * z * czz
    whole = det + (diagonal + ((ax * yy * cxy + az * xx * cxz) + az * yy * cyz))
    over_det, over_whole = 1.0 / det, 1.0 / whole
    ux = (cxx * x + cxy * y) + cxz * z
    uy = (cxy * x + cyy * y) + cyz * z
    uz = (cxz * x + cyz * y) + czz * z
    kx, ky, kz = det * x - b * ux, det * y - b * uy, det * z - b * uz
    w, g, h = (a * over_det) * over_whole, b * over_det, (b * b) * over_det
    # Schur complement on the next node: the matrix Z ...
    left = (
        (b - h * cxx) + w * (kx * kx), w * (kx * ky) - h * cxy, w * (kx * kz) - h * cxz,
        (b - h * cyy) + w * (ky * ky), w * (ky * kz) - h * cyz, (b - h * czz) + w * (kz * kz),
    )  # fmt: skip
    # ... and the force K·own = t·(a·t·own) + b·own, where a·t·own = (a/Δ)·u·f
    along = (ux * fx + uy * fy) + uz * fz
    s = (a * over_whole) * along
    vx, vy, vz, gxy, gxz, gyz = w * ux, w * uy, w * uz, g * cxy, g * cxz, g * cyz
    own = (
        over_det * (cxx * fx + cxy * fy + cxz * fz) - along * vx,
        over_det * (cxy * fx + cyy * fy + cyz * fz) - along * vy,
        over_det * (cxz * fx + cyz * fy + czz * fz) - along * vz,
    )
    force = (s * x + b * own[0], s * y + b * own[1], s * z + b * own[2])
    gain = (
        vx * kx + g * cxx, vx * ky + gxy, vx * kz + gxz,
        vy * kx + gxy, vy * ky + g * cyy, vy * kz + gyz,
        vz * kx + gxz, vz * ky + gyz, vz * kz + g * czz,
    )  # fmt: skip
    inverse = (
        over_det * cxx - vx * ux, over_det * cxy - vx * uy, over_det * cxz - vx * uz,
        over_det * cyy - vy * uy, over_det * cyz - vy * uz, over_det * czz - vz * uz,
    )  # fmt: skip
    return gain, own, left, force, inverse


@jit_ordered_within
def push_node(gain: Any, inverse: Any, f: Any) -> Any:
    """Return (S + K)⁻¹·f and the force K·(S + K)⁻¹·f on the neighbour, of an eliminated node."""
    gxx, gxy, gxz, gyx, gyy, gyz, gzx, gzy, gzz = gain
    xx, xy, xz, yy, yz, zz = inverse
    x, y, z = f
    own = (
        (xx * x + xy * y) + xz * z, (xy * x + yy * y) + yz * z, (xz * x + yz * y) + zz * z,
    )  # fmt: skip
    force = (
        (gxx * x + gyx * y) + gzx * z, (gxy * x + gyy * y) + gzy * z, (gxz * x + gyz * y) + gzz * z,
    )  # fmt: skip
    return own, force


@jit_within
def six(work: Any, first: int, i: int) -> Any:
    """Return column i of six rows."""
    return (
        work[first, i], work[first + 1, i], work[first + 2, i], work[first + 3, i],
        work[first + 4, i], work[first + 5, i],
    )  # fmt: skip


@jit_within
def spring(work: Any, e: int) -> Any:
    """Return K of element e: xx, xy, xz, yy, yz, zz."""
    x, y, z = work[DIRECTION, e], work[DIRECTION + 1, e], work[DIRECTION + 2, e]
    b, ax, ay = work[GEOMETRIC, e], work[AXIAL, e] * x, work[AXIAL, e] * y
    return ax * x + b, ax * y, ax * z, ay * y + b, ay * z, work[AXIAL, e] * z * z + b


@jit_within
def ground(work: Any, first: int) -> Any:
    """Return Z of the lowest free node: zero, or the element to the fixed node below it."""
    xx, xy, xz, yy, yz, zz = spring(work, ZERO)
    tied = 1.0 if first == 1 else 0.0
    return tied * xx, tied * xy, tied * xz, tied * yy, tied * yz, tied * zz


@jit_within
def _plain_node(work: Any, i: int, e: int, Z: Any, f: Any) -> Any:
    """Eliminate node i through element e, in a one-sided sweep."""
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
    t = (work[DIRECTION, e], work[DIRECTION + 1, e], work[DIRECTION + 2, e])
    return eliminate_node(S, force, t, work[AXIAL, e], b)


@jit_ordered
def eliminate_plainly(work: Any, first: int, n: int) -> None:
    """Solve for the corrections of the nodes first <= i < n; they are 0 at n and below first."""
    Z, f = ground(work, first), (0.0, 0.0, 0.0)
    for i in range(first, n):
        gain, own, Z, f, inverse = _plain_node(work, i, i, Z, f)
        for k in range(9):
            work[ELIMINATED + k, i] = gain[k]
        for k in range(3):
            work[ELIMINATED + 9 + k, i] = own[k]
        for k in range(6):
            work[ELIMINATED + 12 + k, i] = inverse[k]
    _substitute_plainly(work, first, n)


@jit_ordered
def push_plainly(work: Any, first: int, n: int) -> None:
    """Solve for another residual with the factors of `eliminate_plainly`."""
    f = (0.0, 0.0, 0.0)
    G = work[ELIMINATED : ELIMINATED + 18]
    for i in range(first, n):
        x, y, z = f
        gain = (G[0, i], G[1, i], G[2, i], G[3, i], G[4, i], G[5, i], G[6, i], G[7, i], G[8, i])
        inverse = (G[12, i], G[13, i], G[14, i], G[15, i], G[16, i], G[17, i])
        force = (x + work[RESIDUAL, i], y + work[RESIDUAL + 1, i], z + work[RESIDUAL + 2, i])
        own, f = push_node(gain, inverse, force)
        for k in range(3):
            G[9 + k, i] = own[k]
    _substitute_plainly(work, first, n)


@jit_ordered
def _substitute_plainly(work: Any, first: int, n: int) -> None:
    """Back-substitute from the hang-off down."""
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
    """Set the correction to zero where motion is prescribed."""
    for k in range(3):
        work[CORRECTION + k, n] = 0.0
        if first == 1:
            work[CORRECTION + k, 0] = 0.0


@jit_ordered
def solve_symmetric(S: Any, f: Any) -> Any:
    """Solve S·x = f for a symmetric 3×3 matrix (xx, xy, xz, yy, yz, zz), by LDLᵀ."""
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
def add_six(a: Any, b: Any) -> Any:
    """Return the sum of two symmetric matrices."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]
