"""Shedding frequency held over each half wavelength of the response along a rope.

[LCD] Le Cunff and Durand (1999): ω = 2π·St·U/d, and waves of this frequency have k² = (√(T² +
4·EI·m_t·ω²) - T)/(2·EI), or m_t·ω²/T. Counted from the hang-off down, a half wave keeps the
frequency of its upper end.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

from rope_twin.core.guards import RATE_MIN, TANGENT2_MIN
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import row, rows
from rope_twin.core.state import DIRECTION, FLOW, MASS, TENSION, VOLUME


@jit_within
def across(water: Any, tangent: Any) -> Any:
    """Return U × t and its magnitude, the water velocity normal to the rope."""
    u, v, w = water
    x, y, z = tangent
    cx, cy, cz = v * z - w * y, w * x - u * z, u * y - v * x
    return cx, cy, cz, sqrt(cx * cx + cy * cy + cz * cz)


@jit_within
def _pace(turns: float, water: Any, direction: Any, per_diameter: float) -> Any:
    """Return 2π·St·U/d [rad/s] for water normal to a direction vector of any length."""
    x, y, z = direction
    inverse = 1.0 / sqrt(x * x + y * y + z * z + TANGENT2_MIN)
    _, _, _, speed = across(water, (x * inverse, y * inverse, z * inverse))
    return turns * speed * per_diameter


@jit
def set_paces(turns: float, work: Any, per_diameter: Any, pace: Any, low: int, high: int) -> None:
    """Set 2π·St·U/d of the nodes low <= i < high [rad/s], U normal to the adjacent elements.

    turns: 2π·St; per_diameter and pace: 1/d and the result, from node `low` on.
    """
    first = max(low, 1)
    if low == 0:
        water = (work[FLOW, 0], work[FLOW + 1, 0], work[FLOW + 2, 0])
        x, y, z = work[DIRECTION, 0], work[DIRECTION + 1, 0], work[DIRECTION + 2, 0]
        pace[0] = _pace(turns, water, (2.0 * x, 2.0 * y, 2.0 * z), per_diameter[0])
    tx, ty, tz = rows(work, DIRECTION, first)
    bx, by, bz = rows(work, DIRECTION, first - 1)
    ux, uy, uz = rows(work, FLOW, first)
    own, per = pace[first - low :], per_diameter[first - low :]
    for i in range(high - first):
        direction = (tx[i] + bx[i], ty[i] + by[i], tz[i] + bz[i])
        own[i] = _pace(turns, (ux[i], uy[i], uz[i]), direction, per[i])


@jit_within
def wave_number(EI: float, T: float, m: float, omega: float) -> Any:
    """Return k of a wave of this frequency [1/m]; 0 where the rope is slack. m: mass per metre."""
    inertia = m * omega * omega
    square = 2.0 * inertia / (T + sqrt(T * T + 4.0 * EI * inertia) + RATE_MIN)
    return sqrt(square) if T > 0.0 else 0.0


@jit
def _set_turns(waves: Any, work: Any, length: Any, turn: Any, n: int) -> None:
    """Set k·length/ω of the nodes below n, without bending stiffness [s]."""
    T, mass, volume = row(work, TENSION, 0), row(work, MASS, 0), row(work, VOLUME, 0)
    for i in range(n):
        moved = mass[i] + waves.added * volume[i]
        turn[i] = sqrt(2.0 * length[i] * moved / (T[i] + T[i] + RATE_MIN)) if T[i] > 0.0 else 0.0


@jit
def hold_frequencies(waves: Any, work: Any, length: Any, held: Any, turn: Any, n: int) -> None:
    """Hold ω of the upper end over each half wave, from the hang-off down.

    held: each node's own ω, replaced by that of its half wave. turn: scratch.
    """
    T, mass, volume = row(work, TENSION, 0), row(work, MASS, 0), row(work, VOLUME, 0)
    if waves.EI == 0.0:
        _set_turns(waves, work, length, turn, n)
    turned, omega = pi, 0.0
    for i in range(n - 1, -1, -1):
        if turned >= pi:
            turned, omega = turned - pi, held[i]
        held[i] = omega
        if waves.EI == 0.0:
            turned += omega * turn[i]
        else:
            per_metre = (mass[i] + waves.added * volume[i]) / length[i]
            turned += length[i] * wave_number(waves.EI, T[i], per_metre, omega)
