"""Energy balance of a rope or a multi-line system, from the states at step boundaries.

It is evaluated in numpy, outside the compiled step, and only on request. An effect registers its
stored energy and its power by `@account(kind, Type)` (core/loads/accounts).

The balance is that of the lumped-mass model, so that only the time integration error remains:
with w the material velocity at the hang-off and F the force there, M·a = T_i·t_i - T_{i-1}·t_{i-1}
+ f times v, summed, gives d(energy)/dt = F·w + V·(energy per metre there) + water - damper, where
the top element may grow at V. Three terms of the order of the mesh size are neglected:
mass·V·|w - v_{n-1}|²/4, the work of decaying length corrections, and the change at a split or
merge.

**Multi-line systems.** Each rope is evaluated like a single one, with its own payout speed. The
forces of a connection on the ropes' ends cancel, as it has one motion. So do those of a sheave on
the rope that runs over it at V: the power F·V·q of both sides (F the tensions, q the last elements'
vectors over their unstretched lengths), the energy transported by V from one side to the other, the
power on the wheel and that of the momentum flux m·V²·(q + q') sum up to V/2·(difference of both
strains)·(F + F' - T - T'), with T the last elements' tensions: the contribution of half an element,
which is neglected. A sheave adds its kinetic energy, that of its wheel, its potential energy, and
the friction of the rope.

A link or a contact between ropes or payloads stores the work of its elastic force; its damping and
friction dissipate.
"""

from __future__ import annotations

from math import acos, tanh
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.axial_law import FibreLaw, elastic_state, instantaneous_tension, sections_law
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.joined import joints as ties
from rope_twin.core.joined.joints import LOOSE, Joints, System
from rope_twin.core.joined.line_contact import rope_contact_of
from rope_twin.core.joined.payload_contact import payload_contact_of
from rope_twin.core.joined.stack import (
    FLOW_COLUMN,
    FRICTION,
    FROM,
    INTO,
    NOWHERE,
    POINT,
    SHEAVE_FRICTION_SPEED,
    SHEAVE_MASS,
    SHEAVE_WEIGHT,
    WHEEL,
    Sheaves,
)
from rope_twin.core.loads.accounts import Place, account_sum, law_of_lowest, wetted
from rope_twin.core.loads.balance import lower_end_force, set_flow
from rope_twin.core.loads.hooks import ramped
from rope_twin.core.moved_end import has_moved_end
from rope_twin.core.state import (
    ACCELERATION,
    EA,
    ELEMENTS,
    END,
    FLOW,
    FLOW_RATE,
    LINK2_MIN,
    MASS,
    NODE_ROWS,
    PER_METRE,
    POSITION,
    PULL,
    PULL_X,
    PULL_Z,
    SAME_PLACE,
    STRETCH2_MIN,
    SURFACE,
    TANGENT2_MIN,
    VELOCITY,
    C,
    Floats,
    Rope,
    Stage,
    new_work,
)


class Elements(NamedTuple):
    """Element quantities from the lower end up; vectors (3, n), scalars (n,)."""

    direction: Floats
    turning: Floats  # rate of the direction [1/s]
    stored: Floats  # elastic energy [J]
    damping: Floats  # force that dissipates, part of the tension [N]
    held: Floats  # energy per metre that this force has stored, in a fibre rope [J/m]
    rate: Floats  # strain rate times unstretched length [m/s]
    stretch: Floats  # length over unstretched length
    rest: Floats  # unstretched length [m]
    section: Any  # column in `sections`
    water: float = 0.0  # power of the water on the lowest element [W]


class StoredEnergy(NamedTuple):
    """Energy in rope and payload [J]."""

    kinetic: float  # added mass included
    elastic: float
    potential: float  # of weight less buoyancy, zero at the mean water level

    @property
    def total(self) -> float:
        """Return the sum of all stored energy [J]."""
        return self.kinetic + self.elastic + self.potential


