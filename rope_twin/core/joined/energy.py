"""Energy balance of a multi-line system with sheaves and links, from the state at a step boundary.

Each rope is measured like a single one, with its own payout speed; the forces of connections on the
ropes' ends cancel, as a connection has one motion. So do those of a sheave on the rope that runs
over it at V: F·V·q of both sides (F the tensions, q the last elements' vectors over their
unstretched lengths), the energy that V takes from one and gives to the other, the work on the wheel
and that of the material stream's m·V²·(q + q') sum up to V/2·(difference of both strains)·(F + F' -
T - T'), with T the last elements' tensions: that of half an element. Left over for a sheave are its
kinetic energy, that of its wheel, its potential energy, and the friction of the rope on it.

A link stores the work of its force without damping, and none where it is slack. So does a contact
between ropes, whose damping and friction dissipate.
"""

from __future__ import annotations

from math import acos, tanh
from typing import NamedTuple

import numpy as np

from rope_twin.core.energy import Border, Elements, Power, Store, damped, measure
from rope_twin.core.guards import LINK2_MIN
from rope_twin.core.joined import ties
from rope_twin.core.joined.contact import touch_of
from rope_twin.core.joined.joints import LOOSE, Joints, System
from rope_twin.core.joined.sheaves import (
    CREEP,
    FLOW_COLUMN,
    FRICTION,
    FROM,
    INTO,
    NOWHERE,
    POINT,
    SHEAVE_MASS,
    SHEAVE_WEIGHT,
    WHEEL,
    Sheaves,
)
from rope_twin.core.state import POSITION, PULL, PULL_X, PULL_Z, VELOCITY, Floats, Rope


class SystemBorder(NamedTuple):
    """Energy and power of one rope or of a multi-line system at a step boundary."""

    store: Store
    power: Power
    elements: tuple[Elements, ...]  # of each rope, and of the links as one more
    rubbed: float  # what friction on sheaves and contact between ropes dissipate [W]


def of_one(border: Border) -> SystemBorder:
    """Return the SystemBorder of a single rope."""
    return SystemBorder(border.store, border.power, (border.elements,), 0.0)


def lost(before: SystemBorder, after: SystemBorder, step: float) -> float:
    """Return the energy dissipated over a step by dampers and sheave friction [J]."""
    pairs = zip(before.elements, after.elements, strict=True)
    own = sum(damped(one, other, step) for one, other in pairs)
    return own + 0.5 * step * (before.rubbed + after.rubbed)


def measure_system(system: System, pulls: Floats, speeds: Floats, time: float) -> SystemBorder:
    """Return energy and power of the state of a system at a step boundary.

    pulls: of each rope at its upper end, (ropes, PULL_COLUMNS); speeds: payout over its hang-off,
    (ropes,) [m/s], arbitrary where there is none.
    """
    joints, sheaves = system.joints, system.sheaves
    borders: list[Border] = []
    for r, rope in enumerate(system.ropes):
        at_ship = bool(joints.upper[r] == LOOSE)
        V = float(speeds[r]) if at_ship else _flow(joints, sheaves, r)
        border = measure(_with_shared(system, rope), pulls[r, PULL_X : PULL_Z + 1], time, V)
        if not at_ship:
            border = border._replace(power=border.power._replace(hang_off=0.0, passing=0.0))
        borders.append(border)
    held, stored = _tied(joints)
    elements = tuple(border.elements for border in borders)
    touch = touch_of(system.stack)
    if touch is not None:
        stored += touch.stored
    still = _of_sheaves(joints, sheaves) + np.array([0.0, stored, 0.0])
    store = np.sum([border.store for border in borders], axis=0) + still
    power = np.sum([border.power for border in borders], axis=0)
    return SystemBorder(
        Store(*store.tolist()),
        Power(*power.tolist()),
        (*elements, held),
        _rubbed(joints, sheaves, elements, pulls[:, PULL]) + (touch.lost if touch else 0.0),
    )


