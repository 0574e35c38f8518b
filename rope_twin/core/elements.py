"""Tension-only elements of a rope: sections, tension, direction and tangent stiffness.

T = max(0, E + c·strain rate), with the elastic part E of core/axial_law. One max() over the sum
keeps the law continuous: the damper cannot push, and there is no jump c·rate when an element
becomes taut.

Masses are lumped; an element's direction is t = Δx/l, with l² regularised by (1e-8·l_0)² for nodes
that coincide. A boundary between sections is always a node, so an element belongs to one section.
Stiffness per element and mass, volume and areas per node follow from the unstretched lengths;
effects read those rows and do not depend on sections. Only the top element grows, at the payout
speed.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.axial_law import law_from, law_of, pull_of
from rope_twin.core.jit.decorators import jit, jit_ordered_within, jit_within
from rope_twin.core.jit.functions import anywhere
from rope_twin.core.jit.rows import offset_row, row, rows
from rope_twin.core.jit.wide import choose, count_beyond
from rope_twin.core.state import (
    AXIAL,
    CHANGE,
    CORRECTION,
    DAMPING,
    DIRECTION,
    DIVISOR_MIN,
    EA,
    ELEMENTS,
    END,
    GEOMETRIC,
    GROWTH,
    LENGTH,
    MASS,
    PER_METRE,
    POSITION,
    REST,
    SAME_PLACE,
    SECTION,
    STIFFNESS,
    STRETCH2_MIN,
    TENSION,
    VELOCITY,
    C,
    Floats,
    Rope,
    Stage,
)

PER_AREA = 1.1283791670955126  # diameter over the root of the section's area, √(4/π)


@jit_within
def diameter(volume: float, length: float) -> float:
    """Return the diameter of this volume on this length [m]."""
    return PER_AREA * sqrt(volume / (length + DIVISOR_MIN))


@jit_within
def dry_height(length: float, volume: float) -> Any:
    """Return a height over the surface [m] above which a node's rope is dry however it lies."""
    return 0.5 * length + diameter(volume, length)


@jit_within
def section_above(sections: Any, s: Any) -> int:
    """Return the section of the rope just above material coordinate s, the same in all lanes."""
    k = 0
    while anywhere(sections[END, k] <= s + SAME_PLACE):
        k += 1
    return k


@jit_within
def set_element(work: Floats, sections: Any, k: int, e: int, rest: float) -> None:
    """Set unstretched length, section k and stiffness of element e; it does not grow."""
    work[REST, e] = rest
    work[GROWTH, e] = 0.0
    work[SECTION, e] = k
    work[STIFFNESS, e] = sections[EA, k] / rest
    work[DAMPING, e] = sections[C, k] / rest


@jit_ordered_within
def set_growth(work: Floats, e: int, V: Any) -> None:
    """Set the growth rate of element e, whose unstretched length changes at V [m/s]."""
    work[GROWTH, e] = V / work[REST, e]


@jit
def set_lengths(work: Floats, s: Any, sections: Any, n: int, L: float) -> None:
    """Set all elements and lumped nodes for paid-out length L; no element grows."""
    section = 0
    for k in range(MASS, LENGTH + 1):
        work[k, 0] = 0.0
    for e in range(n):
        rest = (L if e == n - 1 else s[e + 1]) - s[e]
        while anywhere(sections[END, section] <= s[e] + SAME_PLACE):
            section += 1
        set_element(work, sections, section, e, rest)
        for k in range(MASS, LENGTH + 1):
            half = 0.5 * rest * sections[k - MASS + PER_METRE, section]
            work[k, e] += half
            work[k, e + 1] = half


@jit
def set_top_length(work: Floats, s: Any, sections: Any, n: int, L: float, V: float) -> None:
    """Update the top element and its nodes for the paid-out length L [m] and its rate V [m/s]."""
    top, below = section_above(sections, s[n - 1]), section_above(sections, s[n - 2])
    set_top_of(work, s, sections, n, (L, V), (top, below))


