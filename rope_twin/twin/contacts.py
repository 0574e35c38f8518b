"""Contact with the hull and between ropes, as a snapshot shows it."""

from __future__ import annotations

import math

import numpy as np

from rope_twin.core.joined.contact import touch_of
from rope_twin.core.joined.joints import System
from rope_twin.core.state import ELEMENTS, POSITION, VELOCITY, Rope
from rope_twin.effects.hull_contact import HullContact, contact_forces
from rope_twin.twin.snapshot import PressedPlace

NOWHERE = (math.nan, math.nan, math.nan)


def hull_contacts(rope: Rope) -> tuple[PressedPlace, ...]:
    """Return the present contact with the hull; none if the scene does not list the effect.

    The position is the middle of the element that is pressed most.
    """
    hull = next((own for own in rope.effects if isinstance(own, HullContact)), None)
    if hull is None:
        return ()
    state, upto = rope.state, int(rope.state.counts[ELEMENTS]) + 1
    x, v = (state.nodes[first : first + 3, :upto] for first in (POSITION, VELOCITY))
    normal = contact_forces(hull, x, v, state.s[:upto])[3]
    e = int(np.argmax(normal))
    if not normal[e] > 0.0:
        return (PressedPlace("hull", 0.0, NOWHERE),)
    a, b, c = (0.5 * (x[:, e] + x[:, e + 1])).tolist()
    return (PressedPlace("hull", float(normal.sum()), (a, b, c)),)


def rope_contacts(system: System) -> tuple[PressedPlace, ...]:
    """Return the present contact between ropes; none if the scene does not list the effect."""
    touch = touch_of(system.stack)
    if touch is None:
        return ()
    return (PressedPlace("ropes", touch.push, touch.at if touch.contacts else NOWHERE),)
