"""Line profile in 3-D, seen from the side; hang-off at the sea surface and lower end in close-up.

Three kilometres of rope with a lateral offset of a few tens of metres would look like a needle:
horizontal distances are enlarged by a round factor, which the view's title and a scale bar show.
The close-ups are to scale; that of the lower end has payload, slings and bridles, and its camera
follows it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.messages.encoder import PAYLOAD
from rope_twin.messages.templates import HANG_OFF_RGB, PAYLOAD_RGB, tension_colours
from rope_twin.view.charts import (
    HAIR,
    SCALE_RGB,
    WAVE_RGB,
    Canvas,
    Points,
    depth_words,
    depths_over,
    round_step,
)

_FACTORS = (50, 20, 10, 5, 2, 1)
_WIDE = 0.25  # maximum drawn width of the rope, as a fraction of its height ...
_TOO_WIDE = 0.6  # ... and the width beyond which the factor is reduced
_GONE = 0.3  # drawn distance from the middle at which a moving hang-off is centred again
# as fractions of the scale: space for a name and for the depth scale, and visible half width
_NAME, _SCALE, _SEEN = 0.1, 0.3, 0.9
_SEA = (70, 130, 200)
_SPOT = (255, 255, 255)
ROPE_WIDTH = 2.5  # of a rope [points of the user interface]
# For a hang-off at the water [m]; above it all but SCALE is multiplied by `SurfaceView.size`.
PATCH = 7.0  # half the side of the drawn sea surface
SCALE = 6.0  # extent of the height scale below the water and above the hang-off
EYE, TARGET = (-4.0, -19.0, 6.5), (-1.0, 0.0, -0.6)  # camera, relative to the middle of the view
_BESIDE = np.array([2.2, 0.0, 0.4])
SHOWN_M = 60.0  # length of rope that is drawn
_SURFACE = (52, 118, 190)


@dataclass(frozen=True)
class Frame:
    """Scale and orientation of the picture."""

    factor: int  # enlargement of horizontal distances
    depth_m: float  # of the lowest node
    across: tuple[float, float]  # unit vector (east, north) that points right in the picture
    wide: float = 0.0  # drawn extent of the rope to the right
    above_m: float = 0.0  # height of the highest node above the water
    at_m: tuple[float, float] = (0.0, 0.0)  # east, north of the hang-off: middle of the picture

    @property
    def depths_m(self) -> Points:
        """Return the ticks of the depth scale, from the top down; negative above the water."""
        return depths_over(self.above_m, 0.999 * self.depth_m)

    @property
    def high_m(self) -> float:
        """Return the length of the depth scale [m]."""
        depths = self.depths_m
        return float(depths[-1] - depths[0])

    def gone_m(self, position_m: Points) -> float:
        """Return the horizontal distance of a rope's hang-off from the middle; nodes (n, 3)."""
        return float(np.hypot(*(position_m[0, :2] - self.at_m)))

    def place(self, position_m: Points) -> Points:
        """Return positions (n, 3) as drawn."""
        from_hang_off = position_m - np.array([*self.at_m, 0.0])
        return np.asarray(from_hang_off * np.array([self.factor, self.factor, 1.0]))

    def spot(self, right: float, height_m: float) -> list[float]:
        """Return a point in the plane of the picture; `right` as drawn."""
        return [self.across[0] * right, self.across[1] * right, height_m]


def frame_for(position_m: Points, gone_m: float = 0.0) -> Frame:
    """Return the frame for a rope (n, 3) whose hang-off has moved by `gone_m` horizontally."""
    depth, above = _reach(position_m)
    high, hang_off = depth + above, (float(position_m[0, 0]), float(position_m[0, 1]))
    drift = position_m[:, :2] - position_m[0, :2]
    distance = np.hypot(drift[:, 0], drift[:, 1])
    farthest = int(distance.argmax())
    width = float(distance[farthest])
    factor = next((f for f in _FACTORS if f * max(width, gone_m) <= _WIDE * high), 1)
    straight = width < 1e-4 * high
    if straight:  # any direction will do: look north
        return Frame(factor, depth, (1.0, 0.0), above_m=above, at_m=hang_off)
    direction = (float(drift[farthest, 0] / width), float(drift[farthest, 1] / width))
    return Frame(factor, depth, direction, factor * width, above, hang_off)


