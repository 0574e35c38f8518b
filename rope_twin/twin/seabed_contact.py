"""Seabed contact in a snapshot: height above the bed, reactions, length of rope on the bed."""

from __future__ import annotations

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.bed import Grid, Plane, clearance
from rope_twin.core.body.bed import bed_pushes
from rope_twin.core.body.energy import pose_of
from rope_twin.core.body.parts import part_of
from rope_twin.core.body.state import GridBed, PlaneBed, RigidBody
from rope_twin.core.state import Rope
from rope_twin.effects.seabed import normal_push
from rope_twin.twin.snapshot import BedContact


def seabed_of(rope: Rope) -> Plane | Grid | None:
    """Return the seabed of a rope; None if the scene lists none."""
    return next((effect for effect in rope.effects if isinstance(effect, Plane | Grid)), None)


def seabed_contact(rope: Rope) -> BedContact | None:
    """Return the present seabed contact; None if the scene lists no seabed."""
    bed = seabed_of(rope)
    if bed is None:
        return None
    state, work = rope.state, rope.work
    n = int(state.counts[rows.ELEMENTS])
    x = state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1]
    v = state.nodes[rows.VELOCITY : rows.VELOCITY + 3, : n + 1]
    height = clearance(bed, x)
    s = state.s[: n + 1]
    lump = 0.5 * np.diff(s, prepend=s[0], append=s[-1])
    lying = (lump[:-1] + lump[1:])[height <= 0.0]
    load_height, load_push = height[0], normal_push(bed, bed.soil.k_payload, x[:, :1], v[:, :1])
    body = next((effect for effect in rope.effects if isinstance(effect, RigidBody)), None)
    if body is not None and len(body.corners):  # height of its lowest corner, push on all
        load_height, load_push, _ = bed_pushes(
            part_of(body, PlaneBed, GridBed), body, pose_of(body)
        )
    along = normal_push(bed, bed.soil.k * work[rows.FRONTAL, :n], x[:, :n], v[:, :n])
    return BedContact(
        payload_height_m=float(np.min(load_height)),
        payload_push_n=float(np.sum(load_push)),
        rope_on_bed_m=float(lying.sum()),
        rope_push_n=float(along.sum()),
    )
