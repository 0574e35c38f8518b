"""Contact between the ropes of a system: penalty forces between elements, with friction.

Two elements touch where their closest points P and Q (Ericson 2005, ch. 5.1.9) come nearer than
`reach`, one distance for all ropes (default: the largest diameter). With n the unit vector from Q
to P and the penetration e = reach - n·(P - Q), at the relative speed v_n away from each other,

    N = k·e·max(1 - χ·v_n, 0)    (Hunt and Crossley 1975),

and friction μ·N against the sliding velocity v_t, regularised to μ·N·v_t/√(|v_t|² + v_0²) (Oden and
Martins 1985). The sign of n is that of the start of the step, so that ropes whose centre lines pass
each other within a step are pushed back.

A contact at a node is assigned to the element above it, if it is the nearest for both elements
there; of two contacts on both sides of a node within 2·reach only the nearer one is active. The
lowest and the uppermost element of each rope have no contact, since ropes approach each other at a
connection by design. Static equilibrium is solved without contact.

The block of a node with the weight w (1 - t, t of one element, s of the other) in the relative
displacement is 2·|w|·dF/d(P - Q), which bounds the coupled stiffness w·wᵀ of all four nodes from
above (derived: Σ|w| = 2), so that Newton's method converges without coupling ropes in its matrix.

**SIMD lanes** (core/lanes). Bounding boxes are compared in all lanes together. Pairs of elements
that are near in a lane are evaluated for this lane alone, without contraction, so that they are
bit-identical to those of a single system.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import (
    jit,
    jit_entry,
    jit_exact,
    jit_exact_within,
    jit_within,
)
from rope_twin.core.jit.functions import by_type, by_width
from rope_twin.core.jit.rows import column
from rope_twin.core.jit.wide import ALL, LANES, bits, choose, lane_of
from rope_twin.core.joined.stack import nodes_of, work_of
from rope_twin.core.loads.hooks import calls_of, has_active_set, kernel
from rope_twin.core.state import (
    BLOCK,
    DIVISOR_MIN,
    ELEMENTS,
    ELIMINATED,
    POSITION,
    RESIDUAL,
    VELOCITY,
    Floats,
    LaneStage,
    Stage,
)

GROUP_ELEMENTS = 8  # elements per group, for a broad phase with bounding boxes
# Six rows of scratch: the bounding box of a group, in the column of its number. Factors are not
# reused with this effect, whose active set is not reported unchanged.
BOX = ELIMINATED
BEGIN_S = 1e-9  # time from which on contact is active; static solutions are before
FRICTION_SPEED = 0.01  # v_0 [m/s]
PARALLEL = 1e-9  # sine² of the angle below which two elements are parallel


class LineContact(NamedTuple):
    """Kernel data of contact between ropes."""

    k: float  # stiffness of a contact [N/m]
    chi: float  # χ [s/m]
    mu: float  # μ
    reach: float  # distance of the centre lines at contact [m]


@jit_exact_within
def _dot(a: Any, b: Any) -> Any:
    """Return the inner product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit_within
def difference(a: Any, b: Any) -> Any:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@jit_exact_within
def _interpolated(a: Any, b: Any, t: float) -> Any:
    low = 1.0 - t
    return low * a[0] + t * b[0], low * a[1] + t * b[1], low * a[2] + t * b[2]


