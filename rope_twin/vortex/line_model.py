"""Rope of a run as the VIV models see it: samples of flow and shape, and a line model.

**Samples**: relative flow, tangents, curvature, and the sampling interval. The interval resolves
the fastest vortices, and is at most a real-time cycle.

**Line model**: a tensioned beam or string with cross-flow motion. `line_model` describes the
present rope of a run: taut between its ends, in the relative flow.

**Lines of a multi-line system**: ropes that continue each other count as one. Two ropes are one
line where the lower end of one and the upper end of the other meet at a bare connection: no third
rope, bar, sheave or payload, and no mass. Any other connection is held across the line: that of
several ropes, and that of a hook or payload, whose mass is many times that of half a wave length of
rope at the frequencies of vortices. A payload at the lower end of one rope alone moves as below a
single rope. With bending stiffness a connection is a hinge, and each rope is a line.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.joined.joints import FIRST, LOOSE, SECOND, System
from rope_twin.core.joined.stack import POINT
from rope_twin.core.state import ELEMENTS, FLOW, POSITION, VELOCITY, Boundary, Floats, Rope, State
from rope_twin.effects.bending import Bending
from rope_twin.effects.payload import Payload, TwoWayPayload
from rope_twin.effects.rope_in_air import Wetting
from rope_twin.effects.rope_mass import AddedMass, AxialAddedMass

SAMPLES_PER_PERIOD = 24  # samples per period of the fastest vortices: resolves a crest to 0.9 %
AVERAGING_PERIODS = 10.0  # of the means, in periods of the fastest vortices
# ratios to the design frequency at which the interval changes
SHORTEN_ABOVE, LENGTHEN_BELOW = 1.25, 0.5
_PLACE, _SPEED, _FLOW = (
    slice(first, first + 3) for first in (rows.POSITION, rows.VELOCITY, rows.FLOW)
)


def along(rope: Rope) -> Floats:
    """Return the nodes' coordinates along the stretched rope, from the hang-off, negative [m]."""
    position = np.empty(int(rope.state.counts[ELEMENTS]) + 1)
    _along(rope.state.nodes, position)
    return position


def mix_flow(flow: Floats, rope: Rope, weight: float) -> None:
    """Update the running mean `flow` of relative water velocity [m/s], (3, points), by a weight.

    flow: at equal fractions of the elements from the lower end up; the hang-off has the value of
    the node below.
    """
    _mix(flow, rope.state.nodes, rope.work, int(rope.state.counts[ELEMENTS]), weight)


def mean_around(points: Floats, s: Floats, values: Floats, half_width: Floats) -> Floats:
    """Return weighted means of `values`, linear between `s`, around each of `points`.

    `points` and `s` are ascending. The weight falls linearly to 0 at the neighbouring points, so
    that a sum over coarse nodes contains oscillations between them. `half_width`, (len(points),):
    minimum half width of the window, so that oscillations of about that period give the same mean
    on any mesh. Values are mirrored at both ends of `s`.
    """
    means, integral, double = np.empty(len(points)), np.empty(len(s)), np.empty(len(s))
    _mean(points, s, values, half_width, integral, double, means)
    return means


@jit_entry
def _along(nodes: Any, position: Any) -> None:
    n = position.shape[0] - 1
    position[n] = 0.0
    for i in range(n - 1, -1, -1):
        square = 0.0
        for k in range(POSITION, POSITION + 3):
            step = nodes[k, i + 1] - nodes[k, i]
            square += step * step
        position[i] = position[i + 1] - sqrt(square)


@jit_entry
def _mix(flow: Any, nodes: Any, work: Any, n: int, weight: float) -> None:
    points = flow.shape[1]
    for j in range(points):
        at_element = j * n / (points - 1.0)
        i = min(int(at_element), n - 1)
        fraction, above = at_element - i, min(i + 1, n - 1)
        for k in range(3):
            lower = work[FLOW + k, i] - nodes[VELOCITY + k, i]
            upper = work[FLOW + k, above] - nodes[VELOCITY + k, above]
            flow[k, j] += weight * (lower + fraction * (upper - lower) - flow[k, j])


