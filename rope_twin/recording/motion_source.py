"""Ship motion and measurements of a run: selection of their source, and computed motion.

Together with the winch schedule (`rope_twin.twin.winch.commands`) this is all input of a run.
The stamps are the same in a real-time run over ROS and in an unpaced one. Computed are a regular
heave, a table of prescribed motion, and the motion by RAOs or of a box hull in waves; records are
in `heave`.

The measurements of a bag (line out, line speed, tensions, payload depth) go to an unpaced run.
Stamps are placed in simulation time by the ROS time of t = 0: that of the replayed motion where it
comes from a bag with stamps of the same voyage, else that of the run that the bag recorded
(`twin/epoch`), else the first reading. The record is played once; nothing is made up after it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import cos, pi, sin
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.errors import BagError, InputError, counted
from rope_twin.messages import decode, encode_heave, encode_pose
from rope_twin.messages.inputs import read_measurement
from rope_twin.messages.templates import NANOSECONDS, nanoseconds
from rope_twin.recording.bag import BagReader, find_bag
from rope_twin.recording.heave import open_heave, open_poses, sample_of
from rope_twin.recording.track import names_of
from rope_twin.scene.schema import RecordedPoses, RegularHeave, Scene
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.raos import Responses
from rope_twin.sea.ship_motion import BoxHull, TimeHistory, heave_response, read_time_history
from rope_twin.sea.spectrum import Waves, wave_at
from rope_twin.sea.tables import Vector
from rope_twin.topics import MEASURED_TOPICS
from rope_twin.twin.motion.hang_off import lever_arm
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.motion.ship_motion import ShipPose, Vector3, attitude, body_rates, turned
from rope_twin.twin.readings import (
    MOTOR,
    MOTOR_TENSION,
    PAYLOAD,
    PAYLOAD_DEPTH,
    WINCH_MEASURED,
    WINCH_SENSORS,
    Measurement,
)
from rope_twin.twin.validity import HeaveSample, SceneMotion

if TYPE_CHECKING:
    from rope_twin.twin.input_queue import InputQueue
    from rope_twin.twin.twin import Twin

Floats = NDArray[np.float64]

FIRST_NS = -100_000_000  # samples begin this early, so that t = 0 lies between two of them
LEAD_NS = 200_000_000  # samples are passed to the twin this long before they are needed
SAMPLE_PERIOD_NS = 50_000_000  # 20 Hz, the rate of ship/heave
_EPOCH = "twin/epoch"
APART_NS = 86_400 * NANOSECONDS  # readings further from t = 0 are of another voyage
GROUPS = {WINCH_SENSORS: WINCH_MEASURED, MOTOR: MOTOR_TENSION, PAYLOAD: PAYLOAD_DEPTH}


class Sea(SceneMotion, Protocol):
    """Source of ship motion, in simulation time."""

    source: str  # description
    note: str  # fault of the source and how it is handled; empty: none
    topic: str  # that its samples are published on

    def is_over(self, from_ns: int) -> bool:
        """Return whether there is no sample from a time on."""


def open_sea(
    scene: Scene,
    bag: str = "",
    topic: str = "",
    start_s: float = 0.0,
    loop: bool = True,
    poses: str = "",
) -> Sea | None:
    """Return the ship motion: heave of `bag`, poses of `poses`, or the scene's sea; None: none.

    `start_s` counts from the scene's own start if it is the scene's sea. A regular heave has no
    end, whatever `loop` is. The ship's still-water position in `poses` is taken from the scene's
    own poses.

    Raises:
        BagError: the bag cannot be used; one sentence.
        InputError: a topic is named without a bag, heave and poses are both given, or a table that
            the scene names is invalid.
    """
    if bag and poses:
        remedy = "give heave or poses of the ship, not both"
        raise InputError(f"bag {bag}", f"poses of {poses} are named too", remedy)
    if bag:
        return open_heave(bag, topic or None, start_s, loop)
    sea = scene.sea_state
    if poses:
        named = replace(sea.poses or RecordedPoses(bag=poses), bag=poses, topic=topic)
        return open_poses(scene, named, start_s, loop)
    if sea.poses is not None:
        named = replace(sea.poses, topic=topic or sea.poses.topic)
        return open_poses(scene, named, sea.start_s + start_s, loop and sea.loop)
    if sea.bag:
        return open_heave(sea.bag, topic or None, sea.start_s + start_s, loop and sea.loop)
    if topic:
        problem = f"scene {scene.name} has no bag to look for it in"
        raise InputError(f"topic '{topic}'", problem, "name a bag too, or leave the topic out")
    if sea.path:
        return HangOffHistory(read_time_history(sea.path), sea.start_s + start_s)
    if sea.heave is not None:
        return RegularSea(sea.heave, sea.start_s + start_s)
    return sea_of_waves(scene)


def submit(twin: Twin | InputQueue, sample: HeaveSample) -> str:
    """Pass one sample to a twin; return why it was rejected, or ""."""
    if sample.pose is not None:
        return twin.submit_pose(sample.pose)
    return twin.submit_heave(sample.stamp_ns, sample.position_m, sample.velocity_m_per_s)


def encode_motion(stamp_ns: int, sample: HeaveSample) -> tuple[str, bytes]:
    """Return topic and message of a sample with this stamp."""
    if sample.pose is not None:
        return "ship/odometry", encode_pose(stamp_ns, sample.pose)
    return "ship/heave", encode_heave(stamp_ns, sample.position_m, sample.velocity_m_per_s)


def series_of(samples: list[HeaveSample]) -> HeaveSeries | None:
    """Return the hang-off motion of the samples, for many steps at once; None if there are none.

    Raises:
        InputError: the motion is implausible for a ship.
    """
    if not samples:
        return None
    heave = ((sample.stamp_ns, sample.position_m, sample.velocity_m_per_s) for sample in samples)
    horizontal = [sample.lateral for sample in samples if sample.lateral is not None]
    return HeaveSeries.of(heave, horizontal)


def stamps_between(from_ns: int, to_ns: int) -> NDArray[np.int64]:
    """Return the multiples of SAMPLE_PERIOD_NS with from_ns <= stamp < to_ns, in order."""
    first, end = -(-from_ns // SAMPLE_PERIOD_NS), -(-to_ns // SAMPLE_PERIOD_NS)
    return np.arange(first, end, dtype=np.int64) * SAMPLE_PERIOD_NS


class ComputedSea(ABC):
    """Samples at multiples of SAMPLE_PERIOD_NS, each computed by itself, without an end.

    A sample is bit-identical in whatever interval: the order of summation in a matrix product
    depends on the number of rows.
    """

    note = ""
    topic = "ship/heave"

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order."""
        return [self.sample(stamp_ns) for stamp_ns in stamps_between(from_ns, to_ns).tolist()]

    @abstractmethod
    def sample(self, stamp_ns: int) -> HeaveSample:
        """Return the sample at a time."""

    def is_over(self, from_ns: int) -> bool:
        """Return False: a computed motion has no end."""
        return False