@jit_exact
def _closest(nodes_a: Any, i: int, nodes_b: Any, j: int) -> Any:
    """Return the fractions s, t of the closest points of two elements, and the vector between."""
    a, b = column(nodes_a, POSITION, i), column(nodes_b, POSITION, j)
    u, w = (
        difference(column(nodes_a, POSITION, i + 1), a),
        difference(column(nodes_b, POSITION, j + 1), b),
    )
    r = difference(a, b)
    uu, ww, uw = _dot(u, u) + DIVISOR_MIN, _dot(w, w) + DIVISOR_MIN, _dot(u, w)
    ur, wr = _dot(u, r), _dot(w, r)
    square = uu * ww - uw * uw
    s = 0.5
    if square > PARALLEL * uu * ww:
        s = min(max((uw * wr - ur * ww) / square, 0.0), 1.0)
    t = (uw * s + wr) / ww
    if t < 0.0:
        t, s = 0.0, min(max(-ur / uu, 0.0), 1.0)
    elif t > 1.0:
        t, s = 1.0, min(max((uw - ur) / uu, 0.0), 1.0)
    gap = (r[0] + s * u[0] - t * w[0], r[1] + s * u[1] - t * w[1], r[2] + s * u[2] - t * w[2])
    return s, t, gap


@jit_exact
def _is_nearest(contact: Any, pair: Any, s: float, t: float, gap: Any, last: Any) -> bool:
    """Return whether a pair's closest points are the local minimum of the distance of the ropes.

    On the concave side of a bend the elements on either side of its node are both near: only the
    nearer one is active.
    """
    nodes_a, i, nodes_b, j = pair
    if (s >= 1.0 and i < last[0]) or (t >= 1.0 and j < last[1]):
        return False  # assigned to the element above
    if s <= 0.0 and i > 1 and _closest(nodes_a, i - 1, nodes_b, j)[0] < 1.0:
        return False
    if t <= 0.0 and j > 1 and _closest(nodes_a, i, nodes_b, j - 1)[1] < 1.0:
        return False
    point, distance2 = (
        _interpolated(column(nodes_a, POSITION, i), column(nodes_a, POSITION, i + 1), s),
        _dot(gap, gap),
    )
    for e in range(max(i - 1, 1), min(i + 1, last[0]) + 1):
        for f in range(max(j - 1, 1), min(j + 1, last[1]) + 1):
            if e == i and f == j:
                continue
            u, _, other_gap = _closest(nodes_a, e, nodes_b, f)
            other_point = _interpolated(
                column(nodes_a, POSITION, e), column(nodes_a, POSITION, e + 1), u
            )
            offset, other_distance2 = difference(other_point, point), _dot(other_gap, other_gap)
            precedes = e < i or (e == i and f < j)
            if _dot(offset, offset) < 4.0 * contact.reach * contact.reach and (
                other_distance2 < distance2
                or (other_distance2 == distance2 and precedes and 0.0 < u < 1.0)
            ):
                return False
    return True


@jit
def side_of(dot: Any, gap: Any, before: Any) -> Any:
    """Return the unit vector n from the other rope, and n·(P - Q).

    dot: inner product, as the caller rounds it; before: P - Q at the start.
    """
    size, size_before = sqrt(dot(gap, gap)), sqrt(dot(before, before))
    separated = size > 1e-6 * size_before
    sign = choose(dot(gap, before) >= 0.0, 1.0, -1.0)
    inverse = choose(separated, sign / (size + DIVISOR_MIN), 1.0 / (size_before + DIVISOR_MIN))
    x, y = choose(separated, gap[0], before[0]), choose(separated, gap[1], before[1])
    z = choose(separated, gap[2], before[2])
    return (x * inverse, y * inverse, z * inverse), choose(separated, sign * size, 0.0)


@jit_within
def press(dot: Any, contact: Any, penetration: Any, n: Any, v: Any) -> Any:
    """Return N, its gain 1 - χ·v_n, v_n, v_t, and friction per sliding velocity [N·s/m]."""
    speed = dot(v, n)
    gain = max(1.0 - contact.chi * speed, 0.0)
    N = contact.k * penetration * gain
    sliding = (v[0] - speed * n[0], v[1] - speed * n[1], v[2] - speed * n[2])
    return (
        N,
        gain,
        speed,
        sliding,
        contact.mu * N / sqrt(dot(sliding, sliding) + FRICTION_SPEED * FRICTION_SPEED),
    )


