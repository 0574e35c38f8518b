"""Unpaced run: as fast as possible, without ROS, with the same twin, inputs and bag.

Inputs have the same stamps as those of the ROS nodes and are passed on equally early, so that the
result is bit-identical to a real-time run that misses no deadline.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import asdict, replace
from statistics import median

from rope_twin import topics
from rope_twin.alerts.monitor import AlertMonitor
from rope_twin.errors import BagError, SolverError, StateError
from rope_twin.messages import (
    Encoder,
    encode_cut,
    encode_diagnostics,
    encode_elevation,
    encode_epoch,
    encode_measurement,
    encode_order,
    statuses,
)
from rope_twin.messages.reports import encode_alerts
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.motion_source import (
    FIRST_NS,
    GROUPS,
    LEAD_NS,
    MeasuredReplay,
    encode_motion,
    open_measured,
    open_sea,
    submit,
)
from rope_twin.recording.session import (
    InputLog,
    RunSetup,
    describe_run,
    describe_session,
    encode_json,
    encode_session,
)
from rope_twin.run.options import RunOptions
from rope_twin.run.progress import StopSignal
from rope_twin.run.summary import RunSummary, summarise
from rope_twin.scene.load import at_setting, following_measured, load_scene
from rope_twin.scene.rigging import winches_by_name
from rope_twin.scene.winch import FOLLOWS_MEASURED
from rope_twin.twin.cut_input import plan_for
from rope_twin.twin.input_queue import InputQueue
from rope_twin.twin.pacing import keep_pauses_short, steps_in_slot
from rope_twin.twin.recovery import Recovery
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.winch.commands import schedule_samples
from rope_twin.twin.winch.winch import input_of

MEASURED_S = 3.0  # computing time that suffices to measure the speed of a model
UNPACED = "unpaced"  # name of the only run in a bag
BLIND_S = 1.0  # simulation time between speed samples, without snapshots

Message = tuple[int, str, bytes]  # simulation time [ns], topic, CDR


class UnpacedRun:
    """One twin with its inputs and its bag; the caller advances it cycle by cycle."""

    def __init__(self, options: RunOptions, epoch_ns: int | None = None) -> None:
        """Build and compile the twin and open its files; `epoch_ns`: ROS time of t = 0.

        By default the run begins now; if it resumes from a saved state, t = 0 is earlier.

        Raises:
            RopeTwinError: scene, bag or directory are invalid; one sentence.
        """
        scene = at_setting(load_scene(options.scene), options.elements, options.step_s)
        self._cut = plan_for(scene, options.cut)
        self._sea = open_sea(
            scene, options.bag, options.topic, options.sea_offset_s, poses=options.poses
        )
        self._options = options
        self._measured: MeasuredReplay | None = None
        if options.measured:
            self._measured = open_measured(options.measured, getattr(self._sea, "begins_ns", 0))
        if options.follow_measured:
            scene = following_measured(scene)
        watch = {} if options.watch is None else asdict(options.watch)
        # `_submit` passes on the samples of `open_sea` only
        setup, start = RunSetup.of(options, **watch, feeds_itself=True), options.start_from
        self.twin = setup.make(scene, start)
        self.twin.failure_folder = options.failure_folder
        self._recovery = Recovery(self.twin)
        self.epoch_ns = time.time_ns() - self.twin.time_ns if epoch_ns is None else epoch_ns
        keep_pauses_short()
        self._bag = None if options.record is None else BagWriter(options.record, topics.TOPICS)
        self._steps = steps_in_slot(self.twin.step_s)
        self._slot_ns = self._steps * self.twin.step_ns
        self._encoder, self._alerts = Encoder(self.epoch_ns), AlertMonitor(scene)
        self._log = InputLog(UNPACED)
        log = None if self._bag is None else self._log.take
        self._inputs = InputQueue(self.twin, self._recovery, log)
        self._messages: deque[Message] = deque()  # inputs passed on, but not yet recorded
        self._sequence = Counter[str]()  # messages in the bag, by topic
        # A saved state already has inputs that its bag does not have: they are recorded again.
        self._known_ns = {} if start is None else self.twin.inputs.newest_ns()
        self._submitted_ns = FIRST_NS if self.twin.steps == 0 else self.twin.time_ns
        self._reported_ns = self.twin.time_ns
        self._saved = False
        self.last: Snapshot = self.twin.snapshot()
        self._record(self.twin.time_ns, "twin/epoch", encode_epoch(self.epoch_ns))
        if self._bag is not None:
            run = describe_run(scene, setup, 0.0)
            described = describe_session(run, self.twin, self.epoch_ns)
            described |= self._log.begin(self.twin.time_ns)
            self._record(self.twin.time_ns, topics.SESSION_TOPIC, encode_session(described, {}))

    @property
    def sea_note(self) -> str:
        """Return the faults of the replayed records and how they are handled; "": none."""
        parts = self._sea.note if self._sea else "", self._measured.note if self._measured else ""
        return " ".join(filter(None, parts))

    def advance_slot(self) -> Snapshot:
        """Pass on inputs, advance one cycle and record it.

        Raises:
            SolverError: the solver failed; the last good state is kept.
        """
        began_ns = self.twin.time_ns
        self._submit(began_ns + self._slot_ns + LEAD_NS)
        self._inputs.advance(self._steps)
        self.last = snapshot = self._inputs.snapshot()
        for name, content in self._log.messages(snapshot):
            self._record(began_ns, name, encode_json(content))
        while self._messages and self._messages[0][0] < snapshot.stamp_ns:
            self._record(*self._messages.popleft())
        if self._bag is not None:
            for name in topics.due_topics(*topics.slot_of(snapshot), snapshot):
                self._record(snapshot.stamp_ns, name, self._encoder.encode(name, snapshot))
            if self._alerts.observe(snapshot):
                data = encode_alerts(self.epoch_ns + snapshot.stamp_ns, *self._alerts.listed())
                self._record(snapshot.stamp_ns, topics.ALERTS, data)
        if snapshot.stamp_ns - self._reported_ns >= topics.DIAGNOSTICS_PERIOD_NS:
            self._tell(snapshot)
        return snapshot

    def advance_blindly(self, time_s: float) -> None:
        """Pass on inputs and advance, without snapshot or record.

        Raises:
            SolverError: the solver failed.
        """
        steps = max(1, round(time_s / self.twin.step_s))
        self._submit(self.twin.time_ns + steps * self.twin.step_ns + LEAD_NS)
        self._messages.clear()
        self._inputs.advance(steps)

    def summary(self, error: str = "") -> RunSummary:
        """Return the run summary up to now."""
        bag = str(self._options.record) if self._options.record else None
        state = str(self._options.save) if self._saved else None
        return replace(summarise(self.twin, self.last, None), bag=bag, state=state, error=error)

    def save(self) -> None:
        """Save the state to the file that the options name, if any.

        Raises:
            StateError: the state cannot be saved.
        """
        if self._options.save is not None:
            self.twin.save(self._options.save)
            self._saved = True

    def close(self) -> None:
        """Close the bag."""
        if self._bag is not None:
            self._bag.close()

    def _submit(self, until_ns: int) -> None:
        """Pass all samples before `until_ns` to the twin that it has not received yet."""
        messages: list[Message] = []
        for heave in self._sea.between(self._submitted_ns, until_ns) if self._sea else ():
            at_ns = heave.stamp_ns
            if at_ns > self._known_ns.get("heave", FIRST_NS - 1):
                submit(self._inputs, heave)
            messages.append((at_ns, *encode_motion(self.epoch_ns + at_ns, heave)))
            if heave.elevation_m is not None:
                data = encode_elevation(self.epoch_ns + at_ns, heave.elevation_m)
                messages.append((at_ns, "sea/elevation", data))
        for measured in (
            self._measured.between(self._submitted_ns, until_ns) if self._measured else ()
        ):
            at_ns = measured.stamp_ns
            if at_ns > self._known_ns.get(GROUPS[measured.source], FIRST_NS - 1):
                self._inputs.submit_measurement(measured)
            messages.append((at_ns, *encode_measurement(self.epoch_ns + at_ns, measured)))
        for name, winch in winches_by_name(self.twin.scene).items():
            if winch.follows == FOLLOWS_MEASURED:
                continue  # it takes no commands
            for command in schedule_samples(winch, self._submitted_ns, until_ns):
                at_ns, order = command.stamp_ns, command.command
                if at_ns > self._known_ns.get(input_of(order, name), FIRST_NS - 1):
                    self._inputs.submit_command(at_ns, order, name)
                messages.append((at_ns, *encode_order(self.epoch_ns + at_ns, order, name)))
        if self._cut is not None and self._submitted_ns <= self._cut.at_ns < until_ns:
            cut = self._cut
            at_ns = cut.at_ns
            if at_ns > self._known_ns.get("cut", FIRST_NS - 1):
                self._inputs.submit_cut(at_ns, cut.below_m, cut.rope)
            messages.append((at_ns, *encode_cut(self.epoch_ns + at_ns, cut.below_m, cut.rope)))
        self._messages.extend(sorted(messages, key=lambda message: message[0]))
        self._submitted_ns = until_ns

    def _tell(self, snapshot: Snapshot) -> None:
        self._reported_ns = snapshot.stamp_ns
        stamp_ns = self.epoch_ns + snapshot.stamp_ns
        rows = statuses(snapshot, None)
        self._alerts.take_rows(rows)
        self._record(snapshot.stamp_ns, "diagnostics", encode_diagnostics(stamp_ns, rows))

    def _record(self, at_ns: int, name: str, data: bytes) -> None:
        if self._bag is not None:
            self._sequence[name] += 1
            self._bag.write(name, self.epoch_ns + at_ns, data, sequence=self._sequence[name])


def measure_alone(options: RunOptions, time_s: float) -> float:
    """Return the real-time factor of the solver only, from the first seconds of the run.

    It is the median of samples of BLIND_S, because other programs use the machine too. A real-time
    run is slower: each cycle starts with cold CPU caches, which can cost several times the work of
    a short time step; `RunSummary.paced_real_time_factor` includes that.
    """
    run = UnpacedRun(replace(options, record=None, energy=False, error_interval=False, watch=None))
    run.twin.failure_folder = None
    end_ns = run.twin.time_ns + time_s * 1e9
    # a saved state includes the computing time up to it
    enough_s = run.twin.statistics().computing_s + MEASURED_S
    factors = []
    try:
        while run.twin.time_ns < end_ns and run.twin.statistics().computing_s < enough_s:
            before = run.twin.statistics()
            run.advance_blindly(min(time_s, BLIND_S))
            after = run.twin.statistics()
            simulated_s = (after.steps - before.steps) * run.twin.step_s
            factors.append(simulated_s / (after.computing_s - before.computing_s))
    except SolverError:
        pass  # the run itself has reported it; the steps before it count
    return median(factors) if factors else 0.0


def run_unpaced(
    options: RunOptions,
    report: Callable[[UnpacedRun], None],
    epoch_ns: int | None = None,
    say: Callable[[str], None] | None = None,
) -> RunSummary:
    """Run to the simulation time `options.end_s`, or until a signal ends the run.

    `report` is called after each cycle; `say` receives notes before the run begins.

    Raises:
        RopeTwinError: scene, bag, state or directory are invalid; one sentence.
    """
    run = UnpacedRun(options, epoch_ns)
    for words in filter(None, (run.sea_note, run.twin.notice)):
        if say is not None:
            say(words)
    error = not_kept = ""
    step_ns = run.twin.step_ns
    last_ns = round((options.end_s or 0.0) * 1e9 / step_ns) * step_ns
    stop = StopSignal()
    try:
        while run.twin.time_ns < last_ns and not stop.requested:
            run.advance_slot()
            report(run)
        stop.restore()
        run.save()
    except (SolverError, StateError, BagError) as failure:
        error = str(failure)
    finally:
        stop.restore()
        try:
            run.close()
        except BagError as failure:
            not_kept = str(failure)
    return replace(run.summary(error), not_kept=not_kept)
