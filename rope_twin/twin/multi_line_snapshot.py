"""Snapshot of a multi-line system: ropes, payloads, bars, sheaves; clearance of two lines.

Clearance and crossings are those of two lines that hang side by side. Each line runs from its
hang-off down to the sheave. Seen normal to the plane of both hang-offs they cross where one passes
to the other side of the other: where their distance along that plane changes sign. The gap is their
distance there normal to the plane: with the current in that plane it is close to zero, and the
lines touch. Lines are compared at equal depth, and one that turns upward again is followed by its
greatest depth up to there; the number of such snapshots is counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body.step import pose_of
from rope_twin.core.joined.joints import FIRST, PULL, SECOND, System
from rope_twin.core.joined.stack import FLOW_COLUMN, POINT
from rope_twin.core.loads.balance import lower_end_tension
from rope_twin.core.state import Boundary, Floats
from rope_twin.errors import InputError
from rope_twin.scene.rigging import places, runs_over_sheave
from rope_twin.scene.schema import Scene
from rope_twin.twin.contact import seabed_contact
from rope_twin.twin.snapshot import (
    BedContact,
    Crossing,
    LineEvent,
    LinesSnapshot,
    Nearest,
    PayloadSnapshot,
    RopeSnapshot,
    SheaveSnapshot,
    Snapshot,
    StrutSnapshot,
    amended,
    first_rope,
)
from rope_twin.twin.snapshot_builder import body_of, rope_snapshot
from rope_twin.vortex.results import RopeVibration

SHEAVE_ZONE = 0.02  # of the sheave's depth: the zone above it where the lines meet is left out
SAME_CROSSING_TOL = 0.05  # of the sheave's depth: maximum shift of a crossing between two snapshots
MIN_SPACING_M = 1e-3
SAMPLING_NS = 1_000_000_000


class SystemState(NamedTuple):
    """Present state of all ropes."""

    scene: Scene
    system: System
    owners: dict[str, int]  # by payload, the rope at whose lower end it is
    pull: Floats  # force on the upper ends [N], (ropes, rows.PULL_COLUMNS)
    payout: Boundary  # length [m] and rate [m/s] of each rope, (ropes,)
    time_s: float
    effects: tuple[Any, ...]  # of the first rope, in use now

    def nodes(self, r: int, first: int) -> Floats:
        """Return three rows of the state of a rope from `first` on, (3, nodes)."""
        state = self.system.ropes[r].state
        return state.nodes[first : first + 3, : state.counts[rows.ELEMENTS] + 1]


def rope_snapshots(state: SystemState, first: Snapshot) -> tuple[RopeSnapshot, ...]:
    """Return the state of every rope; first: snapshot of the first one."""
    names = [line.name for line in state.scene.ropes]
    further = (_rope_snapshot(state, r, name) for r, name in enumerate(names[1:], start=1))
    return first_rope(first, names[0]), *further


def with_vibration(
    scene: Scene, snapshot: Snapshot, responses: Sequence[RopeVibration]
) -> Snapshot:
    """Return the snapshot with the VIV response of its ropes, of those that have one.

    responses: from the last node of the core down, which at a sheave is the rope's lower end.
    """
    pairs = zip(scene.ropes, snapshot.ropes, responses, strict=False)
    ropes = []
    for line, rope, response in pairs:
        ordered = response.upside_down() if runs_over_sheave(scene, line) else response
        ropes.append(replace(rope, vibration=ordered))
    return amended(snapshot, vibration=responses[0], ropes=(*ropes, *snapshot.ropes[len(ropes) :]))


def payload_snapshots(state: SystemState) -> tuple[PayloadSnapshot, ...]:
    """Return the state of every payload: that of the lower end, or of a rigid body's middle."""
    snapshots = []
    for payload in state.scene.payloads:
        r = state.owners[payload.name]
        body = body_of(state.system.ropes[r])
        if body is None:
            ends = (state.nodes(r, row)[:, 0].copy() for row in (rows.POSITION, rows.VELOCITY))
        else:
            pose = pose_of(body)
            ends = (motion(body.middle) for motion in (pose.place, pose.speed))
        snapshots.append(PayloadSnapshot(payload.name, *ends))
    return tuple(snapshots)


