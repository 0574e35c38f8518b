"""A rope whose state is set by hand and stepped by the core alone, and what is read from it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from rope_twin.core import state as rows
from rope_twin.core.statics import find_equilibrium
from rope_twin.core.step import advance
from rope_twin.errors import SolverError
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import Motion
from rope_twin.twin.motion.heave_track import ramp
from validation.rigs import Rig

Vector = NDArray[np.float64]
AT_REST = 1e-9  # of the length: what the search for rest may leave


class Bench:
    """The core's arrays of a scene's rope, by default in static equilibrium.

    Raises:
        SolverError: there is none.
    """

    def __init__(
        self, scene: Scene, rope: rows.Rope | None = None, *, at_rest: bool = True
    ) -> None:
        self.rope = build(scene) if rope is None else rope
        self.length = scene.ropes[0].length_m
        self.hang_off = scene.ship.hang_off_m
        self.time = 0.0
        if at_rest:
            self.settle()

    @property
    def n(self) -> int:
        """Return the number of elements in use."""
        return int(self.rope.state.counts[rows.ELEMENTS])

    @property
    def s(self) -> Vector:
        """Return a view of the material coordinates from the lower end [m], (nodes,)."""
        return self.rope.state.s[: self.n + 1]

    @property
    def position(self) -> Vector:
        """Return a view of the node positions, lower end first, (3, nodes)."""
        return self._nodes(rows.POSITION)

    @property
    def velocity(self) -> Vector:
        """Return a view of the node velocities, lower end first, (3, nodes)."""
        return self._nodes(rows.VELOCITY)

    @property
    def acceleration(self) -> Vector:
        """Return a view of the node accelerations, lower end first, (3, nodes)."""
        return self._nodes(rows.ACCELERATION)

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
        if not move <= AT_REST * self.length:
            problem = f"no static equilibrium found (the last move was {move:.3g} m)"
            raise SolverError("the rope at rest", problem, "check what holds it")

    def find_acceleration(self) -> None:
        """Solve the acceleration that is consistent with a given state, by a step of 1 µs."""
        model = self.rope.model
        self.rope = self.rope._replace(model=model._replace(step=1e-6))
        self.hold(1)
        self.rope = self.rope._replace(model=model)

    def hold(self, steps: int) -> Vector:
        """Advance with the hang-off at rest; the magnitude of the pull on it after each step."""
        return self.follow(self.still(steps))

    def still(self, steps: int) -> rows.Boundary:
        """Return the motion of a hang-off at rest."""
        value = np.tile([*self.hang_off, self.length], (steps + 1, 1))
        return rows.Boundary(value, np.zeros_like(value))

    def follow(self, boundary: rows.Boundary) -> Vector:
        """Advance with prescribed motion; the magnitude of the pull on it after each step.

        Raises:
            SolverError: a step is not finite.
        """
        steps = len(boundary.value) - 1
        pull = np.zeros((steps, rows.PULL_COLUMNS))
        done = advance(self.rope, boundary, pull, self.time, steps)
        if done < steps:
            raise SolverError(f"step {done + 1}", "it is not finite", "shorten the step")
        self.time += steps * self.rope.model.step
        self.length = float(boundary.value[-1, rows.LINE])
        return pull[:, rows.PULL]

    def _nodes(self, first: int) -> Vector:
        return self.rope.state.nodes[first : first + 3, : self.n + 1]


def energy(bench: Bench, rig: Rig) -> float:
    """Return kinetic, strain and potential energy of rope and payload [J].

    Nodes carry half of their elements. The payload has its added mass, the rope none.
    """
    rest_length = np.diff(bench.s)
    lump = 0.5 * (np.concatenate([[0.0], rest_length]) + np.concatenate([rest_length, [0.0]]))
    mass, weight = rig.mass * lump, rig.weight * lump
    mass[0] += rig.load + rig.added[2]
    weight[0] += rig.load_weight
    strain = np.linalg.norm(np.diff(bench.position), axis=0) / rest_length - 1.0
    motion = 0.5 * float((mass * (bench.velocity**2).sum(axis=0)).sum())
    stretch = 0.5 * rig.EA * float((rest_length * np.maximum(strain, 0.0) ** 2).sum())
    return motion + stretch + float((weight * bench.position[2]).sum())


def time_in_turns(
    benches: Sequence[Bench], pieces: int, motion: Callable[[Bench], rows.Boundary]
) -> list[list[float]]:
    """Time benches in turns; return the seconds that each takes to follow its motion."""
    took: list[list[float]] = [[] for _ in benches]
    for _ in range(pieces):
        for bench, times in zip(benches, took, strict=True):
            boundary = motion(bench)
            began = time.perf_counter()
            bench.follow(boundary)
            times.append(time.perf_counter() - began)
    return took


def lift(height: float, duration: float) -> Motion:
    """Return a smooth (quintic) rise from 0 to `height` within `duration`."""

    def at(time: float) -> tuple[float, float]:
        share, rate = ramp(time, duration)
        return height * share, height * rate

    return at


def pluck(height: float, duration: float) -> Motion:
    """Return a displacement to `height` and back within `duration`."""
    lifted = lift(height, 0.5 * duration)

    def at(time: float) -> tuple[float, float]:
        if time <= 0.5 * duration:
            return lifted(time)
        z, v = lifted(max(duration - time, 0.0))
        return z, -v

    return at


def frequency(values: Vector, step: float) -> float:
    """Return the frequency of a nearly harmonic oscillation about its mean [Hz].

    A straight line through the times of its rising zero crossings (cubic in between).

    Raises:
        SolverError: it crosses its mean too rarely.
    """
    x = values - values.mean()
    k = np.flatnonzero((x[1:-2] < 0.0) & (x[2:-1] >= 0.0)) + 1
    if len(k) < 3:
        raise SolverError("oscillation", f"{len(k)} crossings", "watch it for longer")
    times = []
    for i in k:
        roots = np.polynomial.polynomial.polyroots(
            np.polynomial.polynomial.polyfit([-1.0, 0.0, 1.0, 2.0], x[i - 1 : i + 3], 3)
        )
        real = roots.real[np.abs(roots.imag) < 1e-9]
        times.append((i + real[np.argmin(np.abs(real - 0.5))]) * step)
    return float(1.0 / np.polyfit(np.arange(len(times)), times, 1)[0])
