"""Results of a parameter study as a table and as a picture."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.studies.ensemble import QUANTILES
from rope_twin.studies.picture import check_picture, write_picture
from rope_twin.studies.study_design import Row, Study, Variable

FIGURES = (  # column of the rows, words, scale
    ("tension_top_max_n", "highest top tension [kN]", 1e-3),
    ("tension_top_mean_n", "mean top tension [kN]", 1e-3),
    ("tension_top_min_n", "lowest top tension [kN]", 1e-3),
    ("slack_share", "slack somewhere [% of time]", 100.0),
    ("highest_over_breaking_load", "highest over breaking load [%]", 100.0),
    ("damage_worst", "damage of the worst piece [1e-9]", 1e9),
)
PARTS = 4  # of a variable's range, where every run has a number of its own
MANY = 8  # different numbers; more are stated by parts of the range


def whole_runs(rows: Sequence[Row]) -> list[Row]:
    """Return the completed runs."""
    return [row for row in rows if not row["failure"]]


def study_lines(study: Study, rows: Sequence[Row]) -> Iterator[str]:
    """Return the lines of the table."""
    good = whole_runs(rows)
    yield f"{study.name}: {len(rows)} runs of {study.seconds:g} s of {study.scene}"
    failed = [row for row in rows if row["failure"]]
    for row in failed[:5]:
        yield f"run {row['run']} stopped early: {row['failure']}"
    if len(failed) > 5:
        yield f"and {len(failed) - 5} more"
    if not good:
        return
    yield ""
    heads = ["least", *(f"{100 * part:g} %" for part in QUANTILES[1:-1]), "largest"]
    known = [*_known(good), *_by_rope(good)]
    width = max(len(words) for _, words, _ in known)
    yield " " * width + "".join(f"{head:>10}" for head in heads)
    for column, words, scale in known:
        numbers = np.quantile([scale * row[column] for row in good], QUANTILES)
        yield f"{words:{width}}" + "".join(f"{number:10.4g}" for number in numbers)
    for variable in study.vary:
        yield ""
        yield from _effect_of(variable, good)


def _known(rows: Sequence[Row]) -> list[tuple[str, str, float]]:
    return [figure for figure in FIGURES if figure[0] in rows[0]]


def _by_rope(rows: Sequence[Row]) -> list[tuple[str, str, float]]:
    """Return the highest tension of each rope of a multi-line scene."""
    end = ".tension_max_n"
    names = (column.removesuffix(end) for column in rows[0] if column.endswith(end))
    return [(name + end, f"highest tension of {name} [kN]", 1e-3) for name in names]


def _effect_of(variable: Variable, rows: Sequence[Row]) -> Iterator[str]:
    """Return a line for each value of a variable, or for each part of its range."""
    yield f"{variable.column}: median over the runs{_ranks(variable, rows)}"
    known = _known(rows)
    yield " " * 24 + "".join(f"{words.split(' [')[0]:>32}" for _, words, _ in known[:3])
    for words, some in _levels(variable, rows):
        cells = "".join(
            f"{np.median([scale * row[column] for row in some]):32.4g}"
            for column, _, scale in known[:3]
        )
        yield f"{words:>18} {len(some):5d}{cells}"


def _levels(variable: Variable, rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    values: list[Any] = list(dict.fromkeys(row[variable.column] for row in rows))
    if variable.names or variable.cases:
        return [(str(v), [row for row in rows if row[variable.column] == v]) for v in values]
    if len(values) <= MANY:
        values.sort()
        return [(f"{v:.6g}", [row for row in rows if row[variable.column] == v]) for v in values]
    borders = np.quantile([row[variable.column] for row in rows], np.linspace(0.0, 1.0, PARTS + 1))
    found = []
    for low, high in pairwise(borders):
        last = high == borders[-1]
        inside = [row for row in rows if low <= row[variable.column] <= high]
        some = [row for row in inside if last or row[variable.column] < high]
        found.append((f"{low:.4g}..{high:.4g}", some))
    return [(words, some) for words, some in found if some]


def _ranks(variable: Variable, rows: Sequence[Row]) -> str:
    """Return the rank correlation with the maximum tension; for numbers only."""
    values = [row[variable.column] for row in rows]
    if variable.names or variable.cases or len(set(values)) < 3:
        return ""
    highest = [row["tension_top_max_n"] for row in rows]
    if len(set(highest)) < 2:
        return ""
    from scipy.stats import spearmanr  # a second to load, and only studies want it

    rank = float(spearmanr(values, highest).statistic)
    return f"; rank correlation with the highest tension {rank:+.2f}"


ACROSS = 4  # panels beside each other
PANELS_MOST = 32
HIGH, LOW = "#d55e00", "#0072b2"
DAMAGE = re.compile(r"(.*\.)?damage")  # columns of damage along a rope


def draw_study(study: Study, rows: Sequence[Row], path: Path) -> None:
    """Draw a panel for each variable, and one for the damage along each rope if it was counted.

    Raises:
        InputError: it cannot be drawn or written.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    good = whole_runs(rows)
    shown = study.vary[:PANELS_MOST]
    damaged = [column for column in (good[0] if good else ()) if DAMAGE.fullmatch(column)]
    panels = len(shown) + len(damaged)
    across = min(ACROSS, panels)
    down = math.ceil(panels / across)
    figure = Figure(figsize=(4.0 * across, 3.2 * down + 0.5), layout="constrained")
    axes: list[Any] = figure.subplots(down, across, squeeze=False).ravel().tolist()
    for own, variable in zip(axes, shown, strict=False):
        _draw(own, variable, good)
    for own, column in zip(axes[len(shown) :], damaged, strict=False):
        _draw_damage(own, good, column)
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


def _draw_damage(axes: Any, rows: Sequence[Row], column: str) -> None:
    """Draw range and median of a rope's damage over the runs, from the lower end up."""
    length = min(len(row[column]) for row in rows)
    damage = np.array([row[column][:length] for row in rows])
    place = rows[0][f"{column}_from_lower_end_m"][:length]
    axes.fill_betweenx(place, damage.min(axis=0), damage.max(axis=0), color=HIGH, alpha=0.3)
    axes.plot(np.median(damage, axis=0), place, color=HIGH)
    name = column.rpartition(".")[0]
    axes.set_xlabel(f"damage of {name} in a run" if name else "damage of a run")
    axes.set_ylabel("from the lower end [m]")
    axes.grid(True, linewidth=0.3)
