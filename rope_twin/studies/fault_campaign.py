"""The fault campaign: every input with every fault, each run judged against a sound twin.

Both twins hear the same sea, one of them through a fault that begins at `FROM_S`. A fault must
raise a row of the diagnostics before the top tension has been off by more than `OFF_PCT` of its
standard deviation for `PATIENCE_S`; what no look at the input can show is listed with the error
that it makes.

In a sound run the twin hears the same traffic over hours without a fault, and a load cell and a
depth sensor that scatter by their own uncertainty around what it computes. Every fall of an index
is a false one.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from heapq import merge
from itertools import count
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from rope_twin.effects.current import CurrentParams
from rope_twin.errors import InputError
from rope_twin.messages import Level, Status, statuses
from rope_twin.recording.motion_source import FIRST_NS, Sea, open_sea
from rope_twin.run.border import InputBorder
from rope_twin.run.seat import PRIORITY
from rope_twin.scene.schema import Scene
from rope_twin.studies.fault_injection import (
    CURRENT,
    HEAVE,
    JUDGING,
    ODOMETRY,
    PAIR,
    SECOND_NS,
    WINCH,
    Fault,
    Message,
    Truth,
    faults_of,
    instrumented,
    laid_over,
    readings,
    truth_of,
)
from rope_twin.twin.input_queue import InputQueue
from rope_twin.twin.monitors import ERROR_INTERVAL, NO_MONITORS, Monitors
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.readings import Measurement
from rope_twin.twin.recovery import Recovery
from rope_twin.twin.snapshot import SPEED, Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.validity import HeaveSample
from rope_twin.twin.winch.commands import WinchCommand

LATENCY_NS = 10_000_000  # from a stamp to the arrival of its message
PITCH_RAD, PITCH_PERIOD_S = math.radians(2.0), 8.0  # of a ship whose sea is known by heave alone
SPEEDS_M_PER_S = (0.0, 0.4, 0.0, -0.4)  # of the winch, each for SPEED_FOR_S
SPEED_FOR_S = 6.0
PROFILE = ((0.0, 0.5, 0.1), (-100.0, 0.3, 0.1), (-1000.0, 0.1, 0.0))  # z [m], east, north [m/s]
COMMAND_NS, PROFILE_NS = SECOND_NS // 10, SECOND_NS
PERIOD_NS = round(len(SPEEDS_M_PER_S) * SPEED_FOR_S * SECOND_NS)  # after which commands repeat
SNAPSHOT_NS = SECOND_NS // 5  # between two snapshots and readings
SETTLED_S = 120.0  # after the build-up the indices have risen


def motion(scene: Scene, until_s: float, posed: bool) -> list[Message]:
    """Return the ship's motion in the scene's sea, as heave or as odometry.

    Raises:
        InputError: the scene's ship lies still.
    """
    samples = _sea_of(scene).between(FIRST_NS, round(until_s * SECOND_NS))
    if posed:
        poses = [sample.pose or _pitched(sample) for sample in samples]
        return [
            Message(ODOMETRY, pose.stamp_ns + LATENCY_NS, pose.stamp_ns, pose) for pose in poses
        ]
    return _heaving(samples)


def _heaving(samples: Sequence[HeaveSample]) -> list[Message]:
    return [
        Message(HEAVE, sample.stamp_ns + LATENCY_NS, sample.stamp_ns,
                (sample.position_m, sample.velocity_m_per_s))
        for sample in samples
    ]  # fmt: skip


def _sea_of(scene: Scene) -> Sea:
    """Return the scene's sea. Raises InputError if its ship lies still."""
    sea = open_sea(scene)
    if sea is None:
        problem, remedy = "its ship lies still", "name a scene with a sea"
        raise InputError(f"scene {scene.name}", problem, remedy)
    return sea


def _pitched(sample: HeaveSample) -> ShipPose:
    """Return the heave of a ship that pitches about its reference point as well."""
    omega = 2.0 * math.pi / PITCH_PERIOD_S
    phase = omega * sample.stamp_ns * 1e-9
    angle, rate = PITCH_RAD * math.sin(phase), PITCH_RAD * omega * math.cos(phase)
    w = sample.velocity_m_per_s
    return ShipPose(
        stamp_ns=sample.stamp_ns,
        position_m=(0.0, 0.0, sample.position_m),
        # The twist is in the turned axes: R(angle) about y, transposed, times (0, 0, w).
        velocity_m_per_s=(-w * math.sin(angle), 0.0, w * math.cos(angle)),
        orientation=(0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)),
        rate_rad_per_s=(0.0, rate, 0.0),
    )


