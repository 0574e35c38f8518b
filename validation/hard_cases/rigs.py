"""Fixtures of the robustness tests: the core's arrays of a rig, and heave with build-up."""

from __future__ import annotations

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary
from rope_twin.studies.driven_twin import Motion
from validation import rigs
from validation.rigs import Rig, faded
from validation.state_bench import Bench, Vector, energy


class RigBench(Bench):
    """The core's arrays of a rig as built, for cases that set the state themselves."""

    def __init__(self, rig: Rig, rope: rows.Rope | None = None) -> None:
        super().__init__(rig.scene(), rope, at_rest=False)
        self.rig = rig

    def heave(self, motion: Motion, first: int, steps: int) -> Vector:
        """Advance from step `first` with the hang-off heaving; the pull after each step [N]."""
        value, rate = np.zeros((2, steps + 1, rows.MOTIONS))
        value[:, rows.LINE] = self.length
        for k in range(steps + 1):
            value[k, rows.Z], rate[k, rows.Z] = motion((first + k) * self.rig.step)
        return self.follow(Boundary(value, rate))

    def energy(self) -> float:
        """Return kinetic, strain and potential energy of rope and payload [J]."""
        return energy(self, self.rig)


def settled(rig: Rig) -> RigBench:
    """Return a rope in static equilibrium."""
    bench = RigBench(rig)
    bench.settle()
    return bench


def sine(amplitude: float, period: float, fade: float = 8.0) -> Motion:
    """Return the heave a·sin(2π·t/T) and its velocity, with a build-up of `fade` [s]."""
    return faded(rigs.sine(amplitude, period), fade)
