"""How deep waves are felt, and how far apart nodes may be that take the water from a cubic.

Both leave something out of the water's velocity; what they leave out stays together under
`neglected` [m/s]. Here k are wave numbers [1/m] from long to short and speed is a·ω of each at the
surface [m/s], (n,), where ω counts as 1/s at least, so that it bounds the acceleration too.
"""

from __future__ import annotations

import math

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.core.wave_field import LOWEST

# Shares of what may be neglected. A cubic of four values makes 1.63 of an error that all may have.
CUT, BETWEEN = 0.25, 0.5
LEVELS, DEEPEST = 40, 2e3  # of the table of stretches, to this depth [m]
HALVINGS = 60  # that find how deep a component reaches


def levels_to(depth: float) -> Floats:
    """Where the longest stretches are told, from the surface down [m]."""
    return -np.append(0.0, np.geomspace(0.25, min(depth, DEEPEST), LEVELS))


def reaches(k: Floats, speed: Floats, depth: float, neglected: float) -> Floats:
    """For each component the z below which it and all shorter ones bring less than their share.

    z is Wheeler's. The bound counts each at its largest, Σ a·ω·(e^{kz} + e^{-k(z+2h)}), by halves.
    """
    error, deepest = CUT * neglected, max(-LOWEST / float(k[0]), -depth)
    reach = np.full(len(k), deepest)
    for j in range(len(k)):
        low, high = deepest, 0.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            both = np.exp(k[j:] * middle) + np.exp(-k[j:] * (middle + 2.0 * depth))
            if float(speed[j:] @ both) > error:
                high = middle
            else:
                low = middle
        reach[j] = low if low > deepest else -math.inf
    return reach


def thirds(levels: Floats, k: Floats, speed: Floats, depth: float, neglected: float) -> Floats:
    """A third of the longest stretch [m] that a cubic serves below each level.

    (11·error/Σ a·ω·k⁴·(e^{kz} + e^{-k(z+2h)}))^¼, where ω counts as 1/s at least.
    """
    error, size = BETWEEN * neglected, speed * k**4
    both = np.exp(np.outer(levels, k)) + np.exp(-np.outer(levels + 2.0 * depth, k))
    return np.asarray((11.0 * error / np.maximum(both @ size, 1e-30)) ** 0.25)
