"""What the hard cases are built from: one rope with every effect, whose figures a case sets.

Physics that a case does not want has a coefficient of 0, so that all cases with a free lower end
share one compiled step, and all with a held one a second.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rope_twin.core import state as rows
from rope_twin.core.statics import find_equilibrium
from rope_twin.core.step import advance
from rope_twin.effects.added_mass import AddedMassParams
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.weight import WeightParams
from rope_twin.errors import SolverError, phrase
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
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin

Vector = NDArray[np.float64]
Triple = tuple[float, float, float]
Motion = Callable[[float], tuple[float, float]]  # time [s] to value and rate
Speeds = Sequence[tuple[float, float]]  # at [s], winch speed from then on [m/s]
Profile = tuple[tuple[float, tuple[float, float]], ...]

NOTHING: Triple = (0.0, 0.0, 0.0)
STILL_WATER: Profile = ((0.0, (0.0, 0.0)),)
WATER = 1025.0
STILL = 1e-9  # of the line out: a smaller last move is equilibrium


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
    added: float = 0.0  # payload's added mass along every axis
    area: float = 0.0  # payload's drag area along every axis
    fixed_at: Triple | None = None  # a lower end held there instead of a payload
    density: float = 0.0  # vacuum
    gravity: float = 9.80665
    current: Profile = STILL_WATER
    drag: tuple[float, float] = (0.0, 0.0)  # normal on d, tangential on pi·d
    added_mass: float = 0.0  # coefficient across the rope
    step: float = 0.01
    tolerance: float | None = None
    winch: Winch | None = None

    def scene(self) -> Scene:
        """The scene, as a file would have given it."""
        free = self.fixed_at is None
        return Scene(
            name="hard case",
            path=Path("hard_case.yaml"),
            digest="",
            about="a hard case of the stability study",
            ropes=(self._line(),),
            payloads=(self._payload(),) if free else (),
            winch=self.winch,
            ship=Ship(motion_ramp_s=0.0),
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

    def _line(self) -> RopeLine:
        rope = Rope(
            diameter_m=self.diameter, hydrodynamic_diameter_m=self.diameter,
            mass_kg_per_m=self.mass, axial_stiffness_n=self.EA, breaking_load_n=1e6,
        )  # fmt: skip
        return RopeLine(
            name="rope",
            rope=rope,
            length_m=self.length,
            elements=self.elements,
            damping=Damping(newton_seconds=self.damping),
            to="load" if self.fixed_at is None else "",
            fixed_at_m=self.fixed_at,
        )

    def _payload(self) -> Payload:
        return Payload(
            name="load", mass_kg=self.load, displaced_volume_m3=self.volume,
            added_mass_kg=(self.added,) * 3, drag_area_m2=(self.area,) * 3,
        )  # fmt: skip

    def twin(self) -> Twin:
        """The running twin, at rest."""
        return Twin(self.scene())

    @property
    def weight(self) -> float:
        """The rope's weight in water per metre [N/m]."""
        return (self.mass - self.density * 0.25 * math.pi * self.diameter**2) * self.gravity

    @property
    def load_weight(self) -> float:
        """The payload's weight in water [N]."""
        return (self.load - self.density * self.volume) * self.gravity

    @property
    def top_weight(self) -> float:
        """The pull of the rope hanging still and straight [N]."""
        return self.load_weight + self.weight * self.length

    @property
    def hanging_depth(self) -> float:
        """Depth of the lower end of the rope hanging still [m]: L + (W + w·L/2)·L/EA."""
        L = self.length
        return L + (self.load_weight + 0.5 * self.weight * L) * L / self.EA


