"""States, inputs and results of a fleet's members, and the state of a live twin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope, State
from rope_twin.scene.schema import Scene


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
    others: tuple[State, ...] = ()  # of the other ropes, where ropes meet
    joints: Floats | None = None  # motion of their connections, (rows.NODE_ROWS, joints)


@dataclass(frozen=True)
class FleetInputs:
    """Motion at the step borders, the first being the present.

    Each is (steps + 1,) for all members, or (steps + 1, members). All hang-offs heave alike.
    """

    heave_m: Floats  # height of the hang-offs relative to their rest
    heave_rate_m_per_s: Floats
    line_out_m: Floats  # of the main winch
    line_speed_m_per_s: Floats
    # line out and line speed of other winches, by the name of their hang-off; one that is not
    # named holds the line that it has out
    lines: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)


@dataclass(frozen=True)
class FleetRecord:
    """Results of `Fleet.advance`. A last look may be shorter than the others.

    Where ropes meet the payload is the rigid body of the scene, else its first payload; its tension
    is that of the first rope that ends there.
    """

    top_tension_n: Floats  # of the main winch's rope at the end of each step, (steps, members)
    least_tension_n: Floats  # of any element of any rope over each look, (looks, members)
    payload_depth_m: Floats  # at the end of each look, (looks, members), positive down
    payload_speed_m_per_s: Floats  # vertical, likewise, positive down
    payload_tension_n: Floats  # of the lowest element, likewise
    failures: Mapping[int, str]  # members that failed and why; their values are then NaN
    hung_tension_n: Mapping[str, Floats]  # as top_tension_n, of each rope from a hang-off, by name
