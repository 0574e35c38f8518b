"""A van der Pol wake oscillator in scaled time, solved at a node inside a stage.

In the wake's time τ, dτ = ω·dt, with y the driving motion divided by the diameter:

    d²q/dτ² + ε·(q² - 1)·dq/dτ + q = A·d²y/dτ²

For constant ω that is q'' + ε·ω·(q² - 1)·q' + ω²·q = A·y''. Where ω falls to 0 that form has no
restoring term, and q grows without bound. Here the state is q and p, which is dq/dτ without the
driving term (Liénard 1928):

    q' = ω·p + A·y',    p' = -ε·(q² - 1)·q' - ω·q

Nothing is divided by ω: at ω = 0 the wake is stationary.

A body that moves many times as fast as the water sheds vortices of its own motion, for which the
driving term would only integrate its path: A·y' is reduced by 1/(1 + (A·y'/(40·ω))⁴). In lock-in at
one diameter, A·y'/ω is 4 to 5 and the reduction 2e-4; q then stays below (4·23/ε)^⅓, 12 for ε 0.05,
in any motion.
"""

from __future__ import annotations

from math import pi, sin, sqrt
from typing import Any

from rope_twin.core.guards import DIVISOR_MIN
from rope_twin.core.jit.decorators import jit_within

WAVES = 24  # number of half waves along the rope that compose the smooth noise
GOLDEN = 2.399963  # rad, phase increment between them
FASTEST = 40.0  # A·dy/dτ at which the driving term is halved


@jit_within
def smooth_noise(share: float) -> Any:
    """Return mesh-independent noise of half waves at a fraction of the rope's length."""
    total = 0.0
    for j in range(1, WAVES + 1):
        total += sin(pi * j * share + GOLDEN * j * j)
    return sqrt(2.0 / WAVES) * total


@jit_within
def faded(drive: Any, omega: Any) -> Any:
    """Return the reduced driving term A·y' and its derivative to A·y'."""
    x, limit = drive * drive, (FASTEST * omega) ** 2
    s = limit * limit / (limit * limit + x * x + DIVISOR_MIN)
    return s * drive, s * (4.0 * s - 3.0)


@jit_within
def wake_of(c: float, q: Any, start: Any, figures: Any) -> Any:
    """Return p of the stage that has this q; see `solve_wake`."""
    hat, wake_hat, _ = start
    omega, epsilon = figures
    return wake_hat - epsilon * (q * q - 1.0) * (q - hat) - c * omega * q


@jit_within
def solve_wake(c: float, count: int, start: Any, figures: Any, drive: Any) -> Any:
    """Solve q = hat + c·q', p = wake_hat + c·p' by Newton's method; return q and slope s.

    start: both explicit parts and an initial guess of q; figures: ω and ε; drive: reduced A·y'; s:
    slope of the cubic. dq/d(drive) is c/s.
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
