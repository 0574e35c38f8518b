"""Failed steps: the twin returns to its last good state, reports it, and continues."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import not_finite, small_scene

import rope_twin.twin.ropes as parted_module
import rope_twin.twin.ropes as ropes_module
from rope_twin import Snapshot, Twin, load_scene
from rope_twin.core.step import advance
from rope_twin.effects.current import from_rows
from rope_twin.errors import SolverError
from rope_twin.messages import Level, Status, statuses
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.twin.inputs import CurrentInput
from rope_twin.twin.monitors import NO_MONITORS, Monitors
from rope_twin.twin.motion.boundary_conditions import Blending
from rope_twin.twin.motion.heave_track import REJOIN_M_PER_S2
from rope_twin.twin.recovery import (
    CHECKPOINT_NS,
    CHECKPOINTS,
    FAILURE_WINDOW_NS,
    MAX_FAILURE_FILES,
    MAX_FAILURES,
    Recovery,
)
from rope_twin.twin.state import load_state
from rope_twin.twin.state_file import AutoSave

SLOT = 2  # steps


class FailingCore:
    """The core's advance; the step that begins at a listed time fails, each as often as listed."""

    def __init__(self, fails: dict[int, int], spoils: bool = False) -> None:
        self.fails = fails  # by number of the step: how often
        self.spoils = spoils  # the state is no number afterwards, and the step counts as done

    def __call__(self, rope: Any, boundary: Any, pull: Any, time: float, steps: int) -> int:
        first = round(time / rope.model.step)
        bad = [n for n, left in self.fails.items() if left and first <= n < first + steps]
        if not bad:
            return int(advance(rope, boundary, pull, time, steps))
        good = min(bad) - first
        self.fails[min(bad)] -= 1
        done = int(advance(rope, boundary, pull, time, good)) if good else 0
        if self.spoils:
            rope.state.nodes[:3] = math.nan
            pull[done:] = math.nan
            return steps
        return done


def heaving(folder: Path, asked: Monitors = NO_MONITORS, speed: float = 0.0) -> Twin:
    """A twin in a swell of 2 m, with samples for a minute."""
    twin = Twin(small_scene(folder), asked)
    for k in range(-2, 1201):
        t = 0.05 * k
        z, v = 1.0 * math.sin(0.7 * t), 0.7 * math.cos(0.7 * t)
        assert not twin.submit_heave(k * 50_000_000, z, v)
        if t >= 9.0:
            break
    if speed:
        assert not twin.submit_speed(0, speed)
    return twin


def run(recovery: Recovery, twin: Twin, seconds: float, feed: bool = True) -> list[Snapshot]:
    """Slot by slot, with heave that comes in time."""
    snapshots = []
    for _ in range(round(seconds / (SLOT * twin.step_s))):
        newest = twin.inputs.newest_ns().get("heave", 0)
        if feed and newest < twin.time_ns + 500_000_000:
            t = (newest + 50_000_000) * 1e-9
            twin.submit_heave(newest + 50_000_000, math.sin(0.7 * t), 0.7 * math.cos(0.7 * t))
        recovery.advance(SLOT)
        snapshots.append(recovery.snapshot())
    return snapshots


def solver_row(snapshot: Snapshot) -> Status:
    return next(row for row in statuses(snapshot, None) if row.name == "simulation: solver")


def broken(monkeypatch: pytest.MonkeyPatch, fails: dict[int, int], spoils: bool = False) -> Any:
    core = FailingCore(fails, spoils)
    monkeypatch.setattr(ropes_module, "advance", core)
    monkeypatch.setattr(parted_module, "advance", core)
    return core


