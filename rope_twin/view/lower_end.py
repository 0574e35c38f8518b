"""The lower end of the rope close by and to scale: the payload, and slings or bridles around it.

The eye goes along with the lower end, so that what is seen is how things hang about it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.messages.colours import tension_colours
from rope_twin.messages.forms import PAYLOAD_RGB
from rope_twin.view.ticks import round_step

_LEAST_M = 5.0  # so much is seen above, below and beside at least
_NEAR_M = 80.0  # what ends farther away belongs to another part of the picture
_ROOM = 1.25
_GROWN = 1.2  # the eye moves when things are so many times farther than they were
_WATER = (120, 175, 230)
_LINES = (130, 132, 140)
_WORDS = (205, 205, 210)

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Sight:
    """What is seen about the lower end [m]."""

    below: float = _LEAST_M
    beside: float = _LEAST_M
    aside: tuple[float, float] = (1.0, 0.0)  # unit vector east, north that points to the right

    @property
    def above(self) -> float:
        """So much rope is seen above the lower end."""
        return max(_LEAST_M, 0.6 * max(self.below, self.beside))

    @property
    def half(self) -> float:
        """Half of what the eye has before it, up and down."""
        return _ROOM * max(0.5 * (self.below + self.above), self.beside)

    @property
    def middle(self) -> float:
        """Height of the picture's middle over the lower end."""
        return 0.5 * (self.above - self.below)

    def spot(self, right: float, up: float) -> list[float]:
        """A place in the plane of the picture, about its middle."""
        return [self.aside[0] * right, self.aside[1] * right, self.middle + up]

    def eye(self) -> tuple[list[float], list[float]]:
        """Where the eye is and where it looks, for rerun's 55 degrees of view."""
        target = np.array([0.0, 0.0, self.middle])
        back = np.array([self.aside[1], -self.aside[0], 0.0])
        away = self.half / math.tan(math.radians(27.5))
        return (target + away * back + [0.0, 0.0, 0.12 * away]).tolist(), target.tolist()


def depth_in_words(depth_m: float) -> str:
    """Where the lower end is; in the air as well."""
    if depth_m >= 0.0:
        return f"{depth_m:.1f} m deep"
    return f"{-depth_m:.1f} m above the water"


