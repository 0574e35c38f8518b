"""What the physics tests are built from: rigs, and the core's arrays at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.statics import find_equilibrium
from rope_twin.core.step import advance
from rope_twin.scene.build import build
from rope_twin.scene.schema import Scene
from rope_twin.studies.rigs import NOTHING, STILL_WATER, Motion, Rig, Speeds, march, sine, still
from rope_twin.studies.stability_rigs import Nodes

__all__ = [
    "NOTHING", "STILL_WATER", "Bench", "Motion", "Rig", "Speeds", "frequency", "lift", "march",
    "sine", "still", "top_tension",
]  # fmt: skip

Vector = NDArray[np.float64]
Heave = Motion


def lift(height: float, duration: float) -> Heave:
    """From 0 to `height` within `duration`, smooth (quintic), then at rest."""

    def at(time: float) -> tuple[float, float]:
        if time >= duration:
            return height, 0.0
        u = time / duration
        rate = 30.0 * u * u * (1.0 - u) ** 2 / duration
        return height * u**3 * (10.0 - 15.0 * u + 6.0 * u * u), height * rate

    return at


def top_tension(twin: Twin, heave: Heave, seconds: float, every: int = 1) -> Vector:
    """The published top tension [N] after each `every` steps."""
    return np.array([shot.tension_top_n for shot in march(twin, heave, seconds, every)])


class Bench(Nodes):
    """The core's arrays of a scene in static equilibrium, for tests that set the state itself."""

    def __init__(self, scene: Scene) -> None:
        self.rope = build(scene).rope
        self.length = scene.ropes[0].length_m
        self.hang_off = scene.ship.hang_off_m
        self.time = 0.0
        assert find_equilibrium(self.rope, self.length) <= 1e-9 * self.length

    @property
    def acceleration(self) -> Vector:
        """View of the node accelerations, payload first, (3, nodes)."""
        return self.rope.state.nodes[rows.ACCELERATION : rows.ACCELERATION + 3, : self.n + 1]

    def hold(self, steps: int) -> Vector:
        """Advance with the hang-off at rest; the magnitude of the pull on it after each step."""
        value = np.tile([*self.hang_off, self.length], (steps + 1, 1))
        return self.follow(rows.Boundary(value, np.zeros_like(value)))

    def follow(self, boundary: rows.Boundary) -> Vector:
        """Advance with prescribed motion; the magnitude of the pull on it after each step."""
        steps = len(boundary.value) - 1
        pull = np.zeros((steps, rows.PULL_COLUMNS))
        done = advance(self.rope, boundary, pull, self.time, steps)
        assert done == steps, f"step {done + 1} was not finite"
        self.time += steps * self.rope.model.step
        return pull[:, rows.PULL]


def frequency(values: Vector, step: float) -> float:
    """Frequency [Hz] of a nearly pure oscillation about its mean.

    A straight line through the times of its rising zero crossings (cubic in between).
    """
    x = values - values.mean()
    k = np.flatnonzero((x[1:-2] < 0.0) & (x[2:-1] >= 0.0)) + 1
    assert len(k) > 2, "too few crossings to tell a frequency"
    times = []
    for i in k:
        roots = np.polynomial.polynomial.polyroots(
            np.polynomial.polynomial.polyfit([-1.0, 0.0, 1.0, 2.0], x[i - 1 : i + 3], 3)
        )
        real = roots.real[np.abs(roots.imag) < 1e-9]
        times.append((i + real[np.argmin(np.abs(real - 0.5))]) * step)
    return float(1.0 / np.polyfit(np.arange(len(times)), times, 1)[0])
