"""Measured series of a recorded lift: tension, heave and line out of one winch, from a bag.

Tension comes from winch/measured; line out from there, or else from ropes/length of the twin; heave
from ship/heave, or else from the twin's hang_off/odometry. Times count from the first tension.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.errors import BagError, InputError
from rope_twin.estimation.figures import ROPE_FIGURES
from rope_twin.estimation.measured_lift import MeasuredLift, Series
from rope_twin.messages.cdr import typestore
from rope_twin.messages.inputs import read_heave, read_measurement
from rope_twin.recording.bag import find_bag
from rope_twin.recording.damaged_bag import Messages, read_undamaged
from rope_twin.recording.input_log import decode_json
from rope_twin.recording.session import Session
from rope_twin.scene.schema import Scene
from rope_twin.topics import BY_NAME, INPUT_LOG_TOPIC, SESSION_TOPIC, WINCH_MEASURED, is_topic
from rope_twin.twin.input_queue import calls_of

HEAVE, HANG_OFF, LENGTH = "ship/heave", "hang_off/odometry", "ropes/length"
LEAST_SAMPLES = 100


@dataclass(frozen=True)
class RecordedLift:
    """Series of a bag, and the scene that it was recorded with."""

    lift: MeasuredLift  # pin_noise_n is NaN until the scene's prior is known
    session: Session | None  # the first of the bag
    problems: tuple[str, ...]  # damage of the bag and messages that were left out
    applied: dict[str, float]  # factors on the scene's figures that the run took over at last

    def scene(self) -> Scene:
        """Return the scene in the bag.

        Raises:
            BagError: the bag has none.
            SceneError: it is not valid here.
        """
        if self.session is None:
            what = f"it has no {SESSION_TOPIC}, so no scene"
            raise BagError("bag", what, "name the scene with --scene")
        return self.session.scene()


def read_lift(bag: str | Path, winch: str = "") -> RecordedLift:
    """Return the series of a winch; "": of the only one, or the first that is named.

    A damaged bag is read as far as it is whole.

    Raises:
        BagError: there is no such bag, or it lacks tension, heave or line out.
    """
    found, damage = read_undamaged(find_bag(bag), lambda reader: _read(reader, winch))
    return replace(found, problems=(*damage, *found.problems))


def _read(bag: Messages, winch: str) -> RecordedLift:
    tension, line_out, own_line = Series(1), Series(1), Series(1)
    heave, hang_off = Series(2), Series(2)
    session: Session | None = None
    problems: list[str] = []
    applied: dict[str, float] = {}
    rest_z: float | None = None
    refused = 0
    for topic, data in _messages(bag):
        try:
            if topic == SESSION_TOPIC and session is None:
                session = Session.read(decode_json(topic, data))
            elif topic == WINCH_MEASURED:
                stamp_ns, rows = read_measurement(topic, data)[1:]
                for name, length, _, force in rows:
                    if winch in ("", name):
                        winch = winch or name
                        line_out.add(stamp_ns * 1e-9, _number(length))
                        tension.add(stamp_ns * 1e-9, _number(force))
            elif topic == INPUT_LOG_TOPIC:
                applied |= _applied(decode_json(topic, data))
            elif topic == HEAVE:
                stamp_ns, (z, v) = read_heave(data)
                heave.add(stamp_ns * 1e-9, z, v)
            elif topic == HANG_OFF:
                message = _decoded(topic, data)
                z = float(message.pose.pose.position.z)
                rest_z = z if rest_z is None else rest_z
                hang_off.add(_stamp_s(message), z, float(message.twist.twist.linear.z))
            elif topic == LENGTH:
                message = _decoded(topic, data)
                if len(message.position):
                    own_line.add(_stamp_s(message), float(message.position[0]))
        except InputError:
            refused += 1
    if refused:
        problems.append(f"{refused} messages could not be read and were left out")
    lift = MeasuredLift(np.nan)
    lift.tension = tension
    lift.line_out = line_out if len(line_out.table) else own_line
    lift.heave = heave if len(heave.table) else hang_off
    for name, series, wanted in (
        ("tension", lift.tension, f"{WINCH_MEASURED} with effort"),
        ("line out", lift.line_out, f"{WINCH_MEASURED} with position, or {LENGTH}"),
        ("heave", lift.heave, f"{HEAVE} or {HANG_OFF}"),
    ):
        if len(series.table) < LEAST_SAMPLES:
            what = f"{len(series.table)} samples of {name}"
            of = f" of winch '{winch}'" if winch else ""
            raise BagError(f"bag {bag.path}{of}", what, f"record {wanted}")
    if lift.heave is hang_off:
        lift.heave = _relative(hang_off, session, rest_z)
    zero_s = float(lift.tension.table[0, 0])
    lift.tension, lift.line_out = lift.tension.less(zero_s, 0.0), lift.line_out.less(zero_s, 0.0)
    lift.heave = lift.heave.less(zero_s, 0.0, 0.0)
    return RecordedLift(lift, session, tuple(problems), applied)


def _messages(bag: Messages) -> Iterator[tuple[str, bytes]]:
    """Return topic and data of the messages that are needed, topic by topic."""
    for name in bag.topics:
        for wanted in (SESSION_TOPIC, INPUT_LOG_TOPIC, WINCH_MEASURED, HEAVE, HANG_OFF, LENGTH):
            if is_topic(name, wanted):
                yield from ((wanted, data) for _, data in bag.messages(name))


def _applied(entry: dict[str, Any]) -> dict[str, float]:
    """Return the factors that an entry of the log of inputs takes over.

    Raises:
        InputError: it is no entry of that log.
    """
    try:
        calls = calls_of(entry.get("calls", []))
    except ValueError as error:
        raise InputError(INPUT_LOG_TOPIC, str(error), "give the bag as recorded") from error
    given = (one.named for one in calls if one.method == "offer_figures")
    return {
        name: float(value)
        for named in given
        for name, value in named.items()
        if name in ROPE_FIGURES
    }


def _decoded(topic: str, data: bytes) -> Any:
    """Return a message of the table of topics.

    Raises:
        InputError: it cannot be decoded.
    """
    try:
        return typestore().deserialize_cdr(data, BY_NAME[topic].type_name)
    except Exception as error:
        what = f"a message cannot be decoded ({type(error).__name__})"
        raise InputError(topic, what, "give the bag as recorded") from error


def _stamp_s(message: Any) -> float:
    return float(message.header.stamp.sec) + 1e-9 * float(message.header.stamp.nanosec)


def _number(value: float | None) -> float:
    return np.nan if value is None else value


def _relative(hang_off: Series, session: Session | None, first_z: float | None) -> Series:
    """Return the hang-off's height relative to its rest: that of the scene, or its mean."""
    rest = float(hang_off.table[:, 1].mean()) if first_z is None else first_z
    if session is not None:
        rest = session.scene().ship.hang_off_m[2]
    return hang_off.less(0.0, rest, 0.0)