@jit_entry
def _mean(
    points: Any, s: Any, values: Any, half_width: Any, integral: Any, double: Any, means: Any
) -> None:
    integral[0] = double[0] = 0.0  # integrals of the values from s[0], and double integrals
    for i in range(1, s.shape[0]):
        step = s[i] - s[i - 1]
        integral[i] = integral[i - 1] + 0.5 * (values[i] + values[i - 1]) * step
        double[i] = double[i - 1] + integral[i - 1] * step
        double[i] += (2.0 * values[i - 1] + values[i]) * step * step / 6.0
    last, length, low, high = points.shape[0] - 1, s[-1] - s[0], 0, 0
    for node in range(last + 1):
        middle = min(max(points[node], s[0]), s[-1])
        down = points[node] - points[node - 1] if node > 0 else points[1] - points[0]
        up = points[node + 1] - points[node] if node < last else points[last] - points[last - 1]
        down = min(max(down, half_width[node]), length)
        up = min(max(up, half_width[node]), length)
        low, high = _below(s, middle - down, low), _below(s, middle + up, high)
        centre = _twice(s, values, integral, double, middle, _below(s, middle, low))
        above = _mirrored(s, values, integral, double, middle + up, high) - centre
        below = centre - _mirrored(s, values, integral, double, middle - down, low)
        means[node] = (above / up - below / down) / (0.5 * (up + down))


@jit
def _below(s: Any, position: float, guess: int) -> int:
    """Return the index of the last of `s` not above `position`, from a guess; 0 without one."""
    i, last = guess, s.shape[0] - 1
    while i < last and s[i + 1] <= position:
        i += 1
    while i > 0 and s[i] > position:
        i -= 1
    return i


@jit
def _twice(s: Any, values: Any, once: Any, twice: Any, position: float, i: int) -> float:
    """Return the double integral of the values from s[0] to `position`; i: last `s` below it."""
    i = min(i, s.shape[0] - 2)
    step = position - s[i]
    slope = (values[i + 1] - values[i]) / (s[i + 1] - s[i])
    inner = 0.5 * values[i] + slope * step / 6.0
    return float(twice[i] + step * (once[i] + step * inner))


@jit
def _mirrored(s: Any, values: Any, once: Any, twice: Any, position: float, guess: int) -> float:
    """Return the double integral, extended beyond the ends of `s` by mirroring."""
    if position < s[0]:
        inside = 2.0 * s[0] - position
        return float(_twice(s, values, once, twice, inside, _below(s, inside, guess)))
    if position > s[-1]:
        inside = 2.0 * s[-1] - position
        value = _twice(s, values, once, twice, inside, _below(s, inside, guess))
        return float(value + 2.0 * once[-1] * (position - s[-1]))
    return float(_twice(s, values, once, twice, position, guess))


def shedding_hz(rope: Rope, boundary: Boundary, strouhal: float) -> float:
    """Return the frequency St·U/d of the fastest vortices [Hz].

    U is the flow across the rope, relative to the hang-off's velocity.
    """
    n = int(rope.state.counts[rows.ELEMENTS])
    flow = rope.work[_FLOW, :n] - boundary.rate[0, :3, None]
    flow[2] = 0.0  # heave and waves' vertical motion run along the rope
    speed = _speed_across(flow, tangents(rope.state.nodes[_PLACE, : n + 1])[:, :n])
    return float((strouhal * speed / diameters(rope)[:n]).max())


def _speed_across(velocity: Floats, tangent: Floats) -> Floats:
    """Return the magnitude of velocities normal to unit vectors along the rope, (3, nodes) each."""
    across = velocity - (velocity * tangent).sum(axis=0) * tangent
    return np.asarray(np.sqrt((across * across).sum(axis=0)))


def sampling_steps(hz: float, step_s: float, cycle: int) -> int:
    """Number of steps between samples for this frequency of the fastest vortices.

    cycle: steps of a real-time cycle, which has a whole number of samples, so that they come at the
    same instants for any step.
    """
    if hz == 0.0:
        return cycle
    most = max(1, min(cycle, int(1.0 / (SAMPLES_PER_PERIOD * hz * step_s) + 1e-9)))
    return next(steps for steps in range(most, 0, -1) if cycle % steps == 0)


def needs_new_interval(hz: float, made_for_hz: float, other_current: bool) -> bool:
    """Return whether the interval must change; only another current makes it longer."""
    slower = other_current and hz < LENGTHEN_BELOW * made_for_hz
    return hz > SHORTEN_ABOVE * made_for_hz or slower


