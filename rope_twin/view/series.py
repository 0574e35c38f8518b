"""Time history of a scalar; samples are passed to rerun in batches, so that every one is kept."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rope_twin.view.timelines import Timelines

LIVE_BATCH_NS = 200_000_000  # 5 calls per second and curve, whatever the rate of its topic
FILE_BATCH_NS = 5_000_000_000  # few large batches: small files that open quickly


class Series:
    """One curve of a plot."""

    def __init__(self, stream: Any, timelines: Timelines, path: str, batch_ns: int) -> None:
        import rerun as rr

        self._stream = stream
        self._timelines = timelines
        self._path = path
        self._batch_ns = batch_ns
        self.least, self.most = math.inf, -math.inf  # of all finite samples
        self._columns = rr.Scalars.columns
        self._times: list[int] = []
        self._values: list[float] = []

    def add(self, time_ns: int, value: float) -> None:
        """Add a sample at a ROS time."""
        self._times.append(time_ns)
        self._values.append(value)
        if math.isfinite(value):
            self.least, self.most = min(self.least, value), max(self.most, value)
        if abs(time_ns - self._times[0]) >= self._batch_ns:
            self.flush()

    def style(self, name: str, rgb: str) -> None:
        """Set name and colour (six hexadecimal digits) of the curve."""
        import rerun as rr

        line = rr.SeriesLines(names=name, colors=int(rgb + "ff", 16), widths=1.5)
        self._stream.log(self._path, line, static=True)

    def dots(self, name: str, rgb: str) -> None:
        """Draw the curve as dots with this name and colour: samples with gaps are not joined."""
        import rerun as rr

        dots = rr.SeriesPoints(names=name, colors=int(rgb + "ff", 16), marker_sizes=2.5)
        self._stream.log(self._path, dots, static=True)

    def flush(self) -> None:
        """Pass the pending samples to rerun."""
        if not self._times:
            return
        self._stream.send_columns(
            self._path,
            indexes=self._timelines.columns(np.array(self._times, dtype=np.int64)),
            columns=self._columns(scalars=self._values),
        )
        self._times.clear()
        self._values.clear()
