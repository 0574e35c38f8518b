"""Forecasts as tables: the band of each quantity over the lead, risks, and quiet windows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rope_twin.messages import templates
from rope_twin.messages.cdr import new, serialise

TENSION_TOPIC, RISK_TOPIC, QUIET_TOPIC = "forecast/tension", "forecast/risk", "forecast/quiet"
FORECAST_TOPICS = TENSION_TOPIC, RISK_TOPIC, QUIET_TOPIC
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
        "contact_limit_m_per_s", "horizon_s", "coverage", "age_s",
    ),
    QUIET_TOPIC: ("begin_s", "length_s", "probability", "speed_limit_m_per_s", "age_s"),
}  # fmt: skip


def encode_forecast(
    topic: str, origin_ns: int, frame_id: str, rows: Sequence[Mapping[str, float]]
) -> bytes:
    """Return a table of one of FORECAST_TOPICS, stamped with the origin [ROS time, ns].

    rows: values by column; a missing one is NaN.
    """
    described = templates.columns(" ".join(COLUMNS[topic]))
    points = np.zeros(len(rows), templates.point_type(described))
    for name in COLUMNS[topic]:
        points[name] = [row.get(name, math.nan) for row in rows]
    message: Any = templates.cloud(frame_id, len(rows), points.dtype)
    message.data = np.frombuffer(points.tobytes(), np.uint8)
    sec, nanosec = templates.split(origin_ns)
    message.header.stamp = new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    return serialise(message)
