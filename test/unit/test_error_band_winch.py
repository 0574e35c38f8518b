"""The live error band where a winch answers to the rope: a winch of the companion's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.errors import SceneError
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.bench.band import fed
from rope_twin.studies.variants import variant
from rope_twin.twin.accuracy.companion import HalfRope
from rope_twin.twin.accuracy.error_band import SETTLING_S, BandedTwin
from rope_twin.twin.accuracy.error_bound import ErrorBand
from rope_twin.twin.hoisting.orders import Order


def half_of(twin: BandedTwin) -> HalfRope:
    half = twin._companion
    assert isinstance(half, HalfRope)
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
    twin, found = BandedTwin(scene), []
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
    twin, alone = BandedTwin(scene), Twin(scene)
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
    twin = BandedTwin(load_scene("shallow_lift"))
    twin.advance(101)  # an odd step: the companion has one to wait for
    assert half_of(twin).winch is None
    twin.offer_order(None, Order("depth", 195.0))
    twin.advance(99)
    assert half_of(twin).winch is not None
    assert twin.snapshot().band is not None
    twin.offer_order(None, Order("speed", 0.5))  # reaches both
    twin.advance(200)
    assert line_out_m(twin) == pytest.approx(
        float(half_of(twin)._ahead.value[0, rows.LINE]), abs=1e-4
    )
    assert float(half_of(twin)._ahead.rate[0, rows.LINE]) == pytest.approx(0.4, abs=0.1)


def test_a_new_plan_after_a_pause_reaches_both_winches() -> None:
    """It comes with stamps before those of the old one, which it replaces."""
    twin = BandedTwin(load_scene("emergency_stop"))
    twin.advance(10)
    assert twin.offer_order(3_000_000_000, Order("speed", -0.5)) == ""
    twin.doubt_inputs()
    assert twin.offer_order(1_000_000_000, Order("speed", 0.5)) == ""
    twin.advance(490)
    for rate in (twin._boundary.rate, half_of(twin)._ahead.rate):
        assert rate[0, rows.LINE] == pytest.approx(0.5, abs=0.01)


def test_while_a_winch_answers_the_difference_itself_counts() -> None:
    calm, answers = ErrorBand(100e3, 0.01), ErrorBand(100e3, 0.01)
    answers.answer(0.0)
    for found in (calm, answers):
        for k in range(1, 40):
            found.take(0.01 * k, 0.0, 90e3)
            found.compare(0.01 * k, 100.0)
    assert calm.bound_n(0.39) < 50.0
    assert answers.bound_n(0.39) == pytest.approx(114.0)


def test_a_restored_twin_gives_its_companion_a_winch_again() -> None:
    twin = BandedTwin(soft_brake())
    for _ in fed(twin, 3.0):
        pass
    again = BandedTwin.restore(twin.capture(), twin.scene)
    again.advance(round((SETTLING_S + 0.1) / again.step_s))
    assert half_of(again).winch is not None
    assert again.snapshot().band is not None


def test_where_ropes_meet_a_winch_that_answers_has_no_band() -> None:
    """Their companion's lines out are theirs."""
    scene = load_scene("two_line_lift")
    drives = load_scene("emergency_stop").winch
    assert drives is not None
    with pytest.raises(SceneError, match=r"winch: its drive, .*run it without a band"):
        BandedTwin(replace(scene, winch=drives))
    twin = BandedTwin(scene)
    twin.advance(100)
    assert twin.snapshot().band is not None
    twin.offer_order(None, Order("depth", 50.0))
    twin.advance(100)
    assert twin.snapshot().band is None