def strut_snapshots(state: SystemState) -> tuple[StrutSnapshot, ...]:
    """Return the state of every bar."""
    joints = state.system.joints
    snapshots = []
    for k, strut in enumerate(state.scene.struts):
        ends = [joints.nodes[: rows.VELOCITY, int(joints.ties[end, k])] for end in (FIRST, SECOND)]
        snapshots.append(StrutSnapshot(strut.name, np.array(ends), float(joints.ties[PULL, k])))
    return tuple(snapshots)


def sheave_snapshots(state: SystemState) -> tuple[SheaveSnapshot, ...]:
    """Return the state of every sheave."""
    sheaves, nodes, snapshots = state.system.sheaves, state.system.joints.nodes, []
    for k, sheave in enumerate(state.scene.sheaves):
        assert sheaves is not None
        point, flow = (int(sheaves.figures[row, k]) for row in (POINT, FLOW_COLUMN))
        position_m = nodes[: rows.VELOCITY, point].copy()
        passed_m, speed = float(nodes[rows.POSITION, flow]), float(nodes[rows.VELOCITY, flow])
        snapshots.append(SheaveSnapshot(sheave.name, position_m, passed_m, speed))
    return tuple(snapshots)


def contact(state: SystemState) -> BedContact | None:
    """Return the seabed contact of all ropes; the height is that of the lowest payload.

    Without payloads it is that of the lowest lower end, as of a single rope.
    """
    every_rope = (seabed_contact(rope) for rope in state.system.ropes)
    contacts = [bed for bed in every_rope if bed is not None]
    if not contacts:
        return None
    below_payloads = [contacts[state.owners[payload.name]] for payload in state.scene.payloads]
    at_ends = below_payloads or contacts
    return BedContact(
        payload_height_m=min(bed.payload_height_m for bed in at_ends),
        payload_reaction_n=sum(bed.payload_reaction_n for bed in at_ends),
        rope_on_bed_m=sum(bed.rope_on_bed_m for bed in contacts),
        rope_reaction_n=sum(bed.rope_reaction_n for bed in contacts),
        several=tuple((bed.payload_height_m, bed.payload_reaction_n) for bed in below_payloads),
    )


def _rope_snapshot(state: SystemState, r: int, name: str) -> RopeSnapshot:
    rope = state.system.ropes[r]
    lower_n = lower_end_tension(rope, state.effects, state.time_s)
    ends_n = lower_n, float(state.pull[r, rows.PULL])
    if not runs_over_sheave(state.scene, state.scene.ropes[r]):
        line = float(state.payout.value[r]), float(state.payout.rate[r])
        return rope_snapshot(name, rope, ends_n, line)
    sheaves = state.system.sheaves
    assert sheaves is not None
    flow, side = int(sheaves.figures[FLOW_COLUMN, sheaves.of[r]]), float(sheaves.side[r])
    passed, speed = state.system.joints.nodes[[rows.POSITION, rows.VELOCITY], flow]
    line = float(sheaves.base[r] + side * passed), float(side * speed)
    return rope_snapshot(name, rope, ends_n, line, from_sheave=True)


def lines_of(scene: Scene) -> tuple[list[int], list[int]]:
    """Return the rope numbers of both lines over the scene's sheave, from the hang-off down.

    Raises:
        InputError: the scene has not exactly one sheave, or a line branches on its way to the ship.
    """
    if len(scene.sheaves) != 1:
        problem = f"the scene has {len(scene.sheaves)} sheaves"
        remedy = "give a scene with one, such as two_line_loop"
        raise InputError(f"{scene.path}: sheaves", problem, remedy)
    lines = []
    for number, line in enumerate(scene.ropes):
        if line.to == scene.sheaves[0].name:
            rope_numbers = [number]
            while scene.ropes[rope_numbers[0]].from_ not in places(scene):
                connection = scene.ropes[rope_numbers[0]].from_
                above = [k for k, other in enumerate(scene.ropes) if other.to == connection]
                if len(above) != 1 or above[0] in rope_numbers:
                    problem = f"{len(above)} ropes lead to '{connection}'"
                    remedy = "two lines are watched that go up to the ship as one rope each"
                    raise InputError(f"{scene.path}: ropes[{rope_numbers[0]}]", problem, remedy)
                rope_numbers.insert(0, above[0])
            lines.append(rope_numbers)
    first = [rope_numbers for rope_numbers in lines if rope_numbers[0] == 0] or lines[:1]
    (other,) = [rope_numbers for rope_numbers in lines if rope_numbers is not first[0]]
    return first[0], other


