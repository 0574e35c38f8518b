"""Reader of the stamped messages of one topic of a bag, with selection of the valid ones.

No fault is corrected silently: skipped messages are counted and reported in notes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError

from rope_twin.errors import BagError, did_you_mean, phrase
from rope_twin.messages.cdr import deserialise, table
from rope_twin.recording.bag_reader import BagReader, TopicContent

Vector = NDArray[np.float64]
Stamps = NDArray[np.int64]
Table = NDArray[np.float64]
Faults = dict[str, NDArray[np.bool_]]  # by what is wrong: which rows

_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
GAP_PERIODS = 3.0  # an interval this many times the usual one is a gap
_TOLERATED_SHARE = 0.05  # of samples that cannot be used
_LONGEST_GAP_S = 60.0  # beyond it, it is the clock that jumped, or two recordings


def choose_topic(bag: BagReader, topic: str | None, usual: str, types: Sequence[str]) -> str:
    """Return the suitable topic: `topic`, or the one of the usual name, or the only one.

    usual: its name in this suite, like ship/heave, whose last words name what is wanted.

    Raises:
        BagError: there is none, or it is of another type, or there are several.
    """
    where, wanted = f"bag {bag.path}", usual.rpartition("/")[2]
    topics: Mapping[str, TopicContent] = bag.topics
    fitting = [name for name, content in topics.items() if content.type_name in types]
    right = " or ".join(types)
    if topic is not None:
        name = topic if topic in topics else f"/{topic}"
        if name not in topics:
            near = did_you_mean(topic, topics) if topics else "the bag is empty"
            raise BagError(phrase(where, f"it has no topic '{topic}'", near))
        if name not in fitting:
            what = f"topic {name} is a {topics[name].type_name}"
            raise BagError(phrase(where, what, f"{wanted} must be a {right}"))
        return name
    named = [name for name in fitting if f"/{name}".endswith(f"/{usual}")]
    for found in (named, fitting):
        if len(found) == 1:
            return found[0]
    if fitting:
        what = f"several topics could be the {wanted}: {', '.join(sorted(fitting))}"
        raise BagError(phrase(where, what, "name one of them"))
    held = ", ".join(f"{name} ({content.type_name})" for name, content in sorted(topics.items()))
    raise BagError(phrase(where, f"no topic is a {right}", f"it holds {held or 'nothing'}"))


class StampedRows:
    """The samples of a topic as they come, and the judgement on them."""

    def __init__(self, bag: BagReader, topic: str, wanted: str, fields: Sequence[str]) -> None:
        """Read all messages; fields: the numbers wanted of each, like `pose.pose.position.z`.

        Raises:
            BagError: the bag turns out to be damaged.
        """
        self.where = f"bag {bag.path}, topic {topic}"
        self.notes: list[str] = []
        self.skipped = 0
        self._wanted = wanted
        self._content = bag.topics[topic]
        messages = list(bag.messages(topic))
        kept, rows = self._read([data for _, data in messages], [*_STAMP, *fields])
        log_ns = np.array([messages[k][0] for k in kept], dtype=np.int64)
        header_ns = rows[:, 0].astype(np.int64) * 1_000_000_000 + rows[:, 1].astype(np.int64)
        self._stamps, self._values = (header_ns, log_ns), rows[:, len(_STAMP) :]
        self._undecodable = len(messages) - len(kept)

    def _read(self, messages: list[bytes], paths: list[str]) -> tuple[Sequence[int], Table]:
        """Return the numbers of those messages that can be decoded, and their indices."""
        if not messages:
            return (), np.empty((0, len(paths)))
        try:
            found = table(self._content.type_name, messages, paths)
        except SerdeError:
            found = None  # the first message is damaged
        if found is not None:
            return range(len(messages)), found
        kept, rows, read = [], [], attrgetter(*paths)
        for number, data in enumerate(messages):
            try:
                rows.append(read(deserialise(self._content.type_name, data)))
            except SerdeError:
                continue
            kept.append(number)
        return kept, np.array(rows, dtype=np.float64).reshape(len(kept), len(paths))

    def usable(self, judge: Callable[[Table], Faults] | None = None) -> tuple[Stamps, Table]:
        """Return stamps (n,), rising, and values (n, k), finite and without the faults found by
        `judge`.

        Raises:
            BagError: few are left, or time has a hole.
        """
        total = len(self._values) + self._undecodable
        if total == 0:
            right = f"{self._wanted} needs at least 2"
            raise BagError(phrase(self.where, "it holds no message", right))
        stamp_ns, log_ns = self._stamps
        if 2 * np.count_nonzero(stamp_ns) < len(stamp_ns):
            stamp_ns = log_ns
            self.notes.append(f"{self.where}: headers without a stamp, times are those of the log.")
        values = self._values
        keep, faults = _judge(stamp_ns, values, judge(values) if judge else {})
        if self._undecodable:
            faults["that do not decode"] = self._undecodable
        self._tell_skipped(faults, total, int(keep.sum()))
        self.notes.append(self._tell_gaps(stamp_ns[keep]))
        return stamp_ns[keep], values[keep]

    def _tell_skipped(self, faults: dict[str, int], total: int, kept: int) -> None:
        self.skipped = sum(faults.values())
        told = ", ".join(f"{count} {fault}" for fault, count in faults.items() if count)
        if kept < 2 or self.skipped > _TOLERATED_SHARE * total:
            what = f"{self.skipped} of {total} samples cannot be used ({told or 'too few'})"
            right = f"right are 2 or more, at most {_TOLERATED_SHARE:.0%} bad"
            raise BagError(phrase(self.where, what, right))
        if self.skipped:
            self.notes.append(f"{self.where}: skipped {self.skipped} of {total} samples ({told}).")
        promised = self._content.messages
        if total < promised:
            self.notes.append(f"{self.where}: of {promised} messages promised {total} are there.")

    def _tell_gaps(self, stamp_ns: Stamps) -> str:
        steps = np.diff(stamp_ns)
        gaps = steps > GAP_PERIODS * np.median(steps)
        if not np.any(gaps):
            return ""
        longest = int(np.argmax(steps))
        at_s = float(stamp_ns[longest] - stamp_ns[0]) * 1e-9
        told = f"the longest {steps[longest] * 1e-9:.4g} s at {at_s:.3f} s"
        if steps[longest] > _LONGEST_GAP_S * 1e9:
            right = f"right is one recording without a gap above {_LONGEST_GAP_S:g} s"
            raise BagError(phrase(self.where, f"gaps in time, {told}", right))
        return f"{self.where}: gaps in time: {int(gaps.sum())}, {told}."


def _judge(
    stamp_ns: Stamps, values: Table, others: Faults
) -> tuple[NDArray[np.bool_], dict[str, int]]:
    """Return which samples are valid and later than all before, and the counted faults."""
    finite = np.all(np.isfinite(values), axis=1)
    stamped = stamp_ns != 0
    keep = finite & stamped
    faults = {
        "not finite": int((~finite).sum()),
        "without a stamp": int((finite & ~stamped).sum()),
    }
    for fault, rows in others.items():
        faults[fault] = int((keep & rows).sum())
        keep &= ~rows
    latest = np.iinfo(np.int64).min
    repeated = backward = 0
    for index in np.flatnonzero(keep):
        stamp = int(stamp_ns[index])
        if stamp > latest:
            latest = stamp
            continue
        keep[index] = False
        repeated += stamp == latest
        backward += stamp < latest
    faults["with a repeated stamp"] = repeated
    faults["with a stamp that goes back"] = backward
    return keep, faults
