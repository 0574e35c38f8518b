"""Close-up view of the rope's lower end, to scale: payload, slings and bridles.

The camera follows the lower end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.messages.encoder import PAYLOAD
from rope_twin.messages.templates import PAYLOAD_RGB, tension_colours
from rope_twin.view.canvas import SCALE_RGB, WAVE_RGB, Canvas, Points, round_step

_LEAST_M = 5.0  # minimum visible distance above, below and to the sides
_NEAR_M = 80.0  # ropes that end farther away are not part of this view
_MARGIN = 1.25
_GROWN = 1.2  # the camera moves when the extent has grown by this factor


@dataclass(frozen=True)
class Sight:
    """Visible region around the lower end [m]."""

    below: float = _LEAST_M
    beside: float = _LEAST_M
    aside: tuple[float, float] = (1.0, 0.0)  # unit vector (east, north) that points right

    @property
    def above(self) -> float:
        """Return the visible length of rope above the lower end."""
        return max(_LEAST_M, 0.6 * max(self.below, self.beside))

    @property
    def half(self) -> float:
        """Return half of the visible height."""
        return _MARGIN * max(0.5 * (self.below + self.above), self.beside)

    @property
    def middle(self) -> float:
        """Return the height of the middle of the picture above the lower end."""
        return 0.5 * (self.above - self.below)

    def spot(self, right: float, up: float) -> list[float]:
        """Return a point in the plane of the picture, relative to its middle."""
        return [self.aside[0] * right, self.aside[1] * right, self.middle + up]

    def eye(self) -> tuple[list[float], list[float]]:
        """Return camera position and target, for rerun's field of view of 55 degrees."""
        target = np.array([0.0, 0.0, self.middle])
        normal = np.array([self.aside[1], -self.aside[0], 0.0])
        distance = self.half / math.tan(math.radians(27.5))
        return (target + distance * normal + [0.0, 0.0, 0.12 * distance]).tolist(), target.tolist()


def depth_in_words(depth_m: float) -> str:
    """Return the depth of the lower end in words, or its height above the water."""
    if depth_m >= 0.0:
        return f"{depth_m:.1f} m depth"
    return f"{-depth_m:.1f} m above the water"


