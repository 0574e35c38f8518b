"""Elimination of nodes in a chain of 3×3 blocks: algebra shared by all sweeps.

A chain is (A + K)·delta = R: A_i are the symmetric node blocks, K_e = a·t·tᵀ + b·I the element
blocks (a = AXIAL, b = GEOMETRIC). Eliminating a node leaves a Schur complement on its neighbours.

**Coupled to the next node only** (`eliminate_node`). The Schur complement S of an eliminated part
becomes Z = K - K·(S + K)⁻¹·K on the next node, never formed as that difference: K over the mass
reaches 1e6 for short stiff elements, so that the difference would cancel. Z is S and K in series,
with K split into b·I and a·t·tᵀ. With Ŝ = S + b·I, C = adj Ŝ, det = det Ŝ, u = C·t,
Δ = det + a·t·u, k = det·t - b·u and w = a/(det·Δ):

Z = b·I - (b²/det)·C + w·k·kᵀ, (S + K)⁻¹ = C/det - w·u·uᵀ, (S + K)⁻¹·K = (b/det)·C + w·u·kᵀ.

**Coupled to the next two nodes** (`eliminate_coupled_node`). Node i has the blocks c·I with node
i + 1 and d·I with node i + 2 (rows LINK). Its 3×3 pivot is S = L·D·Lᵀ; with B the block to i + 1,
V = L⁻¹·B and M = L⁻¹, the two receive -Vᵀ·D⁻¹·V, -d·Vᵀ·D⁻¹·M and -d²·Mᵀ·D⁻¹·M. That is the banded
LDLᵀ (Golub and Van Loan 2013, section 4.3) by nodes: backward stable for a positive definite
matrix, and half the work of pairing the nodes into 6×6 blocks. It subtracts multiples of K, so that
the mass is resolved to 1e-16·K.

The functions accept scalars and pairs (core/jit/rows), which have no unary minus and accept a
scalar as left operand only.

**Two nodes at once** (`eliminate_pair`), one per SIMD lane. The factors of a pair are a record of
RECORD numbers: pairs of the gain (S + K)⁻¹·K by rows, of the condensed solution (S + K)⁻¹·f, and
of the inverse (S + K)⁻¹.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit_ordered_within, jit_within
from rope_twin.core.jit.rows import column, gather, lane, load, pair, row, rows, span, store
from rope_twin.core.jit.wide import choose
from rope_twin.core.state import (
    AXIAL,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELIMINATED,
    GEOMETRIC,
    RESIDUAL,
    ZERO,
    Floats,
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
    # a·t·C·t from products of t and not from u, which shortens the dependency chain to the division
    ax, ay, az, xx, yy = a * x, a * y, a * z, x + x, y + y
    diagonal = (ax * x * cxx + ay * y * cyy) + az * z * czz
    total = det + (diagonal + ((ax * yy * cxy + az * xx * cxz) + az * yy * cyz))
    over_det, over_total = 1.0 / det, 1.0 / total
    ux = (cxx * x + cxy * y) + cxz * z
    uy = (cxy * x + cyy * y) + cyz * z
    uz = (cxz * x + cyz * y) + czz * z
    kx, ky, kz = det * x - b * ux, det * y - b * uy, det * z - b * uz
    w, g, h = (a * over_det) * over_total, b * over_det, (b * b) * over_det
    # Schur complement on the next node: the matrix Z ...
    schur = (
        (b - h * cxx) + w * (kx * kx), w * (kx * ky) - h * cxy, w * (kx * kz) - h * cxz,
        (b - h * cyy) + w * (ky * ky), w * (ky * kz) - h * cyz, (b - h * czz) + w * (kz * kz),
    )  # fmt: skip
    # ... and the force K·y = t·(a·t·y) + b·y of the solution y, where a·t·y = (a/Δ)·u·f
    along = (ux * fx + uy * fy) + uz * fz
    s = (a * over_total) * along
    vx, vy, vz, gxy, gxz, gyz = w * ux, w * uy, w * uz, g * cxy, g * cxz, g * cyz
    solution = (
        over_det * (cxx * fx + cxy * fy + cxz * fz) - along * vx,
        over_det * (cxy * fx + cyy * fy + cyz * fz) - along * vy,
        over_det * (cxz * fx + cyz * fy + czz * fz) - along * vz,
    )
    force = (s * x + b * solution[0], s * y + b * solution[1], s * z + b * solution[2])
    gain = (
        vx * kx + g * cxx, vx * ky + gxy, vx * kz + gxz,
        vy * kx + gxy, vy * ky + g * cyy, vy * kz + gyz,
        vz * kx + gxz, vz * ky + gyz, vz * kz + g * czz,
    )  # fmt: skip
    inverse = (
        over_det * cxx - vx * ux, over_det * cxy - vx * uy, over_det * cxz - vx * uz,
        over_det * cyy - vy * uy, over_det * cyz - vy * uz, over_det * czz - vz * uz,
    )  # fmt: skip
    return gain, solution, schur, force, inverse


@jit_ordered_within
def reduce_node(gain: Any, inverse: Any, f: Any) -> Any:
    """Return (S + K)⁻¹·f of an eliminated node, and the force K·(S + K)⁻¹·f on its neighbour."""
    gxx, gxy, gxz, gyx, gyy, gyz, gzx, gzy, gzz = gain
    xx, xy, xz, yy, yz, zz = inverse
    x, y, z = f
    solution = (
        (xx * x + xy * y) + xz * z, (xy * x + yy * y) + yz * z, (xz * x + yz * y) + zz * z,
    )  # fmt: skip
    force = (
        (gxx * x + gyx * y) + gzx * z, (gxy * x + gyy * y) + gzy * z, (gxz * x + gyz * y) + gzz * z,
    )  # fmt: skip
    return solution, force


@jit_within
def six(work: Floats, first: int, i: int) -> Any:
    """Return column i of six rows."""
    return (
        work[first, i], work[first + 1, i], work[first + 2, i], work[first + 3, i],
        work[first + 4, i], work[first + 5, i],
    )  # fmt: skip


@jit_within
def spring(work: Floats, e: int) -> Any:
    """Return K of element e: xx, xy, xz, yy, yz, zz."""
    x, y, z = work[DIRECTION, e], work[DIRECTION + 1, e], work[DIRECTION + 2, e]
    b, ax, ay = work[GEOMETRIC, e], work[AXIAL, e] * x, work[AXIAL, e] * y
    return ax * x + b, ax * y, ax * z, ay * y + b, ay * z, work[AXIAL, e] * z * z + b


@jit_within
def ground(work: Floats, first: int) -> Any:
    """Return Z of the lowest free node: zero, or the element to the fixed node below it."""
    xx, xy, xz, yy, yz, zz = spring(work, ZERO)
    tied = 1.0 if first == 1 else 0.0
    return tied * xx, tied * xy, tied * xz, tied * yy, tied * yz, tied * zz


@jit_within
def hold_ends(work: Floats, first: int, n: int) -> None:
    """Set the correction to zero where motion is prescribed."""
    for k in range(3):
        work[CORRECTION + k, n] = 0.0
        if first == 1:
            work[CORRECTION + k, 0] = 0.0


@jit_ordered_within
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


@jit_within
def lanes(p: Any, k: int) -> Any:
    """Return lane k of three pairs."""
    return lane(p[0], k), lane(p[1], k), lane(p[2], k)


@jit_within
def six_lanes(p: Any, k: int) -> Any:
    """Return lane k of six pairs."""
    return lane(p[0], k), lane(p[1], k), lane(p[2], k), lane(p[3], k), lane(p[4], k), lane(p[5], k)


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
def dot(a: Any, b: Any) -> Any:
    """Return the inner product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


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

    - for the back-substitution, y, G and I of delta = y - G·next - I·(d·second): S⁻¹·f, S⁻¹·B and
      S⁻¹;
    - the Schur complement: V and D⁻¹·V, which add -Vᵀ·D⁻¹·V to the next node; then -Bᵀ·y, -d·y,
      -d²·S⁻¹ and, coupling the two nodes, -d·Bᵀ·S⁻¹ by rows.
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
    solution = (h0 - l10 * oy - l20 * h2, oy, h2)
    pushed = (
        0.0 - (h0 * a[0] + h1 * b[0] + h2 * c[0]), 0.0 - (h0 * a[1] + h1 * b[1] + h2 * c[1]),
        0.0 - (h0 * a[2] + h1 * b[2] + h2 * c[2]),
    )  # fmt: skip
    minus = 0.0 - d
    cross = (
        (minus * gx[0], minus * gy[0], minus * z[0]), (minus * gx[1], minus * gy[1], minus * z[1]),
        (minus * gx[2], minus * gy[2], minus * z[2]),
    )  # fmt: skip
    far = times_six(minus, times_six(d, I))
    schur = ((a, b, c), (x, y, z)), pushed, scaled(minus, solution), far, cross
    return (solution, (gx, gy, z), I), schur


