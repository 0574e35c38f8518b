"""Line model of a rope for VIV: a tensioned beam or string with cross-flow motion.

`line_model` describes the present rope of a run: taut between its ends, in the relative flow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.effects.added_mass import AddedMass, AxialAddedMass
from rope_twin.effects.bending import Bending
from rope_twin.effects.payload import Payload, TwoWayPayload
from rope_twin.vortex.sampling import tangents

EVEN = 32  # the number of elements is a multiple, independent of the input mesh
MORE, FEWER = 1.25, 0.5  # ratio of required to existing elements beyond which the mesh is changed
MEMORY_S = 60.0  # for which the modes of a faster current are kept: longer than a long wave


class Span(NamedTuple):
    """Rows from the lower end up; n elements, n + 1 nodes, the last one fixed at the ship."""

    s: Floats  # along the rope from the lower end [m], ascending, (n + 1,)
    tension: Floats  # of the elements [N], (n,)
    mass: Floats  # of the elements per metre, added mass included [kg/m], (n,)
    diameter: Floats  # hydrodynamic, at the nodes [m], (n + 1,)
    speed: Floats  # normal water speed at the nodes [m/s], (n + 1,)
    stiffness: float = 0.0  # bending stiffness EI [N·m²], ends hinged
    end_mass: float | None = None  # at the free lower end [kg]; None: it is fixed

    @property
    def node_mass(self) -> Floats:
        """Return the mass lumped at the nodes, including that of the end [kg]."""
        half = 0.5 * self.mass * np.diff(self.s)
        lumps = np.zeros(len(self.s))
        lumps[:-1] += half
        lumps[1:] += half
        lumps[0] += self.end_mass or 0.0
        return lumps

    @property
    def node_length(self) -> Floats:
        """Return the length lumped at each node from the adjacent half elements [m]."""
        half = 0.5 * np.diff(self.s)
        lengths = np.zeros(len(self.s))
        lengths[:-1] += half
        lengths[1:] += half
        return lengths


class RecentSpeeds:
    """Largest U/d of a line over the last minute, in a current that changes in time."""

    def __init__(self) -> None:
        self._held = np.zeros((2, 0))  # times [s] and U/d [1/s], the latter descending

    def add(self, time_s: float, span: Span) -> None:
        """Take the present flow in, at a time that never goes back."""
        own = _fastest(span)
        times, speeds = self._held
        lasting = (times >= time_s - MEMORY_S) & (speeds > own)
        self._held = np.append(self._held[:, lasting], [[time_s], [own]], axis=1)

    def fastest(self, span: Span) -> float:
        """Return the largest U/d of a span and of those that were added [1/s]."""
        return max(_fastest(span), float(self._held[1].max(initial=0.0)))

    def kept(self) -> Floats:
        """Return the restart data for `take_back`."""
        return self._held.copy()

    def take_back(self, kept: Floats) -> None:
        """Resume from this state."""
        self._held = kept.copy()


def _fastest(span: Span) -> float:
    return float((span.speed / span.diameter).max())


def refined(span: Span, longest_m: float, multiple: int = 1, kept: int = 0) -> Span:
    """Return the rope in equal elements of at most this length, by linear interpolation.

    multiple: their number is a multiple of it, except for a rope given in more; kept: the previous
    number, 0 for none. The number is kept while it is roughly right: a change shifts all
    frequencies by about 1e-4, and would happen at another time on every mesh.
    """
    length = float(span.s[-1] - span.s[0])
    count = max(len(span.s) - 1, multiple * int(np.ceil(length / (longest_m * multiple))))
    if FEWER * kept <= count <= MORE * kept:
        count = kept
    s = np.linspace(span.s[0], span.s[-1], count + 1)
    middle, own = 0.5 * (s[1:] + s[:-1]), 0.5 * (span.s[1:] + span.s[:-1])
    return span._replace(
        s=s,
        tension=extended(middle, own, span.tension),
        mass=np.interp(middle, own, span.mass),
        diameter=np.interp(s, span.s, span.diameter),
        speed=np.interp(s, span.s, span.speed),
    )


def half_waves(span: Span, per_diameter: float, moved: Floats | float = 0.0) -> Floats:
    """Return half a wave length at f = per_diameter·U/d, at the nodes [m]; at most the whole rope.

    moved: mass per metre beyond the span's own, at the elements [kg/m].
    """
    speed = np.sqrt(span.tension / (span.mass + moved))
    speed = 0.5 * (np.append(speed[:1], speed) + np.append(speed, speed[-1:]))
    length = float(span.s[-1] - span.s[0])
    frequency = per_diameter * span.speed / span.diameter
    return np.asarray(0.5 * speed / np.maximum(frequency, 0.5 * speed / length))


def extended(at: Floats, s: Floats, values: Floats) -> Floats:
    """Return linear interpolation, with linear extrapolation beyond the first and last value."""
    if len(s) < 2:
        return np.full(len(at), values[0])
    found = np.interp(at, s, values)
    low, high = at < s[0], at > s[-1]
    found[low] = values[0] + (at[low] - s[0]) * (values[1] - values[0]) / (s[1] - s[0])
    last = (values[-1] - values[-2]) / (s[-1] - s[-2])
    found[high] = values[-1] + (at[high] - s[-1]) * last
    return found


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
    added = sum(own.density for own in rope.effects if isinstance(own, AddedMass | AxialAddedMass))
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
