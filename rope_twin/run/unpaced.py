"""A run as fast as possible: the same twin, the same inputs, the same bag, and no ROS.

The inputs are offered with the stamps that the ROS nodes use and as long before they are needed,
so the result equals that of a paced run to the bit.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace
from statistics import median

from rope_twin.cadence import DIAGNOSTICS_PERIOD_NS, due_topics, slot_of
from rope_twin.errors import BagError, SolverError, StateError
from rope_twin.messages import (
    Encoder,
    encode_cut,
    encode_diagnostics,
    encode_elevation,
    encode_epoch,
    encode_order,
    statuses,
)
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.input_log import InputLog, encode_json
from rope_twin.recording.session import Setup, describe_run, describe_session, encode_session
from rope_twin.run.ending import end_told
from rope_twin.run.inputs import FIRST_NS, LEAD_NS, encode_motion, offer, open_sea
from rope_twin.run.options import RunOptions
from rope_twin.run.summary import RunSummary, summarise
from rope_twin.scene.card import OTHER_SEA
from rope_twin.scene.change import at_setting
from rope_twin.scene.load import load_scene
from rope_twin.scene.rules.rigging import winches_by_name
from rope_twin.topics import SESSION_TOPIC, TOPICS
from rope_twin.twin.cutting.cutting import plan_for
from rope_twin.twin.hoisting.schedule import schedule_samples
from rope_twin.twin.hoisting.winch import input_of
from rope_twin.twin.input_queue import InputQueue
from rope_twin.twin.kinds import twin_kind
from rope_twin.twin.pacing import keep_pauses_short, steps_in_slot
from rope_twin.twin.recovery import Recovery
from rope_twin.twin.snapshot import Snapshot

ENOUGH_S = 3.0  # of computing say how fast a model is
UNPACED = "unpaced"  # name of the only run in a bag
BLIND_S = 1.0  # steps without a look at the rope, where only the speed is wanted

Message = tuple[int, str, bytes]  # twin time [ns], topic, CDR


class UnpacedRun:
    """One twin with its inputs and its bag, stepped slot by slot by whoever calls."""

    def __init__(self, options: RunOptions, epoch_ns: int | None = None) -> None:
        """Build, compile and open what is needed; `epoch_ns`: ROS time of t = 0.

        By default the run begins now: with a state to go on from, t = 0 lies before that.

        Raises:
            RopeTwinError: scene, bag or directory are wrong; one sentence.
        """
        scene = at_setting(load_scene(options.scene), options.elements, options.step_s)
        self._cut = plan_for(scene, options.cut)
        self._sea = open_sea(
            scene, options.bag, options.topic, options.sea_offset_s, poses=options.poses
        )
        self._options = options
        start = options.start_from
        kind = twin_kind(options.energy, options.error_band, options.watch)
        self.twin = kind(scene) if start is None else kind.restore(start, scene)
        self.twin.failure_folder = options.failure_folder
        self.twin.expect_motion(None)  # `_offer` feeds what `open_sea` gives, and nothing else
        if options.other_sea:
            self.twin.doubt_card(OTHER_SEA)
        self._recovery = Recovery(self.twin)
        self.epoch_ns = time.time_ns() - self.twin.time_ns if epoch_ns is None else epoch_ns
        keep_pauses_short()
        self._bag = None if options.record is None else BagWriter(options.record, TOPICS)
        self._steps = steps_in_slot(self.twin.step_s)
        self._slot_ns = self._steps * self.twin.step_ns
        self._encoder = Encoder(self.epoch_ns)
        self._log = InputLog(UNPACED)
        log = None if self._bag is None else self._log.take
        self._inputs = InputQueue(self.twin, self._recovery, log)
        self._messages: deque[Message] = deque()  # of inputs: offered, not yet recorded
        self._sequence = Counter[str]()  # messages in the bag, by topic
        # A state to go on from has been offered more than its bag has: that much comes once more.
        self._known_ns = {} if start is None else self.twin.newest_ns()
        self._offered_ns = FIRST_NS if self.twin.steps == 0 else self.twin.time_ns
        self._told_ns = self.twin.time_ns
        self._saved = False
        self.last: Snapshot = self.twin.snapshot()
        self._record([(self.twin.time_ns, "twin/epoch", encode_epoch(self.epoch_ns))])
        if self._bag is not None:
            run = describe_run(scene, _setup(options), 0.0)
            described = describe_session(run, self.twin, self.epoch_ns)
            described |= self._log.begin(self.twin.time_ns)
            self._record([(self.twin.time_ns, SESSION_TOPIC, encode_session(described, {}))])

    @property
    def sea_note(self) -> str:
        """What was wrong with the sea that is replayed and what is done about it; or nothing."""
        return self._sea.note if self._sea else ""

    def advance_slot(self) -> Snapshot:
        """Offer inputs, step, record. Raises SolverError; the last good state is kept."""
        began_ns = self.twin.time_ns
        self._offer(began_ns + self._slot_ns + LEAD_NS)
        self._inputs.advance(self._steps)
        self.last = snapshot = self._inputs.snapshot()
        for name, content in self._log.messages(snapshot):
            self._record([(began_ns, name, encode_json(content))])
        while self._messages and self._messages[0][0] < snapshot.stamp_ns:
            self._record([self._messages.popleft()])
        if self._bag is not None:
            for name in due_topics(*slot_of(snapshot), snapshot):
                data = self._encoder.encode(name, snapshot)
                self._record([(snapshot.stamp_ns, name, data)])
        if snapshot.stamp_ns - self._told_ns >= DIAGNOSTICS_PERIOD_NS:
            self._tell(snapshot)
        return snapshot

    def advance_blindly(self, time_s: float) -> None:
        """Offer inputs and step, with no snapshot and no record. Raises SolverError."""
        steps = max(1, round(time_s / self.twin.step_s))
        self._offer(self.twin.time_ns + steps * self.twin.step_ns + LEAD_NS)
        self._messages.clear()
        self._inputs.advance(steps)

    def summary(self, error: str = "") -> RunSummary:
        """The figures so far."""
        bag = str(self._options.record) if self._options.record else None
        state = str(self._options.save) if self._saved else None
        return replace(summarise(self.twin, self.last, None), bag=bag, state=state, error=error)

    def save(self) -> None:
        """Save the state where the options say. Raises StateError."""
        if self._options.save is not None:
            self.twin.save(self._options.save)
            self._saved = True

    def close(self) -> None:
        """End the bag."""
        if self._bag is not None:
            self._bag.close()

    def _offer(self, until_ns: int) -> None:
        """Give the twin all samples before `until_ns` that it has not had."""
        messages: list[Message] = []
        for heave in self._sea.between(self._offered_ns, until_ns) if self._sea else ():
            at_ns = heave.stamp_ns
            if at_ns > self._known_ns.get("heave", FIRST_NS - 1):
                offer(self._inputs, heave)
            messages.append((at_ns, *encode_motion(self.epoch_ns + at_ns, heave)))
            if heave.elevation_m is not None:
                data = encode_elevation(self.epoch_ns + at_ns, heave.elevation_m)
                messages.append((at_ns, "sea/elevation", data))
        for name, winch in winches_by_name(self.twin.scene).items():
            for command in schedule_samples(winch, self._offered_ns, until_ns):
                at_ns, order = command.stamp_ns, command.order
                if at_ns > self._known_ns.get(input_of(order, name), FIRST_NS - 1):
                    self._inputs.offer_order(at_ns, order, name)
                messages.append((at_ns, *encode_order(self.epoch_ns + at_ns, order, name)))
        if self._cut is not None and self._offered_ns <= self._cut.at_ns < until_ns:
            cut = self._cut
            at_ns = cut.at_ns
            if at_ns > self._known_ns.get("cut", FIRST_NS - 1):
                self._inputs.offer_cut(at_ns, cut.below_m, cut.rope)
            messages.append((at_ns, *encode_cut(self.epoch_ns + at_ns, cut.below_m, cut.rope)))
        self._messages.extend(sorted(messages, key=lambda message: message[0]))
        self._offered_ns = until_ns

    def _tell(self, snapshot: Snapshot) -> None:
        self._told_ns = snapshot.stamp_ns
        stamp_ns = self.epoch_ns + snapshot.stamp_ns
        rows = statuses(snapshot, None)
        self._record([(snapshot.stamp_ns, "diagnostics", encode_diagnostics(stamp_ns, rows))])

    def _record(self, messages: list[Message]) -> None:
        if self._bag is not None:
            for at_ns, name, data in messages:
                self._sequence[name] += 1
                self._bag.write(name, self.epoch_ns + at_ns, data, sequence=self._sequence[name])


def _setup(options: RunOptions) -> Setup:
    """What of the options the numbers depend on."""
    watch = options.watch
    return Setup(
        elements=options.elements,
        step_s=options.step_s,
        energy=options.energy,
        error_band=options.error_band,
        vibration=watch.vibration if watch else "",
        fatigue=watch.fatigue if watch else "",
        other_sea=options.other_sea,
        feeds_itself=True,
    )


def measure_alone(options: RunOptions, time_s: float) -> float:
    """Real-time factor of the model alone: the run's beginning once more, without waiting.

    The median over seconds, since other programs use the machine too.

    In a paced run every slot begins with what other programs left in the processor's caches, which
    costs a short step several times its own work; `RunSummary.paced_real_time_factor` has that.
    """
    run = UnpacedRun(replace(options, record=None, energy=False, error_band=False, watch=None))
    run.twin.failure_folder = None
    end_ns = run.twin.time_ns + time_s * 1e9
    enough_s = run.twin.statistics().computing_s + ENOUGH_S  # a state knows how long it took
    factors = []
    try:
        while run.twin.time_ns < end_ns and run.twin.statistics().computing_s < enough_s:
            before = run.twin.statistics()
            run.advance_blindly(min(time_s, BLIND_S))
            after = run.twin.statistics()
            simulated_s = (after.steps - before.steps) * run.twin.step_s
            factors.append(simulated_s / (after.computing_s - before.computing_s))
    except SolverError:
        pass  # the run itself has told; what was stepped counts
    return median(factors) if factors else 0.0


def run_unpaced(
    options: RunOptions,
    report: Callable[[UnpacedRun], None],
    epoch_ns: int | None = None,
    say: Callable[[str], None] | None = None,
) -> RunSummary:
    """Run to the twin time `options.end_s`, or until told to end; `report` follows each slot.

    `say`: takes what is to be said before it begins.

    Raises:
        RopeTwinError: scene, bag, state or directory are wrong; one sentence.
    """
    run = UnpacedRun(options, epoch_ns)
    for words in filter(None, (run.sea_note, run.twin.told)):
        if say is not None:
            say(words)
    error = not_kept = ""
    step_ns = run.twin.step_ns
    last_ns = round((options.end_s or 0.0) * 1e9 / step_ns) * step_ns
    try:
        with end_told() as told:
            while run.twin.time_ns < last_ns and not told.is_set():
                run.advance_slot()
                report(run)
        run.save()
    except (SolverError, StateError, BagError) as failure:
        error = str(failure)
    finally:
        try:
            run.close()
        except BagError as failure:
            not_kept = str(failure)
    return replace(run.summary(error), not_kept=not_kept)
