"""Fraction of the difference to the coarse solution that is the rope's error.

It is a third where elements and step are of second order (Richardson 1911). It is larger where
waves decay within an element (`surface_layer`), where the drag is amplified by a loosely coupled
VIV model (`grown_apart`), in multi-line systems, and where the current jumps between two layers:

The current acts at nodes. A jump of it at the fraction y of an element, from the node below, loads
the rope as if it lay midway between two nodes, by (y - ½) elements too high or low: an error of
first order, at most half an element. On the coarse mesh it is at most a whole element, and the
difference of the two is always half an element. So the error never exceeds the difference, and is
half of it on average.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.state import Rope
from rope_twin.core.vortices.drag_growth import DragGrowth
from rope_twin.effects.current import Current, CurrentInTime
from rope_twin.twin.accuracy.grown_apart import SHAKEN
from rope_twin.twin.accuracy.surface_layer import error_per_difference

MEETING = 0.5  # multi-line: elements of several lengths have different errors, and those that
# cancel in the difference may not in the rope; fitted on bridle_lift, where 1/3 covered 94.8 %
THIN = 0.01  # of an element: thickness of a layer that counts as a jump of the current
PASSING_S = 1.5  # window of the difference where elements pass a jump of the current: the rope
# smooths the jump, and the difference passes through zero when a coarse element passes it;
# fitted on two_line_14km; sufficient in two_line_loop, whose elements are five times as long


def share_of_difference(rope: Rope, meets: bool) -> float:
    """Return the fraction of the difference that is the rope's error; meets: multi-line."""
    shaken = any(isinstance(effect, DragGrowth) for effect in rope.effects)
    least = max(MEETING if meets else 0.0, SHAKEN if shaken else 0.0)
    share = max(error_per_difference(rope), least)
    return max(share, 1.0) if has_layers(rope) else share


def whole_for_s(rope: Rope) -> float:
    """Return how long the full difference counts [s]; 0 where the current has no jump."""
    return PASSING_S if has_layers(rope) else 0.0


def has_layers(rope: Rope) -> bool:
    """Return whether the current jumps within a small part of an element."""
    for effect in rope.effects:
        current = effect.current if isinstance(effect, CurrentInTime) else effect
        if isinstance(current, Current):
            thin = np.diff(current.z) < THIN * rope.model.element_length
            return bool((thin & (np.diff(current.U, axis=1) != 0.0).any(axis=0)).any())
    return False