def commands(scene: Scene, until_s: float) -> list[Message]:
    """Return speed commands at 10 Hz; nothing where the scene has no winch of that name."""
    if scene.winch is None:
        return []
    stamps = range(0, round(until_s * SECOND_NS), COMMAND_NS)
    messages = []
    for stamp_ns in stamps:
        turn = int(stamp_ns * 1e-9 / SPEED_FOR_S) % len(SPEEDS_M_PER_S)
        order = WinchCommand(SPEED, SPEEDS_M_PER_S[turn])
        messages.append(Message(WINCH, stamp_ns + LATENCY_NS, stamp_ns, order, "console"))
    return messages


def profiles(scene: Scene, until_s: float) -> list[Message]:
    """Return a current profile every second; nothing where the scene lists no current."""
    if not any(isinstance(params, CurrentParams) for params in scene.effects):
        return []
    stamps = range(0, round(until_s * SECOND_NS), PROFILE_NS)
    return [Message(CURRENT, stamp + LATENCY_NS, stamp, PROFILE, "meter") for stamp in stamps]


EPOCH_NS = 1_700_000_000 * SECOND_NS  # ROS time of t = 0: any that leaves room for wrong clocks
DELAY_NS = 150_000_000  # the twin runs behind ROS time by this, as `input_delay_s` has it
CHECK_NS = SECOND_NS // 2  # between two checks for commanders that are gone
SEED = 1
FROM_S, UNTIL_S = 20.0, 50.0
PATIENCE_S = 2.0
OFF_PCT = 15.0
DROP, DROP_WITHIN_S = 0.05, 10.0  # of the quality index below that of the sound run, and in time
# Rows on the machine and on the lift's own state, which a sound run raises as well as a faulted one
_NOT_OF_INPUTS = ("simulation: pacing", "simulation: start-up")


class LoneTwin:
    """A twin behind its border on a simulated clock: as in a paced run, but faster."""

    def __init__(self, scene: Scene, monitors: Monitors = NO_MONITORS) -> None:
        """Make the twin of a run. Raises SceneError: the scene cannot be built."""
        self.scene = scene
        self._twin = Twin(scene, monitors)
        self._inputs = InputQueue(self._twin, Recovery(self._twin))
        self._border = InputBorder(self._twin, self._inputs, PRIORITY, lambda: self.now_ns * 1e-9)
        self._border.epoch_ns = EPOCH_NS
        self._steps = steps_in_slot(self._twin.step_s)
        self._last = self._twin.snapshot()
        self._senders: set[str] = set()
        self._checked_ns = 0

    @property
    def now_ns(self) -> int:
        """Return the simulation time of the ROS clock at the beginning of the next cycle [ns]."""
        return self._twin.time_ns + DELAY_NS

    def deliver(self, message: Message) -> None:
        """Take a message that has arrived."""
        data = message.encoded(EPOCH_NS)
        if message.topic in (HEAVE, ODOMETRY):
            arrival_ns = EPOCH_NS + message.received_ns
            self._border.take_motion(message.topic, data, message.sender, arrival_ns)
        elif message.topic == CURRENT:
            self._border.take_current(data)
        elif message.topic in JUDGING:
            arrival_ns = EPOCH_NS + message.received_ns
            self._border.take_measurement(message.topic, data, message.sender, arrival_ns)
        else:
            self._senders.add(message.sender)
            self._border.take_order(message.topic, data, message.sender)

    def measure(self, measurement: Measurement) -> None:
        """Take a measurement that has arrived, stamped in simulation time."""
        self._inputs.submit_measurement(measurement)

    @property
    def time_ns(self) -> int:
        """Twin time [ns]."""
        return self._twin.time_ns

    def snapshot(self) -> Snapshot:
        """Return the current snapshot."""
        self._last = self._inputs.snapshot()
        return self._last

    def step_slot(self) -> None:
        """Step on by one publish period. Raises SolverError where a run would end."""
        if self._twin.time_ns >= self._checked_ns + CHECK_NS:
            self._checked_ns = self._twin.time_ns
            self._border.seats.check(self._senders, self._twin.time_ns)
        self._inputs.advance(self._steps)

    def rows(self) -> list[Status]:
        """Return the diagnostics rows as they would be published now."""
        return [*statuses(self._last, None), *self._border.rows()]


