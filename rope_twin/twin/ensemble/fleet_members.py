"""Members of a fleet: states, inputs, results, and what ropes and systems have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.jit.wide import LANES
from rope_twin.core.joined.joints import System
from rope_twin.core.lanes.batch import Lanes
from rope_twin.core.state import Boundary, Floats, Ints, Rope, State
from rope_twin.errors import InputError
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.scratch import Scratch
from rope_twin.twin.figures import FIGURES
from rope_twin.twin.regrid import state_arrays


@dataclass(frozen=True)
class LiveState:
    """Copy of a twin's rope between two steps."""

    scene: Scene
    time_ns: int
    rope: Rope  # state of the nodes in use and own effects; `work` is the tension, (elements,)
    pull_n: Floats  # force of the rope on its upper end, (3,) x, y, z
    payout_m_per_s: float
    loaded: bool = False  # whether the upper end carries loads: a connection does
    others: tuple[LiveState, ...] = ()  # other ropes of the scene, in its order
    joints: Floats | None = None  # motion of the connections, (rows.NODE_ROWS, joints)

    @property
    def line_out_m(self) -> float:
        """Unstretched length of the rope [m], of one from a winch the line out."""
        return float(self.rope.state.s[self.rope.state.counts[rows.ELEMENTS]])


@dataclass(frozen=True)
class FleetState:
    """State of one member, for `Fleet.restore`."""

    time_ns: int
    rope: State  # of the main winch's rope
    memories: tuple[Floats, ...] = ()  # internal variables of the effects, rope by rope
    others: tuple[State, ...] = ()  # of the other ropes, in multi-line systems
    joints: Floats | None = None  # motion of their connections, (rows.NODE_ROWS, joints)


@dataclass(frozen=True)
class FleetInputs:
    """Motion at the step boundaries, of which the first is the present.

    Each is (steps + 1,) for all members, or (steps + 1, members). All hang-offs have this heave.
    """

    heave_m: Floats  # height of the hang-offs relative to their rest
    heave_rate_m_per_s: Floats
    line_out_m: Floats  # of the main winch
    line_speed_m_per_s: Floats
    # line out and line speed of other winches, by the name of their hang-off; a winch that is not
    # named stands still
    lines: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)


@dataclass(frozen=True)
class FleetRecord:
    """Results of `Fleet.advance`. The last interval may be shorter than the others.

    In multi-line systems the payload is the rigid body of the scene, or else its first payload; its
    tension is that of the first rope that ends there.
    """

    top_tension_n: Floats  # of the main winch's rope at the end of each step, (steps, members)
    min_tension_n: Floats  # of any element of any rope over each interval, (intervals, members)
    payload_depth_m: Floats  # at the end of each interval, (intervals, members), positive down
    payload_speed_m_per_s: Floats  # vertical, likewise, positive down
    payload_tension_n: Floats  # of the lowest element, likewise
    failures: Mapping[int, str]  # members that failed and why; their values are then NaN
    suspended_tension_n: Mapping[
        str, Floats
    ]  # as top_tension_n, of each rope from a hang-off, by name


class BoundarySeries(NamedTuple):
    """Boundary conditions at the step boundaries, (steps + 1,) or (steps + 1, members) each."""

    z_m: Floats  # height of the hang-off
    z_rate: Floats
    line_out_m: Floats
    line_speed: Floats

    def fill(self, boundary: Boundary, members: Ints, first: int) -> None:
        """Set heave and line out of lanes from step boundary `first` on.

        boundary: (boundaries, MOTIONS, lanes).
        """
        (value, rate), count = boundary, len(members)
        steps = slice(first, first + len(value))
        columns = (value, rows.Z), (rate, rows.Z), (value, rows.LINE), (rate, rows.LINE)
        for (table, column), series in zip(columns, self, strict=True):
            values = series[steps]
            table[:, column, :count] = values[:, members] if values.ndim > 1 else values[:, None]
            if count < table.shape[2]:
                table[:, column, count:] = table[:, column, :1]


class Members(ABC):
    """Members of one scene and mesh."""

    lead: tuple[int, ...]  # axes of results before their own: none, or the ropes
    from_ship: tuple[int, ...]  # numbers of the ropes from a hang-off, the main winch's first
    payload: int = 0  # number of the rope whose lower end is the payload

    def __init__(self, scene: Scene, ropes: Sequence[Rope], count: int) -> None:
        """Store the scene, its ropes with the scene's figures, and the number of members."""
        self.scene = scene
        self.count = count
        self.step_s = ropes[0].model.step
        self.factors: dict[str, Floats] = {name: np.ones(count) for name in FIGURES}
        self.failures: dict[int, str] = {}  # members that failed, and why
        # coordinates of the nodes at the scene's length, of each rope
        self.marks_m = [
            rope.state.s[: rope.state.counts[rows.ELEMENTS] + 1].copy() for rope in ropes
        ]

    @property
    def running(self) -> list[int]:
        """Members that have not failed."""
        return [k for k in range(self.count) if k not in self.failures]

    @property
    @abstractmethod
    def ropes(self) -> tuple[Rope, ...]:
        """Ropes of a member with the scene's figures; their state is not in use."""

    def check(self, given: FleetState) -> None:
        """Check that a state fits the members.

        Raises:
            InputError: it does not.
        """
        remedy = "give states of a fleet of this scene and mesh"
        states, ropes = (given.rope, *given.others), self.ropes
        if len(states) != len(ropes):
            raise InputError("fleet", f"a state of {len(states)} ropes, not {len(ropes)}", remedy)
        for state, rope in zip(states, ropes, strict=True):
            if state.nodes.shape != rope.state.nodes.shape:
                capacity = rope.state.nodes.shape[1]
                problem = f"a state with space for {state.s.size} nodes, not {capacity}"
                raise InputError("fleet", problem, remedy)
        count = sum(len(state_arrays(rope.effects)) for rope in ropes)
        if len(given.memories) != count:
            problem = f"a state with {len(given.memories)} internal variables, not {count}"
            remedy = "give states that `Fleet.state` returned for this scene"
            raise InputError("fleet", problem, remedy)

    # Steps

    @abstractmethod
    def kind_of(self, member: int) -> Any:
        """Return the properties that members in lanes must share; None: it is stepped alone."""

    def groups_by_kind(self, members: Ints) -> Iterator[Ints]:
        """Yield groups of members of one kind: at most as many as there are lanes, or one alone."""
        kinds: dict[Any, list[int]] = {}
        for k in members.tolist():
            kinds.setdefault(self.kind_of(k) or k, []).append(k)
        for same_kind in kinds.values():
            for first in range(0, len(same_kind), LANES):
                yield np.array(same_kind[first : first + LANES], dtype=np.int64)

    @abstractmethod
    def alone(self, member: int, scratch: Scratch) -> Rope | System:
        """Return a member's rope or system, which shares its state with the fleet."""

    @abstractmethod
    def place(self, boundary: Boundary, members: Ints) -> None:
        """Keep x and y of the hang-offs of lanes; boundary: (..., boundaries, MOTIONS, lanes)."""

    def load(self, group: Lanes, members: Ints, lanes: list[int], scratch: Scratch) -> None:
        """Copy members into a group, and clear its counters and samples; lanes: those in use."""
        group.load([self.alone(k, scratch) for k in members.tolist()], lanes)

    def take(self, group: Lanes, members: Ints, lanes: list[int], scratch: Scratch) -> None:
        """Copy the states of these lanes back to their members, with solver counts."""
        for lane in lanes:
            group.take(lane, self.alone(int(members[lane]), scratch))