class ClearanceMonitor:
    """Monitor of both lines from snapshot to snapshot.

    Raises:
        InputError: as `lines_of`, or both hang-offs are at the same position.
    """

    def __init__(self, scene: Scene) -> None:
        """Find both lines and the plane of their hang-offs; raises InputError as the class says."""
        self.lines = lines_of(scene)
        positions = places(scene)
        first, second = (np.array(positions[scene.ropes[line[0]].from_][:2]) for line in self.lines)
        spacing_m = float(np.linalg.norm(second - first))
        if spacing_m < MIN_SPACING_M:
            remedy = "set `at_m` of one of them aside: the lines are watched in the plane of both"
            raise InputError(f"{scene.path}: hang_offs", "both are at one place", remedy)
        self.plane = (second - first) / spacing_m
        self.crossings: tuple[Crossing, ...] = ()  # in the last snapshot
        self.turned_up = 0  # number of snapshots in which a line turned upward

    def observe(self, snapshot: Snapshot) -> tuple[Nearest, list[LineEvent]]:
        """Return the minimum distance in a snapshot, and events since the last one: crossings that
        began or ended.
        """
        paths = [self._path(snapshot, line) for line in self.lines]
        self.turned_up += any((np.diff(path[:, 2]) > 0.0).any() for path in paths)
        depth, positions, slopes = _at_common_depths(paths)
        sheave_depth = -float(snapshot.sheaves[0].position_m[2])
        above = depth < (1.0 - SHEAVE_ZONE) * sheave_depth
        distance = np.linalg.norm(positions[0] - positions[1], axis=1)[above]
        k = int(distance.argmin())
        crossings = find_crossings(depth[above], positions[:, above], slopes[above], self.plane)
        events = self._compare(crossings, snapshot.time_s, SAME_CROSSING_TOL * sheave_depth)
        self.crossings = tuple(crossings)
        return Nearest(snapshot.time_s, float(depth[above][k]), float(distance[k])), events

    def _path(self, snapshot: Snapshot, line: list[int]) -> Floats:
        """Position of the nodes of a line from the hang-off down [m], (nodes, 3)."""
        parts = [snapshot.ropes[line[0]].node_position_m]
        parts += [snapshot.ropes[number].node_position_m[1:] for number in line[1:]]
        return np.concatenate(parts)

    def _compare(
        self, crossings: list[Crossing], time_s: float, tolerance_m: float
    ) -> list[LineEvent]:
        """Return events of crossings that began, and of those that ended."""
        ended, events = list(self.crossings), []
        for crossing in crossings:
            matches = [old for old in ended if abs(old.depth_m - crossing.depth_m) < tolerance_m]
            if matches:
                ended.remove(min(matches, key=lambda old: abs(old.depth_m - crossing.depth_m)))
            else:
                events.append(_event(time_s, "cross", crossing))
        return events + [_event(time_s, "part", old) for old in ended]


def _event(time_s: float, kind: str, crossing: Crossing) -> LineEvent:
    return LineEvent(time_s, kind, crossing.depth_m, crossing.angle_deg, crossing.gap_m)