def relative_flow(rope: Rope) -> Floats:
    """Velocity of water relative to rope at the nodes [m/s], (3, nodes).

    The hang-off has the value of the node below it.
    """
    n = int(rope.state.counts[rows.ELEMENTS])
    relative = rope.work[_FLOW, : n + 1] - rope.state.nodes[_SPEED, : n + 1]
    relative[:, n] = relative[:, n - 1]
    return np.asarray(relative)


def tangents(position: Floats) -> Floats:
    """Unit vectors along the rope at its nodes, upward, (3, nodes)."""
    return _directions(np.diff(position, axis=1))


def _directions(step: Floats) -> Floats:
    """Unit vectors along the sums of the adjacent steps at the nodes, (3, nodes)."""
    tangent = np.concatenate([step[:, :1], step[:, 1:] + step[:, :-1], step[:, -1:]], axis=1)
    return np.asarray(tangent / np.sqrt((tangent * tangent).sum(axis=0)))


def diameters(rope: Rope) -> Floats:
    """Hydrodynamic diameter at the nodes [m], (nodes,)."""
    n, sections = int(rope.state.counts[rows.ELEMENTS]), rope.sections
    s = rope.state.s[: n + 1]
    section = np.searchsorted(sections[rows.END], 0.5 * (s[1:] + s[:-1]), side="right")
    diameter = np.sqrt(4.0 * sections[rows.PER_METRE + 1, section] / pi)
    return np.append(diameter, diameter[-1])


def flow_directions(position: Floats, flow: Floats) -> Floats:
    """Unit vectors across rope and flow, and across the rope with the flow, (2, 3, nodes)."""
    tangent = tangents(position)
    across: Any = np.cross(flow, tangent, axis=0)
    norm = np.sqrt((across * across).sum(axis=0))
    east = np.zeros_like(tangent)
    east[0] = 1.0
    across = np.where(norm > 1e-9, across, np.cross(east, tangent, axis=0))
    across = across / np.maximum(np.sqrt((across * across).sum(axis=0)), 1e-12)
    return np.stack([across, np.cross(tangent, across, axis=0)])


def curvature(rope: Rope) -> tuple[Floats, Floats]:
    """Curvature of the rope at its nodes by its bending effect, in components of `turned`.

    Returns material coordinates of the nodes [m], (nodes,), and curvature [1/m], (2, nodes).
    """
    n = int(rope.state.counts[rows.ELEMENTS])
    s = rope.state.s[: n + 1]
    unstretched = np.diff(s)
    q = np.diff(rope.state.nodes[_PLACE, : n + 1], axis=1) / unstretched
    kappa = np.zeros((3, n + 1))
    kappa[:, 1:-1] = np.diff(q, axis=1) / (0.5 * (unstretched[1:] + unstretched[:-1]))
    for effect in rope.effects:
        if isinstance(effect, Bending) and effect.clamp > 0.0:
            clamped = np.array([effect.x, effect.y, effect.z])
            misfit = clamped - q[:, -1]
            kappa[:, -1] = 2.0 / unstretched[-1] * (misfit - (misfit @ clamped) * clamped)
    return s, turned(kappa, _directions(q))


def turned(vectors: Floats, tangent: Floats) -> Floats:
    """Components (2, points) of vectors (3, points) across a rope along unit vectors.

    East and north as carried along by a rope that is tilted from upright without twist: a·b - (a·(e
    + t))·t_b/(1 + t_z), with e upward and t along the rope.
    """
    lean = vectors[2] + (vectors * tangent).sum(axis=0)
    factor = lean / np.maximum(1.0 + tangent[2], 1e-9)
    return np.asarray(vectors[:2] - factor * tangent[:2])


def bending_stiffness(effects: tuple[Any, ...]) -> float:
    """Bending stiffness EI of the rope [N·m²]; 0: none."""
    return float(sum(effect.EI for effect in effects if isinstance(effect, Bending)))


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
    end_mass: float | None = None  # at the free lower end [kg], or None if fixed

    @property
    def node_mass(self) -> Floats:
        """Return the mass lumped at the nodes, including that of the end [kg]."""
        lumps = _lumped(self.mass * np.diff(self.s))
        lumps[0] += self.end_mass or 0.0
        return lumps

    @property
    def node_length(self) -> Floats:
        """Return the length lumped at each node from the adjacent half elements [m]."""
        return _lumped(np.diff(self.s))


