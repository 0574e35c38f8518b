"""Shape of a rope at one instant from its upper end down, for touchdown and bend results."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rope_twin.core.state import Rope
from rope_twin.scene.schema import RopeLine
from rope_twin.twin.snapshot import RopeShot, Vector


class RopeShape(NamedTuple):
    """Shape of one rope; rows run from its upper end (row 0) down, as in a RopeShot."""

    name: str
    line: RopeLine
    core: Rope
    position_m: Vector  # (nodes, 3)
    arc_m: Vector  # unstretched, 0 at the upper end, (nodes,)
    element_tension_n: Vector  # (nodes - 1,)
    loose: bool = False  # its upper end is free: the part below a cut


def shape_from_top(line: RopeLine, core: Rope, shot: RopeShot, *, loose: bool = False) -> RopeShape:
    """Return the shape of a rope whose last node in the core is its upper end."""
    place, tension = shot.node_position_m, shot.element_tension_n
    s = core.state.s[: len(place)]
    return RopeShape(shot.name, line, core, place, (s[-1] - s)[::-1].copy(), tension, loose)


def shape_from_sheave(line: RopeLine, core: Rope, shot: RopeShot) -> RopeShape:
    """Return the shape of a rope that ends at a sheave, where its elements come and go."""
    arc = core.state.s[: len(shot.node_position_m)] - core.state.s[0]
    arc[-1] = shot.line_out_m
    return RopeShape(shot.name, line, core, shot.node_position_m, arc, shot.element_tension_n)


def midpoints(arc_m: Vector) -> Vector:
    """Return midpoints of the elements between nodes at these arc lengths [m], (nodes - 1,)."""
    return np.asarray(0.5 * (arc_m[1:] + arc_m[:-1]))
