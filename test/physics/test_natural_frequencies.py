"""Natural frequencies, measured from free oscillations of the running twin.

P2: taut string in water, n/(2·l)·√(T/μ). P3: axial modes of rope and payload, x·tan x = m·L/M'.
The rope swinging across, by Bessel functions: case P7 of `python -m validation`.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rigs import Rig, frequency, lift, march
from scipy.optimize import brentq  # type: ignore[import-untyped]

from validation.state_bench import pluck

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
    snapshots = list(march(twin, pluck(0.05, duration), duration + 12.0 / first, every=2))
    free = np.array([s.node_position_m[:, 2] for s in snapshots if s.time_s > duration])
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
    snapshots = list(march(twin, lift(0.2, 0.5 * period), 12.0 * period, every=5))
    free = np.array([s.node_position_m[:, 2] for s in snapshots if s.time_s > 0.5 * period]) - rest
    mass = np.full(rig.elements + 1, rope.mass * length / rig.elements)
    mass[0] *= 0.5
    mass[-1] = 0.5 * mass[-1] + MOVING
    mode = np.cos(x * np.linspace(1.0, 0.0, rig.elements + 1))
    measured = 1.0 / frequency(free @ (mass * mode), 5 * rig.step)
    assert measured == pytest.approx(period, rel=2e-3)
