"""Input border: checks messages from outside before they reach a twin.

A message that cannot be decoded, comes from a second sender of the ship motion, or from a node that
does not command the winch is rejected here, counted and reported. The twin itself checks whether
the values are plausible (`Twin.offer_*`). One sender of motion is used at a time; another one is
accepted once the first has been silent for SILENT_S.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.messages import Level, Status, decode
from rope_twin.messages.inputs import ORDER_FIELDS
from rope_twin.messages.templates import NANOSECONDS
from rope_twin.run.seat import Command, Seats
from rope_twin.scene.schema import WINCH
from rope_twin.scene.winch import SWITCHES
from rope_twin.topics import CUT_TOPIC, INPUTS, MOTION_TOPICS, ORDER_TOPICS, SWITCH_TOPIC
from rope_twin.twin.input_queue import InputQueue
from rope_twin.twin.motion.ship_pose import ShipPose
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import (
    COMMANDER_EVENTS,
    DEPTH,
    EMERGENCY_STOP,
    LENGTH,
    SPEED,
    TENSION,
    WinchCommand,
)

SILENT_S = 0.5  # silence of the sender of motion after which another one is accepted
REPORTED_S = 60.0  # how long a rejection keeps its row above OK
MESSAGES_ROW, SENDERS_ROW = "simulation: messages", "simulation: senders"

Content = TypeVar("Content")


class Refusals:
    """Rejected messages of one topic: total, those of the last REPORTED_S, and the last reason."""

    def __init__(self) -> None:
        self.count = 0
        self.note = ""
        self._recent: deque[float] = deque(maxlen=100_000)

    def add(self, note: str, now_s: float) -> None:
        """Count a rejected message."""
        self.count, self.note = self.count + 1, note
        self._recent.append(now_s)

    def recent(self, now_s: float) -> int:
        """Return how many were rejected in the last REPORTED_S."""
        while self._recent and self._recent[0] < now_s - REPORTED_S:
            self._recent.popleft()
        return len(self._recent)


class MotionSender:
    """Selects one of several senders of a motion topic.

    A sender that replaces another, as after a restart, is ignored for SILENT_S and then accepted.
    """

    def __init__(self) -> None:
        self._sender: object = None
        self._heard_s = -math.inf
        self._refused = False  # whether another one was rejected since the last accepted message
        self.mixed = False  # whether two senders have sent in turn

    def admit(self, sender: object, now_s: float) -> bool:
        """Return whether a message of this sender is accepted; `sender` is any identifier."""
        if sender != self._sender and now_s - self._heard_s < SILENT_S:
            self._refused = True
            return False
        self.mixed = self.mixed or (self._refused and sender == self._sender)
        self._sender, self._heard_s, self._refused = sender, now_s, False
        return True


class InputBorder:
    """Decodes messages, from any thread, and queues their content for the twin.

    A faulty message raises nothing: it is counted and reported in `rows`.
    """

    def __init__(
        self,
        twin: Twin,
        inputs: InputQueue,
        priority: str,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """Make the border of a twin.

        `priority`: names of commanding nodes, highest first; `now_s`: a steady clock.
        """
        self._twin, self._inputs, self._now_s = twin, inputs, now_s
        self._lock = threading.Lock()
        self._malformed = {name: Refusals() for name in INPUTS}
        self._strangers = {name: Refusals() for name in MOTION_TOPICS}
        self._senders = {name: MotionSender() for name in MOTION_TOPICS}
        self._ignored = 0
        self.seats = Seats(
            twin.scene, priority, lambda order, winch: self._command(None, order, winch), now_s
        )
        self.epoch_ns: int | None = None  # ROS time of t = 0; None: all inputs are ignored

    def take_motion(
        self, topic: str, data: bytes, sender: object = None, received_ns: int | None = None
    ) -> None:
        """Accept or reject a message on one of MOTION_TOPICS.

        Args:
            topic: topic of the message.
            data: the message as CDR.
            sender: any identifier of its publisher.
            received_ns: ROS time of its arrival; None: not known.
        """
        content = self._read(topic, lambda: _MOTION_READERS[topic](data))
        if content is None or (epoch_ns := self._epoch()) is None:
            return
        with self._lock:
            now_s = self._now_s()
            if not self._senders[topic].admit(sender, now_s):
                right = "stop one of the two senders"
                note = phrase(topic, "a second sender publishes it too and is ignored", right)
                self._strangers[topic].add(note, now_s)
                return
        arrival_ns = None if received_ns is None else received_ns - epoch_ns
        stamp_ns, sample = content
        if isinstance(sample, ShipPose):
            self._inputs.offer_pose(replace(sample, stamp_ns=stamp_ns - epoch_ns), arrival_ns)
        else:
            self._inputs.offer_heave(stamp_ns - epoch_ns, *sample, arrival_ns)

    def take_order(
        self, topic: str, data: bytes, sender: str | None = None, publisher: str = ""
    ) -> None:
        """Accept or reject a message on one of WINCH_TOPICS.

        Args:
            topic: topic of the message.
            data: the message as CDR.
            sender: name of its node, which must have the winch's seat; None: not checked.
            publisher: name of the sender while its node was not known.
        """
        content = self._read(topic, lambda: read_order(topic, data))
        if content is None or (epoch_ns := self._epoch()) is None:
            return
        stamp_ns, order, name = content
        at_ns = None if stamp_ns is None else stamp_ns - epoch_ns
        if sender is not None:
            winch, now_ns = self._twin.inputs.winch_called(name), self._twin.time_ns
            command = Command(order, at_ns, sender, publisher)
            admitted = self.seats.admit(winch, command, now_ns)
            if admitted is None:
                return
            at_ns = admitted.stamp_ns
        self._command(at_ns, order, name)

    def switch(self, winch: str, kind: str) -> tuple[bool, str]:
        """Execute a switch that comes by a service immediately; return success and text."""
        if self._epoch() is None:
            return False, f"winch {winch}: '{kind}' ignored, the simulation is not active"
        refusal = self.seats.permit(winch, kind)
        if refusal:
            return False, refusal
        self._command(None, WinchCommand(kind), winch)
        return True, f"winch {winch}: {kind.replace('_', ' ')}"

    def take_cut(self, data: bytes) -> None:
        """Accept or reject a ropes/cut message."""
        content = self._read(CUT_TOPIC, lambda: read_cut(data))
        if content is not None and (epoch_ns := self._epoch()) is not None:
            stamp_ns, below_m, rope = content
            at_ns = None if stamp_ns is None else stamp_ns - epoch_ns
            self._inputs.offer_cut(at_ns, below_m, rope)

    def take_current(self, data: bytes) -> None:
        """Accept or reject a `current` message; it has no stamp and applies from now on."""
        content = self._read("current", lambda: read_current(data))
        if content is not None:
            self._inputs.offer_current(content)

    def rows(self) -> list[Status]:
        """Return the diagnostics rows of seats, messages and senders."""
        with self._lock:
            now_s = self._now_s()
            ignored = self._ignored + self._inputs.refused
            return [
                *self.seats.rows(),
                _messages_row(self._malformed, ignored, now_s),
                _senders_row(self._strangers, now_s),
            ]

    @property
    def mixed(self) -> str:
        """Return in words which motion several senders sent in turn; "": none."""
        names = [name for name, one in self._senders.items() if one.mixed]
        return f"{', '.join(names)}: several senders, one of them used" if names else ""

    def _command(self, at_ns: int | None, order: WinchCommand, winch: str) -> None:
        self._inputs.offer_command(at_ns, order, winch)

    def _read(self, topic: str, read: Callable[[], Content]) -> Content | None:
        """Return the content of a message; count a malformed one and return None."""
        try:
            return read()
        except InputError as error:
            with self._lock:
                self._malformed[topic].add(str(error), self._now_s())
            return None

    def _epoch(self) -> int | None:
        """Return the epoch; if there is none, count the input as ignored and return None."""
        epoch_ns = self.epoch_ns
        if epoch_ns is None:
            self._ignored += 1
        return epoch_ns


def _messages_row(malformed: dict[str, Refusals], ignored: int, now_s: float) -> Status:
    """Return the row on malformed messages, and on inputs ignored while not active."""
    values = {topic: str(refused.count) for topic, refused in malformed.items()}
    values["ignored while not active"] = str(ignored)
    recent = {topic: count for topic, one in malformed.items() if (count := one.recent(now_s))}
    if not recent:
        total = sum(refused.count for refused in malformed.values())
        words = "all messages well formed"
        if total:
            words = f"{total} malformed since the start, none in the last {REPORTED_S:g} s"
        return Status(MESSAGES_ROW, Level.OK, words, values)
    notes = " ".join(malformed[topic].note for topic in recent)
    message = f"{sum(recent.values())} malformed and rejected in the last {REPORTED_S:g} s; "
    return Status(MESSAGES_ROW, Level.WARN, f"{message}last per topic: {notes}", values)


def _senders_row(strangers: dict[str, Refusals], now_s: float) -> Status:
    """Return the row on second senders of the ship motion."""
    values = {f"{topic}: of others": str(one.count) for topic, one in strangers.items()}
    notes = [one.note for one in strangers.values() if one.recent(now_s)]
    if notes:
        return Status(SENDERS_ROW, Level.ERROR, " ".join(notes), values)
    return Status(SENDERS_ROW, Level.OK, "one sender of ship motion", values)


def read_heave(data: bytes) -> tuple[int, tuple[float, float]]:
    """Return ROS stamp [ns], heave [m] and heave rate [m/s] of a ship/heave message.

    Raises:
        InputError: if the bytes are not such a message, or its stamp is invalid.
    """
    message = decode("ship/heave", data)
    stamp_ns = _stamp_ns("ship/heave", message.header.stamp)
    return stamp_ns, (message.pose.pose.position.z, message.twist.twist.linear.z)


def read_pose(data: bytes) -> tuple[int, ShipPose]:
    """Return the ROS stamp [ns] of a ship/odometry message, and its pose, stamped with 0.

    Raises:
        InputError: if the bytes are not such a message, or its stamp is invalid.
    """
    message = decode("ship/odometry", data)
    stamp_ns = _stamp_ns("ship/odometry", message.header.stamp)
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    speed, rate = message.twist.twist.linear, message.twist.twist.angular
    return stamp_ns, ShipPose(
        0,
        (place.x, place.y, place.z),
        (speed.x, speed.y, speed.z),
        (turn.x, turn.y, turn.z, turn.w),
        (rate.x, rate.y, rate.z),
    )


_MOTION_READERS: dict[str, Callable[[bytes], tuple[int, ShipPose | tuple[float, float]]]] = {
    "ship/heave": read_heave,
    "ship/odometry": read_pose,
}


def read_order(topic: str, data: bytes) -> tuple[int | None, WinchCommand, str]:
    """Return ROS stamp [ns] (None: apply immediately), command and winch of a winch message.

    Raises:
        InputError: if the bytes are not such a message, its stamp is invalid, or it does not carry
            exactly one value (or switch) of the topic's kind.
    """
    message = decode(topic, data)
    names = [str(name) for name in message.name]
    if topic == SWITCH_TOPIC and names[1:] == [EMERGENCY_STOP]:
        # never rejected for its stamp: an invalid one is replaced by a past time, and is flagged
        stamp = message.header.stamp
        stamp_ns = _stamp_ns(topic, stamp) if 0 <= stamp.nanosec < NANOSECONDS else 1
    else:
        stamp_ns = _stamp_ns(topic, message.header.stamp)
    winch = names[0] if names else WINCH
    if topic == SWITCH_TOPIC:
        if len(names) != 2:
            right = f"give two: the winch's, and one of {', '.join(SWITCHES)}"
            raise InputError(phrase(topic, f"{len(names)} names", right))
        if names[1] in COMMANDER_EVENTS:  # internal commands, not allowed in a message
            right = did_you_mean(names[1], SWITCHES)
            raise InputError(phrase(topic, f"'{names[1]}' is not a switch", right))
        return stamp_ns or None, WinchCommand(names[1]), winch
    kind = next(kind for kind, own in ORDER_TOPICS.items() if own == topic)
    values = getattr(message, ORDER_FIELDS[kind])
    if len(values) != 1:
        plural, right = _VALUES[kind]
        raise InputError(phrase(topic, f"{len(values)} {plural}", right))
    return stamp_ns or None, WinchCommand(kind, float(values[0])), winch


_VALUES = {  # name of the value in the plural, and its meaning
    SPEED: ("velocities", "there must be exactly one, the pay-out rate"),
    LENGTH: ("positions", "there must be exactly one, the line out to stop at"),
    DEPTH: ("positions", "there must be exactly one, the payload's depth to stop at"),
    TENSION: ("efforts", "there must be exactly one, the tension set-point"),
}


def read_cut(data: bytes) -> tuple[int | None, float, str]:
    """Return ROS stamp [ns] (None: at once), length above the cut [m] and rope of a ropes/cut.

    Raises:
        InputError: if the bytes are not such a message, its stamp is invalid, or it does not carry
            exactly one position.
    """
    message = decode(CUT_TOPIC, data)
    stamp_ns = _stamp_ns(CUT_TOPIC, message.header.stamp)
    if len(message.position) != 1:
        right = "there must be exactly one, the length of rope between hang-off and cut"
        raise InputError(phrase(CUT_TOPIC, f"{len(message.position)} positions", right))
    rope = str(message.name[0]) if len(message.name) else ""
    return stamp_ns or None, float(message.position[0]), rope


def read_current(data: bytes) -> NDArray[np.float64]:
    """Return the rows (k, 3) of z [m], east and north [m/s] of a `current` message.

    Raises:
        InputError: if the bytes are not such a message or its layout is not k rows of 3.
    """
    message = decode("current", data)
    numbers = np.asarray(message.data, dtype=np.float64)
    sizes = [int(dimension.size) for dimension in message.layout.dim]
    offset = int(message.layout.data_offset)
    fits = len(numbers) > 0 and len(numbers) % 3 == 0 and offset == 0
    if sizes and fits:
        rows = len(numbers) // 3
        fits = sizes in ([rows, 3], [len(numbers)]) and math.prod(sizes) == len(numbers)
    if not fits:
        raise InputError(
            phrase(
                "current",
                f"{len(numbers)} numbers with a layout of {sizes or 'no'} dimensions "
                f"and offset {offset}",
                "it must be rows of z, east, north: sizes [k, 3] (or none), offset 0",
            )
        )
    return numbers.reshape(-1, 3)


def _stamp_ns(topic: str, stamp: Any) -> int:
    if not 0 <= stamp.nanosec < NANOSECONDS:
        raise InputError(
            phrase(topic, f"a stamp with {stamp.nanosec} ns", "they must be below 1000000000")
        )
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)
