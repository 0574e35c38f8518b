"""Condensation of a rope (a chain of nodes) to the connections at its ends, and back-substitution.

The recursion is that of `banded/nodes`, node by node; the result is the chain's Schur complement on
the end nodes. Where both ends are connections the lower one is carried along as three more columns:
node i has (S + K)·delta_i = f + K·delta_{i+1} + P·delta_0, so that with H = (S + K)⁻¹·P delta_i = y
+ G·delta_{i+1} + H·delta_0, and K·H takes the place of P at node i + 1. That is what
`eliminate_node` does with a force, for each column of P. The lower connection is left with D - Σ
Pᵀ·H, a difference: its mass is resolved to 1e-16·K.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.banded.nodes import eliminate_node, spring
from rope_twin.core.jit.decorators import jit_ordered, jit_within
from rope_twin.core.jit.rows import column
from rope_twin.core.state import (
    AXIAL,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELIMINATED,
    GEOMETRIC,
    RESIDUAL,
    WORK_ROWS,
    ZERO,
)

FAR = WORK_ROWS  # 9 rows: H of a node, by rows
CHAIN_ROWS = FAR + 9
_NOTHING = (0.0, 0.0, 0.0)


@jit_within
def _element(work: Any, e: int) -> Any:
    """Return direction, AXIAL and GEOMETRIC of element e."""
    return column(work, DIRECTION, e), work[AXIAL, e], work[GEOMETRIC, e]


@jit_within
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit_within
def _held(work: Any, i: int, e: int, Z: Any) -> Any:
    """Return Ŝ of node i with the Schur complement Z of the eliminated part; element e is next."""
    b = work[GEOMETRIC, e]
    return (
        Z[0] + (work[BLOCK, i] + b), Z[1] + work[BLOCK + 1, i], Z[2] + work[BLOCK + 2, i],
        Z[3] + (work[BLOCK + 3, i] + b), Z[4] + work[BLOCK + 4, i],
        Z[5] + (work[BLOCK + 5, i] + b),
    )  # fmt: skip


@jit_within
def _pushed(work: Any, i: int, f: Any) -> Any:
    """Return the force on node i, including the condensed force of the eliminated part."""
    return f[0] + work[RESIDUAL, i], f[1] + work[RESIDUAL + 1, i], f[2] + work[RESIDUAL + 2, i]


@jit_within
def _keep(work: Any, i: int, gain: Any, own: Any) -> None:
    for k in range(9):
        work[ELIMINATED + k, i] = gain[k]
    for k in range(3):
        work[ELIMINATED + 9 + k, i] = own[k]


@jit_ordered
def eliminate_upward(work: Any, first: int, n: int) -> Any:
    """Eliminate from the lower end, free (first = 0) or fixed (1), to node n: block and force."""
    Z, f = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), _NOTHING
    if first == 1:
        Z = spring(work, ZERO)
    for i in range(first, n):
        S, force = _held(work, i, i, Z), _pushed(work, i, f)
        gain, own, Z, f, _ = eliminate_node(S, force, *_element(work, i))
        _keep(work, i, gain, own)
    return Z, f


@jit_ordered
def eliminate_downward(work: Any, n: int) -> Any:
    """Eliminate from the hang-off n, with prescribed motion, to node 0: block and force."""
    Z, f = spring(work, n - 1), _NOTHING
    for i in range(n - 1, 0, -1):
        e = i - 1
        S, force = _held(work, i, e, Z), _pushed(work, i, f)
        gain, own, Z, f, _ = eliminate_node(S, force, *_element(work, e))
        _keep(work, i, gain, own)
    return Z, f


@jit_ordered
def eliminate_between(work: Any, n: int) -> Any:
    """Condense to both ends: return block and force at node n, at node 0, and P by columns.

    P couples them: -P is the block of row n and column 0.
    """
    xx, xy, xz, yy, yz, zz = D = Z = spring(work, ZERO)
    px, py, pz = (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)
    f, g = _NOTHING, _NOTHING
    for i in range(1, n):
        S, force = _held(work, i, i, Z), _pushed(work, i, f)
        t, a, b = _element(work, i)
        gain, own, Z, f, _ = eliminate_node(S, force, t, a, b)
        _keep(work, i, gain, own)
        _, hx, _, next_x, _ = eliminate_node(S, px, t, a, b)
        _, hy, _, next_y, _ = eliminate_node(S, py, t, a, b)
        _, hz, _, next_z, _ = eliminate_node(S, pz, t, a, b)
        for k in range(3):
            work[FAR + 3 * k, i], work[FAR + 3 * k + 1, i] = hx[k], hy[k]
            work[FAR + 3 * k + 2, i] = hz[k]
        D = (
            D[0] - _dot(px, hx), D[1] - _dot(px, hy), D[2] - _dot(px, hz),
            D[3] - _dot(py, hy), D[4] - _dot(py, hz), D[5] - _dot(pz, hz),
        )  # fmt: skip
        g = (g[0] + _dot(px, own), g[1] + _dot(py, own), g[2] + _dot(pz, own))
        px, py, pz = next_x, next_y, next_z
    return Z, f, D, g, (px, py, pz)


@jit_within
def _moved(work: Any, i: int, d: Any) -> Any:
    """Return y + G·delta of the neighbour that node i was eliminated onto."""
    G = work[ELIMINATED : ELIMINATED + 12]
    return (
        G[9, i] + G[0, i] * d[0] + G[1, i] * d[1] + G[2, i] * d[2],
        G[10, i] + G[3, i] * d[0] + G[4, i] * d[1] + G[5, i] * d[2],
        G[11, i] + G[6, i] * d[0] + G[7, i] * d[1] + G[8, i] * d[2],
    )


@jit_within
def set_column(work: Any, first: int, i: int, d: Any) -> None:
    """Set column i of three rows."""
    work[first, i], work[first + 1, i], work[first + 2, i] = d


@jit_ordered
def substitute_upward(work: Any, first: int, n: int) -> None:
    """Back-substitute after `eliminate_upward`, given the correction of node n."""
    d = column(work, CORRECTION, n)
    for i in range(n - 1, first - 1, -1):
        d = _moved(work, i, d)
        set_column(work, CORRECTION, i, d)
    if first == 1:
        set_column(work, CORRECTION, 0, _NOTHING)


@jit_ordered
def substitute_downward(work: Any, n: int) -> None:
    """Back-substitute after `eliminate_downward`, given the correction of node 0."""
    d = column(work, CORRECTION, 0)
    for i in range(1, n):
        d = _moved(work, i, d)
        set_column(work, CORRECTION, i, d)


@jit_ordered
def substitute_between(work: Any, n: int) -> None:
    """Back-substitute after `eliminate_between`, given the corrections of both ends."""
    far, d = column(work, CORRECTION, 0), column(work, CORRECTION, n)
    for i in range(n - 1, 0, -1):
        H = work[FAR:CHAIN_ROWS]
        x, y, z = _moved(work, i, d)
        d = (
            x + (H[0, i] * far[0] + H[1, i] * far[1] + H[2, i] * far[2]),
            y + (H[3, i] * far[0] + H[4, i] * far[1] + H[5, i] * far[2]),
            z + (H[6, i] * far[0] + H[7, i] * far[1] + H[8, i] * far[2]),
        )
        set_column(work, CORRECTION, i, d)
