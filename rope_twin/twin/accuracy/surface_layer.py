"""Reliability of the difference to a coarser solution where short waves load the rope.

The water's acceleration decays as e^{kz} below the surface. A rope feels it at nodes, so with
elements of length l a component with wave number k loads it by the trapezoidal sum of e^{kz}, which
is too large by l/2·coth(k·l/2) - 1/k per metre of its force at the surface (a geometric series):
k·l²/12, of second order, where k·l is small, but l/2 itself, of first order, where the component
decays within an element. From elements of 2·l the difference is then not three times the error but
equal to it.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.state import Floats, Rope
from rope_twin.core.waves.rows import AMPLITUDE, OMEGA, K
from rope_twin.effects.waves import Waves
from rope_twin.twin.accuracy.error_bound import THIRD

THIN = 1e-3  # k·l/2 below which x²/3 is used; the next term of the series is -x⁴/45


def surplus_m(k: Floats, element_m: float) -> Floats:
    """Excess load of nodes `element_m` apart over a component's load per metre at z = 0 [m]."""
    x = 0.5 * k * element_m
    closed = x / np.tanh(np.maximum(x, THIN)) - 1.0
    return np.asarray(np.where(x < THIN, x * x / 3.0, closed) / k)


def error_per_difference(rope: Rope) -> float:
    """Return the fraction 1/3 to 1 of the difference that is the error, by the scene's waves.

    Root mean square over the components, each by its acceleration a·ω²; a third without waves.
    """
    sea = next((effect for effect in rope.effects if isinstance(effect, Waves)), None)
    if sea is None:
        return THIRD
    length = rope.model.element_length
    own = sea.table[:, sea.table[AMPLITUDE] > 0.0]
    error, twice = (surplus_m(own[K], times * length) for times in (1.0, 2.0))
    push = own[AMPLITUDE] * own[OMEGA] ** 2
    share = np.linalg.norm(push * error) / np.linalg.norm(push * (twice - error))
    return max(float(share), THIRD)
