"""The grid of the twin, driven by a clock that only moves when someone waits or computes."""

from __future__ import annotations

import itertools
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ros_bench import PATIENCE_S

from rope_twin.errors import SolverError
from rope_twin.twin.pacing import (
    CATCH_UP,
    Pacer,
    SnapshotQueue,
    SteadyClock,
    keep_pauses_short,
    queue_depth,
    steps_in_slot,
)
from rope_twin.twin.snapshot import Snapshot

MS = 1_000_000
SLOT = 20 * MS


class FakeClock:
    """Time that jumps to where it is waited for; past `end_ns` the waiter stays until stopped."""

    def __init__(self, end_ns: int) -> None:
        self.time_ns = 0
        self.end_ns = end_ns
        self.ended = threading.Event()

    def now_ns(self) -> int:
        return self.time_ns

    def wait_until(self, time_ns: int, interrupt: threading.Event) -> None:
        if time_ns >= self.end_ns:
            self.ended.set()
            interrupt.wait()
            return
        self.time_ns = max(self.time_ns, time_ns)


class FakeTwin:
    """Takes a scripted time for each slot; notes when it was called."""

    step_ns = 10 * MS

    def __init__(self, clock: FakeClock, durations_ns: Iterable[int] = ()) -> None:
        self.clock = clock
        self.durations: Iterator[int] = iter(durations_ns)
        self.began_ns: list[int] = []
        self.steps = 0
        self.fails_at = -1
        self.error: Exception = SolverError("the rope: stage 2 of step 6 does not converge; stop.")

    def advance(self, steps: int) -> None:
        self.began_ns.append(self.clock.now_ns())
        if self.steps >= self.fails_at >= 0:
            raise self.error
        self.clock.time_ns += next(self.durations, MS)
        self.steps += steps

    def snapshot(self) -> Snapshot:
        return cast(Snapshot, SimpleNamespace(step=self.steps))


def run_to_end(
    durations_ns: Iterable[int] = (), slots: int = 10, speed: float = 1.0, **twin_fields: Any
) -> tuple[Pacer, FakeTwin, FakeClock, SnapshotQueue]:
    """Pace a fake twin until the clock would pass the last slot's beginning."""
    clock = FakeClock(round(slots * SLOT / speed))
    twin = FakeTwin(clock, durations_ns)
    for name, value in twin_fields.items():
        setattr(twin, name, value)
    handover = SnapshotQueue(depth=1000)
    pacer = Pacer(twin, handover, steps_per_slot=2, speed=speed, clock=clock)
    pacer.start(0)
    wait_for_end(pacer, clock)
    return pacer, twin, clock, handover


def wait_for_end(pacer: Pacer, clock: FakeClock) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not clock.ended.wait(0.001) and pacer.health().running:
        assert time.monotonic() < deadline, "the worker neither ended nor waited"


def test_slots_begin_on_the_absolute_grid() -> None:
    pacer, twin, _, handover = run_to_end([5 * MS, 19 * MS, MS], slots=6)
    pacer.stop()
    assert twin.began_ns == [k * SLOT for k in range(6)]
    assert [handover.take(0.0).step for _ in range(6)] == [2, 4, 6, 8, 10, 12]  # type: ignore[union-attr]
    health = pacer.health()
    assert (health.steps, health.late_steps, health.worst_lateness_s) == (12, 0, 0.0)
    assert health.late_ago_s is None
    assert health.error == ""
    assert not health.running


def test_real_time_factor_is_simulated_over_computing() -> None:
    pacer, *_ = run_to_end([2 * MS] * 10, slots=10)
    pacer.stop()
    health = pacer.health()
    assert health.computing_s == pytest.approx(0.02)
    assert health.real_time_factor == pytest.approx(10.0)


