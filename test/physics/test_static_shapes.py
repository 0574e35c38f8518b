"""Static shapes against closed forms: stretch under weight (P8), elastic catenary (P1)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigs import Rig

from validation.statics import catenary, solve_catenary

HANGING = Rig(length=2000.0, density=1025.0, volume=3.0)
CHORD = (800.0, 0.0, -600.0)  # 1000 m long
LINE = Rig(length=1020.0, density=1025.0, fixed_at=CHORD)


def stretch(weight: float, load: float, length: float, EA: float) -> float:
    """Elongation of a bar under its own weight and a load: (W + w·L/2)·L/EA."""
    return (load + 0.5 * weight * length) * length / EA


@pytest.mark.parametrize("elements", [3, 100])
@pytest.mark.parametrize("load", [500.0, 20e3])
def test_stretch_of_a_hanging_rope(elements: int, load: float) -> None:
    """The lumped rope samples a linear tension at mid-element: the sum is exact."""
    rig = replace(HANGING, elements=elements, load=load, volume=load / 7000.0)
    snapshot = rig.twin().snapshot()
    expected = stretch(rig.weight, rig.load_weight, rig.length, rig.EA)
    assert -snapshot.payload_position_m[2] - rig.length == pytest.approx(expected, rel=1e-9)
    assert snapshot.tension_top_n == pytest.approx(
        rig.load_weight + rig.weight * rig.length, rel=1e-9
    )


@pytest.mark.parametrize("length", [998.0, 1000.5, 1020.0, 1300.0])
def test_elastic_catenary(length: float) -> None:
    """P1: shape and end tensions, 0.1 % at 100 elements; stretched taut, tight, slack, dipping."""
    rig = replace(LINE, length=length)
    snapshot = rig.twin().snapshot()
    H, V = solve_catenary(rig, CHORD[0], -CHORD[2])
    s = length - snapshot.arc_length_m
    x, z, tension = catenary(s, H, V, rig.weight, rig.EA)
    shape = np.stack([CHORD[0] - x, np.zeros_like(x), CHORD[2] + z], axis=1)
    assert np.abs(snapshot.node_position_m - shape).max() < 1e-3 * np.linalg.norm(CHORD)
    assert snapshot.tension_top_n == pytest.approx(tension[0], rel=1e-3)
    assert snapshot.hang_off_force_n == pytest.approx([H, 0.0, -V - rig.weight * length], rel=1e-3)
    middles = 0.5 * (s[1:] + s[:-1])
    _, _, between = catenary(middles, H, V, rig.weight, rig.EA)
    assert snapshot.element_tension_n == pytest.approx(between, rel=1e-3)
    assert snapshot.tension_payload_n == pytest.approx(tension[-1], rel=1e-3)


def test_half_a_level_line_equals_the_whole_line() -> None:
    """A level line is two half lines that meet at its lowest point."""
    whole = replace(LINE, length=1300.0, fixed_at=(1000.0, 0.0, 0.0)).twin().snapshot()
    assert whole.node_tension_n[1:-1] == pytest.approx(whole.node_tension_n[-2:0:-1], rel=1e-6)
    middle = tuple(float(x) for x in whole.node_position_m[50])
    assert middle[0] == pytest.approx(500.0, abs=1e-6)
    rig = replace(LINE, length=650.0, elements=50, fixed_at=(middle[0], middle[1], middle[2]))
    half = rig.twin().snapshot()
    assert half.node_position_m == pytest.approx(whole.node_position_m[:51], abs=1e-5)
    assert half.tension_top_n == pytest.approx(whole.tension_top_n, rel=1e-6)
    assert half.hang_off_force_n == pytest.approx(whole.hang_off_force_n, rel=1e-6, abs=1e-3)


def test_static_equilibrium_is_independent_of_damping() -> None:
    """A light load that a current carries far aside hangs the same with and without damping."""
    rig = Rig(
        length=6.2, elements=60, mass=15.4, EA=4.4e8, diameter=0.0015, load=4.0, density=1025.0,
        area=(5.0, 5.0, 5.0), current=((0.0, (0.5, 0.0)),), drag=(1.2, 0.02),
    )  # fmt: skip
    free, damped = rig.twin().snapshot(), replace(rig, damping=1e8).twin().snapshot()
    assert free.payload_position_m[0] > 1.0
    assert damped.node_position_m == pytest.approx(free.node_position_m, abs=1e-6)