@jit_within
def contact_block(across: Any, along: Any, n: Any) -> Any:
    """Return across·I + along·nnᵀ (xx, xy, xz, yy, yz, zz)."""
    return (
        across + along * n[0] * n[0], along * n[0] * n[1], along * n[0] * n[2],
        across + along * n[1] * n[1], along * n[1] * n[2], across + along * n[2] * n[2],
    )  # fmt: skip


_press, _block = jit_exact_within(press), jit_exact_within(contact_block)


@jit_exact_within
def _relative(nodes_a: Any, i: int, s: float, nodes_b: Any, j: int, t: float) -> Any:
    """Return the velocity of P relative to Q."""
    velocity = _interpolated(column(nodes_a, VELOCITY, i), column(nodes_a, VELOCITY, i + 1), s)
    return difference(
        velocity, _interpolated(column(nodes_b, VELOCITY, j), column(nodes_b, VELOCITY, j + 1), t)
    )


@jit_exact
def _add(work: Any, i: int, weight: float, force: Any, block: Any) -> None:
    """Add weighted force and block to a node."""
    for k in range(3):
        work[RESIDUAL + k, i] += weight * force[k]
    for k in range(6):
        work[BLOCK + k, i] += 2.0 * abs(weight) * block[k]


@jit_exact
def _add_contact(contact: Any, works: Any, starts: Any, pair: Any, last: Any, stage: Any) -> None:
    """Add the contact forces of a pair of elements."""
    (work_a, work_b), (i, j) = works, pair
    s, t, gap = _closest(work_a, i, work_b, j)
    n, distance = side_of(_dot, gap, _closest(starts[0], i, starts[1], j)[2])
    penetration = contact.reach - distance
    if penetration <= 0.0 or not _is_nearest(contact, (work_a, i, work_b, j), s, t, gap, last):
        return
    N, gain, _, sliding, friction = _press(
        _dot, contact, penetration, n, _relative(work_a, i, s, work_b, j, t)
    )
    if N == 0.0:
        return
    across = stage.q * friction
    along = stage.p * contact.k * gain + stage.q * contact.chi * contact.k * penetration - across
    force = (
        N * n[0] - friction * sliding[0],
        N * n[1] - friction * sliding[1],
        N * n[2] - friction * sliding[2],
    )
    block = _block(across, along, n)
    _add(work_a, i, 1.0 - s, force, block)
    _add(work_a, i + 1, s, force, block)
    _add(work_b, j, t - 1.0, force, block)
    _add(work_b, j + 1, -t, force, block)


@jit
def _bounding_box(table: Any, start: Any, low: int, high: int) -> Any:
    """Return the bounding box of the elements low <= e < high, now and at the start of the step."""
    ax, ay, az = column(table, POSITION, low)
    bx, by, bz = ax, ay, az
    for i in range(low, high + 1):
        x, y, z = column(table, POSITION, i)
        u, v, w = column(start, POSITION, i)
        ax, ay, az = min(ax, min(x, u)), min(ay, min(y, v)), min(az, min(z, w))
        bx, by, bz = max(bx, max(x, u)), max(by, max(y, v)), max(bz, max(z, w))
    return ax, ay, az, bx, by, bz


@jit_within
def _are_apart(a: Any, b: Any, reach: Any) -> Any:
    """Return whether two boxes are farther apart than `reach`."""
    return (
        (a[0] - reach > b[3]) | (b[0] - reach > a[3]) | (a[1] - reach > b[4])
        | (b[1] - reach > a[4]) | (a[2] - reach > b[5]) | (b[2] - reach > a[5])
    )  # fmt: skip


# Whether two boxes are not farther apart than `reach`; in lanes: bits.
_are_near = by_width(
    jit_within(lambda a, b, reach: int(not _are_apart(a, b, reach))),
    jit_within(lambda a, b, reach: ALL - bits(_are_apart(a, b, reach))),
)


