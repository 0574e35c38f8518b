"""The protection: when a twin steps down and up, what changes with it, and in a paced run."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rope_twin import Snapshot, Twin, load_scene
from rope_twin.recording.motion_source import FIRST_NS, LEAD_NS, open_sea, submit
from rope_twin.scene.convergence import read_study
from rope_twin.scene.error_bound import RMS, AccuracyLevel, KnownError
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import march, variant
from rope_twin.twin.level import (
    MIN_CYCLES,
    TARGET_LOAD,
    WAIT_S,
    OverloadProtection,
    levels_of,
)
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.pacing import Pacer, SlotTimes, SnapshotQueue, steps_in_slot
from rope_twin.twin.winch.commands import schedule_samples
from validation.rigs import Rig, sine

MS = 1_000_000
RIG = Rig(length=500.0, elements=80, damping=2e5, ramp=2.0, drag=(1.2, 0.01), density=1025.0,
          current=((0.0, (0.4, 0.1)),))  # fmt: skip
HEAVE = sine(1.0, 7.0)


class Machine:
    """A protection on a machine that needs so much of each slot of 20 ms on the best level."""

    def __init__(self) -> None:
        self.scene, self.now_ns = load_scene("deep_lift"), 0
        self.levels = levels_of(self.scene)
        self.level, self.cut, self.study_error = self.levels[0], None, KnownError()
        self.protection = OverloadProtection(self)
        self.taken: list[AccuracyLevel] = []

    def set_level(self, level: AccuracyLevel) -> None:
        self.taken.append(level)

    def slot(self, load: float, late: bool | None = None) -> bool:
        """A slot; `load` is that of the best level."""
        level = self.protection.level
        load *= self.levels[0].step_ns / (level.step_ns * (1 << level.halvings))
        self.now_ns += 20 * MS
        ended_late = load > 1.0 if late is None else late
        return self.protection.judge(
            SlotTimes(self.now_ns, 20 * MS, round(load * 20 * MS), ended_late)
        )

    def run(self, load: float, seconds: float) -> int:
        """Run at this load for a time; return the number of level changes."""
        return sum(self.slot(load) for _ in range(round(seconds / 0.02)))


@pytest.fixture
def machine() -> Machine:
    return Machine()


def test_larger_steps_come_first_and_then_fewer_elements() -> None:
    levels = [(r.step_ns // MS, r.halvings) for r in levels_of(load_scene("deep_lift"))]
    assert levels == [(10, 0), (20, 0), (50, 0), (50, 1), (50, 2)]  # 100, 50 and 25 elements
    fine = variant(load_scene("deep_lift"), 100, 0.001)
    assert [r.step_ns // MS for r in levels_of(fine)][:6] == [1, 2, 5, 10, 20, 50]


@settings(max_examples=30)
@given(st.lists(st.floats(0.0, 0.65), min_size=50, max_size=100), st.integers(0, 49))
def test_a_machine_with_room_never_steps_down(loads: list[float], stalled: int) -> None:
    """Not even when the system stalls once for a second, and slots after that end late."""
    machine = Machine()
    for number, load in enumerate(loads):
        stall = 50.0 if number == stalled else 0.0
        assert not machine.slot(load + stall, late=stalled <= number < stalled + 20)
    assert machine.taken == []


@settings(max_examples=30)
@given(st.floats(0.9, 4.0))
def test_too_much_work_goes_to_the_first_rung_that_fits(load: float) -> None:
    machine = Machine()
    slots = 0
    while not machine.taken:
        machine.slot(load)
        slots += 1
        assert slots <= MIN_CYCLES
    work = [10.0 / (r.step_ns / MS * (1 << r.halvings)) for r in machine.levels]
    (at,) = (machine.levels.index(level) for level in machine.taken)
    assert load * work[at] <= TARGET_LOAD + 1e-9 or at == len(work) - 1
    assert at == 1 or load * work[at - 1] > TARGET_LOAD - 1e-9
    assert machine.run(load, 12.0) == 0


def test_three_slots_in_turn_that_cannot_be_in_time_are_enough(machine: Machine) -> None:
    machine.run(0.1, 1.0)
    moved = [machine.slot(3.0) for _ in range(3)]
    assert moved == [False, False, True]


def test_it_comes_back_one_rung_at_a_time_when_there_is_room(machine: Machine) -> None:
    machine.run(3.0, 0.5)
    low = machine.levels.index(machine.taken[-1])
    assert low > 1
    machine.run(0.1, (low + 0.5) * WAIT_S)
    climbed = [machine.levels.index(level) for level in machine.taken[1:]]
    assert climbed == list(range(low - 1, -1, -1))
    assert machine.protection.level == machine.levels[0]


def test_a_rung_that_must_be_left_again_soon_is_waited_for_longer(machine: Machine) -> None:
    """A machine that has room only as long as nothing is asked of it."""
    waits = []
    machine.run(3.0, 0.5)
    for _ in range(3):
        began = machine.now_ns
        while not machine.slot(0.1):
            pass
        waits.append((machine.now_ns - began) * 1e-9)
        assert machine.run(0.1, 0.5) == 0
        while not machine.slot(30.0):
            pass
    assert waits[0] == pytest.approx(WAIT_S, abs=0.6)
    assert waits[1] > 1.8 * waits[0]
    assert waits[2] > 1.8 * waits[1]


def test_a_setting_that_a_budget_bought_is_the_best_rung_of_its_ladder() -> None:
    """Finer than the study's: down from 0.5 ms and 301 elements, and all of them come back."""
    scene = variant(load_scene("shallow_lift"), 301, 0.0005)
    levels = levels_of(scene)
    work = [1.0 / (level.step_ns << level.halvings) for level in levels]
    assert levels[0] == AccuracyLevel(500_000)
    assert work == sorted(work, reverse=True)
    twin = Twin(scene)
    twin.advance(40)
    before_n = twin.snapshot().tension_top_n
    for level, elements in ((levels[-1], 301 >> levels[-1].halvings), (levels[0], 301)):
        twin.set_level(level)
        twin.advance(steps_in_slot(level.step_s))
        found = twin.snapshot()
        assert abs(len(found.element_tension_n) - elements) <= levels[-1].halvings
        assert found.tension_top_n == pytest.approx(before_n, rel=1e-2)


