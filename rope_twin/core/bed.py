"""Data of a seabed: a plane, or a grid of soundings."""

from __future__ import annotations

from typing import NamedTuple

from rope_twin.core.loads.hooks import differs_by_rope
from rope_twin.core.state import Floats


class Soil(NamedTuple):
    """Contact properties of the seabed."""

    k: float  # stiffness per area [N/m³]
    k_payload: float  # stiffness below the payload [N/m]
    chi: float  # Hunt-Crossley damping χ [s/m]
    mu: float  # friction coefficient μ


class Plane(NamedTuple):
    """A plane seabed z = height + east·x + north·y."""

    height: float  # at the origin [m]
    east: float
    north: float
    soil: Soil


class Grid(NamedTuple):
    """A seabed given by soundings on a rectangular grid."""

    top: float  # maximum z [m]
    x: Floats  # (columns,)
    y: Floats  # (rows,)
    height: Floats  # z of the bed [m], (rows, columns)
    soil: Soil


differs_by_rope(Plane, Grid)
