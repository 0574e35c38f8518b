"""Learning beside a twin: the worker's queue, the live learner, taking over, the tare, the row."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import numpy as np
import pytest
from learned_lift import NOISE_N, SECONDS, lift, recorded
from small_scene import SMALL_SCENE

from rope_twin import load_scene
from rope_twin.errors import InputError, StateError
from rope_twin.estimation.figures import BIAS, INDEX
from rope_twin.estimation.live import LiveLearning
from rope_twin.estimation.worker import Input, Motion, Reading, Worker, WorkerCall
from rope_twin.messages.cdr import typestore
from rope_twin.messages.reports import FIGURE_COLUMNS, ROW, Level, encode_estimate
from rope_twin.topics import BY_NAME, ESTIMATE_TOPIC
from rope_twin.twin.input_queue import InputQueue
from rope_twin.twin.readings import Measurement
from rope_twin.twin.twin import Twin


class Counting:
    """A task that counts what it takes and works as often as it took something."""

    def __init__(self, fails: bool = False) -> None:
        self.taken: list[Input] = []
        self.left, self.fails = 0, fails
        self.threads: set[str] = set()

    def take(self, inputs: Input) -> None:
        self.taken.append(inputs)
        self.left += 1

    def work(self) -> bool:
        if self.fails:
            raise RuntimeError("no lanes")
        self.threads.add(threading.current_thread().name)
        self.left = max(self.left - 1, 0)
        return self.left > 0


def test_every_task_gets_all_inputs_and_a_failed_one_stands() -> None:
    """The others go on; the reason is kept; a call is made in the worker's thread."""
    good, bad = Counting(), Counting(fails=True)
    worker = Worker(bad, good)
    called = threading.Event()
    worker.take(Motion(0.0, 0.1, 0.0, 200.0))
    worker.take(Reading(0.0, 1e5))
    worker.take(WorkerCall(called.set))
    worker.start()
    assert called.wait(30.0)
    while good.left or not bad.taken:
        called.wait(0.01)
    worker.stop()
    assert [type(one) for one in good.taken] == [Motion, Reading]
    assert good.threads == {"twin-worker"}
    assert worker.trouble(bad) == "no lanes"
    assert worker.trouble(good) == ""
    assert worker.processor_s > 0.0
    worker.stop()  # again: without effect


def new_learning(folder: Path) -> tuple[Twin, InputQueue, LiveLearning]:
    """Return a twin of the small scene, its queue, and learning beside it."""
    path = folder / "small.yaml"
    path.write_text(
        SMALL_SCENE + f"learning: {{pin_range_n: {NOISE_N / 0.0075}, friction_pct: 0.0, "
        "friction_uncertainty_pct: 0.001, heave_delay_s: 0.0, heave_delay_uncertainty_s: 0.001}\n"
    )
    twin = Twin(load_scene(path))
    twin.prescribe_motion()
    queue = InputQueue(twin, twin)
    return twin, queue, LiveLearning(twin.scene, queue)


@pytest.mark.parametrize("part", ["alarms", "learner"])
def test_a_watch_that_has_failed_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    """Its row must not stay at the last time without a fault."""
    _, _, learning = new_learning(tmp_path)
    assert learning.fault_row().level is Level.OK

    def fail() -> bool:
        raise RuntimeError("no lanes")

    monkeypatch.setattr(getattr(learning, part), "work", fail)
    learning.worker.work()
    row = learning.fault_row()
    assert (row.level, row.message) == (Level.WARN, "nothing is tested any more: no lanes")


def test_a_live_twin_learns_and_takes_over(tmp_path: Path) -> None:
    """Weight is learned from what the load cell says, taken over, and the tension agrees then."""
    twin, queue, learning = new_learning(tmp_path)
    series = lift()
    began = threading.active_count()
    learning.start(twin)
    learning.worker.stop()  # its work is done here, in step with the twin
    learning.worker._stopping.clear()
    assert threading.active_count() == began
    heave, tension = series.heave.table, series.tension.table
    line = dict(series.line_out.table)
    said: list[str] = []
    row = learning.row(1.0)
    assert (row.name, row.level) == (ROW, Level.OK)
    with pytest.raises(InputError, match="nothing was learned yet"):
        learning.learner.factors_to_apply()
    assert learning.apply()[0] is False
    for k in range(int(SECONDS / 0.05)):
        at = k * 0.05
        for t, z, v in heave[k : k + 1]:
            queue.submit_heave(round(t * 1e9), float(z), float(v))
        stamp, force = tension[k]
        learning.hear(Measurement.of_winch(round(stamp * 1e9), line[stamp], 0.0, float(force)))
        learning.worker.take(Motion(at, float(heave[k, 1]), float(heave[k, 2]), line[stamp]))
        if k % 200 == 0:
            if k == 0:
                queue.advance(1)  # the slot in which the state to begin from is taken
            learning.worker.work()
            if (found := learning.take_new()) is not None:
                said.append(found.words())
    learning.worker.work()
    assert learning.learner.trouble == ""
    newest = learning.learner.newest
    assert newest is not None
    theta, _, _ = recorded()
    weight = next(one for one in newest.figures if one.name == "submerged_weight")
    truth = weight.prior * np.exp(theta[0])
    half = weight.high - weight.low
    assert weight.low - 0.5 * half < truth < weight.high + 0.5 * half
    assert said
    assert "after 1 min" in said[0]
    ok, words = learning.apply()
    assert ok, words
    queue.advance(5)
    assert twin.inputs.figures.at(10**12)["submerged_weight"] == pytest.approx(
        newest.factors["submerged_weight"]
    )
    assert "current" not in newest.factors
    values = learning.row(100.0).values
    assert "submerged_weight" in values
    message = typestore().deserialize_cdr(
        encode_estimate(123, newest.rows()), BY_NAME[ESTIMATE_TOPIC].type_name
    )
    assert message.width == len(newest.figures)
    assert [one.name for one in message.fields] == FIGURE_COLUMNS.split()
    memory = json.loads(json.dumps(learning.memory(), allow_nan=False))
    again = LiveLearning(twin.scene, queue)  # of a simulation that was killed and goes on
    again.restore(memory)
    again.start(twin)
    again.worker.stop()
    again.worker._stopping.clear()
    queue.advance(1)
    again.worker.work()
    estimator = again.learner.estimator
    assert estimator is not None
    np.testing.assert_array_equal(estimator.theta, newest.belief.mean)
    np.testing.assert_array_equal(estimator.belief.covariance, newest.belief.covariance)
    words = f"continues from {newest.minutes} learned minutes; the next one is learned from at "
    assert again.row(1.0).message.startswith(words)
    assert again.memory() == memory


