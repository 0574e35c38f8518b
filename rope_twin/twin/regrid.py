"""Transfer of the state of ropes to other elements: half or twice as many, or those of a part.

Coarser: every other node is dropped; the others keep position and material coordinate. Mass,
momentum and inertia force of a dropped node go to its neighbours by the lever rule, and a new
element has the mean force of the two that it replaces: the balance of the remaining nodes is the
sum of the previous ones, no momentum is lost, and kinetic energy can only fall (the square of a
weighted mean is at most the mean of the squares). Finer: a node returns at its old material
coordinate, or elements are divided evenly, with interpolated velocity; tension then changes along
the old element according to the loads at its ends.

Where a bent pair becomes a chord, or a chord a bent pair, the length differs. As at the sheave
(`core.payout`), a length offset gives an element its required tension, and decays. Tensions are
evaluated here in numpy by the formulas of `core.elastic.stretch`.

Internal variables of effects (core/loads/memory) are interpolated over the rope's material; those
of a rigid body stay as they are. In a multi-line system the connections keep their motion.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.axial_law import (
    FibreLaw,
    elastic_state,
    instantaneous_strain,
    instantaneous_tension,
    sections_law,
)
from rope_twin.core.body.state import FIXED, RigidBody
from rope_twin.core.joined.joints import System, loaded_ends, new_system, with_flows
from rope_twin.core.joined.stack import FLOW_COLUMN
from rope_twin.core.loads.accounts import law_of_lowest
from rope_twin.core.loads.hooks import work_rows
from rope_twin.core.loads.memory import variable_count
from rope_twin.core.payout import TRIALS
from rope_twin.core.state import (
    SAME_PLACE,
    Floats,
    Ints,
    Model,
    Rope,
    State,
    Table,
    columns_for,
    new_state,
    new_work,
)
from rope_twin.effects.payload import Payload, TwoWayPayload

SPARE_NODES = 12  # of a coarser rope beyond half the capacity: splits, trial nodes, an odd one
MIN_SPARE_NODES = TRIALS + 1  # beyond the nodes of a finer rope, so that it can still split
MIN_PART_FRACTION = 0.25  # of an even part: an old node nearer to another one is not restored
MAX_LENGTH_RATIO = 1.5  # to the element length made at the sheave: a longer part is divided evenly
SAG_LIMIT = 0.05  # of a part's length; as in payout, a node further off stays on the chord
_X, _V, _A = (slice(k, k + 3) for k in (rows.POSITION, rows.VELOCITY, rows.ACCELERATION))
BISECTIONS = 60


@dataclass(frozen=True)
class UpperEnd:
    """Boundary condition of the new elements at the upper end: a hang-off or a connection."""

    pull_n: Floats  # force of the rope on it, (3,) x, y, z
    payout_m_per_s: float
    loaded: bool  # whether its node carries loads; a connection does, no hang-off


@dataclass(frozen=True)
class Grid:
    """Mesh of a rope, as needed to return to it."""

    model: Model
    capacity: int  # capacity of the arrays in nodes
    marks_m: Floats  # material coordinates of the nodes below the hang-off


def upper_ends(ropes: Rope | System, pull: Floats, payout_m_per_s: Floats) -> list[UpperEnd]:
    """Return the upper end of each rope.

    pull: force of each rope on it [N], (ropes, PULL_COLUMNS); payout: of the ropes that hang from
    the ship, (ropes,).
    """
    speeds = [float(payout_m_per_s[0])]
    loaded = loaded_ends(ropes) if isinstance(ropes, System) else (False,)
    if isinstance(ropes, System):
        speeds = np.where(loaded, _passing_m_per_s(ropes), payout_m_per_s).tolist()
    forces = pull[:, rows.PULL_X : rows.PULL_Z + 1].copy()
    return [UpperEnd(*fields) for fields in zip(forces, speeds, loaded, strict=True)]


def _passing_m_per_s(system: System) -> Floats:
    """Return the rate at which each rope grows at a sheave [m/s], (ropes,); 0 without one."""
    speeds, sheaves = np.zeros(len(system.ropes)), system.sheaves
    if sheaves is not None:
        for r, (of, side) in enumerate(zip(sheaves.of, sheaves.side, strict=True)):
            if of >= 0:
                flow = int(sheaves.figures[FLOW_COLUMN, of])
                speeds[r] = float(side) * float(system.joints.nodes[rows.VELOCITY, flow])
    return speeds


def joined_as(system: System, ropes: Sequence[Rope]) -> System:
    """Return a system of these ropes with copies of the connections and sheaves of `system`."""
    joints, sheaves = system.joints, system.sheaves
    joined = new_system(tuple(ropes), list(joints.lower), list(joints.upper), joints.ties.copy())
    if sheaves is not None:
        flows = with_flows(joined.joints, sheaves.figures.shape[1])
        joined = joined._replace(joints=flows, sheaves=copy.deepcopy(sheaves))
    joined.joints.nodes[:] = joints.nodes
    for new, old in zip(joined.ropes, ropes, strict=True):
        n = int(old.state.counts[rows.ELEMENTS])
        new.work[rows.TENSION, :n] = old.work[rows.TENSION, :n]
    return joined


def element_tension(rope: Rope) -> Floats:
    """Tension of the elements from the lower end up [N], (elements,), a view of the scratch."""
    tension: Floats = rope.work[rows.TENSION, : rope.state.counts[rows.ELEMENTS]]
    return tension


def is_slack(ropes: Iterable[Rope]) -> bool:
    """Return whether any of these ropes has an element without tension."""
    return any(bool(element_tension(rope).min() <= 0.0) for rope in ropes)


def marks_of(rope: Rope) -> Floats:
    """Material coordinates of the nodes below the hang-off [m], (nodes - 1,)."""
    return rope.state.s[: int(rope.state.counts[rows.ELEMENTS])].copy()


def coarse_capacity(capacity: int, sections: Floats) -> int:
    """Return the capacity in nodes of the arrays of a coarser rope."""
    return capacity // 2 + int(sections.shape[1]) + SPARE_NODES


def coarse_model(model: Model, ratio: float) -> Model:
    """Return the model of a mesh whose elements are longer by this ratio."""
    return model._replace(
        element_length=ratio * model.element_length,
        split_above=ratio * model.split_above,
        merge_below=ratio * model.merge_below,
    )


def coarser(rope: Rope, end: UpperEnd) -> Rope:
    """Return the rope on every second node; the force on the hang-off is unchanged."""
    keep, n = _kept_nodes(rope), int(rope.state.counts[rows.ELEMENTS])
    old = elements_of(rope.state, rope.sections, end.payout_m_per_s)
    model = coarse_model(rope.model, 2.0)
    capacity = coarse_capacity(rope.state.s.shape[0], rope.sections)
    state = _state_on_nodes(rope, capacity, rope.state.s[keep])
    state.nodes[:, : len(keep)] = rope.state.nodes[:, keep]
    weights = _lever_weights(keep, old.rest)
    mass = _node_masses(rope, old)
    lowest = rope.model.first_free
    for vector in (_V, _A):
        mean = _distributed(weights, mass * rope.state.nodes[vector, : n + 1]) / _distributed(
            weights, mass
        )
        state.nodes[vector, lowest : len(keep) - 1] = mean[:, lowest:-1]
    mean_force = _mean_tensions(rope, keep, old)
    new = elements_of(state, rope.sections, end.payout_m_per_s)
    wanted_n = np.where(np.isnan(mean_force[0]), np.nan, (mean_force * new.direction).sum(axis=0))
    load = _load_at_top(rope, old, end)
    direction = new.direction[:, -1]
    if wanted_n[-1] > 0.0:
        wanted_n[-1] = max(float((0.5 * new.rest[-1] * load - end.pull_n) @ direction), 0.0)
    return _filled(rope._replace(model=model), state, new, wanted_n, end)


def finer(rope: Rope, grid: Grid, end: UpperEnd) -> Rope:
    """Return the rope on a finer mesh: old nodes if paid out, even division of new rope.

    Tension and motion between the nodes follow from the balance at the old ones.
    """
    n = int(rope.state.counts[rows.ELEMENTS])
    old = elements_of(rope.state, rope.sections, end.payout_m_per_s)
    parent, fraction = _divided_elements(rope, old, grid)
    start = np.concatenate([[0.0], np.cumsum(fraction)[:-1]])
    first = np.searchsorted(parent, np.arange(n))
    lower_fraction = start - start[first][parent]  # start of a part in its old element, 0 to 1
    s = rope.state.s
    coordinates = np.append(s[:n][parent] + lower_fraction * old.rest[parent], s[n])
    capacity = max(grid.capacity, len(coordinates) + MIN_SPARE_NODES)
    state = _state_on_nodes(rope, capacity, coordinates)
    material = material_nodes(rope.state, old, end.payout_m_per_s)
    at_low, at_high = material[:, :-1][:, parent], material[:, 1:][:, parent]
    state.nodes[:, : len(parent)] = (1.0 - lower_fraction) * at_low + lower_fraction * at_high
    state.nodes[:, len(parent)] = rope.state.nodes[:, n]
    force = _forces_of_parts(rope, old, end, (parent, lower_fraction + 0.5 * fraction))
    taut = rope.work[rows.TENSION, :n][parent] > 0.0
    _move_off_chords(state, old, (parent, fraction), np.where(taut, force, 0.0))
    new = elements_of(state, rope.sections, end.payout_m_per_s)
    wanted_n = np.where(taut, np.maximum((force * new.direction).sum(axis=0), 0.0), np.nan)
    return _filled(rope._replace(model=grid.model), state, new, wanted_n, end)


def _kept_nodes(rope: Rope) -> Ints:
    """Return every second node from the hang-off down, the lower end, and the ends of sections."""
    n = int(rope.state.counts[rows.ELEMENTS])
    ends = rope.sections[rows.END]
    distance = np.abs(rope.state.s[: n + 1, None] - ends[None, np.isfinite(ends)])
    fixed = sorted({0, n, *np.flatnonzero((distance <= SAME_PLACE).any(axis=1)).tolist()})
    kept = [0]
    for low, high in pairwise(fixed):
        kept += reversed(range(high, low, -2))
    return np.array(kept)


def _state_on_nodes(rope: Rope, capacity: int, coordinates: Floats) -> State:
    """Return a state with nodes at these material coordinates and the previous solver counts."""
    state = new_state(capacity)
    state.counts[rows.ELEMENTS] = len(coordinates) - 1
    state.s[: len(coordinates)] = coordinates
    state.health[:] = rope.state.health
    return state


def _filled(rope: Rope, state: State, new: Elements, wanted_n: Floats, end: UpperEnd) -> Rope:
    """Return the rope with this state and these element tensions (NaN: no offset)."""
    count = len(wanted_n)
    state.offset[:count] = offsets_for(rope, new, wanted_n)
    capacity = state.s.shape[0]
    work = new_work(columns_for(capacity), work_rows(rope.effects))
    work[rows.TENSION, :count] = tensions(rope, new, state.offset[:count])
    effects = on_nodes(rope.effects, state.s[: count + end.loaded], capacity)
    return rope._replace(state=state, work=work, effects=effects)


def _lever_weights(keep: Ints, rest: Floats) -> tuple[Ints, Ints, Floats]:
    """Return for each old node the new node at or below it, the one above, and its weight."""
    n = len(rest)
    low = np.searchsorted(keep, np.arange(n + 1), side="right") - 1
    high = np.minimum(low + 1, len(keep) - 1)
    s = np.concatenate([[0.0], np.cumsum(rest)])
    span = s[keep[high]] - s[keep[low]]
    weight = np.where(span > 0.0, (s - s[keep[low]]) / np.where(span > 0.0, span, 1.0), 0.0)
    return low, high, weight


def _distributed(weights: tuple[Ints, Ints, Floats], values: Floats) -> Floats:
    """Sums (3, new nodes) of values (3, old nodes) by the lever rule."""
    low, high, weight = weights
    total = np.zeros((3, int(high.max()) + 1))
    for k in range(3):
        np.add.at(total[k], low, (1.0 - weight) * values[k])
        np.add.at(total[k], high, weight * values[k])
    return total


def _node_masses(rope: Rope, old: Elements) -> Floats:
    """Mass of the rope at each node, with that of a payload or hook at node 0 [kg], (3, nodes)."""
    half = 0.5 * old.rest * rope.sections[rows.PER_METRE][old.section]
    mass = np.zeros((3, len(half) + 1))
    mass[:, :-1] += half
    mass[:, 1:] += half
    for effect in rope.effects:
        if isinstance(effect, Payload | TwoWayPayload):
            mass[:, 0] += effect.Mx, effect.My, effect.Mz
        if isinstance(effect, RigidBody):
            mass[:, 0] += effect.hook
    return mass


def _mean_tensions(rope: Rope, keep: Ints, old: Elements) -> Floats:
    """Mean force in the old elements of each new one [N], (3, new elements); NaN if slack."""
    tension = rope.work[rows.TENSION, : len(old.rest)]
    force = np.where(tension > 0.0, tension, np.nan) * old.direction
    mean: Floats = np.add.reduceat(force * old.rest, keep[:-1], axis=1)
    return mean / np.add.reduceat(old.rest, keep[:-1])


def _load_at_top(rope: Rope, old: Elements, end: UpperEnd) -> Floats:
    """Load less inertia per metre of rope at the hang-off [N/m], (3,).

    It follows from the force on the hang-off less the tension of the top element.
    """
    tension = rope.work[rows.TENSION, len(old.rest) - 1]
    load: Floats = (end.pull_n + tension * old.direction[:, -1]) / (0.5 * old.rest[-1])
    return load


def _divided_elements(rope: Rope, old: Elements, grid: Grid) -> tuple[Ints, Floats]:
    """Return the parts of the old elements: element and fraction of its unstretched length."""
    parents: list[int] = []
    fractions: list[float] = []
    s, element_length = rope.state.s, grid.model.element_length
    first_marks = np.searchsorted(grid.marks_m, s[: len(old.rest) + 1], side="right")
    has_unit = law_of_lowest(rope.effects) is not None  # a compensator: one element on all meshes
    if has_unit:
        parents, fractions = [0], [1.0]
    for e, rest_length in enumerate(old.rest.tolist()[has_unit:], start=int(has_unit)):
        marks = (grid.marks_m[first_marks[e] : first_marks[e + 1]] - s[e]) / rest_length
        cuts = [0.0]
        for cut in marks.tolist():
            min_fraction = MIN_PART_FRACTION / (len(marks) + 1)
            if cut > cuts[-1] + min_fraction and cut < 1.0 - min_fraction:
                cuts.append(cut)
        for low, high in pairwise([*cuts, 1.0]):
            length_m = (high - low) * rest_length
            count = (
                round(length_m / element_length)
                if length_m > MAX_LENGTH_RATIO * element_length
                else 1
            )
            parents += [e] * count
            fractions += [(high - low) / count] * count
    return np.array(parents), np.array(fractions)


def material_nodes(state: State, old: Elements, payout_m_per_s: float) -> Floats:
    """Return position, velocity and acceleration of the material at nodes, (NODE_ROWS, nodes).

    The rope passes the hang-off: its velocity is v - V·q and its acceleration a - 2·V·dq/dt, with q
    the element's vector over its unstretched length. (The term of dV/dt is left to the next step.)
    """
    n, V = len(old.rest), payout_m_per_s
    nodes: Floats = state.nodes[:, : n + 1].copy()
    q = old.length[-1] / old.rest[-1] * old.direction[:, -1]
    q_rate = (nodes[_V, n] - nodes[_V, n - 1] - V * q) / old.rest[-1]
    nodes[_V, n] -= V * q
    nodes[_A, n] -= 2.0 * V * q_rate
    return nodes


def _forces_of_parts(
    rope: Rope, old: Elements, end: UpperEnd, parts: tuple[Ints, Floats]
) -> Floats:
    """Force in the middle of each part [N], (3, parts); parts: elements, positions 0 to 1 in them.

    It is T·t in the middle of the old element and changes by the load less inertia per metre, which
    is linear between the values from the balance of the old nodes; in the top element it is that of
    its upper end.
    """
    parent, position = parts
    n = len(old.rest)
    force = rope.work[rows.TENSION, :n] * old.direction
    load = np.zeros((3, n + 1))
    load[:, 1:n] = -np.diff(force, axis=1) / (0.5 * (old.rest[1:] + old.rest[:-1]))
    load[:, n] = _load_at_top(rope, old, end)
    load[:, 0] = load[:, 1]
    low, high = load[:, :-1][:, parent], load[:, 1:][:, parent]
    low = np.where(parent == n - 1, high, low)
    middle = 0.5 * (0.5 + position)  # midway between the middles of the element and of the part
    change: Floats = (position - 0.5) * old.rest[parent] * ((1.0 - middle) * low + middle * high)
    return force[:, parent] - change


def _move_off_chords(
    state: State, old: Elements, parts: tuple[Ints, Floats], force: Floats
) -> None:
    """Move new nodes off the chord of their element so that its parts lie along their forces."""
    parent, fraction = parts
    magnitude = np.sqrt((force * force).sum(axis=0))
    direction = force / np.where(magnitude > 0.0, magnitude, 1.0)
    chord = old.length[parent] * fraction * direction
    total = np.zeros((3, len(old.rest)))
    for k in range(3):
        np.add.at(total[k], parent, chord[k])
    chord -= fraction * total[:, parent]  # closes each element's chain on its chord
    sum_of_chords = np.cumsum(chord, axis=1)
    first = np.searchsorted(parent, np.arange(len(old.rest)))
    offset = (
        sum_of_chords - (sum_of_chords - chord)[:, first][:, parent]
    )  # at the upper end of each part
    sag = np.sqrt((offset * offset).sum(axis=0))
    longest = np.zeros(len(old.rest))
    np.maximum.at(longest, parent, sag / (old.rest[parent] * fraction))
    offset = np.where(longest[parent] <= SAG_LIMIT, offset, 0.0)
    inner = np.flatnonzero(parent[1:] == parent[:-1])
    state.nodes[_X, :][:, inner + 1] += offset[:, inner]


class Elements(NamedTuple):
    """Elements from the lower end up, (elements,) each."""

    rest: Floats  # unstretched length [m]
    section: Ints  # index of the rope's section
    direction: Floats  # (3, elements), upward
    length: Floats  # [m]
    damper: Floats  # damping tension [N]
    lowest_rate: float  # of the lowest element's length [m/s]
    lowest_depth: float  # of its middle below the mean water level [m]


def elements_of(state: State, sections: Floats, payout_m_per_s: float) -> Elements:
    """Return the elements of a state; the top one grows at the pay-out speed [m/s]."""
    n = int(state.counts[rows.ELEMENTS])
    s = state.s[: n + 1]
    rest = np.diff(s)
    section = np.searchsorted(sections[rows.END], s[:-1] + SAME_PLACE, side="right")
    vector = np.diff(state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1], axis=1)
    length = np.sqrt((vector * vector).sum(axis=0) + 1e-16 * rest * rest)
    direction = vector / length
    relative_velocity = np.diff(state.nodes[rows.VELOCITY : rows.VELOCITY + 3, : n + 1], axis=1)
    rate = (direction * relative_velocity).sum(axis=0)
    rate[-1] -= payout_m_per_s / rest[-1] * length[-1]
    damper = sections[rows.C][section] / rest * rate
    depth = -float(state.nodes[rows.POSITION + 2, :2].mean())
    return Elements(rest, section, direction, length, damper, float(rate[0]), depth)


def tensions(rope: Rope, elements: Elements, offset: Floats) -> Floats:
    """Tension of elements with these length offsets [N]; 0 where slack, (elements,)."""
    strain = (elements.length + offset - elements.rest) / elements.rest
    law, stiffness = sections_law(rope), rope.sections[rows.EA][elements.section]
    if isinstance(law, FibreLaw):
        elastic = instantaneous_tension(law, elements.section, strain)[0]
    else:
        elastic = np.where(strain < 0.0, stiffness * strain, 0.0)
        elastic += elastic_state(law, stiffness, elements.section, strain)[0]
    tension: Floats = np.maximum(elastic + elements.damper, 0.0)
    unit_law = law_of_lowest(rope.effects)
    if unit_law is not None:
        extension = float(elements.length[0] + offset[0] - elements.rest[0])
        k = float(stiffness[0] / elements.rest[0])
        tension[0] = unit_law(extension, elements.lowest_rate, k, elements.lowest_depth)[0]
    return tension


def offsets_for(rope: Rope, elements: Elements, wanted_n: Floats) -> Floats:
    """Length offsets that give these tensions [m]; 0 where the tension is NaN, (elements,).

    The lowest element has none where an effect gives its law: it is the same on all meshes.
    """
    stiffness = rope.sections[rows.EA][elements.section]
    elastic = wanted_n - elements.damper
    strain, law = elastic / stiffness, sections_law(rope)
    if isinstance(law, FibreLaw):
        strain = instantaneous_strain(law, elements.section, elastic)
    elif rope.law is not None:
        taut = elastic > 0.0
        strain = np.where(
            taut, _strains(rope.law, elements.section, np.maximum(elastic, 0.0)), strain
        )
    offset = elements.rest * (1.0 + strain) - elements.length
    offsets: Floats = np.where(np.isnan(wanted_n), 0.0, offset)
    if law_of_lowest(rope.effects) is not None:
        offsets[0] = 0.0
    return offsets


def _strains(law: Table, section: Ints, elastic_n: Floats) -> Floats:
    """Return the strains at which a tension table holds these tensions, by bisection.

    The tabulated tension must increase everywhere.
    """
    high = np.full(len(elastic_n), 1e-3)
    unused = np.zeros(len(elastic_n))
    while np.any(too_low := elastic_state(law, unused, section, high)[0] < elastic_n):
        high = np.where(too_low, 2.0 * high, high)
    low = np.zeros(len(elastic_n))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        below = elastic_state(law, unused, section, middle)[0] < elastic_n
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    strain: Floats = 0.5 * (low + high)
    return strain


def has_state(effect: Any) -> bool:
    """Return whether an effect has internal variables, so that two ropes cannot share it."""
    return variable_count(type(effect)) > 0


def own_copies(effects: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the effects; those with internal variables get copies of all their arrays."""
    return tuple(_copy(effect) if has_state(effect) else effect for effect in effects)


