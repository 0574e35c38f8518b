"""Ropes at rest and in a steady flow: P1 catenary, P8 stretch, P9 critical angle of tow."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rope_twin.errors import SolverError
from rope_twin.studies.picture import Line, Panel, Vector
from validation.case import Case, Finding, Found, between, within, within_pct
from validation.rigs import Rig

CHORD = (800.0, 0.0, -600.0)  # 1000 m long
LINE = Rig(length=1020.0, density=1025.0, fixed_at=CHORD)
LENGTHS = (998.0, 1000.5, 1020.0, 1300.0)  # stretched taut, tight, slack, dipping
HANGING = Rig(length=2000.0, density=1025.0, load=20e3, volume=3.0)
WEIGHT = 8.89  # of the 17.3 mm deep-tow cable in water [N/m], Woods Hole
TOWED = Rig(
    length=2000.0, mass=WEIGHT / 9.80665 + 1025.0 * 0.25 * math.pi * 0.0173**2, EA=1.272e7,
    diameter=0.0173, density=1025.0, drag=(1.5, 0.0), load=1.0,
)  # fmt: skip
CRITICAL_DEG = {0.5: 19.4, 1.0: 46.1}  # over speed [m/s]


def catenary(s: Vector, H: float, V: float, w: float, EA: float) -> tuple[Vector, Vector, Vector]:
    """Return the elastic catenary from its lower end (Irvine 1981, Cable Structures, eqs
    1.16-1.18).

    s unstretched from the lower end [m]; H horizontal and V vertical tension there [N], V < 0 if
    the line first dips. Returns x, z from the lower end [m] and the tension [N].
    """
    vertical = V + w * s
    x = H * s / EA + H / w * (np.arcsinh(vertical / H) - np.arcsinh(V / H))
    z = s * (V + 0.5 * w * s) / EA + H / w * (np.hypot(1.0, vertical / H) - np.hypot(1.0, V / H))
    return x, z, np.hypot(H, vertical)


def solve_catenary(rig: Rig, horizontal: float, vertical: float) -> tuple[float, float]:
    """Return H and V of the line to an upper end at these distances from its lower one [m].

    Raises:
        SolverError: the search does not end.
    """
    from scipy.optimize import fsolve

    length, w = rig.length, rig.weight

    def miss(unknown: Vector) -> Vector:
        H, V = np.exp(unknown[0]), unknown[1] * w * length
        x, z, _ = catenary(np.array([length]), H, V, w, rig.EA)
        return np.array([x[0] - horizontal, z[0] - vertical]) / length

    sag = max(length**2 - vertical**2 - horizontal**2, 1e-4 * horizontal**2) / horizontal**2
    slope = np.sqrt(3.0 * sag)  # parabola: Irvine's first guess of lambda
    start = [np.log(0.5 * w * horizontal / slope), 0.5 * (vertical / length / np.tanh(slope) - 1.0)]
    solution, info, ok, text = fsolve(miss, start, full_output=True, xtol=1e-14)
    if ok != 1 and np.abs(info["fvec"]).max() >= 1e-12:
        raise SolverError("catenary", str(text), "start from another guess")
    return float(np.exp(solution[0])), float(solution[1] * w * length)


def _catenaries() -> Found:
    findings: list[Finding] = []
    lines: list[Line] = []
    for length in LENGTHS:
        rig = replace(LINE, length=length)
        snapshot = rig.twin().snapshot()
        H, V = solve_catenary(rig, CHORD[0], -CHORD[2])
        x, z, tension = catenary(length - snapshot.arc_length_m, H, V, rig.weight, rig.EA)
        shape = np.stack([CHORD[0] - x, np.zeros_like(x), CHORD[2] + z], axis=1)
        error_m = float(np.abs(snapshot.node_position_m - shape).max())
        error_pct = error_m / 10.0  # of the chord
        lower = snapshot.tension_payload_n
        findings += [
            between(f"{length:g} m: shape off, of the chord", error_pct, (0.0, 0.1), "0", "%"),
            within_pct(
                f"{length:g} m: upper tension", snapshot.tension_top_n, tension[0], 0.1, "N"
            ),
            within_pct(f"{length:g} m: lower tension", lower, tension[-1], 0.1, "N"),
        ]
        lines += [
            Line(shape[:, 0], shape[:, 2], f"{length:g} m, closed form"),
            Line(snapshot.node_position_m[::5, 0], snapshot.node_position_m[::5, 2], "", "k."),
        ]
    picture = Panel("Elastic catenaries; dots: ours", "x [m]", "z [m]", tuple(lines))
    return Found(tuple(findings), (picture,))


def _stretch() -> Found:
    findings, errors, counts = [], [], (3, 10, 30, 100)
    L = HANGING.length
    exact = (HANGING.load_weight + 0.5 * HANGING.weight * L) * L / HANGING.EA
    for elements in counts:
        depth = -replace(HANGING, elements=elements).twin().snapshot().payload_position_m[2]
        errors.append(abs((depth - L) / exact - 1.0))
    for elements, error in ((counts[0], errors[0]), (counts[-1], errors[-1])):
        quantity = f"stretch off at {elements} elements"
        findings.append(between(quantity, error, (0.0, 1e-9), f"{exact:.6g} m"))
    line = Line(counts, np.maximum(errors, 1e-16), "", "o-")
    picture = Panel("Error of the stretch", "elements", "relative", (line,), log=True)
    return Found(tuple(findings), (picture,))


def _critical_angles() -> Found:
    from scipy.optimize import brentq

    findings, lines = [], []
    for speed, printed in CRITICAL_DEG.items():
        pressure = 0.5 * TOWED.density * TOWED.diameter * TOWED.drag[0] * speed**2
        angle = math.degrees(brentq(_lift_off, 0.0, 1.5, args=(pressure,)))
        snapshot = replace(TOWED, current=((0.0, (speed, 0.0)),)).twin().snapshot()
        chord = snapshot.node_position_m[60] - snapshot.node_position_m[20]
        ours = math.degrees(math.atan2(chord[0], -chord[2]))
        findings += [
            within(f"{speed:g} m/s: angle from the vertical", ours, printed, 0.2, "°"),
            within(f"{speed:g} m/s: against w·sin a = p·cos² a", ours, angle, 0.2, "°"),
        ]
        x, _, z = snapshot.node_position_m.T
        lines.append(Line(x, z, f"{speed:g} m/s: {ours:.2f}°"))
    picture = Panel("2 km of 17.3 mm cable towed", "x [m]", "z [m]", tuple(lines))
    return Found(tuple(findings), (picture,))


def _lift_off(a: float, pressure: float) -> float:
    return WEIGHT * math.sin(a) - pressure * math.cos(a) ** 2


CASES = (
    Case("P1", "elastic catenary: shape and end tensions, 100 elements", "Irvine 1981, closed form",
         _catenaries, 2.0),
    Case("P8", "stretch of a hanging rope under weight and load, ΔL = (W + wL/2)·L/EA",
         "closed form", _stretch, 2.0),
    Case("P9", "steady tow: critical angle of a 17.3 mm cable, Cdn 1.5", "closed form",
         _critical_angles, 2.0),
)  # fmt: skip
