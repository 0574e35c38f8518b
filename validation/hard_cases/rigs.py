"""Fixtures of the robustness tests: the core's arrays of a rope, and heave with build-up."""

from __future__ import annotations

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.statics.equilibrium import find_equilibrium
from rope_twin.core.step import advance
from rope_twin.errors import SolverError, phrase
from rope_twin.scene.model.rope import build
from rope_twin.studies.driven_twin import Motion
from validation import rigs
from validation.rigs import Rig, faded
from validation.state_bench import Nodes, Vector

STILL = 1e-9  # of the line out: a smaller last move is equilibrium


class Arrays(Nodes):
    """The core's arrays of a rig, for cases that set the state itself."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.rope = build(rig.scene())
        self.length = rig.length

    @property
    def s(self) -> Vector:
        """Return a view of the material coordinates from the lower end [m], (nodes,)."""
        return self.rope.state.s[: self.n + 1]

    @property
    def unconverged(self) -> int:
        """Return the number of substeps accepted without convergence."""
        return int(self.rope.state.health[rows.SUBSTEPS_UNCONVERGED])

    def settle(self) -> None:
        """Solve the static equilibrium.

        Raises:
            SolverError: there is none within reach.
        """
        move = find_equilibrium(self.rope, self.length)
        if not move <= STILL * self.length:
            what = f"no static equilibrium found (the last move was {move:.3g} m)"
            raise SolverError(phrase("the rope at rest", what, "a solver defect: report it"))

    def find_acceleration(self) -> None:
        """Solve the acceleration that is consistent with a given state, by a step of 1 µs."""
        model = self.rope.model
        self.rope = self.rope._replace(model=model._replace(step=1e-6))
        self.hold(1)
        self.rope = self.rope._replace(model=model)

    def hold(self, steps: int) -> Vector:
        """Advance with the hang-off at the origin, at rest; the pull on it after each step [N]."""
        value = np.zeros((steps + 1, rows.MOTIONS))
        value[:, rows.LINE] = self.length
        return self.follow(value, np.zeros_like(value))

    def heave(self, motion: Motion, first: int, steps: int) -> Vector:
        """Advance from step `first` with the hang-off heaving; the pull after each step [N]."""
        value, rate = np.zeros((2, steps + 1, rows.MOTIONS))
        value[:, rows.LINE] = self.length
        for k in range(steps + 1):
            value[k, rows.Z], rate[k, rows.Z] = motion((first + k) * self.rig.step)
        return self.follow(value, rate)

    def follow(self, value: Vector, rate: Vector) -> Vector:
        """Advance with prescribed motion; the magnitude of the pull after each step [N].

        value, rate: (steps + 1, MOTIONS), the hang-off and line out at the steps' borders.

        Raises:
            SolverError: a state would not be finite.
        """
        steps = len(value) - 1
        pull = np.zeros((steps, rows.PULL_COLUMNS))
        done = advance(self.rope, rows.Boundary(value, rate), pull, 0.0, steps)
        if done < steps:
            what = "the rope's next state is not finite even at 1/32 of the step"
            raise SolverError(phrase(f"step {done + 1}", what, "a solver defect: report it"))
        self.length = float(value[-1, rows.LINE])
        return pull[:, rows.PULL]

    def energy(self) -> float:
        """Return kinetic (with added mass), strain and potential energy of rope and payload [J].

        The rope's added mass is left out: cases that look at energy have none.
        """
        rig, rest = self.rig, np.diff(self.s)
        lump = 0.5 * (np.concatenate([[0.0], rest]) + np.concatenate([rest, [0.0]]))
        mass, weight = rig.mass * lump, rig.weight * lump
        mass[0] += rig.load + rig.added[2]
        weight[0] += rig.load_weight
        strain = np.linalg.norm(np.diff(self.position), axis=0) / rest - 1.0
        motion = 0.5 * float((mass * (self.velocity**2).sum(axis=0)).sum())
        stretch = 0.5 * rig.EA * float((rest * np.maximum(strain, 0.0) ** 2).sum())
        return motion + stretch + float((weight * self.position[2]).sum())


def sine(amplitude: float, period: float, fade: float = 8.0) -> Motion:
    """Return the heave a·sin(2π·t/T) and its velocity, with a build-up of `fade` [s]."""
    return faded(rigs.sine(amplitude, period), fade)