def state_arrays(effects: tuple[Any, ...]) -> list[Floats]:
    """Return all arrays of the effects with internal variables, not copied."""
    return [part for effect in effects if has_state(effect) for part in effect if _is_array(part)]


def with_arrays_of(live: Any, effect: Any) -> Any:
    """Return an effect with the arrays of a live one of its type, if that has internal variables.

    The arrays are not copied. The effect keeps its own arrays that no step changes.
    """
    if not has_state(live):
        return effect
    fixed = FIXED if isinstance(live, RigidBody) else ()
    arrays = {k: v for k, v in live._asdict().items() if _is_array(v) and k not in fixed}
    return effect._replace(**arrays)


def on_nodes(
    effects: tuple[Any, ...], s: Floats, capacity: int, start_m: float = 0.0
) -> tuple[Any, ...]:
    """Return the effects for other nodes of their rope, or of a part of it.

    Internal variables are interpolated over the rope's material; further rows are those of the
    nearest node.

    Args:
        effects: of the rope with its old nodes.
        s: coordinates of the new nodes that carry loads in the old rope [m], (nodes,).
        capacity: of the new rope's arrays, in nodes.
        start_m: coordinate of the new rope's lower end in the old rope [m].
    """
    return tuple(
        effect._replace(memory=_memory_of(effect, s, capacity, start_m))
        if has_state(effect)
        else effect
        for effect in own_copies(effects)
    )


def _copy(effect: Any) -> Any:
    arrays = {name: part.copy() for name, part in effect._asdict().items() if _is_array(part)}
    return effect._replace(**arrays)


def _is_array(part: Any) -> bool:
    return isinstance(part, np.ndarray)


def _memory_of(effect: Any, s: Floats, capacity: int, start_m: float) -> Floats:
    memory, k = effect.memory, variable_count(type(effect))
    old, n = int(memory[3 * k, -1]), len(s)
    marks = memory[3 * k, :old]
    new: Floats = np.zeros((memory.shape[0], capacity + 1))
    if old == 0:  # the first step sets the values
        return new
    for r in range(k):
        new[r, :n] = np.interp(s, marks, memory[r, :old])
        new[r, n:] = new[r, n - 1]  # of ghost nodes, and of a node where an element splits
    nearest = np.abs(s[:, None] - marks).argmin(axis=1)
    new[3 * k + 1 :, :n] = memory[3 * k + 1 :, nearest]
    new[3 * k + 1 :, -1] = memory[3 * k + 1 :, -1]  # values that an effect has once for the rope
    new[3 * k, :n], new[3 * k, -1] = s - start_m, n
    return new
