"""Gradual transition of a place from exciting one mode to another, over some shedding periods.

The papers assign places to modes once, in a constant current. Along a moving rope the assignment is
recomputed again and again, and an instantaneous change of a place's mode would be unphysical: the
vortices shed before are still present. The assignment therefore changes as 1 - e^(-t·f/PERIODS), f
the shedding frequency of the place. The number of periods is our choice; in a constant current
nothing depends on it. Without the transition there is a feedback: drag is amplified where modes
take over, which moves the rope at some per cent of the water's speed, and which mode leads depends
on that speed; two twins on different meshes then soon diverge.
"""

from __future__ import annotations

import numpy as np

from rope_twin.viv.span import Floats

PERIODS = 8.0


def handed_over(
    before: Floats, wanted: Floats, locked: Floats, shedding_hz: Floats, since_s: float
) -> Floats:
    """Return the fraction of each place that excites each mode now, (places, modes).

    before: the same `since_s` ago, for the places and modes of that time; wanted: the final value;
    locked: the fraction at which a mode is locked in, an upper bound; shedding_hz: of the places,
    (places,).
    """
    share = 1.0 - np.exp(-since_s * shedding_hz / PERIODS)
    places, modes = wanted.shape
    known = min(modes, before.shape[1])
    was = np.zeros_like(wanted)
    was[:, :known] = _at_shares(before[:, :known], places)
    return np.asarray(np.minimum(was + share[:, None] * (wanted - was), locked))


def _at_shares(table: Floats, places: int) -> Floats:
    """Return rows at equal fractions of the rope, linear between those given at equal fractions."""
    if len(table) == places:
        return table
    at = np.linspace(0.0, len(table) - 1.0, places)
    low = np.minimum(at.astype(int), len(table) - 2)
    part = (at - low)[:, None]
    return np.asarray((1.0 - part) * table[low] + part * table[low + 1])
