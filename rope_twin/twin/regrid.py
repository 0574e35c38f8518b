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
from rope_twin.core.axial_law import FibreLaw, held_strain, held_tension, hold, sections_law
from rope_twin.core.body.state import FIXED, RigidBody
from rope_twin.core.joined.joints import System, loaded_ends, new_system, with_flows
from rope_twin.core.joined.stack import FLOW_COLUMN
from rope_twin.core.loads.accounts import law_of_lowest
from rope_twin.core.loads.hooks import work_rows
from rope_twin.core.loads.memory import numbers_carried
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

SPARE = 12  # nodes of a coarser rope beyond half the capacity: events, trial nodes, an odd one
LEAST_SPARE = TRIALS + 1  # nodes beyond those of a finer rope, so that it can still split
LEAST_PART = 0.25  # of an even part: an old node nearer to another one is not restored
LONG = 1.5  # times the element length made at the sheave: a longer part is divided evenly
SAG_LIMIT = 0.05  # of a part's length; as in payout, a node further off stays on the chord
_X, _V, _A = (slice(k, k + 3) for k in (rows.POSITION, rows.VELOCITY, rows.ACCELERATION))
HALVINGS = 60


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
    room: int  # capacity of the arrays in nodes
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
    return [UpperEnd(*own) for own in zip(forces, speeds, loaded, strict=True)]


def _passing_m_per_s(whole: System) -> Floats:
    """Return the rate at which each rope grows at a sheave [m/s], (ropes,); 0 without one."""
    speeds, sheaves = np.zeros(len(whole.ropes)), whole.sheaves
    if sheaves is not None:
        for r, (of, side) in enumerate(zip(sheaves.of, sheaves.side, strict=True)):
            if of >= 0:
                flow = int(sheaves.figures[FLOW_COLUMN, of])
                speeds[r] = float(side) * float(whole.joints.nodes[rows.VELOCITY, flow])
    return speeds


def joined_as(whole: System, ropes: Sequence[Rope]) -> System:
    """Return these ropes in a system with copies of the connections and sheaves of `whole`."""
    joints, sheaves = whole.joints, whole.sheaves
    found = new_system(tuple(ropes), list(joints.lower), list(joints.upper), joints.ties.copy())
    if sheaves is not None:
        flows = with_flows(found.joints, sheaves.figures.shape[1])
        found = found._replace(joints=flows, sheaves=copy.deepcopy(sheaves))
    found.joints.nodes[:] = joints.nodes
    for own, given in zip(found.ropes, ropes, strict=True):
        n = int(given.state.counts[rows.ELEMENTS])
        own.work[rows.TENSION, :n] = given.work[rows.TENSION, :n]
    return found


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


def coarse_room(room: int, sections: Floats) -> int:
    """Return the capacity in nodes of the arrays of a coarser rope."""
    return room // 2 + int(sections.shape[1]) + SPARE


def coarser(rope: Rope, at: UpperEnd) -> Rope:
    """Return the rope on every second node; the force on the hang-off is unchanged."""
    keep, n = _kept_nodes(rope), int(rope.state.counts[rows.ELEMENTS])
    old = elements_of(rope.state, rope.sections, at.payout_m_per_s)
    model = rope.model._replace(
        element_length=2.0 * rope.model.element_length,
        split_above=2.0 * rope.model.split_above,
        merge_below=2.0 * rope.model.merge_below,
    )
    room = coarse_room(rope.state.s.shape[0], rope.sections)
    state = _empty(rope, room, rope.state.s[keep])
    state.nodes[:, : len(keep)] = rope.state.nodes[:, keep]
    weights = _lever_weights(keep, old.rest)
    mass = _node_masses(rope, old)
    lowest = rope.model.first_free
    for part in (_V, _A):
        moved = _spread(weights, mass * rope.state.nodes[part, : n + 1]) / _spread(weights, mass)
        state.nodes[part, lowest : len(keep) - 1] = moved[:, lowest:-1]
    wanted = _mean_tensions(rope, keep, old)
    new = elements_of(state, rope.sections, at.payout_m_per_s)
    wanted_n = np.where(np.isnan(wanted[0]), np.nan, (wanted * new.direction).sum(axis=0))
    load = _load_at_top(rope, old, at)
    top = new.direction[:, -1]
    if wanted_n[-1] > 0.0:
        wanted_n[-1] = max(float((0.5 * new.rest[-1] * load - at.pull_n) @ top), 0.0)
    return _filled(rope._replace(model=model), state, new, wanted_n, at)


