"""An elastically mounted cylinder in a flow, as a rope of three elements."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rigs import Bench, Rig, Vector, with_nothing_below

from rope_twin.scene.schema import Scene, Winch

DIAMETER = 0.1
DENSITY = 1025.0
# a short rope, and a winch that pays it out and hauls it in
HAULED = Rig(
    length=30.0, elements=30, mass=2.0, EA=1e6, diameter=0.03, damping=1e3, load=200.0, volume=0.03,
    density=DENSITY, current=((0.0, (0.5, 0.0)),), drag=(1.2, 0.02), added_mass=1.0, step=0.01,
)  # fmt: skip
HAULING = Winch(
    speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=2.0, min_line_out_m=5.0,
    max_line_out_m=60.0,
)  # fmt: skip


@dataclass(frozen=True)
class Cylinder:
    """Mass ratio, wet natural frequency [Hz], flow speed [m/s], drag coefficient of a cylinder."""

    mass_ratio: float = 2.4
    frequency: float = 1.0
    speed: float = 0.6
    drag: float = 1.2
    step: float = 0.01

    @property
    def displaced(self) -> float:
        """Displaced mass per metre."""
        return DENSITY * 0.25 * math.pi * DIAMETER**2

    @property
    def moving(self) -> float:
        """Mass per metre with added mass, Ca = 1."""
        return (self.mass_ratio + 1.0) * self.displaced

    def scene(self, *effects: Any) -> Scene:
        """Return three elements stretched thirty times: springs that are equal in all directions.

        Both nodes move alike, each on T/l per third of the rope; slopes stay below 1 %.
        """
        third, chord = 1.0 / 3.0, 30.0
        k = self.moving * third * (2.0 * math.pi * self.frequency) ** 2
        tension = k * chord / 3.0
        rig = Rig(
            length=1.0, elements=3, mass=self.mass_ratio * self.displaced,
            EA=tension / (chord - 1.0), diameter=DIAMETER, density=DENSITY, gravity=0.0,
            fixed_at=(0.0, 0.0, -chord), current=((0.0, (self.speed, 0.0)),), drag=(self.drag, 0.0),
            added_mass=1.0, step=self.step, tolerance=1e-6,
        )  # fmt: skip
        scene = rig.scene()
        return with_nothing_below(replace(scene, effects=(*scene.effects, *effects)))

    def run(self, bench: Bench, seconds: float) -> Vector:
        """Return in-line and cross-flow positions [m] of a node after every step, (steps, 2)."""
        positions = []
        for _ in range(round(seconds / self.step)):
            bench.hold(1)
            positions.append(bench.position[:2, 1].copy())
        return np.array(positions)


def runge_kutta(
    slope: Callable[[Vector], Vector], state: Vector, step: float, count: int
) -> Vector:
    """Integrate by the classical Runge-Kutta method; return every state, (count, unknowns)."""
    states = []
    for _ in range(count):
        k1 = slope(state)
        k2 = slope(state + 0.5 * step * k1)
        k3 = slope(state + 0.5 * step * k2)
        k4 = slope(state + step * k3)
        state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        states.append(state)
    return np.array(states)
