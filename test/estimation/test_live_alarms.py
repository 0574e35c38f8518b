"""Alarms beside a twin: published, a row, frozen learning, quality index, acknowledged."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from learned_lift import NOISE_N, lift
from test_live_learning import new_learning

from rope_twin.estimation.causes import STUCK_PIN, STUCK_SENSOR
from rope_twin.estimation.live import ROW, LiveLearning
from rope_twin.estimation.worker import Motion
from rope_twin.messages.cdr import encode_text, typestore
from rope_twin.messages.reports import Level, alarm_words
from rope_twin.topics import ALARM_TOPIC, BY_NAME
from rope_twin.twin.readings import Measurement

STUCK_S, SECONDS = 70.0, 75.0


def test_a_stuck_load_pin_is_an_alarm_until_it_is_acknowledged(tmp_path: Path) -> None:
    """Found after 1 s; the row is an error, learning is frozen, the remark reaches the twin."""
    twin, queue, learning = new_learning(tmp_path)
    learning.start(twin)
    learning.worker.stop()
    learning.worker._stopping.clear()
    assert learning.alarms.row().level is Level.OK
    assert learning.acknowledge() == (False, "there is no alarm to acknowledge")
    series = lift()
    line = dict(series.line_out.table)
    queue.advance(1)
    held = float(series.tension.table[round(STUCK_S / 0.05), 1])
    for k in range(round(SECONDS / 0.05)):
        at, force = (float(one) for one in series.tension.table[k])
        z, v = (float(one) for one in series.heave.table[k, 1:])
        force = held if at >= STUCK_S else force
        learning.hear(Measurement.of_winch(round(at * 1e9), line[at], 0.0, force))
        learning.worker.take(Motion(at, z, v, line[at]))
        if k % 100 == 99:
            learning.worker.work()
    assert NOISE_N > 0.0
    alarm = learning.alarms.newest
    assert alarm is not None
    assert alarm.causes == (STUCK_PIN,)
    assert alarm.found_s == pytest.approx(STUCK_S + 1.0, abs=0.06)
    row = learning.alarms.row()
    assert (row.name, row.level) == (ROW, Level.ERROR)
    assert row.values["causes"] == STUCK_PIN
    assert STUCK_PIN in learning.learner.trouble
    (words, *reminders) = learning.new_alarms()
    assert words == alarm.words
    assert not reminders
    queue.advance(1)
    assert any(STUCK_PIN in one.warning for one in twin.snapshot().inputs.values())
    (reported,) = learning.alarms.as_json()
    assert STUCK_PIN in alarm_words(reported)
    again = LiveLearning(twin.scene, queue)  # of a simulation that was killed and goes on
    again.restore(json.loads(json.dumps(learning.memory(), allow_nan=False)))
    assert again.alarms.newest == alarm
    assert next(again.new_alarms()) == alarm.words
    again.start(twin)
    again.worker.stop()
    again.worker._stopping.clear()
    queue.advance(1)
    again.worker.work()
    assert again.alarms.row().level is Level.ERROR
    assert STUCK_PIN in again.learner.trouble
    assert not list(again.new_alarms()), "raised once"
    queue.advance(round(SECONDS / (1e-9 * twin.step_ns)))
    ok, _ = learning.acknowledge()
    assert ok
    queue.advance(1)  # the slot in which the state to begin from is taken
    learning.worker.work()
    estimator = learning.learner.estimator
    assert estimator is not None
    assert estimator.state_s == pytest.approx(SECONDS, abs=0.2)  # the fault is not learned
    assert estimator.model.lift.tension.table[0, 0] > SECONDS - 1.5
    assert len(estimator.model.lift.counter.table) > 0
    assert next(learning.new_alarms()) == ""
    assert learning.learner.trouble == ""


def test_a_stuck_motion_sensor_is_found_though_the_twin_moves_on(tmp_path: Path) -> None:
    """The twin refuses the repeats and goes on by itself; the rule hears the sensor."""
    twin, queue, learning = new_learning(tmp_path)
    learning.start(twin)
    learning.worker.stop()
    learning.worker._stopping.clear()
    series = lift()
    line = dict(series.line_out.table)
    queue.advance(1)
    for k in range(round(SECONDS / 0.05)):
        at, z, v = (float(one) for one in series.heave.table[k])
        force = float(series.tension.table[k, 1])
        learning.hear(Measurement.of_winch(round(at * 1e9), line[at], 0.0, force))
        learning.worker.take(Motion(at, z, v, line[at]))
        stuck = float(series.heave.table[min(k, round(STUCK_S / 0.05)), 1])
        learning.hear_motion(round(at * 1e9), stuck)
        if k % 100 == 99:
            learning.worker.work()
    alarm = learning.alarms.newest
    assert alarm is not None
    assert alarm.causes == (STUCK_SENSOR,)
    assert alarm.begun_s == pytest.approx(STUCK_S, abs=0.06)
    assert alarm.found_s == pytest.approx(STUCK_S + 1.0, abs=0.06)


def test_the_message_is_the_alarm_in_words() -> None:
    """A string, as the topic table says."""
    data = encode_text("line slip, since 12 s")
    message = typestore().deserialize_cdr(data, BY_NAME[ALARM_TOPIC].type_name)
    assert message.data == "line slip, since 12 s"


def test_tests_that_have_nothing_to_test_say_so(tmp_path: Path) -> None:
    """A load pin that is lost for minutes: the row is not OK."""
    alarms = new_learning(tmp_path)[2].alarms
    alarms._watch = cast("Any", SimpleNamespace(tested_s=400.0))
    rows = []
    for time_s in (401.0, 600.0):
        alarms.take(Motion(time_s, 0.0, 0.0, 200.0))
        rows.append((alarms.row().level, alarms.row().message))
    assert rows == [
        (Level.OK, "no fault, tested until 400 s"),
        (Level.WARN, "no fault until 400 s, and nothing is compared since"),
    ]
