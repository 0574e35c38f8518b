"""Whether the drag of rope and companion has grown alike, where a model of vortices makes it grow.

Which mode drives a place is a choice. Where rope and companion choose alike, what their drag grows
by differs by little and the error of both is of second order. Where they do not, the companion
tells no more than how far a rope that chooses otherwise may be from this one: the difference is the
error then, not a multiple of it.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.state import Floats

# found on the two scenes with such a model and five other lifts by each:
SHAKEN = 0.37  # of the difference that is the rope's error where the drag has grown alike
ALIKE, OTHERWISE = 0.005, 0.015  # of the drag: it differs by less, by more
REMEMBERED_S = 5.0  # so long it counts: the rope has moved by it


def differ_by(amplified: Floats, companions: Floats) -> float:
    """What a rope has more or less drag than the companion, in the mean along it, over its mean.

    Both are what the drag is multiplied by at the nodes, from the lower end up.
    """
    at = np.linspace(0.0, 1.0, len(companions))
    own = np.interp(at, np.linspace(0.0, 1.0, len(amplified)), amplified)
    return float(np.abs(own - companions).mean() / own.mean())


def share_where_they_differ(share: float, by: float) -> float:
    """Of a difference that is the rope's error; `share`: where the drag has grown alike."""
    part = (by - ALIKE) / (OTHERWISE - ALIKE)
    return share + (1.0 - share) * min(max(part, 0.0), 1.0)
