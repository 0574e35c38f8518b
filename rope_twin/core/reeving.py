"""Rope reeved over sheaves: where two ropes of a system become one that runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rope_twin.core.joints import Joints, System
from rope_twin.core.sheaves import NOWHERE, SHEAVE_ROWS, Sheaves
from rope_twin.core.state import ELEMENTS, MOTIONS, NODE_ROWS, WORK_ROWS, Boundary, Floats


class Wheel(NamedTuple):
    """A sheave and the two ropes that are one over it; both have it at their upper end."""

    point: int  # the joint that it turns at
    into: int  # the rope that a positive flow makes longer
    out: int  # the one that it makes shorter
    mass: float = 0.0  # [kg]
    weight: float = 0.0  # in water [N]
    inertia: float = 0.0  # of its turning over its radius squared [kg]
    friction: float = 0.0  # F/F' = exp(friction·angle of wrap)


def reeve(system: System, wheels: Sequence[Wheel]) -> System:
    """The system with the ropes running over these sheaves, the flow over each being 0.

    The ropes of one sheave are of the same make at their upper ends, of one section each.

    Raises:
        ValueError: a wheel's ropes do not end there, or are not of one make.
    """
    joints, first = system.joints, system.joints.nodes.shape[1]
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
            raise ValueError(f"reeve: ropes {wheel.into} and {wheel.out} are not of one make")
        for r, sign in ((wheel.into, 1.0), (wheel.out, -1.0)):
            if joints.upper[r] != wheel.point or of[r] != NOWHERE:
                raise ValueError(f"reeve: rope {r} does not end at joint {wheel.point} alone")
            state = system.ropes[r].state
            of[r], side[r], base[r] = k, sign, state.s[state.counts[ELEMENTS]]
    size = (len(of), 2, MOTIONS)
    sheaves = Sheaves(
        figures, of, side, base, np.zeros((3, len(of))), Boundary(np.zeros(size), np.zeros(size))
    )
    return system._replace(joints=_with_columns(joints, len(wheels)), sheaves=sheaves)


def _with_columns(joints: Joints, more: int) -> Joints:
    """Joints with so many columns more, for flows."""
    count = joints.nodes.shape[1] + more
    nodes: Floats = np.zeros((NODE_ROWS, count))
    nodes[:, : count - more] = joints.nodes
    return joints._replace(
        nodes=nodes,
        work=np.zeros((WORK_ROWS, count)),
        matrix=np.zeros((3 * count, 3 * count)),
    )
