"""Snapshot <-> standard messages as CDR bytes: pure functions, used by ROS and recording alike."""

from rope_twin.messages.cdr import decode, encode_text
from rope_twin.messages.diagnostics import statuses
from rope_twin.messages.encoder import Encoder
from rope_twin.messages.inputs import (
    encode_current,
    encode_cut,
    encode_elevation,
    encode_epoch,
    encode_heave,
    encode_lower_end,
    encode_measurement,
    encode_order,
    encode_pose,
)
from rope_twin.messages.reports import Level, Status, encode_diagnostics
from rope_twin.messages.templates import CloudReader, read_cloud

__all__ = [
    "CloudReader",
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
    "encode_lower_end",
    "encode_measurement",
    "encode_order",
    "encode_pose",
    "encode_text",
    "read_cloud",
    "statuses",
]
