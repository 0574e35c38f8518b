"""Input border: checks messages from outside before they reach a twin.

A message that cannot be decoded, comes from a second sender of the ship motion, or from a node that
does not command the winch is rejected here, counted and reported, and so are the values of a second
sender of a measured quantity. The twin itself checks whether the values are plausible
(`Twin.submit_*`). One sender is used at a time; another one is accepted once the first has been
silent for SILENT_S, or for INTERVALS of a slow sensor's own intervals.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Hashable
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rope_twin import topics
from rope_twin.errors import InputError, counted, phrase
from rope_twin.messages import Level, Status
from rope_twin.messages.inputs import (
    read_current,
    read_cut,
    read_heave,
    read_lower_end,
    read_measurement,
    read_order,
    read_pose,
)
from rope_twin.messages.reports import SCORE, read_risks
from rope_twin.run.seat import Command, Seats
from rope_twin.twin.input_queue import InputQueue
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.readings import Measurement, Row
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import EMERGENCY_STOP, WinchCommand

SILENT_S = 0.5  # silence of a sender after which another one is accepted ...
INTERVALS, LONGEST_S = 3.0, 10.0  # ... or so many intervals of a measured quantity, up to so long
MAX_SENSORS = 1000  # quantities of winches of which the sender is selected
REPORTED_S = 60.0  # how long a rejection keeps its row above OK
REMARK_S = 5.0  # between two remarks to the twin
LATE_S = 2.0  # after its sending a command is not executed at once any more; less than the time
# after which a console reports that it has no effect
MAX_SENDERS = 1000  # whose clocks are known
STEADY_S, JITTER_S = 1.0, 0.25  # messages of one age for so long show how far a clock lags
CLOCK_DRIFT = 1e-4  # by which a lag may grow [s/s]
_DEPTH, _QUANTITIES = "depth", ("line out", "line speed", "tension")  # values of a row
MESSAGES_ROW, SENDERS_ROW = "simulation: messages", "simulation: senders"

Content = TypeVar("Content")


class SenderLags:
    """How far the clocks of senders lag, by the ages of their messages.

    What waited, in the middleware or on its way, comes at one moment and is of many ages.
    """

    def __init__(self) -> None:
        self._lags: dict[Hashable, tuple[float, float]] = {}  # lag and when it held [s]
        self._first: dict[Hashable, tuple[float, float]] = {}  # an age, and since when [s]

    def since_sent_s(self, sender: Hashable, age_s: float, now_s: float) -> float:
        """Return the time since a message was sent [s].

        age_s: the same by the sender's clock; now_s: time of an own steady clock.
        """
        if (known := self._lags.get(sender)) is not None:
            lag_s, held_s = known
            lag_s = min(age_s, lag_s + CLOCK_DRIFT * (now_s - held_s))
            self._lags[sender] = lag_s, now_s
            return age_s - lag_s
        if sender not in self._first and len(self._first) >= MAX_SENDERS:
            del self._first[next(iter(self._first))]
        first_s, since_s = self._first.setdefault(sender, (age_s, now_s))
        if abs(age_s - first_s) > JITTER_S:
            self._first[sender] = age_s, now_s
        elif now_s - since_s >= STEADY_S:
            if len(self._lags) >= MAX_SENDERS:
                del self._lags[next(iter(self._lags))]
            self._lags[sender] = age_s, now_s
            return 0.0
        return age_s


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


class SelectedSender:
    """Selects one of several senders of a motion topic, or of a measured quantity.

    A sender that replaces another, as after a restart, is ignored until the first has been silent
    for long enough, and then accepted.
    """

    def __init__(self, longest_s: float = SILENT_S) -> None:
        """Set the longest silence after which another sender is accepted [s]."""
        self._longest_s = longest_s
        self._silent_s = SILENT_S
        self._sender: object = None
        self._heard_s = -math.inf
        self._refused = False  # whether another one was rejected since the last accepted message
        self.mixed = False  # whether two senders have sent in turn

    def admit(self, sender: object, now_s: float) -> bool:
        """Return whether a message of this sender is accepted; `sender` is any identifier."""
        quiet_s = now_s - self._heard_s
        if sender != self._sender:
            if quiet_s < self._silent_s:
                self._refused = True
                return False
            quiet_s = 0.0
        self.mixed = self.mixed or (self._refused and sender == self._sender)
        self._silent_s = min(max(SILENT_S, INTERVALS * quiet_s), self._longest_s)
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
        self._malformed = {name: Refusals() for name in (*topics.INPUTS, topics.FORECAST_RISK)}
        self._late = Refusals()  # commands
        self._strangers = {
            name: Refusals() for name in (*topics.MOTION_TOPICS, *topics.MEASURED_TOPICS)
        }
        self._senders = {name: SelectedSender() for name in topics.MOTION_TOPICS}
        # by topic, winch and number of the quantity in a row
        self._sensors: dict[tuple[str, str, int], SelectedSender] = {}
        self._ignored = 0
        self.latched: set[str] = set()  # winches whose stop waits for the simulation to go on
        self._remarked_s = -math.inf
        order = partial(inputs.submit_command, None)
        self.seats = Seats(twin.scene, priority, order, now_s)
        # called with each measurement that could be decoded, in twin time; None: no listener
        self.listener: Callable[[Measurement], None] | None = None
        # called with stamp [ns] and height [m] of each sample of motion
        self.motion_listener: Callable[[int, float], None] | None = None
        # called with all winches whose stop is latched, at each new one; None: no listener
        self.latch_listener: Callable[[set[str]], None] | None = None
        self._epoch_ns: int | None = None
        self._begun_ns = -math.inf  # twin time at the end of the last pause or restart
        self._held_current: NDArray[np.float64] | None = None  # newest profile of a pause
        self.motion_ns: int | None = None  # twin time of the newest sample of ship motion
        self.lower_end_ns: int | None = None  # likewise of the motion of the lower end

    @property
    def epoch_ns(self) -> int | None:
        """ROS time of t = 0 [ns]; None: inputs are ignored, but for a current profile and stops."""
        return self._epoch_ns

    @epoch_ns.setter
    def epoch_ns(self, epoch_ns: int | None) -> None:
        self._epoch_ns = epoch_ns
        self._begun_ns = self._twin.time_ns or -math.inf  # a motion may begin before t = 0
        if epoch_ns is not None and self._held_current is not None:
            self._inputs.submit_current(self._held_current)
            self._held_current = None

    def take_motion(
        self, topic: str, data: bytes, sender: object = None, received_ns: int | None = None
    ) -> None:
        """Accept or reject a message (CDR) on one of MOTION_TOPICS.

        sender: any identifier of its publisher; received_ns: ROS time of arrival, None: unknown.
        """
        content = self._read(topic, lambda: _MOTION_READERS[topic](data))
        if content is None or (epoch_ns := self._epoch(content[0])) is None:
            return
        with self._lock:
            now_s = self._now_s()
            if not self._senders[topic].admit(sender, now_s):
                self._remark(self._refuse_stranger(topic, "it", now_s), now_s)
                return
        arrival_ns = None if received_ns is None else received_ns - epoch_ns
        stamp_ns, sample = content
        if self.motion_listener is not None:
            height_m = sample.position_m[2] if isinstance(sample, ShipPose) else sample[0]
            self.motion_listener(stamp_ns - epoch_ns, height_m)
        if isinstance(sample, ShipPose):
            self._inputs.submit_pose(replace(sample, stamp_ns=stamp_ns - epoch_ns), arrival_ns)
        else:
            self._inputs.submit_heave(stamp_ns - epoch_ns, *sample, arrival_ns)
        self.motion_ns = max(self.motion_ns or 0, stamp_ns - epoch_ns)  # once it is queued

    def take_lower_end(self, data: bytes) -> None:
        """Accept or reject a lower_end/odometry message."""
        if self._twin.inputs.lower_end is None:
            problem = "the scene does not let another simulator move it"
            remedy = "give its rope `end_motion: {from_outside: true}`"
            with self._lock:
                sentence = phrase(topics.LOWER_END, problem, remedy)
                self._malformed[topics.LOWER_END].add(sentence, self._now_s())
            return
        content = self._read(topics.LOWER_END, lambda: read_lower_end(data))
        if content is not None and (epoch_ns := self._epoch(content[0])) is not None:
            stamp_ns, position_m, velocity_m_per_s = content
            self._inputs.submit_lower_end(stamp_ns - epoch_ns, position_m, velocity_m_per_s)
            self.lower_end_ns = max(self.lower_end_ns or 0, stamp_ns - epoch_ns)

    def take_order(
        self,
        topic: str,
        data: bytes,
        sender: str,
        sent_ago_s: float = 0.0,
        process: object = None,
    ) -> None:
        """Accept or reject a message on one of WINCH_TOPICS.

        sender: name of its node, which must have the winch's seat; sent_ago_s: time since it was
        sent [s]; process: any identifier of the sender's process, None: unknown.
        """
        content = self._read(topic, lambda: read_order(topic, data))
        if content is None:
            return
        stamp_ns, order, name = content
        stops = order.kind == EMERGENCY_STOP or order == WinchCommand(SPEED, 0.0)
        if stamp_ns is None and not stops and self.refuse_late(topic, order.kind, sent_ago_s):
            return
        # the planner's commands belong to its schedule, which begins again with the next epoch
        is_planned = self.seats.plans(sender)
        is_stop = order.kind == EMERGENCY_STOP and not is_planned
        if is_stop and self.epoch_ns is None:
            self._latch_stop(self._twin.inputs.winch_name(name))
            return
        if (epoch_ns := self._epoch(stamp_ns if is_planned else None)) is None:
            return
        at_ns = None if stamp_ns is None else stamp_ns - epoch_ns
        winch, now_ns = self._twin.inputs.winch_name(name), self._twin.time_ns
        executable = winch in self.seats.winches and self._twin.inputs.winch_may_execute(
            winch, at_ns, order
        )
        command = self.seats.admit(
            winch, Command(order, at_ns, sender, executable, process), now_ns
        )
        if doubt := self.seats.doubt(winch):
            with self._lock:
                self._remark(f"winch {winch}: {doubt}", self._now_s())
        if command is not None:
            self._inputs.submit_command(command.stamp_ns, order, name)

    def switch(self, winch: str, kind: str) -> tuple[bool, str]:
        """Execute a switch that comes by a service immediately; return success and text.

        An emergency stop while the simulation is not active is latched until it is.
        """
        if kind != EMERGENCY_STOP and self._epoch() is None:
            return False, f"winch {winch}: '{kind}' ignored, the simulation is not active"
        refusal = self.seats.permit(winch, kind) or self._twin.inputs.winch_forbids(winch, kind)
        if refusal:
            return False, refusal
        if self._epoch() is None:
            self._latch_stop(winch)
            return True, _latched_words([winch])
        refusal = self._inputs.submit_command(None, WinchCommand(kind), winch)
        return not refusal, refusal or f"winch {winch}: {kind.replace('_', ' ')}"

    def ask_seat(self, winch: str) -> tuple[bool, str]:
        """Reserve the seat of a winch by a service; return success and text."""
        if self._epoch() is None:  # the command that would take it would be ignored
            return False, f"winch {winch}: seat not reserved, the simulation is not active"
        return self.seats.ask(winch)

    def refuse_late(self, where: str, what: str, sent_ago_s: float) -> str:
        """Return why a command that applies at once is rejected, and count it; "": it is not.

        It was held up on its way, or this process was stopped: its sender has seen no effect and
        may have done something else since.
        """
        if sent_ago_s <= LATE_S:
            return ""
        problem = f"'{what}' was sent {sent_ago_s:.1f} s ago and is not executed any more"
        remedy = "send it again; if nothing was held up, set the clock of its sender"
        note = phrase(where, problem, remedy)
        with self._lock:
            self._late.add(note, self._now_s())
        return note

    def take_cut(self, data: bytes, sent_ago_s: float = 0.0) -> None:
        """Accept or reject a ropes/cut message; sent_ago_s: time since it was sent [s]."""
        content = self._read(topics.CUT_TOPIC, lambda: read_cut(data))
        if content is not None and (epoch_ns := self._epoch()) is not None:
            stamp_ns, below_m, rope = content
            if stamp_ns is None and self.refuse_late(topics.CUT_TOPIC, "cut", sent_ago_s):
                return
            at_ns = None if stamp_ns is None else stamp_ns - epoch_ns
            self._inputs.submit_cut(at_ns, below_m, rope)

    def take_measurement(
        self, topic: str, data: bytes, sender: object = None, received_ns: int | None = None
    ) -> None:
        """Accept or reject a message on one of MEASURED_TOPICS; arguments as of motion.

        Several nodes may share a topic, each with its own winch or quantity.
        """
        content = self._read(topic, lambda: read_measurement(topic, data))
        if content is None or (epoch_ns := self._epoch(content.stamp_ns)) is None:
            return
        with self._lock:
            rows = self._admitted(topic, content.rows, sender)
        if rows:
            measurement = content._replace(stamp_ns=content.stamp_ns - epoch_ns, rows=rows)
            arrival_ns = None if received_ns is None else received_ns - epoch_ns
            self._inputs.submit_measurement(measurement, arrival_ns)
            if self.listener is not None:
                self.listener(measurement)

    def _admitted(self, topic: str, rows: tuple[Row, ...], sender: object) -> tuple[Row, ...]:
        """Return the rows without the values of a second sender; call it under the lock."""
        now_s = self._now_s()
        found: list[Row] = []
        for name, *values in rows:
            winch = self._twin.inputs.winch_name(name) if name else ""
            refused = []
            for k, value in enumerate(values):
                key = topic, winch, k
                if value is None:
                    continue
                if key not in self._sensors and len(self._sensors) < MAX_SENSORS:
                    self._sensors[key] = SelectedSender(LONGEST_S)
                if key in self._sensors and not self._sensors[key].admit(sender, now_s):
                    values[k] = None
                    refused.append(_DEPTH if topic == topics.MEASURED_DEPTH else _QUANTITIES[k])
            if refused:
                what = " and ".join(refused) + (f" of '{name}'" if name else "")
                self._refuse_stranger(topic, what, now_s)
            if not refused or any(value is not None for value in values):
                found.append((name, values[0], values[1], values[2]))
        return tuple(found)

    def _refuse_stranger(self, topic: str, what: str, now_s: float) -> str:
        """Count a message of a second sender; return the sentence."""
        publishes = f"a second sender publishes {what} too and is ignored"
        note = phrase(topic, publishes, "stop one of the two senders")
        self._strangers[topic].add(note, now_s)
        return note

    def take_current(self, data: bytes) -> None:
        """Accept or reject a `current` message; it has no stamp and applies from now on.

        Of those that come in a pause the newest applies at its end: a sensor may send for hours.
        """
        content = self._read("current", lambda: read_current(data))
        if content is not None and self.epoch_ns is None:
            self._held_current = content
        elif content is not None:
            self._inputs.submit_current(content)

    def take_forecast(self, data: bytes) -> list[dict[str, float]]:
        """Accept or reject a message on FORECAST_RISK; return its risks, none if it is rejected.

        Each of its rows has the verification of the last forecasts.
        """
        rows = self._read(topics.FORECAST_RISK, lambda: read_risks(data)) or []
        if rows and self._epoch() is not None:
            self._inputs.submit_forecast_score(**{name: rows[0][name] for name in SCORE})
        return rows

    def rows(self) -> list[Status]:
        """Return the diagnostics rows of seats, messages and senders."""
        with self._lock:
            now_s = self._now_s()
            ignored = self._ignored + self._inputs.refused
            latched = sorted(self.latched) if self.epoch_ns is None else []
            return [
                *self.seats.rows(),
                _messages_row(self._malformed, self._late, ignored, latched, now_s),
                _senders_row(self._strangers, now_s),
            ]

    @property
    def mixed(self) -> str:
        """Return in words which inputs several senders sent in turn; "": none."""
        names = [name for name, motion_sender in self._senders.items() if motion_sender.mixed]
        names += sorted({key[0] for key, sensor in self._sensors.items() if sensor.mixed})
        return f"{', '.join(names)}: several senders, one of them used" if names else ""

    def _read(self, topic: str, read: Callable[[], Content]) -> Content | None:
        """Return the content of a message; count a malformed one and return None."""
        try:
            return read()
        except InputError as error:
            with self._lock:
                now_s = self._now_s()
                self._malformed[topic].add(str(error), now_s)
                if topic not in (topics.CUT_TOPIC, topics.FORECAST_RISK, *topics.MEASURED_TOPICS):
                    self._remark(str(error), now_s)
            return None

    def _remark(self, note: str, now_s: float) -> None:
        """Report rejected inputs to the quality index of the twin; call with the lock held."""
        if self.epoch_ns is not None and now_s - self._remarked_s >= REMARK_S:
            self._remarked_s = now_s
            self._inputs.take_remark(note.removesuffix("."))

    def _latch_stop(self, winch: str) -> None:
        """Queue an emergency stop for the first cycle after a pause.

        It is reported, and queued once, if the winch will execute it.
        """
        if winch in self.seats.winches and not (
            self.seats.permit(winch, EMERGENCY_STOP)
            or self._twin.inputs.winch_forbids(winch, EMERGENCY_STOP)
        ):
            with self._lock:
                if winch in self.latched:
                    return
                self.latched.add(winch)
            if self.latch_listener is not None:
                self.latch_listener(set(self.latched))
        self._inputs.submit_command(None, WinchCommand(EMERGENCY_STOP), winch)

    def _epoch(self, stamp_ns: int | None = None) -> int | None:
        """Return the epoch; if there is none, count the input as ignored and return None.

        So is one stamped within a pause, or before a restart: in the new epoch its stamp means
        another time. It may have waited in the subscriber's queue.
        """
        epoch_ns = self.epoch_ns
        if epoch_ns is not None and self.latched:  # they have reached the twin
            self.latched.clear()
        if epoch_ns is None or (stamp_ns is not None and stamp_ns - epoch_ns < self._begun_ns):
            self._ignored += 1
            return None
        return epoch_ns


def _latched_words(winches: list[str]) -> str:
    names = ", ".join(winches)
    return f"winch {names}: emergency stop latched, in force once the simulation goes on"


def _messages_row(
    malformed: dict[str, Refusals], late: Refusals, ignored: int, latched: list[str], now_s: float
) -> Status:
    """Return the row on malformed messages and late commands, inputs ignored and stops latched
    while not active.
    """
    values = {topic: str(refused.count) for topic, refused in malformed.items()}
    values |= {"late commands": str(late.count), "ignored while not active": str(ignored)}
    if latched:
        return Status(MESSAGES_ROW, Level.WARN, _latched_words(latched), values)
    recent = {
        topic: count for topic, refusals in malformed.items() if (count := refusals.recent(now_s))
    }
    sentences = []
    if late_count := late.recent(now_s):
        sentences.append(f"{counted(late_count, 'command')} late and rejected in the last "
                         f"{REPORTED_S:g} s; last: {late.note}")  # fmt: skip
    if recent:
        notes = " ".join(malformed[topic].note for topic in recent)
        message = f"{sum(recent.values())} malformed and rejected in the last {REPORTED_S:g} s; "
        sentences.append(f"{message}last per topic: {notes}")
    if sentences:
        return Status(MESSAGES_ROW, Level.WARN, " ".join(sentences), values)
    total = sum(refused.count for refused in malformed.values())
    words = "all messages well formed"
    if total:
        words = f"{total} malformed since the start, none in the last {REPORTED_S:g} s"
    return Status(MESSAGES_ROW, Level.OK, words, values)


def _senders_row(strangers: dict[str, Refusals], now_s: float) -> Status:
    """Return the row on second senders of the ship motion and of measured quantities."""
    values = {f"{topic}: of others": str(refusals.count) for topic, refusals in strangers.items()}
    notes = {
        topic: refusals.note for topic, refusals in strangers.items() if refusals.recent(now_s)
    }
    if notes:
        level = Level.ERROR if any(topic in topics.MOTION_TOPICS for topic in notes) else Level.WARN
        return Status(SENDERS_ROW, level, " ".join(notes.values()), values)
    return Status(SENDERS_ROW, Level.OK, "one sender of each input", values)


_MOTION_READERS: dict[str, Callable[[bytes], tuple[int, ShipPose | tuple[float, float]]]] = {
    "ship/heave": read_heave,
    "ship/odometry": read_pose,
}