class LowerEnd:
    """Draws the lower end below `path`; `sight` changes when the camera moves, None at first."""

    def __init__(self, stream: Any, path: str) -> None:
        self._canvas = Canvas(stream, path)
        self._focus = np.zeros(3)
        self.payloads: dict[str, Points] = {}  # positions by name; empty: one at the rope's end
        self._body_name = ""  # of the 6-DOF payload
        self._outline_m: Points | None = None  # its side lengths
        self._pose: tuple[Points, list[float]] | None = None  # its centre and attitude
        self._slings = np.zeros((0, 3)), np.zeros(0)  # attachment points and tensions
        self._scale_n = 0.0
        self._falls = 0  # > 0: the body falls with the part below a cut, which was just drawn
        self._at_water = False  # whether the sea surface is visible
        self.sight: Sight | None = None

    def take_body(self, name: str, outline_m: Points) -> None:
        """Set name and side lengths of a 6-DOF payload."""
        self._body_name, self._outline_m = name, outline_m

    def take_slings(self, ends_m: Points, tension_n: Points) -> None:
        """Set attachment points (n, 3) and tensions of the slings of a 6-DOF payload."""
        self._slings = ends_m, tension_n

    def take_poses(self, poses: dict[str, tuple[Points, list[float]]]) -> None:
        """Set position and attitude (x, y, z, w) of each payload, by name."""
        self._pose = poses.get(self._body_name, next(iter(poses.values()), None))
        named = [*poses] != [PAYLOAD]  # otherwise the only one, at the rope's end
        self.payloads = {name: place for name, (place, _) in poses.items()} if named else {}

    def show_rope(self, position_m: Points, elements_n: Points, scale_n: float) -> bool:
        """Draw the first rope, nodes (n, 3) from the top down; return if the camera has to move."""
        self._scale_n, self._falls = scale_n, max(0, self._falls - 1)
        if not self._falls:
            self._focus = position_m[-1].copy()
        first = self.sight is None
        if first:
            self._take(Sight())
        self._draw("rope", position_m, elements_n, scale_n)
        if self._falls:  # the payload is drawn with the rope that carries it
            return first
        return self._draw_payloads() or first

    def show_further(
        self, number: int, position_m: Points, elements_n: Points, scale_n: float
    ) -> bool:
        """Draw another rope if it comes near; return whether the camera has to move.

        With a 6-DOF payload the only other rope is the part below a cut; the camera follows it.
        """
        moved = False
        if self._outline_m is not None and self.sight is not None:
            self._focus, self._falls = position_m[-1].copy(), 2
            moved = self._draw_payloads()
        offset = position_m - self._focus
        near = np.sqrt((offset**2).sum(axis=1)) < _NEAR_M
        if self.sight is None or not near.any():
            return False
        if near.all():  # otherwise it is not a sling, but leads elsewhere
            moved |= self._widen(offset)
        self._draw(f"rope/{number}", position_m, elements_n, scale_n)
        return moved

    def show_bars(self, ends_m: Points) -> None:
        """Draw the struts of a multi-line system, ends (n, 2, 3)."""
        ends, _ = _cut(ends_m - self._focus, self._bounds)
        self._canvas.lines("bars", ends, PAYLOAD_RGB, 3.0)

    @property
    def _bounds(self) -> float:
        """Return the distance from the lower end up to which lines are drawn."""
        return 2.0 * (self.sight or Sight()).half

    def _widen(self, offset: Points) -> bool:
        """Widen the view to include points (n, 3) relative to the lower end; return if it moved."""
        assert self.sight is not None
        side = np.sqrt((offset[:, :2] ** 2).sum(axis=1))
        farthest, below = int(side.argmax()), float(-offset[:, 2].min())
        lateral = float(side[farthest])
        if below <= _GROWN * self.sight.below and lateral <= _GROWN * self.sight.beside:
            return False
        direction = self.sight.aside
        if lateral > self.sight.beside or lateral > 0.2 * below:
            east, north = (float(part) / max(lateral, 1e-9) for part in offset[farthest, :2])
            direction = (east, north) if east >= 0.0 else (-east, -north)
        self._take(Sight(max(below, self.sight.below), max(lateral, self.sight.beside), direction))
        return True

    def _take(self, sight: Sight) -> None:
        """Set the visible region, and draw its scale bar."""
        self.sight = sight
        bar_m = round_step(0.5 * sight.half, most=1) / 2.0
        low, bar_begin, tick = 0.8 * sight.half, -0.55 * sight.half, 0.03 * sight.half
        ends = (bar_begin, bar_begin + bar_m)
        lines = [[sight.spot(x, low) for x in ends]]
        lines += [[sight.spot(x, low - tick), sight.spot(x, low + tick)] for x in ends]
        self._canvas.lines("scale", lines, SCALE_RGB)
        words_at = sight.spot(bar_begin + 0.5 * bar_m, low)
        self._canvas.labels("scale/words", [words_at], [f"{bar_m:g} m"])

    def _draw(self, name: str, position_m: Points, elements_n: Points, scale_n: float) -> None:
        """Draw the visible elements, relative to the lower end."""
        nodes = position_m - self._focus
        ends, shown = _cut(np.stack([nodes[:-1], nodes[1:]], axis=1), self._bounds)
        self._canvas.lines(name, ends, tension_colours(elements_n[shown], scale_n), 3.0)

    def _draw_payloads(self) -> bool:
        """Draw payload, depth label and water; return whether the camera has to move."""
        assert self.sight is not None
        middle, offset = self._focus, 0.4 * self.sight.half
        if self._outline_m is not None and self._pose is not None:
            middle = self._pose[0]
            offset = max(
                offset, 0.5 * float(np.hypot(*self._outline_m[:2])) + 0.2 * self.sight.half
            )
        position = self.sight.spot(offset, 0.0)
        position[2] = float(middle[2] - self._focus[2])
        self._canvas.labels("depth", [position], [depth_in_words(-float(middle[2]))])
        self._draw_water(self.sight)
        if self._outline_m is not None and self._pose is not None:
            return self._draw_body(self._outline_m, *self._pose)
        known = self.payloads or {"": self._focus}
        every = {name: place - self._focus for name, place in known.items()}
        inside = {
            name: position
            for name, position in every.items()
            if np.abs(position).max() < self._bounds
        }
        half = self.sight.half / 16.0
        centres = [position - [0.0, 0.0, half] for position in inside.values()]
        self._canvas.payloads(centres, half, list(inside), named=bool(self.payloads))
        return False

    def _draw_water(self, sight: Sight) -> None:
        """Draw the mean water level where it is visible."""
        height = -float(self._focus[2]) - sight.middle
        before, self._at_water = self._at_water, abs(height) < sight.half
        if before or self._at_water:
            level = [[sight.spot(side * sight.half, height) for side in (-1.0, 1.0)]]
            self._canvas.lines("water", level[: self._at_water], WAVE_RGB)

    def _draw_body(self, sides: Points, place: Points, quaternion: list[float]) -> bool:
        """Draw a 6-DOF payload in true size and attitude; return whether the camera has to move."""
        import rerun as rr

        center = place - self._focus
        self._canvas.log(
            "payload",
            rr.Boxes3D(
                centers=[center], half_sizes=[0.5 * sides],
                quaternions=[rr.Quaternion(xyzw=quaternion)],
                colors=PAYLOAD_RGB, fill_mode="solid",
            ),
        )  # fmt: skip
        ends, pulls = self._slings
        strips = [[[0.0, 0.0, 0.0], (end - self._focus).tolist()] for end in ends]
        self._canvas.lines("slings", strips, tension_colours(pulls, self._scale_n), 2.0)
        reach = 0.5 * float(np.sqrt(sides @ sides))
        return self._widen(np.array([center - reach, center + reach]))


def _cut(ends: Points, bounds: float) -> tuple[Points, NDArray[np.intp]]:
    """Return the elements (n, 2, 3) with an end in a sphere, clipped to it, and their indices.

    An element may be longer than the visible region: only the part inside is drawn.
    """
    from_middle = np.sqrt((ends**2).sum(axis=2))
    shown = np.flatnonzero(from_middle.min(axis=1) < bounds)
    pieces = ends[shown].copy()
    for side, opposite in ((0, 1), (1, 0)):
        outside = from_middle[shown, side] > bounds
        inner, outer = pieces[outside, opposite], pieces[outside, side]
        segment = outer - inner
        # |inner + share·along| = bounds
        a, b = (segment**2).sum(axis=1), (inner * segment).sum(axis=1)
        c = (inner**2).sum(axis=1) - bounds**2
        share = (np.sqrt(np.maximum(b * b - a * c, 0.0)) - b) / a
        pieces[outside, side] = inner + share[:, None] * segment
    return pieces, shown