def test_before_the_start_it_takes_the_rung_that_fits_at_once(machine: Machine) -> None:
    assert not machine.protection.start_at(0.5)
    assert machine.protection.start_at(1.0)
    assert machine.protection.place[0] == 2
    assert machine.taken == [machine.levels[1]]
    assert machine.run(0.1, WAIT_S - 0.1) == 0, "the wait begins with the first slot"
    assert machine.run(0.1, 1.0) == 1


@pytest.mark.parametrize("energy", [False, True])
@pytest.mark.parametrize("error_interval", [False, True])
def test_time_line_and_payload_go_on_where_they_were(energy: bool, error_interval: bool) -> None:
    """With a winch that pays out, down two levels and back; each kind of twin."""
    twin = Twin(load_scene("deep_lift"), Monitors(energy, error_interval))
    twin.submit_speed(None, 0.5)
    twin.advance(200)
    for level in (
        AccuracyLevel(20 * MS),
        AccuracyLevel(50 * MS, 1),
        AccuracyLevel(20 * MS),
        AccuracyLevel(10 * MS),
    ):
        before, same = twin.snapshot(), twin.branch()
        twin.set_level(level)
        after = twin.snapshot()
        assert (after.stamp_ns, after.line_out_m) == (before.stamp_ns, before.line_out_m)
        assert np.array_equal(after.payload_position_m, before.payload_position_m)
        assert after.tension_top_n == before.tension_top_n
        twin.advance(4)
        later = twin.snapshot()
        assert later.stamp_ns - after.stamp_ns == 4 * level.step_ns
        V = later.payout_speed_m_per_s
        assert later.line_out_m - after.line_out_m == pytest.approx(4 * level.step_s * V, rel=0.05)
        assert len(later.element_tension_n) == pytest.approx(100 / (1 << level.halvings), abs=2)
        same.advance(4 * level.step_ns // same.step_ns)
        there = same.snapshot()
        assert there.stamp_ns <= later.stamp_ns < there.stamp_ns + same.step_ns
        if there.stamp_ns == later.stamp_ns:
            assert later.tension_top_n == pytest.approx(there.tension_top_n, rel=5e-4)


def test_a_run_that_was_down_for_a_while_is_right_again() -> None:
    """Against one that never was: within 0.05 % of the tension soon after it is up again."""
    same, moved = RIG.twin(), RIG.twin()
    alone = [snapshot.tension_top_n for snapshot in march(same, HEAVE, 12.0, 10)]
    seen = [snapshot.tension_top_n for snapshot in march(moved, HEAVE, 3.0, 10)]
    moved.set_level(AccuracyLevel(20 * MS, 1))
    seen += [one.tension_top_n for one in going_on(moved, 3.0, 5)]
    moved.set_level(AccuracyLevel(10 * MS))
    seen += [one.tension_top_n for one in going_on(moved, 6.0, 10)]
    apart = np.abs(np.array(seen) - alone) / np.mean(alone)
    assert apart[:30].max() == 0.0
    assert apart[30:].max() < 2e-3
    assert apart[-20:].max() < 5e-4


def going_on(twin: Twin, seconds: float, every: int) -> list[object]:
    """March a twin whose step has changed."""
    snapshots = []
    end_ns = twin.time_ns + round(seconds * 1e9)
    while twin.time_ns < end_ns:
        for k in range(1, every + 1):
            at_ns = twin.time_ns + k * twin.step_ns
            twin.submit_heave(at_ns, *HEAVE(at_ns * 1e-9))
        twin.advance(every)
        snapshots.append(twin.snapshot())
    return snapshots


def sailed(moves: Sequence[tuple[float, AccuracyLevel]], seconds: float) -> dict[int, Snapshot]:
    """deep_lift with its own sea and winch, and a level taken at each of these times; by stamp."""
    scene, waiting, snapshots = load_scene("deep_lift"), list(moves), {}
    twin, sea, submitted_ns = Twin(scene), open_sea(scene), FIRST_NS
    assert sea is not None
    while twin.time_ns < seconds * 1e9:
        if waiting and twin.time_ns >= waiting[0][0] * 1e9:
            twin.set_level(waiting.pop(0)[1])
        until_ns = twin.time_ns + 50 * MS + LEAD_NS
        for heave in sea.between(submitted_ns, until_ns):
            submit(twin, heave)
        for command in schedule_samples(scene.winch, submitted_ns, until_ns):
            twin.submit_command(command.stamp_ns, command.command)
        submitted_ns = until_ns
        twin.advance(1)
        snapshots[twin.time_ns] = twin.snapshot()
    return snapshots


def test_down_and_up_the_tension_stays_within_the_error_that_is_published() -> None:
    """deep_lift on half its elements at 50 ms from 15 to 30 s: rms there, and after the way back.

    Against the run that never left its level, whose own error counts as well. From one sample to
    the next the difference changes by three times as much at most, at the moves too.
    """
    alone = sailed((), 40.0)
    moved = sailed([(15.0, AccuracyLevel(50 * MS, 1)), (30.0, AccuracyLevel(10 * MS))], 40.0)
    scale = np.std([snapshot.tension_top_n for snapshot in alone.values()])
    study = read_study(load_scene("deep_lift"))
    assert study is not None
    published = sum(study.at(*own)[0].bound(RMS) for own in ((50, 0.05), (100, 0.01)))
    for begin, end in ((15.0, 30.0), (30.0, 40.0)):
        stamps = [ns for ns in moved if begin < ns * 1e-9 <= end]
        apart = [moved[ns].tension_top_n - alone[ns].tension_top_n for ns in stamps]
        assert 100.0 * np.sqrt(np.mean(np.square(apart))) / scale <= published
        assert 100.0 * np.abs(np.diff(apart)).max() / scale <= 3.0 * published


def test_a_state_that_was_saved_on_a_lower_rung_goes_on_to_the_bit(tmp_path: Path) -> None:
    twin = RIG.twin()
    list(march(twin, HEAVE, 1.0, 10))
    twin.set_level(AccuracyLevel(20 * MS, 1))
    going_on(twin, 1.0, 5)
    twin.save(tmp_path / "low.state")
    again = Twin.restore(tmp_path / "low.state", RIG.scene())
    assert again.level == twin.level
    assert again.time_ns == twin.time_ns
    for one in (twin, again):
        going_on(one, 1.0, 5)
        one.set_level(AccuracyLevel(10 * MS))
        going_on(one, 1.0, 10)
    assert again.snapshot().tension_top_n == twin.snapshot().tension_top_n
    assert again.level == AccuracyLevel(10 * MS)


def test_a_state_that_was_saved_after_the_way_back_goes_on_to_the_bit(tmp_path: Path) -> None:
    """The arrays have the capacity that those of a new twin have."""
    twin = RIG.twin()
    list(march(twin, HEAVE, 1.0, 10))
    for level in (AccuracyLevel(20 * MS, 1), AccuracyLevel(10 * MS)):
        twin.set_level(level)
        going_on(twin, 0.5, 5)
    twin.save(tmp_path / "back.state")
    again = Twin.restore(tmp_path / "back.state", RIG.scene())
    for one in (twin, again):
        going_on(one, 0.5, 10)
    assert again.snapshot().tension_top_n == twin.snapshot().tension_top_n


class Spent:
    """A clock that goes on only where time is waited for or spent: no other program counts."""

    def __init__(self) -> None:
        self.time_ns = 0

    def now_ns(self) -> int:
        return self.time_ns

    def wait_until(self, time_ns: int, interrupt: threading.Event) -> None:
        self.time_ns = max(self.time_ns, time_ns)


class Throttled(Twin):
    """A twin whose step takes as long as a far larger rope's, for its first second."""

    def __init__(self, scene: Scene, clock: Spent) -> None:
        super().__init__(scene)
        self._spent = clock

    def advance(self, steps: int) -> None:
        if self.time_ns < 1000 * MS:
            self._spent.time_ns += steps * 14 * MS >> self.level.halvings
        super().advance(steps)


def until(holds: Callable[[], bool], seconds: float = 300.0) -> None:
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_under_a_load_that_it_cannot_carry_it_steps_down_and_comes_back_after() -> None:
    """14 ms for each step of 10 ms: impossible on the best level. Nothing is skipped, and the
    tension stays that of a run without a load."""
    scene, clock = variant(RIG.scene(), 40), Spent()
    twin = Throttled(scene, clock)
    for k in range(400):
        at_ns = k * 25 * MS
        twin.submit_heave(at_ns, *HEAVE(at_ns * 1e-9))
    protection = OverloadProtection(twin, wait_s=0.3)
    handover = SnapshotQueue(10_000)
    pacer = Pacer(twin, handover, steps_in_slot(twin.step_s), clock=clock, last_step=300)
    taken: list[AccuracyLevel] = []

    def watch(slot: SlotTimes) -> bool:
        moved = protection.judge(slot)
        taken.extend([protection.level] if moved else [])
        return moved

    pacer.watch(watch)
    pacer.start(0)
    until(lambda: not pacer.health().running)
    pacer.stop()
    assert pacer.health().finished
    assert taken[0].step_ns >= 20 * MS
    assert taken[-1] == AccuracyLevel(10 * MS)
    assert pacer.health().behind_s == 0.0
    assert any(words.startswith("stepping down to accuracy level") for words in protection.said)
    assert protection.said[-1].startswith("stepping up to accuracy level 1 of ")
    snapshots = []
    while (snapshot := handover.take(0.0)) is not None:
        snapshots.append(snapshot)
    assert handover.lost == 0
    gaps = np.diff([0, *(snapshot.stamp_ns for snapshot in snapshots)])
    assert all(gap in (20 * MS, 50 * MS) for gap in gaps)
    alone = Twin(scene)
    for k in range(400):
        alone.submit_heave(k * 25 * MS, *HEAVE(k * 0.025))
    for snapshot in snapshots:
        alone.advance((snapshot.stamp_ns - alone.time_ns) // alone.step_ns)
        assert snapshot.tension_top_n == pytest.approx(alone.snapshot().tension_top_n, rel=2e-3)


def huge() -> Scene:
    """7,000 elements in steps of 1 ms."""
    return variant(RIG.scene(), 7000, 0.001)


def test_a_scene_that_is_too_much_for_any_machine_begins_lower() -> None:
    """Five times real time with 7,000 elements and 1 ms: five million nodes a second and more."""
    twin = Twin(huge())
    protection = OverloadProtection(twin)
    load = protection.measure(0.02, 50.0)
    assert load > 1.0
    assert protection.start_at(load)
    assert twin.level != AccuracyLevel(MS)
    assert "it would take" in protection.reason
    assert twin.snapshot().stamp_ns == 0
    assert OverloadProtection(RIG.twin()).measure(0.02, 0.01) < 0.6
