"""How deep waves are felt, how far apart nodes may be that take the water from a cubic, and how far
aside of a place angles may be turned instead of found.

All three leave something out of the water's velocity; what they leave out stays together under
`neglected` [m/s]. Here k are wave numbers [1/m] from long to short and speed is a·ω of each at the
surface [m/s], (n,), where ω counts as 1/s at least, so that it bounds the acceleration too.
"""

from __future__ import annotations

import math

import numpy as np

from rope_twin.core.guards import NO_WAVES
from rope_twin.core.state import Floats
from rope_twin.core.waves.sums import LOWEST

# Shares of what may be neglected. A cubic of four values makes 1.63 of an error that all may have.
CUT, TURN, BETWEEN = 0.2, 0.1, 0.5
LEVELS, DEEPEST = 40, 2e3  # of the table of stretches, to this depth [m]
HALVINGS = 60  # that find how deep a component reaches
FARTHEST = 1e4  # m: so far aside angles are turned at most
SMALL = 36.7  # e^-36.7 of 1 is round-off


def levels_to(depth: float) -> Floats:
    """Where the longest stretches are told, from the surface down [m]."""
    return -np.append(0.0, np.geomspace(0.25, min(depth, DEEPEST), LEVELS))


def deepest(k: Floats, depth: float) -> float:
    """The z at which the longest component ends: the bottom, or where nothing is left of it [m]."""
    return max(-LOWEST / float(k[0]), -depth)


def reaches(k: Floats, speed: Floats, depth: float, neglected: float) -> Floats:
    """For each component the z below which it and all shorter ones bring less than their share.

    z is Wheeler's. The bound counts each at its largest, Σ a·ω·(e^{kz} + e^{-k(z+2h)}), by halves.
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
    """The z of nodes below which no component reaches, were all crests or troughs at one place.

    From Wheeler's z that the longest one reaches, `reach` [m]; crest: Σ a [m].
    """
    if crest >= depth:
        return -math.inf
    return reach * (1.0 - crest / depth) - crest


def echoes(k: Floats, depth: float) -> Floats:
    """For each component the z down to which the bottom throws back nothing of it that counts."""
    return 0.5 * SMALL / k - depth


def thirds(levels: Floats, k: Floats, speed: Floats, depth: float, neglected: float) -> Floats:
    """A third of the longest stretch [m] that a cubic serves below each level.

    (11·error/Σ a·ω·k⁴·(e^{kz} + e^{-k(z+2h)}))^¼, where ω counts as 1/s at least.
    """
    error, size = BETWEEN * neglected, speed * k**4
    return np.asarray((11.0 * error / np.maximum(_both(levels, k, depth) @ size, NO_WAVES)) ** 0.25)


def asides(
    levels: Floats, k: Floats, a: Floats, speed: Floats, depth: float, neglected: float
) -> Floats:
    """How far aside [m] angles may be turned, for places below each level.

    A component turned by d = k·r is wrong by d⁶/720 of itself: the velocity by that of
    Σ a·ω·k⁶·e^{kz}, and the surface by that of Σ a·k⁶, which shifts Wheeler's z and changes the
    velocity by Σ a·ω·k·e^{kz} a metre, in shallow water by h/(h - Σ a) times as much.
    """
    room = 1.0 - float(a.sum()) / depth
    if room <= 0.0:
        return np.zeros(len(levels))
    both = _both(np.maximum(levels, deepest(k, depth)), k, depth)
    wrong = both @ (speed * k**6) + both @ (speed * k) * float(a @ k**6) / room
    return np.minimum((720.0 * TURN * neglected / np.maximum(wrong, NO_WAVES)) ** (1 / 6), FARTHEST)


def _both(levels: Floats, k: Floats, depth: float) -> Floats:
    """e^{kz} + e^{-k(z+2h)} of components at levels, (levels, n)."""
    return np.exp(np.outer(levels, k)) + np.exp(-np.outer(levels + 2.0 * depth, k))
