"""How much of the difference to a companion on half the elements is the rope's error.

A third where elements and step are of second order (Richardson 1911). More where waves die within
an element (`surface_layer`), where the drag grows beside the step (`grown_apart`), where ropes
meet, and where the current jumps between two layers:

The current is felt at nodes. A step of it that lies at the part y of an element, from the node
below, loads the rope as if it lay in the middle between two nodes, by (y - ½) elements too high or
low: an error of first order, half an element at most. On every second node it is a whole element at
most, and the difference of the two is always half an element. So the error is never larger than the
difference, and half of it in the mean.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.state import Rope
from rope_twin.core.vortices.drag_growth import DragGrowth
from rope_twin.effects.current import Current, CurrentInTime
from rope_twin.twin.accuracy.grown_apart import SHAKEN
from rope_twin.twin.accuracy.surface_layer import error_per_difference

MEETING = 0.5  # where ropes meet: elements of several lengths err each in its own way, and what
# cancels in the difference need not in the rope; found on bridle_lift, where a third held 94.8 %
THIN = 0.01  # of an element: a step of the current
PASSING_S = 1.5  # so long a difference counts where elements pass a step of the current: the rope
# rounds the step off, and the difference passes through zero when one of the companion's passes;
# found on two_line_14km, and enough in two_line_loop, whose elements are five times as long


def share_of_difference(rope: Rope, meets: bool) -> float:
    """Of the rope's error; meets: others end where it does."""
    shaken = any(isinstance(effect, DragGrowth) for effect in rope.effects)
    least = max(MEETING if meets else 0.0, SHAKEN if shaken else 0.0)
    share = max(error_per_difference(rope), least)
    return max(share, 1.0) if has_layers(rope) else share


def whole_for_s(rope: Rope) -> float:
    """How long the whole difference counts [s]; 0 where the current has no step."""
    return PASSING_S if has_layers(rope) else 0.0


def has_layers(rope: Rope) -> bool:
    """Whether the current jumps within a small part of an element."""
    for effect in rope.effects:
        current = effect.current if isinstance(effect, CurrentInTime) else effect
        if isinstance(current, Current):
            thin = np.diff(current.z) < THIN * rope.model.element_length
            return bool((thin & (np.diff(current.U, axis=1) != 0.0).any(axis=0)).any())
    return False
