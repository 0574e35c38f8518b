"""Faults of sensors, clocks, networks and senders, laid over the messages of one input.

The kinds are those with which PX4's simulation tests its estimators (off, stuck, garbage, wrong,
slow, delayed, intermittent: PX4 user guide, "System Failure Injection"), and those of clocks and
networks besides. A fault is a function from messages to messages.

The instruments of a campaign (load cell, counter, depth sensor) measure what the sound twin
computed, with a scatter of their own standard uncertainty.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

from rope_twin.messages import (
    encode_current,
    encode_heave,
    encode_measurement,
    encode_order,
    encode_pose,
)
from rope_twin.scene.instruments import Measured, MeasuredLength, MeasuredTension
from rope_twin.scene.rigging import places
from rope_twin.scene.schema import Scene
from rope_twin.twin.readings import Measurement
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.winch.commands import WinchCommand

SECOND_NS = 1_000_000_000
HEAVE, ODOMETRY, WINCH, CURRENT = "ship/heave", "ship/odometry", "winch/speed_command", "current"
DRIVING = HEAVE, ODOMETRY, WINCH, CURRENT
SENSORS, DEPTH = "winch/measured", "payload/measured_depth"
JUDGING = SENSORS, DEPTH  # inputs that the twin is compared with
INPUTS = *DRIVING, *JUDGING
PAIR = " + "  # in the name of a pair of faults
Heave = tuple[float, float]  # position [m], rate [m/s]
Profile = tuple[tuple[float, float, float], ...]  # rows of z [m], east, north [m/s]
READING_NS = SECOND_NS // 10
# instruments of a scene that has none
CELL = MeasuredTension(uncertainty_pct=0.5)
COUNTER = MeasuredLength(uncertainty_m=0.02)
SOUNDER = MeasuredLength(uncertainty_m=0.5)


@dataclass(frozen=True)
class Message:
    """One message on its way to the twin, in simulation time."""

    topic: str
    received_ns: int
    stamp_ns: int  # by its sender's clock
    content: Any  # Heave, ShipPose, WinchCommand, Profile or Measurement
    sender: str = "sensor"
    garbage: bytes = b""  # what comes in place of the content

    def encoded(self, epoch_ns: int) -> bytes:
        """Return CDR bytes as delivered by the middleware; epoch_ns: ROS time of t = 0."""
        if self.garbage:
            return self.garbage
        stamp_ns = max(0, epoch_ns + self.stamp_ns)
        if self.topic == HEAVE:
            return encode_heave(stamp_ns, *self.content)
        if self.topic == ODOMETRY:
            return encode_pose(stamp_ns, self.content)
        if self.topic == CURRENT:
            return encode_current(self.content)
        if self.topic in JUDGING:
            return encode_measurement(stamp_ns, self.content)[1]
        data: bytes = encode_order(stamp_ns, self.content)[1]
        return data


Change = Callable[[list[Message], random.Random], list[Message]]


@dataclass(frozen=True)
class Fault:
    """Fault of an input from a given time on."""

    name: str
    change: Change
    hidden: str = ""  # why the input alone cannot show it; empty: it must be flagged


def faults_of(topic: str) -> list[Fault]:
    """Return every fault of one input, and pairs of faults that can occur together."""
    single = [replace(item, hidden=_HIDDEN.get((topic, item.name), item.hidden))
              for item in (*_ANY, *_OF[topic])]  # fmt: skip
    if topic in (HEAVE, ODOMETRY):
        paired = [fault for fault in single if fault.name in _PAIRED]
        single += [_both(item, other) for item, other in combinations(paired, 2)]
    return single


def _both(first: Fault, second: Fault) -> Fault:
    hidden = first.hidden if first.hidden and second.hidden else ""
    return Fault(f"{first.name}{PAIR}{second.name}",
                 lambda messages, rng: second.change(first.change(messages, rng), rng),
                 hidden)  # fmt: skip


def _each(change: Callable[[Message], Message]) -> Change:
    """Change every message by itself."""
    return lambda messages, rng: [change(message) for message in messages]


def _content(change: Callable[[Any], Any]) -> Change:
    """Change the content of every message."""
    return _each(lambda message: replace(message, content=change(message.content)))


# -- what becomes of messages, whatever they say ------------------------------------------------


def _stuck(messages: list[Message], rng: random.Random) -> list[Message]:
    return [replace(message, content=messages[0].content) for message in messages]


def _random_bytes(messages: list[Message], rng: random.Random) -> list[Message]:
    return [replace(message, garbage=rng.randbytes(rng.randint(1, 400))) for message in messages]


def _cut_short(message: Message) -> Message:
    data = message.encoded(0)
    return replace(message, garbage=data[: len(data) // 2])


def _slow(messages: list[Message], rng: random.Random) -> list[Message]:
    """Pass one message every 0.5 s."""
    thinned: list[Message] = []
    for message in messages:
        if not thinned or message.stamp_ns >= thinned[-1].stamp_ns + SECOND_NS // 2:
            thinned.append(message)
    return thinned


def _shifted(arrival_s: float, stamp_s: float = 0.0) -> Change:
    """Shift arrival and stamp: both alike as by a relay that stamps, one as by a wrong clock."""
    arrival_ns, off_ns = round(arrival_s * SECOND_NS), round(stamp_s * SECOND_NS)
    return _each(
        lambda message: replace(
            message,
            received_ns=message.received_ns + arrival_ns,
            stamp_ns=message.stamp_ns + off_ns,
        )
    )


def _intermittent(messages: list[Message], rng: random.Random) -> list[Message]:
    """Drop all messages of every other second."""
    return [message for message in messages if message.stamp_ns // SECOND_NS % 2]


def _dropouts(messages: list[Message], rng: random.Random) -> list[Message]:
    """Drop half of all messages at random."""
    return [message for message in messages if rng.random() < 0.5]


def _repeated(messages: list[Message], rng: random.Random) -> list[Message]:
    return [message for message in messages for _ in range(2)]


def _out_of_order(messages: list[Message], rng: random.Random) -> list[Message]:
    """Swap contents and stamps of neighbours; times of arrival are unchanged."""
    swapped = list(messages)
    for k in range(0, len(swapped) - 1, 2):
        a, b = swapped[k], swapped[k + 1]
        swapped[k] = replace(b, received_ns=a.received_ns)
        swapped[k + 1] = replace(a, received_ns=b.received_ns)
    return swapped


def _other_sender(messages: list[Message], rng: random.Random) -> list[Message]:
    """Add a second sender that sends in turn, with inverted values from five seconds before."""
    late_s = 5.02  # between two of the first one
    others = _shifted(late_s, late_s)(_times(-1.0)(messages, rng), rng)
    others = [replace(message, sender="stranger") for message in others]
    return sorted([*messages, *others], key=lambda message: message.received_ns)


# -- what becomes of their numbers --------------------------------------------------------------

Value = Callable[[float], float]


def _same(value: float) -> float:
    return value


def _scaled_by(value: Value, rate: Value | None = None) -> Change:
    """Change positions (or the value of a command or profile) by `value`, rates by `rate`."""
    rate = rate or value

    def changed(message: Message) -> Message:
        content = message.content
        if message.topic == HEAVE:
            content = value(content[0]), rate(content[1])
        elif message.topic == ODOMETRY:
            content = replace(
                content,
                position_m=tuple(map(value, content.position_m)),
                velocity_m_per_s=tuple(map(rate, content.velocity_m_per_s)),
            )
        elif message.topic in JUDGING:
            content = _with_row(content, value, rate, value)
        elif message.topic == CURRENT:
            content = tuple((z, value(east), value(north)) for z, east, north in content)
        else:
            content = WinchCommand(content.kind, value(content.value))
        return replace(message, content=content)

    return _each(changed)


def _times(factor: float, rate: float | None = None) -> Change:
    other = factor if rate is None else rate
    return _scaled_by(lambda value: factor * value, lambda value: other * value)


def _jump(jump_m: float) -> Change:
    """Move every position by so much at once; rates stay true."""
    return _scaled_by(lambda value: value + jump_m, _same)


def _noise(sigma_m: float) -> Change:
    return lambda messages, rng: _scaled_by(lambda z: z + rng.gauss(0.0, sigma_m), _same)(
        messages, rng
    )


def _posed(name: str, factor: float) -> Change:
    """Multiply all parts of `rate_rad_per_s` or `orientation` of a pose."""
    return _content(
        lambda pose: replace(pose, **{name: tuple(factor * part for part in getattr(pose, name))})
    )


def _with_row(reported: Measurement, place: Value, speed: Value, tension: Value) -> Measurement:
    """Return a measurement whose known values are changed."""
    changes = place, speed, tension
    rows = tuple(
        (name, *(None if number is None else change(number)
                 for change, number in zip(changes, numbers, strict=True)))
        for name, *numbers in reported.rows
    )  # fmt: skip
    return reported._replace(rows=rows)  # type: ignore[arg-type]


def _readings(place: Value = _same, speed: Value = _same, tension: Value = _same) -> Change:
    """Change line out or depth [m], line speed [m/s] and tension [N] of each reading."""
    return _content(lambda reported: _with_row(reported, place, speed, tension))


def _with_value(message: Message, column: int, value: float) -> Message:
    """Return a reading with a value in a column (1: line out or depth, 2: speed, 3: tension)."""
    row = list(message.content.rows[0])
    row[column] = value
    return replace(message, content=message.content._replace(rows=(tuple(row),)))


def _stuck_at_first(column: int) -> Change:
    """Keep the first value of a column."""
    return lambda messages, rng: [
        _with_value(message, column, messages[0].content.rows[0][column]) for message in messages
    ]


def _spikes(column: int, size: Value) -> Change:
    """Change a value in one of ten readings at random."""
    return lambda messages, rng: [
        _with_value(message, column, size(message.content.rows[0][column]))
        if rng.random() < 0.1
        else message
        for message in messages
    ]


_ALIKE = "position and rate are changed alike, as in a smaller sea"
_ANY = [
    Fault("off", lambda given, rng: []),
    Fault("random bytes", _random_bytes),
    Fault("cut short", _each(_cut_short)),
    Fault("not a number", _scaled_by(lambda _: math.nan)),
    Fault("infinite", _scaled_by(lambda _: math.inf)),
    Fault("1e300", _scaled_by(lambda _: 1e300)),
    Fault("another sender", _other_sender),
]
_STAMPED = [
    Fault("delayed 0.5 s", _shifted(0.5)),
    Fault("delayed 1 s", _shifted(1.0)),
    Fault("delayed 5 s", _shifted(5.0)),
    Fault("clock +1.5 s", _shifted(0.0, 1.5)),
    Fault("clock +9 s", _shifted(0.0, 9.0)),
    Fault("clock -1.5 s", _shifted(0.0, -1.5)),
    Fault("clock -9 s", _shifted(0.0, -9.0)),
    Fault("out of order", _out_of_order),
]
_STREAMED = [
    Fault("stuck", _stuck),
    Fault("slow, 2 Hz", _slow),
    Fault("intermittent", _intermittent),
    Fault("half lost", _dropouts),
    Fault("repeated", _repeated),
]
_MEASURED = [
    Fault("times 0.1", _times(0.1), _ALIKE),
    Fault("times 1.03", _times(1.03), _ALIKE),
    Fault("times 10", _times(10.0)),
    Fault("opposite sign", _times(-1.0), _ALIKE),
    Fault("position times 0.1", _times(0.1, 1.0)),
    Fault("position times 10", _times(10.0, 1.0)),
    Fault("position of opposite sign", _times(-1.0, 1.0)),
    Fault("rate times 0.1", _times(1.0, 0.1)),
    Fault("rate times 10", _times(1.0, 10.0)),
    Fault("rate times 100", _times(1.0, 100.0)),
    Fault("rate of opposite sign", _times(1.0, -1.0)),
    Fault("rate +15 m/s", _scaled_by(_same, lambda v: v + 15.0)),
    Fault("jump by 5 m", _jump(5.0)),
    Fault("jump by 29 m", _jump(29.0)),
    Fault("jump by 500 m", _jump(500.0)),
    Fault("noise of 0.5 m", _noise(0.5)),
    Fault("relayed 0.5 s late", _shifted(0.5, 0.5), "stamps and values agree"),
    Fault("relayed 5 s late", _shifted(5.0, 5.0), "stamps and values agree"),
]
_ORDERED = "the winch obeys it, as it would obey its crew"
_OF = {
    HEAVE: [*_STAMPED, *_STREAMED, *_MEASURED],
    ODOMETRY: [
        *_STAMPED,
        *_STREAMED,
        *_MEASURED,
        Fault("rate of turn times 10", _posed("rate_rad_per_s", 10.0)),
        Fault("rate of turn of opposite sign", _posed("rate_rad_per_s", -1.0)),
        Fault("quaternion of length 0.5", _posed("orientation", 0.5)),
    ],
    WINCH: [
        *_STAMPED,
        Fault("stuck", _stuck, _ORDERED),
        Fault("slow, 2 Hz", _slow, _ORDERED),
        Fault("intermittent", _intermittent),
        Fault("half lost", _dropouts, _ORDERED),
        Fault("repeated", _repeated),
        Fault("times 0.1", _times(0.1), _ORDERED),
        Fault("times 10", _times(10.0)),
        Fault("times 100", _times(100.0)),
        Fault("opposite sign", _times(-1.0), _ORDERED),
        Fault("plus 5 m/s", _jump(5.0)),
        Fault("relayed 0.5 s late", _shifted(0.5, 0.5), _ORDERED),
    ],
    CURRENT: [
        Fault("times 0.1", _times(0.1), "it is a current as good as any"),
        Fault("times 10", _times(10.0)),
        Fault("times 100", _times(100.0)),
        Fault("opposite sign", _times(-1.0), "it is a current as good as any"),
        Fault("plus 1 m/s", _jump(1.0)),
    ],
}
_COMPARED = "readings are compared for the time of their stamps"
_FT, _LB_N, _KGF_N = 0.3048, 4.4482216152605, 9.80665  # exact
_ARRIVING = [
    Fault("delayed 1 s", _shifted(1.0), _COMPARED),
    Fault("delayed 15 s", _shifted(15.0)),
    Fault("clock +1.5 s", _shifted(0.0, 1.5)),
    Fault("clock +9 s", _shifted(0.0, 9.0)),
    Fault("clock -15 s", _shifted(0.0, -15.0)),
    Fault("out of order", _out_of_order),
    Fault("stuck", _stuck),
    Fault("slow, 2 Hz", _slow, "fewer readings are as good"),
    Fault("half lost", _dropouts, "fewer readings are as good"),
    Fault("repeated", _repeated),
]
_OF[SENSORS] = [
    *_ARRIVING,
    Fault("relayed 15 s late", _shifted(15.0, 15.0)),
    Fault("tension stuck", _stuck_at_first(3)),
    Fault("tension in lbf", _readings(tension=lambda n: n / _LB_N)),
    Fault("tension in kgf", _readings(tension=lambda n: n / _KGF_N)),
    Fault("tension in kN", _readings(tension=lambda n: 1e-3 * n)),
    Fault("tension times 10", _readings(tension=lambda n: 10.0 * n)),
    Fault("tension of opposite sign", _readings(tension=lambda n: -n)),
    Fault("tension lost", _readings(tension=lambda n: 0.0)),
    Fault("tension spikes of 50 kN", _spikes(3, lambda n: n + 5e4)),
    Fault("line out stuck", _stuck_at_first(1)),
    Fault("line out in ft", _readings(place=lambda m: m / _FT)),
    Fault("line out of opposite sign", _readings(place=lambda m: -m)),
    Fault("line out jumps by 5 m", _readings(place=lambda m: m + 5.0)),
    Fault("line out spikes of 3 m", _spikes(1, lambda m: m + 3.0)),
    Fault("line speed stuck", _stuck_at_first(2)),
    Fault("line speed in m/min", _readings(speed=lambda v: 60.0 * v)),
    Fault("line speed in ft/s", _readings(speed=lambda v: v / _FT)),
    Fault("line speed of opposite sign", _readings(speed=lambda v: -v)),
]
_OF[DEPTH] = [
    *_ARRIVING,
    Fault("in ft", _readings(place=lambda m: m / _FT)),
    Fault("in fathoms", _readings(place=lambda m: m / (6.0 * _FT))),
    Fault("opposite sign", _readings(place=lambda m: -m)),
    Fault("jumps by 5 m", _readings(place=lambda m: m + 5.0)),
    Fault("spikes of 20 m", _spikes(1, lambda m: m + 20.0)),
]
_HIDDEN = {(CURRENT, "off"): "a profile holds until the next one comes"}
_PAIRED = {
    "stuck", "slow, 2 Hz", "intermittent", "half lost", "repeated", "out of order", "delayed 0.5 s",
    "clock +1.5 s", "position times 10", "rate times 10", "rate of opposite sign", "another sender",
    "jump by 5 m",
}  # fmt: skip


def laid_over(messages: list[Message], fault: Fault, from_ns: int, seed: int) -> list[Message]:
    """Return the messages with the fault from a given time on, in the order of arrival.

    messages: of one input, in the order of their stamps; from_ns: the first stamp with the fault
    [ns, simulation time]; seed: of random bytes, noise and losses.
    """
    early = [message for message in messages if message.stamp_ns < from_ns]
    later = [message for message in messages if message.stamp_ns >= from_ns]
    faulted = fault.change(later, random.Random(seed))
    return sorted([*early, *faulted], key=lambda item: item.received_ns)


class Truth(NamedTuple):
    """Values of the sound twin at one time."""

    stamp_ns: int
    line_out_m: float
    speed_m_per_s: float
    tension_n: float
    depth_m: float


def truth_of(snapshot: Snapshot) -> Truth:
    """Return what instruments would see of a snapshot, each without an error of its own."""
    depth_m = -float(snapshot.payload_position_m[2])
    return Truth(
        snapshot.stamp_ns,
        snapshot.line_out_m,
        snapshot.payout_speed_m_per_s,
        snapshot.tension_top_n,
        depth_m,
    )


def instrumented(scene: Scene) -> Scene:
    """Return the scene with uncertainties of its instruments, its own where it gives them."""
    own = scene.measured
    measured = Measured(
        tension=CELL if own.tension.uncertainty(1.0) is None else own.tension,
        line_out=COUNTER if own.line_out.uncertainty(1.0) is None else own.line_out,
        payload_depth=SOUNDER if own.payload_depth.uncertainty(1.0) is None else own.payload_depth,
    )
    return replace(scene, measured=measured)


def readings(scene: Scene, truths: Sequence[Truth], latency_ns: int, seed: int) -> list[Message]:
    """Return the readings of all instruments of an instrumented scene, in the order of arrival.

    truths: of the sound twin, at rising times, one in READING_NS is read; latency_ns: from a stamp
    to the arrival of its message; seed: of the scatter.
    """
    rng, messages, due_ns = random.Random(seed), list[Message](), 0
    winch = next((rope.from_ for rope in scene.ropes if rope.from_ in places(scene)), "")
    cell, counter = scene.measured.tension, scene.measured.line_out
    sounder = scene.measured.payload_depth
    for truth in truths:
        if truth.stamp_ns < due_ns:
            continue
        due_ns = truth.stamp_ns + READING_NS
        tension_n = truth.tension_n + rng.gauss(0.0, cell.uncertainty(truth.tension_n) or 0.0)
        length_m = truth.line_out_m + rng.gauss(0.0, counter.uncertainty(truth.line_out_m) or 0.0)
        depth_m = truth.depth_m + rng.gauss(0.0, sounder.uncertainty(truth.depth_m) or 0.0)
        reported = Measurement.of_winch(
            truth.stamp_ns,
            length_m + counter.bias,
            truth.speed_m_per_s,
            tension_n + cell.bias,
            winch,
        )
        sounded = Measurement.of_depth(truth.stamp_ns, depth_m + sounder.bias)
        arrival_ns = truth.stamp_ns + latency_ns
        messages.append(Message(SENSORS, arrival_ns, truth.stamp_ns, reported, "winch"))
        messages.append(Message(DEPTH, arrival_ns, truth.stamp_ns, sounded, "sounder"))
    return messages
