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
DOUBTFUL = 0.5  # below it a result must not be used for a decision
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
    for residual in residuals:
        quantity, scale, unit, form = _QUANTITIES[residual.quantity]
        label = f"{residual.name}: {quantity}"
        values |= {
            f"{label}, measured [{unit}]": f"{scale * residual.measured:{form}}",
            f"{label}, computed [{unit}]": f"{scale * residual.computed:{form}}",
            f"{label}, mean residual of 60 s [{unit}]": f"{scale * residual.mean:{form}}",
            f"{label}, RMS residual of 60 s [{unit}]": f"{scale * residual.rms:{form}}",
        }
        if residual.outside is not None:
            values[f"{label}, outside its interval [%]"] = f"{100.0 * residual.outside:.0f}"
            if disagrees(residual):
                outside.append(residual)
    if outside:
        words = "; ".join(residual_words(residual) for residual in outside)
        return Status("simulation: residuals", Level.WARN, words, values)
    words = "; ".join(residual_words(residual) for residual in residuals)
    return Status("simulation: residuals", Level.OK, words, values)


def residual_words(residual: Residual) -> str:
    """Return a residual in words, with its interval and statistics."""
    quantity, scale, unit, form = _QUANTITIES[residual.quantity]
    words = (
        f"{quantity} of '{residual.name}': measured {scale * residual.measured:{form}} {unit}, "
        f"computed {scale * residual.computed:{form}} {unit}, mean residual "
        f"{scale * residual.mean:+{form}} {unit}"
    )
    if residual.half_width is None or residual.outside is None:
        return f"{words}, interval unknown (give `measured` in the scene)"
    scope = "" if residual.twin is not None else " (of the instrument alone)"
    coverage = (
        f"{100.0 * residual.outside:.0f} % outside ±{scale * residual.half_width:{form}} {unit}"
    )
    return f"{words}, {coverage}{scope}"


def quality_rows(snapshot: Snapshot) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of `twin/quality`; cause: its number in CAUSES, NaN: unknown."""
    for quality in snapshot.quality:
        yield (
            quality.element,
            quality.index,
            CAUSES.index(quality.cause),
            *map(or_nan, quality.components),
        )


def quality_status(elements: Sequence[Quality]) -> Status:
    """Return the row on the lowest index: OK from UNPROVEN, ERROR below DOUBTFUL."""
    values: dict[str, str] = {}
    for element in elements:
        label = element.element.replace("_", " ")
        values[f"{label}: index"] = f"{element.index:.3f}"
        values[f"{label}: reason"] = f"{element.cause}: {element.reason}" if element.reason else ""
        values |= {
            f"{label}: {cause}": "unknown" if value is None else f"{value:.3f}"
            for cause, value in zip(CAUSES, element.components, strict=True)
        }
    worst = min(elements, key=lambda element: element.index)
    level = Level.OK if worst.index >= UNPROVEN - _ROUND_OFF else Level.WARN
    level = Level.ERROR if worst.index < DOUBTFUL - _ROUND_OFF else level
    return Status("simulation: quality", level, quality_words(worst), values)


def quality_words(quality: Quality) -> str:
    """Return the lowest index in words, in tenths as it rises, with its reason."""
    tenths = math.floor(10.0 * quality.index + 10.0 * _ROUND_OFF) / 10.0
    words = f"lowest index {tenths:.1f} ({quality.element.replace('_', ' ')})"
    relation = "rising after" if is_rising(quality) else "limited by"
    return f"{words}, {relation} {quality.cause}: {quality.reason}" if quality.reason else words


def is_rising(quality: Quality) -> bool:
    """Return whether the index is below all that limits it now, after a fall."""
    components = dict(zip(CAUSES, quality.components, strict=True))
    limits = [value for value in quality.components if value is not None]
    unproven = components[RESIDUAL] is None or components[DISCRETISATION] is None
    return quality.index < min([*limits, UNPROVEN if unproven else 1.0]) - _ROUND_OFF


def lowest_words(elements: Sequence[dict[str, Any]]) -> str:
    """Return the lowest index of a run, from the fields of each Quality, and the present one."""
    worst = min(elements, key=lambda element: float(element["lowest"]))
    present = min(float(element["index"]) for element in elements)
    name = worst["element"].replace("_", " ")
    words = f"quality index: {present:.2f} now, lowest {worst['lowest']:.2f} ({name}"
    if worst["lowest_at_s"] > 0.0:
        words += f" at {worst['lowest_at_s']:.1f} s"
    return f"{words}): {worst['lowest_reason']}" if worst["lowest_reason"] else f"{words})"
