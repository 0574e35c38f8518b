"""Smallest bend radius of each rope, and where along the rope it occurs.

At a node between elements of unit directions t and unstretched mean length l the curvature is
|t' - t|/l = 2·sin(turn/2)/l, as of the discrete rod (Bergou et al. 2008, section 4.2, for small
turns); for equal elements along a circle it is exactly 1/R. Where the hang-off holds the rope's
direction, the turn to it counts over half the top element, as in `effects/bending.py`.

The mesh limits the result: a rope folded back on itself has a curvature of 2/l, so no radius below
l/2 is ever reported, and an arc shorter than an element is not resolved. A slack rope without
bending stiffness bends as sharply as its elements allow: its radius is then that of the mesh.
"""

from __future__ import annotations

import math

import numpy as np

from rope_twin.core import state as rows
from rope_twin.effects.bending import Bending, BendingParams
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.twin.snapshot import Bend, RopeBend, Vector
from rope_twin.twin.snapshot_builder import RopeShape
from rope_twin.vortex.line_model import bending_stiffness

_STORED = ("radius_m", "line_out_m", "at_s", "minimum_m", "element_m")  # fields of a Bend


def curvatures(position: Vector, arc: Vector, held: Vector | None = None) -> Vector:
    """Curvature at the nodes [1/m], (n,).

    position: nodes (n, 3) [m]; arc: their unstretched arc length [m], (n,); held: unit vector of
    the direction in which the rope is clamped at the first node; None: a free end.
    """
    chord, rest = np.diff(position, axis=0), np.diff(arc)
    size = np.sqrt((chord * chord).sum(axis=1))[:, None]
    along = np.divide(chord, size, out=np.zeros_like(chord), where=size > 0.0)
    found = np.zeros(len(position))
    turn = np.diff(along, axis=0)
    found[1:-1] = 2.0 * np.sqrt((turn * turn).sum(axis=1)) / (rest[1:] + rest[:-1])
    if held is not None:
        found[0] = 2.0 * float(np.linalg.norm(along[0] - held)) / rest[0]
    return found


def minimum_radii(hung: RopeShape) -> Vector:
    """Minimum bend radius at the nodes [m], (n,); 0: none is given; the larger at section ends."""
    given = np.array([own.rope.minimum_bend_radius_m or 0.0 for own in hung.line.made_of])
    if len(given) == 1:
        return np.full(len(hung.arc_m), given[0])
    ends = hung.core.sections[rows.END, : len(given)]
    s, last = hung.arc_m[-1] - hung.arc_m, len(given) - 1
    below, above = (
        given[np.minimum(np.searchsorted(ends, s, side=side), last)] for side in ("left", "right")
    )
    return np.asarray(np.maximum(below, above))


class BendMonitor:
    """Monitor of the smallest bend radius of each rope with bending stiffness or a minimum radius.

    It samples at each snapshot and keeps the smallest radius of all snapshots.
    """

    def __init__(self, scene: Scene) -> None:
        """Reserve a row for each rope of the scene, and for the lower part of a cut rope."""
        self._tightest = np.zeros((len(scene.ropes) + 1, len(_STORED)))
        self._tightest[:, 0] = math.inf

    def look(self, ropes: tuple[RopeShape, ...], time_s: float) -> tuple[RopeBend, ...]:
        """Return the bend of each monitored rope now; time_s: twin time [s]."""
        return tuple(
            self._judge(number, hung, time_s)
            for number, hung in enumerate(ropes)
            if limits_bends(hung.line) or bending_stiffness(hung.core.effects) > 0.0
        )

    def _judge(self, number: int, hung: RopeShape, time_s: float) -> RopeBend:
        now, position = smallest_radius(hung, time_s)
        known = Bend(hung.name, *self._tightest[number].tolist())
        if now.tightness > known.tightness:
            known = now
            self._tightest[number] = [getattr(now, name) for name in _STORED]
        return RopeBend(now, position, known)


def smallest_radius(hung: RopeShape, time_s: float) -> tuple[Bend, tuple[float, float, float]]:
    """Return the bend closest to its minimum radius, or furthest below it, and its position [m].

    For a rope without a minimum bend radius it is the smallest radius; if only some sections have a
    minimum radius, only these count.
    """
    bend, least = curvatures(hung.position_m, hung.arc_m, _held(hung)), minimum_radii(hung)
    at = int(np.argmax(bend * least if least.any() else bend))
    rest = np.diff(hung.arc_m)[max(at - 1, 0) : at + 1]
    x, y, z = (float(part) for part in hung.position_m[at])
    found = Bend(
        name=hung.name,
        radius_m=1.0 / float(bend[at]) if bend[at] > 0.0 else math.inf,
        line_out_m=float(hung.arc_m[at]),
        at_s=time_s,
        minimum_m=float(least[at]),
        element_m=float(rest.mean()),
    )
    return found, (x, y, z)


def watches_bends(scene: Scene) -> bool:
    """Return whether any rope of the scene is monitored for bends."""
    stiff = scene.listed(BendingParams) or any(line.bending for line in scene.ropes)
    return bool(stiff) or any(limits_bends(line) for line in scene.ropes)


def limits_bends(line: RopeLine) -> bool:
    """Return whether a section of the rope has a minimum bend radius."""
    return any(own.rope.minimum_bend_radius_m is not None for own in line.made_of)


def _held(hung: RopeShape) -> Vector | None:
    """Return the direction in which the rope's upper end is clamped, downward; None if free."""
    for own in hung.core.effects:
        if isinstance(own, Bending) and own.clamp > 0.0 and not hung.loose:
            return -np.array([own.x, own.y, own.z])
    return None
