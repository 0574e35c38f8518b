"""Modes as a plot: motion over the depth of the rope at rest (needs matplotlib)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.studies.modes.modes import TURNING, UNHELD, Mode, Modes, SystemMode, SystemModes
from rope_twin.studies.picture import check_picture, write_picture

_ROPES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#555555")
_COLOURS = {"axial": "#d55e00", "in-plane": "#0072b2", "out-of-plane": "#009e73",
            TURNING: "#cc79a7"}  # fmt: skip


def draw_modes(scene: str, found: Modes, path: Path) -> None:
    """Draw a panel per mode: amplitude along the rope, signed by its main direction.

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


def draw_system_modes(scene: str, found: SystemModes, path: Path) -> None:
    """Draw a panel per mode: the ropes at rest in side view, and displaced by the mode.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    modes = [*found.lowest, *found.stretching]
    figure = Figure(figsize=(1.5 * len(modes) + 1.0, 5.0), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(modes), sharey=True))
    places = [line.place[:, ::-1].T for line in found.still.lines]
    corners = np.concatenate(places)
    size = float(np.ptp(corners, axis=0).max())
    for axes, mode in zip(panels, modes, strict=True):
        _draw_system(axes, mode, places, size)
    panels[0].set_ylabel("z [m]")
    names = [line.name for line in found.still.lines]
    panels[-1].legend(names, fontsize=6, loc="lower right")
    figure.suptitle(f"{scene}: natural modes about rest (grey), motion drawn large")
    write_picture(figure, path, 110)


def _draw_system(axes: Any, mode: SystemMode, places: list[Floats], size: float) -> None:
    """Draw a system along x or y, whichever shows more of the motion."""
    motion = np.concatenate(mode.shapes)
    side = int((motion[:, :2] ** 2).sum(axis=0).argmax())
    for k, (place, shape) in enumerate(zip(places, mode.shapes, strict=True)):
        moved = place + 0.08 * size * shape
        axes.plot(moved[:, side], moved[:, 2], color=_ROPES[k % len(_ROPES)], linewidth=1.2)
    for place in places:
        axes.plot(place[:, side], place[:, 2], color="0.75", linewidth=0.6, zorder=0)
    at_rest = np.concatenate(places)[:, side]
    middle, reach = 0.5 * (at_rest.min() + at_rest.max()), 0.5 * np.ptp(at_rest) + 0.1 * size
    axes.set_xlim(middle - reach, middle + reach)
    period = f"{mode.period_s:.3g} s" if mode.kind != UNHELD else "no period"
    axes.set_title(f"{mode.kind}\n{period}", fontsize=8)
    axes.set_xlabel("xy"[side] + " [m]", fontsize=7)
    axes.tick_params(labelsize=6)