class RegularSea(ComputedSea):
    """Exact samples of z = a·sin(2π·t/T) by simulation time; t = 0 is `start_s` into it.

    The twin's cubic Hermite interpolation between them differs by at most (2π/T·dt)⁴/384 of the
    amplitude: 6e-9 at T = 8 s, 2e-6 at the shortest period of a scene, 2 s.
    """

    def __init__(self, heave: RegularHeave, start_s: float = 0.0) -> None:
        self._heave = heave
        self._start_s = start_s
        self.source = f"regular heave of ±{heave.amplitude_m:g} m every {heave.period_s:g} s"

    def at(self, time_s: float) -> tuple[float, float]:
        """Return position [m] and velocity [m/s] at a time, exactly."""
        amplitude, omega = self._heave.amplitude_m, 2.0 * pi / self._heave.period_s
        angle = omega * (time_s + self._start_s)
        return amplitude * sin(angle), amplitude * omega * cos(angle)

    def sample(self, stamp_ns: int) -> HeaveSample:
        """Return the sample at a time."""
        return HeaveSample(stamp_ns, *self.at(stamp_ns * 1e-9), None)


class ShipOfComponents:
    """Poses of a ship whose six degrees of freedom are sums of sines.

    Turns are yaw, then pitch, then roll about the ship's axes.
    """

    def __init__(self, answer: NDArray[np.complex128], omega: Vector, bow: float) -> None:
        """Take complex amplitudes at t = 0, (6, n) [m], [rad], their ω [rad/s], and the heading of
        the bow, from east to north [rad].
        """
        self._answer, self._omega, self._bow = answer, omega, bow

    def freedoms(self, time_s: float) -> tuple[Floats, Floats]:
        """Return surge, sway, heave [m], roll, pitch, yaw [rad] at a time, and the rates, (6,)."""
        moved = self._answer * np.exp(1j * self._omega * time_s)
        return moved.sum(axis=1).real, (1j * self._omega * moved).sum(axis=1).real

    def pose(self, stamp_ns: int) -> ShipPose:
        """Return the pose at a time, computed by itself: bit-identical in whatever interval."""
        moved, rate = (part.tolist() for part in self.freedoms(stamp_ns * 1e-9))
        x, y, z, w = attitude(*moved[3:])
        orientation = (*self._from_bow(x, y), z, w)
        velocity = turned((-orientation[0], -orientation[1], -z, w), self._in_sea(rate[:3]))
        spin = self._in_sea(body_rates(moved[3], moved[4], rate[3:]))
        return ShipPose(stamp_ns, self._in_sea(moved[:3]), velocity, orientation, spin)

    def _from_bow(self, forward: float, port: float) -> tuple[float, float]:
        """Return east and north of a direction forward and to port on the ship at rest."""
        c, s = cos(self._bow), sin(self._bow)
        return c * forward - s * port, s * forward + c * port

    def _in_sea(self, vector: Sequence[float]) -> Vector3:
        return (*self._from_bow(vector[0], vector[1]), vector[2])


