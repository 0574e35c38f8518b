"""Real-time twin: a twin with its solver and publisher threads, its epoch and its diagnostics.

It exists from configure to cleanup of the simulation node. A ROS stamp is epoch + simulation time.
On the steady clock the real-time cycle that covers [t, t + cycle] begins `input_delay_s` after ROS
time epoch + t/speed, so that inputs stamped shortly after t have arrived by then.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from rope_twin import topics
from rope_twin.alerts.monitor import AlertMonitor
from rope_twin.errors import InputError, counted
from rope_twin.messages import Encoder, Level, Status, encode_text, statuses
from rope_twin.messages.diagnostics import BreachWords
from rope_twin.messages.reports import encode_alerts, encode_estimate
from rope_twin.recording.session import (
    InputLog,
    RunSetup,
    SessionStart,
    describe_run,
    describe_session,
    encode_json,
    encode_session,
)
from rope_twin.ros.params import SimulationParams
from rope_twin.run.border import InputBorder
from rope_twin.run.summary import CpuUsage, RunSummary, summarise
from rope_twin.scene.schema import Scene
from rope_twin.twin import pacing
from rope_twin.twin.input_queue import InputQueue, LogEntry
from rope_twin.twin.level import OverloadProtection
from rope_twin.twin.recovery import Recovery
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.state import load_state
from rope_twin.twin.state_file import AutoSave, SavingStatus
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import EMERGENCY_STOP, RESET, WinchCommand

if TYPE_CHECKING:
    from rope_twin.estimation.live import LiveLearning

CLOCK_STEP_S = 0.05  # tolerance of ROS time against the steady clock
WAITING_S = 1.0  # after which a cycle of a co-simulation says what it waits for


def publishing_row(error: str, lost_snapshots: int) -> Status:
    """Return the row on publishing; `error`: why a topic is no longer published."""
    values = {"lost snapshots": str(lost_snapshots)}
    name = "simulation: publishing"
    if error:
        return Status(name, Level.ERROR, error, values)
    if lost_snapshots:
        message = f"{counted(lost_snapshots, 'snapshot')} computed but not published in time"
        return Status(name, Level.WARN, message, values)
    return Status(name, Level.OK, "all snapshots published", values)


def clock_row(moved_s: float) -> Status:
    """Return the row on the drift of ROS time against the steady clock since the start."""
    values = {"ROS time against steady time [s]": f"{moved_s:.3f}"}
    name = "simulation: clocks"
    if abs(moved_s) > CLOCK_STEP_S:
        message = (
            f"ROS time has shifted by {moved_s:+.3f} s against the steady clock since the start: "
            "stamps of live inputs are wrong by as much; deactivate and activate to set a new epoch"
        )
        return Status(name, Level.WARN, message, values)
    return Status(name, Level.OK, "ROS time and the steady clock agree", values)


def granted_row(granted: pacing.GrantedClock) -> Status:
    """Return the row on the clock of a co-simulation: what the next cycle waits for."""
    newest_s, granted_s, now_s = (
        ns * 1e-9 for ns in (granted.newest_ns, granted.granted_ns, granted.now_ns())
    )
    values = {"newest time on /clock [s]": f"{newest_s:.3f}"}
    name = "simulation: clocks"
    if granted.waited_s < WAITING_S:
        return Status(name, Level.OK, "steps to the time of /clock", values)
    if newest_s < granted_s:
        message = (
            f"/clock has gone back from {granted_s:.3f} s to {newest_s:.3f} s, and the twin waits "
            "until it is past that time; deactivate and activate to set a new epoch"
        )
        return Status(name, Level.WARN, message, values)
    if now_s < granted_s:
        message = "waiting for motion: none has come up to the time of /clock"
        return Status(name, Level.WARN, message, values)
    return Status(name, Level.OK, f"waiting for /clock beyond {granted_s:.3f} s", values)


def saving_row(saving: SavingStatus) -> Status:
    """Return the row on the last saved state of a run that saves its state."""
    saved = "never" if saving.saved_s is None else f"{saving.saved_s:.2f}"
    values = {"file": str(saving.path), "last saved state, simulation time [s]": saved}
    name = "simulation: saving"
    if saving.trouble:
        return Status(name, Level.ERROR, saving.trouble, values)
    if saving.saved_s is None:
        return Status(name, Level.OK, "no state saved yet", values)
    return Status(name, Level.OK, f"state saved at {saved} s", values)


def level_row(protection: OverloadProtection, last: Snapshot) -> Status:
    """Return the row on the accuracy level: elements, time step, and why it was degraded."""
    number, count = protection.place
    values = {
        "level": f"{number} of {count}",
        "elements": str(len(last.element_tension_n)),
        "step [s]": f"{protection.level.step_s:g}",
        "changes": str(protection.changes),
        "load": f"{protection.load:.2f}",
    }
    name = "simulation: accuracy level"
    if number == 1:
        return Status(name, Level.OK, f"full accuracy level: {protection.words()}", values)
    level = f"accuracy level {number} of {count}, {protection.words()}"
    return Status(name, Level.WARN, f"degraded to {level}: {protection.reason}", values)


_log = logging.getLogger(__name__)


class Publisher:
    """Publishes the due topics of the snapshots that the solver thread has queued."""

    def __init__(
        self,
        handover: pacing.SnapshotQueue,
        publish: Callable[[str, bytes], None],
        first: Snapshot,
        log: InputLog | None = None,
        published: Callable[[], Mapping[str, int]] = dict,
        alerts: AlertMonitor | None = None,
        watch: Callable[[Snapshot], None] | None = None,
    ) -> None:
        """Load all message definitions by encoding `first`, which is not published.

        Loading them later would take from the time that other nodes have before t = 0.

        publish: publishes the bytes of a message on a topic; published: returns the number of
        messages published on each topic up to now; watch: is given each snapshot, in the publishing
        thread. Entries of `log` and the list of `alerts` are published too.
        """
        rehearsal = Encoder(0)
        for topic in topics.SNAPSHOT_TOPICS:
            rehearsal.encode(topic.name, first)
        self._handover = handover
        self._publish = publish
        self._log = log
        self._published, self._alerts, self._watch = published, alerts, watch
        self._epoch_ns = 0
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self.processor_s = 0.0  # CPU time of publishing
        self.error = ""  # last message that could not be published; "": none

    def start(self, epoch_ns: int) -> None:
        """Publish from now on, stamped `epoch_ns` + simulation time."""
        self._stopping.clear()
        self._epoch_ns = epoch_ns
        self._thread = threading.Thread(target=self._run, name="twin-publisher", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Publish the queued snapshots, then stop; without effect when not running."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _run(self) -> None:
        encoder = Encoder(self._epoch_ns)
        before_s = self.processor_s - time.thread_time()
        while True:
            snapshot = self._handover.take(timeout_s=0.05)
            if self._publish_log(snapshot):
                encoder = Encoder(self._epoch_ns)  # as in a replay that begins here
            if snapshot is not None:
                self._publish_snapshot(encoder, snapshot)
                self.processor_s = before_s + time.thread_time()
            elif self._stopping.is_set():
                return

    def _publish_log(self, snapshot: Snapshot | None) -> bool:
        """Publish the inputs logged before a snapshot; return whether a session has begun."""
        begun = False
        try:
            for name, content in self._log.messages(snapshot) if self._log else ():
                if name == topics.SESSION_TOPIC:
                    begun = True
                    self._publish(name, encode_session(content, self._published()))
                else:
                    self._publish(name, encode_json(content))
        except Exception as error:
            if not self.error:
                _log.exception("the inputs cannot be published")
            self.error = f"topic {topics.INPUT_LOG_TOPIC}: {type(error).__name__}: {error}"
        return begun

    def _publish_snapshot(self, encoder: Encoder, snapshot: Snapshot) -> None:
        if self._watch is not None:
            self._attempt(topics.ESTIMATE_TOPIC, partial(self._watch, snapshot))
        for name in topics.due_topics(*topics.slot_of(snapshot), snapshot):
            self._attempt(name, partial(encoder.encode, name, snapshot))
        if self._alerts is not None:
            self._attempt(topics.ALERTS, partial(self._judge, self._alerts, snapshot))

    def _judge(self, alerts: AlertMonitor, snapshot: Snapshot) -> bytes | None:
        """Return the alert list if it is to be published."""
        if not alerts.observe(snapshot):
            return None
        return encode_alerts(self._epoch_ns + snapshot.stamp_ns, *alerts.listed())

    def _attempt(self, name: str, make: Callable[[], bytes | None]) -> None:
        """Publish what `make` returns; one topic that fails must not stop the others."""
        try:
            data = make()
            if data is not None:
                self._publish(name, data)
        except Exception as error:  # diagnostics report it
            if not self.error:
                _log.exception("topic %s cannot be published", name)
            self.error = f"topic {name}: {type(error).__name__}: {error}"


START_LEAD_S = 0.5  # from the publication of the epoch to t = 0, for other nodes to prepare ...
AWAITED_LEAD_S = 1.5  # ... and from construction to t = 0, while other nodes discover each other


class PacedTwin:
    """Owns the twin; inputs and outputs are serialised messages."""

    def __init__(
        self,
        scene: Scene,
        params: SimulationParams,
        publish: Callable[[str, bytes], None],
        published: Callable[[], Mapping[str, int]] = dict,
    ) -> None:
        """Build and compile the twin (seconds if nothing is cached).

        published: returns the number of messages published on each topic up to now.

        Raises:
            SceneError: the scene cannot be built.
            StateError: the saved state is unsuitable, or no state can be saved.
            InputError: the run would end before it begins, or a model or curve is unknown.
        """
        self.scene = scene
        self._params = params
        self._publish, self._published = publish, published
        self._made_ns = time.monotonic_ns()
        mesh = {"elements": params.elements or None, "step_s": params.step_s or None}
        setup = RunSetup.of(params, **mesh)
        self.twin, self.begun, beside = _begin(scene, setup, params)
        self.twin.failure_folder = Path(params.failure_directory).resolve()
        self._recovery = Recovery(self.twin)
        self._keeper: AutoSave | None = None
        if params.save_state:
            every_s = params.save_every_s * params.speed
            path = Path(params.save_state).resolve()
            self._keeper = AutoSave(self._recovery, path, every_s, self._beside)
        self.protection = _protection_of(self.twin, params)
        self._described = describe_run(scene, setup, params.speed)
        self._log = InputLog(uuid4().hex)
        self._stopped: set[str] = set()  # winches whose emergency stop is in the saved state
        self._inputs = InputQueue(self.twin, self._keeper or self._recovery, self._take_entry)
        self._first = self.twin.snapshot()
        steps = pacing.steps_in_slot(self.twin.step_s)
        self.granted = pacing.GrantedClock(self._motion_reach_ns) if params.lockstep else None
        self._handover = pacing.SnapshotQueue(
            pacing.queue_depth(steps * self.twin.step_s, params.speed)
        )
        self.pacer = pacing.Pacer(
            self._inputs,
            self._handover,
            steps,
            params.speed,
            clock=self.granted,
            last_step=_steps_to_do(self.twin, params.stop_after_s),
            catch_up=math.inf if params.lockstep else pacing.CATCH_UP,
        )
        if self.protection is not None:
            self.pacer.watch(self.protection.judge)
        self.learning: LiveLearning | None = None
        if params.learn:  # without it nothing of the estimator is loaded
            from rope_twin.estimation.live import LiveLearning  # with SciPy's solvers

            self.learning = LiveLearning(scene, self._inputs)
        watch = None if self.learning is None else self.learning.see
        self.alerts = AlertMonitor(scene)
        self._publisher = Publisher(
            self._handover, publish, self._first, self._log, published, self.alerts, watch
        )
        self._ros_ahead_ns = 0  # ROS time less steady time at the last start
        self.border = InputBorder(self.twin, self._inputs, params.command_priority)
        self.border.latch_listener = self._keep_stops
        if self.learning is not None:
            self.border.listener = self.learning.hear
            self.border.motion_listener = self.learning.hear_motion
        self.dropped = self._continue(beside)  # why crew limits of the state are left out
        self._process_s = 0.0  # CPU time of the whole process before the last halt
        self._process_at_s: float | None = None  # process time at the last start; None: halted
        self._broken = BreachWords()

    def _beside(self) -> dict[str, Any]:
        """Return what is saved beside the twin's state: alerts, crew limits, what was learned."""
        learned = {} if self.learning is None else {"learning": self.learning.memory()}
        return {"alerts": self.alerts.memory(), **learned}

    def _continue(self, beside: Mapping[str, Any]) -> list[str]:
        """Continue from what `_beside` returned; return what is left out, in sentences."""
        if self.learning is not None and "learning" in beside:
            self.learning.restore(beside["learning"])
        return self.alerts.restore(beside["alerts"]) if "alerts" in beside else []

    def command_alerts(self, words: str) -> str:
        """Execute a command to the alert list and save it at once; return the answer in words.

        Raises:
            InputError: it is not possible.
        """
        answer = self.alerts.command(words)
        if self._keeper is not None and self.border.epoch_ns is not None:
            self._keeper.request()
        elif self._keeper is not None:
            self._keep_stops(self.border.latched)
        return answer

    def begin(self, ros_now_ns: int) -> int:
        """Start, or resume after `halt`; return the epoch: ROS time of t = 0 [ns]."""
        steady_now_ns = time.monotonic_ns()
        lead_ns = round(START_LEAD_S * 1e9)
        if self._params.wait_for:  # compilation may have taken that long already
            lead_ns = max(lead_ns, round(AWAITED_LEAD_S * 1e9) + self._made_ns - steady_now_ns)
        speed = self._params.speed
        at_ns = self.twin.time_ns
        epoch_ns = ros_now_ns + lead_ns - round(at_ns / speed)
        # A slow run still needs whole heave samples, a fast one the same real time to get them.
        delay_ns = round(self._params.input_delay_s * max(1.0, speed) * 1e9 / speed)
        origin_ns = steady_now_ns + lead_ns + delay_ns
        if self.granted is not None:  # a cycle may begin as soon as the time of its end is granted
            epoch_ns = ros_now_ns - at_ns
            origin_ns = ros_now_ns + self.pacer.slot_ns
            self.granted.begin(ros_now_ns)
            self.border.motion_ns = self.border.lower_end_ns = None  # of another epoch
        self._ros_ahead_ns = ros_now_ns - steady_now_ns
        described = describe_session(self._described, self.twin, epoch_ns) | self._log.begin(at_ns)
        self._inputs.begin()
        self._publish(topics.SESSION_TOPIC, encode_session(described, self._published()))
        self.border.seats.resume(at_ns, self.last.winches if at_ns > 0 else ())
        if at_ns > 0:
            self._inputs.invalidate_inputs()
        self.border.epoch_ns = epoch_ns
        # before the first snapshot, at which alerts of a saved state would end without them
        self.alerts.take_rows(self.rows(self._ros_ahead_ns))
        self._publisher.start(epoch_ns)
        if self.learning is not None:
            self.learning.start(self.twin)
        pacing.raise_other_threads()
        self._process_at_s = time.process_time()
        self.pacer.start(origin_ns)
        return epoch_ns

    def _motion_reach_ns(self) -> int | None:
        """Return the ROS time up to which ship and lower-end motion are known; None: neither of
        them is moved.
        """
        border, scene = self.border, self.scene
        if border.epoch_ns is None:
            return 0
        moves = ((border.motion_ns, scene.sea_state.moves),
                 (border.lower_end_ns, scene.ropes[0].is_led))  # fmt: skip
        if any(newest_ns is None and awaited for newest_ns, awaited in moves):
            return 0
        newest = [newest_ns for newest_ns, _ in moves if newest_ns is not None]
        return border.epoch_ns + min(newest) if newest else None

    def describe_again(self) -> None:
        """Begin a new session at the next cycle, for a recorder that has joined."""
        epoch_ns = self.border.epoch_ns
        if epoch_ns is None:
            return

        def mark() -> None:
            described = describe_session(self._described, self.twin, epoch_ns)
            self._inputs.begin()
            self._log.take(SessionStart(self.twin.time_ns, described))

        self._inputs.at_next_slot(mark)

    def _take_entry(self, entry: LogEntry) -> None:
        """Log inputs; an emergency stop or a cut is saved with this cycle, to outlive a kill."""
        self._log.take(entry)
        if (keeper := self._keeper) is None:
            return
        for call in entry.calls:
            if call.method == "submit_cut":
                keeper.request()
            if call.method != "submit_command":
                continue
            _, command, winch = call.arguments
            if command.kind == RESET:
                self._stopped.discard(winch)
            elif command.kind == EMERGENCY_STOP and winch not in self._stopped:
                self._stopped.add(winch)
                keeper.request()

    def _keep_stops(self, winches: set[str]) -> None:
        """Save the state with the emergency stops that wait for the end of a pause.

        The twin itself executes them in the first cycle after it, where they are logged.
        """
        if self._keeper is None:
            return
        stopped = self.twin.branch()
        for winch in winches:
            stopped.submit_command(None, WinchCommand(EMERGENCY_STOP), winch)
        self._keeper.keep(stopped)

    def halt(self) -> None:
        """Stop after the current cycle, publish all computed snapshots and save the state."""
        self.pacer.stop()
        self._publisher.stop()
        if self.learning is not None:
            self.learning.stop()
        self._process_s, self._process_at_s = self._processor_s(), None
        self.border.epoch_ns = None
        if self._keeper is not None:
            self._keeper.finish()
        pacing.reset_threads()

    def save(self) -> tuple[bool, str]:
        """Save the state at the end of the present cycle; return success and text."""
        if self._keeper is None:
            return False, "no file: give the parameter save_state when the simulation is configured"
        saving = self._keeper.health()
        if self.border.epoch_ns is not None:
            self._keeper.request()
            words = "`simulation: saving` of diagnostics has the result"
            return True, f"saving to {saving.path}; {words}"
        if saving.saved_s is None or saving.trouble:
            self._keep_stops(self.border.latched)
        self._keeper.finish_writing()
        saving = self._keeper.health()
        if saving.saved_s is None or saving.trouble:
            return False, saving.trouble or f"no state in {saving.path}: the solver has failed"
        return True, f"paused, the state is in {saving.path}"

    @property
    def last(self) -> Snapshot:
        """Return the last snapshot."""
        return self.pacer.last or self._first

    def summary(self) -> RunSummary:
        """Return the run summary up to now."""
        saving = self._keeper.health() if self._keeper is not None else None
        state = str(saving.path) if saving is not None and saving.saved_s is not None else None
        changes = self.protection.changes if self.protection is not None else 0
        health = self.pacer.health()
        summary = summarise(self.twin, self.last, health)
        cpu_usage = None
        if health.granted_s > 0.0:
            used_s = (health.processor_s, self._publisher.processor_s, self._processor_s())
            cpu_usage = asdict(CpuUsage(*(100.0 * cpu_s / health.granted_s for cpu_s in used_s)))
        trouble = saving.trouble if saving is not None else ""
        newest = None if self.learning is None else self.learning.learner.newest
        return replace(
            summary,
            learned=[] if newest is None else newest.rows(),
            alarms=[] if self.learning is None else self.learning.alarms.as_json(),
            state=state,
            not_kept=trouble,
            mixed=self.border.mixed,
            level_changes=changes,
            core_share=cpu_usage,
        )

    def _processor_s(self) -> float:
        """Return the CPU time of the whole process while it was running in real time."""
        at_s = self._process_at_s
        return self._process_s + (0.0 if at_s is None else time.process_time() - at_s)

    def notices(self) -> Iterator[str]:
        """Return new changes of the accuracy level and newly violated limits, a sentence each."""
        yield from self._broken.of(self.last)
        while self.protection is not None and self.protection.said:
            yield self.protection.said.popleft()
        if self.learning is not None:
            yield from self._learned(self.learning)
            for words in self.learning.new_alarms():
                self._publish(topics.ALARM_TOPIC, encode_text(words))
                yield f"fault alarm: {words}" if words else "the fault alarm was acknowledged"

    def _learned(self, learning: LiveLearning) -> Iterator[str]:
        """Publish figures that were learned since, and take them over if that is wanted."""
        estimate, epoch_ns = learning.take_new(), self.border.epoch_ns
        if estimate is None or epoch_ns is None:
            return
        stamp_ns = epoch_ns + round(estimate.time_s * 1e9)
        self._publish(topics.ESTIMATE_TOPIC, encode_estimate(stamp_ns, estimate.rows()))
        yield f"learned {estimate.words()}"
        if self._params.apply_learned:
            _, words = learning.apply()
            yield words

    def arrival_ns(self, ros_now_ns: int) -> int | None:
        """Return the ROS time of a message that arrives now; None if speed is not 1."""
        return ros_now_ns if self._params.speed == 1.0 else None

    def rows(self, ros_ahead_ns: int) -> list[Status]:
        """Return the diagnostics rows of solver, pacing, inputs, messages and clocks.

        ros_ahead_ns: ROS time less steady time now [ns].
        """
        health = self.pacer.health()
        rows = [self.summary().row(), *statuses(self.last, health)]
        if self.protection is not None:
            rows.append(level_row(self.protection, self.last))
        rows += self.border.rows()
        rows.append(publishing_row(self._publisher.error, health.lost_snapshots))
        rows.append(self.alerts.row())
        if self._keeper is not None:
            rows.append(saving_row(self._keeper.health()))
        if self.learning is not None:
            rows += [self.learning.row(health.granted_s), self.learning.fault_row()]
        if self.border.epoch_ns is not None and self.granted is None:
            rows.append(clock_row((ros_ahead_ns - self._ros_ahead_ns) * 1e-9))
        elif self.border.epoch_ns is not None and self.granted is not None:
            rows.append(granted_row(self.granted))
        return rows


