"""The bytes are what ROS itself makes of them: decoded and encoded again by rclpy."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pytest
from sample_snapshot import hanging_body, rolled_ship

from rope_twin import messages
from rope_twin.alerts.alert_list import Alert, AlertList, Priority, Situation
from rope_twin.messages.cdr import encode_text
from rope_twin.messages.reports import (
    FIGURE_COLUMNS,
    FORECAST_TOPICS,
    STATES,
    encode_alerts,
    encode_estimate,
    encode_forecast,
)
from rope_twin.recording.session import encode_json
from rope_twin.topics import BY_NAME, TOPICS
from rope_twin.twin.winch.commands import WinchCommand

ONE_OF_EACH = [
    WinchCommand("speed", 0.3),
    WinchCommand("length", 350.0),
    WinchCommand("depth", 340.0),
    WinchCommand("tension", 1e5),
    WinchCommand("set_brake"),
]
STAMP_NS = 1_763_700_000_123_456_789
LEARNED = dict.fromkeys(FIGURE_COLUMNS.split(), 0.5) | {"name": "payload_drag", "state": STATES[0]}


def alerts_of(count: int) -> list[Alert]:
    """Return a list of so many alarms."""
    found = AlertList()
    places = (f"rope {k}" for k in range(count))
    found.update([Situation(10001, "tension", "A", one, Priority.ALARM, one) for one in places], 0)
    return found.listed()


def encoded(topic: str, nodes: int) -> bytes:
    snapshot = hanging_body(nodes)
    encoder = messages.Encoder(STAMP_NS)
    if topic in encoder.topics:
        return encoder.encode(topic, snapshot)
    return {
        "ship/heave": messages.encode_heave(STAMP_NS, 1.5, -0.25),
        "ship/odometry": messages.encode_pose(STAMP_NS, rolled_ship(STAMP_NS)),
        "lower_end/odometry": messages.encode_lower_end(
            STAMP_NS, (1.0, 2.0, -3.0), (0.1, 0.0, -0.2)
        ),
        "sea/elevation": messages.encode_elevation(STAMP_NS, -0.75),
        **dict(messages.encode_order(STAMP_NS, order, "aft") for order in ONE_OF_EACH),
        **dict([messages.encode_cut(STAMP_NS, 1500.0)]),
        "twin/epoch": messages.encode_epoch(STAMP_NS),
        "winch/seat": messages.encode_text("winch: console"),
        "twin/session": encode_json({"session": 1, "files": {"a.yaml": "about: ä\n"}}),
        "twin/inputs": encode_json({"number": 1, "calls": [["submit_heave", [1, 0.1, -0.0], {}]]}),
        **{
            name: encode_forecast(name, STAMP_NS, "map", nodes * [{"age_s": 0.2}])
            for name in FORECAST_TOPICS
        },
        "estimate/figures": encode_estimate(STAMP_NS, nodes * [LEARNED]),
        "estimate/alarms": encode_text("payload lost since 12.0 s"),
        "alerts": encode_alerts(STAMP_NS, STAMP_NS, alerts_of(nodes)),
        "diagnostics": messages.encode_diagnostics(STAMP_NS, messages.statuses(snapshot, None)),
    }[topic]


def plain(message: Any) -> Any:
    """A message of either library as dictionaries, lists and numbers."""
    if hasattr(message, "get_fields_and_field_types"):
        return {
            name: plain(getattr(message, name)) for name in message.get_fields_and_field_types()
        }
    if hasattr(message, "__msgtype__"):
        return {name: plain(getattr(message, name)) for name in message.__dataclass_fields__
                if name != "__msgtype__" and not name.isupper()}  # fmt: skip
    if isinstance(message, bytes):  # rclpy's `byte`
        return message[0]
    if isinstance(message, (list, tuple, np.ndarray)) or hasattr(message, "typecode"):
        return [plain(item) for item in message]
    return message


@pytest.mark.ros
@pytest.mark.parametrize("nodes", [2, 5, 102])
@pytest.mark.parametrize("topic", [t.name for t in TOPICS if t.publisher])
def test_rclpy_reads_and_writes_the_same_bytes(topic: str, nodes: int) -> None:
    serialization = importlib.import_module("rclpy.serialization")
    package, _, kind = BY_NAME[topic].type_name.split("/")
    message_type = getattr(importlib.import_module(f"{package}.msg"), kind)
    data = encoded(topic, nodes)
    message = serialization.deserialize_message(data, message_type)
    assert plain(message) == plain(messages.decode(topic, data))
    # equal but for what is in the padding, and for a tail that rmw reserves and does not use
    written = serialization.serialize_message(message)[: len(data)]
    assert len(written) == len(data)
    assert plain(messages.decode(topic, written)) == plain(message)
