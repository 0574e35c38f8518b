"""Construction of a Snapshot (hang-off first) from the solver's arrays (payload first)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body import state as at
from rope_twin.core.body.components import deck_forces
from rope_twin.core.body.loads import component_of
from rope_twin.core.body.state import Deck, RigidBody
from rope_twin.core.body.step import Pose, pose_of, pulls_of
from rope_twin.core.loads.balance import lower_end_tension
from rope_twin.core.loads.hooks import factors_at
from rope_twin.core.state import Boundary, Ints, Rope, State
from rope_twin.effects.compensator import Compensator, forces
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.twin.motion.heave_track import ramp
from rope_twin.twin.snapshot import (
    BodySnapshot,
    CompensatorSnapshot,
    RopeSnapshot,
    RopeStrength,
    Snapshot,
    SolverHealth,
    Vector,
    amended,
)


class Extremes:
    """Maximum, mean and minimum of a series that arrives in batches."""

    def __init__(self) -> None:
        self.high, self.low = -np.inf, np.inf
        self._sum, self._count = 0.0, 0

    def take(self, values: list[float]) -> None:
        """Add values."""
        if values:
            self.high = max(self.high, *values)
            self.low = min(self.low, *values)
            self._sum = reduce(add, values, self._sum)  # independent of the division into batches
            self._count += len(values)

    @property
    def mean(self) -> float:
        """Mean of all values; NaN if there are none."""
        return self._sum / self._count if self._count else float("nan")

    @property
    def empty(self) -> bool:
        """Whether no value was added."""
        return self._count == 0


@dataclass(frozen=True)
class RunStatistics:
    """Statistics of a run since its start."""

    steps: int
    computing_s: float
    real_time_factor: float  # simulated time over computing time; 0 before the first step
    tension_top_max_n: float
    tension_top_mean_n: float
    tension_top_min_n: float


def rope_snapshot(
    name: str,
    rope: Rope,
    ends_n: tuple[float, float],
    line: tuple[float, float],
    *,
    from_sheave: bool = False,
) -> RopeSnapshot:
    """Return the state of a rope, which shares no memory with the solver.

    ends_n: tension at its lower and upper end [N]; line: unstretched length [m] and its rate [m/s];
    from_sheave: whether the upper end is its first node in the core, as where it ends at a sheave.
    """
    n = int(rope.state.counts[rows.ELEMENTS])
    downward = slice(None) if from_sheave else slice(None, None, -1)
    tension, (lower_n, upper_n) = rope.work[rows.TENSION, :n], ends_n
    interior = 0.5 * (tension[1:] + tension[:-1])
    return RopeSnapshot(
        name=name,
        node_position_m=_node_vectors(rope.state, rows.POSITION, downward),
        node_tension_n=np.concatenate(([lower_n], interior, [upper_n]))[downward].copy(),
        element_tension_n=tension[downward].copy(),
        tension_top_n=upper_n,
        line_out_m=line[0],
        payout_speed_m_per_s=line[1],
    )


def _node_vectors(state: State, first: int, order: slice) -> Vector:
    """Return the vectors in three rows of the state from `first` on, nodes in order, (nodes, 3)."""
    nodes = state.nodes[first : first + 3, : int(state.counts[rows.ELEMENTS]) + 1]
    return np.ascontiguousarray(nodes[:, order].T)


def build_snapshot(
    scene: Scene,
    rope: Rope,
    boundary: Boundary,
    pull: Vector,
    at: tuple[int, int],
    top: tuple[Extremes, Extremes],
    ship_moves: bool = True,
) -> Snapshot:
    """Return a Snapshot of the first rope that shares no memory with the solver.

    Args:
        scene: the scene.
        rope: its first rope, with the effects in use.
        boundary: hang-off [m], line out [m] and their rates now [m/s], (rows.MOTIONS,) each.
        pull: magnitude and vector of the force on the hang-off [N], (rows.PULL_COLUMNS,).
        at: time since the start [ns], and number of steps.
        top: tension there since the start, and since the previous snapshot.
        ship_moves: by the scene's sea or by samples; else nothing builds up.
    """
    (stamp_ns, step), (run, recent), ship = at, top, scene.ship
    time_s, state, upper_n = stamp_ns * 1e-9, rope.state, float(pull[rows.PULL])
    lower_n = lower_end_tension(rope, rope.effects, time_s)
    line = float(boundary.value[rows.LINE]), float(boundary.rate[rows.LINE])
    first = rope_snapshot(scene.ropes[0].name, rope, (lower_n, upper_n), line)
    n = len(first.element_tension_n)
    low_n, high_n = (upper_n, upper_n) if recent.empty else (recent.low, recent.high)
    max_n = max(run.high, upper_n)
    return Snapshot(
        stamp_ns=stamp_ns,
        step=step,
        step_s=rope.model.step,
        node_position_m=first.node_position_m,
        node_velocity_m_per_s=_node_vectors(state, rows.VELOCITY, slice(None, None, -1)),
        node_tension_n=first.node_tension_n,
        element_tension_n=first.element_tension_n,
        arc_length_m=(state.s[n] - state.s[: n + 1])[::-1].copy(),
        tension_top_n=upper_n,
        tension_top_min_n=low_n,
        tension_top_max_n=high_n,
        hang_off_force_n=pull[rows.PULL_X :].copy(),
        tension_payload_n=lower_n,
        hang_off_position_m=boundary.value[: rows.LINE].copy(),
        hang_off_velocity_m_per_s=boundary.rate[: rows.LINE].copy(),
        heave_m=float(boundary.value[rows.Z] - ship.hang_off_m[2]),
        payload_position_m=state.nodes[rows.POSITION : rows.POSITION + 3, 0].copy(),
        payload_velocity_m_per_s=state.nodes[rows.VELOCITY : rows.VELOCITY + 3, 0].copy(),
        line_out_m=first.line_out_m,
        payout_speed_m_per_s=first.payout_speed_m_per_s,
        fluid_factors=factors_at(rope.effects, time_s),
        motion_ramp=ramp(time_s, ship.motion_ramp_s)[0] if ship_moves else 1.0,
        solver=_solver_health(state.health),
        strength=(strength_of(scene.ropes[0], max_n, rope),),
    )


def strength_of(line: RopeLine, max_n: float, rope: Rope) -> RopeStrength:
    """Return a rope's maximum tension and MBL; max_n: maximum at its top since the start [N].

    Of several sections it is the one with the highest utilisation along the rope at present.
    """
    n = int(rope.state.counts[rows.ELEMENTS])
    tension_n = rope.work[rows.TENSION, :n]
    top_n = float(max_n)
    peak_n = max(top_n, float(tension_n.max()))
    if len(line.made_of) == 1:
        return RopeStrength(line.name, peak_n, line.breaking_load_n, top_max_n=top_n)
    s = rope.state.s[: n + 1]
    mbl_n = np.array([section.rope.breaking_load_n for section in line.made_of])
    number = np.searchsorted(rope.sections[rows.END], 0.5 * (s[1:] + s[:-1]), side="right")
    mbl_n = mbl_n[np.minimum(number, len(mbl_n) - 1)]
    most = int(np.argmax(tension_n / mbl_n))
    carried_n = float(tension_n[most])
    mbl_n_there = float(mbl_n[most])
    return RopeStrength(line.name, peak_n, mbl_n_there, section_n=carried_n, top_max_n=top_n)


def _solver_health(health: Ints) -> SolverHealth:
    counts = health.tolist()
    return SolverHealth(
        steps=counts[rows.STEPS],
        solves=counts[rows.SOLVES],
        solves_max_per_stage=counts[rows.SOLVES_MAX],
        substeps=counts[rows.SUBSTEPS],
        substeps_max_per_step=counts[rows.SUBSTEPS_MAX],
        rejected_substeps=counts[rows.REJECTED],
        unconverged_substeps=counts[rows.SUBSTEPS_UNCONVERGED],
        splits=counts[rows.SPLITS],
        merges=counts[rows.MERGES],
    )


def body_of(rope: Rope) -> RigidBody | None:
    """Return the rigid body at the lower end of a rope, if its payload is one."""
    bodies = (effect for effect in rope.effects if isinstance(effect, RigidBody))
    return next((body for body in bodies if body.here), None)


def deck_contact(body: RigidBody, pose: Pose) -> tuple[float, float] | None:
    """Return the reaction of the deck on a body [N], and how far the body is above it [m].

    None: there is no deck.
    """
    deck = component_of(body, Deck)
    if deck is None:
        return None
    clearance_m = float(pose.place(body.corners)[:, 2].min() - body.stage[at.DECK_Z])
    return float(deck_forces(deck, body, pose)[:, 2].sum()), clearance_m


def payload_depth_m(rope: Rope) -> float:
    """Return the depth of a rope's lower end, or of the centre of the rigid body there [m]."""
    body = body_of(rope)
    if body is not None:
        return -float(pose_of(body).place(body.middle)[2])
    return -float(rope.state.nodes[rows.POSITION + 2, 0])