class ShipOnWaves(ShipOfComponents, ComputedSea):
    """Poses of a ship that answers each component of the waves that the rope feels.

    A component a·cos(k·x - ω·t + φ) is the real part of a·exp(i(ω·t - k·x - φ)); each degree of
    freedom answers with its response times that, at the reference point at rest.
    """

    topic = "ship/odometry"

    def __init__(self, waves: Waves, responses: Responses, scene: Scene) -> None:
        self._arm = lever_arm(scene)
        bow = float(np.radians(scene.sea_state.on_waves.heading_deg))  # type: ignore[union-attr]
        x, y, _ = scene.ship.hang_off_m
        self._surface = wave_at(waves, x, y)
        wave = wave_at(waves, x - self._arm[0], y - self._arm[1])
        frequency = waves.omega / (2.0 * np.pi)
        super().__init__(wave * responses.at(frequency, waves.heading - bow), waves.omega, bow)
        self.source = (
            f"waves of Hs {waves.significant_height_m:.3g} m; six degrees of freedom by "
            f"{responses.source}, bow at {np.degrees(bow):g}°"
        )

    def sample(self, stamp_ns: int) -> HeaveSample:
        """Return the sample at a time."""
        surface = (self._surface * np.exp(1j * self._omega * (stamp_ns * 1e-9))).sum().real
        return sample_of(self.pose(stamp_ns), self._arm, float(surface))


