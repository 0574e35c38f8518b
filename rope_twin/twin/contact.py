"""Contact with seabed, hull and each other, landings, and the touchdown point within an element.

A rope without bending stiffness that hangs from the bed up to its support is a catenary: at arc
length s from the touchdown its slope is tan(phi) = w·s/H (Irvine 1981, Cable Structures, 2.1), less
the bed's own slope on an inclined bed. The touchdown is therefore where the slope relative to the
bed, extrapolated linearly from the two lowest suspended elements, reaches zero. This is exact for
the discrete catenary too: the first node on the bed carries the part of its weight that is not
suspended, and the point moves continuously while that node is laid down or picked up. The first
touching node, or the intersection of the polygon with the bed, would stand still and then jump.

A straight rope meets the bed where it intersects it. In between, where the slope does not vanish
within one element, both are weighted: the tangent point by the fraction of the slope that vanishes
within an element, the intersection by the remainder. The same holds on elements that resolve the
soil, which yields over sqrt(H/k): there the result is the intersection with the soil surface, up to
that length before the touchdown on a rigid bed. With bending stiffness the rope lies down over
sqrt(EI/H), which moves the point by less than that.

The seabed contact of a snapshot has the height above the bed, reactions, and the length on the bed.
"""

from __future__ import annotations

import math

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.bed import Grid, Plane
from rope_twin.core.bed_shape import clearance
from rope_twin.core.body.components import bed_forces
from rope_twin.core.body.loads import component_of
from rope_twin.core.body.state import GridBed, PlaneBed
from rope_twin.core.body.step import pose_of
from rope_twin.core.joined.joints import System
from rope_twin.core.joined.line_contact import rope_contact_of
from rope_twin.core.joined.payload_contact import payload_contact_of
from rope_twin.core.state import ELEMENTS, POSITION, VELOCITY, Rope
from rope_twin.effects.hull_contact import HullContact, contact_forces
from rope_twin.effects.seabed import normal_push
from rope_twin.twin.snapshot import BedContact, ContactForce, Snapshot, Touchdown, Vector
from rope_twin.twin.snapshot_builder import RopeShape, body_of, midpoints

NO_CONTACT = (math.nan, math.nan, math.nan)


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
    body = body_of(rope)
    if body is not None:  # height of its lowest corner, push on all
        load_height, load_push, _ = bed_forces(
            component_of(body, PlaneBed, GridBed), body, pose_of(body)
        )
    along = normal_push(bed, bed.soil.k * work[rows.FRONTAL, :n], x[:, :n], v[:, :n])
    return BedContact(
        payload_height_m=float(np.min(load_height)),
        payload_reaction_n=float(np.sum(load_push)),
        rope_on_bed_m=float(lying.sum()),
        rope_reaction_n=float(along.sum()),
    )


def touchdown_of(shape: RopeShape, bed: Plane | Grid) -> Touchdown | None:
    """Return the touchdown, from the upper end down; from the lower end if only that is suspended.

    None: no node touches the bed, or both ends lie on it.
    """
    height = clearance(bed, np.ascontiguousarray(shape.position_m.T))
    position, arc, tension = shape.position_m, shape.arc_m, shape.element_tension_n
    upward = height[0] <= 0.0
    if upward:  # a mooring that begins at its anchor
        position, arc = position[::-1], (arc[-1] - arc)[::-1]
        height, tension = height[::-1], tension[::-1]
    if height[0] <= 0.0 or not (height <= 0.0).any():
        return None
    at_m, angle = touchdown_at(position, arc, height)
    x, y, z = (float(np.interp(at_m, arc, column)) for column in position.T)
    return Touchdown(
        name=shape.name,
        position_m=(x, y, z),
        line_out_m=float(arc[-1]) - at_m if upward else at_m,
        layback_m=math.hypot(x - float(position[0, 0]), y - float(position[0, 1])),
        tension_n=float(np.interp(at_m, midpoints(arc), tension)),
        angle_deg=math.degrees(angle),
    )