def with_body(snapshot: Snapshot, rope: Rope) -> Snapshot:
    """Add the rope's rigid body to the snapshot; its centre is then the payload's position."""
    body = body_of(rope)
    if body is None:
        return snapshot
    nodes, pose = rope.state.nodes, pose_of(body)
    hook = nodes[rows.POSITION : rows.POSITION + 3, 0]
    force, _, _ = pulls_of(body, hook, nodes[rows.VELOCITY : rows.VELOCITY + 3, 0])
    ends = pose.place(body.legs[:, :3])
    legs = hook - ends
    reaction_n, clearance_m = deck_contact(body, pose) or (None, None)
    return amended(
        snapshot,
        payload_position_m=pose.place(body.middle),
        payload_velocity_m_per_s=pose.speed(body.middle),
        body=BodySnapshot(
            quaternion=pose.quaternion,
            angular_velocity_rad_per_s=pose.spin,
            size_m=body.size.copy(),
            leg_tension_n=np.sqrt((force * force).sum(axis=1)),
            leg_length_m=np.sqrt((legs * legs).sum(axis=1)),
            leg_end_m=ends,
            hook_m=hook.copy(),
            deck_reaction_n=reaction_n,
            deck_clearance_m=clearance_m,
        ),
    )


def with_compensator(snapshot: Snapshot, rope: Rope) -> Snapshot:
    """Add the heave compensator at the rope's lower end to the snapshot, if there is one."""
    for effect in rope.effects:
        if isinstance(effect, Compensator) and effect.here != 0.0:
            return amended(snapshot, compensator=_compensator(effect, rope))
    return snapshot