@dataclass(frozen=True)
class Finding:
    """Result of one run."""

    input: str
    fault: str
    flagged_after_s: float | None  # since the fault began; None: never
    level: str  # worst that was raised because of it: OK, WARN or ERROR
    row: str  # name and message of the first row that was raised
    worst_error_pct: float  # of the top tension, % of its standard deviation
    worst_error_pct_while_ok: float
    off_while_ok_s: float  # longest time without a flag and with an error above OFF_PCT
    survived: bool  # it ran to its end, and all that it published was finite
    hidden: str = ""  # why the input alone cannot show it
    quality_after_s: float | None = None  # until the quality index drops; None: never
    quality_reason: str = ""  # why it dropped

    @property
    def met(self) -> bool:
        """Return whether the run survived and was flagged in time, or need not be flagged.

        A measurement that judges the twin makes no error of it: its faults must lower the index.
        """
        in_time = self.dropped if self.input in JUDGING else self.off_while_ok_s <= PATIENCE_S
        return self.survived and (bool(self.hidden) or in_time)

    @property
    def dropped(self) -> bool:
        """Return whether the quality index dropped within DROP_WITHIN_S."""
        return self.quality_after_s is not None and self.quality_after_s <= DROP_WITHIN_S


@dataclass
class TopTensionRecord:
    """A run's top tension and the level of each row, slot by slot."""

    time_s: list[float] = field(default_factory=list)
    tension_n: list[float] = field(default_factory=list)
    rows: list[dict[str, tuple[Level, str]]] = field(default_factory=list)
    quality: list[tuple[float, str]] = field(default_factory=list)  # lowest index and reason
    truths: list[Truth] = field(default_factory=list)
    ended: str = ""  # why it did not come to its end


def follow(
    scene: Scene, messages: Iterable[Message], monitors: Monitors = NO_MONITORS
) -> TopTensionRecord:
    """Run a twin to UNTIL_S with these messages, in the order of their arrival."""
    course, twin = TopTensionRecord(), LoneTwin(scene, monitors)
    waiting = iter(messages)
    following = next(waiting, None)
    while not course.time_s or course.time_s[-1] < UNTIL_S - 1e-9:
        while following is not None and following.received_ns <= twin.now_ns:
            twin.deliver(following)
            following = next(waiting, None)
        try:
            twin.step_slot()
            snapshot = twin.snapshot()
        except Exception as error:  # whatever ends a run is what the campaign is to find
            course.ended = f"{type(error).__name__}: {error}"
            break
        course.time_s.append(snapshot.time_s)
        course.tension_n.append(snapshot.tension_top_n)
        course.truths.append(truth_of(snapshot))
        lowest = min(snapshot.quality, key=lambda element: element.index)
        course.quality.append((lowest.index, f"{lowest.cause}: {lowest.reason}"))
        course.rows.append({row.name: (row.level, row.message) for row in twin.rows()
                            if row.name not in _NOT_OF_INPUTS})  # fmt: skip
    return course


def judge(topic: str, fault: Fault, sound: TopTensionRecord, faulted: TopTensionRecord) -> Finding:
    """Compare a faulted run with the undisturbed one."""
    count = min(len(sound.time_s), len(faulted.time_s))
    time_s = np.array(sound.time_s[:count])
    after = time_s > FROM_S
    true_n, seen_n = np.array(sound.tension_n[:count]), np.array(faulted.tension_n[:count])
    deviation_n = float(np.std(np.array(sound.tension_n)[np.array(sound.time_s) > FROM_S]))
    error_pct = np.where(after, 100.0 * np.abs(seen_n - true_n) / deviation_n, 0.0)
    raised = list(_raised(sound, faulted, count))
    is_quiet = np.array([not rows for rows in raised]) & after
    first = next((k for k in range(count) if after[k] and raised[k]), None)
    name, (level, message) = "", (Level.OK, "")
    if first is not None:
        name, (level, message) = next(iter(raised[first].items()))
    raised_level = max((row[0] for rows in raised for row in rows.values()), default=level)
    finite = bool(np.isfinite(seen_n).all())
    fall = _fall(sound, faulted)
    return Finding(
        input=topic,
        fault=fault.name,
        flagged_after_s=None if first is None else round(float(time_s[first]) - FROM_S, 3),
        level=raised_level.name,
        row=f"{name}: {message}" if name else "",
        worst_error_pct=float(error_pct.max()) if finite else float("inf"),
        worst_error_pct_while_ok=float(error_pct[is_quiet].max()) if is_quiet.any() else 0.0,
        off_while_ok_s=_longest_s(time_s, is_quiet & (error_pct > OFF_PCT)),
        survived=finite and not faulted.ended,
        hidden=fault.hidden,
        quality_after_s=None if fall is None else round(fall[0] - FROM_S, 3),
        quality_reason="" if fall is None else fall[1],
    )