class Power(NamedTuple):
    """Power into the rope [W]; negative values take energy from it."""

    hang_off: float  # force times material velocity there, and at a lower end that is moved
    passing: float  # energy carried by the rope that enters over the sheave
    water: float


class StepEnergy(NamedTuple):
    """Energy, power and elements at a step boundary."""

    store: StoredEnergy
    power: Power
    elements: Elements


def measure(rope: Rope, pull: Floats, time: float, V: float) -> StepEnergy:
    """Return energy and power of the state at a step boundary.

    pull: the rope's force on the hang-off, x, y, z [N]; time [s]; V: payout speed [m/s].
    """
    elements, effects = _elements(rope, V), ramped(rope.effects, time)
    place = _place(rope, elements, time, V)
    end = Place(*(row[..., :1] for row in place))
    sheave = _metre_at_sheave(rope, elements, place)
    store = StoredEnergy(
        kinetic=_kinetic_energy(rope.effects, place)
        + account_sum("kinetic_end", rope.effects, end),
        elastic=float(elements.stored.sum()),
        potential=account_sum("potential", rope.effects, place)
        + account_sum("potential_end", rope.effects, end),
    )
    per_metre = elements.stored[-1] / elements.rest[-1]
    per_metre += _kinetic_energy(rope.effects, sheave) + account_sum(
        "potential", rope.effects, sheave
    )
    pulled = 0.0
    if rope.model.first_free and has_moved_end(rope.effects):
        pulled = float(lower_end_force(rope, rope.effects, time) @ place.velocity[:, 0])
    power = Power(
        hang_off=-float(pull @ place.velocity[:, -1]) - pulled,
        passing=float(V * per_metre),
        water=account_sum("power", effects, wetted(effects, place))
        + account_sum("power_end", effects, end)
        + elements.water,
    )
    return StepEnergy(store, power, elements)


def damped(before: Elements, after: Elements, step: float) -> float:
    """Return the energy that the axial damper dissipates over a step [J].

    It is the mean damping force times the elongation: a stiff damper stops a motion within a
    fraction of a step, and force times rate at the step boundaries would overestimate its work. For
    an element that has just been split or merged only force times rate is available.
    """
    n = min(len(before.rest), len(after.rest))
    common = n if len(before.rest) == len(after.rest) else n - 1
    moved = 0.5 * (before.rest[:common] + after.rest[:common])
    moved *= after.stretch[:common] - before.stretch[:common]
    work = 0.5 * (before.damping[:common] + after.damping[:common]) @ moved
    for elements in (before, after):
        work += 0.5 * step * (elements.damping[common:] @ elements.rate[common:])
    rest = 0.5 * (before.rest[:common] + after.rest[:common])
    return float(work - rest @ (after.held[:common] - before.held[:common]))


def _kinetic_energy(effects: tuple[Any, ...], place: Place) -> float:
    """Return the kinetic energy of the rope including the effects' contributions [J]."""
    energy = 0.5 * float(place.mass @ (place.velocity**2).sum(axis=0))
    return energy + account_sum("kinetic", effects, place)


