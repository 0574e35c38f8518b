"""Fraction of the difference to the coarse solution that is the rope's error.

It is a third where elements and step are of second order (Richardson 1911). It is larger where
waves decay within an element (`wave_error_fraction`), where the drag is amplified by a loosely
coupled VIV model (`divergence`), in multi-line systems, and where the current jumps between two
layers:

The current acts at nodes. A jump of it at the fraction y of an element, from the node below, loads
the rope as if it lay midway between two nodes, by (y - ½) elements too high or low: an error of
first order, at most half an element. On the coarse mesh it is at most a whole element, and the
difference of the two is always half an element. So the error never exceeds the difference, and is
half of it on average.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.state import Floats, Rope
from rope_twin.core.waves.rows import AMPLITUDE, OMEGA, K
from rope_twin.effects.current import Current, CurrentInTime
from rope_twin.effects.waves import Waves
from rope_twin.twin.accuracy.divergence import VIV_FRACTION
from rope_twin.twin.accuracy.error_bound import THIRD
from rope_twin.vortex.drag_amplification import DragGrowth

MULTI_LINE = 0.5  # multi-line: elements of several lengths have different errors, and those that
# cancel in the difference may not in the rope; fitted on bridle_lift, where 1/3 covered 94.8 %
THIN_LAYER = 0.01  # of an element: thickness of a layer that counts as a jump of the current
PASSING_S = 1.5  # window of the difference where elements pass a jump of the current: the rope
# smooths the jump, and the difference passes through zero when a coarse element passes it;
# fitted on two_line_14km; sufficient in two_line_loop, whose elements are five times as long


def fraction_of_difference(rope: Rope, meets: bool) -> float:
    """Return the fraction of the difference that is the rope's error; meets: multi-line."""
    shaken = any(isinstance(effect, DragGrowth) for effect in rope.effects)
    least = max(MULTI_LINE if meets else 0.0, VIV_FRACTION if shaken else 0.0)
    share = max(wave_error_fraction(rope), least)
    return max(share, 1.0) if has_layers(rope) else share


def full_difference_s(rope: Rope) -> float:
    """Return how long the full difference counts [s]; 0 where the current has no jump."""
    return PASSING_S if has_layers(rope) else 0.0


def has_layers(rope: Rope) -> bool:
    """Return whether the current jumps within a small part of an element."""
    for effect in rope.effects:
        current = effect.current if isinstance(effect, CurrentInTime) else effect
        if isinstance(current, Current):
            thin = np.diff(current.z) < THIN_LAYER * rope.model.element_length
            return bool((thin & (np.diff(current.U, axis=1) != 0.0).any(axis=0)).any())
    return False


SERIES_LIMIT = 1e-3  # k·l/2 below which x²/3 is used; the next term of the series is -x⁴/45


def excess_load_m(k: Floats, element_m: float) -> Floats:
    """Excess load of nodes `element_m` apart over a component's load per metre at z = 0 [m].

    The water's acceleration decays as e^{kz} below the surface. A rope feels it at nodes, so with
    elements of length l a component with wave number k loads it by the trapezoidal sum of e^{kz},
    which is too large by l/2·coth(k·l/2) - 1/k per metre of its force at the surface (a geometric
    series): k·l²/12, of second order, where k·l is small, but l/2 itself, of first order, where the
    component decays within an element.
    """
    x = 0.5 * k * element_m
    closed = x / np.tanh(np.maximum(x, SERIES_LIMIT)) - 1.0
    return np.asarray(np.where(x < SERIES_LIMIT, x * x / 3.0, closed) / k)


def wave_error_fraction(rope: Rope) -> float:
    """Return the fraction 1/3 to 1 of the difference that is the error, by the scene's waves.

    Where a component decays within an element, the difference to elements of twice the length is
    equal to the error, not three times as large (`excess_load_m`). Root mean square over the
    components, each by its acceleration a·ω²; a third without waves.
    """
    sea = next((effect for effect in rope.effects if isinstance(effect, Waves)), None)
    if sea is None:
        return THIRD
    length = rope.model.element_length
    own = sea.table[:, sea.table[AMPLITUDE] > 0.0]
    error, twice = (excess_load_m(own[K], times * length) for times in (1.0, 2.0))
    push = own[AMPLITUDE] * own[OMEGA] ** 2
    share = np.linalg.norm(push * error) / np.linalg.norm(push * (twice - error))
    return max(float(share), THIRD)