def finer(rope: Rope, grid: Grid, at: UpperEnd) -> Rope:
    """Return the rope on a finer mesh: old nodes if paid out, even division of new rope.

    Tension and motion between the nodes follow from the balance at the old ones.
    """
    n = int(rope.state.counts[rows.ELEMENTS])
    old = elements_of(rope.state, rope.sections, at.payout_m_per_s)
    parent, share = _parts(rope, old, grid)
    before = np.concatenate([[0.0], np.cumsum(share)[:-1]])
    first = np.searchsorted(parent, np.arange(n))
    low = before - before[first][parent]  # start of a part in its old element, 0 to 1
    s = rope.state.s
    coordinates = np.append(s[:n][parent] + low * old.rest[parent], s[n])
    room = max(grid.room, len(coordinates) + LEAST_SPARE)
    state = _empty(rope, room, coordinates)
    material = material_nodes(rope.state, old, at.payout_m_per_s)
    at_low, at_high = material[:, :-1][:, parent], material[:, 1:][:, parent]
    state.nodes[:, : len(parent)] = (1.0 - low) * at_low + low * at_high
    state.nodes[:, len(parent)] = rope.state.nodes[:, n]
    force = _forces_of_parts(rope, old, at, (parent, low + 0.5 * share))
    taut = rope.work[rows.TENSION, :n][parent] > 0.0
    _bend(state, old, (parent, share), np.where(taut, force, 0.0))
    new = elements_of(state, rope.sections, at.payout_m_per_s)
    wanted_n = np.where(taut, np.maximum((force * new.direction).sum(axis=0), 0.0), np.nan)
    return _filled(rope._replace(model=grid.model), state, new, wanted_n, at)


def _kept_nodes(rope: Rope) -> Ints:
    """Return every second node from the hang-off down, the lower end, and the ends of sections."""
    n = int(rope.state.counts[rows.ELEMENTS])
    ends = rope.sections[rows.END]
    apart = np.abs(rope.state.s[: n + 1, None] - ends[None, np.isfinite(ends)])
    borders = sorted({0, n, *np.flatnonzero((apart <= SAME_PLACE).any(axis=1)).tolist()})
    keep = [0]
    for low, high in pairwise(borders):
        keep += reversed(range(high, low, -2))
    return np.array(keep)


def _empty(rope: Rope, room: int, coordinates: Floats) -> State:
    """Return a state with nodes at these material coordinates and the previous solver counts."""
    state = new_state(room)
    state.counts[rows.ELEMENTS] = len(coordinates) - 1
    state.s[: len(coordinates)] = coordinates
    state.health[:] = rope.state.health
    return state


def _filled(rope: Rope, state: State, new: Elements, wanted_n: Floats, at: UpperEnd) -> Rope:
    """Return the rope with this state and these element tensions (NaN: no offset)."""
    count = len(wanted_n)
    state.offset[:count] = offsets_for(rope, new, wanted_n)
    room = state.s.shape[0]
    work = new_work(columns_for(room), work_rows(rope.effects))
    work[rows.TENSION, :count] = tensions(rope, new, state.offset[:count])
    effects = on_nodes(rope.effects, state.s[: count + at.loaded], room)
    return rope._replace(state=state, work=work, effects=effects)


def _lever_weights(keep: Ints, rest: Floats) -> tuple[Ints, Ints, Floats]:
    """Return for each old node the new node at or below it, the one above, and its weight."""
    n = len(rest)
    low = np.searchsorted(keep, np.arange(n + 1), side="right") - 1
    high = np.minimum(low + 1, len(keep) - 1)
    s = np.concatenate([[0.0], np.cumsum(rest)])
    span = s[keep[high]] - s[keep[low]]
    share = np.where(span > 0.0, (s - s[keep[low]]) / np.where(span > 0.0, span, 1.0), 0.0)
    return low, high, share


def _spread(weights: tuple[Ints, Ints, Floats], values: Floats) -> Floats:
    """Sums (3, new nodes) of values (3, old nodes) by the lever rule."""
    low, high, share = weights
    total = np.zeros((3, int(high.max()) + 1))
    for k in range(3):
        np.add.at(total[k], low, (1.0 - share) * values[k])
        np.add.at(total[k], high, share * values[k])
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


def _load_at_top(rope: Rope, old: Elements, at: UpperEnd) -> Floats:
    """Load less inertia per metre of rope at the hang-off [N/m], (3,): its force there less T."""
    tension = rope.work[rows.TENSION, len(old.rest) - 1]
    load: Floats = (at.pull_n + tension * old.direction[:, -1]) / (0.5 * old.rest[-1])
    return load


