"""One rope with its effects, whose figures are set: for physics tests and studies of hard cases.

Physics that is not wanted has a coefficient of 0, so that all rigs with a free lower end share one
compiled step, and all with a held one a second. Bending, which has a solve of its own, is there
only where its stiffness is given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from rope_twin.effects.bending import BendingParams
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rope_mass import AddedMassParams, WeightParams
from rope_twin.effects.waves import RegularWave, WavesParams
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
from rope_twin.studies.driven_twin import Motion
from rope_twin.twin.motion.heave_track import ramp
from rope_twin.twin.twin import Twin

Triple = tuple[float, float, float]
Profile = tuple[tuple[float, tuple[float, float]], ...]

NOTHING: Triple = (0.0, 0.0, 0.0)
STILL_WATER: Profile = ((0.0, (0.0, 0.0)),)
WATER = 1025.0
# For rigs whose step is compiled with waves anyway: these move no water at all.
CALM = WavesParams(regular=RegularWave(height_m=0.0, period_s=8.0))


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
    current: Profile = STILL_WATER
    drag: tuple[float, float] = (0.0, 0.0)  # normal on d, tangential on π·d
    added_mass: float = 0.0  # coefficient across the rope
    EI: float | None = None  # N·m²
    clamp: Triple | None = None  # direction in which the hang-off holds a rope with EI
    step: float = 0.01
    tolerance: float | None = None
    ramp: float = 0.0
    winch: Winch | None = None

    def scene(self) -> Scene:
        """Return the scene, as a file would give it."""
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
            about="a rig",
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
                *([] if self.EI is None else [self._bending(self.EI)]),
                *([PayloadParams()] if free else []),
            ),
            time=Time(step_s=self.step, newton_tolerance_n=self.tolerance),
        )

    def _bending(self, EI: float) -> BendingParams:
        return BendingParams(stiffness_n_m2=EI, clamped_along=self.clamp)

    def twin(self) -> Twin:
        """Return the twin, in static equilibrium."""
        return Twin(self.scene())

    @property
    def weight(self) -> float:
        """Return the rope's submerged weight per metre [N/m]."""
        area = 0.25 * math.pi * self.diameter**2
        return (self.mass - self.density * area) * self.gravity

    @property
    def load_weight(self) -> float:
        """Return the payload's submerged weight [N]."""
        return (self.load - self.density * self.volume) * self.gravity

    @property
    def top_weight(self) -> float:
        """Return the top tension of the rope hanging straight [N]."""
        return self.load_weight + self.weight * self.length

    @property
    def hanging_depth(self) -> float:
        """Return the depth of the lower end of the hanging rope [m]: L + (W + w·L/2)·L/EA."""
        L = self.length
        return L + (self.load_weight + 0.5 * self.weight * L) * L / self.EA


def with_nothing_below(scene: Scene) -> Scene:
    """A rig's scene whose lower end is held, with a payload of no mass there.

    No load on a node that is held counts. Its step is the one that scenes with a payload are
    compiled for anyway.
    """
    (line,) = scene.ropes
    nothing = Payload(
        name="nothing", mass_kg=0.0, displaced_volume_m3=0.0, added_mass_kg=(0.0, 0.0, 0.0),
        drag_area_m2=(0.0, 0.0, 0.0),
    )  # fmt: skip
    return replace(
        scene,
        ropes=(replace(line, to=nothing.name),),
        payloads=(nothing,),
        effects=(*scene.effects, PayloadParams()),
    )


def sine(amplitude: float, period: float) -> Motion:
    """Return the motion a·sin(2π·t/T) and its velocity, with the ship's build-up ramp."""
    omega = 2.0 * math.pi / period

    def at(time: float) -> tuple[float, float]:
        angle = omega * time
        return amplitude * math.sin(angle), amplitude * omega * math.cos(angle)

    return at


def faded(motion: Motion, fade: float) -> Motion:
    """Return a motion that starts from rest, with the ship's build-up ramp."""

    def at(time: float) -> tuple[float, float]:
        z, v = motion(time)
        share, rate = ramp(time, fade)
        return share * z, share * v + rate * z

    return at
