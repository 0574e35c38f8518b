"""Steady tow in a current that turns with depth: P6, shape and tension of rope and payload."""

from __future__ import annotations

import math

import numpy as np

from rope_twin.studies.picture import Line, Panel, Vector
from validation.case import Case, Found, between, within_pct
from validation.rigs import Rig

TOWED = Rig(
    length=1500.0, mass=6.4, EA=65e6, diameter=0.04, density=1025.0, drag=(1.5, 0.3), load=4e3,
    volume=1.0, area=(4.0, 4.0, 6.0),
    current=((0.0, (1.4, 0.2)), (-300.0, (0.7, 0.6)), (-2000.0, (0.1, -0.1))),
)  # fmt: skip


def water(rig: Rig, z: float) -> Vector:
    """Return the current at a height [m/s]."""
    heights = [row[0] for row in reversed(rig.current)]
    east, north = (np.interp(z, heights, [r[1][k] for r in reversed(rig.current)]) for k in (0, 1))
    return np.array([east, north, 0.0])


def shot_upward(rig: Rig, depth: float, s: Vector) -> Vector:
    """Return position [m] and force [N] at s [m] from the payload, which is at -depth; (6, n).

    d(T·t)/ds = w·z - f(U, t), dx/ds = (1 + T/EA)·t, f the Morison drag per unstretched metre.
    """
    from scipy.integrate import solve_ivp

    p = 0.5 * rig.density * rig.diameter

    def slope(_: float, y: Vector) -> Vector:
        pull = y[3:]
        tension = float(np.linalg.norm(pull))
        t = pull / tension
        U = water(rig, y[2])
        tangential = float(U @ t)
        normal = U - tangential * t
        force = p * rig.drag[0] * np.linalg.norm(normal) * normal
        force += p * math.pi * rig.drag[1] * abs(tangential) * tangential * t
        return np.concatenate([(1.0 + tension / rig.EA) * t, np.array([0, 0, rig.weight]) - force])

    U = water(rig, -depth)
    drag = 0.5 * rig.density * np.array(rig.area) * np.linalg.norm(U) * U
    start = np.concatenate([[0.0, 0.0, -depth], np.array([0.0, 0.0, rig.load_weight]) - drag])
    done = solve_ivp(slope, (0.0, rig.length), start, t_eval=s, rtol=1e-9, atol=1e-9)
    return np.asarray(done.y)


def solve_tow(rig: Rig, s: Vector) -> Vector:
    """Return the rope that ends at the origin, by shooting: as `shot_upward`, from the top."""
    from scipy.optimize import brentq

    def miss(depth: float) -> float:
        return float(shot_upward(rig, depth, np.array([rig.length]))[2, -1])

    shape = shot_upward(rig, brentq(miss, 0.4 * rig.length, 1.01 * rig.length, xtol=1e-6), s)
    shape[:2] -= shape[:2, -1:]
    return shape


def _turning_current() -> Found:
    snapshot = TOWED.twin().snapshot()
    s = TOWED.length - snapshot.arc_length_m[::-1]
    s[0], s[-1] = 0.0, TOWED.length
    middle = 0.5 * (s[1:] + s[:-1])
    exact = solve_tow(TOWED, np.sort(np.concatenate([s, middle])))
    shape, pull = exact[:3, ::2], np.sqrt((exact[3:] ** 2).sum(axis=0))
    error_m = float(np.abs(snapshot.node_position_m[::-1].T - shape).max())
    tension_n = snapshot.element_tension_n[::-1]
    tension_error = float(np.abs(tension_n / pull[1::2] - 1.0).max())
    payload = np.array(snapshot.payload_position_m)
    findings = (
        between("shape off, of the length", 100.0 * error_m / TOWED.length, (0.0, 0.05), "0", "%"),
        between("tension along the rope off, most", 100.0 * tension_error, (0.0, 0.5), "0", "%"),
        within_pct("top tension", snapshot.tension_top_n, pull[-1], 0.5, "N"),
        within_pct("payload: east of the hang-off", payload[0], shape[0, 0], 0.5, "m"),
        within_pct("payload: north of the hang-off", payload[1], shape[1, 0], 0.5, "m"),
        within_pct("payload: depth", -payload[2], -shape[2, 0], 0.5, "m"),
    )
    sampled = snapshot.node_position_m[::5]
    panels = (
        Panel("seen from the side; dots: ours", "east [m]", "z [m]",
              (Line(shape[0], shape[2], "shooting"), Line(sampled[:, 0], sampled[:, 2], "", "k."))),
        Panel("seen from above", "east [m]", "north [m]",
              (Line(shape[0], shape[1], "shooting"), Line(sampled[:, 0], sampled[:, 1], "", "k."))),
        Panel("tension", "[kN]", "from the payload [m]",
              (Line(1e-3 * pull[1::2], middle, "shooting"),
               Line(1e-3 * tension_n[::5], middle[::5], "", "k."))),
    )  # fmt: skip
    return Found(findings, panels)


CASES = (
    Case("P6", "steady tow in a current that turns with depth, 100 elements",
         "shooting solution of the same ODE by scipy", _turning_current, 2.0),
)  # fmt: skip
