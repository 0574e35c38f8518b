"""Where a rope first meets the seabed, found within an element.

A rope without stiffness that hangs from a bed up to where it is held is a catenary: over its arc
length s from the touchdown its slope is tan(phi) = w·s/H (Irvine 1981, Cable Structures, 2.1), less
the bed's own slope on a bed that is not level. So the touchdown is where the slope to the bed,
continued in a straight line from the two lowest elements that hang, has gone. That line is exact
for the discrete catenary too: there the first node on the bed leaves to it what of its weight does
not hang, and the point moves on evenly while that node is laid down or picked up. The first node
that touches, or the polygon's crossing with the bed, would stand still and then jump.

A straight rope meets the bed where it cuts it. In between, where an element's length is not enough
for the slope to go, both count: the tangent with the share of the slope that goes within an element
and the cut with what is left. So it is, too, on elements that resolve the soil, which gives way
over sqrt(H/k): there the answer is where the rope cuts its surface, up to that length before the
touchdown on a rigid bed. With bending stiffness the rope lies down over sqrt(EI/H), which moves the
point by less than that.
"""

from __future__ import annotations

import math

import numpy as np

from rope_twin.core.bed import Grid, Plane, clearance
from rope_twin.twin.hung import HungRope, middles
from rope_twin.twin.snapshot import Touchdown, Vector


def touchdown_of(hung: HungRope, bed: Plane | Grid) -> Touchdown | None:
    """Of a rope from its upper end down, or up from its lower end if only that one hangs.

    None: no node touches the bed, or both ends lie on it.
    """
    height = clearance(bed, np.ascontiguousarray(hung.position_m.T))
    position, arc, tension = hung.position_m, hung.arc_m, hung.element_tension_n
    upward = height[0] <= 0.0
    if upward:  # a mooring that begins at its anchor
        position, arc = position[::-1], (arc[-1] - arc)[::-1]
        height, tension = height[::-1], tension[::-1]
    if height[0] <= 0.0 or not (height <= 0.0).any():
        return None
    at_m, angle = touchdown_at(position, arc, height)
    x, y, z = (float(np.interp(at_m, arc, column)) for column in position.T)
    return Touchdown(
        name=hung.name,
        position_m=(x, y, z),
        line_out_m=float(arc[-1]) - at_m if upward else at_m,
        layback_m=math.hypot(x - float(position[0, 0]), y - float(position[0, 1])),
        tension_n=float(np.interp(at_m, middles(arc), tension)),
        angle_deg=math.degrees(angle),
    )


def touchdown_at(position: Vector, arc: Vector, height: Vector) -> tuple[float, float]:
    """Arc length of the touchdown [m], and the rope's angle to the bed there [rad].

    position: nodes (n, 3) [m] from an end that hangs to one beyond the touchdown; arc: their arc
    length from that end [m], (n,); height: above the bed [m], (n,), not above 0 somewhere.

    The angle is in the vertical plane of the lowest element that hangs: of the slope that has not
    gone within an element, 0 where the rope lies down along the bed.
    """
    k = int(np.argmax(height <= 0.0))  # the first node on the bed
    low = max(k - 2, 0)
    place, s, h = position[low : k + 1], arc[low : k + 1], height[low : k + 1]
    run = np.hypot(*np.diff(place[:, :2], axis=0).T)
    down, drop = -np.diff(h), -np.diff(place[:, 2])  # to the bed, and with it
    slopes = np.tan(np.arctan2(down, run)).tolist()
    lowest, half = slopes[-1], 0.5 * float(s[-1] - s[-2])
    middle, end = float(s[-1]) - half, float(arc[min(k + 1, len(arc) - 1)])
    room = 0.5 * (float(s[-1]) + end) - middle  # to the middle of the next element, or the end
    goes = 0.0  # of the slope within that, if it goes on as above
    if k >= 2:
        goes = max((slopes[0] - lowest) * room / (middle - 0.5 * float(s[0] + s[1])), 0.0)
    if lowest <= goes:
        return middle + room * lowest / goes, 0.0
    cut, share = float(s[-2] + h[-2] / down[-1] * 2.0 * half), goes / lowest
    bed = math.atan2(float(drop[-1] - down[-1]), float(run[-1]))
    own = math.atan2(float(drop[-1]), float(run[-1]))
    return cut + share * (middle + room - cut), (1.0 - share) * (own - bed)
