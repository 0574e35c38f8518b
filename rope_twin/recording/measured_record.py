"""Measurements of a bag, passed to an unpaced run: line out, line speed, tensions, payload depth.

Stamps are placed in simulation time by the ROS time of t = 0: that of the replayed motion where it
comes from a bag with stamps of the same voyage, else that of the run that the bag recorded
(`twin/epoch`), else the first reading. The record is played once; nothing is made up after it.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from typing import Any

from rope_twin.errors import BagError, InputError, phrase
from rope_twin.messages import decode, encode_measurement
from rope_twin.messages.inputs import read_measurement
from rope_twin.messages.status import counted
from rope_twin.recording.bag import BagReader, find_bag
from rope_twin.topics import MEASURED_TOPICS
from rope_twin.twin.readings import (
    MOTOR,
    MOTOR_TENSION,
    PAYLOAD,
    PAYLOAD_DEPTH,
    WINCH_MEASURED,
    WINCH_SENSORS,
    Measurement,
)

_EPOCH = "twin/epoch"
_SECOND_NS = 1_000_000_000
APART_NS = 86_400 * _SECOND_NS  # readings further from t = 0 are of another voyage
GROUPS = {WINCH_SENSORS: WINCH_MEASURED, MOTOR: MOTOR_TENSION, PAYLOAD: PAYLOAD_DEPTH}


class MeasuredReplay:
    """Measurements by simulation time, in the order of their stamps."""

    def __init__(self, measurements: list[Measurement], source: str, note: str = "") -> None:
        """Keep measurements whose stamps are in simulation time [ns]."""
        self._measurements = sorted(measurements, key=lambda one: one.stamp_ns)
        self._stamps = [one.stamp_ns for one in self._measurements]
        self.source, self.note = source, note

    def between(self, from_ns: int, to_ns: int) -> list[Measurement]:
        """Return the measurements with from_ns <= stamp_ns < to_ns, in order."""
        first, end = bisect_left(self._stamps, from_ns), bisect_left(self._stamps, to_ns)
        return self._measurements[first:end]


def open_measured(bag: str, begins_ns: int = 0) -> MeasuredReplay:
    """Return the measurements of a bag; begins_ns: ROS time of t = 0, 0: by the bag itself.

    Raises:
        BagError: it is no bag, has no measurement, or none near the time of the motion.
    """
    path = find_bag(bag)
    with BagReader(path) as reader:
        found = list(_measurements(reader))
        epoch_ns = _epoch_ns(reader)
    where = f"bag {path}"
    readings = [one for one in found if isinstance(one, Measurement)]
    if not readings:
        right = f"name one with {', '.join(MEASURED_TOPICS)}, whose messages are stamped"
        faults = [one for one in found if isinstance(one, str)]
        raise BagError(phrase(where, faults[0] if faults else "it has no measurements", right))
    first_ns, last_ns = (pick(one.stamp_ns for one in readings) for pick in (min, max))
    zero_ns = begins_ns or epoch_ns or first_ns
    if last_ns < zero_ns or first_ns > zero_ns + APART_NS:
        early_s = (zero_ns - first_ns) * 1e-9
        what = (
            f"its readings begin {abs(early_s):.6g} s {'before' if early_s > 0 else 'after'} t = 0"
        )
        right = "heave and measurements must be of the same time, by one clock"
        raise BagError(phrase(where, what, right))
    counts = Counter(one.source for one in readings)
    parts = [counted(counts[source], group.replace("_", " ") + " reading")
             for source, group in GROUPS.items() if counts[source]]  # fmt: skip
    span = f"from {(first_ns - zero_ns) * 1e-9:.2f} to {(last_ns - zero_ns) * 1e-9:.2f} s"
    source = f"bag {path.name}: {', '.join(parts)}, {span}"
    wrong = Counter(one for one in found if isinstance(one, str))
    notes = [f"{where}: {counted(count, 'message')} left out: {words}"
             for words, count in wrong.most_common(3)]  # fmt: skip
    placed = [one._replace(stamp_ns=one.stamp_ns - zero_ns) for one in readings]
    return MeasuredReplay(placed, source, " ".join(notes))


def _measurements(reader: BagReader) -> Iterator[Measurement | str]:
    """Yield each measurement, stamped in ROS time, or why a message is none.

    Raises:
        BagError: a topic is there twice, in several namespaces.
    """
    for topic in MEASURED_TOPICS:
        names = [name for name in reader.topics if f"/{name}".endswith(f"/{topic}")]
        if len(names) > 1:
            what = f"{topic} is there in {len(names)} namespaces"
            right = f"keep one of {', '.join(names)}"
            raise BagError(phrase(f"bag {reader.path}", what, right))
        for name in names:
            for _, data in reader.messages(name):
                try:
                    one = read_measurement(topic, data)
                except InputError as error:
                    yield str(error)
                    continue
                yield one if one.stamp_ns > 0 else f"{topic}: its stamp is 0"


def _epoch_ns(reader: BagReader) -> int:
    """Return the ROS time of t = 0 of the run that the bag recorded; 0: none, or several."""
    names = [name for name in reader.topics if f"/{name}".endswith(f"/{_EPOCH}")]
    found: set[int] = set()
    for name in names:
        for _, data in reader.messages(name):
            stamp: Any = decode(_EPOCH, data)
            found.add(int(stamp.sec) * _SECOND_NS + int(stamp.nanosec))
    return found.pop() if len(found) == 1 else 0


def encoded(measurement: Measurement, epoch_ns: int) -> tuple[str, bytes]:
    """Return topic and message of a measurement of a run whose t = 0 is this ROS time."""
    return encode_measurement(epoch_ns + measurement.stamp_ns, measurement)
