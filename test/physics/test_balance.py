"""Forces in static equilibrium sum to zero. Energy and work: case P5 of `python -m validation`."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from payout_rigs import SEA
from rigs import Rig, Vector

from rope_twin import Snapshot

CURRENT = ((0.0, (0.9, 0.2)), (-400.0, (0.2, 0.6)), (-900.0, (-0.1, 0.1)))
IN_FLOW = replace(SEA, current=CURRENT, area=(5.0, 5.0, 8.0), load=6e3, drag=(1.2, 0.3))


def water_at(rig: Rig, z: Vector) -> Vector:
    """Return the current at heights z [m/s], (3, n); constant outside the profile."""
    heights = [row[0] for row in reversed(rig.current)]
    parts = [np.interp(z, heights, [row[1][k] for row in reversed(rig.current)]) for k in (0, 1)]
    return np.stack([*parts, np.zeros_like(z)])


def drag_on_rope(rig: Rig, snapshot: Snapshot) -> Vector:
    """Morison drag of a rope at rest, cross-flow principle, summed over the nodes [N], (3,).

    Per metre ½·ρ·d·Cdn·|U_n|·U_n + ½·ρ·pi·d·Cdt·|U_t|·U_t; each node has half of its elements.
    """
    x, s = snapshot.node_position_m.T, snapshot.arc_length_m
    rest = np.diff(s)
    along = np.diff(x) / np.linalg.norm(np.diff(x), axis=0)
    tangent = np.concatenate([along[:, :1], along[:, :-1] + along[:, 1:], along[:, -1:]], axis=1)
    tangent /= np.linalg.norm(tangent, axis=0)
    lump = 0.5 * (np.concatenate([[0.0], rest]) + np.concatenate([rest, [0.0]]))
    U = water_at(rig, x[2])
    part = (U * tangent).sum(axis=0)
    across = U - part * tangent
    pressure = 0.5 * rig.density * rig.diameter * lump
    force = pressure * rig.drag[0] * np.linalg.norm(across, axis=0) * across
    force += pressure * math.pi * rig.drag[1] * np.abs(part) * part * tangent
    return np.asarray(force.sum(axis=1))


def test_the_hang_off_force_is_weight_in_water_plus_drag() -> None:
    """Static equilibrium in a turning current, drag by Morison's cross-flow principle; 1e-6."""
    snapshot = IN_FLOW.twin().snapshot()
    U = water_at(IN_FLOW, snapshot.payload_position_m[2:])[:, 0]
    total = drag_on_rope(IN_FLOW, snapshot)
    total += 0.5 * IN_FLOW.density * np.array(IN_FLOW.area) * np.linalg.norm(U) * U
    total[2] -= IN_FLOW.load_weight + IN_FLOW.weight * IN_FLOW.length
    assert np.linalg.norm(total[:2]) > 5e3
    assert snapshot.hang_off_force_n == pytest.approx(total, abs=1e-6 * snapshot.tension_top_n)
    assert snapshot.tension_top_n == pytest.approx(
        np.linalg.norm(snapshot.hang_off_force_n), rel=1e-14
    )
