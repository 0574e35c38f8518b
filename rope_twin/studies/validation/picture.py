"""Panels as one picture (needs matplotlib)."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import Any

from rope_twin.studies.picture import check_picture, mark_decades, write_picture
from rope_twin.studies.validation.case import Panel, Row

MOST_ACROSS = 3


def draw_case(row: Row, path: Path) -> None:
    """Write the picture of what a case found; raises as `draw_panels` does."""
    draw_panels(f"{row.case.id}: {row.case.about}", row.found.panels, path)


def draw_panels(title: str, panels: Sequence[Panel], path: Path) -> None:
    """Write panels under a title as one picture.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    across = 2 if len(panels) == 4 else min(len(panels), MOST_ACROSS)
    down = ceil(len(panels) / across)
    figure = Figure(figsize=(5.0 * across + 0.6, 3.8 * down), layout="constrained")
    axes = figure.subplots(down, across, squeeze=False).ravel()
    for panel, own in zip(panels, axes, strict=False):
        _draw(figure, own, panel)
    for own in axes[len(panels) :]:
        own.set_visible(False)
    figure.suptitle(title, fontsize=10)
    write_picture(figure, path, 90)


def _draw(figure: Any, axes: Any, panel: Panel) -> None:
    if panel.field is not None:
        most = panel.field.most
        least = None if most is None else -most
        image = axes.imshow(
            panel.field.values, origin="lower", aspect="auto", cmap="RdBu_r",
            extent=(*panel.field.x, *panel.field.y), vmin=least, vmax=most,
        )  # fmt: skip
        if panel.field.label:
            figure.colorbar(image, ax=axes, label=panel.field.label)
    for line in panel.lines:
        axes.plot(line.x, line.y, line.style, label=line.label, linewidth=1.2, markersize=4)
    if panel.log:
        axes.set_xscale("log")
        axes.set_yscale("log")
        mark_decades(axes)
    elif panel.lines and all(float(x).is_integer() for line in panel.lines for x in line.x):
        axes.xaxis.get_major_locator().set_params(integer=True)  # modes and the like
    if any(line.label for line in panel.lines):
        axes.legend(fontsize=7)
    if panel.field is None:
        axes.grid(True, linewidth=0.3)
    axes.set_title(panel.title, fontsize=9)
    axes.set_xlabel(panel.x)
    axes.set_ylabel(panel.y)
