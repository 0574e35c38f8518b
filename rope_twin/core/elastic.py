"""Elements that only pull: T = max(0, E(strain) + c·strain rate), and their stiffness blocks.

E is EA·strain, or a table where the rope has one (core/law.py).

One max() over the sum keeps the law continuous and convex: a damper never pushes and there is no
jump c·rate at first contact. Discretisation and guard: lumped mass rope with element directions
t = Δx/l; l² is kept off zero by (1e-8·rest)² for an element whose nodes meet.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.jit import jit
from rope_twin.core.law import pull_of
from rope_twin.core.rows import offset_row, row, rows
from rope_twin.core.state import (
    AXIAL,
    CORRECTION,
    DAMPING,
    DIRECTION,
    ELEMENTS,
    EXPECTED,
    GEOMETRIC,
    POSITION,
    REST,
    SECTION,
    STIFFNESS,
    TENSION,
    VELOCITY,
)


@jit
def stretch(
    law: Any, work: Any, offset: Any, p: float, q: float, growth: float, low: int, high: int
) -> None:
    """Direction, tension and stiffness blocks of the elements low <= e < high.

    T = E((l + offset - rest)/rest) + DAMPING·(t·Δv - growth·l), where growth [1/s] is the rate of
    the rest length over that length; STIFFNESS is E's tangent over rest. The block of an element is
    AXIAL·t·tᵀ + GEOMETRIC·I with GEOMETRIC = p·T/l and AXIAL = p·(STIFFNESS - growth·DAMPING) +
    q·DAMPING - GEOMETRIC, both 0 when slack. The derivative of the direction inside the strain rate
    is dropped, which keeps the block symmetric; Newton then needs no more solves (measured).
    """
    px, py, pz = rows(work, POSITION, low)
    nx, ny, nz = rows(work, POSITION, low + 1)
    vx, vy, vz = rows(work, VELOCITY, low)
    wx, wy, wz = rows(work, VELOCITY, low + 1)
    tx, ty, tz = rows(work, DIRECTION, low)
    T, axial, geometric = row(work, TENSION, low), row(work, AXIAL, low), row(work, GEOMETRIC, low)
    stiffness, damping = row(work, STIFFNESS, low), row(work, DAMPING, low)
    rest, slack = row(work, REST, low), offset_row(offset, low)
    section = row(work, SECTION, low)
    for e in range(high - low):
        dx, dy, dz = nx[e] - px[e], ny[e] - py[e], nz[e] - pz[e]
        l0 = rest[e]
        length = sqrt(dx * dx + dy * dy + dz * dz + 1e-16 * l0 * l0)
        inverse = 1.0 / length
        dx *= inverse
        dy *= inverse
        dz *= inverse
        closing = dx * (wx[e] - vx[e]) + dy * (wy[e] - vy[e]) + dz * (wz[e] - vz[e])
        elastic, k = pull_of(law, section, stiffness, e, length + slack[e] - l0, l0)
        pull = elastic + damping[e] * (closing - growth * length)
        taut = pull > 0.0
        pull = pull if taut else 0.0
        across = p * pull * inverse
        along = p * (k - growth * damping[e]) + q * damping[e] - across
        tx[e] = dx
        ty[e] = dy
        tz[e] = dz
        T[e] = pull
        axial[e] = max(along, 0.0) if taut else 0.0
        geometric[e] = across


@jit
def stretch_top(rope: Any, stage: Any) -> None:
    """The top element, which grows at the payout speed V."""
    top = rope.state.counts[ELEMENTS] - 1
    stretch(
        rope.law,
        rope.work,
        rope.state.offset,
        stage.p,
        stage.q,
        stage.V / rope.work[REST, top],
        top,
        top + 1,
    )


@jit
def stretch_all(rope: Any, stage: Any) -> None:
    """All elements."""
    top = rope.state.counts[ELEMENTS] - 1
    stretch(rope.law, rope.work, rope.state.offset, stage.p, stage.q, 0.0, top - top, top)
    stretch_top(rope, stage)


@jit
def expect_tension(work: Any, low: int, high: int) -> None:
    """T that the linearisation expects after the correction; T itself where slack."""
    dx, dy, dz = rows(work, CORRECTION, low)
    nx, ny, nz = rows(work, CORRECTION, low + 1)
    tx, ty, tz = rows(work, DIRECTION, low)
    T, axial, geometric = row(work, TENSION, low), row(work, AXIAL, low), row(work, GEOMETRIC, low)
    expected = row(work, EXPECTED, low)
    for e in range(high - low):
        stretching = tx[e] * (nx[e] - dx[e]) + ty[e] * (ny[e] - dy[e]) + tz[e] * (nz[e] - dz[e])
        expected[e] = T[e] + (axial[e] + geometric[e]) * stretching


@jit
def count_unexpected(work: Any, tolerance: float, low: int, high: int) -> int:
    """Elements whose tension is not what the linearisation expected; NaN counts as one."""
    T, expected = row(work, TENSION, low), row(work, EXPECTED, low)
    wrong = 0
    for e in range(high - low):
        wrong += not (abs(T[e] - expected[e]) <= tolerance)
    return wrong