def _elements(rope: Rope, V: float) -> Elements:
    """Return stored and damping energy by T = max(0, E(strain) + c·strain rate) of
    `elastic.stretch`.
    """
    n, sections = int(rope.state.counts[ELEMENTS]), rope.sections
    s, offset = rope.state.s[: n + 1], rope.state.offset[:n]
    x = rope.state.nodes[POSITION : POSITION + 3, : n + 1]
    v = rope.state.nodes[VELOCITY : VELOCITY + 3, : n + 1]
    rest, dx, dv = np.diff(s), np.diff(x), np.diff(v)
    length = np.sqrt((dx * dx).sum(axis=0) + STRETCH2_MIN * rest * rest)
    direction = dx / length
    closing = (direction * dv).sum(axis=0)
    section = np.searchsorted(sections[END], s[:-1] + SAME_PLACE, side="right")
    rate = closing.copy()  # of the length, less that of the unstretched length: l_0·strain rate
    rate[-1] -= V / rest[-1] * length[-1]
    strain = (length + offset - rest) / rest
    law, damper = sections_law(rope), sections[C, section] / rest * rate
    if isinstance(law, FibreLaw):
        elastic, stored = instantaneous_tension(law, section, strain)
        pull = np.maximum(elastic + damper, 0.0)
        spring, held = np.zeros(n), stored.copy()
    else:
        spring, stored = elastic_state(law, sections[EA, section], section, strain)
        slack = sections[EA, section] * np.minimum(strain, 0.0)  # a table begins with EA
        pull, held = np.maximum(spring + slack + damper, 0.0), np.zeros(n)
    stored, damping, water = stored * rest, pull - spring, 0.0
    effect_law = law_of_lowest(rope.effects)
    if effect_law is not None:
        k, depth = sections[EA, section[0]] / rest[0], -0.5 * float(x[2, 0] + x[2, 1])
        rate_0 = float(closing[0])
        tension, restoring, rod, work = effect_law(
            float(length[0] + offset[0] - rest[0]), rate_0, k, depth
        )
        damping[0], stored[0], water = tension - restoring - rod, work, -rod * rate_0
        held[0] = 0.0
    return Elements(
        direction=direction,
        turning=(dv - closing * direction) / length,
        stored=stored,
        damping=damping,
        held=held,
        rate=rate,
        stretch=length / rest,
        rest=rest,
        section=section,
        water=water,
    )


def _place(rope: Rope, elements: Elements, time: float, V: float) -> Place:
    """Return all nodes; the hang-off node has the material velocity v - V·(element vector/l_0)."""
    n = len(elements.rest)
    x = rope.state.nodes[POSITION : POSITION + 3, : n + 1]
    v = rope.state.nodes[VELOCITY : VELOCITY + 3, : n + 1].copy()
    v[:, -1] -= V / elements.rest[-1] * (x[:, -1] - x[:, -2])
    along, turn = _at_nodes(elements.direction), _at_nodes(elements.turning)
    size = np.sqrt((along * along).sum(axis=0) + TANGENT2_MIN)
    tangent = along / size
    half = 0.5 * elements.rest * rope.sections[PER_METRE:, elements.section]
    lumps = np.zeros((len(half), n + 1))
    lumps[:, :-1] += half
    lumps[:, 1:] += half
    water = _flow(rope, lumps, time, V)
    return Place(
        arc=rope.state.s[: n + 1],
        position=x,
        velocity=v,
        acceleration=rope.state.nodes[ACCELERATION : ACCELERATION + 3, : n + 1],
        tangent=tangent,
        turning=(turn - (turn * tangent).sum(axis=0) * tangent) / size,
        flow=water[FLOW : FLOW + 3],
        flow_rate=water[FLOW_RATE : FLOW_RATE + 3],
        surface=water[SURFACE],
        **dict(zip(("mass", "volume", "frontal", "skin", "length"), lumps, strict=True)),
        bare=np.zeros(n + 1),
        touching=lumps[2],
    )


def _at_nodes(rows: Floats) -> Floats:
    """Return the sums over the elements adjacent to each node; end nodes have one element."""
    return np.concatenate([rows[:, :1], rows[:, :-1] + rows[:, 1:], rows[:, -1:]], axis=1)


def _metre_at_sheave(rope: Rope, elements: Elements, place: Place) -> Place:
    """Return one metre of the rope that passes the hang-off, as a Place."""
    end = Place(*(row[..., -1:] for row in place))
    mass, volume, frontal, skin, length = rope.sections[PER_METRE:, elements.section[-1:]]
    return end._replace(
        mass=mass, volume=volume, frontal=frontal, skin=skin, length=length, touching=frontal
    )


