"""Lines, points, labels and boxes below one path of a rerun recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.messages.templates import PAYLOAD_RGB, tension_colours

GRID_RGB, SCALE_RGB, WAVE_RGB = (66, 68, 76), (130, 132, 140), (120, 175, 230)
WORDS_RGB = (205, 205, 210)
HAIR, THIN = 0.5, 0.75  # widths of lines [points of the user interface]

Points = NDArray[np.float64]


class Canvas:
    """Draws below `path` in the coordinates of a view; flat: in two dimensions.

    Widths and radii are in points of the user interface.
    """

    def __init__(self, stream: Any, path: str, *, flat: bool = False) -> None:
        self._stream, self._path, self._flat = stream, path, flat

    def log(self, name: str, drawn: Any, *, static: bool = False) -> None:
        """Log an archetype of rerun; static: for the whole recording."""
        self._stream.log(f"{self._path}/{name}", drawn, static=static)

    def lines(
        self, name: str, strips: Any, colours: Any, width: float = THIN, *, static: bool = False,
        **options: Any,
    ) -> None:  # fmt: skip
        """Draw strips of points."""
        import rerun as rr

        kind = rr.LineStrips2D if self._flat else rr.LineStrips3D
        drawn = kind(strips, colors=colours, radii=rr.Radius.ui_points(width), **options)
        self.log(name, drawn, static=static)

    def rope(
        self, name: str, nodes: Points, elements_n: Points, scale_n: float, width: float = 3.0,
        **options: Any,
    ) -> None:  # fmt: skip
        """Draw the elements between nodes, (n, 2 or 3), in the colours of their tension [N]."""
        elements = np.stack([nodes[:-1], nodes[1:]], axis=1)
        self.lines(name, elements, tension_colours(elements_n, scale_n), width, **options)

    def points(
        self, name: str, places: Any, colour: Any, radius: float, *,
        words: Sequence[str] | None = None, static: bool = False,
    ) -> None:  # fmt: skip
        """Draw points, with a label each if words are given."""
        import rerun as rr

        kind = rr.Points2D if self._flat else rr.Points3D
        labels: dict[str, Any] = {} if words is None else {"labels": words, "show_labels": True}
        drawn = kind(places, colors=colour, radii=rr.Radius.ui_points(radius), **labels)
        self.log(name, drawn, static=static)

    def labels(self, name: str, places: Any, words: Sequence[str], *, static: bool = False) -> None:
        """Write a label at each place."""
        self.points(name, places, WORDS_RGB, 0.0, words=words, static=static)

    def payloads(self, places: Any, half_m: float, names: Sequence[str], *, named: bool) -> None:
        """Draw payloads as cubes of this half side at their centres; named: with their names."""
        import rerun as rr

        self.log(
            "payload",
            rr.Boxes3D(
                centers=places, half_sizes=[[half_m] * 3] * len(names), colors=PAYLOAD_RGB,
                fill_mode="solid", labels=names, show_labels=named,
            ),
        )  # fmt: skip
