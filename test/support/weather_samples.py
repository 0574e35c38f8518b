"""Hindcast and limit files, for operability tests."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime, timedelta
from pathlib import Path

START = datetime(2001, 1, 1)
HOUR = 3600.0


def write_hindcast(
    path: Path, hs_m: Iterable[float], tp_s: float = 8.0, from_deg: float | None = None,
    step_h: float = 1.0, start: datetime = START,
) -> Path:  # fmt: skip
    """Write a series of heights at equal steps."""
    direction = "" if from_deg is None else ",direction_from_deg"
    lines = [f"time,hs_m,tp_s{direction}"]
    for k, height in enumerate(hs_m):
        when = start + timedelta(hours=k * step_h)
        own = "" if from_deg is None else f",{from_deg}"
        lines.append(f"{when.isoformat()},{float(height)!r},{tp_s}{own}")
    path.write_text("\n".join(lines) + "\n")
    return path


def write_limits(path: Path, limit_m: float) -> Path:
    """Write one limit for all periods from 4 to 16 s and any heading."""
    path.write_text(f"tp_s,limit_hs_m\n4,{limit_m}\n16,{limit_m}\n")
    return path
