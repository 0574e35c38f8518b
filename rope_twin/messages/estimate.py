"""Message and words of figures that are learned from the measured tension."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from rope_twin.messages import templates
from rope_twin.messages.cdr import Template, new, serialise
from rope_twin.messages.status import Level, Status

COLUMNS = "name value low high prior prior_sd sd state correlation"
STATES = "not observable", "weak", "learned"  # numbers 0, 1, 2 of the column `state`
# of value, low, high and prior
UNITS = {
    "submerged_weight": "N", "oscillating_mass": "kg", "payload_drag": "m²",
    "axial_stiffness": "N", "axial_damping": "N·s", "tangential_drag": "kg/m²", "current": "-",
    "tension_bias": "N", "tension_gain": "-", "heave_gain": "-", "heave_delay": "s",
    "sheave_friction": "-",
}  # fmt: skip
ROW = "simulation: learned figures"


@cache
def _template(count: int) -> Template:
    point = templates.point_type(templates.columns(COLUMNS))
    return Template(templates.cloud("map", count, point))


def encode_estimate(stamp_ns: int, rows: Sequence[dict[str, Any]]) -> bytes:
    """Return a message of estimate/figures.

    stamp_ns: ROS time of the end of the data that were learned from. rows: values of COLUMNS, with
    `state` one of STATES.
    """
    points = np.zeros(len(rows), templates.point_type(templates.columns(COLUMNS)))
    for number, row in enumerate(rows):
        for name in COLUMNS.split():
            value = row[name]
            if name == "name":
                value = value.encode()
            elif name == "state":
                value = STATES.index(value)
            points[name][number] = value
    sec, nanosec = templates.split(stamp_ns)
    stamp = {"header.stamp.sec": sec, "header.stamp.nanosec": nanosec}
    return _template(len(rows)).fill({**stamp, "data": points.view(np.uint8)})


def encode_alarm(words: str) -> bytes:
    """Return a message of estimate/alarms; words: of the alarm, "": it was acknowledged."""
    return serialise(new("std_msgs/msg/String", data=words))


def alarm_words(alarm: dict[str, Any]) -> str:
    """Return an alarm of a run in words, from its `--json`."""
    return f"alarm at {alarm['found_s']:.0f} s: {alarm['causes']}, since {alarm['begun_s']:.0f} s"


def learned_words(row: dict[str, Any]) -> str:
    """Return a learned figure in words, from the fields of a FigureEstimate."""
    unit = "" if row["unit"] == "-" else f" {row['unit']}"
    words = (
        f"{row['name'].replace('_', ' ')}: {row['value']:.4g}{unit}, 90 % {row['low']:.4g} to "
        f"{row['high']:.4g}{unit} (scene {row['prior']:.4g}), {row['state']}"
    )
    return f"{words}; {row['advice']}" if row["advice"] else words


def estimate_status(
    words: str, trouble: str, rows: Sequence[dict[str, Any]], minutes: int, core_pct: float
) -> Status:
    """Return the row on learning: WARN if it stands.

    words: what it does at present; trouble: why it stands, or ""; rows: as for `encode_estimate`.
    """
    values = {
        "minutes learned from": str(minutes),
        "CPU [% of a core]": f"{core_pct:.2f}",
    }
    for row in rows:
        spread = f"{row['low']:.4g} to {row['high']:.4g} {row['unit']}, {row['state']}"
        values[row["name"]] = f"{row['value']:.4g} {row['unit']}, 90 % {spread}"
    return Status(ROW, Level.WARN if trouble else Level.OK, trouble or words, values)