class HangOffHistory:
    """Samples of a prescribed motion, given in a table; the ship does not turn."""

    note = ""
    topic = "ship/odometry"

    def __init__(self, history: TimeHistory, start_s: float = 0.0) -> None:
        self._history, self._start_s = history, start_s
        self.source = f"hang-off moved by {history.source}, {history.end_s:g} s long"

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order."""
        stamps = stamps_between(from_ns, to_ns)
        times = np.asarray(stamps * 1e-9 + self._start_s, np.float64)
        known = times <= self._history.end_s
        place, velocity = self._history.at(times[known])
        rows = zip(stamps[known].tolist(), place.tolist(), velocity.tolist(), strict=True)
        poses = (ShipPose(stamp, tuple(p), tuple(v)) for stamp, p, v in rows)
        return [sample_of(pose, (0.0, 0.0, 0.0), None) for pose in poses]

    def is_over(self, from_ns: int) -> bool:
        """Return whether the motion has ended before a time."""
        return from_ns * 1e-9 + self._start_s > self._history.end_s


class WaveSea(ComputedSea):
    """Samples of heave and of the surface at the hang-off by simulation time.

    A component a·cos(k·x - ω·t + φ) is the real part of a·exp(i(ω·t - k·x - φ)); the ship motion is
    its RAO times that. The sea itself builds up from flat with the ship's ramp.
    """

    def __init__(self, waves: Waves, hull: BoxHull, x: float, y: float) -> None:
        self.source = f"waves of Hs {waves.significant_height_m:.3g} m; {hull.describe()}"
        self._wave = wave_at(waves, x, y)
        self._heave = self._wave * heave_response(hull, waves.omega / (2.0 * np.pi))
        self._omega = waves.omega

    def at(self, time_s: Vector) -> tuple[Vector, Vector, Vector]:
        """Return position [m], velocity [m/s] and surface [m] at times (n,), exactly."""
        turn = np.exp(1j * np.outer(time_s, self._omega))
        moved = turn @ np.stack([self._heave, 1j * self._omega * self._heave, self._wave], axis=1)
        position, velocity, surface = moved.real.T
        return position, velocity, surface

    def sample(self, stamp_ns: int) -> HeaveSample:
        """Return the sample at a time."""
        (position,), (velocity,), (surface,) = self.at(np.array([stamp_ns * 1e-9]))
        return HeaveSample(stamp_ns, float(position), float(velocity), float(surface))


def sea_of_waves(scene: Scene) -> WaveSea | ShipOnWaves | None:
    """Return the ship's motion on the scene's waves, or None if the scene has no such motion.

    Raises:
        InputError: its table of responses is wrong.
    """
    riding = scene.sea_state.on_waves
    if riding is None:
        return None
    params = scene.listed(WavesParams)
    assert params is not None, "checked when the scene was read"
    waves = components_of(params, scene.environment.gravity_m_per_s2)
    if riding.responses:
        responses = read_responses(riding.responses, riding.conventions)
        return ShipOnWaves(waves, responses, scene)
    x, y, _ = scene.ship.hang_off_m
    return WaveSea(waves, riding.hull, x, y)


class MeasuredReplay:
    """Measurements by simulation time, in the order of their stamps."""

    def __init__(self, measurements: list[Measurement], source: str, note: str = "") -> None:
        """Keep measurements whose stamps are in simulation time [ns]."""
        self._measurements = sorted(measurements, key=lambda measurement: measurement.stamp_ns)
        self._stamps = [measurement.stamp_ns for measurement in self._measurements]
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
        messages = list(_measurements(reader))
        epoch_ns = _epoch_ns(reader)
    where = f"bag {path}"
    readings = [message for message in messages if isinstance(message, Measurement)]
    if not readings:
        remedy = f"name one with {', '.join(MEASURED_TOPICS)}, whose messages are stamped"
        faults = [message for message in messages if isinstance(message, str)]
        raise BagError(where, faults[0] if faults else "it has no measurements", remedy)
    first_ns, last_ns = (pick(reading.stamp_ns for reading in readings) for pick in (min, max))
    zero_ns = begins_ns or epoch_ns or first_ns
    if last_ns < zero_ns or first_ns > zero_ns + APART_NS:
        early_s = (zero_ns - first_ns) * 1e-9
        side = "before" if early_s > 0 else "after"
        problem = f"its readings begin {abs(early_s):.6g} s {side} t = 0"
        remedy = "heave and measurements must be of the same time, by one clock"
        raise BagError(where, problem, remedy)
    counts = Counter(reading.source for reading in readings)
    parts = [counted(counts[source], group.replace("_", " ") + " reading")
             for source, group in GROUPS.items() if counts[source]]  # fmt: skip
    span = f"from {(first_ns - zero_ns) * 1e-9:.2f} to {(last_ns - zero_ns) * 1e-9:.2f} s"
    source = f"bag {path.name}: {', '.join(parts)}, {span}"
    wrong = Counter(message for message in messages if isinstance(message, str))
    notes = [f"{where}: {counted(count, 'message')} left out: {reason}"
             for reason, count in wrong.most_common(3)]  # fmt: skip
    placed = [reading._replace(stamp_ns=reading.stamp_ns - zero_ns) for reading in readings]
    return MeasuredReplay(placed, source, " ".join(notes))


def _measurements(reader: BagReader) -> Iterator[Measurement | str]:
    """Yield each measurement, stamped in ROS time, or why a message is none.

    Raises:
        BagError: a topic is there twice, in several namespaces.
    """
    for topic in MEASURED_TOPICS:
        names = names_of(reader, topic)
        if len(names) > 1:
            problem = f"{topic} is there in {len(names)} namespaces"
            raise BagError(f"bag {reader.path}", problem, f"keep one of {', '.join(names)}")
        for name in names:
            for _, data in reader.messages(name):
                try:
                    measurement = read_measurement(topic, data)
                except InputError as error:
                    yield str(error)
                    continue
                yield measurement if measurement.stamp_ns > 0 else f"{topic}: its stamp is 0"


def _epoch_ns(reader: BagReader) -> int:
    """Return the ROS time of t = 0 of the run that the bag recorded; 0: none, or several."""
    epochs: set[int] = set()
    for name in names_of(reader, _EPOCH):
        for _, data in reader.messages(name):
            epochs.add(nanoseconds(decode(_EPOCH, data)))
    return epochs.pop() if len(epochs) == 1 else 0