def test_a_step_that_fails_once_is_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the state before it, to the motion of an unbroken run; ERROR for a minute, then WARN."""
    whole = heaving(tmp_path)
    unbroken = run(Recovery(whole), whole, 6.0)
    broken(monkeypatch, {251: 1})
    twin = heaving(tmp_path)
    recovery = Recovery(twin)
    snapshots = run(recovery, twin, 6.0)
    assert [one.stamp_ns for one in snapshots] == [one.stamp_ns for one in unbroken]
    assert recovery.count == 1
    assert snapshots[-1].tension_top_n == pytest.approx(unbroken[-1].tension_top_n, rel=1e-9)
    row = solver_row(snapshots[-1])
    assert row.level == Level.ERROR
    assert "recovered from 1 failed step" in row.message
    assert "step 252" in row.message
    snapshots = run(recovery, twin, 61.0)
    assert solver_row(snapshots[-1]).level == Level.WARN


def test_repeated_failures_return_to_checkpoints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Time goes on on its grid, nothing is not finite, and the hang-off does not jump."""
    broken(monkeypatch, {550: 3})
    twin = heaving(tmp_path, speed=0.5)
    recovery = Recovery(twin)
    snapshots = run(recovery, twin, 12.0)
    assert recovery.count == 3
    assert "the rope's state at 4.00 s" in recovery.reason, "the second newest: 5 s, 4 s, 3 s"
    stamps = np.array([snapshot.stamp_ns for snapshot in snapshots])
    assert (np.diff(stamps) == SLOT * twin.step_ns).all()
    assert not [name for snapshot in snapshots for name in not_finite(snapshot)]
    z = np.array([snapshot.hang_off_position_m[2] for snapshot in snapshots])
    back = 275  # the slot in which it went back
    jumps = np.abs(np.diff(z))
    assert jumps[back + 1 :].max() < 0.02 * (0.7 + 1.5 * 2.0 / 2.0)
    live = snapshots[-1].hang_off_position_m[2] - twin.scene.ship.hang_off_m[2]
    assert live == pytest.approx(math.sin(0.7 * twin.time_ns * 1e-9), abs=1e-3)
    line = np.array([snapshot.line_out_m for snapshot in snapshots])
    assert line[back + 1] == pytest.approx(line[200], abs=0.02), "of 4 s"
    assert np.diff(line)[back + 1 :].max() < 0.5 * 0.02 + 1e-9
    tensions = np.array([snapshot.tension_top_n for snapshot in snapshots])
    assert tensions[back:].max() < 1.3 * tensions[:back].max()


