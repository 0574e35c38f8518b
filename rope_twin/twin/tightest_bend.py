"""The tightest bend of a rope: where along it the radius of curvature is smallest.

At a node between elements of unit directions t and unstretched mean length l the curvature is
|t' - t|/l = 2·sin(turn/2)/l, the discrete rod's (Bergou et al. 2008, section 4.2, for small turns);
of equal elements along a circle it is exactly 1/R. Where the hang-off holds the rope's direction
the turn to it counts over half the top element, as in `effects/bending.py`.

What a grid can tell: a rope folded back on itself has 2/l, so no radius below l/2 is ever told, and
an arc shorter than an element is not seen. A rope without bending stiffness bends as sharply as its
elements allow wherever it is slack: there the radius is the grid's and not the rope's.
"""

from __future__ import annotations

import math

import numpy as np

from rope_twin.core import state as rows
from rope_twin.effects.bending import Bending, BendingParams
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.twin.fatigue.wear import bending_stiffness
from rope_twin.twin.hung import HungRope
from rope_twin.twin.snapshot import Bend, RopeBend, Vector

_REMEMBERED = ("radius_m", "line_out_m", "at_s", "minimum_m", "element_m")  # of a Bend


def curvatures(position: Vector, arc: Vector, held: Vector | None = None) -> Vector:
    """At the nodes [1/m], (n,), of nodes at position (n, 3) [m] and unstretched arc (n,) [m].

    held: unit vector along the rope that holds it at the first node; a free end has none.
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


def least_radii(hung: HungRope) -> Vector:
    """Minimum bend radius at the nodes [m], (n,); 0 where none is given, at joints the larger."""
    given = np.array([own.rope.minimum_bend_radius_m or 0.0 for own in hung.line.made_of])
    if len(given) == 1:
        return np.full(len(hung.arc_m), given[0])
    ends = hung.core.sections[rows.END, : len(given)]
    s, last = hung.arc_m[-1] - hung.arc_m, len(given) - 1
    below, above = (
        given[np.minimum(np.searchsorted(ends, s, side=side), last)] for side in ("left", "right")
    )
    return np.asarray(np.maximum(below, above))


class BendWatch:
    """The tightest bend of each rope that has bending stiffness or a minimum bend radius.

    It is looked at with each snapshot, and the tightest of all looks is remembered.
    """

    def __init__(self, scene: Scene) -> None:
        """Room for the ropes of the scene, and for the lower part of one that is cut."""
        self._tightest = np.zeros((len(scene.ropes) + 1, len(_REMEMBERED)))
        self._tightest[:, 0] = math.inf

    def look(self, ropes: tuple[HungRope, ...], time_s: float) -> tuple[RopeBend, ...]:
        """What is to be told of the ropes now."""
        return tuple(
            self._judge(number, hung, time_s)
            for number, hung in enumerate(ropes)
            if limits_bends(hung.line) or bending_stiffness(hung.core.effects) > 0.0
        )

    def _judge(self, number: int, hung: HungRope, time_s: float) -> RopeBend:
        now, position = tightest_now(hung, time_s)
        known = Bend(hung.name, *self._tightest[number].tolist())
        if now.tightness > known.tightness:
            known = now
            self._tightest[number] = [getattr(now, name) for name in _REMEMBERED]
        return RopeBend(now, position, known)


def tightest_now(hung: HungRope, time_s: float) -> tuple[Bend, tuple[float, float, float]]:
    """The bend that is tightest beside what the rope may there, and where that is [m].

    Of a rope without a minimum bend radius the one of the smallest radius; of one that has it in
    some of its sections only these count.
    """
    bend, least = curvatures(hung.position_m, hung.arc_m, _held(hung)), least_radii(hung)
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
    """Whether there is anything to look at."""
    stiff = scene.listed(BendingParams) or any(line.bending for line in scene.ropes)
    return bool(stiff) or any(limits_bends(line) for line in scene.ropes)


def limits_bends(line: RopeLine) -> bool:
    """Whether a minimum bend radius is given for some of a rope."""
    return any(own.rope.minimum_bend_radius_m is not None for own in line.made_of)


def _held(hung: HungRope) -> Vector | None:
    """The direction down along the rope in which its upper end is held, if it is."""
    for own in hung.core.effects:
        if isinstance(own, Bending) and own.clamp > 0.0 and not hung.loose:
            return -np.array([own.x, own.y, own.z])
    return None
