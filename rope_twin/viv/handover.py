"""How a place goes over from driving one mode to another: in some periods of its vortices.

The papers share places out once, in a constant current. Beside a rope that moves the shares are
found again and again; that a place's wake changes its mode in an instant is nowhere said, and could
not be: what was shed before is still there. So a place goes over as 1 - e^(-t·f/PERIODS), f the
frequency of its vortices. Which periods that takes is ours; in a constant current nothing depends
on it. Without it the choice feeds back: drag grows where modes take over, the rope moves by it at
some per cent of the water's speed, and which mode leads follows from that speed; two twins on other
elements are then soon nothing like each other.
"""

from __future__ import annotations

import numpy as np

from rope_twin.viv.span import Floats

PERIODS = 8.0


def handed_over(
    before: Floats, wanted: Floats, locked: Floats, shedding_hz: Floats, since_s: float
) -> Floats:
    """What part of each place drives each mode now, (places, modes).

    before: the same a time `since_s` ago, of as many places and modes as there were then; wanted:
    what it comes to; locked: the part at which a mode is locked in, and no more can drive it;
    shedding_hz: of the places, (places,).
    """
    share = 1.0 - np.exp(-since_s * shedding_hz / PERIODS)
    places, modes = wanted.shape
    known = min(modes, before.shape[1])
    was = np.zeros_like(wanted)
    was[:, :known] = _at_shares(before[:, :known], places)
    return np.asarray(np.minimum(was + share[:, None] * (wanted - was), locked))


def _at_shares(table: Floats, places: int) -> Floats:
    """Rows at equal shares of the rope, linear between those given at equal shares."""
    if len(table) == places:
        return table
    at = np.linspace(0.0, len(table) - 1.0, places)
    low = np.minimum(at.astype(int), len(table) - 2)
    part = (at - low)[:, None]
    return np.asarray((1.0 - part) * table[low] + part * table[low + 1])