def _fall(sound: TopTensionRecord, faulted: TopTensionRecord) -> tuple[float, str] | None:
    """Return time [s] and reason of the first drop of the quality index; None: it never fell."""
    samples = zip(sound.time_s, sound.quality, faulted.quality, strict=False)
    falls = ((time_s, observed[1]) for time_s, true, observed in samples
             if time_s > FROM_S and observed[0] < true[0] - DROP)  # fmt: skip
    return next(falls, None)


def _raised(
    sound: TopTensionRecord, faulted: TopTensionRecord, count: int
) -> Iterator[dict[str, tuple[Level, str]]]:
    """Yield the rows of each slot that are worse than those of the sound run."""
    for true, observed in zip(sound.rows[:count], faulted.rows[:count], strict=True):
        yield {name: row for name, row in observed.items()
               if row[0] > true.get(name, (Level.OK, ""))[0]}  # fmt: skip


def _longest_s(time_s: NDArray[np.float64], holds: NDArray[np.bool_]) -> float:
    """Return the longest uninterrupted time for which a condition holds [s]."""
    longest = begun = 0.0
    for k, is_held in enumerate(holds):
        if not is_held:
            begun = 0.0
            continue
        begun = begun or float(time_s[k])
        longest = max(longest, float(time_s[k]) - begun)
    return round(longest, 3)


def plan(scene: Scene, inputs: Sequence[str], pairs: bool = True) -> list[tuple[str, Fault]]:
    """Return each run's input and fault, without inputs that the scene does not use."""
    traffic = {WINCH: commands(scene, 0.1), CURRENT: profiles(scene, 0.1)}
    topics = [topic for topic in inputs if topic not in traffic or traffic[topic]]
    return [(topic, fault) for topic in topics for fault in faults_of(topic)
            if pairs or PAIR not in fault.name]  # fmt: skip


class Baseline:
    """Undisturbed traffic and run of a scene, against which each fault is compared."""

    def __init__(self, scene: Scene, posed: bool, measured: bool = False) -> None:
        """Make the traffic and run the sound twin.

        posed: the ship's odometry is used in place of its heave; measured: there are a load cell, a
        line-out counter and a depth sensor, and an error interval without which the index would
        be no higher with them.

        Raises:
            InputError: the scene's ship lies still.
            SceneError: the scene cannot be built.
        """
        self._scene = scene
        sources = (
            motion(scene, UNTIL_S + 1.0, posed),
            commands(scene, UNTIL_S + 1.0),
            profiles(scene, UNTIL_S + 1.0),
        )
        self._traffic = {messages[0].topic: messages for messages in sources if messages}
        self._monitors = ERROR_INTERVAL if measured else NO_MONITORS
        self._sound = self._follow(self._traffic)
        if measured:
            self._scene = instrumented(scene)
            read = readings(self._scene, self._sound.truths, LATENCY_NS, SEED)
            self._traffic |= {
                topic: [row for row in read if row.topic == topic] for topic in JUDGING
            }
            self._sound = self._follow(self._traffic)

    def find(self, topic: str, fault: Fault) -> Finding:
        """Run the scene with a fault of one input and judge it."""
        traffic = dict(self._traffic)
        traffic[topic] = laid_over(traffic[topic], fault, round(FROM_S * SECOND_NS), SEED)
        return judge(topic, fault, self._sound, self._follow(traffic))

    def _follow(self, traffic: dict[str, list[Message]]) -> TopTensionRecord:
        merged = merge(*traffic.values(), key=lambda message: message.received_ns)
        return follow(self._scene, merged, self._monitors)


