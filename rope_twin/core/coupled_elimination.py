"""The direct solve where effects couple a node to the next two: block LDLᵀ with 3×3 pivots.

Beside the blocks A_i and K_e of `elimination`, node i has the blocks c·I with node i + 1 and with
node i + 2 (rows LINK). A node is eliminated onto both; its 3×3 pivot is L·D·Lᵀ. With
V = L⁻¹·(block to i + 1) and M = L⁻¹ they get -Vᵀ·D⁻¹·V, -d·Vᵀ·D⁻¹·M and -d²·Mᵀ·D⁻¹·M, where d is
the coupling to i + 2. That is the banded LDLᵀ (Golub and Van Loan 2013, section 4.3) by nodes:
backward stable for a positive definite matrix, and half the work of pairing the nodes into 6×6
blocks. It differences K, where `elimination` does not, so that the mass is seen to 1e-16·K.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import add_six, hold_ends, spring
from rope_twin.core.jit import jit_ordered, jit_within
from rope_twin.core.state import BLOCK, CORRECTION, ELIMINATED, FACTOR, LINK, RESIDUAL


@jit_within
def _less(a: Any, s: Any, b: Any) -> Any:
    """a - s·b of vectors."""
    return a[0] - s * b[0], a[1] - s * b[1], a[2] - s * b[2]


@jit_within
def _factor(S: Any) -> Any:
    """L (10, 20, 21) and the inverse of D of a symmetric matrix (xx, xy, xz, yy, yz, zz)."""
    xx, xy, xz, yy, yz, zz = S
    w0 = 1.0 / xx
    l10, l20 = xy * w0, xz * w0
    below = yz - l10 * xz
    w1 = 1.0 / (yy - l10 * xy)
    l21 = below * w1
    w2 = 1.0 / (zz - l20 * xz - l21 * below)
    return l10, l20, l21, w0, w1, w2


@jit_within
def _forward(L: Any, a: Any, b: Any, c: Any) -> Any:
    """L⁻¹ applied to three rows."""
    second = _less(b, L[0], a)
    return a, second, _less(_less(c, L[1], a), L[2], second)


@jit_within
def _lessen(S: Any, L: Any, a: Any, b: Any, c: Any) -> Any:
    """S less (a b c)·D⁻¹·(a b c)ᵀ, whose rows are a, b, c."""
    _, _, _, w0, w1, w2 = L
    ax, ay, az = w0 * a[0], w0 * a[1], w0 * a[2]
    bx, by, bz = w1 * b[0], w1 * b[1], w1 * b[2]
    cx, cy, cz = w2 * c[0], w2 * c[1], w2 * c[2]
    return (
        S[0] - (ax * a[0] + bx * b[0] + cx * c[0]),
        S[1] - (ax * a[1] + bx * b[1] + cx * c[1]),
        S[2] - (ax * a[2] + bx * b[2] + cx * c[2]),
        S[3] - (ay * a[1] + by * b[1] + cy * c[1]),
        S[4] - (ay * a[2] + by * b[2] + cy * c[2]),
        S[5] - (az * a[2] + bz * b[2] + cz * c[2]),
    )


@jit_within
def _spread(L: Any, d: Any, v: Any) -> Any:
    """-d·Vᵀ·D⁻¹·M by rows: what the node leaves between the next two."""
    l10, l20, l21, w0, w1, w2 = L
    m20 = l10 * l21 - l20
    a, b, c = v
    x0, x1, x2 = d * w0 * a[0], d * w1 * b[0], d * w2 * c[0]
    y0, y1, y2 = d * w0 * a[1], d * w1 * b[1], d * w2 * c[1]
    z0, z1, z2 = d * w0 * a[2], d * w1 * b[2], d * w2 * c[2]
    return (
        (l10 * x1 - x0 - m20 * x2, l21 * x2 - x1, 0.0 - x2),
        (l10 * y1 - y0 - m20 * y2, l21 * y2 - y1, 0.0 - y2),
        (l10 * z1 - z0 - m20 * z2, l21 * z2 - z1, 0.0 - z2),
    )


@jit_within
def _add(a: Any, b: Any) -> Any:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@jit_within
def _vector(work: Any, first: int, i: int) -> Any:
    """Column i of three rows."""
    return work[first, i], work[first + 1, i], work[first + 2, i]


@jit_within
def _keep(work: Any, i: int, v: Any, g: Any, L: Any) -> None:
    """What the way back needs: V, L⁻¹·f, L and the inverse of D."""
    for k in range(3):
        work[ELIMINATED + k, i] = v[0][k]
        work[ELIMINATED + 3 + k, i] = v[1][k]
        work[ELIMINATED + 6 + k, i] = v[2][k]
        work[ELIMINATED + 9 + k, i] = g[k]
    for k in range(6):
        work[FACTOR + k, i] = L[k]


@jit_within
def _substitute(work: Any, first: int, n: int) -> None:
    """From the hang-off down: L·D·Lᵀ·delta = f - (block to i + 1)·delta - d·delta."""
    nothing = (0.0, 0.0, 0.0)
    near, far = nothing, nothing
    for i in range(n - 1, first - 1, -1):
        V, d = work[ELIMINATED : ELIMINATED + 12], work[LINK + 1, i]
        l10, l20, l21 = _vector(work, FACTOR, i)
        w0, w1, w2 = _vector(work, FACTOR + 3, i)
        fx, fy, fz = d * far[0], d * far[1], d * far[2]
        fy -= l10 * fx  # L⁻¹·d·delta of the second next
        fz -= l20 * fx + l21 * fy
        x = w0 * (V[9, i] - (V[0, i] * near[0] + V[1, i] * near[1] + V[2, i] * near[2]) - fx)
        y = w1 * (V[10, i] - (V[3, i] * near[0] + V[4, i] * near[1] + V[5, i] * near[2]) - fy)
        z = w2 * (V[11, i] - (V[6, i] * near[0] + V[7, i] * near[1] + V[8, i] * near[2]) - fz)
        y -= l21 * z
        x -= l10 * y + l20 * z
        work[CORRECTION, i], work[CORRECTION + 1, i], work[CORRECTION + 2, i] = x, y, z
        near, far = (x, y, z), near
    hold_ends(work, first, n)


@jit_ordered
def eliminate_coupled(work: Any, first: int, n: int) -> None:
    """Corrections of the nodes first <= i < n; they are 0 at n and below first."""
    nothing = (0.0, 0.0, 0.0)
    # what eliminated nodes left: on this node and the next, and between them
    S, S_next = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    f, f_next, C = nothing, nothing, (nothing, nothing, nothing)
    if first == 1:
        S = spring(work, 0)
    for i in range(first, n):
        xx, xy, xz, yy, yz, zz = K = spring(work, i)
        A, c, d = work[BLOCK : BLOCK + 6], work[LINK, i], work[LINK + 1, i]
        S = (
            S[0] + (A[0, i] + xx), S[1] + (A[1, i] + xy), S[2] + (A[2, i] + xz),
            S[3] + (A[3, i] + yy), S[4] + (A[4, i] + yz), S[5] + (A[5, i] + zz),
        )  # fmt: skip
        L = _factor(S)
        v = _forward(
            L,
            _add(C[0], (c - xx, -xy, -xz)),
            _add(C[1], (-xy, c - yy, -yz)),
            _add(C[2], (-xz, -yz, c - zz)),
        )
        f = _add(f, _vector(work, RESIDUAL, i))
        g1 = f[1] - L[0] * f[0]
        g = (f[0], g1, f[2] - L[1] * f[0] - L[2] * g1)
        _keep(work, i, v, g, L)
        # on to the next two
        wx, wy, wz = L[3] * g[0], L[4] * g[1], L[5] * g[2]
        m20 = L[0] * L[2] - L[1]
        f = _less(_less(_less(f_next, wx, v[0]), wy, v[1]), wz, v[2])
        f_next = (-d * (wx - L[0] * wy + m20 * wz), -d * (wy - L[2] * wz), -d * wz)
        S = _lessen(add_six(S_next, K), L, v[0], v[1], v[2])
        S_next = _lessen(
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), L, (d, 0.0, 0.0), (-d * L[0], d, 0.0),
            (d * m20, -d * L[2], d),
        )  # fmt: skip
        C = _spread(L, d, v)
    _substitute(work, first, n)