class Arrays:
    """The core's arrays of a rig, for cases that set the state itself."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.rope = build(rig.scene()).rope
        self.length = rig.length

    @property
    def n(self) -> int:
        """Elements in use."""
        return int(self.rope.state.counts[rows.ELEMENTS])

    @property
    def s(self) -> Vector:
        """View of the material coordinates from the lower end [m], (nodes,)."""
        return self.rope.state.s[: self.n + 1]

    @property
    def position(self) -> Vector:
        """View of the node positions, lower end first, (3, nodes)."""
        return self.rope.state.nodes[rows.POSITION : rows.POSITION + 3, : self.n + 1]

    @property
    def velocity(self) -> Vector:
        """View of the node velocities, lower end first, (3, nodes)."""
        return self.rope.state.nodes[rows.VELOCITY : rows.VELOCITY + 3, : self.n + 1]

    @property
    def unconverged(self) -> int:
        """Substeps that were accepted without convergence so far."""
        return int(self.rope.state.health[rows.SUBSTEPS_UNCONVERGED])

    def settle(self) -> None:
        """Go to static equilibrium.

        Raises:
            SolverError: there is none within reach.
        """
        move = find_equilibrium(self.rope, self.length)
        if not move <= STILL * self.length:
            what = f"no static equilibrium found (the last move was {move:.3g} m)"
            raise SolverError(phrase("the rope at rest", what, "a solver defect: report it"))

    def find_acceleration(self) -> None:
        """The acceleration that belongs to a state set by hand: that of a step of 1 µs."""
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
        """Motion (payload with its added mass), stretch and height of rope and payload [J].

        The rope's added mass is left out: cases that look at energy have none.
        """
        rig, rest = self.rig, np.diff(self.s)
        lump = 0.5 * (np.concatenate([[0.0], rest]) + np.concatenate([rest, [0.0]]))
        mass, weight = rig.mass * lump, rig.weight * lump
        mass[0] += rig.load + rig.added
        weight[0] += rig.load_weight
        strain = np.linalg.norm(np.diff(self.position), axis=0) / rest - 1.0
        motion = 0.5 * float((mass * (self.velocity**2).sum(axis=0)).sum())
        stretch = 0.5 * rig.EA * float((rest * np.maximum(strain, 0.0) ** 2).sum())
        return motion + stretch + float((weight * self.position[2]).sum())


def sine(amplitude: float, period: float, fade: float = 8.0) -> Motion:
    """Heave a·sin(2·pi·t/T) and its velocity, faded in by u³·(10 - 15u + 6u²) over `fade` [s]."""
    omega = 2.0 * math.pi / period
    return faded(
        lambda t: (amplitude * math.sin(omega * t), amplitude * omega * math.cos(omega * t)), fade
    )


def faded(motion: Motion, fade: float) -> Motion:
    """A motion that starts from rest: times u³·(10 - 15u + 6u²), u = t/fade up to 1."""

    def at(time: float) -> tuple[float, float]:
        z, v = motion(time)
        u = min(time / fade, 1.0)
        share = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        return share * z, share * v + 30.0 * u * u * (1.0 - u) ** 2 / fade * z

    return at


def still(time: float) -> tuple[float, float]:
    """No motion."""
    return 0.0, 0.0


def march(
    twin: Twin, heave: Motion, seconds: float, every: int = 1, speeds: Speeds = ()
) -> Iterator[Snapshot]:
    """Advance with exact heave samples on every border; a snapshot after each `every` steps.

    Winch commands are offered up to five seconds ahead.

    Raises:
        SolverError: the twin refused a sample, or its next state would not be finite.
    """
    if twin.steps == 0:
        _taken(twin.offer_heave(0, *heave(0.0)))
    waiting = deque(speeds)
    for _ in range(round(seconds / (every * twin.step_s))):
        last = twin.steps + every
        while waiting and waiting[0][0] <= last * twin.step_s + 5.0:
            at, speed = waiting.popleft()
            _taken(twin.offer_speed(round(at * 1e9), speed))
        for k in range(twin.steps + 1, last + 1):
            _taken(twin.offer_heave(k * twin.step_ns, *heave(k * twin.step_s)))
        twin.advance(every)
        yield twin.snapshot()


def _taken(refusal: str) -> None:
    if refusal:
        raise SolverError(refusal)
