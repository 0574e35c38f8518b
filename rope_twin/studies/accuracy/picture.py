"""Work and precision as a plot: error over real-time factor, a point for each setting."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rope_twin.scene.card import PEAK, RMS
from rope_twin.studies.accuracy.page import is_still
from rope_twin.studies.accuracy.study import Row, Study
from rope_twin.studies.picture import check_picture, mark_decades, write_picture

MARKERS = ("o", "s", "D", "^", "v", "P")  # the shorter the step, the earlier
PANELS = ((RMS, "rms [% of std]"), (PEAK, "highest [%]"))
LEAST_PCT = 1e-6


def draw_accuracy(study: Study, path: Path) -> None:
    """Write the plot: rms error on the left, error of the highest tension on the right.

    Raises:
        InputError: matplotlib is not there, or the file cannot be written.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.6), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, (name, label) in zip(panels, PANELS, strict=True):
        _draw_panel(axes, study, name)
        axes.set_ylabel(f"error of the top tension, {label}")
        axes.set_xlabel("times real time (faster →)")
    handles, labels = panels[0].get_legend_handles_labels()
    if not handles:
        handles, labels = panels[1].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside right upper", fontsize=7, frameon=False)
    name, seconds = study.scene.name, study.plan.seconds
    figure.suptitle(f"{name}: what accuracy costs (first {seconds:g} s, one core)", fontsize=11)
    write_picture(figure, path, 90)


def _draw_panel(axes: Any, study: Study, name: str) -> None:
    doubt = study.reference.doubts[name].uncertainty
    rows = [row for row in study.rows if row.setting.tolerance_n is None]
    if doubt is None or is_still(study):
        words = "does not converge:\nsee the spread in the card" if doubt is None else (
            "nothing moves:\nevery setting is right to round-off"
        )  # fmt: skip
        axes.text(0.5, 0.5, words, ha="center", va="center", transform=axes.transAxes)
        axes.set_xticks([])
        axes.set_yticks([])
        return
    axes.set_xscale("log")
    axes.set_yscale("log")
    _draw_rungs(axes, rows, name)
    _draw_front(axes, rows, name)
    own = study.own
    if own is not None:
        axes.plot(own.real_time_factor, _height(own, name), "o", markersize=14, fillstyle="none",
                  color="crimson", markeredgewidth=1.8, linestyle="", label="the scene as it is")  # fmt: skip # noqa: E501
    low, high = axes.get_ylim()
    bottom = min(low, 0.5 * max(doubt, LEAST_PCT))
    axes.axhspan(bottom, max(doubt, LEAST_PCT), color="0.85", zorder=0,
                 label="reference's uncertainty")  # fmt: skip
    axes.set_ylim(bottom, high)
    mark_decades(axes)
    axes.grid(True, which="major", linewidth=0.3)


def _draw_rungs(axes: Any, rows: list[Row], name: str) -> None:
    """Draw a line for each number of elements, with a marker for each time step."""
    from matplotlib import colormaps

    counts = sorted({row.setting.elements for row in rows})
    steps = sorted({row.setting.step_s for row in rows})
    for number, count in enumerate(counts):
        colour = colormaps["viridis"](0.92 * number / max(len(counts) - 1, 1))
        own = sorted(
            (row for row in rows if row.setting.elements == count),
            key=lambda row: row.setting.step_s,
        )
        places = [(row.real_time_factor, _height(row, name)) for row in own]
        axes.plot(
            *zip(*places, strict=True), color=colour, linewidth=0.9, label=f"{count} elements"
        )
        for row, (x, y) in zip(own, places, strict=True):
            axes.plot(x, y, MARKERS[steps.index(row.setting.step_s) % len(MARKERS)], color=colour,
                      markersize=5)  # fmt: skip
    for number, step_s in enumerate(steps):
        axes.plot([], [], MARKERS[number % len(MARKERS)], color="0.4", markersize=5,
                  label=f"{1e3 * step_s:g} ms")  # fmt: skip


def _draw_front(axes: Any, rows: list[Row], name: str) -> None:
    """Draw the Pareto front of error and speed."""
    ordered = sorted(rows, key=lambda row: -row.real_time_factor)
    front: list[tuple[float, float]] = []
    for row in ordered:
        if not front or _height(row, name) < front[-1][1]:
            front.append((row.real_time_factor, _height(row, name)))
    axes.step(*zip(*front, strict=True), where="pre", color="black", linewidth=2.5, alpha=0.25,
              label="best for the cost")  # fmt: skip


def _height(row: Row, name: str) -> float:
    at_most = row.at_most[name]
    return max(LEAST_PCT, LEAST_PCT if at_most is None else at_most)
