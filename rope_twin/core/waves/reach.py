"""Truncation of wave kinematics: component depth, node spacing, range of rotated angles.

All three neglect a part of the water's velocity; the total stays below `neglected` [m/s]. Here k
are wave numbers [1/m] from long to short and speed is a·ω of each at the surface [m/s], (n,), where
ω is at least 1/s, so that the bound holds for the acceleration too.
"""

from __future__ import annotations

import math

import numpy as np

from rope_twin.core.guards import WAVE_MIN
from rope_twin.core.state import Floats
from rope_twin.core.waves.sums import LOWEST

# Fractions of the error budget. A cubic amplifies an error of its four values by up to 1.63.
CUT, TURN, BETWEEN = 0.2, 0.1, 0.5
LEVELS, DEEPEST = 40, 2e3  # of the table of stretches, to this depth [m]
HALVINGS = 60  # that find how deep a component reaches
FARTHEST = 1e4  # m: maximum range of rotated angles
ROUND_OFF_EXPONENT = 36.7  # e^-36.7 is round-off of 1


def levels_to(depth: float) -> Floats:
    """Return the levels at which the longest stretches are tabulated, from the surface down [m]."""
    return -np.append(0.0, np.geomspace(0.25, min(depth, DEEPEST), LEVELS))


def deepest(k: Floats, depth: float) -> float:
    """Return the z at which the longest component ends: the bottom, or where it has decayed [m]."""
    return max(-LOWEST / float(k[0]), -depth)


def reaches(k: Floats, speed: Floats, depth: float, neglected: float) -> Floats:
    """Return for each component the z below which it and all shorter ones are negligible.

    z is Wheeler's. The bound is the sum of all amplitudes, Σ a·ω·(e^{kz} + e^{-k(z+2h)}), solved by
    bisection.
    """
    error, bottom = CUT * neglected, deepest(k, depth)
    reach = np.full(len(k), bottom)
    for j in range(len(k)):
        low, high = bottom, 0.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            both = np.exp(k[j:] * middle) + np.exp(-k[j:] * (middle + 2.0 * depth))
            if float(speed[j:] @ both) > error:
                high = middle
            else:
                low = middle
        reach[j] = low if low > bottom else -math.inf
    return reach


def lowest(reach: float, crest: float, depth: float) -> float:
    """Return the z below which no component reaches a node, for coincident crests or troughs.

    From Wheeler's z that the longest one reaches, `reach` [m]; crest: Σ a [m].
    """
    if crest >= depth:
        return -math.inf
    return reach * (1.0 - crest / depth) - crest


def echoes(k: Floats, depth: float) -> Floats:
    """Return for each component the z down to which its reflection at the bottom is negligible."""
    return 0.5 * ROUND_OFF_EXPONENT / k - depth


def thirds(levels: Floats, k: Floats, speed: Floats, depth: float, neglected: float) -> Floats:
    """Return a third of the longest stretch [m] that a cubic can interpolate below each level.

    (11·error/Σ a·ω·k⁴·(e^{kz} + e^{-k(z+2h)}))^¼, where ω is at least 1/s.
    """
    error, size = BETWEEN * neglected, speed * k**4
    return np.asarray((11.0 * error / np.maximum(_both(levels, k, depth) @ size, WAVE_MIN)) ** 0.25)


def asides(
    levels: Floats, k: Floats, a: Floats, speed: Floats, depth: float, neglected: float
) -> Floats:
    """Return the horizontal range [m] over which angles may be rotated, below each level.

    The relative error of a component rotated by d = k·r is d⁶/720: in the velocity that of Σ
    a·ω·k⁶·e^{kz}, and in the surface that of Σ a·k⁶, which shifts Wheeler's z and changes the
    velocity by Σ a·ω·k·e^{kz} a metre, in shallow water by h/(h - Σ a) times as much.
    """
    room = 1.0 - float(a.sum()) / depth
    if room <= 0.0:
        return np.zeros(len(levels))
    both = _both(np.maximum(levels, deepest(k, depth)), k, depth)
    wrong = both @ (speed * k**6) + both @ (speed * k) * float(a @ k**6) / room
    return np.minimum((720.0 * TURN * neglected / np.maximum(wrong, WAVE_MIN)) ** (1 / 6), FARTHEST)


def _both(levels: Floats, k: Floats, depth: float) -> Floats:
    """Return e^{kz} + e^{-k(z+2h)} of components at levels, (levels, n)."""
    return np.exp(np.outer(levels, k)) + np.exp(-np.outer(levels + 2.0 * depth, k))
