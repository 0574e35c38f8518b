"""Divergence of the drag amplified by a VIV model between the rope and its coarse solution.

Which mode is excited at a node is a selection. Where rope and coarse solution select alike, their
drag differs little and the error of both is of second order. Where they do not, the coarse solution
only shows how far a rope with another selection may be from this one: the difference is then the
error itself, not a multiple of it.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.state import Floats

# fitted on the two scenes with such a model and five other lifts by each:
VIV_FRACTION = 0.37  # fraction of the difference that is the error where the drag agrees
AGREEMENT, DIVERGENCE = 0.005, 0.015  # relative difference of the drag: agreement, divergence
DIVERGED_S = 5.0  # how long a divergence counts: the rope has moved by it


def drag_divergence(amplified: Floats, coarse: Floats) -> float:
    """Return the mean difference of two drag amplifications along the rope over their mean.

    amplified, coarse: of the rope and of the coarse solution, at the nodes from the lower end
    up.
    """
    at = np.linspace(0.0, 1.0, len(coarse))
    own = np.interp(at, np.linspace(0.0, 1.0, len(amplified)), amplified)
    return float(np.abs(own - coarse).mean() / own.mean())


def diverged_fraction(share: float, by: float) -> float:
    """Return the fraction of the difference that is the error; share: where the drag agrees."""
    part = (by - AGREEMENT) / (DIVERGENCE - AGREEMENT)
    return share + (1.0 - share) * min(max(part, 0.0), 1.0)
