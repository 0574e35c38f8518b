"""The hang-off and the sea around it, close by and to scale."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.messages.colours import tension_colours
from rope_twin.messages.forms import HANG_OFF_RGB

PATCH_M = 7.0  # half the side of the patch of sea
SHOWN_M = 60.0  # so much of the rope is drawn here
EYE, TARGET = (-4.0, -19.0, 6.5), (-1.0, 0.0, -0.6)  # relative to the hang-off at rest
_BESIDE = np.array([2.2, 0.0, 0.4])
_SEA = (52, 118, 190)
_WAVE = (120, 175, 230)
_LINES = (130, 132, 140)
_WORDS = (205, 205, 210)


class Surface:
    """Draws below `path`: the upper rope, the hang-off, the sea surface and a scale of height."""

    def __init__(self, stream: Any, path: str) -> None:
        self._stream = stream
        self._path = path
        self._at: NDArray[np.float64] | None = None

    def show_rope(self, position_m: NDArray[np.float64], elements_n: NDArray[np.float64],
                  scale_n: float) -> None:  # fmt: skip
        """The upper end of the rope: nodes (n, 3) from the hang-off down."""
        import rerun as rr

        if self._at is None:
            self._at = position_m[0] * [1.0, 1.0, 0.0]
            self._draw_scale(self._at)
        self._draw_upper_end(f"{self._path}/rope", position_m - self._at, elements_n, scale_n)
        top = position_m[:1] - self._at
        self._stream.log(f"{self._path}/hang_off", rr.Points3D(top, radii=0.5, colors=HANG_OFF_RGB))
        self._stream.log(
            f"{self._path}/hang_off/words",
            rr.Points3D(top + _BESIDE, labels=["hang-off"], show_labels=True,
                        colors=_WORDS, radii=rr.Radius.ui_points(0.0)),
        )  # fmt: skip

    def show_further(self, number: int, position_m: NDArray[np.float64],
                     elements_n: NDArray[np.float64], scale_n: float) -> None:  # fmt: skip
        """The upper end of one of further ropes, if it is near the surface."""
        if self._at is None or position_m[0, 2] < -SHOWN_M:
            return
        path = f"{self._path}/rope/{number}"
        self._draw_upper_end(path, position_m - self._at, elements_n, scale_n)

    def _draw_upper_end(self, path: str, nodes_m: NDArray[np.float64],
                        elements_n: NDArray[np.float64], scale_n: float) -> None:  # fmt: skip
        """As much of a rope as is shown, its elements in the colours of their tension."""
        import rerun as rr

        count = int(np.searchsorted(nodes_m[0, 2] - nodes_m[:, 2], SHOWN_M)) + 1
        nodes = nodes_m[: max(count, 2)]
        self._stream.log(
            path,
            rr.LineStrips3D(
                np.stack([nodes[:-1], nodes[1:]], axis=1),
                colors=tension_colours(elements_n[: len(nodes) - 1], scale_n),
                radii=rr.Radius.ui_points(3.0),
            ),
        )

    def show_sea(self, elevation_m: float) -> None:
        """The water surface at the ship."""
        import rerun as rr

        side = np.linspace(-PATCH_M, PATCH_M, 7)
        lines = [[[x, -PATCH_M, elevation_m], [x, PATCH_M, elevation_m]] for x in side]
        lines += [[[-PATCH_M, y, elevation_m], [PATCH_M, y, elevation_m]] for y in side]
        corners = [[x, y, elevation_m] for x in (-PATCH_M, PATCH_M) for y in (-PATCH_M, PATCH_M)]
        self._stream.log(
            f"{self._path}/sea",
            rr.Mesh3D(vertex_positions=corners, triangle_indices=[[0, 2, 3], [0, 3, 1]],
                      albedo_factor=[*_SEA, 90]),
        )  # fmt: skip
        self._stream.log(
            f"{self._path}/sea/grid",
            rr.LineStrips3D(lines, colors=_WAVE, radii=rr.Radius.ui_points(0.5)),
        )

    def _draw_scale(self, at: NDArray[np.float64]) -> None:
        """Height above mean water level, every 2 m, a little to the left of the rope."""
        import rerun as rr

        heights = np.arange(-6.0, 6.1, 2.0)
        x = -PATCH_M - 2.0
        lines = [[[x, 0.0, -6.0], [x, 0.0, 6.0]]]
        lines += [[[x - 0.3, 0.0, z], [x, 0.0, z]] for z in heights]
        thin = rr.Radius.ui_points(0.75)
        self._stream.log(
            f"{self._path}/scale", rr.LineStrips3D(lines, colors=_LINES, radii=thin), static=True
        )
        self._stream.log(
            f"{self._path}/scale/words",
            rr.Points3D([[x - 2.0, 0.0, z + 0.35] for z in heights],
                        labels=[f"{z:+g} m" if z else "0 m" for z in heights], show_labels=True,
                        colors=_WORDS, radii=rr.Radius.ui_points(0.0)),
            static=True,
        )  # fmt: skip
