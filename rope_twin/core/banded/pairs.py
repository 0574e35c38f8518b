"""Elimination of two nodes at once, one per SIMD lane, and their factors.

The factors of a pair are a record of RECORD numbers: pairs of the gain (S + K)⁻¹·K by rows, of the
node's own part (S + K)⁻¹·f, and of the inverse; see `core/banded/nodes`.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.banded.nodes import eliminate_node, push_node
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.rows import row, rows, span
from rope_twin.core.jit.simd import gather, load, pair, store
from rope_twin.core.state import AXIAL, BLOCK, DIRECTION, GEOMETRIC, RESIDUAL

RECORD = 36  # numbers: pairs of the gain (S + K)⁻¹·K by rows, of own, of the inverse


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
    """Return Ŝ of two nodes, and direction, AXIAL and GEOMETRIC of the elements they pass.

    Z: the Schur complement of the eliminated part on either of them.
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
    """Return the force on two nodes, including that of the eliminated part, f."""
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    return f[0] + gather(Rx, i, j), f[1] + gather(Ry, i, j), f[2] + gather(Rz, i, j)


@jit_within
def eliminate_pair(work: Any, record: Any, at: int, nodes: Any, elements: Any, state: Any) -> Any:
    """Eliminate two nodes through two elements; return Schur complement and force behind them.

    record, at: the row of records and where this pair's begins; state: Z and f before them.
    """
    S, t, a, b = pair_of_nodes(work, nodes, elements, state[0])
    force = pushed_on(work, nodes[0], nodes[1], state[1])
    gain, own, left, pushed, inverse = eliminate_node(S, force, t, a, b)
    keep(record, at, gain, own, inverse)
    return left, pushed


@jit_within
def keep(record: Any, at: int, gain: Any, own: Any, inverse: Any) -> None:
    """Store the factors of a pair."""
    store(record, at, gain[0])
    store(record, at + 2, gain[1])
    store(record, at + 4, gain[2])
    store(record, at + 6, gain[3])
    store(record, at + 8, gain[4])
    store(record, at + 10, gain[5])
    store(record, at + 12, gain[6])
    store(record, at + 14, gain[7])
    store(record, at + 16, gain[8])
    store(record, at + 18, own[0])
    store(record, at + 20, own[1])
    store(record, at + 22, own[2])
    store(record, at + 24, inverse[0])
    store(record, at + 26, inverse[1])
    store(record, at + 28, inverse[2])
    store(record, at + 30, inverse[3])
    store(record, at + 32, inverse[4])
    store(record, at + 34, inverse[5])


@jit_within
def push_pair(record: Any, at: int, f: Any) -> Any:
    """Return the force behind two eliminated nodes, given that on them; store their own part."""
    gain = (
        load(record, at), load(record, at + 2), load(record, at + 4), load(record, at + 6),
        load(record, at + 8), load(record, at + 10), load(record, at + 12), load(record, at + 14),
        load(record, at + 16),
    )  # fmt: skip
    inverse = (
        load(record, at + 24), load(record, at + 26), load(record, at + 28), load(record, at + 30),
        load(record, at + 32), load(record, at + 34),
    )  # fmt: skip
    own, pushed = push_node(gain, inverse, f)
    store(record, at + 18, own[0])
    store(record, at + 20, own[1])
    store(record, at + 22, own[2])
    return pushed


@jit_within
def substitute_pair(record: Any, at: int, p: Any) -> Any:
    """Return delta of a pair of nodes from that of the nodes behind them."""
    px, py, pz = p
    return (
        (load(record, at + 18) + load(record, at) * px)
        + (load(record, at + 2) * py + load(record, at + 4) * pz),
        (load(record, at + 20) + load(record, at + 6) * px)
        + (load(record, at + 8) * py + load(record, at + 10) * pz),
        (load(record, at + 22) + load(record, at + 12) * px)
        + (load(record, at + 14) * py + load(record, at + 16) * pz),
    )
