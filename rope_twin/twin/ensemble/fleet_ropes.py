"""Members of a fleet that are one rope each.

Their states are arrays with the members as the first axis. Lanes are filled from them
(`Group.begin_stacked`); a member that takes a step alone does it on views of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.lanes.batch import Lanes
from rope_twin.core.lanes.group import Group, Kind, kind_of, why_alone
from rope_twin.core.state import Boundary, Floats, Ints, Rope, State
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet_members import (
    BoundarySeries,
    FleetInputs,
    FleetState,
    LiveState,
    Members,
)
from rope_twin.twin.ensemble.live_state import on_mesh
from rope_twin.twin.ensemble.scratch import Scratch
from rope_twin.twin.figures import scaled_rope, stacked_effects, stacked_sections
from rope_twin.twin.regrid import has_state, own_copies, state_arrays
from rope_twin.twin.statics import solve_scene_statics


class RopeMembers(Members):
    """Ropes of one scene and mesh."""

    lead = ()
    from_ship = (0,)

    def __init__(self, scene: Scene, count: int) -> None:
        """Begin in static equilibrium.

        Raises:
            SceneError: the scene cannot be built, or has no static equilibrium.
        """
        rope = build(scene)
        solve_scene_statics(scene, rope)
        super().__init__(scene, (rope,), count)
        self._rope = rope
        parts: Any = (np.repeat(part[None], count, 0) for part in rope.state)
        self._states = State(*parts)
        self._effects: list[tuple[Any, ...]] = []  # of each member; empty: all share the rope's
        self._use_effects(rope.effects)

    @property
    def ropes(self) -> tuple[Rope, ...]:
        """The rope of a member."""
        return (self._rope,)

    @property
    def _have_state(self) -> bool:
        """Whether effects have internal variables."""
        return any(has_state(effect) for effect in self._rope.effects)

    @property
    def why_alone(self) -> str:
        """Reason why members do not step in lanes; "": they do."""
        return why_alone(self._rope)

    def _use_effects(self, effects: tuple[Any, ...]) -> None:
        """Use effects with other data for all members, with their internal variables."""
        self._rope = self._rope._replace(effects=effects)
        self._effects = [own_copies(effects) for _ in range(self.count)] if self._have_state else []
        self.scale()

    def scale(self) -> None:
        """Apply the factors to the kernel data."""
        kind = kind_of(self._rope)
        sections = stacked_sections(self._rope.sections, self.factors)
        effects = stacked_effects(self._rope.effects, self.factors) if kind and kind.plain else ()
        self._kind, self._alone = kind, dict[int, Rope]()
        self._stack = self._rope._replace(state=self._states, sections=sections, effects=effects)

    def state(self, member: int, time_ns: int) -> FleetState:
        """Return a copy of a member's state."""
        memories = tuple(array.copy() for array in state_arrays(self._effects_of(member)))
        return FleetState(time_ns, self._state_of(member).copy(), memories)

    def restore(self, states: Sequence[FleetState]) -> None:
        """Set states that fit: one for all members, or one for each."""
        if len(states) == 1:
            self._set_all(states[0].rope)
        else:
            for k, state in enumerate(states):
                for array, part in zip(self._states, state.rope, strict=True):
                    array[k] = part
        for k, effects in enumerate(self._effects):
            memories = states[min(k, len(states) - 1)].memories
            for array, saved in zip(state_arrays(effects), memories, strict=True):
                array[...] = saved

    def begin_from(self, live: LiveState) -> None:
        """Set the state of a live twin, on the members' own mesh.

        Raises:
            InputError: the state is that of another scene.
        """
        state, effects = on_mesh(live, self._rope, self.marks_m[0])
        self._use_effects(effects)
        self._set_all(state)

    def ends(self, r: int) -> tuple[Floats, Floats]:
        """Return coordinates of the uppermost node and the one below [m], (members,)."""
        every_member, s = np.arange(self.count), self._states.s
        top = self._states.counts[:, rows.ELEMENTS]
        return s[every_member, top], s[every_member, top - 1]

    def boundaries(self, inputs: FleetInputs) -> BoundarySeries:
        """Return the boundary conditions of valid inputs."""
        return BoundarySeries(
            self.scene.ship.hang_off_m[2] + np.asarray(inputs.heave_m, dtype=float),
            np.asarray(inputs.heave_rate_m_per_s, dtype=float),
            np.asarray(inputs.line_out_m, dtype=float),
            np.asarray(inputs.line_speed_m_per_s, dtype=float),
        )

    def _set_all(self, state: State) -> None:
        """Set one state for all members."""
        for array, part in zip(self._states, state, strict=True):
            array[:] = part

    def _state_of(self, member: int) -> State:
        """Return views of a member's state."""
        return State(*(part[member] for part in self._states))

    def _effects_of(self, member: int) -> tuple[Any, ...]:
        """Return the effects that hold a member's internal variables."""
        return self._effects[member] if self._effects else self._rope.effects

    # Steps

    def alone(self, member: int, scratch: Scratch) -> Rope:
        """Return a member's rope, which shares its state and internal variables with the fleet."""
        rope, work = self._alone.get(member), scratch.work(self._rope.work.shape)
        if rope is None:
            factors = {name: float(value[member]) for name, value in self.factors.items()}
            rope = scaled_rope(self._rope, factors, self._effects_of(member))
            rope = rope._replace(state=self._state_of(member))
        if rope.work is not work:
            rope = self._alone[member] = rope._replace(work=work)
        return rope

    def kind_of(self, member: int) -> Kind | None:
        """Return the properties that members in lanes must share; None: it is stepped alone."""
        if self._kind is None:
            return None
        elements = int(self._states.counts[member, rows.ELEMENTS])
        if not self._kind.place and elements > 1:
            return self._kind._replace(elements=elements)
        return kind_of(self._rope._replace(state=self._state_of(member)))

    def load(self, group: Lanes, members: Ints, lanes: list[int], scratch: Scratch) -> None:
        """Copy members into a group, and clear its counters and samples; lanes: those in use."""
        if isinstance(group, Group) and group.kind.plain:
            group.begin_stacked(self._stack, members)
        else:
            super().load(group, members, lanes, scratch)

    def place(self, boundary: Boundary, members: Ints) -> None:
        """Keep x and y of the hang-offs of lanes; boundary: (boundaries, MOTIONS, lanes)."""
        top, count = self._states.counts[members, rows.ELEMENTS], len(members)
        nodes = self._states.nodes[members, : rows.Z, top].T
        boundary.value[:, : rows.Z, :count] = nodes
        boundary.value[:, : rows.Z, count:] = nodes[:, :1]

    def take(self, group: Lanes, members: Ints, lanes: list[int], scratch: Scratch) -> None:
        """Copy the states of these lanes back to their members, with solver counts."""
        if isinstance(group, Group) and group.kind.plain:
            chosen = np.array(lanes, dtype=np.int64)
            group.take_stacked(self._states, members[chosen], chosen)
        else:
            super().take(group, members, lanes, scratch)
