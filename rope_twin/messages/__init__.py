"""Snapshot <-> standard messages as CDR bytes: pure functions, used by ROS and recording alike."""

from typing import Any

from rosbags.serde import SerdeError

from rope_twin import topics as _topics
from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.messages.cdr import deserialise
from rope_twin.messages.diagnostics import Level, Status, encode_diagnostics, statuses
from rope_twin.messages.encoder import Encoder
from rope_twin.messages.inputs import (
    encode_current,
    encode_cut,
    encode_elevation,
    encode_epoch,
    encode_heave,
    encode_order,
    encode_pose,
    encode_seat,
)
from rope_twin.messages.templates import read_cloud

__all__ = [
    "Encoder",
    "Level",
    "Status",
    "decode",
    "encode_current",
    "encode_cut",
    "encode_diagnostics",
    "encode_elevation",
    "encode_epoch",
    "encode_heave",
    "encode_order",
    "encode_pose",
    "encode_seat",
    "read_cloud",
    "statuses",
]


def decode(topic_name: str, data: bytes | memoryview) -> Any:
    """Return the message in the bytes of one of the suite's topics (a leading slash is allowed).

    Raises:
        InputError: if the topic is not in the table, or the bytes are no message of its type.
    """
    name = topic_name.removeprefix("/")
    topic = _topics.BY_NAME.get(name)
    if topic is None:
        raise InputError(
            phrase("decode", f"unknown topic '{name}'", did_you_mean(name, _topics.BY_NAME))
        )
    try:
        return deserialise(topic.type_name, data)
    except SerdeError as error:
        raise InputError(
            phrase(
                f"topic {name}",
                f"{len(data)} bytes that do not decode ({error})",
                f"it must be a {topic.type_name} in CDR",
            )
        ) from error
