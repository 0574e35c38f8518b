"""Snapshot -> CDR bytes of how the rope shakes and of the fatigue that it has used."""

from __future__ import annotations

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.messages import forms
from rope_twin.messages.cdr import Templates
from rope_twin.twin.results import RopeVibration
from rope_twin.twin.snapshot import Snapshot

COLUMNS = ("from_lower_end_m", "from_hang_off_m", "used")


class WatchForms:
    """Holds the templates of these topics; one per encoder."""

    def __init__(self, frame_id: str) -> None:
        self._frame_id = frame_id
        self._sized = Templates()

    def vibration(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """x, y, z of each node, and amplitude, frequency and drag there."""
        shaking = snapshot.vibration
        if shaking is None:
            raise InputError(phrase("encode", "the snapshot has no vibration", "ask for it"))
        columns = vibration_columns(shaking)
        place = snapshot.node_position_m
        key = (len(place), ("x", "y", "z", *columns))
        template = self._sized.get("rope/vibration", key, lambda: forms.cloud(self._frame_id, *key))
        points = np.column_stack([place, *columns.values()]).astype("<f4")
        return template.fill({**stamp, "data": points.view(np.uint8).ravel()})

    def fatigue(self, snapshot: Snapshot) -> bytes:
        """Rows of COLUMNS, one for each metre."""
        wear = snapshot.fatigue
        if wear is None:
            raise InputError(phrase("encode", "the snapshot has no fatigue", "ask for it"))
        count = len(wear.used)
        template = self._sized.get(
            "rope/fatigue", count, lambda: forms.table_of_numbers("metre", count, COLUMNS)
        )
        table = np.column_stack([wear.from_lower_end_m, wear.from_hang_off_m, wear.used])
        return template.fill({"data": table.ravel()})


def vibration_columns(shaking: RopeVibration) -> dict[str, np.ndarray]:
    """What the cloud holds besides the places, by name."""
    columns = {"cross_flow": shaking.cross_flow, "cross_flow_hz": shaking.cross_flow_hz}
    if shaking.in_line is not None and shaking.in_line_hz is not None:
        columns |= {"in_line": shaking.in_line, "in_line_hz": shaking.in_line_hz}
    return columns | {"drag_amplification": shaking.drag_amplification}