@jit_ordered_within
def reduce_coupled_node(f: Any, G: Any, I: Any, d: Any) -> Any:
    """Return S⁻¹·f of an eliminated node for another force f, and forces on the next two nodes."""
    solution = apply(I, f)
    x, y, z = G
    pushed = (
        0.0 - (x[0] * f[0] + y[0] * f[1] + z[0] * f[2]),
        0.0 - (x[1] * f[0] + y[1] * f[1] + z[1] * f[2]),
        0.0 - (x[2] * f[0] + y[2] * f[1] + z[2] * f[2]),
    )
    return solution, pushed, scaled(0.0 - d, solution)


@jit_ordered_within
def onto_next(schur: Any, carried: Any, K: Any) -> Any:
    """Return the Schur complement on the next node, on the second next, and their coupling.

    schur: contribution of the node; carried: matrix and force of earlier nodes on the next.
    """
    (V, W), pushed, far, second, cross = schur
    S, f = carried
    return lessen(add_six(S, K), V, W), add(f, pushed), (second, far), cross


@jit_ordered_within
def substituted(factors: Any, near: Any, far: Any) -> Any:
    """Return delta of a node from that of the next, and d times that of the second next."""
    solution, G, I = factors
    x, y, z = apply(I, far)
    px, py, pz = near
    gx, gy, gz = G
    return (
        (solution[0] - x) - gx[0] * px - gx[1] * py - gx[2] * pz,
        (solution[1] - y) - gy[0] * px - gy[1] * py - gy[2] * pz,
        (solution[2] - z) - gz[0] * px - gz[1] * py - gz[2] * pz,
    )


