"""Row of the diagnostics, and the message that carries them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

from rope_twin.messages import templates
from rope_twin.messages.cdr import new, serialise

HARDWARE_ID = "rope_twin"


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


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, such as `1 step` or `2 steps`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
