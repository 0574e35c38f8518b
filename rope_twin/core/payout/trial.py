"""Ghost nodes at the end of the arrays: probes on the rope where the force per metre is evaluated.

LOW is the node below the top element, HIGH the rope that passes the hang-off, MIDDLE the node that
a split would create between them. AFTER is the rope at the hang-off as the next event would leave
it: of the section above a new node, or, without a split, with the node below removed.

They are loaded after every step, in one pass: HIGH gives the tension at the hang-off, and the
others let a split or a merge balance its forces without evaluating an effect again.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.acting import loads
from rope_twin.core.guards import STRETCH2_MIN
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.rope.sections import section_above
from rope_twin.core.solve.assembly import set_flow
from rope_twin.core.state import (
    ACCELERATION,
    DIRECTION,
    ELEMENTS,
    MASS,
    NODE_ROWS,
    PER_METRE,
    POSITION,
    RESIDUAL,
    REST,
    SKIN,
    TANGENT,
    VELOCITY,
)

LOW, MIDDLE, HIGH, AFTER = -4, -3, -2, -1  # from the end of the arrays
TRIALS = 4


@jit
def _set_material(rope: Any, below: int, rest: float, V: float, A: float, slot: int) -> None:
    """Set a ghost node to the rope at the hang-off, whose element extends down to node `below`.

    Its velocity is v - V·q and its acceleration a - A·q - 2·V·dq/dt, with q the element's vector
    over its unstretched length.
    """
    nodes, work = rope.state.nodes, rope.work
    n = rope.state.counts[ELEMENTS]
    dx = nodes[POSITION, n] - nodes[POSITION, below]
    dy = nodes[POSITION + 1, n] - nodes[POSITION + 1, below]
    dz = nodes[POSITION + 2, n] - nodes[POSITION + 2, below]
    work[TANGENT, slot], work[TANGENT + 1, slot], work[TANGENT + 2, slot] = dx, dy, dz
    length = sqrt(dx * dx + dy * dy + dz * dz + STRETCH2_MIN * rest * rest)
    for k in range(3):
        q = work[TANGENT + k, slot] / rest
        q_rate = (nodes[VELOCITY + k, n] - nodes[VELOCITY + k, below] - V * q) / rest
        work[POSITION + k, slot] = nodes[POSITION + k, n]
        work[VELOCITY + k, slot] = nodes[VELOCITY + k, n] - V * q
        work[ACCELERATION + k, slot] = nodes[ACCELERATION + k, n] - A * q - 2.0 * V * q_rate
        work[TANGENT + k, slot] /= length


@jit
def load_trials(rope: Any, stage: Any, A: float, lower: float) -> None:
    """Evaluate force less inertia per metre at the ghost nodes, into their RESIDUAL.

    For the state after a step: `work` holds its elements, stage its time and payout speed V, A is
    the rate of V, `lower` the unstretched length below MIDDLE.
    """
    s, sections = rope.state.s, rope.sections
    n = rope.state.counts[ELEMENTS]
    here = section_above(sections, s[n - 1])
    other = section_above(sections, s[n - 1] + lower if lower > 0.0 else s[n - 2])
    load_trials_of(rope, stage, A, lower, here, other)


@jit
def load_trials_of(rope: Any, stage: Any, A: float, lower: float, here: int, other: int) -> None:
    """Evaluate the ghost nodes; here, other: sections at the hang-off and of AFTER."""
    state, work, sections = rope.state, rope.work, rope.sections
    n, slots = state.counts[ELEMENTS], state.s.shape[0]
    low, middle, high, after = slots + LOW, slots + MIDDLE, slots + HIGH, slots + AFTER
    rest = work[REST, n - 1]
    xi = min(lower / rest, 1.0)
    _set_material(rope, n - 1, rest, stage.V, A, high)
    below, length = n - 1, rest
    if not lower > 0.0:
        below, length = n - 2, rest + work[REST, n - 2]
    _set_material(rope, below, length, stage.V, A, after)
    for k in range(NODE_ROWS):
        work[k, low] = state.nodes[k, n - 1]
        work[k, middle] = (1.0 - xi) * work[k, low] + xi * work[k, high]
    for k in range(TANGENT, TANGENT + 3):
        work[k, low] = work[k, middle] = work[k, high]
    for row in range(MASS, SKIN + 1):
        own, others = (
            sections[row - MASS + PER_METRE, here],
            sections[row - MASS + PER_METRE, other],
        )
        work[row, low], work[row, high], work[row, after] = own, own, others
        work[row, middle] = xi * own + (1.0 - xi) * others
    for slot in range(low, slots):
        for k in range(3):
            work[RESIDUAL + k, slot] = 0.0
    set_flow(rope.effects, work, stage, low, slots)
    loads.add_load(rope.effects, work, stage, low, slots)


@jit_within
def set_trials(memory: Any, row: int, value: float, rope: Any) -> None:
    """Set one value at every ghost node, in a row of an effect's internal variables."""
    slots = rope.state.s.shape[0]
    for slot in range(slots - TRIALS, slots):
        memory[row, slot] = value


@jit
def along(work: Any, slot: int, element: int) -> float:
    """Return the component of a ghost node's load along an element [N/m]."""
    total = 0.0
    for k in range(3):
        total += work[RESIDUAL + k, slot] * work[DIRECTION + k, element]
    return total
