"""Arrays of systems of ropes that are stepped as a SIMD batch, and copying in and out."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import config

from rope_twin.core.jit.wide import LANES
from rope_twin.core.joined.joints import (
    FIRST,
    LOOSE,
    SECOND,
    TIE_ROWS,
    Joined,
    Joints,
    System,
    topology_of,
)
from rope_twin.core.joined.plan import SUM_ROWS, Plan, new_plan, write_plan
from rope_twin.core.joined.stack import (
    FLOW_COLUMN,
    FROM,
    INTO,
    POINT,
    LaneStack,
    Sheaves,
    chain_rows,
    effects_at,
    stacked_effects,
)
from rope_twin.core.lanes.effects import (
    SystemLaneData,
    aligned,
    any_by_lane,
    is_by_lane,
    layout_of,
    make,
    put_lane_data,
)
from rope_twin.core.lanes.group import (
    OWN_FIGURES,
    Kind,
    Lanes,
    advance_batch,
    effect_of,
    effect_places,
    on_columns,
    places_of,
    put_properties,
    put_state,
    take_state,
)
from rope_twin.core.lanes.step import Run
from rope_twin.core.loads import hooks
from rope_twin.core.loads.memory import count_initialised, variable_count
from rope_twin.core.state import (
    COUNTS,
    ELEMENTS,
    END,
    HEALTH,
    LOWEST_OFFSET,
    NODE_ROWS,
    SECTION_ROWS,
    TENSION,
    WORK_ROWS,
    Boundary,
    Floats,
    Model,
    Rope,
    State,
)


class JoinedKind(NamedTuple):
    """Properties that systems must share to be stepped in one SIMD batch."""

    ropes: tuple[Kind, ...]
    lower: tuple[int, ...]  # connection at each rope's lower end, or LOOSE
    upper: tuple[int, ...]
    links: tuple[tuple[float, float], ...]  # connections at the ends of each link
    sheaves: tuple[tuple[float, ...], ...]  # connection, flow and both ropes of each
    columns: int  # space for internal variables

    @property
    def types(self) -> tuple[type, ...]:
        """Types that select the compiled code."""
        return Joined, Sheaves if self.sheaves else type(None), *self.ropes[0].types

    @property
    def layout(self) -> JoinedKind:
        """Kind that arrays of a batch are made for: this one, whatever its elements."""
        ropes = tuple(rope_kind._replace(elements=0, place=()) for rope_kind in self.ropes)
        return self._replace(ropes=ropes)

    def with_elements_of(self, system: System) -> JoinedKind:
        """Return the kind of a system of this layout, with the elements that it has now."""
        pairs = zip(self.ropes, system.ropes, strict=True)
        ropes = (
            rope_kind._replace(elements=_count(rope), place=places_of(rope))
            for rope_kind, rope in pairs
        )
        return self._replace(ropes=tuple(ropes))


def why_joined_alone(system: System) -> str:
    """Return why a system cannot be stepped in a SIMD batch; empty if it can.

    Effects are given by the names used in scenes.
    """
    if config.DISABLE_JIT:
        return "plain Python"
    kinds = [type(effect) for effect in system.ropes[0].effects]
    excluded = [kind for kind in kinds if not _steps_in_lanes(kind)]
    return ", ".join(_name_of(kind) for kind in excluded)


def _count(rope: Rope) -> int:
    """Return the number of elements in use."""
    return int(rope.state.counts[ELEMENTS])


def _name_of(kind: type) -> str:
    """Return the name of an effect, or of the file that defines forces between ropes."""
    name = effect_of(kind)
    return kind.__module__.rpartition(".")[2] if name == "joined" else name


def _steps_in_lanes(kind: type) -> bool:
    """Return whether an effect of this type steps in the lanes of systems of ropes."""
    own_hull = "pull" in hooks.hooks_of(kind) and not hooks.couples([kind])  # of a lone hang-off
    each_its_own = is_by_lane(kind) and variable_count(kind) > 0
    unit = hooks.axial_index([kind]) is not None
    return hooks.is_wide(kind, "start") and not (own_hull or each_its_own or unit)


def joined_kind_of(system: System) -> JoinedKind | None:
    """Return the properties shared by systems of a batch; None if it cannot be batched."""
    if why_joined_alone(system):
        return None
    first, joints = system.ropes[0], system.joints
    effects = tuple(layout_of(effect) for effect in first.effects)
    law = None if system.stack.law is None else layout_of(_law_at(system, 0))
    kinds = tuple(
        Kind(
            elements=_count(rope),
            place=places_of(rope),
            sections=rope.sections.shape[1],
            first_free=rope.model.first_free,
            step=rope.model.step,
            absorb=rope.model.absorb,
            effects=effects,
            law=law,
            places=effect_places(rope),
        )
        for rope in system.ropes
    )
    links = zip(joints.ties[FIRST].tolist(), joints.ties[SECOND].tolist(), strict=True)
    ends = tuple(joints.lower.tolist()), tuple(joints.upper.tolist())
    return JoinedKind(kinds, *ends, tuple(links), _reeving_of(system), system.stack.s.shape[1])


def _reeving_of(system: System) -> tuple[tuple[float, ...], ...]:
    """Return connection, flow and both ropes of each sheave."""
    if system.sheaves is None:
        return ()
    rows = system.sheaves.figures[[POINT, FLOW_COLUMN, INTO, FROM]]
    return tuple(tuple(column) for column in rows.T.tolist())


def _law_at(system: System, r: int) -> Any:
    """Return the table of rope r, with as many knots as all ropes have space for."""
    law = system.stack.law
    return None if law is None else type(law)(*(table[r] for table in law))


def _part(data: Any, r: int) -> Any:
    """Return the part of arrays with the ropes in front that belongs to rope r."""
    if isinstance(data, tuple):
        parts = [_part(item, r) for item in data]
        return type(data)(*parts) if hasattr(data, "_fields") else tuple(parts)
    return None if data is None else data[r]


class JoinedGroup(Lanes):
    """Batch of up to LANES systems of one kind, with space for as many nodes as each has."""

    def __init__(self, system: System, kind: JoinedKind, steps: int, intervals: int = 0) -> None:
        """Allocate arrays for systems of this kind, as this one, and for this many steps.

        intervals: rows of each rope's `samples`, the result of a fleet in place of slack samples; 0
        for none.
        """
        count, first = len(kind.ropes), kind.ropes[0]
        super().__init__(first.effects, (count,), (steps, intervals))
        self.kind = kind.layout
        columns = system.stack.s.shape[1]
        sections = aligned(count, SECTION_ROWS, max(rope.sections for rope in kind.ropes), LANES)
        sections[:, END] = np.inf
        self._stack = LaneStack(
            model=np.zeros((count, len(Model._fields))),
            figures=aligned(count, len(OWN_FIGURES), LANES),
            nodes=aligned(count, columns, NODE_ROWS, LANES),
            s=aligned(count, columns, LANES),
            offset=aligned(count, columns, LANES),
            counts=np.zeros((count, COUNTS), np.int64),
            health=np.zeros((count, HEALTH), np.int64),
            work=aligned(count, columns, chain_rows(layout[0] for layout in first.effects), LANES),
            sections=sections,
            effects=tuple(_stacked(on_columns(layout, columns), count) for layout in first.effects),
            law=None if first.law is None else _stacked(first.law, count),
        )
        self._topology = topology_of(system, columns)
        self._joints = _new_joints(system, count)
        self._sheaves = _new_sheaves(system)
        self._ropes = [self._view(r) for r in range(count)]
        by_lane = any_by_lane(layout[0] for layout in first.effects)
        self._each: Any = self._new_each(sections.shape[2]) if by_lane else None
        self._place = np.zeros((count, columns), np.int64)
        self._held: list[System | None] = [None] * LANES  # whose properties lanes have
        self.fit(kind)

    def fit(self, kind: JoinedKind) -> None:
        """Take systems of this kind, of the same layout; lanes keep their properties."""
        if kind == self.kind:
            return
        super().fit(kind)
        counts = self._stack.counts[:, ELEMENTS]
        counts[:] = [rope_kind.elements for rope_kind in kind.ropes]
        write_plan(self._joints.plan, self._topology, counts)
        self._loaded = [
            rope_kind.elements + (up != LOOSE)
            for rope_kind, up in zip(kind.ropes, kind.upper, strict=True)
        ]
        for row, rope_kind in zip(self._place, kind.ropes, strict=True):
            row[: rope_kind.elements] = rope_kind.place

    def _view(self, r: int) -> Rope:
        """Return the arrays of rope r, and write the figures of its model that lanes share."""
        kind, stack = self.kind.ropes[r], self._stack
        figures: Any = dict(zip(OWN_FIGURES, stack.figures[r], strict=True))
        model = Model(absorb=kind.absorb, first_free=kind.first_free, step=kind.step, **figures)
        shared = {"absorb": kind.absorb, "first_free": kind.first_free, "step": kind.step}
        for name, value in shared.items():
            stack.model[r, Model._fields.index(name)] = value
        state = State(stack.nodes[r], stack.s[r], stack.offset[r], stack.counts[r], stack.health[r])
        effects, law = _part(stack.effects, r), _part(stack.law, r)
        return Rope(model, state, stack.work[r], stack.sections[r], effects, law)

    def load(self, members: Sequence[System], used: Collection[int] = range(LANES)) -> None:
        """Copy in systems of the group's kind, and clear counters and samples.

        For a system that its lane already holds, and in unused lanes, only the state is copied.
        """
        self._clear()
        for lane in range(LANES):
            system, held = members[lane if lane < len(members) else 0], self._held[lane]
            if held is system or (held is not None and lane not in used):
                self.put(lane, system)
            else:
                self._put(lane, system)
                self._held[lane] = system

    def _put(self, lane: int, system: System) -> None:
        effects = stacked_effects(system.ropes, system.stack.s.shape[1])
        for r, (wide_rope, rope) in enumerate(zip(self._ropes, system.ropes, strict=True)):
            law = _law_at(system, r)
            lone_rope = rope._replace(effects=effects_at(effects, r), law=law)
            put_properties(wide_rope, lane, lone_rope)
            if self._each is not None:
                put_lane_data(_part(self._each.effects, r), lone_rope.effects, lane)
                self._each.sections[r, lane, :, : rope.sections.shape[1]] = rope.sections
                self._each.tolerance[r, lane] = rope.model.tolerance
        self._joints.ties[..., lane] = system.joints.ties
        if self._sheaves is not None and system.sheaves is not None:
            self._sheaves.figures[..., lane] = system.sheaves.figures
            self._sheaves.base[..., lane] = system.sheaves.base
        self.put(lane, system)

    def put(self, lane: int, system: System) -> None:
        """Copy a system's state, internal variables and tensions into a lane."""
        joints, late = system.joints, 0
        self._joints.nodes[..., lane] = joints.nodes.T
        self._joints.ties[..., lane] = joints.ties
        for r, (wide_rope, rope) in enumerate(zip(self._ropes, system.ropes, strict=True)):
            n = self.kind.ropes[r].elements
            put_state(wide_rope, lane, n, rope)
            wide_rope.work[:n, TENSION, lane] = rope.work[TENSION, :n]
            for joint, node in ((joints.lower[r], 0), (joints.upper[r], n)):
                if joint != LOOSE:
                    wide_rope.state.nodes[node, :, lane] = joints.nodes[:, joint]
            self._lowest[r, lane] = rope.state.counts[LOWEST_OFFSET]
            for effect in rope.effects:
                if variable_count(type(effect)):
                    late |= int(count_initialised(effect) != self._loaded[r])
        self._late = self._late & ~(1 << lane) | late << lane

    def take(self, lane: int, system: System) -> None:
        """Copy a lane's state, internal variables and tensions back to its system."""
        system.joints.nodes[...] = self._joints.nodes[..., lane].T
        system.joints.ties[...] = self._joints.ties[..., lane]
        for r, (wide_rope, rope) in enumerate(zip(self._ropes, system.ropes, strict=True)):
            n = self.kind.ropes[r].elements
            take_state(wide_rope, lane, n, rope)
            rope.state.counts[LOWEST_OFFSET] = self._lowest[r, lane]
            rope.work[TENSION, :n] = wide_rope.work[:n, TENSION, lane]

    def _new_each(self, sections: int) -> SystemLaneData:
        """Return zeros for the data of each lane alone; sections: at most of a rope."""
        stack, count = self._stack, len(self.kind.ropes)
        ends = np.zeros((count, LANES, SECTION_ROWS, sections))
        ends[:, :, END] = np.inf
        columns = stack.s.shape[1]
        return SystemLaneData(
            work=stack.work,
            own=np.zeros((WORK_ROWS, columns)),
            s=np.zeros(columns),
            counts=stack.counts,
            health=stack.health,
            tolerance=np.zeros((count, LANES)),
            sections=ends,
            effects=tuple(
                make(layout, lambda kind, shape: np.zeros((count, LANES, *shape), kind))
                for layout in self.kind.ropes[0].effects
            ),
        )

    def advance(self, run: Run) -> tuple[int, list[int]]:
        """Advance the batch; return the step reached, and the lanes that did not complete it.

        It stops before the last step if there are such lanes.
        """
        lane_stack, known = self._stack, (self._place, self._lowest, self._tally)
        joined = Joined(lane_stack, self._joints, self._sheaves)
        tables = self.boundary, self.pulls, self.samples, run
        return advance_batch(lane_stack.effects, lane_stack.law, joined, self._each, known, *tables)


