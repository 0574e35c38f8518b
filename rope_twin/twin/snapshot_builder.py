"""Construction of a Snapshot (hang-off first) from the solver's arrays (payload first)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body import state as at
from rope_twin.core.body.components import deck_pushes
from rope_twin.core.body.loads import part_of
from rope_twin.core.body.state import Deck, RigidBody
from rope_twin.core.body.step import pose_of, pulls_of
from rope_twin.core.loads.hooks import factors_at
from rope_twin.core.state import Floats, Ints, Rope, State
from rope_twin.effects.compensator import Compensator, forces
from rope_twin.scene.error_bound import KnownError
from rope_twin.scene.schema import RopeLine, Ship
from rope_twin.twin.motion.heave_track import ramp
from rope_twin.twin.snapshot import (
    BodyShot,
    CompensatorShot,
    CutShot,
    InputHealth,
    RopeShot,
    RopeStrength,
    Snapshot,
    SolverHealth,
    Vector,
    WinchShot,
    amended,
)


class Extremes:
    """Maximum, mean and minimum of a series that arrives in pieces."""

    def __init__(self) -> None:
        self.high, self.low = -np.inf, np.inf
        self._sum, self._count = 0.0, 0

    def take(self, values: list[float]) -> None:
        """Add values."""
        if values:
            self.high = max(self.high, *values)
            self.low = min(self.low, *values)
            self._sum = reduce(add, values, self._sum)  # however they are divided into pieces
            self._count += len(values)

    def join(self, other: Extremes) -> None:
        """Add the values of another series."""
        self.high, self.low = max(self.high, other.high), min(self.low, other.low)
        self._sum += other._sum
        self._count += other._count

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


class SnapshotInputs(NamedTuple):
    """Values that a snapshot needs in addition to the solver's arrays."""

    stamp_ns: int
    step: int
    step_s: float
    line: RopeLine
    ship: Ship
    border: Vector  # hang-off [m] and line out [m] now, (rows.MOTIONS,)
    border_rate: Vector  # and their rates [m/s]
    lower_n: float  # tension at the lower end
    effects: tuple[Any, ...]  # kernel data of the first rope's, in use now
    pull: Vector  # rows.PULL_COLUMNS: magnitude and vector of the force on the hang-off [N]
    recent: Extremes  # top tension since the previous snapshot
    run: Extremes  # top tension since the start
    winch_at_limit: str
    doubtful: bool
    computing_s: float
    inputs: dict[str, InputHealth]
    study_error: KnownError
    winches: tuple[WinchShot, ...] = ()
    cut: CutShot | None = None
    ship_moves: bool = True  # by the scene's sea or by samples; else nothing builds up


def build_snapshot(state: State, work: Floats, seen: SnapshotInputs) -> Snapshot:
    """Return a Snapshot that shares no memory with the solver."""
    n = int(state.counts[rows.ELEMENTS])
    element_tension = work[rows.TENSION, :n][::-1].copy()
    top = float(seen.pull[rows.PULL])
    node_tension = np.concatenate(
        ([top], 0.5 * (element_tension[1:] + element_tension[:-1]), [seen.lower_n])
    )
    recent_low, recent_high = (
        (top, top) if seen.recent.empty else (seen.recent.low, seen.recent.high)
    )
    return Snapshot(
        stamp_ns=seen.stamp_ns,
        step=seen.step,
        step_s=seen.step_s,
        node_position_m=_downward(state, rows.POSITION, n),
        node_velocity_m_per_s=_downward(state, rows.VELOCITY, n),
        node_tension_n=node_tension,
        element_tension_n=element_tension,
        arc_length_m=(state.s[n] - state.s[: n + 1])[::-1].copy(),
        tension_top_n=top,
        tension_top_min_n=recent_low,
        tension_top_max_n=recent_high,
        hang_off_force_n=seen.pull[rows.PULL_X :].copy(),
        tension_payload_n=seen.lower_n,
        hang_off_position_m=seen.border[: rows.LINE].copy(),
        hang_off_velocity_m_per_s=seen.border_rate[: rows.LINE].copy(),
        heave_m=float(seen.border[rows.Z] - seen.ship.hang_off_m[2]),
        payload_position_m=state.nodes[rows.POSITION : rows.POSITION + 3, 0].copy(),
        payload_velocity_m_per_s=state.nodes[rows.VELOCITY : rows.VELOCITY + 3, 0].copy(),
        line_out_m=float(seen.border[rows.LINE]),
        payout_speed_m_per_s=float(seen.border_rate[rows.LINE]),
        fluid_factors=factors_at(seen.effects, seen.stamp_ns * 1e-9),
        motion_ramp=(
            ramp(seen.stamp_ns * 1e-9, seen.ship.motion_ramp_s)[0] if seen.ship_moves else 1.0
        ),
        winch_at_limit=seen.winch_at_limit,
        doubtful=seen.doubtful,
        solver=_solver_health(state.health, seen.computing_s),
        inputs=seen.inputs,
        study_error=seen.study_error,
        winches=seen.winches,
        cut=seen.cut,
        strength=(strength_of(seen.line, max(seen.run.high, top), element_tension),),
    )


def strength_of(line: RopeLine, most_n: float, element_tension_n: Vector) -> RopeStrength:
    """Return a rope's maximum tension and MBL; most_n: maximum at its top since the start [N]."""
    highest_n = max(float(most_n), float(element_tension_n.max()))
    return RopeStrength(line.name, highest_n, line.breaking_load_n)