def _flow(rope: Rope, lumps: Floats, time: float, V: float) -> Floats:
    """Return scratch whose rows FLOW, FLOW_RATE and SURFACE hold the water at the nodes.

    lumps: rows MASS to LENGTH of the nodes.
    """
    nodes = lumps.shape[1]
    work = new_work(nodes)
    work[:NODE_ROWS] = rope.state.nodes[:, :nodes]
    work[MASS : MASS + len(lumps), :nodes] = lumps
    _find_flow(rope.effects, work, Stage(time, 1.0, 0.0, V), 0, nodes)
    return work


@jit_entry
def _find_flow(effects: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Compiled entry point of `set_flow`, to be called from Python."""
    set_flow(effects, work, stage, low, high)


class SystemStepEnergy(NamedTuple):
    """Energy and power of one rope or of a multi-line system at a step boundary."""

    store: StoredEnergy
    power: Power
    elements: tuple[Elements, ...]  # of each rope, and of the links as one more
    rubbed: float  # dissipation by sheave friction and by contact of ropes and payloads [W]


def of_one(border: StepEnergy) -> SystemStepEnergy:
    """Return the SystemBorder of a single rope."""
    return SystemStepEnergy(border.store, border.power, (border.elements,), 0.0)


def dissipated(before: SystemStepEnergy, after: SystemStepEnergy, step: float) -> float:
    """Return the energy dissipated over a step by dampers and sheave friction [J]."""
    pairs = zip(before.elements, after.elements, strict=True)
    dissipated = sum(damped(earlier, later, step) for earlier, later in pairs)
    return dissipated + 0.5 * step * (before.rubbed + after.rubbed)


def measure_system(system: System, pulls: Floats, speeds: Floats, time: float) -> SystemStepEnergy:
    """Return energy and power of the state of a system at a step boundary.

    pulls: of each rope at its upper end, (ropes, PULL_COLUMNS); speeds: payout over its hang-off,
    (ropes,) [m/s], arbitrary where there is none.
    """
    joints, sheaves = system.joints, system.sheaves
    borders: list[StepEnergy] = []
    for r, rope in enumerate(system.ropes):
        at_ship = bool(joints.upper[r] == LOOSE)
        V = float(speeds[r]) if at_ship else _sheave_speed(joints, sheaves, r)
        border = measure(_with_shared(system, rope), pulls[r, PULL_X : PULL_Z + 1], time, V)
        if not at_ship:
            border = border._replace(power=border.power._replace(hang_off=0.0, passing=0.0))
        borders.append(border)
    links, stored = _link_elements(joints)
    elements = tuple(border.elements for border in borders)
    touches = [
        contact
        for contact in (rope_contact_of(system), payload_contact_of(system))
        if contact is not None
    ]
    stored += sum(contact.stored for contact in touches)
    extra = _sheave_energy(joints, sheaves) + np.array([0.0, stored, 0.0])
    store = np.sum([border.store for border in borders], axis=0) + extra
    power = np.sum([border.power for border in borders], axis=0)
    return SystemStepEnergy(
        StoredEnergy(*store.tolist()),
        Power(*power.tolist()),
        (*elements, links),
        _friction_power(joints, sheaves, elements, pulls[:, PULL])
        + sum(contact.lost for contact in touches),
    )


def _with_shared(system: System, rope: Rope) -> Rope:
    """Return a rope with the present shared effects, which are those of the first rope.

    Shared effects, such as a current that changes in time, are stored once in the stack
    (core/joined/stack.py).
    """
    kinds = (type(effect) for effect in system.stack.effects)
    pairs = zip(kinds, rope.effects, system.ropes[0].effects, strict=True)
    return rope._replace(
        effects=tuple(
            first if kind is type(rope_effect) else rope_effect
            for kind, rope_effect, first in pairs
        )
    )


def _sheave_speed(joints: Joints, sheaves: Sheaves | None, r: int) -> float:
    """Return the speed at which rope r grows over its sheave [m/s]; 0 without a sheave."""
    if sheaves is None or sheaves.of[r] == NOWHERE:
        return 0.0
    column = int(sheaves.figures[FLOW_COLUMN, sheaves.of[r]])
    return float(sheaves.side[r] * joints.nodes[VELOCITY, column])


def _sheave_energy(joints: Joints, sheaves: Sheaves | None) -> Floats:
    """Return kinetic, elastic and potential energy of sheaves and wheels [J], (3,)."""
    energy = np.zeros(3)
    if sheaves is None:
        return energy
    for column in sheaves.figures.T:
        point, flow = int(column[POINT]), int(column[FLOW_COLUMN])
        v = joints.nodes[VELOCITY : VELOCITY + 3, point]
        V = joints.nodes[VELOCITY, flow]
        energy[0] += 0.5 * (column[SHEAVE_MASS] * float(v @ v) + column[WHEEL] * V * V)
        energy[2] += column[SHEAVE_WEIGHT] * joints.nodes[POSITION + 2, point]
    return energy


def _friction_power(
    joints: Joints, sheaves: Sheaves | None, elements: tuple[Elements, ...], pulls: Floats
) -> float:
    """Return the power of friction between ropes and sheaves, as in `core.joined.sheaves` [W]."""
    if sheaves is None:
        return 0.0
    total = 0.0
    for column in sheaves.figures.T:
        a, b = int(column[INTO]), int(column[FROM])
        upper, lower = elements[a], elements[b]
        mean = 0.5 * float(upper.stretch[-1] + lower.stretch[-1])
        cosine = -float(upper.direction[:, -1] @ lower.direction[:, -1])
        wrap = acos(max(-1.0, min(1.0, cosine)))
        V = float(joints.nodes[VELOCITY, int(column[FLOW_COLUMN])])
        grip = mean * tanh(0.5 * column[FRICTION] * wrap) * max(float(pulls[a] + pulls[b]), 0.0)
        total += grip * tanh(V / SHEAVE_FRICTION_SPEED) * V
    return total


def _link_elements(joints: Joints) -> tuple[Elements, float]:
    """Return the links as elements of unit length, for their damping, and their energy [J]."""
    links, count = joints.ties, joints.ties.shape[1]
    ends = _ends(joints, POSITION, links[ties.AT : ties.AT + 3])
    closing = _ends(joints, VELOCITY, np.zeros((3, count)))
    length = np.sqrt((ends * ends).sum(axis=0) + LINK2_MIN)
    rate = (ends * closing).sum(axis=0) / length
    force, stiffness, minimum = (links[row] for row in (ties.FORCE, ties.STIFFNESS, ties.LEAST))
    stretched = length - links[ties.LENGTH]
    spring = np.maximum(force + stiffness * stretched, minimum)
    pull = np.maximum(force + stiffness * stretched + links[ties.DAMPING] * rate, minimum)
    # below the minimum force the spring is clamped: its elongation is at least this
    slack = np.where(stiffness > 0.0, (minimum - force) / np.where(stiffness > 0.0, stiffness, 1.0),
                     -np.inf)  # fmt: skip
    acting = np.maximum(stretched, slack)
    stored = force * acting + 0.5 * stiffness * acting**2
    below = stretched < acting
    stored[below] += minimum[below] * (stretched - acting)[below]
    zeros = np.zeros((3, count))
    elements = Elements(
        direction=zeros,
        turning=zeros,
        stored=stored,
        damping=pull - spring,
        held=np.zeros(count),
        rate=rate,
        stretch=length,
        rest=np.ones(count),
        section=np.zeros(count, np.int64),
    )
    return elements, float(stored.sum())


def _ends(joints: Joints, first: int, fixed: Floats) -> Floats:
    """Return a vector at the second end of each link relative to the first, (3, ties)."""
    links, rows = joints.ties, joints.nodes[first : first + 3]
    seconds = links[ties.SECOND].astype(int)
    second = np.where(seconds == ties.ANCHORED, fixed, rows[:, seconds])
    return second - rows[:, links[ties.FIRST].astype(int)]
