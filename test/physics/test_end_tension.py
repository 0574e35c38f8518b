"""Tension at the lower end of a rope: payload, anchor and connection on coarse meshes."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from rigs import Rig, march, sine
from scipy.optimize import brentq

from rope_twin import Twin

HANGING = Rig(
    length=500.0, elements=10, mass=20.0, EA=2e8, diameter=0.06, load=3000.0, volume=0.3,
    density=1025.0, drag=(1.2, 0.02), added_mass=1.0, step=0.02,
)  # fmt: skip


def test_static_end_tension_is_the_payload_weight() -> None:
    """1e-9 with ten elements; the lowest element itself carries 4.4 kN more."""
    snapshot = Twin(HANGING.scene()).snapshot()
    assert snapshot.tension_payload_n == pytest.approx(HANGING.load_weight, rel=1e-9)
    assert snapshot.node_tension_n[-1] == snapshot.tension_payload_n
    half = 0.5 * 50.0 * HANGING.weight
    assert snapshot.element_tension_n[-1] == pytest.approx(HANGING.load_weight + half, rel=1e-6)


def test_dynamic_end_tension_is_weight_plus_inertia() -> None:
    """M·a + W of a payload without drag, with a by differences of its velocity."""
    rig = replace(HANGING, damping=4e5)
    snapshots = list(march(Twin(rig.scene()), sine(1.0, 7.0), 12.0))
    v = np.array([snapshot.payload_velocity_m_per_s[2] for snapshot in snapshots])
    actual = np.array([snapshot.tension_payload_n for snapshot in snapshots])
    stamps = np.array([snapshot.stamp_ns for snapshot in snapshots]) * 1e-9
    a = (v[2:] - v[:-2]) / (stamps[2:] - stamps[:-2])
    expected = rig.load_weight + rig.load * a
    late = slice(len(a) // 2, None)
    assert np.abs(actual[1:-1] - expected)[late].max() < 2e-3 * np.ptp(expected)


def catenary(span: float, height: float, length: float, weight: float) -> float:
    """Tension at the lower anchor of an inextensible catenary whose lowest point is outside."""

    def miss(horizontal: float) -> float:
        return 2.0 * horizontal / weight * np.sinh(0.5 * span * weight / horizontal) - np.sqrt(
            length**2 - height**2
        )

    horizontal = float(brentq(miss, 5e3, 1e9))
    vertical = 0.5 * weight * (height / np.tanh(0.5 * span * weight / horizontal) - length)
    return float(np.hypot(horizontal, vertical))


@pytest.mark.parametrize("elements", [34, 68])
def test_anchor_tension_is_that_of_the_catenary(elements: int) -> None:
    """Within 0.1 %; the lowest element alone is off by more."""
    rig = Rig(
        length=320.0, elements=elements, mass=120.0, EA=1e10, diameter=0.1, load=0.0,
        fixed_at=(200.0, 0.0, -200.0), density=1025.0, step=0.02,
    )  # fmt: skip
    snapshot = Twin(rig.scene()).snapshot()
    exact = catenary(200.0, 200.0, 320.0, (120.0 - 1025.0 * 0.25 * pi * 0.1**2) * rig.gravity)
    assert snapshot.tension_payload_n == pytest.approx(exact, rel=1e-3)
    assert abs(snapshot.element_tension_n[-1] / exact - 1.0) > 5e-3


def test_end_tension_of_a_slack_rope_is_zero() -> None:
    """A light payload whose ship drops faster than it falls."""
    rig = replace(HANGING, load=300.0, volume=0.2, elements=20, length=100.0)
    snapshots = list(march(Twin(rig.scene()), sine(3.0, 3.0), 8.0))
    slack = [snapshot for snapshot in snapshots if snapshot.element_tension_n[-1] == 0.0]
    assert len(slack) > 10
    assert all(snapshot.tension_payload_n == 0.0 for snapshot in slack)


@pytest.mark.parametrize("name", ["bridle_lift", "two_line_lift"])
def test_end_tensions_at_connections_balance(name: str) -> None:
    """At rest both half elements differ by the line's weight."""
    snapshot = Twin(name).snapshot()
    for rope in snapshot.ropes:
        above = rope.tension_top_n - rope.element_tension_n[0]
        below = rope.element_tension_n[-1] - rope.node_tension_n[-1]
        assert above > 10.0
        assert below == pytest.approx(above, rel=2e-3)
