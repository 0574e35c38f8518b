"""Cut of a rope: the solver's arrays of both parts, and the step of the falling part.

The cut is at a node. Where none is, one is inserted into the element: position, velocity and length
offset are interpolated, so that mass, momentum, height and stretch are unchanged (kinetic energy
loses ¼·m·ξ·(1 - ξ)·|Δv|² of the element's mass m). The node is then the end of both parts, in each
with the half element that it has there. Both ends start with the acceleration of the forces left on
them, from a step of a microsecond taken twice.

The upper part stays suspended, with nothing at its lower end. The lower part has a free upper end.
The step prescribes the uppermost node of a rope, so this part continues beyond its end in a section
without mass, volume, area, stiffness and damping, which transmits no force: the end is exactly
free. The node at the end of that section moves ahead of the free end along the rope, so that the
tangent at the free end is the rope's own. With bending stiffness the section is long enough not to
resist; VIV models count the rope between nodes, and get a section of 2 mm: 1 mm more at the end.

Each part has its own arrays of effects with internal variables (core/loads/memory), so that
neither changes the state of the other. Nodes keep their values; the node inserted at the cut takes
values between those of its neighbours, as where an element splits. Effects at the lower end of the
upper part keep their types, so that nothing is recompiled.

The release travels up and down from the cut through elements that go slack behind it, the first of
them in less than a step. The first step is therefore taken in substeps that double, from 1/256 of
it on: a single step would gain energy, up to 2 % of the elastic energy (20 m elements, 10 ms).

In a multi-line system the lower part is an additional rope. Its upper end is a connection with no
other rope, so that it moves freely; the connection or payload at the rope's lower end is now at
that of the lower part. The upper part keeps its upper end and has nothing at its lower end. All are
advanced in one step, whether the part below the cut is still held by other ropes or falls freely.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.bed import Grid, Plane
from rope_twin.core.body.state import RigidBody
from rope_twin.core.joined.joints import LOOSE, System, new_system
from rope_twin.core.loads.hooks import hooks_of, work_rows
from rope_twin.core.payout import SMALLEST_REST
from rope_twin.core.state import (
    SAME_PLACE,
    Boundary,
    Floats,
    Rope,
    State,
    Table,
    columns_for,
    new_state,
    new_work,
)
from rope_twin.core.step import advance, advance_joined
from rope_twin.effects import depth_profiles, payload_oscillation
from rope_twin.effects.compensator import Compensator
from rope_twin.effects.depth_profiles import DepthProfiles
from rope_twin.effects.hull_contact import HullContact
from rope_twin.effects.payload import Payload, SplashZone, TwoWayPayload
from rope_twin.effects.payload_faces import Fairing, Net, TowedFairing
from rope_twin.effects.payload_oscillation import PayloadOscillation
from rope_twin.effects.payload_shedding import PayloadShedding
from rope_twin.effects.rope_mass import Weight
from rope_twin.effects.waves import Waves
from rope_twin.errors import SolverError
from rope_twin.scene.grid import MIN_TOLERANCE_N, ROOM, TOLERANCE_SHARE, halvings
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.twin.regrid import (
    elements_of,
    has_state,
    on_nodes,
    own_copies,
    state_arrays,
    tensions,
)
from rope_twin.vortex.drag_amplification import GROWTH, DragGrowth, OscillatingDrag


def is_viv_model(effect: Any) -> bool:
    """Return whether an effect loads nodes by their length, so that a massless section counts.

    These are the VIV models inside the step, the sticking bed and nets along the rope. Contact with
    the hull does not act on what falls.
    """
    at_nodes = has_state(effect) and "load_nodes" in hooks_of(type(effect))
    return at_nodes and not isinstance(effect, DragGrowth | OscillatingDrag | HullContact)


def falling_effects(effects: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the effects of a falling part: slack rope has no modes, and does not touch the hull.

    Drag amplification is reset; contact with the hull, which moves with the uppermost node, is
    removed.
    """
    for effect in effects:
        if isinstance(effect, DragGrowth):
            effect.memory[GROWTH] = 0.0
    return tuple(
        effect._replace(k=0.0, k_payload=0.0) if isinstance(effect, HullContact) else effect
        for effect in effects
    )


