"""Close-up view of hang-off and sea surface, to scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rope_twin.messages.templates import HANG_OFF_RGB
from rope_twin.view.canvas import HAIR, SCALE_RGB, WAVE_RGB, Canvas, Points
from rope_twin.view.ticks import depths_over

# For a hang-off at the water [m]; for one above it all but SCALE is multiplied by `Sight.size`.
PATCH = 7.0  # half the side of the drawn sea surface
SCALE = 6.0  # extent of the height scale below the water and above the hang-off
EYE, TARGET = (-4.0, -19.0, 6.5), (-1.0, 0.0, -0.6)  # camera, relative to the middle of the view
_BESIDE = np.array([2.2, 0.0, 0.4])
SHOWN_M = 60.0  # length of rope that is drawn
_SEA = (52, 118, 190)


@dataclass(frozen=True)
class Sight:
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
        self.sight = Sight()

    def show_rope(self, position_m: Points, elements_n: Points, scale_n: float) -> bool:
        """Draw the upper end of the rope, nodes (n, 3) from the top; return if the view is new."""
        import rerun as rr

        first = self._at is None
        below = position_m[0] * [1.0, 1.0, 0.0]
        if self._at is None:
            self._at = below
            self.sight = Sight(max(float(position_m[0, 2]), 0.0))
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
        side = np.linspace(-half, half, 7)
        lines = [[[x, -half, elevation_m], [x, half, elevation_m]] for x in side]
        lines += [[[-half, y, elevation_m], [half, y, elevation_m]] for y in side]
        corners = [[x, y, elevation_m] for x in (-half, half) for y in (-half, half)]
        self._canvas.log(
            "sea",
            rr.Mesh3D(vertex_positions=corners, triangle_indices=[[0, 2, 3], [0, 3, 1]],
                      albedo_factor=[*_SEA, 90]),
        )  # fmt: skip
        self._canvas.lines("sea/grid", lines, WAVE_RGB, HAIR)

    def _draw_scale(self) -> None:
        """Draw the scale of height above mean water level, to the left of the rope."""
        size = self.sight.size
        heights = -depths_over(self.sight.above_m + SCALE, SCALE)
        x = (-PATCH - 2.0) * size
        lines = [[[x, 0.0, heights[-1]], [x, 0.0, heights[0]]]]
        lines += [[[x - 0.3 * size, 0.0, z], [x, 0.0, z]] for z in heights]
        self._canvas.lines("scale", lines, SCALE_RGB, static=True)
        places = [[x - 2.0 * size, 0.0, z + 0.35 * size] for z in heights]
        words = [f"{z:+g} m" if z else "0 m" for z in heights]
        self._canvas.labels("scale/words", places, words, static=True)
