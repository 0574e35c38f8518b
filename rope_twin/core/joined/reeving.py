"""Reeving over sheaves: two ropes of a system that run as one, and their static equilibrium.

In equilibrium without friction the tension on both sides of a sheave is equal. The wheel is held
while the ropes reach equilibrium, rope is transferred by the secant method on the tension
difference, and finally the wheel is released.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rope_twin.core.joined.joints import System, with_flows
from rope_twin.core.joined.sheaves import (
    FRICTION,
    FROM,
    INTO,
    NOWHERE,
    SHEAVE_ROWS,
    WHEEL,
    Sheaves,
)
from rope_twin.core.joined.statics import refine_joined_statics, solve_joined_statics
from rope_twin.core.payout import TRIALS
from rope_twin.core.state import (
    EA,
    ELEMENTS,
    MOTIONS,
    POSITION,
    TENSION,
    Boundary,
    Floats,
    Rope,
)
from rope_twin.core.statics.shape import Equilibrium

HELD = 1e30  # kg: inertia of a locked wheel
ROUNDS = 12
ROUND_OFF = 1e-15  # of the largest coordinate
ALIKE = 1e-3  # of a tension: largest difference at which the wheel is released
SHORTEST, LONGEST = 0.5, 1.5  # of the element length: the last element of a stretch


class Wheel(NamedTuple):
    """A sheave and the two ropes that run as one over it; both have it at their upper end."""

    point: int  # joint at its axis
    into: int  # the rope that a positive flow lengthens
    out: int  # the rope that it shortens
    mass: float = 0.0  # [kg]
    weight: float = 0.0  # in water [N]
    inertia: float = 0.0  # moment of inertia over radius squared [kg]
    friction: float = 0.0  # F/F' = exp(friction·angle of wrap)


def reeve(system: System, wheels: Sequence[Wheel]) -> System:
    """Return the system with its ropes running over these sheaves, the flow over each being 0.

    The ropes of one sheave have the same properties at their upper ends and one section each.

    Raises:
        ValueError: a wheel's ropes do not end there, or differ in their properties.
    """
    joints, first = system.joints, system.joints.nodes.shape[1]
    if not wheels:
        return system
    figures = np.zeros((SHEAVE_ROWS, len(wheels)))
    of = np.full(len(system.ropes), NOWHERE)
    side, base = np.zeros(len(of)), np.zeros(len(of))
    for k, wheel in enumerate(wheels):
        figures[:, k] = (
            wheel.point, first + k, wheel.into, wheel.out, wheel.mass, wheel.weight,
            wheel.inertia, wheel.friction,
        )  # fmt: skip
        one, other = (system.ropes[r].sections for r in (wheel.into, wheel.out))
        if one.shape != other.shape or one.shape[1] != 1 or (one != other).any():
            raise ValueError(f"reeve: ropes {wheel.into} and {wheel.out} are of different material")
        for r, sign in ((wheel.into, 1.0), (wheel.out, -1.0)):
            if joints.upper[r] != wheel.point or of[r] != NOWHERE:
                raise ValueError(f"reeve: rope {r} does not end at joint {wheel.point} alone")
            state = system.ropes[r].state
            of[r], side[r], base[r] = k, sign, state.s[state.counts[ELEMENTS]]
    size = (len(of), 2, MOTIONS)
    sheaves = Sheaves(
        figures, of, side, base, np.zeros((3, len(of))), Boundary(np.zeros(size), np.zeros(size))
    )
    return system._replace(joints=with_flows(joints, len(wheels)), sheaves=sheaves)


def solve_reeved_statics(system: System, place: Floats) -> Equilibrium:
    """Solve the static equilibrium, with rope running over sheaves until both tensions are equal.

    The flow over every sheave is 0 afterwards.
    """
    sheaves = system.sheaves
    if sheaves is None:
        return solve_joined_statics(system, place)
    kept = sheaves.figures[[WHEEL, FRICTION]].copy()
    sheaves.figures[WHEEL], sheaves.figures[FRICTION] = HELD, 0.0
    end = _settle_held(system, sheaves, place)
    sheaves.figures[WHEEL] = kept[0]
    if end.found:
        end = refine_joined_statics(system, place)
    sheaves.figures[FRICTION] = kept[1]
    _drop_round_off(system)
    return end


def _drop_round_off(system: System) -> None:
    """Set coordinates at round-off level to 0.

    A loop in one plane would otherwise sway across it with an ever smaller amplitude, down to
    subnormal numbers, with which a processor takes four times as long.
    """
    tables = [rope.state.nodes[: POSITION + 3] for rope in system.ropes]
    tables.append(system.joints.nodes[: POSITION + 3])
    reach = max(float(np.abs(table).max()) for table in tables)
    for table in tables:
        table[np.abs(table) < ROUND_OFF * reach] = 0.0


def _settle_held(system: System, sheaves: Sheaves, place: Floats) -> Equilibrium:
    """Solve the equilibrium with locked wheels, and transfer rope until both tensions are equal."""
    pairs = sheaves.figures[[INTO, FROM]].T.astype(int)
    slope = np.array([-sum(_stiffness(system.ropes[r]) for r in pair) for pair in pairs])
    moved, before = np.zeros(len(pairs)), np.full(len(pairs), np.nan)
    settle = solve_joined_statics
    for _ in range(ROUNDS):
        end = settle(system, place)
        settle = refine_joined_statics
        pulls = np.array([[_last_tension(system.ropes[r]) for r in pair] for pair in pairs])
        apart = pulls[:, 0] - pulls[:, 1]
        if not end.found or (np.abs(apart) <= ALIKE * pulls.max(axis=1)).all():
            break
        found = (apart - before) / np.where(moved == 0.0, np.nan, moved)
        slope = np.where(found < 0.0, found, slope)
        moved, before = -apart / slope, apart
        for pair, more in zip(pairs, moved, strict=True):
            for r, sign in zip(pair, (1.0, -1.0), strict=True):
                sheaves.base[r] = _lay_again(system.ropes[r], sign * float(more))
    return end


def _stiffness(rope: Rope) -> float:
    """Return the axial stiffness of the whole rope [N/m]."""
    return float(rope.sections[EA, 0] / rope.state.s[rope.state.counts[ELEMENTS]])


def _last_tension(rope: Rope) -> float:
    """Return the tension of the element at the sheave [N]."""
    return float(rope.work[TENSION, rope.state.counts[ELEMENTS] - 1])


def _lay_again(rope: Rope, more: float) -> float:
    """Change a rope's length at its last node, in the same shape; return its length [m].

    It keeps at least two elements and at most the capacity of its arrays.
    """
    state, size = rope.state, rope.model.element_length
    n = int(state.counts[ELEMENTS])
    s, x = state.s[: n + 1].copy(), state.nodes[POSITION : POSITION + 3, : n + 1].copy()
    room = len(state.s) - TRIALS - 2
    most = float(s[n]) + (room - n) * size
    length = min(max(float(s[n]) + more, 2.0 * SHORTEST * size), most)
    inner = [float(one) for one in s[:-1] if one <= length - SHORTEST * size]
    while length - inner[-1] > LONGEST * size:
        inner.append(inner[-1] + size)
    if len(inner) < 2:
        inner = [0.0, 0.5 * length]
    new = np.array([*inner, length])
    count = len(new)
    state.s[:count], state.counts[ELEMENTS] = new, count - 1
    for row, old in zip(state.nodes[POSITION : POSITION + 3], x, strict=True):
        row[:count] = np.interp(new * (s[n] / length), s, old)
    return length