def _reach(position_m: Points) -> tuple[float, float]:
    """Return the depth of the lowest node (at least 1 m) and the height of the highest [m]."""
    heights = position_m[:, 2]
    return max(float(-heights.min()), 1.0), max(float(heights.max()), 0.0)


class Overview:
    """Draws the rope below `path`; `frame` is replaced when the camera has to move."""

    def __init__(self, stream: Any, path: str) -> None:
        self._canvas = Canvas(stream, path)
        self.frame: Frame | None = None
        self.payloads: dict[str, Points] = {}  # positions; empty: at the rope's end
        self._further: dict[int, Points] = {}  # nodes of all ropes but the first

    def show(self, position_m: Points, elements_n: Points, scale_n: float) -> bool:
        """Draw the rope, nodes (n, 3); return whether the camera has to move (a new frame)."""
        every = np.concatenate([position_m, *self._further.values()])
        moved = self.frame is None or has_left(self.frame, every)
        if moved:
            gone_m = 0.0 if self.frame is None else self.frame.gone_m(position_m)
            self.frame = frame_for(every, gone_m)
            self._draw_scales(self.frame)
        assert self.frame is not None
        drawn = self.frame.place(position_m)
        self._canvas.rope("rope", drawn, elements_n, scale_n, ROPE_WIDTH)
        places = self.payloads or {"payload": position_m[-1]}
        half = (self.frame.depth_m + self.frame.above_m) / 70.0
        centres = self.frame.place(np.array(list(places.values()))) - [0.0, 0.0, half]
        self._canvas.payloads(centres, half, list(places), named=True)
        self._canvas.points("hang_off", drawn[:1], HANG_OFF_RGB, 5.0)
        return moved

    def show_further(
        self, number: int, position_m: Points, elements_n: Points, scale_n: float
    ) -> None:
        """Draw another rope of a multi-line system, nodes (n, 3)."""
        if self.frame is None:
            return
        self._further[number] = position_m
        drawn = self.frame.place(position_m)
        self._canvas.rope(f"rope/{number}", drawn, elements_n, scale_n, ROPE_WIDTH)

    def show_spots(self, name: str, position_m: Points, labels: list[str]) -> None:
        """Mark positions (n, 3) with a label each: crossings of lines, touchdown points."""
        if self.frame is not None:
            self._canvas.points(name, self.frame.place(position_m), _SPOT, 4.0, words=labels)

    def _draw_scales(self, frame: Frame) -> None:
        """Draw the depth scale left of the rope, the sea, and a bar of the horizontal scale."""
        depths, high = frame.depths_m, frame.high_m
        axis_x, tick = -0.11 * high, 0.012 * high
        lines = [[frame.spot(axis_x, -depths[0]), frame.spot(axis_x, -depths[-1])]]
        lines += [[frame.spot(axis_x - tick, -d), frame.spot(axis_x, -d)] for d in depths]
        bar_m = round_step(0.2 * high / frame.factor, most=1) / 2.0
        low = -depths[-1] - 0.08 * high
        end = frame.factor * bar_m
        lines += [[frame.spot(0.0, low), frame.spot(end, low)]]
        lines += [[frame.spot(x, low - tick), frame.spot(x, low + tick)] for x in (0.0, end)]
        self._canvas.lines("scale", lines, SCALE_RGB)
        places = [frame.spot(axis_x - 0.09 * high, 0.018 * high - d) for d in depths]
        labels = [f"{depth_words(depth)} m" for depth in depths]
        places.append(frame.spot(0.5 * end, low))
        labels.append(f"{bar_m:g} m horizontal")
        self._canvas.labels("scale/words", places, labels)
        self._draw_sea(0.085 * high)

    def _draw_sea(self, half: float) -> None:
        corners = [(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)]
        border = [[x, y, 0.0] for x, y in corners]
        self._canvas.lines("sea", [border, *_grid(half, 0.0)], _SEA, HAIR)