def _stacked(layout: Any, count: int) -> Any:
    """Return zeros in the layout, with the ropes on the first axis and the lanes on the last."""
    return make(layout, lambda kind, shape: aligned(count, *shape, LANES))


def _new_joints(system: System, count: int) -> Joints:
    """Return connections of all lanes; count: number of ropes."""
    joints, size = system.joints, 3 * system.joints.nodes.shape[1]
    links = joints.ties.shape[1]
    plan: Plan = new_plan(count, size // 3, 0)
    sums: Floats = aligned(SUM_ROWS, plan.sums.shape[1], LANES)
    return Joints(
        lower=joints.lower.copy(),
        upper=joints.upper.copy(),
        nodes=aligned(size // 3, NODE_ROWS, LANES),
        ties=aligned(TIE_ROWS, links, LANES),
        work=aligned(size // 3, WORK_ROWS, LANES),
        matrix=aligned(size, size, LANES),
        factor=aligned(size, size, LANES),
        speed=aligned(count, LANES),
        plan=plan._replace(sums=sums),
    )


def _new_sheaves(system: System) -> Sheaves | None:
    """Return sheaves of all lanes, without the figures that differ from lane to lane."""
    sheaves = system.sheaves
    if sheaves is None:
        return None
    count = len(sheaves.of)
    return Sheaves(
        figures=aligned(*sheaves.figures.shape, LANES),
        of=sheaves.of.copy(),
        side=sheaves.side.copy(),
        base=aligned(count, LANES),
        way=aligned(3, count, LANES),
        borders=Boundary(*(aligned(*part.shape, LANES) for part in sheaves.borders)),
    )
