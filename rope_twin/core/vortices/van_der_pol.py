"""A van der Pol oscillator in a time of its own, solved at a node inside a stage.

In the wake's time τ, dτ = ω·dt, with y the motion that drives it over the diameter:

    d²q/dτ² + ε·(q² - 1)·dq/dτ + q = A·d²y/dτ²

Where ω is constant that is q'' + ε·ω·(q² - 1)·q' + ω²·q = A·y''. Where it falls to 0 that form has
nothing that brings q back, and q grows without end. Here it is carried as q and p, what dq/dτ is
without the drive (Liénard 1928):

    q' = ω·p + A·y',    p' = -ε·(q² - 1)·q' - ω·q

Nothing in it is divided by ω: at ω = 0 the wake stands.

A body that moves many times as fast as the water leaves vortices of its own, and the drive would
only count its way: A·y' fades by 1/(1 + (A·y'/(40·ω))⁴). In lock-in at a diameter, A·y'/ω is 4 to 5
and the fading 2e-4; q then stays below (4·23/ε)^⅓, 12 for ε 0.05, in any motion.
"""

from __future__ import annotations

from math import pi, sin, sqrt
from typing import Any

from rope_twin.core.guards import NONE_AT_ALL
from rope_twin.core.jit.decorators import jit_within

WAVES = 24  # half waves along the rope that smooth noise is made of
GOLDEN = 2.399963  # rad, between their phases
FASTEST = 40.0  # A·dy/dτ at which the drive is halved


@jit_within
def smooth_noise(share: float) -> Any:
    """Noise of half waves at a share of the rope's length, so that finer elements see the same."""
    total = 0.0
    for j in range(1, WAVES + 1):
        total += sin(pi * j * share + GOLDEN * j * j)
    return sqrt(2.0 / WAVES) * total


@jit_within
def faded(drive: Any, omega: Any) -> Any:
    """A·y' as the wake feels it, and the derivative of that to A·y'."""
    x, limit = drive * drive, (FASTEST * omega) ** 2
    s = limit * limit / (limit * limit + x * x + NONE_AT_ALL)
    return s * drive, s * (4.0 * s - 3.0)


@jit_within
def wake_of(c: float, q: Any, start: Any, figures: Any) -> Any:
    """p of the stage that has this q: see `solve_wake`."""
    hat, wake_hat, _ = start
    omega, epsilon = figures
    return wake_hat - epsilon * (q * q - 1.0) * (q - hat) - c * omega * q


@jit_within
def solve_wake(c: float, count: int, start: Any, figures: Any, drive: Any) -> Any:
    """q of the stage q = hat + c·q', p = wake_hat + c·p', by Newton; and the slope s of the cubic.

    start: both hats and a guess of q; figures: ω and ε; drive: A·y', faded. dq/d(drive) is c/s.
    """
    hat, wake_hat, q = start
    omega, epsilon = figures
    k, slope = c * omega, 1.0
    for _ in range(count):
        own = k * epsilon * (q * q - 1.0)
        miss = (q - hat) * (1.0 + own) - k * (wake_hat - k * q) - c * drive
        slope = 1.0 + own + 2.0 * k * epsilon * q * (q - hat) + k * k
        q -= miss / slope
    return q, slope