def test_a_nan_state_is_never_published(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken(monkeypatch, {350: 1}, spoils=True)
    twin = heaving(tmp_path)
    recovery = Recovery(twin)
    snapshots = run(recovery, twin, 6.0)
    assert not [name for snapshot in snapshots for name in not_finite(snapshot)]
    assert recovery.count == 1
    assert "is not finite" in recovery.reason
    assert math.isfinite(twin.statistics().tension_top_mean_n)
    assert math.isfinite(twin.statistics().tension_top_max_n)


def test_any_exception_is_recovered_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    twin = heaving(tmp_path)
    recovery = Recovery(twin)
    run(recovery, twin, 2.0)
    at, left = twin.inputs.heave.at, [1]

    def fail_once(time_ns: int) -> tuple[float, float]:
        if left.pop() if left else 0:
            raise ZeroDivisionError("float division by zero")
        return at(time_ns)

    monkeypatch.setattr(twin.inputs.heave, "at", fail_once)
    snapshots = run(recovery, twin, 2.0)
    assert recovery.count == 1
    assert "a step failed on ZeroDivisionError: float division by zero" in recovery.reason
    assert snapshots[-1].time_s == pytest.approx(4.0)


def test_a_current_received_since_the_checkpoint_is_reverted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Accept an impossible sample by mistake: without it the twin continues."""
    monkeypatch.setattr(CurrentInput, "_fault", lambda self, profile: "")
    twin = heaving(tmp_path)
    recovery = Recovery(twin)
    run(recovery, twin, 2.0)
    assert twin.submit_current([[0.0, 0.1, 0.0], [-1e-308, 9.0, 0.0]]) == ""
    assert not np.isfinite(from_rows(np.array([[0.0, 0.1, 0.0], [-1e-308, 9.0, 0.0]])).slope).all()
    snapshots = run(recovery, twin, 2.0)
    assert recovery.count == 1
    assert "with the current profile of before" in recovery.reason
    assert not not_finite(snapshots[-1])
    row = next(r for r in statuses(snapshots[-1], None) if r.name == "simulation: input current")
    assert row.level == Level.WARN
    assert "the one before it is in force again" in row.message


def test_recovery_ends_after_the_maximum_number_of_failures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken(monkeypatch, {250: 10**9})
    twin = heaving(tmp_path)
    recovery = Recovery(twin)
    with pytest.raises(
        SolverError, match=f"gives up after {MAX_FAILURES} failed steps within 60 s"
    ) as caught:
        run(recovery, twin, 4.0)
    assert "\n" not in str(caught.value)
    assert recovery.count == MAX_FAILURES - 1
    assert twin.steps == 250
    assert twin.is_finite


def test_widely_spaced_failures_do_not_end_recovery(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One each 16 s, four within any minute: more than MAX_FAILURES in all, and few files."""
    times = {16 * 100 * k: 1 for k in range(1, 13)}
    assert 16e9 * (MAX_FAILURES - 1) > FAILURE_WINDOW_NS
    broken(monkeypatch, dict(times))
    twin = heaving(tmp_path)
    twin.failure_folder = tmp_path
    recovery = Recovery(twin)
    run(recovery, twin, 200.0)
    assert recovery.count == len(times)
    assert len(list(tmp_path.glob("*.state"))) == MAX_FAILURE_FILES


def test_checkpoints_of_another_mesh_are_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    core = broken(monkeypatch, {})
    twin = heaving(tmp_path)
    recovery = Recovery(twin)
    run(recovery, twin, 3.1)
    twin.set_level(AccuracyLevel(2 * twin.step_ns, 1))
    core.fails = {160: 3}  # steps of 20 ms: at 3.2 s
    snapshots = run(recovery, twin, 3.0)
    assert recovery.count == 3
    assert "state at 3.1" in recovery.reason, "the first state of that grid"
    assert not not_finite(snapshots[-1])


def test_both_parts_of_a_cut_rope_return_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A checkpoint of the whole rope is none of the parts."""
    broken(monkeypatch, {330: 2, 830: 2})
    twin = heaving(tmp_path)
    recovery = Recovery(twin)
    run(recovery, twin, 3.0)
    assert twin.submit_cut(None, 120.0) == ""
    snapshots = run(recovery, twin, 7.0)
    assert recovery.count == 4
    assert not not_finite(snapshots[-1])
    assert snapshots[-1].time_s == pytest.approx(10.0)


@pytest.mark.parametrize(
    "asked", [Monitors(energy=True), Monitors(error_interval=True)], ids=["energy", "interval"]
)
def test_monitors_return_with_the_rope(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: Monitors
) -> None:
    broken(monkeypatch, {350: 2})
    twin = heaving(tmp_path, asked)
    recovery = Recovery(twin)
    snapshots = run(recovery, twin, 6.0)
    assert recovery.count == 2
    if asked.energy:
        balance = snapshots[-1].energy
        assert balance is not None
        assert abs(balance.residual_j) < 0.05 * balance.exchanged_j
        assert balance.since_s >= 3.49
    else:
        assert (
            "unknown until 23.5 s" in snapshots[-1].no_error_interval
        )  # its coarse solution settles


def test_a_recovery_in_progress_is_part_of_a_saved_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Saved while the hang-off is led over, the restored run is the same to the bit."""
    broken(monkeypatch, {350: 3})
    twin = heaving(tmp_path, speed=0.3)
    recovery = Recovery(twin)
    run(recovery, twin, 4.0, feed=False)
    assert recovery.count == 3
    twin.save(tmp_path / "led.state")
    again = Twin.restore(tmp_path / "led.state", twin.scene)
    one, other = (run(Recovery(t), t, 3.0, feed=False)[-1] for t in (twin, again))
    assert one.node_position_m.tobytes() == other.node_position_m.tobytes()
    assert one.tension_top_n == other.tension_top_n


def test_only_good_states_are_saved_after_a_recovery(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    core = broken(monkeypatch, {250: 1})
    twin = heaving(tmp_path)
    keeper = AutoSave(Recovery(twin), tmp_path / "run.state", 1.0)
    for _ in range(200):
        keeper.advance(SLOT)
        keeper.finish_writing()
    assert load_state(tmp_path / "run.state").about.step == 400
    core.fails = {410: 10**9}
    with pytest.raises(SolverError):
        keeper.advance(200)
    keeper.finish()
    assert load_state(tmp_path / "run.state").about.step == 400
    assert not load_state(tmp_path / "run.state").about.failure


def test_the_hang_off_returns_smoothly_after_a_recovery() -> None:
    """A jump of 2 m asks for at most 0.5 m/s² and leaves neither step nor kink."""
    blending = Blending(2)
    jump = np.array([[0.0, 0.0, 2.0], [0.0, 0.3, -0.4]])
    blending.begin(1_000_000_000, jump, np.zeros((2, 3)))
    times = np.arange(1_000_000_000, blending.until_ns + 20_000_000, 10_000_000)
    computed = [blending.at(int(time_ns)) for time_ns in times]
    position, rate = (np.array([one[k] for one in computed]) for k in range(2))
    assert np.array_equal(position[0], jump)
    assert not position[-1].any()
    assert np.abs(np.diff(rate, axis=0)).max() / 0.01 < REJOIN_M_PER_S2 * 1.001
    middle = 0.5 * (rate[1:] + rate[:-1])
    assert np.allclose(np.diff(position, axis=0), 0.01 * middle, atol=1e-5)


def test_connected_ropes_return_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a winch at each of two hang-offs."""
    import rope_twin.twin.multi_line as joined_module

    twin = Twin(load_scene("two_line_lift"))
    assert len(twin.scene.ropes) > 1
    step, left = joined_module.advance_joined, [3]

    def fail(system: Any, own: Any, pull: Any, time: float, steps: int) -> int:
        if time > 2.5 and left[0]:
            left[0] -= 1
            return 0
        return int(step(system, own, pull, time, steps))

    monkeypatch.setattr(joined_module, "advance_joined", fail)
    for k in range(-2, 150):
        t = 0.05 * k
        twin.submit_heave(k * 50_000_000, math.sin(0.7 * t), 0.7 * math.cos(0.7 * t))
    recovery = Recovery(twin)
    slot = max(1, round(0.02 / twin.step_s))
    snapshots = []
    while twin.time_ns < 6_000_000_000:
        recovery.advance(slot)
        snapshots.append(recovery.snapshot())
    assert recovery.count == 3
    assert not [name for snapshot in snapshots for name in not_finite(snapshot)]
    tops = np.array(
        [[rope.node_position_m[0] for rope in snapshot.ropes] for snapshot in snapshots]
    )
    speeds = np.abs(np.diff(tops[:, :, 2], axis=0)) / (slot * twin.step_s)
    back = round(2.5 / (slot * twin.step_s))
    assert np.delete(speeds, range(back - 3, back + 3), axis=0).max() < 0.7 + 1.5


def test_checkpoints_are_of_full_seconds_and_few(tmp_path: Path) -> None:
    twin = heaving(tmp_path)
    recovery = Recovery(twin)
    run(recovery, twin, 5.5)
    times = [one.time_ns for one in recovery._checkpoints]
    assert times == [CHECKPOINT_NS * k for k in (3, 4, 5)]
    assert len(times) == CHECKPOINTS
