"""Tables that bound the error of wave kinematics, made once for a sea (core/waves).

**Truncation**: depth of components, node spacing, distance from a base position or a tabulated
level. Each neglects part of the water velocity; the total error is below `neglected` [m/s]. Here k
are wave numbers [1/m] in ascending order and speed is a·ω of each component at the surface [m/s],
(n,), where ω is at least 1/s, so that the bound holds for the acceleration too.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rope_twin.core.state import WAVE_MIN, Floats
from rope_twin.core.waves import BLOCK, MAX_DECAY_EXPONENT

# Fractions of the error budget. A cubic amplifies an error of its four values by up to 1.63.
TRUNCATION_SHARE, ROTATION_SHARE, DECAY_SHARE, INTERPOLATION_SHARE = 0.2, 0.05, 0.05, 0.5
LEVELS, MAX_LEVEL_DEPTH = 40, 2e3  # of the table of stretches, to this depth [m]
BISECTIONS = 60  # bisections for the depth that a component reaches
MAX_ROTATION_RANGE = 1e4  # m: maximum range of rotated angles
MAX_DECAY_LEVELS = 500  # below the last one e^{kz} is computed
ROUND_OFF_EXPONENT = 36.7  # e^-36.7 is round-off of 1


def levels_to(depth: float) -> Floats:
    """Return the levels at which the longest stretches are tabulated, from the surface down [m]."""
    return -np.append(0.0, np.geomspace(0.25, min(depth, MAX_LEVEL_DEPTH), LEVELS))


def lowest_level(k: Floats, depth: float) -> float:
    """Return the z at which the longest component ends: the bottom, or where it has decayed [m]."""
    return max(-MAX_DECAY_EXPONENT / float(k[0]), -depth)


def reach_levels(k: Floats, speed: Floats, depth: float, neglected: float) -> Floats:
    """Return for each component the z below which it and all shorter ones are negligible.

    z is Wheeler's. The bound is the sum of all amplitudes, Σ a·ω·(e^{kz} + e^{-k(z+2h)}), solved by
    bisection.
    """
    error, bottom = TRUNCATION_SHARE * neglected, lowest_level(k, depth)
    reach = np.full(len(k), bottom)
    for j in range(len(k)):
        low, high = bottom, 0.0
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            decay_sum = np.exp(k[j:] * middle) + np.exp(-k[j:] * (middle + 2.0 * depth))
            if float(speed[j:] @ decay_sum) > error:
                high = middle
            else:
                low = middle
        reach[j] = low if low > bottom else -math.inf
    return reach


def lowest_node_height(reach: float, crest: float, depth: float) -> float:
    """Return the z below which no component reaches a node, for coincident crests or troughs.

    From Wheeler's z that the longest one reaches, `reach` [m]; crest: Σ a [m].
    """
    if crest >= depth:
        return -math.inf
    return reach * (1.0 - crest / depth) - crest


def reflection_levels(k: Floats, depth: float) -> Floats:
    """Return for each component the z down to which its reflection at the bottom is negligible."""
    return 0.5 * ROUND_OFF_EXPONENT / k - depth


def stretch_thirds(
    levels: Floats, k: Floats, speed: Floats, depth: float, neglected: float
) -> Floats:
    """Return a third of the longest stretch [m] that a cubic can interpolate below each level.

    (11·error/Σ a·ω·k⁴·(e^{kz} + e^{-k(z+2h)}))^¼, where ω is at least 1/s.
    """
    error, size = INTERPOLATION_SHARE * neglected, speed * k**4
    return np.asarray(
        (11.0 * error / np.maximum(_decay_sum(levels, k, depth) @ size, WAVE_MIN)) ** 0.25
    )


def rotation_ranges(
    levels: Floats, k: Floats, a: Floats, speed: Floats, depth: float, neglected: float
) -> Floats:
    """Return the horizontal range [m] over which angles may be rotated, below each level.

    The relative error of a component rotated by d = k·r is d⁶/720: in the velocity that of Σ
    a·ω·k⁶·e^{kz}, and in the surface that of Σ a·k⁶, which shifts Wheeler's z and changes the
    velocity by Σ a·ω·k·e^{kz} a metre, in shallow water by h/(h - Σ a) times as much.
    """
    margin = 1.0 - float(a.sum()) / depth
    if margin <= 0.0:
        return np.zeros(len(levels))
    decay = _decay_sum(np.maximum(levels, lowest_level(k, depth)), k, depth)
    error_sum = decay @ (speed * k**6) + decay @ (speed * k) * float(a @ k**6) / margin
    return np.minimum(
        (720.0 * ROTATION_SHARE * neglected / np.maximum(error_sum, WAVE_MIN)) ** (1 / 6),
        MAX_ROTATION_RANGE,
    )


def decay_table(
    k: Floats, speed: Floats, reach: Floats, depth: float, neglected: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the rows DECAY_LEVEL, DECAY_END and DECAY_START, and e^{kz} at these levels.

    About a level z the decay of a component is expanded by d = k·(distance), with an error of
    Σ a·ω·k⁶·e^{kz}·(distance)⁶/720, from the level above on. reach: of each component [m].
    """
    size, lowest = speed * k**6, lowest_level(k, depth)
    levels: list[float] = []
    ends: list[float] = []
    z = 0.0
    while z > lowest and len(levels) < MAX_DECAY_LEVELS:
        error_sum = max(float((np.exp(k * z) + np.exp(-k * depth)) @ size), WAVE_MIN)
        distance = (720.0 * DECAY_SHARE * neglected / error_sum) ** (1 / 6)
        if distance == 0.0:
            break
        levels.append(z)
        ends.append(z - distance)
        z -= 2.0 * distance
    begins = [0.0, *ends][: len(ends)]
    echoes = reflection_levels(k, depth)
    counts = [
        BLOCK * max(_blocks(reach <= begin), _blocks(echoes > end))
        for begin, end in zip(begins, ends, strict=True)
    ]
    padded = np.zeros(BLOCK * _blocks(np.ones(len(k), dtype=bool)))
    padded[: len(k)] = k
    values = [np.exp(padded[:n] * z) for n, z in zip(counts, levels, strict=True)]
    starts = np.append(0, np.cumsum(counts)).astype(float)
    return np.array(levels), np.array(ends), starts, np.concatenate([*values, np.zeros(1)])


def _blocks(wanted: NDArray[np.bool_]) -> int:
    """Return the number of blocks that hold the longest components, which are wanted."""
    return -(-int(wanted.sum()) // BLOCK)


def _decay_sum(levels: Floats, k: Floats, depth: float) -> Floats:
    """Return e^{kz} + e^{-k(z+2h)} of components at levels, (levels, n)."""
    return np.exp(np.outer(levels, k)) + np.exp(-np.outer(levels + 2.0 * depth, k))
