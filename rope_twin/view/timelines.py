"""The two timelines of the view: simulation time and ROS time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

TWIN_TIME = "twin_time"  # a duration: 0 at the start of the simulation
ROS_TIME = "ros_time"  # a date


class Timelines:
    """Sets rerun's two timelines to a ROS time."""

    def __init__(self, stream: Any, epoch_ns: int) -> None:
        self._stream = stream
        self.epoch_ns = epoch_ns

    def set(self, time_ns: int) -> None:
        """Set the ROS time of whatever this thread logs next."""
        since = np.timedelta64(time_ns - self.epoch_ns, "ns")
        self._stream.set_time(TWIN_TIME, duration=since)
        self._stream.set_time(ROS_TIME, timestamp=np.datetime64(time_ns, "ns"))

    def columns(self, times_ns: NDArray[np.int64]) -> list[Any]:
        """Return the timelines of a batch of samples (n,)."""
        import rerun as rr

        since = (times_ns - self.epoch_ns).astype("timedelta64[ns]")
        return [
            rr.TimeColumn(TWIN_TIME, duration=since),
            rr.TimeColumn(ROS_TIME, timestamp=times_ns.astype("datetime64[ns]")),
        ]