RECORD = 36  # numbers: pairs of the gain (S + K)⁻¹·K by rows, of the solution, of the inverse


@jit_within
def two(a: Any, b: Any) -> Any:
    """Return pairs of three numbers each."""
    return pair(a[0], b[0]), pair(a[1], b[1]), pair(a[2], b[2])


@jit_within
def two_of_six(a: Any, b: Any) -> Any:
    """Return pairs of six numbers each."""
    return (
        pair(a[0], b[0]), pair(a[1], b[1]), pair(a[2], b[2]), pair(a[3], b[3]), pair(a[4], b[4]),
        pair(a[5], b[5]),
    )  # fmt: skip


@jit_within
def pair_of_nodes(work: Any, nodes: Any, elements: Any, Z: Any) -> Any:
    """Return Ŝ of two nodes, and direction, AXIAL and GEOMETRIC of their next elements.

    Z: Schur complements of the eliminated nodes on them.
    """
    (i, j), (d, e) = nodes, elements
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    x, y, z = rows(work, DIRECTION, 0)
    a, b = gather(row(work, AXIAL, 0), d, e), gather(row(work, GEOMETRIC, 0), d, e)
    S = (
        Z[0] + (gather(Axx, i, j) + b), Z[1] + gather(Axy, i, j), Z[2] + gather(Axz, i, j),
        Z[3] + (gather(Ayy, i, j) + b), Z[4] + gather(Ayz, i, j), Z[5] + (gather(Azz, i, j) + b),
    )  # fmt: skip
    return S, (gather(x, d, e), gather(y, d, e), gather(z, d, e)), a, b


@jit_within
def pushed_on(work: Any, i: int, j: int, f: Any) -> Any:
    """Return the force on two nodes, including the condensed force f of eliminated nodes."""
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    return f[0] + gather(Rx, i, j), f[1] + gather(Ry, i, j), f[2] + gather(Rz, i, j)


@jit_within
def eliminate_pair(work: Any, record: Any, at: int, nodes: Any, elements: Any, state: Any) -> Any:
    """Eliminate two nodes; return Schur complement and condensed force on their neighbours.

    record, at: row of records and start of this pair's record; state: Z and f on the two nodes.
    """
    S, t, a, b = pair_of_nodes(work, nodes, elements, state[0])
    force = pushed_on(work, nodes[0], nodes[1], state[1])
    gain, solution, schur, pushed, inverse = eliminate_node(S, force, t, a, b)
    keep_pair(record, at, gain, solution, inverse)
    return schur, pushed


