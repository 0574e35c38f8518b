"""The O(N) direct solve of (A + K)·delta = R for a chain of 3×3 blocks.

A_i are the symmetric node blocks, K_e = root·rootᵀ + kb·I the element blocks (root = √ka·t). The
chain is eliminated from the lower end to the hang-off. What an eliminated part leaves on its
neighbour is Z = K - K·(S + K)⁻¹·K, formed with the adjugate of S and one division, never as that
difference: K over the mass reaches 1e6 for short stiff elements and would cancel.

With Ŝ = S + kb·I, C = adj Ŝ, det = det Ŝ, u = C·root, Δ = det + root·u and Q = adj(Ŝ + root·rootᵀ):
(S + K)⁻¹ = Q/Δ, (S + K)⁻¹·K = (u·rootᵀ + kb·Q)/Δ,
Z = kb·I + (det·root·rootᵀ - kb·(u·rootᵀ + root·uᵀ) - kb²·Q)/Δ.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.jit import jit, jit_ordered
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
    """root = √ka·t per element."""
    for e in range(n):
        size = sqrt(work[AXIAL, e])
        work[ROOT, e] = size * work[DIRECTION, e]
        work[ROOT + 1, e] = size * work[DIRECTION + 1, e]
        work[ROOT + 2, e] = size * work[DIRECTION + 2, e]


@jit_ordered
def eliminate(work: Any, first: int, n: int) -> None:
    """Solve for the correction of the nodes first <= i < n; it is 0 at n (and below first).

    ELIMINATED rows 0-8: (S + K)⁻¹·K row by row; rows 9-11: (S + K)⁻¹·f, both per node.
    """
    A, R = work[BLOCK : BLOCK + 6], work[RESIDUAL : RESIDUAL + 3]
    G, D = work[ELIMINATED : ELIMINATED + 12], work[CORRECTION : CORRECTION + 3]
    X, Y, Z = work[ROOT], work[ROOT + 1], work[ROOT + 2]
    B = work[GEOMETRIC]
    zxx = zxy = zxz = zyy = zyz = zzz = 0.0
    fx = fy = fz = 0.0
    if first == 1:  # the element to the fixed node is a spring to the ground
        x, y, z, b = X[0], Y[0], Z[0], B[0]
        zxx, zxy, zxz = x * x + b, x * y, x * z
        zyy, zyz, zzz = y * y + b, y * z, z * z + b
    for i in range(first, n):
        x, y, z, b = X[i], Y[i], Z[i], B[i]
        sxx = zxx + (A[0, i] + b)
        sxy = zxy + A[1, i]
        sxz = zxz + A[2, i]
        syy = zyy + (A[3, i] + b)
        syz = zyz + A[4, i]
        szz = zzz + (A[5, i] + b)
        fx += R[0, i]
        fy += R[1, i]
        fz += R[2, i]
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
        fx = inverse * (along * x + b * gx)
        fy = inverse * (along * y + b * gy)
        fz = inverse * (along * z + b * gz)
        G[9, i], G[10, i], G[11, i] = inverse * gx, inverse * gy, inverse * gz
        ib = inverse * b
        wx, wy, wz = inverse * ux, inverse * uy, inverse * uz
        G[0, i], G[1, i], G[2, i] = wx * x + ib * qxx, wx * y + ib * qxy, wx * z + ib * qxz
        G[3, i], G[4, i], G[5, i] = wy * x + ib * qxy, wy * y + ib * qyy, wy * z + ib * qyz
        G[6, i], G[7, i], G[8, i] = wz * x + ib * qxz, wz * y + ib * qyz, wz * z + ib * qzz
    dx = dy = dz = 0.0
    D[0, n] = D[1, n] = D[2, n] = 0.0
    for i in range(n - 1, first - 1, -1):
        ex = G[9, i] + G[0, i] * dx + G[1, i] * dy + G[2, i] * dz
        ey = G[10, i] + G[3, i] * dx + G[4, i] * dy + G[5, i] * dz
        ez = G[11, i] + G[6, i] * dx + G[7, i] * dy + G[8, i] * dz
        dx, dy, dz = ex, ey, ez
        D[0, i], D[1, i], D[2, i] = dx, dy, dz
    if first == 1:
        D[0, 0] = D[1, 0] = D[2, 0] = 0.0
