"""The live error band with vortices: wakes of its own, their phase, and modes beside the step."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rope_twin import Twin
from rope_twin.scene.load import load_scene
from rope_twin.studies.driven_twin import fed, variant
from rope_twin.twin.accuracy.divergence import (
    AGREEMENT,
    DIVERGENCE,
    VIV_FRACTION,
    diverged_fraction,
    drag_divergence,
)
from rope_twin.twin.accuracy.error_bound import ErrorBound
from rope_twin.twin.accuracy.error_interval import ErrorIntervalTwin
from rope_twin.twin.accuracy.phase_drift import AMPLITUDE, PhaseDrift

H, HZ = 0.01, 2.0  # the companion's step [s]; the vortices' frequency [Hz]
OMEGA = 2.0 * math.pi * 2.0 * HZ  # of the top tension


@pytest.mark.parametrize("name", ["sonde_cast", "cable_waves", "strouhal_lift"])
def test_the_companion_has_wakes_of_its_own(name: str) -> None:
    """The run is the same to the bit, and the companion a rope of half the elements, shaken too."""
    scene = load_scene(name)
    twin, found = ErrorIntervalTwin(scene), []
    shots = []
    for shot in fed(twin, 2.0):
        shots.append(shot.tension_top_n)
        found.append(twin._coarse._pull_n)  # type: ignore[attr-defined]
    assert shots == [shot.tension_top_n for shot in fed(Twin(scene), 2.0)]
    half = Twin(variant(scene, scene.ropes[0].elements // 2, 2.0 * scene.time.step_s))
    alone = [shot.tension_top_n for shot in fed(half, 2.0)]
    assert np.allclose(found, alone, rtol=5e-8)  # rest is found that exactly


def followed(
    phase: Callable[[float], float], seconds: float, slow_n: float = 0.0
) -> tuple[PhaseDrift, list[tuple[float, float]]]:
    """Vibrations of 100 N, the companion ahead by a phase: what it found; error and bound.

    The error is what a third of the phase makes; slow_n: a heave that both have.
    """
    found, rows = PhaseDrift(50e3, 0.2, H, resting=True), []
    found.keep_pace(HZ)
    for k in range(1, int(seconds / H)):
        t = k * H
        heave = 50e3 + slow_n * math.sin(2.0 * math.pi * t / 8.0)
        own, ahead = math.sin(OMEGA * t), math.sin(OMEGA * t + phase(t))
        found.take(t, heave + 100.0 * own, heave + 100.0 * ahead)
        right = math.sin(OMEGA * t - phase(t) / 3.0)
        rows.append((100.0 * abs(own - right), found.bound_n(t)))
    return found, rows


@pytest.mark.parametrize("slow_n", [0.0, 5e3])
@pytest.mark.parametrize("turns_per_s", [0.02, -0.02])
def test_a_phase_is_followed_over_whole_turns_and_a_third_of_it_bounded(
    turns_per_s: float, slow_n: float
) -> None:
    """Beside a heave fifty times as high; the companion laps the rope twice in 100 s."""
    found, rows = followed(lambda t: 2.0 * math.pi * turns_per_s * t, 100.0, slow_n)
    assert found.phase_rad is not None
    late = 4.0  # s, of a mean over so many
    expected = 2.0 * math.pi * turns_per_s * (100.0 - late)
    assert found.phase_rad == pytest.approx(expected, abs=0.15)
    errors, bounds = np.transpose(rows[int(10.0 / H) :])
    assert np.mean(errors <= bounds) > 0.99
    assert np.median(bounds) < 3.0 * np.median(errors)
    assert bounds.max() < 2.0 * AMPLITUDE * 110.0  # two vibrations differ by no more


def test_without_a_phase_the_bound_is_of_vibrations_that_oppose_each_other() -> None:
    """Other frequencies; and a companion that began in the middle of the vibration."""
    found, rows = followed(lambda t: 12.0 * t, 20.0)
    assert found.phase_rad is None
    assert 2.0 * 100.0 < rows[-1][1] < 2.0 * AMPLITUDE * 110.0
    began = PhaseDrift(50e3, 0.2, H, resting=False)
    began.keep_pace(HZ)
    for k in range(1, 1000):
        both = 50e3 + 100.0 * math.sin(OMEGA * H * k)
        began.take(H * k, both, both)
    assert began.phase_rad is None
    assert began.bound_n(10.0) > 200.0


def test_what_does_not_vibrate_is_not_out_of_step() -> None:
    found = PhaseDrift(50e3, 0.2, H, resting=True)
    found.keep_pace(HZ)
    for k in range(1, 1000):
        found.take(H * k, 50e3, 50e3)
    assert found.bound_n(10.0) == 0.0


def test_a_restored_twin_does_not_know_how_far_its_vortices_are_out_of_step() -> None:
    """What it has been through is not in the new companion."""
    twin = ErrorIntervalTwin(load_scene("sonde_cast"))
    for _ in fed(twin, 8.0):
        pass
    knows = twin._tops[0].vortices
    again = ErrorIntervalTwin.restore(twin.capture(), twin.scene)
    again.advance(1000)
    lost = again._tops[0].vortices
    assert knows is not None
    assert lost is not None
    assert knows.phase_rad is not None
    assert lost.phase_rad is None
    assert lost.bound_n(again.time_ns * 1e-9) > 100.0


@pytest.mark.parametrize("name", ["vortices_modal", "vortices_decomposed"])
def test_a_companion_has_modes_of_its_own_beside_its_step(name: str) -> None:
    """The run is the same to the bit; the companion is nearly the scene on half the elements.

    Its model looks more rarely than that scene's does, so its drag grows a little later.
    """
    scene = load_scene(name)
    twin, shots, found = ErrorIntervalTwin(scene), [], []
    for shot in fed(twin, 8.0):
        shots.append(shot.tension_top_n)
        found.append(twin._coarse._pull_n)  # type: ignore[attr-defined]
    plain = [shot.tension_top_n for shot in fed(Twin(scene), 8.0)]
    assert shots == plain
    half = Twin(variant(scene, scene.ropes[0].elements // 2, 2.0 * scene.time.step_s))
    alone = np.array([shot.tension_top_n for shot in fed(half, 8.0)])
    off = np.abs(np.array(found) - np.array(plain)).max()
    assert np.abs(np.array(found) - alone).max() < 0.6 * off
    own, other = twin.viv_drag, twin._coarse._viv_drag  # type: ignore[attr-defined]
    assert own is not None
    assert own.tracker.solves == other.tracker.solves == 8
    assert other.every == 4 * own.every
    assert 1.2 < twin._coarse.drag_amplification().max() < 2.0


@pytest.mark.parametrize("name", ["vortices_modal", "vortices_decomposed"])
def test_a_restored_twin_makes_a_companion_that_shakes_on(name: str) -> None:
    """Unknown for 20 s, then near what the one that ran from rest tells."""
    twin = ErrorIntervalTwin(load_scene(name))
    for _ in fed(twin, 10.0):
        pass
    again = ErrorIntervalTwin.restore(twin.capture(), twin.scene)
    assert again._coarse.drag_amplification().max() > 1.2
    for one in (twin, again):
        one.advance(2500)
    assert "" == again.snapshot().no_band == twin.snapshot().no_band
    assert again.snapshot().tension_top_n == twin.snapshot().tension_top_n
    bounds = [one._band.bound_n(one.time_ns * 1e-9) for one in (twin, again)]
    assert 0.0 < bounds[1] < 20.0 * bounds[0]


def test_a_difference_counts_whole_where_the_drag_has_grown_otherwise() -> None:
    """And by less again once it has grown alike for five seconds."""
    band = ErrorBound(50e3, 0.01, VIV_FRACTION)

    def bound(time_s: float) -> float:
        for _ in range(2):
            band.take(time_s, 0.0, 50e3)
        band.compare(time_s, 10.0)
        return band.bound_n(time_s)

    alike = bound(1.0)
    band.diverge(1.0, AGREEMENT)
    assert bound(1.1) == pytest.approx(alike)
    band.diverge(1.2, DIVERGENCE)
    assert bound(1.3) == pytest.approx(alike / VIV_FRACTION)
    band.diverge(4.0, 0.0)
    assert bound(4.1) == pytest.approx(alike / VIV_FRACTION)
    band.diverge(6.3, 0.0)
    assert bound(6.6) == pytest.approx(alike)


def test_how_much_drag_two_grids_differ_by() -> None:
    """Of a straight line there is nothing, of a tenth more along a half a twentieth."""
    fine, coarse = np.linspace(1.0, 1.8, 81), np.linspace(1.0, 1.8, 41)
    assert drag_divergence(fine, coarse) == pytest.approx(0.0, abs=1e-15)
    half = np.where(np.arange(40) < 20, 1.1, 1.0)
    assert drag_divergence(np.ones(80), half) == pytest.approx(0.05)
    assert diverged_fraction(VIV_FRACTION, 0.01) == pytest.approx(0.5 * (1.0 + VIV_FRACTION))