def test_speed_scales_the_grid_and_not_the_steps() -> None:
    pacer, twin, _, _ = run_to_end(slots=8, speed=4.0)
    pacer.stop()
    assert twin.began_ns == [k * SLOT // 4 for k in range(8)]
    assert twin.steps == 16


def test_a_late_slot_is_counted_and_made_up_without_skipping_a_step() -> None:
    stall = 95 * MS  # ends 75 ms after its due time: slots 1 to 3 are overdue by then
    pacer, twin, _, _ = run_to_end([MS, stall, *[MS] * 20], slots=12)
    pacer.stop()
    catch_up = round(SLOT / CATCH_UP)
    # The slot after the stall begins at once; the next ones CATCH_UP times faster than the grid.
    assert twin.began_ns[2] == SLOT + stall
    gaps = [b - a for a, b in zip(twin.began_ns[2:], twin.began_ns[3:], strict=False)]
    assert gaps[0] == catch_up
    assert all(gap >= catch_up for gap in gaps)
    assert twin.began_ns[-1] == 11 * SLOT  # back on the grid
    assert twin.steps == 24
    health = pacer.health()
    late_slots = sum(
        began + (stall if k == 1 else MS) > (k + 1) * SLOT for k, began in enumerate(twin.began_ns)
    )
    assert health.late_steps == 2 * late_slots > 0
    assert health.worst_lateness_s == pytest.approx(0.075)
    assert health.behind_s == 0.0
    last_late = max(k for k, began in enumerate(twin.began_ns) if began + MS > (k + 1) * SLOT)
    since = twin.began_ns[-1] - twin.began_ns[last_late]
    assert health.late_ago_s == pytest.approx(since * 1e-9, abs=2e-3)


def test_a_twin_slower_than_its_grid_says_how_far_behind_it_is() -> None:
    pacer, twin, _, _ = run_to_end([30 * MS] * 100, slots=10)
    health = pacer.health()
    pacer.stop()
    # It never jumps: 30 ms a slot of 20 ms, slot after slot, all but none of them in time.
    assert [b - a for a, b in zip(twin.began_ns, twin.began_ns[1:], strict=False)] == [30 * MS] * (
        len(twin.began_ns) - 1
    )
    assert health.late_steps == health.steps == 2 * len(twin.began_ns)


def test_a_step_that_hangs_shows_as_behind_while_it_hangs() -> None:
    clock = FakeClock(10 * SLOT)
    twin = FakeTwin(clock)
    inside, go_on = threading.Event(), threading.Event()

    def hang(steps: int) -> None:
        inside.set()
        assert go_on.wait(PATIENCE_S)

    twin.advance = hang  # type: ignore[method-assign]
    pacer = Pacer(twin, SnapshotQueue(10), steps_per_slot=2, clock=clock)
    pacer.start(0)
    assert inside.wait(PATIENCE_S)
    clock.time_ns = 520 * MS
    assert pacer.health().behind_s == pytest.approx(0.5)
    go_on.set()
    pacer.stop()


@pytest.mark.parametrize("kind", [SolverError, ZeroDivisionError])
def test_an_error_stops_the_worker_and_keeps_sentence_and_last_snapshot(
    kind: type[Exception],
) -> None:
    error = kind("the rope: step 6 does not converge")
    pacer, twin, _, handover = run_to_end(fails_at=6, error=error)
    health = pacer.health()
    assert not health.running
    assert "the rope: step 6 does not converge" in health.error
    assert pacer.last is not None
    assert pacer.last.step == 6
    assert health.steps == 6
    assert twin.steps == 6
    pacer.stop()
    taken = [handover.take(0.0) for _ in range(4)]
    assert [s.step for s in taken if s] == [2, 4, 6]


def test_stop_and_start_go_on_on_a_new_grid() -> None:
    pacer, twin, clock, _ = run_to_end(slots=3)
    pacer.stop()
    assert twin.steps == 6
    resumed_at = 100 * SLOT + 7 * MS
    clock.ended.clear()
    clock.end_ns = resumed_at + 2 * SLOT
    pacer.start(resumed_at)
    wait_for_end(pacer, clock)
    pacer.stop()
    assert twin.began_ns[3:] == [resumed_at, resumed_at + SLOT]
    assert pacer.health().late_steps == 0  # the pause is nobody's lateness
    assert pacer.health().steps == 10


def test_the_worker_finishes_at_the_last_step_asked_for() -> None:
    clock = FakeClock(100 * SLOT)
    twin = FakeTwin(clock)
    pacer = Pacer(twin, SnapshotQueue(10), steps_per_slot=2, clock=clock, last_step=5)
    pacer.start(0)
    wait_for_end(pacer, clock)
    pacer.stop()
    assert twin.steps == 6  # whole slots
    assert pacer.health().finished
    assert not pacer.health().running


def test_starting_twice_is_refused() -> None:
    pacer, *_ = run_to_end(slots=2)
    with pytest.raises(RuntimeError, match="running already"):
        pacer.start(0)
    pacer.stop()
    pacer.stop()  # harmless


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(0, 90), min_size=5, max_size=40))
def test_whatever_the_delays_steps_are_whole_and_slots_never_early(durations_ms: list[int]) -> None:
    durations = [ms * MS for ms in durations_ms]
    pacer, twin, _, _ = run_to_end(durations, slots=len(durations))
    pacer.stop()
    began = twin.began_ns
    assert twin.steps == 2 * len(began)
    assert all(time_ns >= k * SLOT for k, time_ns in enumerate(began))
    assert all(b - a >= round(SLOT / CATCH_UP) for a, b in itertools.pairwise(began))
    late = sum(
        time_ns + duration > (k + 1) * SLOT
        for k, (time_ns, duration) in enumerate(zip(began, durations, strict=False))
    )
    assert pacer.health().late_steps == 2 * late