_ZERO = (0.0, 0.0, 0.0)
_WITHOUT: dict[type, dict[str, Any]] = {  # values that remove the load of an effect at the end
    Payload: dict.fromkeys(Payload._fields, 0.0),
    TwoWayPayload: dict.fromkeys(TwoWayPayload._fields, 0.0),
    SplashZone: {"lift": 0.0, "slam": 0.0, "wet": _ZERO, "added": _ZERO, "k": _ZERO},
    Net: {"along": 0.0, "facing": 0.0, "lift": 0.0},
    Fairing: {"k": 0.0},
    HullContact: {"k_payload": 0.0},
    TowedFairing: {"force": 0.0},
    DepthProfiles: dict.fromkeys(depth_profiles.AT_END, 0.0),
    PayloadOscillation: dict.fromkeys(payload_oscillation.AT_END, 0.0),
    PayloadShedding: {"k": 0.0},
    Waves: {"Mx": 0.0, "My": 0.0, "Mz": 0.0},
}


def is_at_end(effect: Any) -> bool:
    """Return whether the effect loads the lower end of the rope."""
    return "load_end" in hooks_of(type(effect)) or isinstance(effect, HullContact)


def without_load(effects: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the effects of the rope alone.

    Raises:
        TypeError: an effect at the lower end is unknown here.
    """
    return tuple(_without_end_load(effect) if is_at_end(effect) else effect for effect in effects)


def _without_end_load(effect: Any) -> Any:
    if isinstance(effect, Plane | Grid):  # the bed stays, the payload on it does not
        return effect._replace(soil=effect.soil._replace(k_payload=0.0))
    if isinstance(effect, RigidBody):
        return effect._replace(here=0.0, W=0.0, hook=0.0)
    if type(effect) not in _WITHOUT:
        raise TypeError(f"{type(effect).__name__} loads the lower end: say here what is none of it")
    return effect._replace(**_WITHOUT[type(effect)])


NODE_TOL = 0.01  # of an element: the rope is cut at a node within this distance
BEYOND_M = 1e9  # length of the massless section beyond the free end
BEYOND_SHEDDING_M = 2.0 * SMALLEST_REST  # the same with VIV models: as short as possible
AHEAD_M = 1.0  # distance of its held upper end beyond the free end
INSTANT_S = 1e-6
SPARE_NODES = 16  # nodes: those inserted, and the one beyond the free end
_X, _V, _A = (slice(k, k + 3) for k in (rows.POSITION, rows.VELOCITY, rows.ACCELERATION))


class Nodes(NamedTuple):
    """Nodes and elements of a rope from the lower end up."""

    motion: Floats  # position, velocity, acceleration of the material, (NODE_ROWS, nodes)
    s: Floats  # (nodes,)
    offset: Floats  # (elements,)
    tension: Floats  # (elements,)

    def with_node_at(self, s: float) -> tuple[Nodes, int]:
        """Return these nodes with one at this material coordinate [m], and its index."""
        e = int(np.searchsorted(self.s, s, side="right")) - 1
        e = min(max(e, 0), len(self.offset) - 1)
        fraction = (s - self.s[e]) / (self.s[e + 1] - self.s[e])
        if not NODE_TOL <= fraction <= 1.0 - NODE_TOL:
            return self, e + (fraction > 0.5)
        inserted = (1.0 - fraction) * self.motion[:, e] + fraction * self.motion[:, e + 1]
        parts = fraction * self.offset[e], (1.0 - fraction) * self.offset[e]
        return Nodes(
            np.insert(self.motion, e + 1, inserted, axis=1),
            np.insert(self.s, e + 1, s),
            np.concatenate([self.offset[:e], parts, self.offset[e + 1 :]]),
            np.insert(self.tension, e, self.tension[e]),
        ), e + 1


class CutParts(NamedTuple):
    """Two parts of a cut rope."""

    upper: Rope
    lower: Rope  # with the massless section on top
    lost_m: float  # unstretched length of the lower part


class CutPosition(NamedTuple):
    """Position and time of a cut."""

    at_m: float  # unstretched length of the part below the cut
    min_m: float  # minimum payout of the winch above
    time: float  # now [s]
    rope: int = 0  # its number in a multi-line scene


def cut_rope(
    rope: Rope, boundary: Boundary, position: CutPosition, bare_effects: tuple[Any, ...]
) -> CutParts:
    """Cut a rope.

    Args:
        rope: whole rope; unchanged.
        boundary: its prescribed motion now, in row 0.
        position: of the cut.
        bare_effects: its effects without the load at its lower end.

    Raises:
        SolverError: the forces at a new end are not finite.
    """
    V = float(boundary.rate[0, rows.LINE])
    nodes, k = nodes_of(rope, V).with_node_at(_severable_position(rope, position.at_m))
    lost_m = float(nodes.s[k])
    for inserted_m in inserted_nodes(nodes.s[k:] - lost_m, position.min_m):
        nodes, _ = nodes.with_node_at(lost_m + inserted_m)
    nodes.motion[:, -1] = rope.state.nodes[:, len(rope_s(rope)) - 1]
    upper = upper_part(rope, nodes, k, bare_effects)
    lower = _falling_with_section(rope, nodes, k)
    end_value = boundary.value[0].copy()
    end_value[rows.LINE] -= lost_m
    _find_accelerations(upper, Boundary(end_value[None], boundary.rate[:1]), position.time)
    beyond = node_beyond(lower)
    _find_accelerations(lower, Boundary(beyond[0][None], beyond[1][None]), position.time)
    return CutParts(upper, lower, lost_m)


def _severable_position(rope: Rope, at_m: float) -> float:
    """Return the position of a cut [m]: in a heave compensator, the nearer of its ends."""
    unit_m = float(rope.state.s[1])
    if at_m >= unit_m or not any(isinstance(effect, Compensator) for effect in rope.effects):
        return at_m
    return unit_m if at_m > 0.5 * unit_m else 0.0


def rope_s(rope: Rope) -> Floats:
    """Material coordinates of the nodes, a view [m], (nodes,)."""
    return rope.state.s[: int(rope.state.counts[rows.ELEMENTS]) + 1]


def without_massless_section(lower: Rope) -> Rope:
    """Return a lower part without its massless section; a view except for the counts."""
    counts = lower.state.counts.copy()
    counts[rows.ELEMENTS] -= 1
    return lower._replace(state=lower.state._replace(counts=counts))


def node_beyond(lower: Rope) -> tuple[Floats, Floats]:
    """Position of the held node beyond the free end, and its rate, (MOTIONS,) each."""
    end = int(lower.state.counts[rows.ELEMENTS]) - 1
    x = lower.state.nodes[_X, end]
    direction = x - lower.state.nodes[_X, end - 1]
    value, rate = np.zeros(rows.MOTIONS), np.zeros(rows.MOTIONS)
    value[:3] = x + AHEAD_M / max(float(np.linalg.norm(direction)), 1e-9) * direction
    rate[:3] = lower.state.nodes[_V, end]
    value[rows.LINE] = lower.state.s[end + 1]
    return value, rate


def step_free(lower: Rope, time: float) -> bool:
    """Advance a lower part by a step; False: the next state is not finite and it is unchanged.

    The node beyond the free end keeps the end's velocity over the step.
    """
    value, rate = node_beyond(lower)
    lower.state.nodes[_X, int(lower.state.counts[rows.ELEMENTS])] = value[:3]
    end_value = value + lower.model.step * rate
    boundary = Boundary(np.array([value, end_value]), np.array([rate, rate]))
    return advance(lower, boundary, np.zeros((1, rows.PULL_COLUMNS)), time, 1) == 1


def refresh_tension(rope: Rope, payout_m_per_s: float) -> None:
    """Recompute the tensions of the present state after a failed trial."""
    elements = elements_of(rope.state, rope.sections, payout_m_per_s)
    n = len(elements.rest)
    rope.work[rows.TENSION, :n] = tensions(rope, elements, rope.state.offset[:n])


def nodes_of(rope: Rope, V: float) -> Nodes:
    """Return the nodes of the material, which passes the hang-off with v - V·(vector/l_rest)."""
    s = rope_s(rope).copy()
    n = len(s) - 1
    motion = rope.state.nodes[:, : n + 1].copy()
    motion[_V, n] -= V / (s[n] - s[n - 1]) * (motion[_X, n] - motion[_X, n - 1])
    return Nodes(motion, s, rope.state.offset[:n].copy(), rope.work[rows.TENSION, :n].copy())


def inserted_nodes(s: Floats, min_m: float) -> list[float]:
    """Return nodes to insert in the lowest element, as in a whole rope hauled in this far.

    The uppermost element shrinks at the sheave and must not be the lowest one too.
    """
    min_length_m = min(min_m, float(s[-1]))
    wanted = halvings(min_length_m, float(s[1])) if ROOM * min_length_m < s[1] else []
    return [position for position in wanted if position < (1.0 - NODE_TOL) * s[1]]


def upper_part(
    rope: Rope, nodes: Nodes, k: int, bare_effects: tuple[Any, ...], *, loaded: bool = False
) -> Rope:
    """Return the part that stays suspended; sections cut off end below its lower end.

    loaded: its upper end is a connection, whose node carries loads.
    """
    sections = rope.sections.copy()
    sections[rows.END] -= nodes.s[k]
    part = Nodes(nodes.motion[:, k:], nodes.s[k:] - nodes.s[k], nodes.offset[k:], nodes.tension[k:])
    state = _state_from(part, rope.state.s.shape[0] + SPARE_NODES)
    state.health[:] = rope.state.health
    model = rope.model._replace(first_free=0)
    carrying = nodes.s[k:] if loaded else nodes.s[k:-1]
    if k > 0:
        bare_effects = tuple(
            effect._replace(here=0.0) if isinstance(effect, Compensator) else effect
            for effect in bare_effects
        )
    effects = on_nodes(bare_effects, carrying, state.s.shape[0], float(nodes.s[k]))
    return _filled(rope._replace(model=model, sections=sections, effects=effects), state, part)


def falling_part(rope: Rope, nodes: Nodes, k: int) -> Rope:
    """Return the part below node k; its elements neither split nor merge."""
    motion, s = nodes.motion[:, : k + 1], nodes.s[: k + 1]
    part = Nodes(motion, s, nodes.offset[:k], nodes.tension[:k])
    state = _state_from(part, rope.state.s.shape[0] + SPARE_NODES)
    model = rope.model._replace(split_above=np.inf, merge_below=0.0)
    effects = falling_effects(on_nodes(rope.effects, s, state.s.shape[0]))
    lower = rope._replace(model=model, sections=rope.sections.copy(), effects=effects)
    return _filled(lower, state, part)


def _falling_with_section(rope: Rope, nodes: Nodes, k: int) -> Rope:
    """Return the falling part with the massless section above it."""
    lost_m = nodes.s[k]
    sections = np.hstack([rope.sections, np.zeros((rows.SECTION_ROWS, 1))])
    sections[rows.END, :-1] = np.minimum(sections[rows.END, :-1], lost_m)
    sections[rows.END, -1] = np.inf
    sections[rows.PER_METRE + rows.LENGTH - rows.MASS, -1] = 1.0  # a length per metre, without mass
    sheds = any(is_viv_model(effect) for effect in rope.effects)
    part = Nodes(
        np.insert(nodes.motion[:, : k + 1], k + 1, nodes.motion[:, k], axis=1),
        np.append(nodes.s[: k + 1], lost_m + (BEYOND_SHEDDING_M if sheds else BEYOND_M)),
        np.append(nodes.offset[:k], 0.0),
        np.append(nodes.tension[:k], 0.0),
    )
    state = _state_from(part, rope.state.s.shape[0] + SPARE_NODES)
    model = rope.model._replace(split_above=np.inf, merge_below=0.0)
    law = None if rope.law is None else _with_zero_section(rope.law)
    effects = falling_effects(on_nodes(rope.effects, nodes.s[: k + 1], state.s.shape[0]))
    lower = rope._replace(model=model, sections=sections, law=law, effects=effects)
    return _filled(lower, state, part)


def _with_zero_section(law: Table) -> Table:
    """Return the tension table with a section of zero tension at any strain."""
    knots = law.knot.shape[1]
    zero_rows = {field: np.zeros((1, knots)) for field in Table._fields}
    zero_rows["knot"][0, 1:] = np.inf
    return Table(*(np.vstack([getattr(law, name), zero_rows[name]]) for name in Table._fields))


def _state_from(part: Nodes, capacity: int) -> State:
    state = new_state(capacity)
    n = len(part.offset)
    state.counts[rows.ELEMENTS] = n
    state.nodes[:, : n + 1], state.s[: n + 1], state.offset[:n] = part.motion, part.s, part.offset
    return state


def _filled(rope: Rope, state: State, part: Nodes) -> Rope:
    """Return the part with its own scratch arrays and a tolerance from its weight."""
    work = new_work(columns_for(state.s.shape[0]), work_rows(rope.effects))
    work[rows.TENSION, : len(part.tension)] = part.tension
    tolerance = max(TOLERANCE_SHARE * _weight_n(rope, part), MIN_TOLERANCE_N)
    model = rope.model._replace(tolerance=min(rope.model.tolerance, tolerance))
    return rope._replace(model=model, state=state, work=work)


def _weight_n(rope: Rope, part: Nodes) -> float:
    """Weight of the rope in water, as a magnitude [N]."""
    section = np.searchsorted(rope.sections[rows.END], part.s[:-1] + SAME_PLACE, side="right")
    mass, volume = rope.sections[rows.PER_METRE : rows.PER_METRE + 2, section]
    return sum(
        abs(float(effect.g * (np.diff(part.s) @ (mass - effect.density * volume))))
        for effect in rope.effects
        if isinstance(effect, Weight)
    )


def _find_accelerations(part: Rope, boundary: Boundary, time: float) -> None:
    """Set the accelerations of a part's nodes from its forces; all else is unchanged."""
    model = part.model._replace(step=INSTANT_S, split_above=np.inf, merge_below=0.0)
    end_value = boundary.value + INSTANT_S * boundary.rate
    step_boundary = Boundary(
        np.vstack([boundary.value, end_value]), np.vstack([boundary.rate, boundary.rate])
    )
    n, pull = int(part.state.counts[rows.ELEMENTS]), np.zeros((1, rows.PULL_COLUMNS))
    for _ in range(2):
        work = new_work(columns_for(part.state.s.shape[0]), work_rows(part.effects))
        effects = own_copies(part.effects)
        trial = part._replace(model=model, state=part.state.copy(), work=work, effects=effects)
        if advance(trial, step_boundary, pull, time, 1) < 1:
            problem = "the forces at its new end are not finite"
            raise SolverError("the rope's cut", problem, "check the scene")
        part.state.nodes[_A, :n] = trial.state.nodes[_A, :n]


SUBSTEPS = (0.0, *(0.5**k for k in range(8, -1, -1)))  # fractions of the first step after a cut


def boundary_at(
    boundary: Boundary, fractions: tuple[float, ...], h: float
) -> tuple[Floats, Floats]:
    """Prescribed motion at these fractions of a step, by the cubic of `core.payout`."""
    if len(fractions) == 2:
        return boundary.value, boundary.rate
    u = np.array(fractions)[:, None]
    (y0, y1), (d0, d1) = boundary.value, boundary.rate * h
    c2, c3 = 3.0 * (y1 - y0) - 2.0 * d0 - d1, 2.0 * (y0 - y1) + d0 + d1
    value = y0 + u * (d0 + u * (c2 + u * c3))
    rate = (d0 + u * (2.0 * c2 + u * 3.0 * c3)) / h
    value[-1], rate[-1] = boundary.value[1], boundary.rate[1]
    return value, rate


def cut_system(system: System, boundary: Boundary, position: CutPosition) -> tuple[System, float]:
    """Cut a rope of a system without sheaves; the argument is unchanged.

    Return the system with the lower part as last rope, and its unstretched length [m].

    boundary: of all ropes, (ropes, 1, MOTIONS).

    Raises:
        SolverError: the forces at a new end are not finite.
    """
    r, joints = position.rope, system.joints
    rope = system.ropes[r]
    at_ship = bool(joints.upper[r] == LOOSE)
    nodes, k = nodes_of(
        rope, float(boundary.rate[r, 0, rows.LINE]) if at_ship else 0.0
    ).with_node_at(position.at_m)
    lost_m = float(nodes.s[k])
    for inserted_m in inserted_nodes(nodes.s[k:] - lost_m, position.min_m) if at_ship else ():
        nodes, _ = nodes.with_node_at(lost_m + inserted_m)
    nodes, k = _with_two_elements(nodes, k)
    nodes.motion[:, -1] = rope.state.nodes[:, int(rope.state.counts[rows.ELEMENTS])]
    upper = upper_part(rope, nodes, k, without_load(rope.effects), loaded=not at_ship)
    lower = falling_part(rope, nodes, k)
    ropes = [*system.ropes, lower]
    ropes[r] = upper
    lower_ends = [*joints.lower.tolist(), int(joints.lower[r])]
    lower_ends[r] = LOOSE
    tolerance = min(system.ropes[0].model.tolerance, upper.model.tolerance, lower.model.tolerance)
    ropes[0] = ropes[0]._replace(model=ropes[0].model._replace(tolerance=tolerance))
    upper_ends = [*joints.upper.tolist(), joints.nodes.shape[1]]
    parts = new_system(tuple(ropes), lower_ends, upper_ends, joints.ties)
    for new, old in zip(parts.ropes, ropes, strict=True):
        n = int(old.state.counts[rows.ELEMENTS])
        new.work[rows.TENSION, :n] = old.work[rows.TENSION, :n]
    _find_system_accelerations(
        parts, (r, len(ropes) - 1), _with_lower_part(boundary), position.time
    )
    return parts, lost_m


def scene_of_parts(scene: Scene, number: int, lost_m: float) -> Scene:
    """Return the scene after the cut, with the lower part as last rope; both new ends are free."""
    line = scene.ropes[number]
    upper = replace(line, to="", fixed_at_m=None)
    lower: RopeLine = replace(line, name=f"{line.name}/lower", from_="", length_m=lost_m)
    lines = [*scene.ropes, lower]
    lines[number] = upper
    return replace(scene, ropes=tuple(lines))


def advance_in_substeps(system: System, boundary: Boundary, time: float) -> Floats | None:
    """Advance the first step after a cut in doubling substeps.

    boundary: (ropes, 2, MOTIONS). Returns the forces on the upper ends after it [N], (ropes, 1,
    PULL_COLUMNS), or None if it failed and all is unchanged.
    """
    pull = np.zeros((len(system.ropes), 1, rows.PULL_COLUMNS))
    backup = copy.deepcopy(([rope.state for rope in system.ropes], system.joints))
    internal = [array for rope in system.ropes for array in state_arrays(rope.effects)]
    internal_backup = [array.copy() for array in internal]
    h = system.ropes[0].model.step
    each = [boundary_at(Boundary(*tables), SUBSTEPS, h) for tables in zip(*boundary, strict=True)]
    value, rate = (np.array(tables) for tables in zip(*each, strict=True))
    for k, (begin, end) in enumerate(pairwise(SUBSTEPS)):
        substep_boundary = Boundary(value[:, k : k + 2].copy(), rate[:, k : k + 2].copy())
        substep_system = _with_step(system, (end - begin) * h)
        if advance_joined(substep_system, substep_boundary, pull, time + begin * h, 1) < 1:
            for rope, state in zip(system.ropes, backup[0], strict=True):
                for array, saved in zip(rope.state, state, strict=True):
                    array[...] = saved
            for array, saved in zip(system.joints[2:4], backup[1][2:4], strict=True):
                array[...] = saved
            for array, saved in zip(internal, internal_backup, strict=True):
                array[...] = saved
            return None
    system.ropes[0].state.health[rows.STEPS] -= len(SUBSTEPS) - 2
    return pull


def _with_step(system: System, step: float) -> System:
    return system._replace(
        ropes=tuple(rope._replace(model=rope.model._replace(step=step)) for rope in system.ropes)
    )


def _with_two_elements(nodes: Nodes, k: int) -> tuple[Nodes, int]:
    """Divide parts of one element in two, as a rope between connections needs two elements."""
    if k == 1:
        nodes, _ = nodes.with_node_at(0.5 * float(nodes.s[1]))
        k = 2
    if k == len(nodes.s) - 2:
        nodes, _ = nodes.with_node_at(0.5 * float(nodes.s[k] + nodes.s[k + 1]))
    return nodes, k


def _with_lower_part(boundary: Boundary) -> Boundary:
    """Return a boundary with a row for the lower part, which is not used."""
    return Boundary(*(np.concatenate([table, table[-1:]]) for table in boundary))


def _find_system_accelerations(
    system: System, parts: tuple[int, int], boundary: Boundary, time: float
) -> None:
    """Set the accelerations of the parts' nodes from their forces; all else is unchanged."""
    value, rate = boundary
    step_boundary = Boundary(
        np.concatenate([value, value + INSTANT_S * rate], axis=1),
        np.concatenate([rate, rate], axis=1),
    )
    pull = np.zeros((len(system.ropes), 1, rows.PULL_COLUMNS))
    fixed_mesh = [
        rope._replace(model=rope.model._replace(split_above=np.inf, merge_below=0.0))
        for rope in system.ropes
    ]
    for _ in range(2):
        trial = copy.deepcopy(_with_step(system._replace(ropes=tuple(fixed_mesh)), INSTANT_S))
        if advance_joined(trial, step_boundary, pull, time, 1) < 1:
            problem = "the forces at its new end are not finite"
            raise SolverError("the rope's cut", problem, "check the scene")
        for r in parts:
            _copy_accelerations(system.ropes[r], trial.ropes[r], is_held=r == parts[0])
        system.joints.nodes[_A, -1] = trial.joints.nodes[_A, -1]


def _copy_accelerations(rope: Rope, trial: Rope, *, is_held: bool) -> None:
    """Copy accelerations from a trial step; is_held: except that of the upper end."""
    n = int(rope.state.counts[rows.ELEMENTS]) + (0 if is_held else 1)
    rope.state.nodes[_A, :n] = trial.state.nodes[_A, :n]