def _parts(rope: Rope, old: Elements, grid: Grid) -> tuple[Ints, Floats]:
    """Return the parts of the old elements: element and fraction of its unstretched length."""
    parents: list[int] = []
    shares: list[float] = []
    s, length = rope.state.s, grid.model.element_length
    places = np.searchsorted(grid.marks_m, s[: len(old.rest) + 1], side="right")
    unit = law_of_lowest(rope.effects) is not None  # an element on all meshes
    if unit:
        parents, shares = [0], [1.0]
    for e, rest in enumerate(old.rest.tolist()[unit:], start=int(unit)):
        inside = (grid.marks_m[places[e] : places[e + 1]] - s[e]) / rest
        cuts = [0.0]
        for cut in inside.tolist():
            least = LEAST_PART / (len(inside) + 1)
            if cut > cuts[-1] + least and cut < 1.0 - least:
                cuts.append(cut)
        for low, high in pairwise([*cuts, 1.0]):
            part = (high - low) * rest
            count = round(part / length) if part > LONG * length else 1
            parents += [e] * count
            shares += [(high - low) / count] * count
    return np.array(parents), np.array(shares)


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


def _forces_of_parts(rope: Rope, old: Elements, at: UpperEnd, parts: tuple[Ints, Floats]) -> Floats:
    """Force in the middle of each part [N], (3, parts); parts: elements, positions 0 to 1 in them.

    It is T·t in the middle of the old element and changes by the load less inertia per metre, which
    is linear between the values from the balance of the old nodes; in the top element it is that of
    its upper end.
    """
    parent, place = parts
    n = len(old.rest)
    force = rope.work[rows.TENSION, :n] * old.direction
    load = np.zeros((3, n + 1))
    load[:, 1:n] = -np.diff(force, axis=1) / (0.5 * (old.rest[1:] + old.rest[:-1]))
    load[:, n] = _load_at_top(rope, old, at)
    load[:, 0] = load[:, 1]
    low, high = load[:, :-1][:, parent], load[:, 1:][:, parent]
    low = np.where(parent == n - 1, high, low)
    between = 0.5 * (0.5 + place)  # midway between the middles of the element and of the part
    change: Floats = (place - 0.5) * old.rest[parent] * ((1.0 - between) * low + between * high)
    return force[:, parent] - change


def _bend(state: State, old: Elements, parts: tuple[Ints, Floats], force: Floats) -> None:
    """Move new nodes off the chord of their element so that its parts lie along their forces."""
    parent, share = parts
    size = np.sqrt((force * force).sum(axis=0))
    along = force / np.where(size > 0.0, size, 1.0)
    step = old.length[parent] * share * along
    total = np.zeros((3, len(old.rest)))
    for k in range(3):
        np.add.at(total[k], parent, step[k])
    step -= share * total[:, parent]  # closes each element's chain on its chord
    reached = np.cumsum(step, axis=1)
    first = np.searchsorted(parent, np.arange(len(old.rest)))
    off = reached - (reached - step)[:, first][:, parent]  # at the upper end of each part
    sag = np.sqrt((off * off).sum(axis=0))
    longest = np.zeros(len(old.rest))
    np.maximum.at(longest, parent, sag / (old.rest[parent] * share))
    off = np.where(longest[parent] <= SAG_LIMIT, off, 0.0)
    inner = np.flatnonzero(parent[1:] == parent[:-1])
    state.nodes[_X, :][:, inner + 1] += off[:, inner]


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
    span = np.diff(state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1], axis=1)
    length = np.sqrt((span * span).sum(axis=0) + 1e-16 * rest * rest)
    direction = span / length
    apart = np.diff(state.nodes[rows.VELOCITY : rows.VELOCITY + 3, : n + 1], axis=1)
    rate = (direction * apart).sum(axis=0)
    rate[-1] -= payout_m_per_s / rest[-1] * length[-1]
    damper = sections[rows.C][section] / rest * rate
    depth = -float(state.nodes[rows.POSITION + 2, :2].mean())
    return Elements(rest, section, direction, length, damper, float(rate[0]), depth)