def touchdown_at(position: Vector, arc: Vector, height: Vector) -> tuple[float, float]:
    """Return the arc length of the touchdown [m] and the rope's angle to the bed there [rad].

    position: nodes (n, 3) [m] from a suspended end to one beyond the touchdown; arc: their arc
    length from that end [m], (n,); height: above the bed [m], (n,), not above 0 somewhere.

    The angle lies in the vertical plane of the lowest suspended element. It belongs to the slope
    that does not vanish within an element, and is 0 where the rope lies down along the bed.
    """
    k = int(np.argmax(height <= 0.0))  # the first node on the bed
    low = max(k - 2, 0)
    nodes, s, h = position[low : k + 1], arc[low : k + 1], height[low : k + 1]
    horizontal = np.hypot(*np.diff(nodes[:, :2], axis=0).T)
    descent, drop = -np.diff(h), -np.diff(nodes[:, 2])  # towards the bed, and in absolute height
    slopes = np.tan(np.arctan2(descent, horizontal)).tolist()
    lowest, half_length = slopes[-1], 0.5 * float(s[-1] - s[-2])
    middle, end = float(s[-1]) - half_length, float(arc[min(k + 1, len(arc) - 1)])
    rest_length = (
        0.5 * (float(s[-1]) + end) - middle
    )  # to the middle of the next element, or the end
    slope_decrease = 0.0  # over `rest_length`, extrapolated
    if k >= 2:
        slope_decrease = max(
            (slopes[0] - lowest) * rest_length / (middle - 0.5 * float(s[0] + s[1])), 0.0
        )
    if lowest <= slope_decrease:
        return middle + rest_length * lowest / slope_decrease, 0.0
    intersection, weight = (
        float(s[-2] + h[-2] / descent[-1] * 2.0 * half_length),
        slope_decrease / lowest,
    )
    bed_angle = math.atan2(float(drop[-1] - descent[-1]), float(horizontal[-1]))
    rope_angle = math.atan2(float(drop[-1]), float(horizontal[-1]))
    return intersection + weight * (middle + rest_length - intersection), (1.0 - weight) * (
        rope_angle - bed_angle
    )


def hull_contacts(rope: Rope) -> tuple[ContactForce, ...]:
    """Return the present contact with the hull; none if the scene does not list the effect.

    The position is the middle of the element with the largest normal force.
    """
    hull = next((effect for effect in rope.effects if isinstance(effect, HullContact)), None)
    if hull is None:
        return ()
    state, nodes = rope.state, int(rope.state.counts[ELEMENTS]) + 1
    x, v = (state.nodes[first : first + 3, :nodes] for first in (POSITION, VELOCITY))
    normal = contact_forces(hull, x, v, state.s[:nodes])[3]
    e = int(np.argmax(normal))
    if not normal[e] > 0.0:
        return (ContactForce("hull", 0.0, NO_CONTACT),)
    a, b, c = (0.5 * (x[:, e] + x[:, e + 1])).tolist()
    return (ContactForce("hull", float(normal.sum()), (a, b, c)),)


def system_contacts(system: System) -> tuple[ContactForce, ...]:
    """Return the present contact between ropes and between payloads, of the effects listed."""
    contacts = (("ropes", rope_contact_of(system)), ("payloads", payload_contact_of(system)))
    return tuple(
        ContactForce(name, touch.push, touch.at if touch.contacts else NO_CONTACT)
        for name, touch in contacts
        if touch is not None
    )


def payload_motions(snapshot: Snapshot, count: int) -> list[tuple[Vector, Vector]]:
    """Return position [m] and velocity [m/s] of each payload, (3,) each."""
    if snapshot.payloads:
        return [(payload.position_m, payload.velocity_m_per_s) for payload in snapshot.payloads]
    return [(snapshot.payload_position_m, snapshot.payload_velocity_m_per_s)][:count]


class LandingWatch:
    """Finds landings, snapshot by snapshot; a payload that starts on the bed does not land."""

    def __init__(self) -> None:
        # numbers, since the fields of an object must be in a saved state from the start
        self._landed: list[bool] = []
        self._sinking: list[float] = []  # [m/s]

    def take(self, snapshot: Snapshot) -> list[tuple[int, float]]:
        """Return number and sinking speed [m/s] of each payload that the bed carries from now on.

        The speed is that before contact, the larger of this snapshot's and the last one's.
        """
        assert snapshot.seabed is not None, "landings are asked for where there is a seabed"
        motions = payload_motions(snapshot, 1)
        landed = [reaction_n > 0.0 for _, reaction_n in snapshot.seabed.payloads]
        sinking = [max(-float(velocity[2]), 0.0) for _, velocity in motions]
        landings = [
            (number, max(sinking[number], self._sinking[number]))
            for number, was_landed in enumerate(self._landed)
            if landed[number] and not was_landed
        ]
        self._landed, self._sinking = landed, sinking
        return landings
