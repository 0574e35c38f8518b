"""Ropes in a steady flow: critical angle (P9), and shape against a shooting solution (P6)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rigs import Rig, Vector
from scipy.integrate import solve_ivp  # type: ignore[import-untyped]
from scipy.optimize import brentq  # type: ignore[import-untyped]

WEIGHT = 8.89  # of the 17.3 mm deep-tow cable in water [N/m], Woods Hole
CABLE = Rig(
    length=2000.0, mass=WEIGHT / 9.80665 + 1025.0 * 0.25 * math.pi * 0.0173**2, EA=1.272e7,
    diameter=0.0173, density=1025.0, drag=(1.5, 0.0), load=1.0,
)  # fmt: skip


@pytest.mark.parametrize(("speed", "printed"), [(0.5, 19.4), (1.0, 46.1)])
def test_critical_angle(speed: float, printed: float) -> None:
    """P9: far from its ends the cable hangs where w·sin a = ½·ρ·d·Cdn·U²·cos² a, within 0.2°."""
    pressure = 0.5 * CABLE.density * CABLE.diameter * CABLE.drag[0] * speed**2
    angle = brentq(lambda a: WEIGHT * math.sin(a) - pressure * math.cos(a) ** 2, 0.0, 1.5)
    assert math.degrees(angle) == pytest.approx(printed, abs=0.05)
    shot = replace(CABLE, current=((0.0, (speed, 0.0)),)).twin().snapshot()
    along = shot.node_position_m[60] - shot.node_position_m[20]
    found = math.degrees(math.atan2(along[0], -along[2]))
    assert found == pytest.approx(printed, abs=0.2)


TOWED = Rig(
    length=1500.0, mass=6.4, EA=65e6, diameter=0.04, density=1025.0, drag=(1.5, 0.3), load=4e3,
    volume=1.0, area=(4.0, 4.0, 6.0),
    current=((0.0, (1.4, 0.2)), (-300.0, (0.7, 0.6)), (-2000.0, (0.1, -0.1))),
)  # fmt: skip


def water(rig: Rig, z: float) -> Vector:
    """The current at a height [m/s]."""
    heights = [row[0] for row in reversed(rig.current)]
    east, north = (np.interp(z, heights, [r[1][k] for r in reversed(rig.current)]) for k in (0, 1))
    return np.array([east, north, 0.0])


def shot_upward(rig: Rig, depth: float, s: Vector) -> Vector:
    """Positions at s [m] from the payload, which is at -depth below the origin; (3, n).

    d(T·t)/ds = w·z - f(U, t), dx/ds = (1 + T/EA)·t, f the Morison drag per unstretched metre.
    """
    p = 0.5 * rig.density * rig.diameter

    def slope(_: float, y: Vector) -> Vector:
        pull = y[3:]
        tension = float(np.linalg.norm(pull))
        t = pull / tension
        U = water(rig, y[2])
        along = float(U @ t)
        across = U - along * t
        force = p * rig.drag[0] * np.linalg.norm(across) * across
        force += p * math.pi * rig.drag[1] * abs(along) * along * t
        return np.concatenate([(1.0 + tension / rig.EA) * t, np.array([0, 0, rig.weight]) - force])

    U = water(rig, -depth)
    drag = 0.5 * rig.density * np.array(rig.area) * np.linalg.norm(U) * U
    start = np.concatenate([[0.0, 0.0, -depth], np.array([0.0, 0.0, rig.load_weight]) - drag])
    done = solve_ivp(slope, (0.0, rig.length), start, t_eval=s, rtol=1e-9, atol=1e-9)
    return np.asarray(done.y[:3])


def test_steady_tow_in_a_turning_current() -> None:
    """P6: shape and payload 0.5 % at 100 elements (here 0.05 % of the length)."""
    shot = TOWED.twin().snapshot()
    s = TOWED.length - shot.arc_length_m[::-1]
    s[0], s[-1] = 0.0, TOWED.length

    def miss(depth: float) -> float:
        return float(shot_upward(TOWED, depth, np.array([TOWED.length]))[2, -1])

    exact = shot_upward(TOWED, brentq(miss, 600.0, 1510.0, xtol=1e-6), s)
    exact[:2] -= exact[:2, -1:]
    assert exact[0, 0] > 90.0
    assert np.abs(shot.node_position_m[::-1].T - exact).max() < 5e-4 * TOWED.length
