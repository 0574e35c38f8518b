"""The loop's picture: both tensions over time, both lines seen from the side (needs matplotlib)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rope_twin.studies.picture import check_picture, write_picture
from rope_twin.studies.two_lines.runs import LineRun

COLOURS = {"main": "tab:blue", "haulback": "tab:red"}


def draw_lines(name: str, calm: LineRun, rough: LineRun, label: str, path: Path) -> None:
    """Write it; label: of the rough run.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 4.6), layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=(2.0, 1.0, 1.2))
    for k, (line, colour) in enumerate(COLOURS.items()):
        for run, style, words in ((rough, "-", label), (calm, "--", "calm")):
            left.plot(
                run.time_s, 1e-3 * run.tension_n[k], style, color=colour, linewidth=1.0,
                label=f"{line}, {words}",
            )  # fmt: skip
    _name(left, "tension at the ship", "time [s]", "[kN]")
    left.legend(fontsize=7)
    for own, (line, colour) in zip(calm.lines_m, COLOURS.items(), strict=True):
        middle.plot(own[:, 0], own[:, 1], color=colour, linewidth=1.0, label=line)
    low, high = middle.get_xlim()
    for depth in calm.crossing_m[-1]:
        middle.axhline(depth, color="black", linewidth=0.6, linestyle=":")
        middle.text(low + 0.02 * (high - low), depth, f"{depth:.0f} m", fontsize=7, va="bottom")
    middle.invert_yaxis()
    _name(middle, "both lines at the end, calm", "along the hang-offs' plane [m]", "depth [m]")
    for run, style, words in ((rough, "-", label), (calm, "--", "calm")):
        times = [t for t, depths in zip(run.time_s, run.crossing_m, strict=True) for _ in depths]
        depths = [depth for some in run.crossing_m for depth in some]
        right.plot(times, depths, "." if style == "-" else "k.", markersize=2, label=words)
    right.invert_yaxis()
    _name(right, "where the lines cross", "time [s]", "depth [m]")
    right.legend(fontsize=7)
    figure.suptitle(name, fontsize=10)
    write_picture(figure, path, 90)


def _name(axes: Any, title: str, x: str, y: str) -> None:
    axes.set_title(title, fontsize=9)
    axes.set_xlabel(x, fontsize=8)
    axes.set_ylabel(y, fontsize=8)
    axes.grid(True, linewidth=0.3)
