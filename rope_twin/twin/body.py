"""Rigid-body payload in a snapshot: position, attitude, slings and deck contact."""

from __future__ import annotations

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body import state as at
from rope_twin.core.body.contact import deck_pushes
from rope_twin.core.body.energy import pose_of, pulls_of
from rope_twin.core.body.parts import part_of
from rope_twin.core.body.state import Deck, RigidBody
from rope_twin.core.state import Rope
from rope_twin.twin.snapshot import BodyShot, Snapshot, amended


def body_of(rope: Rope) -> RigidBody | None:
    """Return the rigid body at the lower end of a rope, if its payload is one."""
    return next((effect for effect in rope.effects if isinstance(effect, RigidBody)), None)


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
            deck_push_n=push,
            deck_clearance_m=clearance,
        ),
    )
