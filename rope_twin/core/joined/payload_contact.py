"""Contact between the payloads and hooks of a system: spheres about connections, with friction.

Two bodies touch where their centres come nearer than the sum r of their radii. With n the unit
vector from one centre to the other and the penetration e = r - n·(x - x'), normal force and
friction are those between ropes (core/joined/line_contact), at the centres: a point has no
rotation. The sign of n is that of the start of the step, so that bodies whose centres pass each
other within a step are pushed back.

The connections belong to the dense system, with the coupled block p·∂f/∂x + q·∂f/∂v of a pair,
without the curvature -N/|x - x'| across n and the change of friction with N, which would make it
indefinite or unsymmetric. Contact is active in static equilibrium too, without friction.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rope_twin.core.elimination import dot
from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.jit.functions import anywhere
from rope_twin.core.jit.rows import column
from rope_twin.core.jit.wide import choose, whole
from rope_twin.core.joined.joints import System, add_block, couple_blocks
from rope_twin.core.joined.line_contact import (
    RopeContact,
    contact_block,
    difference,
    measured,
    press,
    side_of,
)
from rope_twin.core.loads.hooks import has_active_set, kernel
from rope_twin.core.state import POSITION, RESIDUAL, VELOCITY, Floats, Ints


class PayloadContact(NamedTuple):
    """Kernel data of contact between payloads."""

    joints: Ints  # connection of each body, (bodies,)
    radii: Floats  # [m], (bodies,)
    k: float  # stiffness of a contact [N/m]
    chi: float  # χ [s/m]
    mu: float  # μ


@jit
def _penetration(contact: Any, motion: Any, start: Any, a: int, b: int) -> Any:
    """Return the direction n from body b to body a, and e."""
    i, j = whole(contact.joints[a]), whole(contact.joints[b])
    gap = difference(column(motion, POSITION, i), column(motion, POSITION, j))
    before = difference(column(start, POSITION, i), column(start, POSITION, j))
    n, distance = side_of(dot, gap, before)
    return n, contact.radii[a] + contact.radii[b] - distance


@jit
def _touch(contact: Any, joints: Any, a: int, b: int, stage: Any) -> None:
    """Add force and block of two bodies."""
    n, penetration = _penetration(contact, joints.work, joints.nodes, a, b)
    if not anywhere(penetration > 0.0):
        return
    i, j = whole(contact.joints[a]), whole(contact.joints[b])
    v = difference(column(joints.work, VELOCITY, i), column(joints.work, VELOCITY, j))
    N, gain, _, sliding, friction = press(dot, contact, penetration, n, v)
    presses = N > 0.0
    if not anywhere(presses):
        return
    across = stage.q * friction
    along = (stage.p * gain + stage.q * contact.chi * penetration) * contact.k - across
    across, along = choose(presses, across, 0.0), choose(presses, along, 0.0)
    block = contact_block(across, along, n)
    for k in range(3):
        force = choose(presses, N * n[k] - friction * sliding[k], 0.0)
        joints.work[RESIDUAL + k, i] += force
        joints.work[RESIDUAL + k, j] -= force
    add_block(joints.matrix, i, block)
    add_block(joints.matrix, j, block)
    couple_blocks(joints.matrix, max(i, j), min(i, j), block)


@kernel("interact", PayloadContact, wide=True)
def interact(contact: Any, system: Any, stage: Any) -> None:
    """Add the forces between all bodies of a system."""
    for a in range(contact.joints.shape[0]):
        for b in range(a):
            _touch(contact, system.joints, a, b, stage)


has_active_set(PayloadContact)


@jit_entry
def _measure(contact: Any, nodes: Any, result: Any) -> None:
    for a in range(contact.joints.shape[0]):
        for b in range(a):
            n, deep = _penetration(contact, nodes, nodes, a, b)
            if deep <= 0.0:
                continue
            i, j = contact.joints[a], contact.joints[b]
            v = difference(column(nodes, VELOCITY, i), column(nodes, VELOCITY, j))
            N, _, out, slid, rub = press(dot, contact, deep, n, v)
            result[0] += 0.5 * contact.k * deep * deep
            result[1] += (contact.k * deep - N) * out
            result[1] += rub * (slid[0] * slid[0] + slid[1] * slid[1] + slid[2] * slid[2])
            result[2] += N
            result[3] = max(result[3], deep)
            result[4] += 1.0
            if result[5] < N:
                result[5] = N
                for k in range(3):
                    low = nodes[POSITION + k, j] + contact.radii[b] * n[k]
                    result[6 + k] = low - 0.5 * deep * n[k]


def payload_contact_of(system: System) -> RopeContact | None:
    """Return the present contact between payloads, or None if not modelled."""
    return measured(system, PayloadContact, _measure, [(system.joints.nodes,)])
