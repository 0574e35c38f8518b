"""The wake oscillator of [QM] under forced motion, integrated in time, as its text may be read: Q2.

The check of the harmonic balance in wake_cylinder: it shares no line with it. Lengths in diameters,
ω = 1, so that V = V_r/2π.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from rope_twin.effects.wake_oscillator import SETS
from rope_twin.studies.accuracy_study import page_table
from rope_twin.studies.picture import Vector

SET, DRAG = SETS["qu_metrikine"], 1.2
PERIODS, PER_PERIOD = 120, 48  # the second half counts
SPEEDS, STEP = (4.8, 7.2), 0.05  # of V_r, and of both axes


class Reading(NamedTuple):
    """One reading of eqs 15-17 and 24-29; V: speed of the water, U: that the cylinder feels."""

    name: str
    lift: str = "UV"  # times C_L0/2·q
    drag: str = "U"  # times C_D·y'
    pace: str = "V"  # of ω_s
    driven_by: str = "acceleration"
    first: float = 0.5  # q that the wake starts from


class Region(NamedTuple):
    """Region of power-in: limits in V_r, and maximum amplitude [D]."""

    lower: float
    upper: float
    largest: float


KEPT = Reading("kept: lift on V·U, drag on U, pace by V, driven by acceleration")
READINGS = (
    KEPT,
    Reading("the same, the wake starts from q 0.01", first=0.01),
    Reading("the same, the wake starts from q 8", first=8.0),
    Reading("lift on U²", lift="UU"),
    Reading("lift on V²", lift="VV"),
    Reading("drag on V", drag="V"),
    Reading("pace by U", pace="U"),
    Reading("driven by the velocity", driven_by="velocity"),
)


def mean_power(reading: Reading, pair: tuple[float, float], reduced: Vector, y: Vector) -> Vector:
    """Return the mean power of the water on y·sin t, over V_r and y together (Runge and Kutta)."""
    A, epsilon = pair
    reduced, y = np.broadcast_arrays(reduced, y)
    V, h = reduced / (2.0 * pi), 2.0 * pi / PER_PERIOD

    def slope(q: Vector, rate: Vector, t: float) -> tuple[Vector, Vector]:
        pace = V if reading.pace == "V" else np.hypot(V, y * np.cos(t))
        shed = 2.0 * pi * SET.strouhal * pace
        push = -np.sin(t) if reading.driven_by == "acceleration" else np.cos(t)
        return rate, A * y * push - epsilon * shed * (q * q - 1.0) * rate - shed**2 * q

    q, rate, total = np.full(V.shape, reading.first), np.zeros(V.shape), np.zeros(V.shape)
    for k in range(PERIODS * PER_PERIOD):
        t = k * h
        v1, a1 = slope(q, rate, t)
        v2, a2 = slope(q + 0.5 * h * v1, rate + 0.5 * h * a1, t + 0.5 * h)
        v3, a3 = slope(q + 0.5 * h * v2, rate + 0.5 * h * a2, t + 0.5 * h)
        v4, a4 = slope(q + h * v3, rate + h * a3, t + h)
        q = q + h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4)
        rate = rate + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if 2 * k >= PERIODS * PER_PERIOD:
            moved = y * np.cos(t + h)
            U = np.hypot(V, moved)
            lift = {"UV": U * V, "UU": U * U, "VV": V * V}[reading.lift]
            drag = U if reading.drag == "U" else V
            total += (0.5 * SET.lift * q * lift - DRAG * drag * moved) * moved
    return total / (PERIODS * PER_PERIOD // 2)


def region(reading: Reading, pair: tuple[float, float], highest: float) -> Region | None:
    """Return the region of positive power, to a step of V_r and y, or None if there is none."""
    reduced = np.arange(SPEEDS[0], SPEEDS[1] + 0.5 * STEP, STEP)
    y = np.arange(STEP, highest, STEP)
    gains = mean_power(reading, pair, reduced[:, None], y[None]) > 0.0
    if not gains.any():
        return None
    speeds = reduced[gains.any(axis=1)]
    return Region(float(speeds[0]), float(speeds[-1]), float(y[gains.any(axis=0)][-1]))


def table_of_readings() -> str:
    """Return both regions by each reading, as a table."""
    rows = [
        ["tried", "A 4, ε 0.05: V_r", "ŷ_max", "A 1, ε 0.1: V_r", "ŷ_max"],
        ["printed", "about 5 to 7", "about 1", "around 6", "below 0.5"],
    ]
    for reading in READINGS:
        cells = [reading.name]
        for pair in (SET.upright, SET.inclined):
            locked = region(reading, pair, 1.3)
            cells += [_ends(locked), "-" if locked is None else f"{locked.largest:.2f}"]
        rows.append(cells)
    return page_table(rows)


def _ends(locked: Region | None) -> str:
    if locked is None:
        return "none"
    low = f"under {locked.lower:.2f}" if locked.lower <= SPEEDS[0] else f"{locked.lower:.2f}"
    high = f"over {locked.upper:.2f}" if locked.upper >= SPEEDS[1] - 1e-6 else f"{locked.upper:.2f}"
    return f"{low} to {high}"
