"""Forecasts as tables: the band of each quantity over the lead, risks, and quiet windows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.messages import templates
from rope_twin.messages.cdr import decode, new, serialise
from rope_twin.topics import FORECAST_RISK, WHAT_IF_ORDERS

TENSION_TOPIC, RISK_TOPIC, QUIET_TOPIC = "forecast/tension", FORECAST_RISK, "forecast/quiet"
SCORE = "coverage", "judged", "factor", "age_s"  # how the last forecasts turned out
FORECAST_TOPICS = TENSION_TOPIC, RISK_TOPIC, QUIET_TOPIC, WHAT_IF_ORDERS
QUANTITIES = (
    "top_tension_n", "payload_tension_n", "payload_depth_m", "payload_speed_m_per_s",
    "slack_margin_n",
)  # fmt: skip
PERCENTILES = (5, 50, 95)


def band_columns(quantity: str) -> tuple[str, ...]:
    """Return the columns of a quantity's band, such as top_tension_5_n."""
    name, _, unit = quantity.replace("_m_per_s", " m_per_s").partition(" ")
    if not unit:
        name, _, unit = quantity.rpartition("_")
    return tuple(f"{name}_{percent}_{unit}" for percent in PERCENTILES)


_BANDS = [column for quantity in QUANTITIES for column in band_columns(quantity)]
COLUMNS = {
    TENSION_TOPIC: ("lead_s", *_BANDS, "heave_skill", "factor", "age_s"),
    RISK_TOPIC: (
        "span_s", "tension", "slack", "contact", "landing", "tension_limit_n",
        "contact_limit_m_per_s", "horizon_s", "coverage", "judged", "factor", "age_s",
    ),
    QUIET_TOPIC: ("begin_s", "length_s", "probability", "speed_limit_m_per_s", "age_s"),
    WHAT_IF_ORDERS: (
        "name", "span_s", "tension", "slack", "contact", "landing", *band_columns("peak_change_n"),
        "lower",
    ),
}  # fmt: skip


def encode_forecast(
    topic: str, origin_ns: int, frame_id: str, rows: Sequence[Mapping[str, float | str]]
) -> bytes:
    """Return a table of one of FORECAST_TOPICS, stamped with the origin [ROS time, ns].

    rows: values by column, the column name in at most 32 bytes; a missing one is NaN.
    """
    described = templates.columns(" ".join(COLUMNS[topic]))
    points = np.zeros(len(rows), templates.point_type(described))
    for name in COLUMNS[topic]:
        own = [row.get(name, "" if name == "name" else math.nan) for row in rows]
        points[name] = [one.encode() if isinstance(one, str) else one for one in own]
    message: Any = templates.cloud(frame_id, len(rows), points.dtype)
    message.data = np.frombuffer(points.tobytes(), np.uint8)
    sec, nanosec = templates.split(origin_ns)
    message.header.stamp = new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    return serialise(message)


def encode_what_if(words: str) -> bytes:
    """Return a message of forecast/what_if; words: orders, such as `lower:0.5 stop`."""
    return serialise(new("std_msgs/msg/String", data=words))


def read_risks(data: bytes) -> list[dict[str, float]]:
    """Return the rows of a message on RISK_TOPIC.

    Raises:
        InputError: it is no such message, has no row, or a row lacks a column.
    """
    table = templates.read_cloud(decode(RISK_TOPIC, data))
    columns = COLUMNS[RISK_TOPIC]
    if not len(table) or not set(columns).issubset(table.dtype.names or ()):
        what, right = f"{len(table)} rows without {', '.join(SCORE)}", "send the forecast node's"
        raise InputError(phrase(RISK_TOPIC, what, right))
    return [{name: float(row[name]) for name in columns} for row in table]