@jit
def _add_in_lanes(contact: Any, stack: Any, ropes: Any, pair: Any, last: Any, context: Any) -> None:
    """Add the contact forces of a pair of elements in some lanes, one after another.

    context: stage, and lanes as bits.
    """
    (r, o), (stage, lanes) = ropes, context
    for lane in range(LANES):
        if lanes >> lane & 1:
            _add_contact(
                LineContact(
                    lane_of(contact.k, lane),
                    lane_of(contact.chi, lane),
                    lane_of(contact.mu, lane),
                    lane_of(contact.reach, lane),
                ),
                (stack.work[r, :, :, lane].T, stack.work[o, :, :, lane].T),
                (stack.nodes[r, :, :, lane].T, stack.nodes[o, :, :, lane].T),
                pair,
                last,
                Stage(stage.time, stage.p, stage.q, 0.0),
            )


# Add the contact forces of elements i, j of the ropes r, o; lanes: in which they are near, as bits.
_touch = by_type(
    LaneStage,
    lambda stage, contact, stack, ropes, pair, last, lanes: _add_in_lanes(
        contact, stack, ropes, pair, last, (stage, lanes)
    ),
    lambda stage, contact, stack, ropes, pair, last, lanes: _add_contact(
        contact,
        (stack.work[ropes[0]], stack.work[ropes[1]]),
        (stack.nodes[ropes[0]], stack.nodes[ropes[1]]),
        pair,
        last,
        stage,
    ),
)
# Lanes that a stage evaluates, as bits; 1 for a single system.
_lanes_of = by_type(LaneStage, lambda stage: stage.lanes, lambda stage: 1)