def _begin(
    scene: Scene, setup: RunSetup, params: SimulationParams
) -> tuple[Twin, str, Mapping[str, Any]]:
    """Return the twin in static equilibrium or at a saved state, a text saying which, and what was
    saved beside the state.
    """
    if not params.from_state:
        return setup.make(scene, None), "starting from static equilibrium", {}
    path = Path(params.from_state).resolve()
    if params.from_state == params.save_state and not path.exists():
        words = f"starting from static equilibrium: no saved state {path} yet"
        return setup.make(scene, None), words, {}
    state = load_state(path)
    twin = setup.make(scene, state)
    return twin, f"resuming from {path} at {twin.time_ns * 1e-9:.2f} s", state.beside


def _protection_of(twin: Twin, params: SimulationParams) -> OverloadProtection | None:
    """Return the accuracy levels, at one that is real-time on this machine; None: disabled."""
    if not params.overload_protection:
        return None
    protection = OverloadProtection(twin)
    if protection.place[1] == 1:
        return None
    slot_s = pacing.steps_in_slot(twin.step_s) * twin.step_s
    protection.start_at(protection.measure(slot_s, params.speed))
    return protection


def _steps_to_do(twin: Twin, stop_after_s: float) -> int:
    """Return the number of steps left until the simulation time at which to stop; 0: no end."""
    if stop_after_s == 0.0:
        return 0
    remaining = round((stop_after_s - twin.time_ns * 1e-9) / twin.step_s)
    if remaining <= 0:
        where = f"node simulation, parameter stop_after_s {stop_after_s:g}"
        problem = f"the saved state is at {twin.time_ns * 1e-9:g} s already"
        raise InputError(where, problem, "set a later end")
    return remaining
