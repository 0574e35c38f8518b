"""Elements that only pull: T = max(0, EA·strain + c·strain rate), and their stiffness blocks.

One max() over the sum keeps the law continuous and convex: a damper never pushes and there is no
jump c·rate at first contact. Discretisation and guard: lumped mass rope with element directions
t = Δx/l; l² is kept off zero by (1e-8·rest)² for an element whose nodes meet.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.jit import jit, jit_inline
from rope_twin.core.state import (
    AXIAL,
    CORRECTION,
    DIRECTION,
    EXPECTED,
    GEOMETRIC,
    POSITION,
    REST,
    TENSION,
    VELOCITY,
)


@jit_inline
def _pull(EA: float, c: float, rest: float, V: float, length: float, offset: float, closing: float) -> Any:  # fmt: skip # noqa: E501
    """EA·strain + c·strain rate before the max [N].

    strain = (length + offset - rest)/rest; its rate is closing/rest - V·length/rest², where V is
    the speed at which the element's rest length grows (the top element under payout).
    """
    inverse = 1.0 / rest
    strain = (length + offset - rest) * inverse
    return EA * strain + c * (closing - V * length * inverse) * inverse


@jit
def stretch(work: Any, offset: Any, EA: float, c: float, p: float, q: float, V: float, low: int, high: int) -> None:  # fmt: skip # noqa: E501
    """Direction, tension and stiffness blocks of the elements low <= e < high.

    The block of an element is ka·t·tᵀ + kb·I: kb = p·T/l is the geometric part,
    ka = p·(EA - c·V/rest)/rest + q·c/rest - kb the rest of the axial part; both 0 when slack.
    The derivative of the direction inside the strain rate is dropped, which keeps the block
    symmetric; Newton then needs no more solves (measured).
    """
    px, py, pz = work[POSITION], work[POSITION + 1], work[POSITION + 2]
    vx, vy, vz = work[VELOCITY], work[VELOCITY + 1], work[VELOCITY + 2]
    tx, ty, tz = work[DIRECTION], work[DIRECTION + 1], work[DIRECTION + 2]
    rest, T, ka, kb = work[REST], work[TENSION], work[AXIAL], work[GEOMETRIC]
    for e in range(low, high):
        dx = px[e + 1] - px[e]
        dy = py[e + 1] - py[e]
        dz = pz[e + 1] - pz[e]
        r = rest[e]
        length = sqrt(dx * dx + dy * dy + dz * dz + 1e-16 * r * r)
        inverse = 1.0 / length
        dx *= inverse
        dy *= inverse
        dz *= inverse
        closing = dx * (vx[e + 1] - vx[e]) + dy * (vy[e + 1] - vy[e]) + dz * (vz[e + 1] - vz[e])
        pull = _pull(EA, c, r, V, length, offset[e], closing)
        taut = pull > 0.0
        pull = pull if taut else 0.0
        across = p * pull * inverse
        along = p * (EA - c * V / r) / r + q * c / r - across
        tx[e] = dx
        ty[e] = dy
        tz[e] = dz
        T[e] = pull
        ka[e] = max(along, 0.0) if taut else 0.0
        kb[e] = across


@jit
def stretch_all(work: Any, offset: Any, model: Any, stage: Any, n: int) -> None:
    """All elements: only the top one grows, at the payout speed V."""
    stretch(work, offset, model.EA, model.c, stage.p, stage.q, 0.0, 0, n - 1)
    stretch(work, offset, model.EA, model.c, stage.p, stage.q, stage.V, n - 1, n)


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
