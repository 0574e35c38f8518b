"""Quality index of the twin in words, as a table, and as a row of the diagnostics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rope_twin.messages import templates
from rope_twin.messages.status import Level, Status
from rope_twin.twin.quality import CAUSES, DISCRETISATION, RESIDUAL, UNPROVEN
from rope_twin.twin.snapshot import Quality, Snapshot

DOUBTFUL = 0.5  # below it a result supports no decision
COLUMNS = f"name index cause {' '.join(CAUSES)}"
_ROUND_OFF = 1e-9


def quality_table(snapshot: Snapshot) -> tuple[templates.Columns, list[dict[str, Any]]]:
    """Return columns and rows of `twin/quality`; cause: its number in CAUSES, NaN: unknown."""
    rows = []
    for one in snapshot.quality:
        parts = (math.nan if value is None else value for value in one.components)
        row = {"name": one.element, "index": one.index, "cause": CAUSES.index(one.cause)}
        rows.append(row | dict(zip(CAUSES, parts, strict=True)))
    return templates.columns(COLUMNS), rows


def quality_status(elements: Sequence[Quality]) -> Status:
    """Return the row on the lowest index: OK from UNPROVEN, ERROR below DOUBTFUL."""
    values: dict[str, str] = {}
    for one in elements:
        label = one.element.replace("_", " ")
        values[f"{label}: index"] = f"{one.index:.3f}"
        values[f"{label}: reason"] = f"{one.cause}: {one.reason}" if one.reason else ""
        values |= {
            f"{label}: {cause}": "unknown" if value is None else f"{value:.3f}"
            for cause, value in zip(CAUSES, one.components, strict=True)
        }
    worst = min(elements, key=lambda one: one.index)
    level = Level.OK if worst.index >= UNPROVEN - _ROUND_OFF else Level.WARN
    level = Level.ERROR if worst.index < DOUBTFUL - _ROUND_OFF else level
    return Status("simulation: quality", level, quality_words(worst), values)


def quality_words(one: Quality) -> str:
    """Return the lowest index in words, in tenths as it rises, with its reason."""
    tenths = math.floor(10.0 * one.index + 10.0 * _ROUND_OFF) / 10.0
    words = f"lowest index {tenths:.1f} ({one.element.replace('_', ' ')})"
    how = "rising after" if is_rising(one) else "limited by"
    return f"{words}, {how} {one.cause}: {one.reason}" if one.reason else words


def is_rising(one: Quality) -> bool:
    """Return whether the index is below all that limits it now, after a fall."""
    parts = dict(zip(CAUSES, one.components, strict=True))
    limits = [value for value in one.components if value is not None]
    unproven = parts[RESIDUAL] is None or parts[DISCRETISATION] is None
    return one.index < min([*limits, UNPROVEN if unproven else 1.0]) - _ROUND_OFF


def lowest_words(elements: Sequence[dict[str, Any]]) -> str:
    """Return the lowest index of a run, from the fields of each Quality, and the present one."""
    worst = min(elements, key=lambda one: float(one["lowest"]))
    now = min(float(one["index"]) for one in elements)
    name = worst["element"].replace("_", " ")
    words = f"quality index: {now:.2f} now, lowest {worst['lowest']:.2f} ({name}"
    if worst["lowest_at_s"] > 0.0:
        words += f" at {worst['lowest_at_s']:.1f} s"
    return f"{words}): {worst['lowest_reason']}" if worst["lowest_reason"] else f"{words})"
