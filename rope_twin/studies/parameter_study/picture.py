"""Picture of a study: maximum and minimum tension over each variable."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.studies.parameter_study.batch import Row
from rope_twin.studies.parameter_study.file import Study, Variable
from rope_twin.studies.parameter_study.table import whole_runs
from rope_twin.studies.picture import check_picture, write_picture

ACROSS = 4  # panels beside each other
PANELS_MOST = 32
HIGH, LOW = "#d55e00", "#0072b2"


def draw_study(study: Study, rows: Sequence[Row], path: Path) -> None:
    """Draw a panel for each variable, and one for the damage along the rope if it was counted.

    Raises:
        InputError: it cannot be drawn or written.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    good = whole_runs(rows)
    shown = study.vary[:PANELS_MOST]
    damaged = bool(good) and "damage" in good[0]
    panels = len(shown) + damaged
    across = min(ACROSS, panels)
    down = math.ceil(panels / across)
    figure = Figure(figsize=(4.0 * across, 3.2 * down + 0.5), layout="constrained")
    axes: list[Any] = figure.subplots(down, across, squeeze=False).ravel().tolist()
    for own, variable in zip(axes, shown, strict=False):
        _draw(own, variable, good)
    if damaged:
        _draw_damage(axes[len(shown)], good)
    for own in axes[panels:]:
        own.set_axis_off()
    axes[0].set_ylabel("top tension [kN]")
    more = len(study.vary) - len(shown)
    left_out = f"; {more} variables more" if more else ""
    figure.suptitle(f"{study.name}: {len(good)} runs of {study.seconds:g} s{left_out}")
    write_picture(figure, path, 110)


def _draw(axes: Any, variable: Variable, rows: Sequence[Row]) -> None:
    values = [row[variable.column] for row in rows]
    if variable.names or variable.cases:
        words = list(dict.fromkeys(values))
        values = [words.index(value) for value in values]
        axes.set_xticks(range(len(words)), words, rotation=20)
    for column, colour, label in (("tension_top_max_n", HIGH, "highest"),
                                  ("tension_top_min_n", LOW, "lowest")):  # fmt: skip
        tension = [1e-3 * row[column] for row in rows]
        axes.plot(values, tension, ".", color=colour, alpha=0.6, label=label)
    axes.set_xlabel(variable.column)
    axes.legend(fontsize="small")
    axes.grid(True, linewidth=0.3)


def _draw_damage(axes: Any, rows: Sequence[Row]) -> None:
    """Draw range and median of the damage over the runs, from the lower end up."""
    length = min(len(row["damage"]) for row in rows)
    damage = np.array([row["damage"][:length] for row in rows])
    place = rows[0]["damage_from_lower_end_m"][:length]
    axes.fill_betweenx(place, damage.min(axis=0), damage.max(axis=0), color=HIGH, alpha=0.3)
    axes.plot(np.median(damage, axis=0), place, color=HIGH)
    axes.set_xlabel("damage of a run")
    axes.set_ylabel("from the lower end [m]")
    axes.grid(True, linewidth=0.3)