def tensions(rope: Rope, of: Elements, offset: Floats) -> Floats:
    """Tension of elements with these length offsets [N]; 0 where slack, (elements,)."""
    strain = (of.length + offset - of.rest) / of.rest
    law, stiffness = sections_law(rope), rope.sections[rows.EA][of.section]
    if isinstance(law, FibreLaw):
        elastic = held_tension(law, of.section, strain)[0]
    else:
        elastic = np.where(strain < 0.0, stiffness * strain, 0.0)
        elastic += hold(law, stiffness, of.section, strain)[0]
    pull: Floats = np.maximum(elastic + of.damper, 0.0)
    own = law_of_lowest(rope.effects)
    if own is not None:
        extension = float(of.length[0] + offset[0] - of.rest[0])
        k = float(stiffness[0] / of.rest[0])
        pull[0] = own(extension, of.lowest_rate, k, of.lowest_depth)[0]
    return pull


def offsets_for(rope: Rope, of: Elements, wanted_n: Floats) -> Floats:
    """Length offsets that give these tensions [m]; 0 where the tension is NaN, (elements,).

    The lowest element has none where an effect gives its law: it is the same on all meshes.
    """
    stiffness = rope.sections[rows.EA][of.section]
    elastic = wanted_n - of.damper
    strain, law = elastic / stiffness, sections_law(rope)
    if isinstance(law, FibreLaw):
        strain = held_strain(law, of.section, elastic)
    elif rope.law is not None:
        taut = elastic > 0.0
        strain = np.where(taut, _strains(rope.law, of.section, np.maximum(elastic, 0.0)), strain)
    offset = of.rest * (1.0 + strain) - of.length
    found: Floats = np.where(np.isnan(wanted_n), 0.0, offset)
    if law_of_lowest(rope.effects) is not None:
        found[0] = 0.0
    return found


def _strains(law: Table, section: Ints, elastic_n: Floats) -> Floats:
    """Return the strains at which a tension table holds these tensions, by bisection.

    The tabulated tension must increase everywhere.
    """
    high = np.full(len(elastic_n), 1e-3)
    unused = np.zeros(len(elastic_n))
    while np.any(short := hold(law, unused, section, high)[0] < elastic_n):
        high = np.where(short, 2.0 * high, high)
    low = np.zeros(len(elastic_n))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        less = hold(law, unused, section, middle)[0] < elastic_n
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    strain: Floats = 0.5 * (low + high)
    return strain


def has_state(effect: Any) -> bool:
    """Return whether an effect has internal variables, so that two ropes cannot share it."""
    return numbers_carried(type(effect)) > 0


def own_copies(effects: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the effects; those with internal variables get copies of all their arrays."""
    return tuple(_copy(own) if has_state(own) else own for own in effects)


def state_arrays(effects: tuple[Any, ...]) -> list[Floats]:
    """Return all arrays of the effects with internal variables, not copied."""
    return [part for own in effects if has_state(own) for part in own if _is_array(part)]


def with_arrays_of(live: Any, effect: Any) -> Any:
    """Return an effect with the arrays of a live one of its type, if that has internal variables.

    The arrays are not copied. Those that no step writes stay the effect's own.
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

    Current values are interpolated over the rope's material; further rows are those of the nearest
    node.

    Args:
        effects: of the rope with its old nodes.
        s: coordinates of the new nodes that carry loads in the old rope [m], (nodes,).
        capacity: of the new rope's arrays, in nodes.
        start_m: coordinate of the new rope's lower end in the old rope [m].
    """
    return tuple(
        own._replace(memory=_memory_of(own, s, capacity, start_m)) if has_state(own) else own
        for own in own_copies(effects)
    )


def _copy(effect: Any) -> Any:
    arrays = {name: part.copy() for name, part in effect._asdict().items() if _is_array(part)}
    return effect._replace(**arrays)


def _is_array(part: Any) -> bool:
    return isinstance(part, np.ndarray)


def _memory_of(effect: Any, s: Floats, capacity: int, start_m: float) -> Floats:
    memory, k = effect.memory, numbers_carried(type(effect))
    old, n = int(memory[3 * k, -1]), len(s)
    marks = memory[3 * k, :old]
    new: Floats = np.zeros((memory.shape[0], capacity + 1))
    if old == 0:  # the first step will give the values
        return new
    for r in range(k):
        new[r, :n] = np.interp(s, marks, memory[r, :old])
        new[r, n:] = new[r, n - 1]  # of ghost nodes, and of a node where an element splits
    nearest = np.abs(s[:, None] - marks).argmin(axis=1)
    new[3 * k + 1 :, :n] = memory[3 * k + 1 :, nearest]
    new[3 * k + 1 :, -1] = memory[3 * k + 1 :, -1]  # what an effect has once for the rope
    new[3 * k, :n], new[3 * k, -1] = s - start_m, n
    return new
