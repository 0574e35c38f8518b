"""Members of a fleet that are multi-line systems.

Each has arrays of its own, all copies of one system in static equilibrium. Members of one kind step
in lanes (core/lanes/joined_group), the others by themselves.

A figure scales all ropes of a system equally: weight, mass and drag of the loads at their lower
ends, stiffness, damping and tangential drag of the ropes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.joined.joints import LOOSE, System
from rope_twin.core.lanes.joined_group import JoinedKind, joined_kind_of, why_joined_alone
from rope_twin.core.state import Boundary, Floats, Ints, Rope
from rope_twin.errors import InputError
from rope_twin.scene.rigging import payload_rope, places
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet_members import (
    BoundarySeries,
    FleetInputs,
    FleetState,
    LiveState,
    Members,
)
from rope_twin.twin.ensemble.live_state import on_mesh
from rope_twin.twin.ensemble.member import element_changes
from rope_twin.twin.ensemble.scratch import Scratch
from rope_twin.twin.figures import scaled_law, scaled_rope
from rope_twin.twin.multi_line import MultiLineRopes
from rope_twin.twin.regrid import joined_as, own_copies, state_arrays


class SystemBoundarySeries(NamedTuple):
    """Boundary conditions of the ropes from a hang-off, by number; the main winch's is the first.

    Tables have the ropes as their first axis.
    """

    by_rope: dict[int, BoundarySeries]

    @property
    def line_out_m(self) -> Floats:
        """Line out of the main winch [m]."""
        return self.by_rope[0].line_out_m

    def fill(self, boundary: Boundary, members: Ints, first: int) -> None:
        """Set heave and line out of lanes from step boundary `first` on."""
        for r, series in self.by_rope.items():
            series.fill(Boundary(boundary.value[r], boundary.rate[r]), members, first)


def _copy_of(system: System) -> System:
    """Return a system with arrays of its own."""
    return joined_as(
        system, [rope._replace(effects=own_copies(rope.effects)) for rope in system.ropes]
    )


def _internal_variables(system: System) -> list[Floats]:
    """Return the internal variables of all effects, rope by rope, not copied."""
    return [array for rope in system.ropes for array in state_arrays(rope.effects)]


class SystemMembers(Members):
    """Systems of one scene and mesh."""

    def __init__(self, scene: Scene, count: int) -> None:
        """Begin in static equilibrium.

        Raises:
            SceneError: the scene cannot be built, or has no static equilibrium.
        """
        built = MultiLineRopes(scene, 1)
        built.solve_statics()
        self._base = _copy_of(built.system(built.first))
        super().__init__(scene, self._base.ropes, count)
        self.lead = (len(self._base.ropes),)
        self.from_ship = tuple(np.flatnonzero(self._base.joints.upper == LOOSE).tolist())
        self.payload = payload_rope(scene)
        self._systems = [_copy_of(self._base) for _ in range(count)]
        self._kind = joined_kind_of(self._base)  # of all, whatever their elements
        self._kinds: dict[int, tuple[int, JoinedKind]] = {}

    @property
    def ropes(self) -> tuple[Rope, ...]:
        """The ropes of a member."""
        return self._base.ropes

    @property
    def why_alone(self) -> str:
        """Reason why members do not step in lanes; "": they do."""
        return why_joined_alone(self._base)

    def scale(self) -> None:
        """Apply the factors to the kernel data."""
        for k, system in enumerate(self._systems):
            factors = {name: float(value[k]) for name, value in self.factors.items()}
            ropes = []
            for base, rope in zip(self._base.ropes, system.ropes, strict=True):
                scaled = scaled_rope(base, factors, rope.effects)
                rope.sections[:] = scaled.sections
                ropes.append(rope._replace(effects=scaled.effects, law=scaled.law))
            law = scaled_law(self._base.stack.law, factors["axial_stiffness"])
            self._systems[k] = system._replace(
                ropes=tuple(ropes), stack=system.stack._replace(law=law)
            )

    def state(self, member: int, time_ns: int) -> FleetState:
        """Return a copy of a member's state."""
        system = self._systems[member]
        first, *others = (rope.state.copy() for rope in system.ropes)
        memories = tuple(array.copy() for array in _internal_variables(system))
        return FleetState(time_ns, first, memories, tuple(others), system.joints.nodes.copy())

    def restore(self, states: Sequence[FleetState]) -> None:
        """Set states that fit: one for all members, or one for each."""
        self._kinds.clear()
        for k, system in enumerate(self._systems):
            saved = states[min(k, len(states) - 1)]
            for rope, state in zip(system.ropes, (saved.rope, *saved.others), strict=True):
                for array, part in zip(rope.state, state, strict=True):
                    array[...] = part
            system.joints.nodes[:] = saved.joints
            for array, values in zip(_internal_variables(system), saved.memories, strict=True):
                array[...] = values

    def check(self, given: FleetState) -> None:
        """Check that a state fits the members.

        Raises:
            InputError: it does not.
        """
        super().check(given)
        if given.joints is None or given.joints.shape != self._base.joints.nodes.shape:
            remedy = "give states of a fleet of this scene and mesh"
            raise InputError("fleet", "a state of other connections", remedy)

    def begin_from(self, live: LiveState) -> None:
        """Set the state of a live twin, on the members' own mesh; that of connections is unchanged.

        Raises:
            InputError: the state is that of another scene.
        """
        live_ropes, joints = (live, *live.others), live.joints
        shape = self._base.joints.nodes.shape
        if len(live_ropes) != len(self.ropes) or joints is None or joints.shape != shape:
            problem = f"the live state is that of a twin of '{live.scene.name}', with other ropes"
            raise InputError("fleet", problem, "begin from a twin of the fleet's scene")
        ropes = zip(live_ropes, self.ropes, self.marks_m, strict=True)
        states, effects = zip(*(on_mesh(*arguments) for arguments in ropes), strict=True)
        self._base = _with_effects(self._base, effects)
        self._kind = joined_kind_of(self._base)
        self._systems = [
            _with_effects(system, [own_copies(rope_effects) for rope_effects in effects])
            for system in self._systems
        ]
        self.scale()
        memories = tuple(_internal_variables(self._base))
        first, *others = states
        self.restore([FleetState(live.time_ns, first, memories, tuple(others), joints)])

    def ends(self, r: int) -> tuple[Floats, Floats]:
        """Return coordinates of the uppermost node of rope r and the one below [m], (members,)."""
        states = [system.ropes[r].state for system in self._systems]
        pairs = [
            state.s[state.counts[rows.ELEMENTS] - 1 : state.counts[rows.ELEMENTS] + 1]
            for state in states
        ]
        below, top = np.array(pairs).T
        return top, below

    def boundaries(self, inputs: FleetInputs) -> SystemBoundarySeries:
        """Return the boundary conditions of valid inputs; winches without inputs stand still."""
        heave = np.asarray(inputs.heave_m, dtype=float)
        rate = np.asarray(inputs.heave_rate_m_per_s, dtype=float)
        from_ship, positions = {}, places(self.scene)
        for r in self.from_ship:
            name = self.scene.ropes[r].from_
            if r == 0:
                line = inputs.line_out_m, inputs.line_speed_m_per_s
            elif name in inputs.lines:
                line = inputs.lines[name]
            else:
                held_m = np.broadcast_to(self.ends(r)[0], (len(heave), self.count))
                line = held_m, np.zeros(len(heave))
            out, speed = (np.asarray(series, dtype=float) for series in line)
            from_ship[r] = BoundarySeries(positions[name][2] + heave, rate, out, speed)
        return SystemBoundarySeries(from_ship)

    # Steps

    def alone(self, member: int, scratch: Scratch) -> System:
        """Return a member's system."""
        return self._systems[member]

    def kind_of(self, member: int) -> JoinedKind | None:
        """Return the properties that members in lanes must share; None: it is stepped alone."""
        if self._kind is None:
            return None
        system = self._systems[member]
        changes = element_changes(system.ropes)
        known = self._kinds.get(member)
        if known is None or known[0] != changes:
            known = self._kinds[member] = changes, self._kind.with_elements_of(system)
        return known[1]

    def place(self, boundary: Boundary, members: Ints) -> None:
        """Keep x and y of the hang-offs of lanes; boundary: (ropes, boundaries, MOTIONS, lanes)."""
        count = len(members)
        for r in self.from_ship:
            states = [self._systems[k].ropes[r].state for k in members.tolist()]
            tops = [state.nodes[: rows.Z, state.counts[rows.ELEMENTS]] for state in states]
            nodes = np.array(tops).T
            boundary.value[r, :, : rows.Z, :count] = nodes
            boundary.value[r, :, : rows.Z, count:] = nodes[:, :1]


def _with_effects(system: System, effects: Sequence[tuple[Any, ...]]) -> System:
    """Return the system with other effects of each rope."""
    pairs = zip(system.ropes, effects, strict=True)
    return system._replace(
        ropes=tuple(rope._replace(effects=rope_effects) for rope, rope_effects in pairs)
    )
