"""All that hangs on the ropes from the ship: a payload, or a bridle with its hook and loads.

The axial model of the lift is each rope from a hang-off with all of it as one mass at its lower
end. Of a bridle these are hook, rings, bars and payloads, summed, as the figures scale them
together. Its slings count with their mass: they are short, so their stretch, their drag and the
added mass across them are neglected beside those of the rope and the payloads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.core import state as rows
from rope_twin.core.body.state import RigidBody
from rope_twin.core.state import Floats, Rope
from rope_twin.effects.payload import Payload, SplashZoneParams, TwoWayPayload
from rope_twin.effects.rope_mass import AddedMassParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.errors import InputError
from rope_twin.scene.environment import bed_at
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.lift import point_figures
from rope_twin.scene.rigging import is_joined, places
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class SuspendedSystem:
    """The ropes from the ship and what hangs on them, at the scene's figures."""

    # each with the mass of its sections with added mass [kg/m], (sections,), and its length [m]
    ropes: tuple[tuple[Rope, Floats, float], ...]
    bodies: tuple[tuple[float, float, float], ...]  # `_vertical_figures` of all below it
    slings_kg: float  # mass of the ropes below it, with added mass along them
    air_kg: float  # mass in air of payloads, connections and bars

    @property
    def rope(self) -> Rope:
        """Return the rope from the main winch."""
        return self.ropes[0][0]

    @property
    def weight_n(self) -> float:
        """Return the submerged weight of the bodies [N]."""
        return float(sum(weight_n for weight_n, _, _ in self.bodies))

    @property
    def mass_kg(self) -> float:
        """Return the mass of the bodies with added mass along z [kg]."""
        return float(sum(mass_kg for _, mass_kg, _ in self.bodies))

    @property
    def drag_kg_per_m(self) -> float:
        """Return ½·ρ·CdA of the bodies along z [kg/m]."""
        return float(sum(drag for _, _, drag in self.bodies))


def _vertical_figures(effect: Any) -> tuple[float, float, float] | None:
    """Return submerged weight [N], mass with added mass along z [kg] and ½·ρ·CdA along z [kg/m].

    None: the effect is no payload.
    """
    if isinstance(effect, Payload | TwoWayPayload):
        return effect.W, effect.Mz, effect.kz
    if isinstance(effect, RigidBody):
        submerged_n = (effect.m - effect.displaced) * effect.g + effect.hook_weight
        return submerged_n, effect.hook + effect.m + effect.added[2], effect.k[2]
    return None


def hanging_of(scene: Scene) -> SuspendedSystem:
    """Return what hangs on a scene's ropes from the ship.

    Raises:
        SceneError: the scene cannot be built.
    """
    ropes = build_joined(scene).system.ropes if is_joined(scene) else (build(scene),)
    metres = [_metre_kg(scene, rope) for rope in ropes]
    hang_offs, suspended, slings_kg = places(scene), [], 0.0
    for r, (line, rope, kg) in enumerate(zip(scene.ropes, ropes, metres, strict=True)):
        if r == 0 or line.from_ in hang_offs:
            suspended.append((rope, kg, float(line.length_m)))
        else:
            slings_kg += float(kg @ line.lengths_m(line.length_m))
    loads = [_vertical_figures(effect) for rope in ropes for effect in rope.effects]
    bodies = [figures for figures in loads if figures is not None]
    air_kg = sum(figures.mass_kg for figures in point_figures(scene).values())
    return SuspendedSystem(tuple(suspended), tuple(bodies), slings_kg, air_kg)


@dataclass(frozen=True)
class OpenWater:
    """Depths of the payload at which nothing but the water and its rope is known to act on it."""

    min_m: float  # -inf: the scene has neither waves nor splash zone
    max_m: float  # inf: it has no seabed

    def without(self, depth_m: Floats) -> Bools:
        """Return where a payload at these depths is not in open water, of their shape."""
        return (depth_m < self.min_m) | (depth_m > self.max_m)


CLEAR_OF_SURFACE_M = 10.0  # above the crests that a load is lifted in
WAVES_OVER_NOISE = 0.3  # of the load pin, which is white: a force at the waves' periods tells more
CLEAR_OF_BED_M = 5.0  # that charts, line counters and tides are out together
LEAN = 0.1  # the payload is at most this share of the depth away from below the hang-off


def open_water(scene: Scene, noise_n: float) -> OpenWater:
    """Return the depths between waves, splash zone and seabed, where a scene has them.

    noise_n: standard deviation of the load pin's noise [N], beside which the force of waves at the
    payload has to be small: they are not measured.

    Raises:
        InputError: there is no such depth.
    """
    splash, bed = scene.listed(SplashZoneParams), scene.listed(SeabedParams)
    half_m = 0.0 if splash is None else 0.5 * splash.height_m
    shallowest_m = -np.inf if splash is None else CLEAR_OF_SURFACE_M + half_m
    shallowest_m = max(shallowest_m, _below_waves(scene, noise_n))
    deepest_m = np.inf if bed is None else -_highest(scene, bed) - CLEAR_OF_BED_M - half_m
    if shallowest_m > deepest_m:
        problem = (
            f"surface and waves reach down to {shallowest_m:.0f} m, the bed up to {deepest_m:.0f} m"
        )
        raise InputError(f"learn {scene.name}", problem, "learn in deeper water")
    return OpenWater(shallowest_m, deepest_m)


def _below_waves(scene: Scene, noise_n: float) -> float:
    """Return the depth at which the waves' force on what hangs is small [m]; -inf: no waves.

    Taken as the mass with added mass times the acceleration a·ω²·exp(-k·z) of deep water, which is
    not less than the vertical one in shallow water.
    """
    params = scene.listed(WavesParams)
    if params is None:
        return -np.inf
    waves = components_of(params, scene.environment.gravity_m_per_s2)
    depths = np.geomspace(1.0, 1e4, 2000)
    square = 0.5 * (waves.amplitude_m * waves.omega**2) ** 2
    force = np.sqrt(np.exp(-2.0 * np.outer(depths, waves.wave_number)) @ square)
    force *= hanging_of(scene).mass_kg
    return float(depths[np.argmax(force <= WAVES_OVER_NOISE * noise_n)])


def _highest(scene: Scene, bed: SeabedParams) -> float:
    """Return the highest z of the seabed where the payload may be [m]."""
    x, y, _ = scene.ship.hang_off_m
    reach = LEAN * abs(bed_at(bed, x, y))
    nodes = bed.soundings
    eastings, northings = (
        [middle - reach, middle, middle + reach]
        + [coordinate for coordinate in grid if abs(coordinate - middle) < reach]
        for middle, grid in (
            (x, () if nodes is None else nodes.x_m), (y, () if nodes is None else nodes.y_m)
        )
    )  # fmt: skip
    return max(bed_at(bed, east, north) for east in eastings for north in northings)


def _metre_kg(scene: Scene, rope: Rope) -> Floats:
    """Return the mass of each section with added mass along the rope [kg/m], (sections,)."""
    mass, volume, _, _, _ = rope.sections[rows.PER_METRE :]
    density = scene.environment.water_density_kg_per_m3
    tangential = sum(
        effect.tangential for effect in scene.effects if isinstance(effect, AddedMassParams)
    )
    mass_kg_per_m: Floats = mass + tangential * density * volume
    return mass_kg_per_m