def _with_shared(system: System, rope: Rope) -> Rope:
    """Return a rope whose shared effects are those of the first rope now.

    Shared effects are stored once in the stack (core/joined/stack.py), such as a current that has
    changed since the start.
    """
    kinds = (type(effect) for effect in system.stack.effects)
    now = zip(kinds, rope.effects, system.ropes[0].effects, strict=True)
    return rope._replace(
        effects=tuple(first if kind is type(own) else own for kind, own, first in now)
    )


def _flow(joints: Joints, sheaves: Sheaves | None, r: int) -> float:
    """Return the speed at which rope r grows over its sheave [m/s]; 0 without a sheave."""
    if sheaves is None or sheaves.of[r] == NOWHERE:
        return 0.0
    column = int(sheaves.figures[FLOW_COLUMN, sheaves.of[r]])
    return float(sheaves.side[r] * joints.nodes[VELOCITY, column])


def _of_sheaves(joints: Joints, sheaves: Sheaves | None) -> Floats:
    """Return kinetic, elastic and potential energy of sheaves and wheels [J], (3,)."""
    found = np.zeros(3)
    if sheaves is None:
        return found
    for column in sheaves.figures.T:
        point, flow = int(column[POINT]), int(column[FLOW_COLUMN])
        v = joints.nodes[VELOCITY : VELOCITY + 3, point]
        V = joints.nodes[VELOCITY, flow]
        found[0] += 0.5 * (column[SHEAVE_MASS] * float(v @ v) + column[WHEEL] * V * V)
        found[2] += column[SHEAVE_WEIGHT] * joints.nodes[POSITION + 2, point]
    return found


def _rubbed(
    joints: Joints, sheaves: Sheaves | None, elements: tuple[Elements, ...], pulls: Floats
) -> float:
    """Return the power of friction between ropes and sheaves, as in `core.joined.sheaves` [W]."""
    if sheaves is None:
        return 0.0
    total = 0.0
    for column in sheaves.figures.T:
        a, b = int(column[INTO]), int(column[FROM])
        one, other = elements[a], elements[b]
        mean = 0.5 * float(one.stretch[-1] + other.stretch[-1])
        cosine = -float(one.direction[:, -1] @ other.direction[:, -1])
        wrap = acos(max(-1.0, min(1.0, cosine)))
        V = float(joints.nodes[VELOCITY, int(column[FLOW_COLUMN])])
        grip = mean * tanh(0.5 * column[FRICTION] * wrap) * max(float(pulls[a] + pulls[b]), 0.0)
        total += grip * tanh(V / CREEP) * V
    return total


def _tied(joints: Joints) -> tuple[Elements, float]:
    """Return the links as elements of unit length, for their damping, and their energy [J]."""
    held, count = joints.ties, joints.ties.shape[1]
    ends = _ends(joints, POSITION, held[ties.AT : ties.AT + 3])
    closing = _ends(joints, VELOCITY, np.zeros((3, count)))
    length = np.sqrt((ends * ends).sum(axis=0) + LINK2_MIN)
    rate = (ends * closing).sum(axis=0) / length
    force, stiffness, least = (held[row] for row in (ties.FORCE, ties.STIFFNESS, ties.LEAST))
    stretched = length - held[ties.LENGTH]
    spring = np.maximum(force + stiffness * stretched, least)
    pull = np.maximum(force + stiffness * stretched + held[ties.DAMPING] * rate, least)
    # below the minimum force the spring is clamped: its elongation is at least this
    slack = np.where(stiffness > 0.0, (least - force) / np.where(stiffness > 0.0, stiffness, 1.0),
                     -np.inf)  # fmt: skip
    acting = np.maximum(stretched, slack)
    stored = force * acting + 0.5 * stiffness * acting**2
    below = stretched < acting
    stored[below] += least[below] * (stretched - acting)[below]
    still = np.zeros((3, count))
    elements = Elements(
        direction=still,
        turning=still,
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
    held, rows = joints.ties, joints.nodes[first : first + 3]
    seconds = held[ties.SECOND].astype(int)
    second = np.where(seconds == ties.ANCHORED, fixed, rows[:, seconds])
    return second - rows[:, held[ties.FIRST].astype(int)]