class LowerEnd:
    """Draws below `path`; `sight` is another when the eye has to move, None before the first."""

    def __init__(self, stream: Any, path: str) -> None:
        self._stream = stream
        self._path = path
        self._focus = np.zeros(3)
        self.payloads: dict[str, Points] = {}  # places by name; none: one at the rope's end
        self._outline_m: Points | None = None  # of a payload that is a rigid body
        self._pose: tuple[Points, list[float]] | None = None  # its middle and attitude
        self._slings = np.zeros((0, 3)), np.zeros(0)  # where they hold it, and their pulls
        self._scale_n = 0.0
        self._falls = 0  # > 0: the body hangs on the part below a cut, which was seen just now
        self._at_water = False  # the water's surface is in sight
        self.sight: Sight | None = None

    def take_rigging(self, names: list[str], position: Points, effort: Points) -> None:
        """The payload is a rigid body: its sides, where slings hold it and how hard they pull."""
        row = {name: number for number, name in enumerate(names)}
        if "size/x" in row:
            self._outline_m = position[[row[f"size/{axis}"] for axis in "xyz"]]
        slings = [name for name in names if f"{name}/x" in row]
        ends = [row[f"{name}/{axis}"] for name in slings for axis in "xyz"]
        self._slings = position[ends].reshape(-1, 3), effort[[row[name] for name in slings]]

    def take_pose(self, place_m: Points, quaternion: list[float]) -> None:
        """Where the payload is, and how it is turned (x, y, z, w)."""
        self._pose = place_m, quaternion

    def show_rope(self, position_m: Points, elements_n: Points, scale_n: float) -> bool:
        """The first rope, nodes (n, 3) from the hang-off down. True if the eye has to move."""
        self._scale_n, self._falls = scale_n, max(0, self._falls - 1)
        if not self._falls:
            self._focus = position_m[-1].copy()
        first = self.sight is None
        if first:
            self._take(Sight())
        self._draw("rope", position_m, elements_n, scale_n)
        if self._falls:  # the payload is drawn with the rope that it hangs on
            return first
        return self._draw_payloads() or first

    def show_further(
        self, number: int, position_m: Points, elements_n: Points, scale_n: float
    ) -> bool:
        """One of further ropes, if it comes near. True if the eye has to move.

        Besides a rigid body the only one is the part below a cut, and the eye falls with it.
        """
        moved = False
        if self._outline_m is not None and self.sight is not None:
            self._focus, self._falls = position_m[-1].copy(), 2
            moved = self._draw_payloads()
        away = position_m - self._focus
        near = np.sqrt((away**2).sum(axis=1)) < _NEAR_M
        if self.sight is None or not near.any():
            return False
        if near.all():  # else it is no sling, but goes on elsewhere
            moved |= self._widen(away)
        self._draw(f"rope/{number}", position_m, elements_n, scale_n)
        return moved

    def place_payloads(self, names: list[str], values: Points) -> None:
        """Where payloads are: names like tool/x, a value for each."""
        rows = np.asarray(values, dtype=np.float64).reshape(-1, 3)
        self.payloads = {
            name.rpartition("/")[0]: row for name, row in zip(names[::3], rows, strict=True)
        }

    def show_bars(self, ends_m: Points) -> None:
        """Bars between ropes that meet, (n, 2, 3)."""
        import rerun as rr

        ends, _ = _cut(ends_m - self._focus, self._bounds)
        width = rr.Radius.ui_points(3.0)
        strips = rr.LineStrips3D(ends, colors=PAYLOAD_RGB, radii=width)
        self._stream.log(f"{self._path}/bars", strips)

    @property
    def _bounds(self) -> float:
        """So far from the lower end things are drawn."""
        return 2.0 * (self.sight or Sight()).half

    def _widen(self, away: Points) -> bool:
        """See that all of this, (n, 3) from the lower end, is in the picture. True if it moved."""
        assert self.sight is not None
        side = np.sqrt((away[:, :2] ** 2).sum(axis=1))
        far, below = int(side.argmax()), float(-away[:, 2].min())
        beside = float(side[far])
        if below <= _GROWN * self.sight.below and beside <= _GROWN * self.sight.beside:
            return False
        aside = self.sight.aside
        if beside > self.sight.beside or beside > 0.2 * below:
            east, north = (float(part) / max(beside, 1e-9) for part in away[far, :2])
            aside = (east, north) if east >= 0.0 else (-east, -north)
        self._take(Sight(max(below, self.sight.below), max(beside, self.sight.beside), aside))
        return True

    def _take(self, sight: Sight) -> None:
        """Look so from now on, with a bar that tells the scale."""
        import rerun as rr

        self.sight = sight
        bar_m = round_step(0.5 * sight.half, most=1) / 2.0
        low, left, tick = 0.8 * sight.half, -0.55 * sight.half, 0.03 * sight.half
        ends = (left, left + bar_m)
        lines = [[sight.spot(x, low) for x in ends]]
        lines += [[sight.spot(x, low - tick), sight.spot(x, low + tick)] for x in ends]
        thin = rr.Radius.ui_points(0.75)
        self._stream.log(f"{self._path}/scale", rr.LineStrips3D(lines, colors=_LINES, radii=thin))
        self._label("scale/words", sight.spot(left + 0.5 * bar_m, low), f"{bar_m:g} m")

    def _draw(self, name: str, position_m: Points, elements_n: Points, scale_n: float) -> None:
        """The elements within sight, about the lower end."""
        import rerun as rr

        nodes = position_m - self._focus
        ends, shown = _cut(np.stack([nodes[:-1], nodes[1:]], axis=1), self._bounds)
        self._stream.log(
            f"{self._path}/{name}",
            rr.LineStrips3D(
                ends,
                colors=tension_colours(elements_n[shown], scale_n),
                radii=rr.Radius.ui_points(3.0),
            ),
        )

    def _draw_payloads(self) -> bool:
        """True if the eye has to move."""
        import rerun as rr

        assert self.sight is not None
        middle, aside = self._focus, 0.4 * self.sight.half
        if self._outline_m is not None and self._pose is not None:
            middle = self._pose[0]
            aside = max(aside, 0.5 * float(np.hypot(*self._outline_m[:2])) + 0.2 * self.sight.half)
        at = self.sight.spot(aside, 0.0)
        words = depth_in_words(-float(middle[2]))
        self._label("depth", [at[0], at[1], float(middle[2] - self._focus[2])], words)
        self._draw_water(self.sight)
        if self._outline_m is not None and self._pose is not None:
            return self._draw_body(self._outline_m, *self._pose)
        known = self.payloads or {"": self._focus}
        every = {name: place - self._focus for name, place in known.items()}
        near = {name: at for name, at in every.items() if np.abs(at).max() < self._bounds}
        half = self.sight.half / 16.0
        self._stream.log(
            f"{self._path}/payload",
            rr.Boxes3D(
                centers=[at - [0.0, 0.0, half] for at in near.values()],
                half_sizes=[[half] * 3] * len(near), colors=PAYLOAD_RGB, fill_mode="solid",
                labels=list(near), show_labels=bool(self.payloads),
            ),
        )  # fmt: skip
        return False

    def _draw_water(self, sight: Sight) -> None:
        """The mean water level, where it is in sight."""
        import rerun as rr

        up = -float(self._focus[2]) - sight.middle
        before, self._at_water = self._at_water, abs(up) < sight.half
        if before or self._at_water:
            level = [[sight.spot(side * sight.half, up) for side in (-1.0, 1.0)]]
            thin = rr.Radius.ui_points(0.75)
            strips = rr.LineStrips3D(level[: self._at_water], colors=_WATER, radii=thin)
            self._stream.log(f"{self._path}/water", strips)

    def _draw_body(self, sides: Points, place: Points, quaternion: list[float]) -> bool:
        """A rigid body as large as it is and turned as it is. True if the eye has to move."""
        import rerun as rr

        center = place - self._focus
        self._stream.log(
            f"{self._path}/payload",
            rr.Boxes3D(
                centers=[center], half_sizes=[0.5 * sides],
                quaternions=[rr.Quaternion(xyzw=quaternion)],
                colors=PAYLOAD_RGB, fill_mode="solid",
            ),
        )  # fmt: skip
        ends, pulls = self._slings
        strips = [[[0.0, 0.0, 0.0], (end - self._focus).tolist()] for end in ends]
        colours = tension_colours(pulls, self._scale_n)
        lines = rr.LineStrips3D(strips, colors=colours, radii=rr.Radius.ui_points(2.0))
        self._stream.log(f"{self._path}/slings", lines)
        reach = 0.5 * float(np.sqrt(sides @ sides))
        return self._widen(np.array([center - reach, center + reach]))

    def _label(self, name: str, place: list[float], words: str) -> None:
        import rerun as rr

        self._stream.log(
            f"{self._path}/{name}",
            rr.Points3D([place], labels=[words], show_labels=True, colors=_WORDS,
                        radii=rr.Radius.ui_points(0.0)),
        )  # fmt: skip


def _cut(ends: Points, bounds: float) -> tuple[Points, NDArray[np.intp]]:
    """Elements (n, 2, 3) that begin or end within a sphere, shortened to it; and which they are.

    An element may be longer than all that is seen: only what is inside is drawn.
    """
    from_middle = np.sqrt((ends**2).sum(axis=2))
    shown = np.flatnonzero(from_middle.min(axis=1) < bounds)
    kept = ends[shown].copy()
    for side, other in ((0, 1), (1, 0)):
        far = from_middle[shown, side] > bounds
        inner, outer = kept[far, other], kept[far, side]
        along = outer - inner
        # |inner + share·along| = bounds
        a, b = (along**2).sum(axis=1), (inner * along).sum(axis=1)
        c = (inner**2).sum(axis=1) - bounds**2
        share = (np.sqrt(np.maximum(b * b - a * c, 0.0)) - b) / a
        kept[far, side] = inner + share[:, None] * along
    return kept, shown
