"""The live error band where a winch answers to the rope: a winch of the companion's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene, ScheduleRow
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.studies.driven_twin import fed, variant
from rope_twin.twin.accuracy.coarse_solution import CoarseRope, CoarseSystem
from rope_twin.twin.accuracy.error_bound import ErrorBound
from rope_twin.twin.accuracy.error_interval import SETTLING_S, ErrorIntervalTwin
from rope_twin.twin.winch.commands import WinchCommand


def half_of(twin: ErrorIntervalTwin) -> CoarseRope:
    half = twin._coarse
    assert isinstance(half, CoarseRope)
    return half


def line_out_m(twin: Twin) -> float:
    return float(twin._boundary.value[0, rows.LINE])


def soft_brake() -> Scene:
    """Of emergency_stop, stopped after 4 s, with a brake that slips: it holds 3 % above rest."""
    scene = load_scene("emergency_stop")
    assert scene.winch is not None
    assert scene.winch.brake is not None
    early = tuple(replace(row, at_s=0.2 * row.at_s) for row in scene.winch.schedule)
    brake = replace(scene.winch.brake, holding_torque_n_m=178e3)
    return replace(scene, winch=replace(scene.winch, brake=brake, schedule=early))


def test_the_companion_is_the_same_rope_and_winch_with_twice_the_step() -> None:
    """Line out and tension are those of a twin of such a scene, which gets the sea by itself."""
    scene = soft_brake()
    twin, found = ErrorIntervalTwin(scene), []
    for _ in fed(twin, 10.0):
        half = half_of(twin)
        found.append((float(half._ahead.value[0, rows.LINE]), half._pull_n))
    other = Twin(variant(scene, None, 2.0 * scene.time.step_s))
    alone = [(line_out_m(other), shot.tension_top_n) for shot in fed(other, 10.0)]
    lines, pulls = np.transpose(found)
    own_lines, own_pulls = np.transpose(alone)
    assert np.abs(lines - own_lines).max() < 1e-9
    assert np.allclose(pulls, own_pulls, rtol=1e-9)
    assert abs(lines[-1] - line_out_m(twin)) > 1e-6  # and it is not the twin's


def test_the_run_is_the_same_to_the_bit_and_so_is_a_branch_with_its_band() -> None:
    scene = soft_brake()
    twin, alone = ErrorIntervalTwin(scene), Twin(scene)
    shots = [shot.tension_top_n for shot in fed(twin, 6.0)]
    assert shots == [shot.tension_top_n for shot in fed(alone, 6.0)]
    other = twin.branch()
    for _ in range(30):
        twin.advance(3)
        other.advance(3)
        one, two = twin.snapshot().band, other.snapshot().band
        assert one is not None
        assert two is not None
        assert (one.low_n, one.high_n) == (two.low_n, two.high_n)


def test_an_order_by_depth_on_the_way_gives_the_companion_a_winch() -> None:
    """The band goes on, wider: the error is of first order from there."""
    twin = ErrorIntervalTwin(load_scene("shallow_lift"))
    twin.advance(101)  # an odd step: the companion has one to wait for
    assert not half_of(twin).winches
    twin.offer_command(None, WinchCommand("depth", 195.0))
    twin.advance(99)
    assert half_of(twin).winches
    assert twin.snapshot().band is not None
    twin.offer_command(None, WinchCommand("speed", 0.5))  # reaches both
    twin.advance(200)
    assert line_out_m(twin) == pytest.approx(
        float(half_of(twin)._ahead.value[0, rows.LINE]), abs=1e-4
    )
    assert float(half_of(twin)._ahead.rate[0, rows.LINE]) == pytest.approx(0.4, abs=0.1)


def test_a_new_plan_after_a_pause_reaches_both_winches() -> None:
    """It comes with stamps before those of the old one, which it replaces."""
    twin = ErrorIntervalTwin(load_scene("emergency_stop"))
    twin.advance(10)
    assert twin.offer_command(3_000_000_000, WinchCommand("speed", -0.5)) == ""
    twin.invalidate_inputs()
    assert twin.offer_command(1_000_000_000, WinchCommand("speed", 0.5)) == ""
    twin.advance(490)
    for rate in (twin._boundary.rate, half_of(twin)._ahead.rate):
        assert rate[0, rows.LINE] == pytest.approx(0.5, abs=0.01)


def test_while_a_winch_answers_the_difference_itself_counts() -> None:
    calm, answers = ErrorBound(100e3, 0.01), ErrorBound(100e3, 0.01)
    answers.answer(0.0)
    for found in (calm, answers):
        for k in range(1, 40):
            found.take(0.01 * k, 0.0, 90e3)
            found.compare(0.01 * k, 100.0)
    assert calm.bound_n(0.39) < 50.0
    assert answers.bound_n(0.39) == pytest.approx(114.0)


def test_a_restored_twin_gives_its_companion_a_winch_again() -> None:
    twin = ErrorIntervalTwin(soft_brake())
    for _ in fed(twin, 3.0):
        pass
    again = ErrorIntervalTwin.restore(twin.capture(), twin.scene)
    again.advance(round((SETTLING_S + 0.1) / again.step_s))
    assert half_of(again).winches
    assert again.snapshot().band is not None


def drives_on_both_lines(of: tuple[str, ...] = ("winch", "aft_sheave")) -> Scene:
    """Of two_line_lift, 1.5 m of the aft line paid out alone while drives hold 6 % above rest."""
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


def system_of(twin: ErrorIntervalTwin) -> CoarseSystem:
    half = twin._coarse
    assert isinstance(half, CoarseSystem)
    return half


def lines_out_m(twin: Twin) -> list[float]:
    return [shot.line_out_m for shot in twin.snapshot().ropes]


@pytest.mark.parametrize("of", [("winch", "aft_sheave"), ("winch",)])
def test_where_ropes_meet_the_companion_has_those_winches_that_answer(of: tuple[str, ...]) -> None:
    """It is the scene with twice the step: the fore line renders while the aft one leaves its load.

    A line whose winch does not answer is the twin's to the bit.
    """
    scene = drives_on_both_lines(of)
    twin, found = ErrorIntervalTwin(scene), []
    for _ in fed(twin, 8.0):
        half = system_of(twin)
        found.append([*half._now[0][:, rows.LINE], *half._pull_n])
    assert half.winches.keys() == {("winch", "aft_sheave").index(name) for name in of}
    other, alone = Twin(variant(scene, None, 2.0 * scene.time.step_s)), []
    for shot in fed(other, 8.0):
        alone.append([*lines_out_m(other), *(one.tension_top_n for one in shot.ropes)])
    assert np.allclose(found, alone, rtol=1e-8)
    fore, aft = (abs(k - m) for k, m in zip(found[-1][:2], lines_out_m(twin), strict=True))
    assert fore > 1e-6
    assert aft == 0.0 or "aft_sheave" in of
    bands = [one.band for one in twin.snapshot().ropes]
    assert None not in bands


def test_where_ropes_meet_the_run_is_the_same_to_the_bit_and_so_is_a_branch() -> None:
    scene = drives_on_both_lines()
    twin, alone = ErrorIntervalTwin(scene), Twin(scene)
    shots = [[one.tension_top_n for one in shot.ropes] for shot in fed(twin, 4.0)]
    assert shots == [[one.tension_top_n for one in shot.ropes] for shot in fed(alone, 4.0)]
    other = twin.branch()
    for _ in range(20):
        twin.advance(3)
        other.advance(3)
        for one, two in zip(twin.snapshot().ropes, other.snapshot().ropes, strict=True):
            assert one.band is not None
            assert two.band is not None
            assert (one.band.low_n, one.band.high_n) == (two.band.low_n, two.band.high_n)


def test_where_ropes_meet_an_order_by_depth_on_the_way_leaves_the_band_known() -> None:
    """The companion's winch is made when the order is due, and gets the next one, too."""
    twin = ErrorIntervalTwin(load_scene("two_line_lift"))
    twin.advance(101)
    assert not system_of(twin).winches
    assert twin.offer_command(None, WinchCommand("depth", 590.0), "aft_sheave") == ""
    twin.advance(99)
    assert system_of(twin).winches.keys() == {1}
    assert all(one.band is not None for one in twin.snapshot().ropes)
    assert twin.offer_command(None, WinchCommand("speed", 0.2), "aft_sheave") == ""
    twin.advance(200)
    assert twin.joined is not None
    own = twin.joined.moved.rate[1, -1, rows.LINE]
    assert system_of(twin)._now[1][1, rows.LINE] == pytest.approx(own)
    assert own == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("name", "share"),
    [("emergency_stop", 1), ("abandonment_and_recovery", 2), ("two_line_lift", 2)],
)
def test_only_where_a_drive_asks_at_every_step_the_companion_keeps_the_elements(
    name: str, share: int
) -> None:
    """Else nothing would tell of their error while no order by depth or tension is due."""
    twin = ErrorIntervalTwin(load_scene(name))
    half = twin._coarse
    assert isinstance(half, CoarseRope | CoarseSystem)
    rope = half._rope if isinstance(half, CoarseRope) else half._system.ropes[0]
    assert share * rope.state.counts[rows.ELEMENTS] == twin.rope.state.counts[rows.ELEMENTS]