def _grid(half: float, height: float) -> list[list[list[float]]]:
    """Return the lines of a square grid of this half side at a height."""
    steps = np.linspace(-half, half, 7)
    lines = [[[x, -half, height], [x, half, height]] for x in steps]
    return lines + [[[-half, y, height], [half, y, height]] for y in steps]


def has_left(frame: Frame, position_m: Points) -> bool:
    """Return whether the rope exceeds the picture, has become small in it or has moved away."""
    depth, above = _reach(position_m)
    high, drawn = depth + above, frame.depth_m + frame.above_m
    drift = position_m[:, :2] - frame.at_m
    width = frame.factor * float(np.hypot(drift[:, 0], drift[:, 1]).max())
    beyond = max(depth - frame.depth_m, above - frame.above_m)
    resized = beyond > 0.15 * drawn or high < 0.5 * drawn
    moved_away = frame.factor * frame.gone_m(position_m) > _GONE * drawn
    return resized or moved_away or (frame.factor > 1 and width > _TOO_WIDE * max(high, drawn))


def eye(frame: Frame) -> tuple[list[float], list[float]]:
    """Return camera position and target, for rerun's field of view of 55 degrees.

    The window is tall; the end of a rope with a large lateral offset, its label and the depth scale
    are visible.
    """
    high, top = frame.high_m, -float(frame.depths_m[0])
    right_e, right_n = frame.across
    right = frame.wide / high + _NAME
    middle = max(0.04, 0.5 * (right - _SCALE))
    farther = max(1.0, (right + _SCALE) / _SEEN)
    target = np.array(frame.spot(middle * high, top - 0.53 * high))
    back = np.array([right_n, -right_e, 0.0])  # a quarter turn: the drift points to the right
    away = farther * 1.45 * high / (2.0 * math.tan(math.radians(27.5)))
    position = target + away * back + np.array([0.0, 0.0, 0.10 * high])
    return position.tolist(), target.tolist()


@dataclass(frozen=True)
class SurfaceView:
    """Visible region, which includes hang-off and water."""

    above_m: float = 0.0  # height of the hang-off above mean water level

    @property
    def size(self) -> float:
        """Return the scale factor relative to a hang-off at the water."""
        return 1.0 + 0.5 * self.above_m / SCALE

    def eye(self) -> tuple[list[float], list[float]]:
        """Return camera position and target, relative to the water below the hang-off."""
        middle = np.array([0.0, 0.0, 0.5 * self.above_m])
        place, target = middle + self.size * np.array(EYE), middle + self.size * np.array(TARGET)
        return place.tolist(), target.tolist()