def run_campaign(
    scene: Scene,
    runs: Sequence[tuple[str, Fault]],
    report: Callable[[Finding], None],
    jobs: int = 1,
) -> list[Finding]:
    """Run each fault (of `plan`) next to an undisturbed twin, in so many parallel processes.

    report: receives each result immediately, in the order of the runs.

    Raises:
        InputError: the scene has no ship motion.
        SceneError: the scene cannot be built.
    """
    _BENCHES.clear()
    _RUNS[:] = runs
    _BENCHES.update({kind: Baseline(scene, *kind) for kind in {_kind(topic) for topic, _ in runs}})
    findings = []
    # A forked process has the compiled code and the sound runs already.
    with ProcessPoolExecutor(max(1, jobs), get_context("fork")) as pool:
        for finding in pool.map(_find, range(len(runs))):
            findings.append(finding)
            report(finding)
    return findings


# filled before the processes are forked that look there
_BENCHES: dict[tuple[bool, bool], Baseline] = {}
_RUNS: list[tuple[str, Fault]] = []


def _find(number: int) -> Finding:
    topic, fault = _RUNS[number]
    return _BENCHES[_kind(topic)].find(topic, fault)


def _kind(topic: str) -> tuple[bool, bool]:
    """Return whether a fault of this input is judged with poses, and with measurements."""
    return topic == ODOMETRY, topic in JUDGING


@dataclass(frozen=True)
class Drop:
    """A fall of the quality index of an element in a sound run."""

    element: str
    at_s: float  # twin time
    index: float  # after it
    reason: str


def sound_run(
    scene: Scene, seconds: float, progress: Callable[[float], None] = lambda _: None
) -> list[Drop]:
    """Run a scene for some twin time [s] without a fault; return each drop by more than DROP.

    progress: is given the twin time [s].

    Raises:
        InputError: the scene's ship lies still.
        SceneError: the scene cannot be built.
        SolverError: the run would end; the twin cannot go on.
    """
    twin = LoneTwin(instrumented(scene), ERROR_INTERVAL)
    rng, traffic, drops = random.Random(SEED), _traffic(scene), []
    following, sample_ns = next(traffic), SNAPSHOT_NS
    max_index: dict[str, float] = {}
    low: set[str] = set()
    while twin.time_ns < seconds * SECOND_NS:
        while following.received_ns <= twin.now_ns:
            twin.deliver(following)
            following = next(traffic)
        twin.step_slot()
        if twin.time_ns < sample_ns:
            continue
        sample_ns += SNAPSHOT_NS
        snapshot = twin.snapshot()
        cell, depth = twin.scene.measured.tension, twin.scene.measured.payload_depth
        tension_n, depth_m = snapshot.tension_top_n, -float(snapshot.payload_position_m[2])
        tension_n += rng.gauss(0.0, cell.uncertainty(tension_n) or 0.0) + cell.bias
        depth_m += rng.gauss(0.0, depth.uncertainty(depth_m) or 0.0) + depth.bias
        twin.measure(Measurement.of_winch(snapshot.stamp_ns, tension_n=tension_n))
        twin.measure(Measurement.of_depth(snapshot.stamp_ns, depth_m))
        for element in snapshot.quality if snapshot.time_s > SETTLED_S else ():
            max_index[element.element] = max(max_index.get(element.element, 0.0), element.index)
            if element.index >= max_index[element.element] - DROP:
                low.discard(element.element)
            elif element.element not in low:
                low.add(element.element)
                why = f"{element.cause}: {element.reason}"
                drops.append(Drop(element.element, snapshot.time_s, element.index, why))
        progress(snapshot.time_s)
    return drops


def _traffic(scene: Scene) -> Iterator[Message]:
    """Yield the messages of heave, winch and current without end, in the order of arrival."""
    sea = _sea_of(scene)
    orders, currents = commands(scene, PERIOD_NS * 1e-9), profiles(scene, PERIOD_NS * 1e-9)
    for number in count():
        begin_ns = number * PERIOD_NS
        samples = sea.between(begin_ns if number else FIRST_NS, begin_ns + PERIOD_NS)
        heave = _heaving(samples)
        later = (
            [replace(message, received_ns=message.received_ns + begin_ns,
                     stamp_ns=message.stamp_ns + begin_ns)
             for message in messages]
            for messages in (orders, currents)
        )  # fmt: skip
        yield from merge(heave, *later, key=lambda message: message.received_ns)