def _lumped(elements: Floats) -> Floats:
    """Return values of elements, (n,), as lumps at their nodes, (n + 1,): half at either end."""
    lumps = np.zeros(len(elements) + 1)
    lumps[:-1] += 0.5 * elements
    lumps[1:] += 0.5 * elements
    return lumps


class RecentSpeeds:
    """Largest U/d of a line over the last minute, in a time-varying current."""

    def __init__(self) -> None:
        self._held = np.zeros((2, 0))  # times [s] and U/d [1/s], the latter descending

    def add(self, time_s: float, span: Span) -> None:
        """Add the present flow; times must not decrease."""
        present = _fastest(span)
        times, speeds = self._held
        retained = (times >= time_s - MEMORY_S) & (speeds > present)
        self._held = np.append(self._held[:, retained], [[time_s], [present]], axis=1)

    def fastest(self, span: Span) -> float:
        """Return the largest U/d of a span and of those that were added [1/s]."""
        return max(_fastest(span), float(self._held[1].max(initial=0.0)))

    def kept(self) -> Floats:
        """Return the restart data for `take_back`."""
        return self._held.copy()

    def take_back(self, saved: Floats) -> None:
        """Resume from this state."""
        self._held = saved.copy()


def _fastest(span: Span) -> float:
    return float((span.speed / span.diameter).max())