class Surface:
    """Draws the upper rope, the hang-off, the sea surface and a height scale below `path`."""

    def __init__(self, stream: Any, path: str) -> None:
        self._canvas = Canvas(stream, path)
        self._at: Points | None = None
        self.sight = SurfaceView()

    def show_rope(self, position_m: Points, elements_n: Points, scale_n: float) -> bool:
        """Draw the upper end of the rope, nodes (n, 3) from the top; return if the view is new."""
        import rerun as rr

        first = self._at is None
        below = position_m[0] * [1.0, 1.0, 0.0]
        if self._at is None:
            self._at = below
            self.sight = SurfaceView(max(float(position_m[0, 2]), 0.0))
            self._draw_scale()
        if np.linalg.norm(below - self._at) > PATCH * self.sight.size:
            self._at = below  # the drawn sea surface follows a ship under way
        self._draw_upper_end("rope", position_m - self._at, elements_n, scale_n)
        top, size = position_m[:1] - self._at, self.sight.size
        ball = rr.Points3D(top, radii=0.5 * size, colors=HANG_OFF_RGB)
        self._canvas.log("hang_off", ball)
        self._canvas.labels("hang_off/words", top + size * _BESIDE, ["hang-off"])
        return first

    def show_further(
        self, number: int, position_m: Points, elements_n: Points, scale_n: float
    ) -> None:
        """Draw the upper end of another rope if it is near the surface."""
        if self._at is None or position_m[0, 2] < -SHOWN_M:
            return
        self._draw_upper_end(f"rope/{number}", position_m - self._at, elements_n, scale_n)

    def _draw_upper_end(
        self, name: str, nodes_m: Points, elements_n: Points, scale_n: float
    ) -> None:
        """Draw the visible part of a rope, its elements in the colours of their tension."""
        count = int(np.searchsorted(nodes_m[0, 2] - nodes_m[:, 2], SHOWN_M)) + 1
        nodes = nodes_m[: max(count, 2)]
        self._canvas.rope(name, nodes, elements_n[: len(nodes) - 1], scale_n)

    def show_sea(self, elevation_m: float) -> None:
        """Draw the sea surface at the ship."""
        import rerun as rr

        half = PATCH * self.sight.size
        corners = [[x, y, elevation_m] for x in (-half, half) for y in (-half, half)]
        self._canvas.log(
            "sea",
            rr.Mesh3D(vertex_positions=corners, triangle_indices=[[0, 2, 3], [0, 3, 1]],
                      albedo_factor=[*_SURFACE, 90]),
        )  # fmt: skip
        self._canvas.lines("sea/grid", _grid(half, elevation_m), WAVE_RGB, HAIR)

    def _draw_scale(self) -> None:
        """Draw the scale of height above mean water level, to the left of the rope."""
        size = self.sight.size
        heights = -depths_over(self.sight.above_m + SCALE, SCALE)
        x = (-PATCH - 2.0) * size
        lines = [[[x, 0.0, heights[-1]], [x, 0.0, heights[0]]]]
        lines += [[[x - 0.3 * size, 0.0, z], [x, 0.0, z]] for z in heights]
        self._canvas.lines("scale", lines, SCALE_RGB, static=True)
        places = [[x - 2.0 * size, 0.0, z + 0.35 * size] for z in heights]
        labels = [f"{z:+g} m" if z else "0 m" for z in heights]
        self._canvas.labels("scale/words", places, labels, static=True)


_MIN_M = 5.0  # minimum visible distance above, below and to the sides
_NEAR_M = 80.0  # ropes that end farther away are not part of this view
_MARGIN = 1.25
_GROWN = 1.2  # the camera moves when the extent has grown by this factor


@dataclass(frozen=True)
class LowerEndView:
    """Visible region around the lower end [m]."""

    below: float = _MIN_M
    beside: float = _MIN_M
    across: tuple[float, float] = (1.0, 0.0)  # unit vector (east, north) that points right

    @property
    def above(self) -> float:
        """Return the visible length of rope above the lower end."""
        return max(_MIN_M, 0.6 * max(self.below, self.beside))

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
        return [self.across[0] * right, self.across[1] * right, self.middle + up]

    def eye(self) -> tuple[list[float], list[float]]:
        """Return camera position and target, for rerun's field of view of 55 degrees."""
        target = np.array([0.0, 0.0, self.middle])
        normal = np.array([self.across[1], -self.across[0], 0.0])
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
        self.sight: LowerEndView | None = None

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
            self._take(LowerEndView())
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
        return 2.0 * (self.sight or LowerEndView()).half

    def _widen(self, offset: Points) -> bool:
        """Widen the view to include points (n, 3) relative to the lower end; return if it moved."""
        assert self.sight is not None
        side = np.sqrt((offset[:, :2] ** 2).sum(axis=1))
        farthest, below = int(side.argmax()), float(-offset[:, 2].min())
        lateral = float(side[farthest])
        if below <= _GROWN * self.sight.below and lateral <= _GROWN * self.sight.beside:
            return False
        direction = self.sight.across
        if lateral > self.sight.beside or lateral > 0.2 * below:
            east, north = (float(part) / max(lateral, 1e-9) for part in offset[farthest, :2])
            direction = (east, north) if east >= 0.0 else (-east, -north)
        self._take(
            LowerEndView(max(below, self.sight.below), max(lateral, self.sight.beside), direction)
        )
        return True

    def _take(self, sight: LowerEndView) -> None:
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

    def _draw_water(self, sight: LowerEndView) -> None:
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
