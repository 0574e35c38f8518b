"""Elimination of one node of the block-pentadiagonal chain: 3×3 pivots, LDLᵀ.

Besides the blocks A_i and K_e of `elimination`, node i has the blocks c·I with node i + 1 and with
node i + 2 (rows LINK). A node is eliminated onto both; its 3×3 pivot is S = L·D·Lᵀ. With B the
block to i + 1, V = L⁻¹·B, M = L⁻¹ and d the coupling to i + 2 they receive -Vᵀ·D⁻¹·V, -d·Vᵀ·D⁻¹·M
and -d²·Mᵀ·D⁻¹·M. That is the banded LDLᵀ (Golub and Van Loan 2013, section 4.3) by nodes: backward
stable for a positive definite matrix, and half the work of pairing the nodes into 6×6 blocks. It
subtracts multiples of K, which `elimination` does not, so that the mass is resolved to 1e-16·K.

Written for numbers and for pairs of numbers alike (core/jit/simd), which have no unary minus
and accept a number only on their left.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit_ordered_within
from rope_twin.core.solve.elimination import add_six


@jit_ordered_within
def less(a: Any, s: Any, b: Any) -> Any:
    """Return a - s·b of vectors."""
    return a[0] - s * b[0], a[1] - s * b[1], a[2] - s * b[2]


@jit_ordered_within
def add(a: Any, b: Any) -> Any:
    """Return the sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@jit_ordered_within
def add_nine(a: Any, b: Any) -> Any:
    """Return the sum of two matrices by rows."""
    return add(a[0], b[0]), add(a[1], b[1]), add(a[2], b[2])


@jit_ordered_within
def link_less(c: Any, K: Any) -> Any:
    """Return c·I - K by rows, K a symmetric matrix (xx, xy, xz, yy, yz, zz)."""
    xx, xy, xz, yy, yz, zz = K
    return (
        (c - xx, 0.0 - xy, 0.0 - xz), (0.0 - xy, c - yy, 0.0 - yz), (0.0 - xz, 0.0 - yz, c - zz),
    )  # fmt: skip


@jit_ordered_within
def factor(S: Any) -> Any:
    """Return L (10, 20, 21) and the inverse of D of a symmetric matrix (xx, xy, xz, yy, yz, zz)."""
    xx, xy, xz, yy, yz, zz = S
    w0 = 1.0 / xx
    l10, l20 = xy * w0, xz * w0
    below = yz - l10 * xz
    w1 = 1.0 / (yy - l10 * xy)
    l21 = below * w1
    w2 = 1.0 / (zz - l20 * xz - l21 * below)
    return l10, l20, l21, w0, w1, w2


@jit_ordered_within
def inverse(L: Any) -> Any:
    """Return Mᵀ·D⁻¹·M: the inverse of the factorised matrix."""
    l10, l20, l21, w0, w1, w2 = L
    m20 = l10 * l21 - l20
    xz, yz, xy = m20 * w2, l21 * w2, l10 * w1
    return (
        w0 + l10 * xy + m20 * xz, 0.0 - (xy + m20 * yz), xz, w1 + l21 * yz, 0.0 - yz, w2,
    )  # fmt: skip


@jit_ordered_within
def times_six(s: Any, a: Any) -> Any:
    """Return a number times a symmetric matrix."""
    return s * a[0], s * a[1], s * a[2], s * a[3], s * a[4], s * a[5]


@jit_ordered_within
def apply(a: Any, b: Any) -> Any:
    """Return a symmetric matrix times a vector."""
    xx, xy, xz, yy, yz, zz = a
    return (
        xx * b[0] + xy * b[1] + xz * b[2], xy * b[0] + yy * b[1] + yz * b[2],
        xz * b[0] + yz * b[1] + zz * b[2],
    )  # fmt: skip


@jit_ordered_within
def lessen(S: Any, V: Any, W: Any) -> Any:
    """Return S - Vᵀ·W, symmetric; V and W = D⁻¹·V by rows."""
    a, b, c = V
    x, y, z = W
    return (
        S[0] - (x[0] * a[0] + y[0] * b[0] + z[0] * c[0]),
        S[1] - (x[0] * a[1] + y[0] * b[1] + z[0] * c[1]),
        S[2] - (x[0] * a[2] + y[0] * b[2] + z[0] * c[2]),
        S[3] - (x[1] * a[1] + y[1] * b[1] + z[1] * c[1]),
        S[4] - (x[1] * a[2] + y[1] * b[2] + z[1] * c[2]),
        S[5] - (x[2] * a[2] + y[2] * b[2] + z[2] * c[2]),
    )


