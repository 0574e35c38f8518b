"""Line model of a rope for VIV: a tensioned beam or string with cross-flow motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
EVEN = 32  # the number of elements is a multiple, independent of the input mesh
MORE, FEWER = 1.25, 0.5  # ratio of required to existing elements beyond which the mesh is changed


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
