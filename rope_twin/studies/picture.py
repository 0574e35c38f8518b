"""Pictures (they need matplotlib): panels as plain data, drawing and writing them; RAOs.

RAOs are shown back as a table in the conventions of this package, and as a picture.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, require
from rope_twin.sea.raos import FREEDOMS, SHIFTS, Point, Responses

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Vector = NDArray[np.float64]
MAX_ACROSS = 3  # panels in a row
FEW_DECADES = 200.0  # an axis whose end is less than 200 times its start is marked at 1, 2 and 5
MAX_PERIODS = 12  # in a printed table of one heading
MAX_CURVES = 9  # headings in a picture
SHOWN = 5e-4  # printed modulus from which a phase has a meaning
MIN_RATIO = 1e-3  # of a freedom's largest modulus: a phase below it is not drawn


@dataclass(frozen=True)
class Line:
    """A curve, or points if its style is a marker."""

    x: Sequence[float] | Vector
    y: Sequence[float] | Vector
    label: str = ""
    style: str = "-"


@dataclass(frozen=True)
class Field:
    """Values over a plane: (rows along y, columns along x), between the ends given."""

    values: Vector
    x: tuple[float, float]
    y: tuple[float, float]
    label: str  # of the colours; empty: no bar of them
    most: float | None = None  # value of the strongest colour, ±; None: the largest


@dataclass(frozen=True)
class Panel:
    """One set of axes."""

    title: str
    x: str
    y: str
    lines: tuple[Line, ...] = ()
    field: Field | None = None
    log: bool = False  # both axes logarithmic


def check_picture(path: Path) -> None:
    """Check, before any computation, that a picture can be drawn at this path.

    Raises:
        InputError: matplotlib is not installed, the ending is not one of a picture, or nothing can
            be written there.
    """
    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        problem = f"'{path.suffix}' is no picture that can be drawn"
        raise InputError(str(path), problem, "end it in .png, .svg or .pdf")
    parent = next(folder for folder in path.absolute().parents if folder.exists())
    if path.is_dir() or not parent.is_dir() or not os.access(parent, os.W_OK):
        raise InputError(str(path), "it cannot be written", "give a place that can be written")
    require("matplotlib", "a plot needs it and it is not there", "plot")


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure of matplotlib, which is loaded only here."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")


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
        remedy = "give a place that can be written"
        raise InputError(str(path), str(error.strerror), remedy) from error


def mark_decades(axes: Axes) -> None:
    """Label both logarithmic axes with plain numbers, also between decades where there are few."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        few = high < FEW_DECADES * low
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def draw_panels(title: str, panels: Sequence[Panel], path: Path) -> None:
    """Write panels under a title as one picture.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    check_picture(path)
    across = 2 if len(panels) == 4 else min(len(panels), MAX_ACROSS)
    down = ceil(len(panels) / across)
    figure = new_figure(5.0 * across + 0.6, 3.8 * down)
    axes = figure.subplots(down, across, squeeze=False).ravel()
    for panel, panel_axes in zip(panels, axes, strict=False):
        _draw(figure, panel_axes, panel)
    for panel_axes in axes[len(panels) :]:
        panel_axes.set_visible(False)
    figure.suptitle(title, fontsize=10)
    write_picture(figure, path, 90)


def _draw(figure: Any, axes: Any, panel: Panel) -> None:
    if panel.field is not None:
        high = panel.field.most
        low = None if high is None else -high
        image = axes.imshow(
            panel.field.values, origin="lower", aspect="auto", cmap="RdBu_r",
            extent=(*panel.field.x, *panel.field.y), vmin=low, vmax=high,
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


def own_headings(responses: Responses, wanted_deg: Sequence[float] = ()) -> Vector:
    """Return the headings of a table within one turn, or those asked for, (h,).

    Raises:
        InputError: a heading asked for is more than a turn.
    """
    if wanted_deg:
        wrong = [heading_deg for heading_deg in wanted_deg if not abs(heading_deg) <= 360.0]
        if wrong:
            raise InputError("--heading", f"it is {wrong[0]:g}°", "give degrees within ±360")
        return np.array(wanted_deg, dtype=float)
    end = 180.0 if responses.mirrored else 359.9999
    return responses.heading_deg[(responses.heading_deg >= 0.0) & (responses.heading_deg <= end)]


def periods_s(responses: Responses) -> Vector:
    """Return the wave periods of a table, ascending, (t,); the limit of 0 Hz left out."""
    return np.asarray(1.0 / responses.frequency_hz[responses.frequency_hz > 0.0][::-1])


def table_rows(responses: Responses, heading_deg: float) -> list[list[str]]:
    """Return a table for one heading: modulus and phase (lead, degrees) of six freedoms."""
    every = periods_s(responses)
    indices = np.unique(np.linspace(0, len(every) - 1, min(len(every), MAX_PERIODS)).round())
    table_periods = every[indices.astype(int)]
    answer = responses.at(1.0 / table_periods, np.full(len(table_periods), np.radians(heading_deg)))
    head = ["T [s]"]
    head += [f"{name} [{'m/m' if name in SHIFTS else '°/m'}]" for name in FREEDOMS]
    rows = [head]
    for period, values in zip(table_periods, answer.T, strict=True):
        sizes = np.abs(values) * np.where(np.arange(6) < 3, 1.0, 180.0 / np.pi)
        phases = np.degrees(np.angle(values))
        cells = (
            f"{a:.3f} {p:+4.0f}°" if a >= SHOWN else f"{a:.3f}     -"
            for a, p in zip(sizes, phases, strict=True)
        )
        rows.append([f"{period:.1f}", *cells])
    return rows


def figures(responses: Responses, headings_deg: Vector) -> dict[str, Any]:
    """Return RAOs for `--json`: modulus and phase as (6, headings, periods)."""
    periods = periods_s(responses)
    answer = np.stack(
        [responses.at(1.0 / periods, np.full(len(periods), np.radians(h))) for h in headings_deg],
        axis=1,
    )
    return {
        "source": responses.source,
        "phase_origin_m": responses.origin_m,
        "mirrored": bool(responses.mirrored),
        "heading_deg": headings_deg.tolist(),
        "period_s": periods.tolist(),
        "freedoms": list(FREEDOMS),
        "modulus": np.abs(answer).tolist(),
        "modulus_unit": ["m/m"] * 3 + ["rad/m"] * 3,
        "phase_deg": np.degrees(np.angle(answer)).tolist(),
    }


def draw_raos(responses: Responses, headings_deg: Vector, at_m: Point | None, path: Path) -> None:
    """Draw modulus and phase of each freedom over period, a curve for each heading.

    at_m: the point, if it is not the file's own.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    periods = periods_s(responses)
    few = np.unique(np.linspace(0, len(headings_deg) - 1, min(len(headings_deg), MAX_CURVES)))
    panels = list[Panel]()
    answers = {
        float(headings_deg[k]): responses.at(
            1.0 / periods, np.full(len(periods), np.radians(headings_deg[k]))
        )
        for k in few.round().astype(int)
    }
    for part in (slice(0, 3), slice(3, 6)):
        for number, name in list(enumerate(FREEDOMS))[part]:
            unit, scale = ("m/m", 1.0) if name in SHIFTS else ("°/m", 180.0 / np.pi)
            lines = tuple(
                Line(periods, scale * np.abs(answer[number]), f"{heading:g}°")
                for heading, answer in answers.items()
            )
            panels.append(Panel(name, "wave period [s]", f"modulus [{unit}]", lines))
        for number, name in list(enumerate(FREEDOMS))[part]:
            largest = max(float(np.abs(answer[number]).max()) for answer in answers.values())
            lines = tuple(
                Line(periods, _phase(answer[number], largest), f"{heading:g}°", ".")
                for heading, answer in answers.items()
            )
            panels.append(Panel(f"{name}, phase", "wave period [s]", "lead of crest [°]", lines))
    where = "" if at_m is None else f", at [{at_m[0]:g}, {at_m[1]:g}, {at_m[2]:g}] m"
    draw_panels(f"RAOs of {Path(responses.source.split(', ')[0]).name}{where}", panels, path)


def _phase(values: Any, largest: float) -> Vector:
    """Return phases in degrees; none where a freedom barely moves."""
    phase = np.degrees(np.angle(values))
    return np.asarray(np.where(np.abs(values) > MIN_RATIO * max(largest, 1e-30), phase, np.nan))