@jit_ordered_within
def scaled(s: Any, a: Any) -> Any:
    """Return a number times a vector."""
    return s * a[0], s * a[1], s * a[2]


@jit_ordered_within
def eliminate_coupled_node(S: Any, f: Any, B: Any, d: Any) -> Any:
    """Eliminate a node onto the next two.

    S: its pivot (xx, xy, xz, yy, yz, zz); f: its force; B: the block to the next node by rows; d:
    the coupling to the second next. Returns

    - for the back-substitution, own, G and I of delta = own - G·next - I·(d·second): S⁻¹·f, S⁻¹·B
      and S⁻¹;
    - the Schur complement: V and D⁻¹·V, which add -Vᵀ·D⁻¹·V to the next node; then -Bᵀ·own, -d·own,
      -d²·S⁻¹ and, between the two, -d·Bᵀ·S⁻¹ by rows.
    """
    L = factor(S)
    l10, l20, l21, w0, w1, w2 = L
    a, b = B[0], less(B[1], l10, B[0])
    c = less(less(B[2], l20, a), l21, b)
    x, y, z = scaled(w0, a), scaled(w1, b), scaled(w2, c)
    gy = less(y, l21, z)
    gx = less(less(x, l10, gy), l20, z)
    I = inverse(L)
    g1 = f[1] - l10 * f[0]
    g2 = f[2] - l20 * f[0] - l21 * g1
    h0, h1, h2 = w0 * f[0], w1 * g1, w2 * g2
    oy = h1 - l21 * h2
    own = (h0 - l10 * oy - l20 * h2, oy, h2)
    pushed = (
        0.0 - (h0 * a[0] + h1 * b[0] + h2 * c[0]), 0.0 - (h0 * a[1] + h1 * b[1] + h2 * c[1]),
        0.0 - (h0 * a[2] + h1 * b[2] + h2 * c[2]),
    )  # fmt: skip
    minus = 0.0 - d
    between = (
        (minus * gx[0], minus * gy[0], minus * z[0]), (minus * gx[1], minus * gy[1], minus * z[1]),
        (minus * gx[2], minus * gy[2], minus * z[2]),
    )  # fmt: skip
    far = times_six(minus, times_six(d, I))
    left = ((a, b, c), (x, y, z)), pushed, scaled(minus, own), far, between
    return (own, (gx, gy, z), I), left


@jit_ordered_within
def push_coupled_node(f: Any, G: Any, I: Any, d: Any) -> Any:
    """Return `own` for another force on an eliminated node, and forces on the next two nodes."""
    own = apply(I, f)
    x, y, z = G
    pushed = (
        0.0 - (x[0] * f[0] + y[0] * f[1] + z[0] * f[2]),
        0.0 - (x[1] * f[0] + y[1] * f[1] + z[1] * f[2]),
        0.0 - (x[2] * f[0] + y[2] * f[1] + z[2] * f[2]),
    )
    return own, pushed, scaled(0.0 - d, own)


@jit_ordered_within
def onto_next(left: Any, carried: Any, K: Any) -> Any:
    """Return the Schur complement on the next node, on the second next and between them.

    left: contribution of the node; carried: matrix and force of earlier nodes on the next.
    """
    (V, W), pushed, far, second, between = left
    S, f = carried
    return lessen(add_six(S, K), V, W), add(f, pushed), (second, far), between


@jit_ordered_within
def substituted(kept: Any, near: Any, far: Any) -> Any:
    """Return delta of a node from that of the next, and d times that of the second next."""
    own, G, I = kept
    x, y, z = apply(I, far)
    px, py, pz = near
    gx, gy, gz = G
    return (
        (own[0] - x) - gx[0] * px - gx[1] * py - gx[2] * pz,
        (own[1] - y) - gy[0] * px - gy[1] * py - gy[2] * pz,
        (own[2] - z) - gz[0] * px - gz[1] * py - gz[2] * pz,
    )
