"""Arrays of systems of ropes that are stepped as a SIMD batch, and copying in and out."""

from __future__ import annotations

from collections.abc import Iterable
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
from rope_twin.core.lanes.batch import OWN_FIGURES, Lanes, Unbatched, new_each
from rope_twin.core.lanes.effects import (
    LaneData,
    SystemLaneData,
    aligned,
    any_by_lane,
    is_by_lane,
    make_wide,
)
from rope_twin.core.lanes.group import (
    Group,
    Kind,
    effect_of,
    new_kind,
    on_columns,
    places_of,
)
from rope_twin.core.loads import hooks
from rope_twin.core.loads.memory import variable_count
from rope_twin.core.state import (
    COUNTS,
    ELEMENTS,
    END,
    HEALTH,
    NODE_ROWS,
    SECTION_ROWS,
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
            rope_kind._replace(elements=int(rope.state.counts[ELEMENTS]), place=places_of(rope))
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
    return ", ".join(effect_of(kind) for kind in excluded)


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
    law = _law_at(system, 0)
    kinds = tuple(new_kind(rope, first.effects, law) for rope in system.ropes)
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
        super().__init__((count,), steps, intervals)
        self.kind, self._types = kind.layout, kind.types
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
            effects=tuple(
                make_wide(on_columns(layout, columns), (count,)) for layout in first.effects
            ),
            law=None if first.law is None else make_wide(first.law, (count,)),
        )
        self._topology = topology_of(system, columns)
        self._joints = _new_joints(system, count)
        self._sheaves = _new_sheaves(system)
        self._arrays = Joined(self._stack, self._joints, self._sheaves)
        self._ropes = [self._view(r) for r in range(count)]
        if any_by_lane(layout[0] for layout in first.effects):
            self._each = each = new_each(SystemLaneData, self._stack, (count,), first.effects)
            self._each_rope = [
                LaneData(
                    each.work[r], each.own, each.s, each.counts[r], each.health[r],
                    each.tolerance[r], each.sections[r], _part(each.effects, r),
                )
                for r in range(count)
            ]  # fmt: skip
        self.fit(kind)

    def fit(self, kind: JoinedKind) -> None:
        """Take systems of this kind, of the same layout; lanes keep their properties."""
        if kind == self.kind:
            return
        super().fit(kind)
        self._elements = [rope_kind.elements for rope_kind in kind.ropes]
        counts = self._stack.counts[:, ELEMENTS]
        counts[:] = self._elements
        write_plan(self._joints.plan, self._topology, counts)
        ends = zip(self._elements, kind.upper, strict=True)
        self._loaded = [elements + (up != LOOSE) for elements, up in ends]

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

    def _own(self, member: System) -> Iterable[Rope]:
        effects = stacked_effects(member.ropes, member.stack.s.shape[1])
        for r, rope in enumerate(member.ropes):
            yield rope._replace(effects=effects_at(effects, r), law=_law_at(member, r))

    def _put_properties(self, lane: int, member: System) -> None:
        super()._put_properties(lane, member)
        if self._sheaves is not None and member.sheaves is not None:
            self._sheaves.figures[..., lane] = member.sheaves.figures
            self._sheaves.base[..., lane] = member.sheaves.base

    def put(self, lane: int, member: System) -> None:
        """Copy a system's state, internal variables and tensions into a lane."""
        super().put(lane, member)
        joints = member.joints
        self._joints.nodes[..., lane] = joints.nodes.T
        self._joints.ties[..., lane] = joints.ties
        for arrays, n, low, up in zip(
            self._ropes, self._elements, joints.lower, joints.upper, strict=True
        ):
            for joint, node in ((low, 0), (up, n)):
                if joint != LOOSE:
                    arrays.state.nodes[node, :, lane] = joints.nodes[:, joint]

    def take(self, lane: int, member: System) -> None:
        """Copy a lane's state, internal variables and tensions back to its system."""
        super().take(lane, member)
        member.joints.nodes[...] = self._joints.nodes[..., lane].T
        member.joints.ties[...] = self._joints.ties[..., lane]


def new_group(kind: Any, member: Rope | System, steps: int, intervals: int = 0) -> Lanes:
    """Return arrays for members of this kind, as this one; kind None: they are not batched."""
    if kind is None:
        return Unbatched(member, steps, intervals)
    if isinstance(member, Rope):
        return Group(kind, steps, intervals)
    return JoinedGroup(member, kind, steps, intervals)


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
