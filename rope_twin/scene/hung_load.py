"""Suspended load at the rope's lower end in still water, which is heavier above the water.

A payload with `splash_zone` has the buoyancy of its submerged part; a hook adds to the body that it
carries. By hand calculation: rope straight down, slings taut and unstretched.
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
    """Weight of payload and hook as a function of the paid-out length."""

    wet_n: float = 0.0  # submerged payload, and hook
    lift_n: float = 0.0  # the payload's buoyancy, if it can leave the water; else 0
    height_m: float = 1.0  # of the payload
    middle_m: float = 0.0  # height of the payload's middle above the water at zero payout

    def dry_share(self, line_out_m: float) -> float:
        """Return the fraction of the payload above the water, 0 to 1; 0 if treated as submerged."""
        if self.lift_n <= 0.0:
            return 0.0
        return min(max(0.5 + (self.middle_m - line_out_m) / self.height_m, 0.0), 1.0)

    def weight_n(self, line_out_m: float) -> float:
        """Return the static load on the rope's lower end [N]."""
        return self.wet_n + self.dry_share(line_out_m) * self.lift_n


def hung_load(scene: Scene, figures: PayloadFigures | None) -> HungLoad:
    """Return the suspended load of a single-line scene; in multi-line scenes it is submerged.

    Args:
        scene: as loaded.
        figures: of its payload; None: a fixed end without a load.
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
    """Return the distance of the body's middle below the rope's end."""
    if body.pinned_at_m is not None:
        return body.pinned_at_m[2]
    drops = [
        one.to_m[2] + sqrt(max(one.length_m**2 - one.to_m[0] ** 2 - one.to_m[1] ** 2, 0.0))
        for one in body.slings
    ]
    return sum(drops) / len(drops)
