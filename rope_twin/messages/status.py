"""A row of the diagnostics (diagnostic_msgs/DiagnosticStatus), and the bytes of many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from rope_twin.messages import forms
from rope_twin.messages.cdr import new, serialise

HARDWARE_ID = "rope_twin"


class Level(IntEnum):
    """diagnostic_msgs/DiagnosticStatus levels."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Status:
    """One row of the diagnostics: a name, how bad, one sentence, and the numbers behind it."""

    name: str
    level: Level
    message: str
    values: dict[str, str] = field(default_factory=dict)


def encode_diagnostics(stamp_ns: int, rows: Sequence[Status]) -> bytes:
    """diagnostics: one DiagnosticStatus a row."""
    header = forms.header("")
    header.stamp = forms.time(stamp_ns)
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


def counted(number: int, noun: str) -> str:
    """Like `1 step`, `2 steps`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
