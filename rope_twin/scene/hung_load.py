"""What hangs at the rope's lower end at rest in still water: it weighs more above the water.

A payload with `splash_zone` floats by its wetted share alone, a hook weighs beside the body that it
carries. By hand calculation: rope straight down, slings taut and as long as they are given.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from rope_twin.effects.rigid_body import STEEL, RigidBodyParams
from rope_twin.effects.splash_zone import SplashZoneParams
from rope_twin.scene.rules.body import body_of
from rope_twin.scene.schema import Scene
from rope_twin.scene.shapes.shapes import PayloadFigures


@dataclass(frozen=True)
class HungLoad:
    """The weight of payload and hook over the line out."""

    wet_n: float = 0.0  # payload under water, and hook
    lift_n: float = 0.0  # the payload's buoyancy, if it can come out of the water; else 0
    height_m: float = 1.0  # of the payload
    middle_m: float = 0.0  # of the payload above the water with no rope out

    def dry_share(self, line_out_m: float) -> float:
        """What of the payload is above the water, 0 to 1; 0 where it is taken as under water."""
        if self.lift_n <= 0.0:
            return 0.0
        return min(max(0.5 + (self.middle_m - line_out_m) / self.height_m, 0.0), 1.0)

    def weight_n(self, line_out_m: float) -> float:
        """Pull on the rope's lower end [N]."""
        return self.wet_n + self.dry_share(line_out_m) * self.lift_n


def hung_load(scene: Scene, figures: PayloadFigures | None) -> HungLoad:
    """Of a scene of one rope; under water where ropes meet (`alone`), as is what hangs on others.

    Args:
        scene: as loaded.
        figures: of its payload; None: a fixed end, on which nothing hangs.
    """
    if figures is None:
        return HungLoad()
    water, body = scene.environment, body_of(scene)
    density, g = water.water_density_kg_per_m3, water.gravity_m_per_s2
    lift = density * figures.volume_m3 * g
    hook = body.hook_mass_kg * (1.0 - density / STEEL) * g if body else 0.0
    wet = figures.mass_kg * g - lift + hook
    surfacing = next((own for own in scene.effects if isinstance(own, SplashZoneParams)), None)
    if surfacing is None:
        return HungLoad(wet)
    top = scene.ship.hang_off_m[2] - (_below_hook_m(body) if body else 0.0)
    return HungLoad(wet, lift, surfacing.height_m, top)


def _below_hook_m(body: RigidBodyParams) -> float:
    """How far the body's middle hangs below the rope's end."""
    if body.pinned_at_m is not None:
        return body.pinned_at_m[2]
    drops = [
        one.to_m[2] + sqrt(max(one.length_m**2 - one.to_m[0] ** 2 - one.to_m[1] ** 2, 0.0))
        for one in body.slings
    ]
    return sum(drops) / len(drops)