def test_a_tare_and_a_freeze(tmp_path: Path) -> None:
    """A tare narrows the bias at once; a frozen learner says why and works no more."""
    _, _, learning = new_learning(tmp_path)
    before = learning.learner._prior.gaussian.sd
    ok, _ = learning.tare()
    learning.worker.work()
    assert ok
    after = learning.learner._prior.gaussian.sd
    assert after[INDEX[BIAS]] == pytest.approx(0.1 * before[INDEX[BIAS]])
    learning.learner.freeze("the load pin is stuck")
    assert learning.row(1.0).level is Level.WARN
    assert "stuck" in learning.row(1.0).message
    assert learning.learner.work() is False
    learning.learner.freeze("")
    assert learning.learner.trouble == ""


def test_scenes_that_cannot_be_learned_are_refused_at_the_start() -> None:
    """The parameter `learn` of such a scene is one sentence, not a thread that fails."""
    scene = load_scene("two_line_loop")
    with pytest.raises(InputError, match="over a sheave"):
        LiveLearning(scene, None)  # type: ignore[arg-type]


def test_a_twin_without_a_state_to_begin_from_steps_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cut rope freezes the learner with the reason; the paced thread does not fail."""

    def refuse(twin: Twin) -> None:
        raise StateError("live state: the rope was cut")

    monkeypatch.setattr("rope_twin.estimation.live.live_state", refuse)
    twin, queue, learning = new_learning(tmp_path)
    learning.start(twin)
    learning.worker.stop()
    learning.worker._stopping.clear()
    queue.advance(1)
    learning.worker.work()
    assert "the rope was cut" in learning.learner.trouble


def test_what_the_twin_refuses_is_not_learned_from(tmp_path: Path) -> None:
    """A line out in feet, tension in a unit of its own, NaN and a stamp that comes twice."""
    twin, _, learning = new_learning(tmp_path)
    learning.see(twin.snapshot())
    mbl_n, lines = twin.scene.ropes[0].breaking_load_n, (200.0, 656.2, 200.1, -50.0, np.nan, 200.2)
    forces = 1e5, 1.1e5, 3.0 * mbl_n, 1.2e5, 1.3e5, -0.5 * mbl_n
    for k, (line_m, force_n) in enumerate(zip(lines, forces, strict=True)):
        reading = Measurement.of_winch(k * 50_000_000, line_m, 0.0, force_n)
        for _ in range(2):
            learning.hear(reading)
            twin.submit_measurement(reading)
    learning.worker.work()
    lift, counted = learning.learner._lift, twin.snapshot().inputs["winch_measured"]
    assert lift.tension.table[:, 1].tolist() == [1e5, 1.1e5, 1.2e5, 1.3e5]
    assert lift.counter.table[:, 1].tolist() == [200.0, 200.1, 200.2]
    assert (counted.accepted, counted.refused) == (6, 5 + 6)
    learning.start(twin)  # after a pause
    learning.worker.stop()
    learning.hear(Measurement.of_winch(10_000_000, 200.0, 0.0, 0.9e5))
    learning.worker._stopping.clear()
    learning.worker.work()
    assert lift.tension.table[1].tolist() == [0.01, 0.9e5]


def test_tension_before_a_tare_is_forgotten(tmp_path: Path) -> None:
    """Its zero was another; the raw line out and the motion stay."""
    twin, _, learning = new_learning(tmp_path)
    learning.see(twin.snapshot())
    for k in range(10):
        learning.hear(Measurement.of_winch(k * 50_000_000, 200.0 + 0.01 * k, 0.0, 1e5 + k))
    for another_clock_ns in (10**15, -(10**15)):  # later readings would be forgotten too
        learning.hear(Measurement.of_winch(another_clock_ns, 200.1, 0.0, 1e5))
    learning.worker.work()
    lift = learning.learner._lift
    assert lift.counter.table[:, 1].tolist() == [200.0 + 0.01 * k for k in range(10)]
    assert len(lift.tension.table) == 10
    learning.tare()
    learning.hear(Measurement.of_winch(500_000_000, 200.1, 0.0, 0.9e5))
    learning.worker.work()
    assert lift.tension.table.tolist() == [[0.5, 0.9e5]]
    assert len(lift.counter.table) == 11
