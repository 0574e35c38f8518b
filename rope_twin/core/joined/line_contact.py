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
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.elimination import dot
from rope_twin.core.jit.decorators import jit, jit_entry, jit_within
from rope_twin.core.jit.rows import column
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.hooks import calls_of, has_active_set, kernel
from rope_twin.core.state import BLOCK, DIVISOR_MIN, ELEMENTS, POSITION, RESIDUAL, VELOCITY, Floats

GROUP_ELEMENTS = 8  # elements per group, for a broad phase with bounding boxes
BEGIN_S = 1e-9  # time from which on contact is active; static solutions are before
FRICTION_SPEED = 0.01  # v_0 [m/s]
PARALLEL = 1e-9  # sine² of the angle below which two elements are parallel


class LineContact(NamedTuple):
    """Kernel data of contact between ropes."""

    k: float  # stiffness of a contact [N/m]
    chi: float  # χ [s/m]
    mu: float  # μ
    reach: float  # distance of the centre lines at contact [m]


@jit_within
def difference(a: Any, b: Any) -> Any:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@jit_within
def _interpolated(a: Any, b: Any, t: float) -> Any:
    low = 1.0 - t
    return low * a[0] + t * b[0], low * a[1] + t * b[1], low * a[2] + t * b[2]


@jit
def _closest(nodes_a: Any, i: int, nodes_b: Any, j: int) -> Any:
    """Return the fractions s, t of the closest points of two elements, and the vector between."""
    a, b = column(nodes_a, POSITION, i), column(nodes_b, POSITION, j)
    u, w = (
        difference(column(nodes_a, POSITION, i + 1), a),
        difference(column(nodes_b, POSITION, j + 1), b),
    )
    r = difference(a, b)
    uu, ww, uw = dot(u, u) + DIVISOR_MIN, dot(w, w) + DIVISOR_MIN, dot(u, w)
    ur, wr = dot(u, r), dot(w, r)
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


@jit
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
        dot(gap, gap),
    )
    for e in range(max(i - 1, 1), min(i + 1, last[0]) + 1):
        for f in range(max(j - 1, 1), min(j + 1, last[1]) + 1):
            if e == i and f == j:
                continue
            u, _, other_gap = _closest(nodes_a, e, nodes_b, f)
            other_point = _interpolated(
                column(nodes_a, POSITION, e), column(nodes_a, POSITION, e + 1), u
            )
            offset, other_distance2 = difference(other_point, point), dot(other_gap, other_gap)
            precedes = e < i or (e == i and f < j)
            if dot(offset, offset) < 4.0 * contact.reach * contact.reach and (
                other_distance2 < distance2
                or (other_distance2 == distance2 and precedes and 0.0 < u < 1.0)
            ):
                return False
    return True


@jit
def side_of(gap: Any, before: Any) -> Any:
    """Return the unit vector n from the other rope, and n·(P - Q); before: P - Q at the start."""
    size, size_before = sqrt(dot(gap, gap)), sqrt(dot(before, before))
    separated = size > 1e-6 * size_before
    sign = choose(dot(gap, before) >= 0.0, 1.0, -1.0)
    inverse = choose(separated, sign / (size + DIVISOR_MIN), 1.0 / (size_before + DIVISOR_MIN))
    x, y = choose(separated, gap[0], before[0]), choose(separated, gap[1], before[1])
    z = choose(separated, gap[2], before[2])
    return (x * inverse, y * inverse, z * inverse), choose(separated, sign * size, 0.0)


@jit_within
def press(contact: Any, penetration: Any, n: Any, v: Any) -> Any:
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


@jit_within
def _relative(nodes_a: Any, i: int, s: float, nodes_b: Any, j: int, t: float) -> Any:
    """Return the velocity of P relative to Q."""
    velocity = _interpolated(column(nodes_a, VELOCITY, i), column(nodes_a, VELOCITY, i + 1), s)
    return difference(
        velocity, _interpolated(column(nodes_b, VELOCITY, j), column(nodes_b, VELOCITY, j + 1), t)
    )


@jit
def _add(work: Any, i: int, weight: float, force: Any, block: Any) -> None:
    """Add weighted force and block to a node."""
    for k in range(3):
        work[RESIDUAL + k, i] += weight * force[k]
    for k in range(6):
        work[BLOCK + k, i] += 2.0 * abs(weight) * block[k]