@jit_within
def set_top_of(work: Floats, s: Any, sections: Any, n: int, line: Any, indices: Any) -> None:
    """Set the top element and its nodes.

    line: paid-out length and its rate; indices: sections of the top element and of the one below.
    """
    (L, V), (top, below) = line, indices
    rest = L - s[n - 1]
    set_element(work, sections, top, n - 1, rest)
    for k in range(MASS, LENGTH + 1):
        per_metre = k - MASS + PER_METRE
        half = 0.5 * rest * sections[per_metre, top]
        work[k, n - 1] = 0.5 * work[REST, n - 2] * sections[per_metre, below] + half
        work[k, n] = half
    set_growth(work, n - 1, V)


@jit_within
def _relative_motion(motion: Any, e: int) -> Any:
    """Return position and velocity of an element's upper node relative to its lower one."""
    px, py, pz, nx, ny, nz, vx, vy, vz, wx, wy, wz = motion
    return (
        nx[e] - px[e], ny[e] - py[e], nz[e] - pz[e],
        wx[e] - vx[e], wy[e] - vy[e], wz[e] - vz[e],
    )  # fmt: skip


@jit_within
def _corrected_motion(motion: Any, deltas: Any, weights: Any, e: int) -> Any:
    """Return relative position and velocity including a pending correction of the nodes."""
    px, py, pz, nx, ny, nz, vx, vy, vz, wx, wy, wz = motion
    dx, dy, dz, ex, ey, ez = deltas
    p, q = weights
    return (
        (nx[e] + p * ex[e]) - (px[e] + p * dx[e]),
        (ny[e] + p * ey[e]) - (py[e] + p * dy[e]),
        (nz[e] + p * ez[e]) - (pz[e] + p * dz[e]),
        (wx[e] + q * ex[e]) - (vx[e] + q * dx[e]),
        (wy[e] + q * ey[e]) - (vy[e] + q * dy[e]),
        (wz[e] + q * ez[e]) - (vz[e] + q * dz[e]),
    )  # fmt: skip


@jit_within
def _evaluate_element(properties: Any, relative: Any, weights: Any, e: int) -> Any:
    """Return direction, tension, AXIAL and GEOMETRIC of element e, as defined in `stretch`."""
    law, rest, offset, section, stiffness, damping, growth_rates = properties
    dx, dy, dz, wx, wy, wz = relative
    p, q = weights
    l0, growth = rest[e], growth_rates[e]
    length = sqrt(dx * dx + dy * dy + dz * dz + STRETCH2_MIN * l0 * l0)
    inverse = 1.0 / length
    dx *= inverse
    dy *= inverse
    dz *= inverse
    rate = dx * wx + dy * wy + dz * wz
    rows = section, stiffness
    elastic, k = pull_of(law, rows, e, length + offset[e] - l0, l0, rate, weights)
    pull = elastic + damping[e] * (rate - growth * length)
    taut = pull > 0.0
    pull = choose(taut, pull, 0.0)
    geometric = p * pull * inverse
    axial = p * (k - growth * damping[e]) + q * damping[e] - geometric
    return dx, dy, dz, pull, choose(taut, max(axial, 0.0), 0.0), geometric


@jit_within
def _properties(law: Any, work: Floats, offset: Any, low: int) -> Any:
    """Return the law and rows of the elements from `low` on."""
    stiffness, damping = row(work, STIFFNESS, low), row(work, DAMPING, low)
    return (
        law_from(law, work, low), row(work, REST, low), offset_row(offset, low),
        row(work, SECTION, low), stiffness, damping, row(work, GROWTH, low),
    )  # fmt: skip


@jit_within
def _motion(work: Floats, low: int) -> Any:
    """Return the rows of position and velocity of the elements' lower and upper nodes."""
    px, py, pz = rows(work, POSITION, low)
    nx, ny, nz = rows(work, POSITION, low + 1)
    vx, vy, vz = rows(work, VELOCITY, low)
    wx, wy, wz = rows(work, VELOCITY, low + 1)
    return px, py, pz, nx, ny, nz, vx, vy, vz, wx, wy, wz