def refined(span: Span, longest_m: float, multiple: int = 1, kept: int = 0) -> Span:
    """Return the rope in equal elements of at most this length, by linear interpolation.

    multiple: their number is a multiple of it, except for a rope given in more; kept: the previous
    number, 0 for none. The number is kept while it is roughly right: a change shifts all
    frequencies by about 1e-4, and its time would depend on the mesh.
    """
    length = float(span.s[-1] - span.s[0])
    count = max(len(span.s) - 1, multiple * int(np.ceil(length / (longest_m * multiple))))
    if FEWER * kept <= count <= MORE * kept:
        count = kept
    s = np.linspace(span.s[0], span.s[-1], count + 1)
    middle, given_middle = 0.5 * (s[1:] + s[:-1]), 0.5 * (span.s[1:] + span.s[:-1])
    return span._replace(
        s=s,
        tension=extended(middle, given_middle, span.tension),
        mass=np.interp(middle, given_middle, span.mass),
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


def extended(points: Floats, s: Floats, values: Floats) -> Floats:
    """Return linear interpolation, with linear extrapolation beyond the first and last value."""
    if len(s) < 2:
        return np.full(len(points), values[0])
    result = np.interp(points, s, values)
    below, above = points < s[0], points > s[-1]
    result[below] = values[0] + (points[below] - s[0]) * (values[1] - values[0]) / (s[1] - s[0])
    slope = (values[-1] - values[-2]) / (s[-1] - s[-2])
    result[above] = values[-1] + (points[above] - s[-1]) * slope
    return result


def line_model(rope: Rope, moved_water: bool = True) -> Span:
    """Return the line model of the present rope; moved_water: include its added mass."""
    n, sections, work = int(rope.state.counts[rows.ELEMENTS]), rope.sections, rope.work
    position = rope.state.nodes[_PLACE, : n + 1]
    steps = np.diff(position, axis=1)
    length = np.sqrt((steps * steps).sum(axis=0))
    s = rope.state.s[: n + 1]
    section = np.searchsorted(sections[rows.END], 0.5 * (s[1:] + s[:-1]), side="right")
    mass, volume = sections[rows.PER_METRE : rows.PER_METRE + 2, section]
    added = sum(
        effect.density for effect in rope.effects if isinstance(effect, AddedMass | AxialAddedMass)
    )
    moved = (added if moved_water else 0.0) * volume
    if any(isinstance(effect, Wetting) for effect in rope.effects):
        moved = moved * wetted_shares(position[2])
    payload = [effect for effect in rope.effects if isinstance(effect, Payload | TwoWayPayload)]
    diameter = np.sqrt(4.0 * volume / np.pi)
    relative = work[_FLOW, :n] - rope.state.nodes[_SPEED, :n]
    speed = _speed_across(relative, tangents(position)[:, :n])
    along = np.concatenate([[0.0], np.cumsum(length)])
    # the flow at the hang-off is unknown: extrapolated linearly from the two nodes below it
    at_top = extended(along[n:], along[:n], speed)
    return Span(
        s=along,
        tension=work[rows.TENSION, :n].copy(),
        mass=(mass + moved) * np.diff(s) / length,
        diameter=np.append(diameter, diameter[-1]),
        speed=np.append(speed, np.maximum(at_top, 0.0)),
        stiffness=sum(effect.EI for effect in rope.effects if isinstance(effect, Bending)),
        end_mass=sum(effect.Mx for effect in payload) if rope.model.first_free == 0 else None,
    )


def wetted_shares(z: Floats) -> Floats:
    """Return the share of each element below the mean water level; z: of the nodes [m]."""
    low, high = np.minimum(z[1:], z[:-1]), np.maximum(z[1:], z[:-1])
    return np.asarray(np.clip(-low / np.maximum(high - low, 1e-12), 0.0, 1.0))


def lines_of(system: System, count: int | None = None) -> list[tuple[int, ...]]:
    """Return the numbers of the ropes of each line, from its lower end up.

    count: only the first so many ropes; None: all. Lines are in the order of their
    uppermost ropes.
    """
    joints = system.joints
    ropes = range(len(joints.lower) if count is None else count)
    below: dict[int, int] = {}  # by rope, the one that continues it at its lower end
    for j in _bare(system):
        upper = [r for r in ropes if joints.lower[r] == j]
        lower = [r for r in ropes if joints.upper[r] == j]
        if len(upper) == len(lower) == 1 and not _loaded(system.ropes[upper[0]]):
            below[upper[0]] = lower[0]
    lines = []
    for top in ropes:
        if top in below.values():
            continue
        line = [top]
        while line[-1] in below:
            line.append(below[line[-1]])
        lines.append(tuple(reversed(line)))
    return lines


def _bare(system: System) -> list[int]:
    """Return the connections of two rope ends, without bar, sheave or hinge."""
    joints, sheaves = system.joints, system.sheaves
    if bending_stiffness(system.ropes[0].effects) > 0.0:
        return []
    held = {*joints.ties[FIRST].astype(int), *joints.ties[SECOND].astype(int)}
    if sheaves is not None:
        held |= {*sheaves.figures[POINT].astype(int)}
    ends = [*joints.lower, *joints.upper]
    return [j for j in set(ends) - held - {LOOSE} if ends.count(j) == 2]


def _loaded(rope: Rope) -> bool:
    """Return whether a payload or connection at the rope's lower end has mass."""
    loads = [effect for effect in rope.effects if isinstance(effect, Payload | TwoWayPayload)]
    return any(load.Mx > 0.0 for load in loads)


def one_rope(ropes: Sequence[Rope]) -> Rope:
    """Return the ropes of a line, given from its lower end up, as one rope.

    The arrays are copies, but for those of a single rope; effects are those of the lowest.
    """
    if len(ropes) == 1:
        return ropes[0]
    last, lowest = len(ropes) - 1, ropes[0]
    nodes, works, s, offset, sections = [], [], [], [], []
    below_m = 0.0
    for k, rope in enumerate(ropes):
        n = int(rope.state.counts[rows.ELEMENTS])
        own = slice(n + 1 if k == last else n)  # a connection is the first node of the upper rope
        nodes.append(rope.state.nodes[:, own])
        works.append(rope.work[:, own])
        s.append(below_m + rope.state.s[own])
        offset.append(rope.state.offset[own])
        length_m = float(rope.state.s[n])
        sections.append(_sections(rope, below_m, np.inf if k == last else length_m))
        below_m += length_m
    counts = lowest.state.counts.copy()
    counts[rows.ELEMENTS] = sum(int(rope.state.counts[rows.ELEMENTS]) for rope in ropes)
    node_rows, work, made = (np.concatenate(part, axis=1) for part in (nodes, works, sections))
    health = lowest.state.health
    state = State(node_rows, np.concatenate(s), np.concatenate(offset), counts, health)
    return lowest._replace(state=state, work=work, sections=made)


def _sections(rope: Rope, below_m: float, length_m: float) -> Floats:
    """Return the sections of a rope that begins at a coordinate, up to its length [m]."""
    ends = rope.sections[rows.END]
    begins = np.concatenate([[0.0], ends[:-1]])
    own: Floats = rope.sections[:, begins < length_m].copy()
    own[rows.END] = below_m + np.minimum(own[rows.END], length_m)
    return own
