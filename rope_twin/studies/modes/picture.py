"""Modes as a plot: motion over the depth of the rope at rest (needs matplotlib)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.studies.modes.modes import Mode, Modes
from rope_twin.studies.picture import check_picture, write_picture

_COLOURS = {"axial": "#d55e00", "in-plane": "#0072b2", "out-of-plane": "#009e73"}


def draw_modes(scene: str, found: Modes, path: Path) -> None:
    """A panel per mode: size of the motion along the rope, signed by its main direction.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    modes = [*found.lowest, *found.axial]
    figure = Figure(figsize=(1.2 * len(modes) + 1.0, 5.0), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(modes), sharey=True))
    span = np.linalg.norm(np.diff(found.place, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(span)])
    for axes, mode in zip(panels, modes, strict=True):
        _draw(axes, mode, along)
    panels[0].set_ylabel("along the rope from the hang-off [m]")
    panels[0].invert_yaxis()
    figure.suptitle(f"{scene}: natural modes about rest")
    write_picture(figure, path, 110)


def _draw(axes: Any, mode: Mode, along: Any) -> None:
    axis = mode.shape[np.abs(mode.shape).max(axis=1).argmax()]
    sign = np.sign(mode.shape @ axis)
    motion = sign * np.linalg.norm(mode.shape, axis=1)
    axes.plot(motion, along, color=_COLOURS[mode.kind], linewidth=1.2)
    axes.axvline(0.0, color="0.7", linewidth=0.6)
    axes.set_title(f"{mode.kind}\n{mode.period_s:.3g} s", fontsize=8)
    axes.set_xlim(-1.1, 1.1)
    axes.set_xticks([])
