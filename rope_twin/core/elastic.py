"""Elements that only pull: T = max(0, EA·strain + c·strain rate), and their stiffness blocks.

One max() over the sum keeps the law continuous and convex: a damper never pushes and there is no
jump c·rate at first contact. Discretisation and guard: lumped mass rope with element directions
t = Δx/l; l² is kept off zero by (1e-8·rest)² for an element whose nodes meet.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.jit import jit
from rope_twin.core.state import (
    AXIAL,
    CORRECTION,
    DIRECTION,
    ELEMENTS,
    EXPECTED,
    GEOMETRIC,
    POSITION,
    REST,
    TENSION,
    VELOCITY,
    Stage,
)


@jit
def stretch(rope: Any, stage: Any, low: int, high: int) -> None:
    """Direction, tension and stiffness blocks of the elements low <= e < high.

    strain = (l + offset - rest)/rest; its rate is t·Δv/rest - V·l/rest², where V (of the stage) is
    the speed at which the rest length grows. The block of an element is AXIAL·t·tᵀ + GEOMETRIC·I
    with GEOMETRIC = p·T/l and AXIAL = p·(EA - c·V/rest)/rest + q·c/rest - GEOMETRIC, both 0 when
    slack. The derivative of the direction inside the strain rate is dropped, which keeps the block
    symmetric; Newton then needs no more solves (measured).
    """
    work, EA, c, V = rope.work, rope.model.EA, rope.model.c, stage.V
    p, q = stage.p, stage.q
    px, py, pz = work[POSITION], work[POSITION + 1], work[POSITION + 2]
    vx, vy, vz = work[VELOCITY], work[VELOCITY + 1], work[VELOCITY + 2]
    tx, ty, tz = work[DIRECTION], work[DIRECTION + 1], work[DIRECTION + 2]
    T, axial, geometric = work[TENSION], work[AXIAL], work[GEOMETRIC]
    rest, offset = work[REST], rope.state.offset
    for e in range(low, high):
        dx = px[e + 1] - px[e]
        dy = py[e + 1] - py[e]
        dz = pz[e + 1] - pz[e]
        l0 = rest[e]
        length = sqrt(dx * dx + dy * dy + dz * dz + 1e-16 * l0 * l0)
        inverse = 1.0 / length
        dx *= inverse
        dy *= inverse
        dz *= inverse
        closing = dx * (vx[e + 1] - vx[e]) + dy * (vy[e + 1] - vy[e]) + dz * (vz[e + 1] - vz[e])
        strain = (length + offset[e] - l0) / l0
        strain_rate = (closing - V * length / l0) / l0
        pull = EA * strain + c * strain_rate
        taut = pull > 0.0
        pull = pull if taut else 0.0
        across = p * pull * inverse
        along = p * (EA - c * V / l0) / l0 + q * c / l0 - across
        tx[e] = dx
        ty[e] = dy
        tz[e] = dz
        T[e] = pull
        axial[e] = max(along, 0.0) if taut else 0.0
        geometric[e] = across


@jit
def stretch_all(rope: Any, stage: Any) -> None:
    """All elements: only the top one grows, at the payout speed V."""
    n = rope.state.counts[ELEMENTS]
    stretch(rope, Stage(stage.time, stage.p, stage.q, 0.0), 0, n - 1)
    stretch(rope, stage, n - 1, n)


@jit
def predict_tension(work: Any, n: int) -> None:
    """T that the linearisation expects after the correction `delta`; T itself where slack."""
    dx, dy, dz = work[CORRECTION], work[CORRECTION + 1], work[CORRECTION + 2]
    tx, ty, tz = work[DIRECTION], work[DIRECTION + 1], work[DIRECTION + 2]
    for e in range(n):
        stretching = (
            tx[e] * (dx[e + 1] - dx[e]) + ty[e] * (dy[e + 1] - dy[e]) + tz[e] * (dz[e + 1] - dz[e])
        )
        work[EXPECTED, e] = work[TENSION, e] + (work[AXIAL, e] + work[GEOMETRIC, e]) * stretching


@jit
def tension_agrees(work: Any, n: int, tolerance: float) -> bool:
    """Whether every tension is what the linearisation expected. NaN counts as disagreement."""
    wrong = 0
    for e in range(n):
        wrong += not (abs(work[TENSION, e] - work[EXPECTED, e]) <= tolerance)
    return wrong == 0
