"""Coarse solution of the error interval: the scene on half the elements with twice the step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene, ScheduleRow
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.studies.driven_twin import fed, march, variant
from rope_twin.twin.error_interval import SAMPLING_RATIO, SETTLING_S, CoarseSolution, ErrorInterval
from rope_twin.twin.monitors import ERROR_INTERVAL
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.winch.commands import WinchCommand
from validation.rigs import Rig, sine

RIG = Rig(length=500.0, elements=20, damping=2e5, ramp=4.0, drag=(1.2, 0.01), density=1025.0,
          current=((0.0, (0.4, 0.1)),))  # fmt: skip
HEAVE = sine(1.0, 7.0)


def interval_of(twin: Twin) -> ErrorInterval:
    monitor = twin.monitor(ErrorInterval)
    assert monitor is not None
    return monitor


def coarse_of(twin: Twin) -> CoarseSolution:
    coarse = interval_of(twin).coarse
    assert coarse is not None
    return coarse


def pulls(snapshots: list[Snapshot]) -> list[list[float]]:
    return [[one.tension_top_n for one in snapshot.ropes] for snapshot in snapshots]


@pytest.mark.parametrize("every", [2, 3])
def test_it_is_the_rope_on_half_the_elements_with_twice_the_step(every: int) -> None:
    """Its tension is that of a twin of such a scene, which gets the same heave by itself."""
    twin = Twin(RIG.scene(), ERROR_INTERVAL)
    other = Twin(variant(RIG.scene(), 10, 0.02))
    alone = [snapshot.tension_top_n for snapshot in march(other, HEAVE, 6.0)]
    found = []
    for _ in march(twin, HEAVE, 6.0, every):
        found.append((twin.steps // 2, *coarse_of(twin).top_tensions_n))
    for step, tension in found[1:]:
        assert tension == pytest.approx(alone[step - 1], rel=1e-9)


@pytest.mark.parametrize("name", ["two_line_lift", "two_line_loop"])
def test_it_is_the_system_on_half_the_elements_with_twice_the_step(name: str) -> None:
    """Its tensions are those of a twin of such a scene, at both winches, over a sheave too."""
    scene = load_scene(name)
    twin, followed = Twin(scene, ERROR_INTERVAL), []
    last = interval_of(twin).ropes[-1]
    for _ in fed(twin, 14.0):
        followed.append([coarse_of(twin).top_tensions_n[r] for r in (0, last)])
    half = Twin(variant(scene, scene.ropes[0].elements // 2, 2.0 * scene.time.step_s))
    alone = [[one[0], one[last]] for one in pulls(list(fed(half, 14.0)))]
    assert np.allclose(followed, alone, rtol=1e-7)


@pytest.mark.parametrize("name", ["cable_waves", "strouhal_lift"])
def test_it_has_vortices_of_its_own(name: str) -> None:
    """The run is bit-identical, and the coarse solution a rope of half the elements."""
    scene = load_scene(name)
    twin, found, snapshots = Twin(scene, ERROR_INTERVAL), [], []
    for snapshot in fed(twin, 2.0):
        snapshots.append(snapshot.tension_top_n)
        found += coarse_of(twin).top_tensions_n
    assert snapshots == [snapshot.tension_top_n for snapshot in fed(Twin(scene), 2.0)]
    half = Twin(variant(scene, scene.ropes[0].elements // 2, 2.0 * scene.time.step_s))
    alone = [snapshot.tension_top_n for snapshot in fed(half, 2.0)]
    assert np.allclose(found, alone, rtol=5e-8)  # tolerance of the static equilibrium


@pytest.mark.parametrize(
    "name", ["vortices_modal", pytest.param("vortices_decomposed", marks=pytest.mark.long)]
)
def test_it_has_a_loosely_coupled_model_of_its_own(name: str) -> None:
    """The run is bit-identical; the coarse solution is nearly the scene on half the elements.

    Its model samples less often than that scene's does, so its drag is amplified a little later.
    That counts more in `decomposed_force`, where whole bands go over to the strongest mode at once.
    """
    scene = load_scene(name)
    twin, snapshots, found = Twin(scene, ERROR_INTERVAL), [], []
    for snapshot in fed(twin, 8.0):
        snapshots.append(snapshot.tension_top_n)
        found += coarse_of(twin).top_tensions_n
    plain = [snapshot.tension_top_n for snapshot in fed(Twin(scene), 8.0)]
    assert snapshots == plain
    half = Twin(variant(scene, scene.ropes[0].elements // 2, 2.0 * scene.time.step_s))
    alone = np.array([snapshot.tension_top_n for snapshot in fed(half, 8.0)])
    off = np.abs(np.array(found) - np.array(plain)).max()
    assert np.abs(np.array(found) - alone).max() < {"vortices_modal": 0.6}.get(name, 0.7) * off
    own, other = twin.viv_drag, coarse_of(twin).viv_drag
    assert own is not None
    assert other is not None
    assert own.trackers[0].solves == other.trackers[0].solves == 8
    assert other.every == SAMPLING_RATIO * own.every
    assert 1.2 < other.drag_amplification(coarse_of(twin).ropes[0], 0).max() < 2.0


@pytest.mark.parametrize(
    "name", ["vortices_modal", pytest.param("vortices_decomposed", marks=pytest.mark.long)]
)
def test_a_restored_twin_makes_one_whose_drag_is_amplified(name: str) -> None:
    twin = Twin(load_scene(name), ERROR_INTERVAL)
    for _ in fed(twin, 10.0):
        pass
    again = Twin.restore(twin.capture(), twin.scene, ERROR_INTERVAL)
    other = coarse_of(again).viv_drag
    assert other is not None
    assert other.drag_amplification(coarse_of(again).ropes[0], 0).max() > 1.2
    for one in (twin, again):
        one.advance(2500)
    assert "" == again.snapshot().no_error_interval == twin.snapshot().no_error_interval
    assert again.snapshot().tension_top_n == twin.snapshot().tension_top_n


def payout_m(twin: Twin) -> float:
    return twin.snapshot().line_out_m


def soft_brake() -> Scene:
    """Return emergency_stop, stopped after 4 s, whose brake slips 3 % above the static load."""
    scene = load_scene("emergency_stop")
    assert scene.winch is not None
    assert scene.winch.brake is not None
    early = tuple(replace(row, at_s=0.2 * row.at_s) for row in scene.winch.schedule)
    brake = replace(scene.winch.brake, holding_torque_n_m=178e3)
    return replace(scene, winch=replace(scene.winch, brake=brake, schedule=early))


def test_it_is_the_rope_and_its_drive_with_twice_the_step() -> None:
    """Payout and tension are those of a twin of such a scene, which gets the sea by itself."""
    scene = soft_brake()
    twin, found = Twin(scene, ERROR_INTERVAL), []
    for _ in fed(twin, 10.0):
        half = coarse_of(twin)
        found.append((*half.payouts_m, *half.top_tensions_n))
    other = Twin(variant(scene, None, 2.0 * scene.time.step_s))
    alone = [(snapshot.line_out_m, snapshot.tension_top_n) for snapshot in fed(other, 10.0)]
    lines, forces = np.transpose(found)
    own_lines, own_forces = np.transpose(alone)
    assert np.abs(lines - own_lines).max() < 1e-9
    assert np.allclose(forces, own_forces, rtol=1e-9)
    assert abs(lines[-1] - payout_m(twin)) > 1e-6  # and it is not the twin's


def test_with_a_drive_the_run_is_bit_identical_and_so_is_the_interval_of_a_branch() -> None:
    scene = soft_brake()
    twin, alone = Twin(scene, ERROR_INTERVAL), Twin(scene)
    snapshots = [snapshot.tension_top_n for snapshot in fed(twin, 6.0)]
    assert snapshots == [snapshot.tension_top_n for snapshot in fed(alone, 6.0)]
    other = twin.branch()
    for _ in range(30):
        twin.advance(3)
        other.advance(3)
        one, two = twin.snapshot().error_interval, other.snapshot().error_interval
        assert one is not None
        assert two is not None
        assert (one.low_n, one.high_n) == (two.low_n, two.high_n)


def test_a_depth_command_during_a_run_makes_a_coarse_winch() -> None:
    twin = Twin(load_scene("shallow_lift"), ERROR_INTERVAL)
    twin.advance(101)  # an odd step: the coarse solution has one to wait for
    assert not coarse_of(twin).winches
    twin.submit_command(None, WinchCommand("depth", 195.0))
    twin.advance(99)
    assert set(coarse_of(twin).winches) == {0}
    assert twin.snapshot().error_interval is not None
    twin.submit_command(None, WinchCommand("speed", 0.5))  # reaches both
    twin.advance(200)
    assert payout_m(twin) == pytest.approx(coarse_of(twin).payouts_m[0], abs=1e-4)
    assert twin.snapshot().payout_speed_m_per_s == pytest.approx(0.4, abs=0.1)


def test_a_new_schedule_after_a_pause_reaches_both_winches() -> None:
    """It comes with stamps before those of the old one, which it replaces."""
    twin = Twin(load_scene("emergency_stop"), ERROR_INTERVAL)
    twin.advance(10)
    assert twin.submit_command(3_000_000_000, WinchCommand("speed", -0.5)) == ""
    twin.invalidate_inputs()
    assert twin.submit_command(1_000_000_000, WinchCommand("speed", 0.5)) == ""
    twin.advance(390)
    before = payout_m(twin), coarse_of(twin).payouts_m[0]
    twin.advance(100)
    after = payout_m(twin), coarse_of(twin).payouts_m[0]
    assert np.subtract(after, before) == pytest.approx(0.5, abs=0.01)


def test_a_restored_twin_gives_its_coarse_solution_a_winch_again() -> None:
    twin = Twin(soft_brake(), ERROR_INTERVAL)
    for _ in fed(twin, 3.0):
        pass
    again = Twin.restore(twin.capture(), twin.scene, ERROR_INTERVAL)
    again.advance(round((SETTLING_S + 0.1) / again.step_s))
    assert coarse_of(again).winches
    assert again.snapshot().error_interval is not None


def drives_on_both_lines(of: tuple[str, ...] = ("winch", "aft_sheave")) -> Scene:
    """Return two_line_lift: 1.5 m of the aft line paid out, drives 6 % above the static load."""
    scene, lent = load_scene("two_line_lift"), load_scene("emergency_stop").winch
    assert scene.winch is not None
    assert lent is not None
    assert lent.drive is not None
    drive = replace(lent.drive, torque_limit_n_m=114e3)

    def driven(winch: WinchScene, name: str) -> WinchScene:
        aft = name == "aft_sheave"
        rows = (ScheduleRow(at_s=1.0, speed_m_per_s=0.3),) if aft else ()
        if name not in of:
            return replace(winch, schedule=rows)
        return replace(winch, drum=lent.drum, drive=drive, brake=lent.brake, schedule=rows)

    (aft,) = scene.hang_offs
    assert aft.winch is not None
    return replace(
        scene,
        winch=driven(scene.winch, "winch"),
        hang_offs=(replace(aft, winch=driven(aft.winch, aft.name)),),
    )


def payouts_m(twin: Twin) -> list[float]:
    return [snapshot.line_out_m for snapshot in twin.snapshot().ropes]


@pytest.mark.parametrize("of", [("winch", "aft_sheave"), ("winch",)])
def test_a_system_has_coarse_winches_where_a_winch_responds(of: tuple[str, ...]) -> None:
    """It is the scene with twice the step: the fore line renders while the aft one leaves its load.

    A line whose winch does not respond is bit-identical to the twin's.
    """
    scene = drives_on_both_lines(of)
    twin, found = Twin(scene, ERROR_INTERVAL), []
    for _ in fed(twin, 8.0):
        half = coarse_of(twin)
        found.append([*half.payouts_m, *half.top_tensions_n])
    assert set(half.winches) == {("winch", "aft_sheave").index(name) for name in of}
    other, alone = Twin(variant(scene, None, 2.0 * scene.time.step_s)), []
    for snapshot in fed(other, 8.0):
        alone.append([*payouts_m(other), *(one.tension_top_n for one in snapshot.ropes)])
    assert np.allclose(found, alone, rtol=1e-8)
    fore, aft = (abs(k - m) for k, m in zip(found[-1][:2], payouts_m(twin), strict=True))
    assert fore > 1e-6
    assert aft == 0.0 or "aft_sheave" in of
    assert all(one.error_interval is not None for one in twin.snapshot().ropes)


def test_a_system_with_drives_is_bit_identical_and_so_is_a_branch() -> None:
    scene = drives_on_both_lines()
    twin, alone = Twin(scene, ERROR_INTERVAL), Twin(scene)
    assert pulls(list(fed(twin, 4.0))) == pulls(list(fed(alone, 4.0)))
    other = twin.branch()
    for _ in range(20):
        twin.advance(3)
        other.advance(3)
        for one, two in zip(twin.snapshot().ropes, other.snapshot().ropes, strict=True):
            assert one.error_interval is not None
            assert two.error_interval is not None
            assert one.error_interval.low_n == two.error_interval.low_n
            assert one.error_interval.high_n == two.error_interval.high_n


def test_a_depth_command_to_another_line_makes_its_coarse_winch() -> None:
    """It is made when the command is due, and gets the next one, too."""
    twin = Twin(load_scene("two_line_lift"), ERROR_INTERVAL)
    twin.advance(101)
    assert not coarse_of(twin).winches
    assert twin.submit_command(None, WinchCommand("depth", 590.0), "aft_sheave") == ""
    twin.advance(99)
    assert set(coarse_of(twin).winches) == {1}
    assert all(one.error_interval is not None for one in twin.snapshot().ropes)
    assert twin.submit_command(None, WinchCommand("speed", 0.2), "aft_sheave") == ""
    twin.advance(200)  # until the winch has reached that speed
    before = coarse_of(twin).payouts_m[1]
    twin.advance(100)
    assert coarse_of(twin).payouts_m[1] - before == pytest.approx(0.2, rel=0.02)


@pytest.mark.parametrize(
    ("name", "share"),
    [("emergency_stop", 1), ("abandonment_and_recovery", 2), ("two_line_lift", 2)],
)
def test_it_keeps_the_elements_only_with_a_drive(name: str, share: int) -> None:
    """Else the difference would not show their error until a depth or tension command is due."""
    twin = Twin(load_scene(name), ERROR_INTERVAL)
    count = coarse_of(twin).ropes[0].state.counts[rows.ELEMENTS]
    assert share * count == twin.rope.state.counts[rows.ELEMENTS]