@jit
def stretch(law: Any, work: Floats, offset: Any, p: float, q: float, low: int, high: int) -> None:
    """Set direction, tension and stiffness blocks of the elements low <= e < high.

    T = E((l + offset - l_0)/l_0) + DAMPING·(t·Δv - GROWTH·l), l_0 the unstretched length, where
    GROWTH [1/s] is its relative rate; STIFFNESS is E's tangent over l_0. The block of an element is
    AXIAL·t·tᵀ + GEOMETRIC·I with GEOMETRIC = p·T/l and AXIAL = p·(STIFFNESS - GROWTH·DAMPING) +
    q·DAMPING - GEOMETRIC, both 0 when slack. The derivative of the direction inside the strain rate
    is omitted, which keeps the block symmetric and costs no additional Newton iterations
    (measured).
    """
    properties, motion = _properties(law, work, offset, low), _motion(work, low)
    tx, ty, tz = rows(work, DIRECTION, low)
    T, axial, geometric = row(work, TENSION, low), row(work, AXIAL, low), row(work, GEOMETRIC, low)
    for e in range(high - low):
        x, y, z, pull, axial_e, geometric_e = _evaluate_element(
            properties, _relative_motion(motion, e), (p, q), e
        )
        tx[e] = x
        ty[e] = y
        tz[e] = z
        T[e] = pull
        axial[e] = axial_e
        geometric[e] = geometric_e


@jit
def count_unexpected(rope: Rope, stage: Stage, low: int, high: int) -> int:
    """Return the number of tensions that deviate from their linearisation after the correction.

    Directions and tensions are set to those of the corrected motion.
    """
    work, tolerance = rope.work, rope.model.tolerance
    properties = _properties(law_of(rope), work, rope.state.offset, low)
    motion, weights = _motion(work, low), (stage.p, stage.q)
    deltas = (*rows(work, CORRECTION, low), *rows(work, CORRECTION, low + 1))
    tx, ty, tz = rows(work, DIRECTION, low)
    T, axial, geometric = row(work, TENSION, low), row(work, AXIAL, low), row(work, GEOMETRIC, low)
    count = 0
    for e in range(high - low):
        dx, dy, dz, ex, ey, ez = deltas
        elongation = tx[e] * (ex[e] - dx[e]) + ty[e] * (ey[e] - dy[e]) + tz[e] * (ez[e] - dz[e])
        expected = T[e] + (axial[e] + geometric[e]) * elongation
        relative = _corrected_motion(motion, deltas, weights, e)
        x, y, z, pull, _, _ = _evaluate_element(properties, relative, weights, e)
        count = count_beyond(count, pull, expected, tolerance)
        tx[e] = x
        ty[e] = y
        tz[e] = z
        T[e] = pull
    return count


@jit
def find_change(rope: Rope, stage: Stage, low: int, high: int, column: int) -> None:
    """Set directions and tensions of the corrected motion; store the change of element forces.

    The change is stored in CHANGE, from `column` on.
    """
    work = rope.work
    properties = _properties(law_of(rope), work, rope.state.offset, low)
    motion, weights = _motion(work, low), (stage.p, stage.q)
    deltas = (*rows(work, CORRECTION, low), *rows(work, CORRECTION, low + 1))
    tx, ty, tz = rows(work, DIRECTION, low)
    T = row(work, TENSION, low)
    cx, cy, cz = rows(work, CHANGE, column)
    for e in range(high - low):
        relative = _corrected_motion(motion, deltas, weights, e)
        x, y, z, pull, _, _ = _evaluate_element(properties, relative, weights, e)
        cx[e] = pull * x - T[e] * tx[e]
        cy[e] = pull * y - T[e] * ty[e]
        cz[e] = pull * z - T[e] * tz[e]
        tx[e] = x
        ty[e] = y
        tz[e] = z
        T[e] = pull


@jit
def stretch_all(rope: Rope, stage: Stage) -> None:
    """Apply `stretch` to all elements."""
    n = rope.state.counts[ELEMENTS]
    stretch(law_of(rope), rope.work, rope.state.offset, stage.p, stage.q, n - n, n)


@jit
def end_rope(work: Floats, n: int) -> None:
    """Set an element of zero length and tension above node n, where a joint carries the end."""
    for k in range(DIRECTION, DIRECTION + 3):
        work[k, n] = work[k, n - 1]
    work[REST, n] = 0.0
    work[TENSION, n] = 0.0
    work[AXIAL, n] = 0.0
