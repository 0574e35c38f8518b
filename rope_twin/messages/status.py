"""Rows of the diagnostics and their message; residuals and quality index in words and as rows.

Residuals are measured less computed. The quality index is also a table.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from rope_twin.messages import templates
from rope_twin.messages.cdr import decode, new, serialise
from rope_twin.quantity import or_nan
from rope_twin.twin.snapshot import (
    CAUSES,
    DISCRETISATION,
    RESIDUAL,
    UNPROVEN,
    Quality,
    Residual,
    Snapshot,
    disagrees,
)

HARDWARE_ID = "rope_twin"
RECORDER_ROW = "recorder: bag"
_QUANTITIES = {  # name, scale, unit and number format of what is measured
    "top_tension_n": ("top tension", 1e-3, "kN", ".2f"),
    "line_out_m": ("line out", 1.0, "m", ".2f"),
    "payload_depth_m": ("payload depth", 1.0, "m", ".2f"),
}
DOUBTFUL = 0.5  # below it a result supports no decision
QUALITY_COLUMNS = f"name index cause {' '.join(CAUSES)}"
_ROUND_OFF = 1e-9


class Level(IntEnum):
    """Level of a diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Status:
    """Diagnostics row: name, level, message of one sentence, and key values."""

    name: str
    level: Level
    message: str
    values: dict[str, str] = field(default_factory=dict)


def encode_diagnostics(stamp_ns: int, rows: Sequence[Status]) -> bytes:
    """Return a `diagnostics` message with one DiagnosticStatus per row."""
    header = new("std_msgs/msg/Header", stamp=templates.time(stamp_ns))
    status = [
        new(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=int(row.level),
            name=row.name,
            message=row.message,
            hardware_id=HARDWARE_ID,
            values=[
                new("diagnostic_msgs/msg/KeyValue", key=key, value=value)
                for key, value in row.values.items()
            ],
        )
        for row in rows
    ]
    return serialise(new("diagnostic_msgs/msg/DiagnosticArray", header=header, status=status))


def read_diagnostics(data: bytes) -> list[Status]:
    """Return the rows of a `diagnostics` message; a level beyond ERROR (stale) is ERROR.

    Raises:
        InputError: the bytes are not such a message.
    """
    return [
        Status(
            str(row.name),
            Level(min(int(row.level) & 0xFF, Level.ERROR)),  # a byte, with a sign in its array
            str(row.message),
            {str(pair.key): str(pair.value) for pair in row.values},
        )
        for row in decode("diagnostics", data).status
    ]


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, such as `1 step` or `2 steps`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def residuals_status(residuals: Sequence[Residual]) -> Status:
    """Return the row on measured less computed values: WARN if one is outside for long."""
    values: dict[str, str] = {}
    outside: list[Residual] = []
    for one in residuals:
        what, scale, unit, form = _QUANTITIES[one.quantity]
        label = f"{one.name}: {what}"
        values |= {
            f"{label}, measured [{unit}]": f"{scale * one.measured:{form}}",
            f"{label}, computed [{unit}]": f"{scale * one.computed:{form}}",
            f"{label}, mean residual of 60 s [{unit}]": f"{scale * one.mean:{form}}",
            f"{label}, RMS residual of 60 s [{unit}]": f"{scale * one.rms:{form}}",
        }
        if one.outside is not None:
            values[f"{label}, outside its interval [%]"] = f"{100.0 * one.outside:.0f}"
            if disagrees(one):
                outside.append(one)
    if outside:
        words = "; ".join(residual_words(one) for one in outside)
        return Status("simulation: residuals", Level.WARN, words, values)
    words = "; ".join(residual_words(one) for one in residuals)
    return Status("simulation: residuals", Level.OK, words, values)


def residual_words(one: Residual) -> str:
    """Return a residual in words, with its interval and statistics."""
    what, scale, unit, form = _QUANTITIES[one.quantity]
    words = (
        f"{what} of '{one.name}': measured {scale * one.measured:{form}} {unit}, computed "
        f"{scale * one.computed:{form}} {unit}, mean residual {scale * one.mean:+{form}} {unit}"
    )
    if one.half_width is None or one.outside is None:
        return f"{words}, interval unknown (give `measured` in the scene)"
    alone = "" if one.twin is not None else " (of the instrument alone)"
    share = f"{100.0 * one.outside:.0f} % outside ±{scale * one.half_width:{form}} {unit}"
    return f"{words}, {share}{alone}"


def quality_rows(snapshot: Snapshot) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of `twin/quality`; cause: its number in CAUSES, NaN: unknown."""
    for one in snapshot.quality:
        yield one.element, one.index, CAUSES.index(one.cause), *map(or_nan, one.components)


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