@jit
def _bound_groups(stack: Any, r: int) -> None:
    """Store the bounding boxes of a rope's groups of elements."""
    work, start, n = work_of(stack, r)[0], nodes_of(stack, r)[0], stack.counts[r, ELEMENTS]
    for low in range(1, n - 1, GROUP_ELEMENTS):
        box = _bounding_box(work, start, low, min(low + GROUP_ELEMENTS, n - 1))
        for k in range(6):
            work[BOX + k, low // GROUP_ELEMENTS] = box[k]


@jit_within
def _box_at(work: Any, low: int) -> Any:
    """Return the bounding box of the group from element `low` on."""
    group = low // GROUP_ELEMENTS
    return column(work, BOX, group) + column(work, BOX + 3, group)


@jit
def _add_between_ropes(contact: Any, stack: Any, r: int, o: int, stage: Any) -> None:
    """Add the forces between two ropes."""
    work_a, work_b, reach = work_of(stack, r)[0], work_of(stack, o)[0], contact.reach
    n, m = stack.counts[r, ELEMENTS], stack.counts[o, ELEMENTS]
    for low in range(1, n - 1, GROUP_ELEMENTS):
        box = _box_at(work_a, low)
        for under in range(1, m - 1, GROUP_ELEMENTS):
            near = _lanes_of(stage) & _are_near(box, _box_at(work_b, under), reach)
            if near != 0:
                high, over = min(low + GROUP_ELEMENTS, n - 1), min(under + GROUP_ELEMENTS, m - 1)
                _add_between_groups(contact, stack, (r, o), (low, high, under, over), (stage, near))


@jit
def _add_between_groups(contact: Any, stack: Any, ropes: Any, limits: Any, context: Any) -> None:
    """Add the forces between the elements low <= i < high and under <= j < over of two ropes.

    limits: low, high, under, over; context: stage, and the lanes in which they are near.
    """
    (r, o), (low, high, under, over), (stage, near) = ropes, limits, context
    work_a, work_b = work_of(stack, r)[0], work_of(stack, o)[0]
    start_a, start_b = nodes_of(stack, r)[0], nodes_of(stack, o)[0]
    last = (stack.counts[r, ELEMENTS] - 2, stack.counts[o, ELEMENTS] - 2)
    for i in range(low, high):
        box = _bounding_box(work_a, start_a, i, i + 1)
        for j in range(under, over):
            other_box = _bounding_box(work_b, start_b, j, j + 1)
            lanes = near & _are_near(box, other_box, contact.reach)
            if lanes != 0:
                _touch(stage, contact, stack, ropes, (i, j), last, lanes)


@kernel("interact", LineContact, wide=True)
def interact(contact: Any, system: Any, stage: Any) -> None:
    """Add the forces between all ropes of a system."""
    if stage.time < BEGIN_S:
        return
    stack = system.stack
    for r in range(stack.counts.shape[0]):
        _bound_groups(stack, r)
    for r in range(stack.counts.shape[0]):
        for o in range(r + 1, stack.counts.shape[0]):
            _add_between_ropes(contact, stack, r, o, stage)


has_active_set(LineContact)


# Add the forces of effects that act between ropes.
add_interactions = calls_of("interact", "system, stage")


class RopeContact(NamedTuple):
    """Contact between ropes at a step boundary."""

    stored: float  # elastic energy [J]
    lost: float  # dissipated [W]
    push: float  # sum of all normal forces [N]
    deepest: float  # largest penetration [m]
    contacts: int
    at: tuple[float, float, float]  # where the largest normal force acts [m]


@jit_entry
def _measure(
    contact: Any, nodes_a: Any, counts_a: Any, nodes_b: Any, counts_b: Any, result: Any
) -> None:
    n, m = counts_a[ELEMENTS], counts_b[ELEMENTS]
    for i in range(1, n - 1):
        element_box, far = _bounding_box(nodes_a, nodes_a, i, i + 1), False
        for j in range(1, m - 1):
            if (j - 1) % GROUP_ELEMENTS == 0:
                bunch_box = _bounding_box(nodes_b, nodes_b, j, min(j + GROUP_ELEMENTS, m - 1))
                far = _are_apart(element_box, bunch_box, contact.reach)
            if far or _are_apart(
                element_box, _bounding_box(nodes_b, nodes_b, j, j + 1), contact.reach
            ):
                continue
            s, t, gap = _closest(nodes_a, i, nodes_b, j)
            n_vector, distance = side_of(_dot, gap, gap)
            penetration = contact.reach - distance
            if penetration <= 0.0 or not _is_nearest(
                contact, (nodes_a, i, nodes_b, j), s, t, gap, (n - 2, m - 2)
            ):
                continue
            v = _relative(nodes_a, i, s, nodes_b, j, t)
            N, _, speed, sliding, friction = _press(_dot, contact, penetration, n_vector, v)
            result[0] += 0.5 * contact.k * penetration * penetration
            rubbed = friction * _dot(sliding, sliding)
            result[1] += (contact.k * penetration - N) * speed + rubbed
            result[2] += N
            result[3] = max(result[3], penetration)
            result[4] += 1.0
            if result[5] < N:
                result[5] = N
                position = _interpolated(
                    column(nodes_a, POSITION, i), column(nodes_a, POSITION, i + 1), s
                )
                result[6], result[7], result[8] = position


def rope_contact_of(system: Any) -> RopeContact | None:
    """Return the present contact between the ropes of a system, or None if not modelled."""
    ends = combinations(((rope.state.nodes, rope.state.counts) for rope in system.ropes), 2)
    return measured(system, LineContact, _measure, (a + b for a, b in ends))


def measured(
    system: Any, kind: type, measure: Any, arrays: Iterable[tuple[Any, ...]]
) -> RopeContact | None:
    """Return the contact of all these arrays for an effect of this type, or None without one."""
    contact = next((effect for effect in system.stack.effects if isinstance(effect, kind)), None)
    if contact is None:
        return None
    result: Floats = np.zeros(9)
    for some in arrays:
        measure(contact, *some, result)
    stored, lost, push, deepest, contacts, _, x, y, z = result.tolist()
    return RopeContact(stored, lost, push, deepest, int(contacts), (x, y, z))
