"""Natural frequencies, measured from free oscillations of the running twin.

P2: taut string in water, n/(2·l)·√(T/μ). P3: axial modes of rope and payload, x·tan x = m·L/M'.
P7: the same rope swinging across, Bessel functions.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rigs import Bench, Rig, Vector, frequency, lift, march
from scipy.optimize import brentq  # type: ignore[import-untyped]
from scipy.special import j0, j1, y0, y1  # type: ignore[import-untyped]

from rope_twin.studies.state_bench import pluck

TENSION = 100e3
STRING = Rig(length=300.0, mass=6.4, diameter=0.04, density=1025.0, gravity=0.0)
STRETCHED = STRING.length * (1.0 + TENSION / STRING.EA)
MODES = 5


@pytest.mark.parametrize(
    ("mass", "diameter", "added_mass"), [(6.4, 0.04, 0.0), (2.9, 0.06, 1.0), (2.9, 0.06, 10.0)]
)
def test_taut_string_in_water(mass: float, diameter: float, added_mass: float) -> None:
    """P2: the first five within 0.5 % at 100 elements; added mass 0, 1 and 10 times the rope's.

    μ is the mass with added mass per stretched metre, l the stretched length. The modes of the
    discrete string are sines too, so the projection on one of them oscillates purely.
    """
    rig = replace(
        STRING, mass=mass, diameter=diameter, added_mass=added_mass, fixed_at=(STRETCHED, 0.0, 0.0)
    )
    per_metre = mass + added_mass * rig.density * 0.25 * math.pi * diameter**2
    first = 0.5 / STRETCHED * math.sqrt(TENSION / (per_metre * rig.length / STRETCHED))
    duration = 0.8 / (MODES * first)
    twin = rig.twin()
    assert twin.snapshot().tension_top_n == pytest.approx(TENSION, rel=1e-9)
    shots = list(march(twin, pluck(0.05, duration), duration + 12.0 / first, every=2))
    free = np.array([s.node_position_m[:, 2] for s in shots if s.time_s > duration])
    s = np.linspace(0.0, 1.0, rig.elements + 1)
    for n in range(1, MODES + 1):
        swing = free @ np.sin(n * math.pi * s)
        assert frequency(swing, 2 * rig.step) == pytest.approx(n * first, rel=5e-3)
        late, early = (
            np.abs(swing[-len(swing) // 4 :]).max(),
            np.abs(swing[: len(swing) // 4]).max(),
        )
        assert late < early * 1.001, "added mass must not feed the oscillation"


STEEL = Rig(mass=3989.7 * 0.076**2, EA=4.04e10 * 0.076**2, diameter=0.8 * 0.076)
HMPE = Rig(
    mass=495.7 * 0.0762**2, EA=56.5 * (5.795e8 * 0.0762**2 + 6.507e8 * 0.0762**3), diameter=0.0613
)
MOVING = 150e3  # M': 100 t of payload, 50 t of water that moves with it


@pytest.mark.parametrize(
    ("rope", "length", "printed"),
    [
        (STEEL, 1e3, 5.17),
        (STEEL, 3e3, 9.39),
        (STEEL, 5e3, 12.68),
        (HMPE, 1e3, 5.37),
        (HMPE, 3e3, 9.36),
        (HMPE, 5e3, 12.17),
    ],
)
def test_axial_period_of_rope_and_payload(rope: Rig, length: float, printed: float) -> None:
    """P3: T = 2·pi·L/(c·x) with x·tan x = m·L/M', 0.2 % at 200 elements.

    The ship lifts the hang-off once and rests; nodes are projected on the first mode cos(x·s/L).
    """
    ratio = rope.mass * length / MOVING
    x = brentq(lambda x: x * math.tan(x) - ratio, 1e-9, 0.5 * math.pi - 1e-9)
    period = 2.0 * math.pi * length / math.sqrt(rope.EA / rope.mass) / x
    assert period == pytest.approx(printed, rel=2e-3)
    rig = replace(
        rope, length=length, elements=200, load=100e3, volume=10.0, added=(1e3, 1e3, 50e3),
        density=1025.0, step=0.02,
    )  # fmt: skip
    twin = rig.twin()
    rest = twin.snapshot().node_position_m[:, 2]
    shots = list(march(twin, lift(0.2, 0.5 * period), 12.0 * period, every=5))
    free = np.array([s.node_position_m[:, 2] for s in shots if s.time_s > 0.5 * period]) - rest
    mass = np.full(rig.elements + 1, rope.mass * length / rig.elements)
    mass[0] *= 0.5
    mass[-1] = 0.5 * mass[-1] + MOVING
    mode = np.cos(x * np.linspace(1.0, 0.0, rig.elements + 1))
    measured = 1.0 / frequency(free @ (mass * mode), 5 * rig.step)
    assert measured == pytest.approx(period, rel=2e-3)


SWUNG = Rig(
    length=500.0, elements=200, mass=6.4, EA=1e10, diameter=0.04, density=1025.0, added_mass=1.0,
    load=3e3, volume=1.0, added=(2e3, 2e3, 1e3), step=0.02, tolerance=1e-3,
)  # fmt: skip


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
        """y and y' at s."""
        tension = self.W + self.w * s
        u = 2.0 * omega / self.w * np.sqrt(self.mu * tension)
        top = 2.0 * omega / self.w * math.sqrt(self.mu * (self.W + self.w * self.length))
        slope = -(j1(u) * y0(top) - y1(u) * j0(top)) * omega * np.sqrt(self.mu / tension)
        return j0(u) * y0(top) - y0(u) * j0(top), slope

    def miss(self, omega: float) -> float:
        """W·y'(0) + M'·ω²·y(0)."""
        y, slope = self.shape(omega, np.zeros(1))
        return float(self.W * slope[0] + self.moving * omega**2 * y[0])

    def frequencies(self, count: int) -> list[float]:
        """The lowest ω [rad/s], by sign changes on a fine grid."""
        grid = np.linspace(1e-3, 4.0, 8000)
        values = np.array([self.miss(omega) for omega in grid])
        at = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))[:count]
        return [float(brentq(self.miss, grid[k], grid[k + 1])) for k in at]


@pytest.mark.parametrize("mode", range(5))
def test_swing_of_a_hanging_rope_with_a_submerged_mass(mode: int) -> None:
    """P7: the first five within 0.3 % at 200 elements; released from the mode's own shape."""
    exact = HangingRope(SWUNG)
    omega = exact.frequencies(5)[mode]
    bench = Bench(SWUNG.scene())
    s = np.linspace(0.0, SWUNG.length, SWUNG.elements + 1)
    shape = exact.shape(omega, s)[0]
    mass = np.full(len(s), exact.mu * SWUNG.length / SWUNG.elements)
    mass[0] = 0.5 * mass[0] + exact.moving
    bench.position[0] = 0.05 * shape / np.abs(shape).max()
    bench.acceleration[0] = -(omega**2) * bench.position[0]
    every = 5 if mode < 2 else 2
    swing = []
    for _ in range(round(8.0 * 2.0 * math.pi / omega / (every * SWUNG.step))):
        bench.hold(every)
        swing.append(float((mass * shape) @ bench.position[0]))
    measured = 2.0 * math.pi * frequency(np.array(swing), every * SWUNG.step)
    assert measured == pytest.approx(omega, rel=3e-3)
