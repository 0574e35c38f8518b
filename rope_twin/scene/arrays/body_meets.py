"""Components of a scene's rigid body besides its slings: water, deck and seabed.

The seabed remains an effect of the rope as well, with the hook as the load at its end; the splash
zone applies to the body only.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss

from rope_twin.core.bed import Grid, Plane
from rope_twin.core.body.kinds import with_parts
from rope_twin.core.body.state import Afloat, GridBed, PlaneBed, RigidBody
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.splash_zone import SplashZone, SplashZoneParams
from rope_twin.scene.schema import Scene

COLUMNS = 3  # along each side of a partially submerged body
LEAST_SHARE = 0.1  # of the weight in air: minimum load of a nearly buoyant body on the seabed


def meet(built: Sequence[Any], scene: Scene) -> tuple[Any, ...]:
    """Return the kernel data of a scene's effects, one of which is a rigid body."""
    (body,) = (own for own in built if isinstance(own, RigidBody))
    parts, others = list(body.parts), []
    for own in built:
        if isinstance(own, SplashZone):
            (zone,) = (one for one in scene.effects if isinstance(one, SplashZoneParams))
            parts[0] = _afloat(zone, body, scene.environment.water_density_kg_per_m3)
            continue
        if isinstance(own, Plane | Grid):
            (params,) = (one for one in scene.effects if isinstance(one, SeabedParams))
            parts.append(_bed(own, params, body))
            own = _below_hook(own, params, body)
        others.append(own)
    whole = with_parts(body, tuple(parts))
    if isinstance(parts[0], Afloat):  # it may begin in the air
        whole = whole._replace(W=body.m * body.g + body.hook_weight)
    return tuple(whole if own is body else own for own in others)


def _afloat(params: SplashZoneParams, body: RigidBody, density: float) -> Afloat:
    """Return columns over the body's outline."""
    places, weights = leggauss(COLUMNS)
    (a, b, _), (X, Y, Z) = body.size, body.middle
    columns = [
        (X + 0.5 * a * x, Y + 0.5 * b * y, Z, 0.25 * wx * wy, 0.5 * a * x, 0.5 * b * y)
        for x, wx in zip(places, weights, strict=True)
        for y, wy in zip(places, weights, strict=True)
    ]
    return Afloat(
        columns=np.array(columns, dtype=float),
        height=params.height_m,
        side_x=float(a) / COLUMNS,
        side_y=float(b) / COLUMNS,
        span_x=0.5 * float(a) / sqrt(3.0),
        span_y=0.5 * float(b) / sqrt(3.0),
        aside=body.buoyed - body.middle,
        slam=0.5 * density * params.slamming * params.bottom_area_m2,
    )


def _bed(own: Plane | Grid, params: SeabedParams, body: RigidBody) -> Any:
    """Return the seabed below the corners."""
    weight = (body.m - body.displaced) * body.g
    k = max(weight, LEAST_SHARE * body.m * body.g) / params.payload_penetration_m / body.carrying
    kind: Any = GridBed if isinstance(own, Grid) else PlaneBed
    return kind(shape=own, k=float(k), chi=own.soil.chi, mu=own.soil.mu)


def _below_hook(own: Any, params: SeabedParams, body: RigidBody) -> Any:
    """Return the seabed below the rope, whose end carries only the hook."""
    k = max(body.hook_weight, 0.0) / params.payload_penetration_m
    return own._replace(soil=own.soil._replace(k_payload=k))
