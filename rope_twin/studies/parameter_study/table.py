"""Summary table of a study: quantiles over all runs, and the influence of each variable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from rope_twin.studies.ensemble.study import QUANTILES
from rope_twin.studies.parameter_study.batch import Row
from rope_twin.studies.parameter_study.file import Study, Variable

FIGURES = (  # column of the rows, words, scale
    ("tension_top_max_n", "highest top tension [kN]", 1e-3),
    ("tension_top_mean_n", "mean top tension [kN]", 1e-3),
    ("tension_top_min_n", "lowest top tension [kN]", 1e-3),
    ("slack_share", "slack somewhere [% of time]", 100.0),
    ("highest_over_breaking_load", "highest over breaking load [%]", 100.0),
    ("damage_worst", "damage of the worst piece [1e-9]", 1e9),
)
PARTS = 4  # of a variable's range, where every run has a number of its own
MANY = 8  # different numbers; more are told by parts of the range


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
    yield " " * 34 + "".join(f"{head:>10}" for head in heads)
    for column, words, scale in _known(good):
        numbers = np.quantile([scale * row[column] for row in good], QUANTILES)
        yield f"{words:34}" + "".join(f"{number:10.4g}" for number in numbers)
    for variable in study.vary:
        yield ""
        yield from _effect_of(variable, good)


def _known(rows: Sequence[Row]) -> list[tuple[str, str, float]]:
    return [figure for figure in FIGURES if figure[0] in rows[0]]


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
