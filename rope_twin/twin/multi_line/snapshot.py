"""Snapshot of a multi-line system: each rope, payload, bar and sheave, and the seabed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body.step import pose_of
from rope_twin.core.joined.joints import FIRST, PULL, SECOND, System
from rope_twin.core.joined.sheaves import FLOW_COLUMN, POINT
from rope_twin.core.loads.balance import lower_end_tension
from rope_twin.core.state import Floats
from rope_twin.scene.model.joined import runs_over_sheave
from rope_twin.scene.schema import Scene
from rope_twin.twin.snapshot import (
    BedContact,
    PayloadShot,
    RopeShot,
    SheaveShot,
    Snapshot,
    StrutShot,
    amended,
    first_rope,
)
from rope_twin.twin.snapshot_builder import body_of
from rope_twin.twin.touchdown import seabed_contact
from rope_twin.vortex.results import RopeVibration


class Payouts(NamedTuple):
    """Payout of each rope and its rate, (ropes,)."""

    length_m: Floats
    speed_m_per_s: Floats


class SystemState(NamedTuple):
    """Present state of all ropes."""

    scene: Scene
    system: System
    owners: dict[str, int]  # by payload, the rope at whose lower end it is
    pull: Floats  # force on the upper ends [N], (ropes, rows.PULL_COLUMNS)
    line: Payouts
    time_s: float
    effects: tuple[Any, ...]  # of the first rope, in use now

    def nodes(self, r: int, first: int) -> Floats:
        """Return three rows of the state of a rope from `first` on, (3, nodes)."""
        state = self.system.ropes[r].state
        return state.nodes[first : first + 3, : state.counts[rows.ELEMENTS] + 1]


def rope_shots(now: SystemState, first: Snapshot) -> tuple[RopeShot, ...]:
    """Return the state of every rope; first: snapshot of the first one."""
    names = [line.name for line in now.scene.ropes]
    further = (_rope_shot(now, r, name) for r, name in enumerate(names[1:], start=1))
    return first_rope(first, names[0]), *further


def with_vibration(scene: Scene, shot: Snapshot, found: Sequence[RopeVibration]) -> Snapshot:
    """Return the snapshot with the VIV response of its ropes, of those that have one.

    found: from the last node of the core down, which at a sheave is the rope's lower end.
    """
    followed = zip(scene.ropes, shot.ropes, found, strict=False)
    ropes = [
        replace(one, vibration=own.upside_down() if runs_over_sheave(scene, line) else own)
        for line, one, own in followed
    ]
    return amended(shot, vibration=found[0], ropes=(*ropes, *shot.ropes[len(ropes) :]))


def payload_shots(now: SystemState) -> tuple[PayloadShot, ...]:
    """Return the state of every payload: its lower end's, or that of a rigid body's middle."""
    return tuple(_payload_shot(now, one.name) for one in now.scene.payloads)


def _payload_shot(now: SystemState, name: str) -> PayloadShot:
    r = now.owners[name]
    body = body_of(now.system.ropes[r])
    if body is None:
        place, speed = (now.nodes(r, row)[:, 0].copy() for row in (rows.POSITION, rows.VELOCITY))
    else:
        pose = pose_of(body)
        place, speed = pose.place(body.middle), pose.speed(body.middle)
    return PayloadShot(name=name, position_m=place, velocity_m_per_s=speed)


def strut_shots(now: SystemState) -> tuple[StrutShot, ...]:
    """Return the state of every bar."""
    joints = now.system.joints
    shots = []
    for k, one in enumerate(now.scene.struts):
        ends = [joints.nodes[: rows.VELOCITY, int(joints.ties[end, k])] for end in (FIRST, SECOND)]
        shots.append(StrutShot(one.name, np.array(ends), float(joints.ties[PULL, k])))
    return tuple(shots)


def sheave_shots(now: SystemState) -> tuple[SheaveShot, ...]:
    """Return the state of every sheave."""
    return tuple(_sheave_shot(now, k, one.name) for k, one in enumerate(now.scene.sheaves))


def contact(now: SystemState) -> BedContact | None:
    """Return the seabed contact of all ropes; the height is that of the lowest payload."""
    found = [seabed_contact(rope) for rope in now.system.ropes]
    contacts = [one for one in found if one is not None]
    if not contacts:
        return None
    loads = [contacts[now.owners[one.name]] for one in now.scene.payloads]
    return BedContact(
        payload_height_m=min(one.payload_height_m for one in loads),
        payload_push_n=sum(one.payload_push_n for one in loads),
        rope_on_bed_m=sum(one.rope_on_bed_m for one in contacts),
        rope_push_n=sum(one.rope_push_n for one in contacts),
    )


def _rope_shot(now: SystemState, r: int, name: str) -> RopeShot:
    nodes, work = now.nodes(r, rows.POSITION), now.system.ropes[r].work
    tension = work[rows.TENSION, : nodes.shape[1] - 1]
    pull = float(now.pull[r, rows.PULL])
    between = 0.5 * (tension[1:] + tension[:-1])
    lower = lower_end_tension(now.system.ropes[r], now.effects, now.time_s)
    at_nodes = np.concatenate(([lower], between, [pull]))
    line = (float(now.line.length_m[r]), float(now.line.speed_m_per_s[r]))
    downward = slice(None, None, -1)  # its upper end is the last node
    if runs_over_sheave(now.scene, now.scene.ropes[r]):
        downward, line = slice(None), _stretch(now, r)
    return RopeShot(
        name=name,
        node_position_m=np.ascontiguousarray(nodes[:, downward].T),
        node_tension_n=at_nodes[downward].copy(),
        element_tension_n=tension[downward].copy(),
        tension_top_n=pull,
        line_out_m=line[0],
        payout_speed_m_per_s=line[1],
    )


def _stretch(now: SystemState, r: int) -> tuple[float, float]:
    """Return the unstretched length of a rope that ends at a sheave [m], and its rate [m/s]."""
    sheaves = now.system.sheaves
    assert sheaves is not None
    flow = int(sheaves.figures[FLOW_COLUMN, sheaves.of[r]])
    passed, speed = now.system.joints.nodes[[rows.POSITION, rows.VELOCITY], flow]
    side = float(sheaves.side[r])
    return float(sheaves.base[r] + side * passed), float(side * speed)


def _sheave_shot(now: SystemState, k: int, name: str) -> SheaveShot:
    sheaves, nodes = now.system.sheaves, now.system.joints.nodes
    assert sheaves is not None
    point, flow = (int(sheaves.figures[row, k]) for row in (POINT, FLOW_COLUMN))
    return SheaveShot(
        name=name,
        position_m=nodes[: rows.VELOCITY, point].copy(),
        passed_m=float(nodes[rows.POSITION, flow]),
        speed_m_per_s=float(nodes[rows.VELOCITY, flow]),
    )