@jit
def _add_contact(contact: Any, pair: Any, stage: Any) -> None:
    """Add the contact forces of a pair of elements."""
    work_a, i, work_b, j, starts, last = pair
    s, t, gap = _closest(work_a, i, work_b, j)
    n, distance = side_of(gap, _closest(starts[0], i, starts[1], j)[2])
    penetration = contact.reach - distance
    if penetration <= 0.0 or not _is_nearest(contact, (work_a, i, work_b, j), s, t, gap, last):
        return
    N, gain, _, sliding, friction = press(
        contact, penetration, n, _relative(work_a, i, s, work_b, j, t)
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
    block = contact_block(across, along, n)
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
        ax, ay, az = min(ax, x, u), min(ay, y, v), min(az, z, w)
        bx, by, bz = max(bx, x, u), max(by, y, v), max(bz, z, w)
    return ax, ay, az, bx, by, bz


@jit_within
def _are_apart(a: Any, b: Any, reach: float) -> bool:
    """Return whether two boxes are farther apart than `reach`."""
    return bool(
        a[0] - reach > b[3] or b[0] - reach > a[3] or a[1] - reach > b[4] or b[1] - reach > a[4]
        or a[2] - reach > b[5] or b[2] - reach > a[5]
    )  # fmt: skip


@jit
def _add_between_ropes(contact: Any, works: Any, starts: Any, counts: Any, stage: Any) -> None:
    """Add the forces between two ropes; counts: their elements."""
    (work_a, work_b), (n, m), reach = works, counts, contact.reach
    last = (n - 2, m - 2)
    for low in range(1, n - 1, GROUP_ELEMENTS):
        high = min(low + GROUP_ELEMENTS, n - 1)
        box_a = _bounding_box(work_a, starts[0], low, high)
        for under in range(1, m - 1, GROUP_ELEMENTS):
            over = min(under + GROUP_ELEMENTS, m - 1)
            if _are_apart(box_a, _bounding_box(work_b, starts[1], under, over), reach):
                continue
            for i in range(low, high):
                element_box = _bounding_box(work_a, starts[0], i, i + 1)
                for j in range(under, over):
                    if not _are_apart(
                        element_box, _bounding_box(work_b, starts[1], j, j + 1), reach
                    ):
                        _add_contact(contact, (work_a, i, work_b, j, starts, last), stage)


@kernel("interact", LineContact)
def interact(contact: Any, system: Any, stage: Any) -> None:
    """Add the forces between all ropes of a system."""
    if stage.time < BEGIN_S:
        return
    stack = system.stack
    for r in range(stack.counts.shape[0]):
        for o in range(r + 1, stack.counts.shape[0]):
            works, starts = (stack.work[r], stack.work[o]), (stack.nodes[r], stack.nodes[o])
            counts = (stack.counts[r, ELEMENTS], stack.counts[o, ELEMENTS])
            _add_between_ropes(contact, works, starts, counts, stage)


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
def _measure(contact: Any, nodes: Any, counts: Any, result: Any) -> None:
    for r in range(counts.shape[0]):
        for o in range(r + 1, counts.shape[0]):
            nodes_a, nodes_b, n, m = nodes[r], nodes[o], counts[r, ELEMENTS], counts[o, ELEMENTS]
            for i in range(1, n - 1):
                element_box, far = _bounding_box(nodes_a, nodes_a, i, i + 1), False
                for j in range(1, m - 1):
                    if (j - 1) % GROUP_ELEMENTS == 0:
                        bunch_box = _bounding_box(
                            nodes_b, nodes_b, j, min(j + GROUP_ELEMENTS, m - 1)
                        )
                        far = _are_apart(element_box, bunch_box, contact.reach)
                    if far or _are_apart(
                        element_box, _bounding_box(nodes_b, nodes_b, j, j + 1), contact.reach
                    ):
                        continue
                    s, t, gap = _closest(nodes_a, i, nodes_b, j)
                    n_vector, distance = side_of(gap, gap)
                    penetration = contact.reach - distance
                    if penetration <= 0.0 or not _is_nearest(
                        contact, (nodes_a, i, nodes_b, j), s, t, gap, (n - 2, m - 2)
                    ):
                        continue
                    v = _relative(nodes_a, i, s, nodes_b, j, t)
                    N, _, speed, sliding, friction = press(contact, penetration, n_vector, v)
                    result[0] += 0.5 * contact.k * penetration * penetration
                    result[1] += (contact.k * penetration - N) * speed + friction * dot(
                        sliding, sliding
                    )
                    result[2] += N
                    result[3] = max(result[3], penetration)
                    result[4] += 1.0
                    if result[5] < N:
                        result[5] = N
                        position = _interpolated(
                            column(nodes_a, POSITION, i), column(nodes_a, POSITION, i + 1), s
                        )
                        result[6], result[7], result[8] = position


def rope_contact_of(stack: Any) -> RopeContact | None:
    """Return the present contact between the ropes of a stack, or None if not modelled."""
    return measured(stack, LineContact, _measure, stack.nodes, stack.counts)


def measured(stack: Any, kind: type, measure: Any, *arrays: Any) -> RopeContact | None:
    """Return the contact that `measure` evaluates for an effect of this type, or None."""
    contact = next((effect for effect in stack.effects if isinstance(effect, kind)), None)
    if contact is None:
        return None
    result: Floats = np.zeros(9)
    measure(contact, *arrays, result)
    stored, lost, push, deepest, contacts, _, x, y, z = result.tolist()
    return RopeContact(stored, lost, push, deepest, int(contacts), (x, y, z))
