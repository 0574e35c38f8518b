"""A view that is fed by topic and writes a recording, and the content of that recording."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from rerun.chunk import RrdReader
from sample_snapshot import hanging_rope

from rope_twin import messages
from rope_twin.view.rope_view import RopeView
from rope_twin.view.sinks import FileSink

ROPE_TOPICS = (
    "ropes/tension_top", "ropes/tension_bottom", "ropes/length", "ropes/element_tension",
    "ropes/nodes",
)  # fmt: skip
EPOCH_NS = 1_763_700_000_000_000_000


class Recorded:
    """The rows of a finished .rrd, by entity."""

    def __init__(self, path: Path) -> None:
        self._rows: dict[str, list[pa.RecordBatch]] = defaultdict(list)
        reader = RrdReader(path)
        for chunk in reader.stream():
            self._rows[chunk.entity_path.lstrip("/")].append(chunk.to_record_batch())
        self.blueprints = len(reader.blueprints())

    @property
    def entities(self) -> set[str]:
        return set(self._rows)

    def column(self, entity: str, name: str) -> list[Any]:
        return [
            value
            for batch in self._rows[entity]
            if name in batch.schema.names
            for value in batch.column(name).to_pylist()
        ]

    def seconds(self, entity: str) -> list[float]:
        found = [
            batch.column("twin_time").cast(pa.int64()).to_numpy() * 1e-9
            for batch in self._rows[entity]
            if "twin_time" in batch.schema.names
        ]
        return sorted(np.concatenate(found).tolist()) if found else []


class Session:
    """View into a file, fed by topic."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.encoder = messages.Encoder(EPOCH_NS)
        self.view = RopeView(FileSink(path, footer=True))

    def epoch(self) -> None:
        self.show("twin/epoch", messages.encode_epoch(EPOCH_NS), EPOCH_NS)

    def show(self, topic: str, data: bytes, time_ns: int) -> None:
        self.view.show(topic, messages.decode(topic, data), time_ns)

    def rope(self, time_s: float, late_s: float = 0.15, **changes: Any) -> None:
        snapshot = replace(hanging_rope(21, time_s=time_s), **changes)
        for topic in ROPE_TOPICS:
            arrived_ns = EPOCH_NS + snapshot.stamp_ns + round(late_s * 1e9)
            self.show(topic, self.encoder.encode(topic, snapshot), arrived_ns)

    def finish(self) -> Recorded:
        self.view.close()
        return Recorded(self._path)