def _downward(state: State, first: int, n: int) -> Vector:
    """Return the vector at rows `first`, payload first, as (n + 1, 3), hang-off first."""
    return np.ascontiguousarray(state.nodes[first : first + 3, : n + 1][:, ::-1].T)


def _solver_health(health: Ints, computing_s: float) -> SolverHealth:
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
        computing_s=computing_s,
    )


def body_of(rope: Rope) -> RigidBody | None:
    """Return the rigid body at the lower end of a rope, if its payload is one."""
    bodies = (effect for effect in rope.effects if isinstance(effect, RigidBody))
    return next((body for body in bodies if body.here), None)


def payload_depth_m(rope: Rope) -> float:
    """Return the depth of a rope's lower end, or of the centre of the rigid body there [m]."""
    body = body_of(rope)
    if body is not None:
        return -float(pose_of(body).place(body.middle)[2])
    return -float(rope.state.nodes[rows.POSITION + 2, 0])


def with_body(shot: Snapshot, rope: Rope) -> Snapshot:
    """Add the rope's rigid body to the snapshot; its centre is then the payload's position."""
    body = body_of(rope)
    if body is None:
        return shot
    nodes, pose = rope.state.nodes, pose_of(body)
    hook = nodes[rows.POSITION : rows.POSITION + 3, 0]
    force, _, _ = pulls_of(body, hook, nodes[rows.VELOCITY : rows.VELOCITY + 3, 0])
    ends = pose.place(body.legs[:, :3])
    legs = hook - ends
    push, clearance, deck = None, None, part_of(body, Deck)
    if deck is not None:
        push = float(deck_pushes(deck, body, pose)[:, 2].sum())
        clearance = float(pose.place(body.corners)[:, 2].min() - body.stage[at.DECK_Z])
    return amended(
        shot,
        payload_position_m=pose.place(body.middle),
        payload_velocity_m_per_s=pose.speed(body.middle),
        body=BodyShot(
            quaternion=pose.quaternion,
            angular_velocity_rad_per_s=pose.spin,
            size_m=body.size.copy(),
            leg_pull_n=np.sqrt((force * force).sum(axis=1)),
            leg_length_m=np.sqrt((legs * legs).sum(axis=1)),
            leg_end_m=ends,
            hook_m=hook.copy(),
            deck_push_n=push,
            deck_clearance_m=clearance,
        ),
    )


def with_compensator(shot: Snapshot, rope: Rope) -> Snapshot:
    """Add the heave compensator at the rope's lower end to the snapshot, if there is one."""
    for own in rope.effects:
        if isinstance(own, Compensator) and own.here != 0.0:
            return amended(shot, compensator=_compensator(own, rope))
    return shot


def _compensator(own: Compensator, rope: Rope) -> CompensatorShot:
    """Return the state of the compensator that is the lowest element of a rope."""
    state, rest = rope.state, float(rope.state.s[1] - rope.state.s[0])
    low, high = (state.nodes[:, k] for k in (0, 1))
    span = (high - low)[rows.POSITION : rows.POSITION + 3]
    length = float(np.sqrt(span @ span))
    rate = float(span @ (high - low)[rows.VELOCITY : rows.VELOCITY + 3]) / length
    depth = -0.5 * float(low[rows.POSITION + 2] + high[rows.POSITION + 2])
    k = float(rope.sections[rows.EA, 0]) / rest
    part = forces(own, length - rest, rate, k, depth)
    return CompensatorShot(
        stroke_m=length - rest,
        stroke_limit_m=own.stroke,
        stroke_rate_m_per_s=rate,
        tension_n=max(part.pull, 0.0),
        gas_pressure_pa=part.pressure_pa,
        gas_force_n=part.gas,
        damper_n=part.damper,
        friction_n=part.seal,
        stop_n=part.stop,
        water_n=part.water,
        active_n=part.active,
    )


class RopeShape(NamedTuple):
    """Shape of one rope; rows run from its upper end (row 0) down, as in a RopeShot."""

    name: str
    line: RopeLine
    core: Rope
    position_m: Vector  # (nodes, 3)
    arc_m: Vector  # unstretched, 0 at the upper end, (nodes,)
    element_tension_n: Vector  # (nodes - 1,)
    loose: bool = False  # its upper end is free: the part below a cut


def shape_from_top(line: RopeLine, core: Rope, shot: RopeShot, *, loose: bool = False) -> RopeShape:
    """Return the shape of a rope whose last node in the core is its upper end."""
    place, tension = shot.node_position_m, shot.element_tension_n
    s = core.state.s[: len(place)]
    return RopeShape(shot.name, line, core, place, (s[-1] - s)[::-1].copy(), tension, loose)


def shape_from_sheave(line: RopeLine, core: Rope, shot: RopeShot) -> RopeShape:
    """Return the shape of a rope that ends at a sheave, where its elements come and go."""
    arc = core.state.s[: len(shot.node_position_m)] - core.state.s[0]
    arc[-1] = shot.line_out_m
    return RopeShape(shot.name, line, core, shot.node_position_m, arc, shot.element_tension_n)


def midpoints(arc_m: Vector) -> Vector:
    """Return midpoints of the elements between nodes at these arc lengths [m], (nodes - 1,)."""
    return np.asarray(0.5 * (arc_m[1:] + arc_m[:-1]))
