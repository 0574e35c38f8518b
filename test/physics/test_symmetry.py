"""Mirrored and rotated scenes give mirrored and rotated results, to round-off."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from payout_rigs import SEA
from rigs import Rig, Vector, march, sine

from rope_twin import Snapshot

CURRENT = ((0.0, (0.8, 0.1)), (-100.0, (0.2, 0.5)), (-300.0, (-0.3, 0.1)))  # turns with depth
RIG = replace(
    SEA, length=300.0, elements=30, current=CURRENT, hang_off=(12.0, -5.0, 3.0), damping=1e6
)
FIXED = replace(RIG, winch=None, length=330.0, fixed_at=(150.0, 60.0, -250.0))
ROUND_OFF = 1e-9


def transformed(rig: Rig, turn: Vector) -> Rig:
    """The rig with every horizontal vector turned (or mirrored) by a 2×2 matrix."""

    def point(x: float, y: float, z: float) -> tuple[float, float, float]:
        east, north = (float(v) for v in turn @ (x, y))
        return east, north, z

    current = tuple((z, point(*u, 0.0)[:2]) for z, u in rig.current)
    fixed = None if rig.fixed_at is None else point(*rig.fixed_at)
    return replace(rig, current=current, hang_off=point(*rig.hang_off), fixed_at=fixed)


def lowered(rig: Rig) -> Snapshot:
    """Ten seconds of heave, paying out through a split where there is a winch."""
    twin = rig.twin()
    if rig.winch:
        assert twin.submit_speed(0, 1.5) == ""
    *_, snapshot = march(twin, sine(1.5, 7.0), 10.0, every=50)
    assert rig.winch is None or snapshot.solver.splits == 1
    return snapshot


def rotation(degrees: float) -> Vector:
    """About z, anticlockwise from above."""
    angle = math.radians(degrees)
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


@pytest.mark.parametrize("rig", [RIG, FIXED], ids=["payload", "fixed"])
@pytest.mark.parametrize(
    "turn",
    [np.diag([-1.0, 1.0]), np.array([[0.0, 1.0], [1.0, 0.0]]), rotation(37.0), rotation(211.3)],
    ids=["mirrored in x", "mirrored in x = y", "turned by 37", "turned by 211.3"],
)
def test_results_are_invariant_under_rotation_and_mirroring(rig: Rig, turn: Vector) -> None:
    """Positions, velocities and the pull follow; tensions stay."""
    plain, other = lowered(rig), lowered(transformed(rig, turn))
    full = np.eye(3)
    full[:2, :2] = turn
    follow: Callable[[Vector], Vector] = lambda rows: rows @ full.T  # noqa: E731
    pairs = [
        (follow(plain.node_position_m), other.node_position_m),
        (follow(plain.node_velocity_m_per_s), other.node_velocity_m_per_s),
        (follow(plain.hang_off_force_n), other.hang_off_force_n),
        (plain.element_tension_n, other.element_tension_n),
    ]
    for expected, actual in pairs:
        assert np.abs(actual - expected).max() < ROUND_OFF * np.abs(expected).max()
    sideways = np.abs(plain.node_position_m[:, 1] - plain.node_position_m[0, 1]).max()
    assert sideways > 0.1, "the case must be three-dimensional"
