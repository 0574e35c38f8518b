"""Added mass and radiation damping of a box or an upright cylinder near the free surface.

The tables of DNV-RP-N103 (appendix A) that scenes take added mass from are of an unbounded fluid.
Near the surface it depends on depth and period, and the body radiates waves. Capytaine (Ancellin
and Dias 2019, JOSS 4, 1341), a boundary element method for the linear potential in deep water,
solves for it; a body that pierces the surface is cut at it.

The error of the panels is the difference from twice their size, times 1/3: what remains if it falls
with the square of their size (Roache 1998).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rope_twin.errors import InputError, require
from rope_twin.scene.shapes import Box, Cylinder

PANELS = 16  # along the longest side
FEWEST = 4
AXES = {"Surge": "x", "Heave": "z"}
SECOND_ORDER = 1.0 / 3.0


@dataclass(frozen=True)
class NearSurface:
    """Coefficients of a body that oscillates along x and z at one period."""

    period_s: float  # infinite: in an unbounded fluid
    added_mass_kg: tuple[float, float]  # along x, along z
    damping_kg_per_s: tuple[float, float]  # of the waves that it radiates
    error: float  # of the panels, over the added mass, the larger of both


def near_surface(
    shape: Box | Cylinder,
    depth_m: float,
    periods_s: Sequence[float],
    density_kg_per_m3: float = 1025.0,
    gravity_m_per_s2: float = 9.80665,
) -> list[NearSurface]:
    """Return the coefficients at each period; math.inf: in an unbounded fluid.

    depth_m: of the body's middle below the still water; less than half its height: it pierces the
        surface.

    Raises:
        InputError: Capytaine is not installed, a period is not positive, or the body is out of the
            water.
    """
    require("capytaine", "coefficients near the surface need it", "hydrodynamics")
    if wrong := [period_s for period_s in periods_s if not period_s > 0.0]:
        raise InputError("period", f"{wrong[0]:g} s", "give positive ones")
    half = 0.5 * shape.height_m
    if depth_m <= -half:
        problem = (
            f"its middle is {-depth_m:g} m above the water, and it is {shape.height_m:g} m high"
        )
        raise InputError("depth", problem, f"give more than {-half:g} m")
    fine, coarse = (_body(shape, depth_m, panels) for panels in (PANELS, PANELS // 2))
    water = {"rho": density_kg_per_m3, "g": gravity_m_per_s2}
    return [_at(period, fine, coarse, water) for period in periods_s]


def _body(shape: Box | Cylinder, depth_m: float, panels: int) -> Any:
    """Return the body of Capytaine with about so many panels along its longest side."""
    import capytaine

    capytaine.set_logging("ERROR")
    centre, high = (0.0, 0.0, -depth_m), shape.height_m
    if isinstance(shape, Box):
        size = shape.length_m, shape.width_m, high
        counts = tuple(max(FEWEST, round(panels * side / max(size))) for side in size)
        mesh = capytaine.mesh_parallelepiped(size=size, resolution=counts, center=centre)
    else:
        radius = 0.5 * shape.diameter_m
        panel = max(shape.diameter_m, high) / panels
        counts = tuple(
            max(FEWEST, round(length / panel)) for length in (radius, 2.0 * math.pi * radius, high)
        )
        mesh = capytaine.mesh_vertical_cylinder(
            length=high, radius=radius, center=centre, resolution=counts
        )
    body = capytaine.FloatingBody(mesh=mesh)
    for name in AXES:
        body.add_translation_dof(name=name)
    return body.immersed_part()


def _at(period_s: float, fine: Any, coarse: Any, water: Any) -> NearSurface:
    added, damping, errors = [], [], []
    for name in AXES:
        (a, b), (other, _) = (_solved(body, name, period_s, water) for body in (fine, coarse))
        added.append(a)
        damping.append(b)
        errors.append(SECOND_ORDER * abs(a - other) / abs(a))
    return NearSurface(period_s, (added[0], added[1]), (damping[0], damping[1]), max(errors))


def _solved(body: Any, name: str, period_s: float, water: Any) -> tuple[float, float]:
    """Return added mass [kg] and damping [kg/s] of a motion along its own axis."""
    import capytaine

    unbounded = math.isinf(period_s)
    problem = capytaine.RadiationProblem(
        body=body,
        radiating_dof=name,
        omega=1.0 if unbounded else 2.0 * math.pi / period_s,
        free_surface=math.inf if unbounded else 0.0,
        **water,
    )
    result = capytaine.BEMSolver().solve(problem)
    return float(result.added_masses[name]), float(result.radiation_dampings[name])
