"""An independent computation of a vertical rope: explicit, in one dimension, plain numpy.

The same lumped elements T = max(0, EA·strain + c·strain rate) between points on a line, stepped by
symplectic Euler (v += h·F/M, x += h·v) far below the stability limit h < (2/ω)·(√(1 + ζ²) - ζ),
ω = 2·√(EA/m)/l0, ζ = c·√(EA/m)/(EA·l0). No Newton, no halving, no guard: what both agree on is
neither's invention.
"""

from __future__ import annotations

import math

import numpy as np

from rope_twin.studies.driven_twin import Motion
from validation.rigs import Rig
from validation.state_bench import Vector

SHARE = 0.25  # of the largest stable step


def explicit_top_tension(rig: Rig, heave: Motion, seconds: float) -> Vector:
    """Return the force on the hang-off [N] at the step boundaries after the first, (steps,).

    Half an element's inertia, weight and drag are added to the top element's tension, as in the
    published figure.
    """
    line = _Line(rig)
    inner = math.ceil(rig.step / (SHARE * line.largest_step()))
    h = rig.step / inner
    steps = round(seconds / rig.step)
    pulls = np.zeros(steps)
    for k in range(steps):
        for j in range(inner):
            line.advance(h, *heave(k * rig.step + (j + 1) * h))
        before, after = heave((k + 1) * rig.step - h)[1], heave((k + 1) * rig.step + h)[1]
        pulls[k] = line.pull((after - before) / (2.0 * h))
    return pulls


class _Line:
    """Nodes on the vertical, lower end first; at rest in equilibrium at the start."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.rest = rig.length / rig.elements
        n = rig.elements
        self.lump = np.full(n, self.rest)
        self.lump[0] *= 0.5
        tension = rig.load_weight + rig.weight * self.rest * (np.arange(n) + 0.5)
        stretched = self.rest * (1.0 + np.maximum(tension, 0.0) / rig.EA)
        self.z = np.concatenate([[0.0], np.cumsum(stretched)])
        self.z -= self.z[-1]
        self.v = np.zeros(n + 1)
        self.weight = rig.weight * self.lump
        self.weight[0] += rig.load_weight
        self.mass = rig.mass * self.lump
        self.mass[0] += rig.load + rig.added[2]
        pressure = 0.5 * rig.density * rig.diameter
        self.along = pressure * math.pi * rig.drag[1] * self.lump
        self.across = pressure * rig.drag[0] * self.lump
        self.payload = 0.5 * rig.density * rig.area[2]
        area = 0.25 * math.pi * rig.diameter**2
        self.added = rig.added_mass * rig.density * area * self.lump

    def largest_step(self) -> float:
        """Return the stability limit of the time step [s]."""
        rig = self.rig
        speed = math.sqrt(rig.EA / rig.mass)
        omega, zeta = 2.0 * speed / self.rest, rig.damping * speed / (rig.EA * self.rest)
        return 2.0 / omega * (math.sqrt(1.0 + zeta * zeta) - zeta)

    def _pulls(self) -> tuple[Vector, Vector]:
        """Return tension [N] and direction, +1 or -1, of the elements."""
        gap = np.diff(self.z)
        way = np.where(gap < 0.0, -1.0, 1.0)
        strain = way * gap / self.rest - 1.0
        rate = way * np.diff(self.v) / self.rest
        return np.maximum(self.rig.EA * strain + self.rig.damping * rate, 0.0), way

    def advance(self, h: float, z: float, v: float) -> None:
        """Advance one step, at whose end the hang-off is at z with velocity v."""
        tension, way = self._pulls()
        force = tension * way
        force[1:] -= tension[:-1] * way[:-1]
        folded = np.zeros(len(force), bool)  # neighbours point against each other: no tangent
        folded[1:] = way[1:] != way[:-1]
        free = self.v[:-1]
        force -= self.weight + np.where(folded, self.across, self.along) * np.abs(free) * free
        force[0] -= self.payload * abs(free[0]) * free[0]
        free += h * force / (self.mass + np.where(folded, self.added, 0.0))
        self.v[-1] = v
        self.z[:-1] += h * free
        self.z[-1] = z

    def pull(self, acceleration: float) -> float:
        """Return the force of the rope on the hang-off [N], downward."""
        tension, way = self._pulls()
        rig, half, v = self.rig, 0.5 * self.rest, float(self.v[-1])
        drag = 0.5 * rig.density * rig.diameter * math.pi * rig.drag[1] * abs(v) * v
        loads = half * (rig.mass * acceleration + rig.weight + drag)
        return float(tension[-1] * way[-1] + loads)