@jit_within
def store_three(record: Any, at: int, pairs: Any) -> None:
    """Store three pairs."""
    store(record, at, pairs[0])
    store(record, at + 2, pairs[1])
    store(record, at + 4, pairs[2])


@jit_within
def load_three(record: Any, at: int) -> Any:
    """Load three pairs."""
    return load(record, at), load(record, at + 2), load(record, at + 4)


@jit_within
def keep_pair(record: Any, at: int, gain: Any, solution: Any, inverse: Any) -> None:
    """Store the factors of a pair."""
    store_three(record, at, gain[:3])
    store_three(record, at + 6, gain[3:6])
    store_three(record, at + 12, gain[6:])
    store_three(record, at + 18, solution)
    store_three(record, at + 24, inverse[:3])
    store_three(record, at + 30, inverse[3:])


@jit_within
def reduce_pair(record: Any, at: int, f: Any) -> Any:
    """Store the solution of two nodes for force f; return the condensed force on the neighbours."""
    gain = load_three(record, at) + load_three(record, at + 6) + load_three(record, at + 12)
    inverse = load_three(record, at + 24) + load_three(record, at + 30)
    solution, pushed = reduce_node(gain, inverse, f)
    store_three(record, at + 18, solution)
    return pushed


@jit_within
def substitute_pair(record: Any, at: int, p: Any) -> Any:
    """Return delta of a pair of nodes from that of their neighbours nearer the middle."""
    px, py, pz = p
    return (
        (load(record, at + 18) + load(record, at) * px)
        + (load(record, at + 2) * py + load(record, at + 4) * pz),
        (load(record, at + 20) + load(record, at + 6) * px)
        + (load(record, at + 8) * py + load(record, at + 10) * pz),
        (load(record, at + 22) + load(record, at + 12) * px)
        + (load(record, at + 14) * py + load(record, at + 16) * pz),
    )


# A batch of ropes, one per lane; the factors of node i are in its column.
INVERSE = ELIMINATED + 12


@jit_ordered_within
def force_on(work: Any, i: int, f: Any) -> Any:
    """Return the force on node i, including the condensed force f of eliminated nodes."""
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    return f[0] + Rx[i], f[1] + Ry[i], f[2] + Rz[i]


@jit_within
def set_column(work: Any, first: int, i: int, values: Any) -> None:
    """Set column i of three rows."""
    work[first, i], work[first + 1, i], work[first + 2, i] = values


@jit_within
def keep_column(work: Any, first: int, i: int, values: Any, moved: Any) -> None:
    """Set column i of three rows in the lanes of `moved`."""
    work[first, i] = choose(moved, values[0], work[first, i])
    work[first + 1, i] = choose(moved, values[1], work[first + 1, i])
    work[first + 2, i] = choose(moved, values[2], work[first + 2, i])


@jit_within
def keep_six(work: Any, first: int, i: int, S: Any, moved: Any) -> None:
    """Store a symmetric matrix in column i of six rows, in the lanes of `moved`."""
    keep_column(work, first, i, S[:3], moved)
    keep_column(work, first + 3, i, S[3:], moved)


@jit_within
def keep_nine(work: Any, first: int, i: int, M: Any, moved: Any) -> None:
    """Store a matrix, by rows or columns, in column i of nine rows, in the lanes of `moved`."""
    keep_column(work, first, i, M[0], moved)
    keep_column(work, first + 3, i, M[1], moved)
    keep_column(work, first + 6, i, M[2], moved)


@jit_within
def nine(work: Any, first: int, i: int) -> Any:
    """Return column i of nine rows in threes."""
    return column(work, first, i), column(work, first + 3, i), column(work, first + 6, i)


@jit_within
def keep_factors(work: Any, i: int, gain: Any, solution: Any, inverse: Any, moved: Any) -> None:
    """Store the factors of node i in the lanes of `moved`, its solution in all; gain by rows."""
    keep_nine(work, ELIMINATED, i, gain, moved)
    set_column(work, ELIMINATED + 9, i, solution)
    keep_six(work, INVERSE, i, inverse, moved)


@jit_ordered_within
def nothing_at(work: Any, i: int) -> Any:
    """Return a zero force in all lanes."""
    zero = row(work, RESIDUAL, 0)[i] * 0.0
    return zero, zero, zero
