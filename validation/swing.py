"""P7: transverse periods of a hanging rope with a submerged mass, by Bessel functions."""

from __future__ import annotations

import math

import numpy as np

from rope_twin.studies.modes import find_modes
from rope_twin.studies.picture import Line, Panel, Vector
from validation.case import Case, Finding, Found, within_pct
from validation.rigs import Rig
from validation.state_bench import Bench, frequency

SWUNG = Rig(
    length=500.0, elements=200, mass=6.4, EA=1e10, diameter=0.04, density=1025.0, added_mass=1.0,
    load=3e3, volume=1.0, added=(2e3, 2e3, 1e3), step=0.02, tolerance=1e-3,
)  # fmt: skip
MODES, PERIODS = 5, 8.0


class HangingRope:
    """Small swings of a hanging rope and a submerged mass, derived from (T·y')' + mu·ω²·y = 0.

    T = W + w·s, s from the payload; mu with added mass across. With u = 2·ω·√(mu·T)/w the solution
    is y = J0(u)·Y0(u_top) - Y0(u)·J0(u_top), 0 at the hang-off, and u' = ω·√(mu/T). The payload,
    M' with its added mass across, asks for W·y'(0) + M'·ω²·y(0) = 0.
    """

    def __init__(self, rig: Rig) -> None:
        self.W, self.w, self.length = rig.load_weight, rig.weight, rig.length
        area = 0.25 * math.pi * rig.diameter**2
        self.mu = rig.mass + rig.added_mass * rig.density * area
        self.moving = rig.load + rig.added[0]

    def shape(self, omega: float, s: Vector) -> tuple[Vector, Vector]:
        """Return y and y' at s."""
        from scipy.special import j0, j1, y0, y1

        tension = self.W + self.w * s
        u = 2.0 * omega / self.w * np.sqrt(self.mu * tension)
        top = 2.0 * omega / self.w * math.sqrt(self.mu * (self.W + self.w * self.length))
        slope = -(j1(u) * y0(top) - y1(u) * j0(top)) * omega * np.sqrt(self.mu / tension)
        return j0(u) * y0(top) - y0(u) * j0(top), slope

    def miss(self, omega: float) -> float:
        """Return the boundary residual W·y'(0) + M'·ω²·y(0)."""
        y, slope = self.shape(omega, np.zeros(1))
        return float(self.W * slope[0] + self.moving * omega**2 * y[0])

    def frequencies(self, count: int) -> list[float]:
        """Return the lowest ω [rad/s], by sign changes on a fine grid."""
        from scipy.optimize import brentq

        grid = np.linspace(1e-3, 4.0, 8000)
        values = np.array([self.miss(omega) for omega in grid])
        roots = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))[:count]
        return [float(brentq(self.miss, grid[k], grid[k + 1])) for k in roots]


def swing_period(exact: HangingRope, omega: float, sooner: bool) -> float:
    """Return the swing period of the rope released from a mode shape [s], by modal projection."""
    bench = Bench(SWUNG.scene())
    s = np.linspace(0.0, SWUNG.length, SWUNG.elements + 1)
    shape = exact.shape(omega, s)[0]
    mass = np.full(len(s), exact.mu * SWUNG.length / SWUNG.elements)
    mass[0] = 0.5 * mass[0] + exact.moving
    bench.position[0] = 0.05 * shape / np.abs(shape).max()
    bench.acceleration[0] = -(omega**2) * bench.position[0]
    every = 2 if sooner else 5
    swing = []
    for _ in range(round(PERIODS * 2.0 * math.pi / omega / (every * SWUNG.step))):
        bench.hold(every)
        swing.append(float((mass * shape) @ bench.position[0]))
    return 1.0 / frequency(np.array(swing), every * SWUNG.step)


def _swings() -> Found:
    exact = HangingRope(SWUNG)
    known = find_modes(SWUNG.scene(), 2 * MODES).lowest
    periods = [mode.period_s for mode in known if mode.kind == "out-of-plane"]
    s = np.linspace(0.0, SWUNG.length, 101)
    findings: list[Finding] = []
    lines = []
    for k, omega in enumerate(exact.frequencies(MODES)):
        period = 2.0 * math.pi / omega
        ours = swing_period(exact, omega, sooner=k > 1)
        findings += [
            within_pct(f"period {k + 1}: released and timed", ours, period, 0.3, "s"),
            within_pct(f"period {k + 1}: by `rope_twin modes`", periods[k], period, 0.3, "s"),
        ]
        shape = exact.shape(omega, s)[0]
        lines.append(Line(shape / np.abs(shape).max(), s, f"{period:.3g} s"))
    picture = Panel("closed form: shapes", "across", "from the payload [m]", tuple(lines))
    errors_pct = [100.0 * (f.ours / float(f.published) - 1.0) for f in findings]
    order = list(range(1, MODES + 1))
    error_panel = Panel(
        "off the closed form", "mode", "[%]",
        (Line(order, errors_pct[::2], "released and timed", "o-"),
         Line(order, errors_pct[1::2], "by rope_twin modes", "s--")),
    )  # fmt: skip
    return Found(tuple(findings), (picture, error_panel))


CASES = (
    Case("P7", "transverse periods of a hanging rope with a submerged mass, 200 elements",
         "closed form (Bessel functions), derived in validation/swing.py", _swings, 5.0),
)  # fmt: skip