def test_the_newest_snapshots_win_when_nobody_takes_them() -> None:
    handover = SnapshotQueue(depth=3)
    for step in range(10):
        handover.put(cast(Snapshot, SimpleNamespace(step=step)))
    assert [handover.take(0.0).step for _ in range(3)] == [7, 8, 9]  # type: ignore[union-attr]
    assert handover.take(0.0) is None
    assert handover.lost == 7


@pytest.mark.parametrize(
    ("slot_s", "speed", "depth"), [(0.02, 1.0, 25), (0.02, 4.0, 100), (2.0, 0.01, 1)]
)
def test_half_a_second_of_snapshots_may_wait(slot_s: float, speed: float, depth: int) -> None:
    assert queue_depth(slot_s, speed) == depth


def test_the_steady_clock_waits_to_the_absolute_time_and_wakes_on_interrupt() -> None:
    clock = SteadyClock()
    quiet = threading.Event()
    until = clock.now_ns() + 5 * MS
    clock.wait_until(until, quiet)
    assert clock.now_ns() >= until
    quiet.set()
    began = clock.now_ns()
    clock.wait_until(began + 60_000 * MS, quiet)
    assert clock.now_ns() - began < 10_000 * MS


@pytest.mark.parametrize(
    ("step_s", "steps"), [(0.01, 2), (0.02, 1), (0.005, 4), (0.003, 6), (0.05, 1), (0.001, 20)]
)
def test_a_slot_holds_whole_steps_and_at_least_fifty_a_second(step_s: float, steps: int) -> None:
    assert steps_in_slot(step_s) == steps
    assert steps == 1 or steps * step_s <= 0.02 + 1e-12


def test_pauses_of_the_interpreter_are_kept_short() -> None:
    import gc

    before = sys.getswitchinterval()
    try:
        keep_pauses_short()
        assert sys.getswitchinterval() <= 1e-3
        assert gc.get_freeze_count() > 0
    finally:
        sys.setswitchinterval(before)
        gc.unfreeze()
