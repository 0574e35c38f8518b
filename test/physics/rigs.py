"""Small cases for the physics tests: one rope with all effects, whose coefficients a test sets.

Every case lists the same effects and switches physics off by a coefficient of zero, so that all
tests share two compiled binaries: with a payload, and with a fixed lower end.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rope_twin import Snapshot, Twin
from rope_twin.core import state as rows
from rope_twin.core.statics import find_equilibrium
from rope_twin.core.step import advance
from rope_twin.effects.added_mass import AddedMassParams
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.weight import WeightParams
from rope_twin.scene.build import build
from rope_twin.scene.schema import (
    Damping,
    Environment,
    Payload,
    Rope,
    RopeLine,
    Scene,
    Ship,
    Time,
    Winch,
)

Vector = NDArray[np.float64]
Triple = tuple[float, float, float]
Heave = Callable[[float], tuple[float, float]]  # time [s] to position [m] and velocity [m/s]
NOTHING: Triple = (0.0, 0.0, 0.0)
STILL_WATER = ((0.0, (0.0, 0.0)),)


@dataclass(frozen=True, kw_only=True)
class Rig:
    """One rope below a hang-off at the origin; what is not given is absent. SI units."""

    length: float = 1000.0
    elements: int = 100
    mass: float = 6.4  # per metre
    EA: float = 65e6
    diameter: float = 0.04
    damping: float = 0.0  # N·s
    load: float = 20e3  # payload's mass
    volume: float = 0.0
    added: Triple = NOTHING  # payload's added mass along x, y, z
    area: Triple = NOTHING  # payload's drag area along x, y, z
    fixed_at: Triple | None = None  # a lower end held there instead of a payload
    hang_off: Triple = NOTHING
    density: float = 0.0  # vacuum
    gravity: float = 9.80665
    current: tuple[tuple[float, tuple[float, float]], ...] = STILL_WATER
    drag: tuple[float, float] = (0.0, 0.0)  # normal on d, tangential on pi·d
    added_mass: float = 0.0  # coefficient across the rope
    step: float = 0.01
    tolerance: float | None = None
    ramp: float = 0.0
    winch: Winch | None = None

    def scene(self) -> Scene:
        """The scene, as a file would have given it."""
        rope = Rope(
            diameter_m=self.diameter,
            mass_kg_per_m=self.mass,
            hydrodynamic_diameter_m=self.diameter,
            axial_stiffness_n=self.EA,
            breaking_load_n=1e6,
        )
        free = self.fixed_at is None
        payload = Payload(
            name="load",
            mass_kg=self.load,
            displaced_volume_m3=self.volume,
            added_mass_kg=self.added,
            drag_area_m2=self.area,
        )
        return Scene(
            name="rig",
            path=Path("rig.yaml"),
            digest="",
            about="a rig of the physics tests",
            ropes=(
                RopeLine(
                    name="rope",
                    rope=rope,
                    length_m=self.length,
                    elements=self.elements,
                    damping=Damping(newton_seconds=self.damping),
                    to="load" if free else "",
                    fixed_at_m=self.fixed_at,
                ),
            ),
            payloads=(payload,) if free else (),
            winch=self.winch,
            ship=Ship(hang_off_m=self.hang_off, motion_ramp_s=self.ramp),
            environment=Environment(
                water_density_kg_per_m3=self.density, gravity_m_per_s2=self.gravity
            ),
            effects=(
                CurrentParams(profile=self.current),
                WeightParams(),
                DragParams(normal=self.drag[0], tangential=self.drag[1]),
                AddedMassParams(normal=self.added_mass),
                *([PayloadParams()] if free else []),
            ),
            time=Time(step_s=self.step, newton_tolerance_n=self.tolerance),
        )

    def twin(self) -> Twin:
        """The running twin, at rest."""
        return Twin(self.scene())

    @property
    def weight(self) -> float:
        """The rope's weight in water per metre [N/m]."""
        area = 0.25 * math.pi * self.diameter**2
        return (self.mass - self.density * area) * self.gravity

    @property
    def load_weight(self) -> float:
        """The payload's weight in water [N]."""
        return (self.load - self.density * self.volume) * self.gravity


def sine(amplitude: float, period: float) -> Heave:
    """Heave a·sin(2·pi·t/T) and its velocity; the ship's ramp fades it in."""
    omega = 2.0 * math.pi / period

    def at(time: float) -> tuple[float, float]:
        angle = omega * time
        return amplitude * math.sin(angle), amplitude * omega * math.cos(angle)

    return at


def still(time: float) -> tuple[float, float]:
    """No heave."""
    return 0.0, 0.0


def lift(height: float, duration: float) -> Heave:
    """From 0 to `height` within `duration`, smooth (quintic), then at rest."""

    def at(time: float) -> tuple[float, float]:
        if time >= duration:
            return height, 0.0
        u = time / duration
        rate = 30.0 * u * u * (1.0 - u) ** 2 / duration
        return height * u**3 * (10.0 - 15.0 * u + 6.0 * u * u), height * rate

    return at


Speeds = Sequence[tuple[float, float]]  # at [s], winch speed from then on [m/s]


def march(
    twin: Twin, heave: Heave, seconds: float, every: int = 1, speeds: Speeds = ()
) -> Iterator[Snapshot]:
    """Advance with exact heave samples on every border; a snapshot after each `every` steps.

    Winch commands are offered up to five seconds ahead.
    """
    if twin.steps == 0:
        assert twin.offer_heave(0, *heave(0.0)) == ""
    waiting = deque(speeds)
    for _ in range(round(seconds / (every * twin.step_s))):
        last = twin.steps + every
        while waiting and waiting[0][0] <= last * twin.step_s + 5.0:
            at, speed = waiting.popleft()
            assert twin.offer_speed(round(at * 1e9), speed) == ""
        for k in range(twin.steps + 1, last + 1):
            assert twin.offer_heave(k * twin.step_ns, *heave(k * twin.step_s)) == ""
        twin.advance(every)
        yield twin.snapshot()


def top_tension(twin: Twin, heave: Heave, seconds: float, every: int = 1) -> Vector:
    """The published top tension [N] after each `every` steps."""
    return np.array([shot.tension_top_n for shot in march(twin, heave, seconds, every)])


class Bench:
    """The core's arrays of a scene in static equilibrium, for tests that set the state itself."""

    def __init__(self, scene: Scene) -> None:
        self.rope = build(scene).rope
        self.length = scene.ropes[0].length_m
        self.hang_off = scene.ship.hang_off_m
        self.time = 0.0
        assert find_equilibrium(self.rope, self.length) <= 1e-9 * self.length

    @property
    def n(self) -> int:
        """Elements in use."""
        return int(self.rope.state.counts[rows.ELEMENTS])

    @property
    def position(self) -> Vector:
        """View of the node positions, payload first, (3, nodes)."""
        return self.rope.state.nodes[rows.POSITION : rows.POSITION + 3, : self.n + 1]

    @property
    def velocity(self) -> Vector:
        """View of the node velocities, payload first, (3, nodes)."""
        return self.rope.state.nodes[rows.VELOCITY : rows.VELOCITY + 3, : self.n + 1]

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
