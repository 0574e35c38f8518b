"""Whether a picture can be drawn (it needs matplotlib), and writing one that was."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import TYPE_CHECKING

from rope_twin.errors import InputError, phrase

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FEW_DECADES = 200.0  # an axis whose end is less than 200 times its start is marked at 1, 2 and 5


def check_picture(path: Path) -> None:
    """See, before anything is computed, that a picture can be drawn there.

    Raises:
        InputError: matplotlib is not installed, the ending is not one of a picture, or nothing can
            be written there.
    """
    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        what = f"'{path.suffix}' is no picture that can be drawn"
        raise InputError(phrase(str(path), what, "end it in .png, .svg or .pdf"))
    place = next(folder for folder in path.absolute().parents if folder.exists())
    if path.is_dir() or not place.is_dir() or not os.access(place, os.W_OK):
        right = "give a place that can be written"
        raise InputError(phrase(str(path), "it cannot be written", right))
    if importlib.util.find_spec("matplotlib") is None:
        right = "install it with `pip install 'rope_twin[plot]'`"
        raise InputError(phrase("matplotlib", "a plot needs it and it is not there", right))


def write_picture(figure: Figure, path: Path, dpi: float) -> None:
    """Write a figure, with its folder; a PNG without matplotlib's version, so that it repeats.

    Raises:
        InputError: it cannot be written there.
    """
    metadata = {"Software": None} if path.suffix == ".png" else None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=dpi, metadata=metadata)
    except OSError as error:
        right = "give a place that can be written"
        raise InputError(phrase(str(path), str(error.strerror), right)) from error


def mark_decades(axes: Axes) -> None:
    """Plain figures on both logarithmic axes, between decades too where those are few."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        few = high < FEW_DECADES * low
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