def _at_common_depths(paths: list[Floats]) -> tuple[Floats, Floats, Floats]:
    """Return both lines at the same depths: depths, x and y of each line, and their slopes.

    (n,), (2, n, 2), (n, 2, 2): the slopes dx/dz and dy/dz of each line just below a depth.
    """
    depths = [np.maximum.accumulate(-path[:, 2]) for path in paths]
    top = max(float(depth[0]) for depth in depths)
    bottom = min(float(depth[-1]) for depth in depths)
    common = np.unique(np.concatenate(depths))
    common = common[(common >= top) & (common <= bottom)]
    pairs = zip(depths, paths, strict=True)
    positions = np.array(
        [[np.interp(common, d, path[:, k]) for k in range(2)] for d, path in pairs]
    )
    slopes = np.diff(positions, axis=2) / np.diff(common)
    slopes = np.concatenate([slopes, slopes[:, :, -1:]], axis=2)
    return common, positions.transpose(0, 2, 1), slopes.transpose(2, 0, 1)


def find_crossings(
    depth: Floats, positions: Floats, slopes: Floats, plane: Floats
) -> list[Crossing]:
    """Return the crossings, where the distance along the plane changes sign, from the top down.

    depth: rising, (n,) [m]; positions: x and y of each line, (2, n, 2) [m]; slopes: of both lines
    below each depth, (n, 2, 2); plane: unit vector, (2,).
    """
    separation = positions[0] - positions[1]
    along = separation @ plane
    across = separation @ np.array([-plane[1], plane[0]])
    crossings = []
    for k in np.flatnonzero(along[:-1] * along[1:] < 0.0):
        fraction = along[k] / (along[k] - along[k + 1])
        first, second = (np.append(slopes[k, line], 1.0) for line in range(2))
        cosine = abs(float(first @ second)) / float(np.linalg.norm(first) * np.linalg.norm(second))
        depth_m = float(depth[k] + fraction * (depth[k + 1] - depth[k]))
        x, y = (positions[0, k] + fraction * (positions[0, k + 1] - positions[0, k])).tolist()
        crossings.append(
            Crossing(
                depth_m=depth_m,
                angle_deg=float(np.degrees(np.arccos(min(cosine, 1.0)))),
                gap_m=float(abs(across[k] + fraction * (across[k + 1] - across[k]))),
                position_m=(x, y, -depth_m),
            )
        )
    return crossings


class ClearanceReport:
    """Clearance of the two lines of a running twin, sampled once a second of twin time."""

    def __init__(self, watch: ClearanceMonitor) -> None:
        self._watch = watch
        self._sampled_second = -1  # second of the last sampling
        self._sampled: LinesSnapshot | None = None

    def complete(self, snapshot: Snapshot) -> Snapshot:
        """Add the results of the lines to the snapshot.

        The first sampling follows the first step, since nothing subscribes before that.
        """
        second = snapshot.stamp_ns // SAMPLING_NS
        if snapshot.step == 0 or second == self._sampled_second:
            return replace(snapshot, lines=self._sampled)
        nearest, events = self._watch.observe(snapshot)
        self._sampled_second = second
        self._sampled = LinesSnapshot(nearest, self._watch.crossings)
        return replace(snapshot, lines=self._sampled, line_events=tuple(events))

    def state(self) -> list[Any]:
        """Return the state that a restart needs, as plain numbers."""
        crossings = [
            [c.depth_m, c.angle_deg, c.gap_m, *c.position_m] for c in self._watch.crossings
        ]
        near = self._sampled.nearest if self._sampled else Nearest(0.0, 0.0, 0.0)
        last = [near.time_s, near.depth_m, near.distance_m]
        return [self._sampled_second, self._watch.turned_up, last, crossings]

    def restore(self, state: list[Any]) -> None:
        """Resume from the state that `state` gave."""
        self._sampled_second, self._watch.turned_up, last, rows = state
        crossings = (Crossing(depth, angle, gap, (x, y, z)) for depth, angle, gap, x, y, z in rows)
        self._watch.crossings = tuple(crossings)
        sampled = self._sampled_second >= 0
        self._sampled = LinesSnapshot(Nearest(*last), self._watch.crossings) if sampled else None


def report_on(scene: Scene) -> ClearanceReport | None:
    """Return a report on the scene's two lines; None if there are no two lines."""
    try:
        return ClearanceReport(ClearanceMonitor(scene))
    except InputError:  # most scenes have no two lines around a sheave
        return None
