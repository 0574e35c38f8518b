"""Exact tension at the top of a vertical rope that is paid out: travelling waves, moving boundary.

An undamped elastic rope in vacuum, unstretched coordinate s from the payload (mass M, weight W) up
to the sheave at s = L(t), obeys m·z_tt = EA·z_ss - w. So z = Z(s) + phi(t - s/c) + psi(t + s/c),
Z = z0 + s·(1 + W/EA) + w·s²/(2·EA), c = √(EA/m) (d'Alembert). With p = phi', q = psi' and the
impedance I = √(EA·m):

- payload, velocity u = p + q at s = 0:        M·u' = I·(2·q - u)
- sheave, z(L(t), t) = z_top(t), differentiated:
  q(t + L/c)·(1 + V/c) = z_top' - V·(1 + (W + w·L)/EA) - p(t - L/c)·(1 - V/c)
- tension just below the sheave:               F = W + w·L + I·(q(t + L/c) - p(t - L/c))

Starts from rest. It shares nothing with the element model but the motions put in.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Motion = Callable[[float], tuple[float, float]]  # time to value and rate


@dataclass(frozen=True)
class HangingBar:
    """m, w per metre; M, W of the payload; EA."""

    m: float
    w: float
    EA: float
    M: float
    W: float


class _Series:
    """A function known at rising times, 0 before the first, linear between."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._values: list[float] = []

    def add(self, time: float, value: float) -> None:
        self._times.append(time)
        self._values.append(value)

    def at(self, time: float) -> float:
        k = bisect_right(self._times, time)
        if k == 0:
            return 0.0
        if k == len(self._times):
            return self._values[-1]
        t0, t1 = self._times[k - 1], self._times[k]
        v0, v1 = self._values[k - 1], self._values[k]
        return v0 + (v1 - v0) * (time - t0) / (t1 - t0)


def top_tension(bar: HangingBar, line: Motion, top: Motion, seconds: float, step: float) -> Vector:
    """Return F [N] at 0, step, 2·step ...; `line`: line out L and V, `top`: the sheave's z and z'.

    Marched with `step`; the delay L/c must be longer than that.
    """
    c, impedance = math.sqrt(bar.EA / bar.m), math.sqrt(bar.EA * bar.m)
    p, q = _Series(), _Series()
    u, q_old = 0.0, 0.0
    keep = math.exp(-impedance / bar.M * step)
    lag = (1.0 - keep) * bar.M / (impedance * step)
    tension = []
    for k in range(round(seconds / step) + 1):
        t = k * step
        if k:  # M·u' = I·(2q - u), exact for a q that is linear over the step
            q_new = q.at(t)
            u = u * keep + 2.0 * (q_old * (lag - keep) + q_new * (1.0 - lag))
            q_old = q_new
        p.add(t, u - q_old)
        L, V = line(t)
        downward = p.at(t - L / c)
        rate = top(t)[1] - V * (1.0 + (bar.W + bar.w * L) / bar.EA) - downward * (1.0 - V / c)
        upward = rate / (1.0 + V / c)
        q.add(t + L / c, upward)
        tension.append(bar.W + bar.w * L + impedance * (upward - downward))
    return np.array(tension)


def ramped_speed(length: float, acceleration: float, commands: list[tuple[float, float]]) -> Motion:
    """Return the line out of a winch under (time, speed) commands with an acceleration limit."""
    knots: list[tuple[float, float, float, float]] = [(0.0, length, 0.0, 0.0)]  # t, L, V, A

    def move(to: float) -> tuple[float, float]:
        t, L, V, A = knots[-1]
        return L + V * (to - t) + 0.5 * A * (to - t) ** 2, V + A * (to - t)

    for start, speed in commands:
        L, V = move(start)
        A = math.copysign(acceleration, speed - V)
        knots.append((start, L, V, A))
        reached = start + abs(speed - V) / acceleration
        L, _ = move(reached)
        knots.append((reached, L, speed, 0.0))

    def at(time: float) -> tuple[float, float]:
        k = max(i for i, knot in enumerate(knots) if knot[0] <= time)
        t, L, V, A = knots[k]
        return L + V * (time - t) + 0.5 * A * (time - t) ** 2, V + A * (time - t)

    return at
