"""Line model of a twin's rope for VIV models: taut between its ends, in the relative flow."""

from __future__ import annotations

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Rope
from rope_twin.effects.added_mass import AddedMass
from rope_twin.effects.bending import Bending
from rope_twin.effects.payload import Payload, TwoWayPayload
from rope_twin.twin.vibration.measured import tangents
from rope_twin.viv.span import Span, extended


def line_model(rope: Rope, moved_water: bool = True) -> Span:
    """Return the line model of the present rope; moved_water: include its added mass."""
    n, sections, work = int(rope.state.counts[rows.ELEMENTS]), rope.sections, rope.work
    place = rope.state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1]
    velocity = rope.state.nodes[rows.VELOCITY : rows.VELOCITY + 3, :n]
    steps = np.diff(place, axis=1)
    length = np.sqrt((steps * steps).sum(axis=0))
    s = rope.state.s[: n + 1]
    which = np.searchsorted(sections[rows.END], 0.5 * (s[1:] + s[:-1]), side="right")
    mass, volume = sections[rows.PER_METRE : rows.PER_METRE + 2, which]
    added = sum(own.density for own in rope.effects if isinstance(own, AddedMass))
    added = added if moved_water else 0.0
    payload = [own for own in rope.effects if isinstance(own, Payload | TwoWayPayload)]
    diameter = np.sqrt(4.0 * volume / np.pi)
    direction = tangents(place)[:, :n]
    relative = work[rows.FLOW : rows.FLOW + 3, :n] - velocity
    across = relative - (relative * direction).sum(axis=0) * direction
    speed = np.sqrt((across * across).sum(axis=0))
    along = np.concatenate([[0.0], np.cumsum(length)])
    # the flow at the hang-off is unknown: extrapolated linearly from the two nodes below it
    at_top = extended(along[n:], along[:n], speed)
    return Span(
        s=along,
        tension=work[rows.TENSION, :n].copy(),
        mass=(mass + added * volume) * np.diff(s) / length,
        diameter=np.append(diameter, diameter[-1]),
        speed=np.append(speed, np.maximum(at_top, 0.0)),
        stiffness=sum(own.EI for own in rope.effects if isinstance(own, Bending)),
        end_mass=sum(own.Mx for own in payload) if rope.model.first_free == 0 else None,
    )