def _compensator(compensator: Compensator, rope: Rope) -> CompensatorSnapshot:
    """Return the state of the compensator that is the lowest element of a rope."""
    state, rest_length = rope.state, float(rope.state.s[1] - rope.state.s[0])
    low, high = (state.nodes[:, k] for k in (0, 1))
    axis = (high - low)[rows.POSITION : rows.POSITION + 3]
    length = float(np.sqrt(axis @ axis))
    rate = float(axis @ (high - low)[rows.VELOCITY : rows.VELOCITY + 3]) / length
    depth = -0.5 * float(low[rows.POSITION + 2] + high[rows.POSITION + 2])
    k = float(rope.sections[rows.EA, 0]) / rest_length
    force = forces(compensator, length - rest_length, rate, k, depth)
    return CompensatorSnapshot(
        stroke_m=length - rest_length,
        stroke_limit_m=compensator.stroke,
        stroke_rate_m_per_s=rate,
        tension_n=max(force.pull, 0.0),
        gas_pressure_pa=force.pressure_pa,
        gas_force_n=force.gas,
        damper_n=force.damper,
        friction_n=force.seal,
        stop_n=force.stop,
        water_n=force.water,
        active_n=force.active,
    )


class RopeShape(NamedTuple):
    """Shape of one rope; rows run from its upper end (row 0) down, as in a RopeSnapshot."""

    name: str
    line: RopeLine
    core: Rope
    position_m: Vector  # (nodes, 3)
    arc_m: Vector  # unstretched, 0 at the upper end, (nodes,)
    element_tension_n: Vector  # (nodes - 1,)
    loose: bool = False  # whether its upper end is free: the part below a cut


def shape_from_top(
    line: RopeLine, core: Rope, snapshot: RopeSnapshot, *, loose: bool = False
) -> RopeShape:
    """Return the shape of a rope whose last node in the core is its upper end."""
    position, tension = snapshot.node_position_m, snapshot.element_tension_n
    s = core.state.s[: len(position)]
    return RopeShape(snapshot.name, line, core, position, (s[-1] - s)[::-1].copy(), tension, loose)


def shape_from_sheave(line: RopeLine, core: Rope, snapshot: RopeSnapshot) -> RopeShape:
    """Return the shape of a rope that ends at a sheave, where its elements come and go."""
    arc = core.state.s[: len(snapshot.node_position_m)] - core.state.s[0]
    arc[-1] = snapshot.line_out_m
    return RopeShape(
        snapshot.name, line, core, snapshot.node_position_m, arc, snapshot.element_tension_n
    )


def midpoints(arc_m: Vector) -> Vector:
    """Return midpoints of the elements between nodes at these arc lengths [m], (nodes - 1,)."""
    return np.asarray(0.5 * (arc_m[1:] + arc_m[:-1]))
