"""Motion of the crane tip: rigid transfer, moments against records, and both kinds of records."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.planning.seas import (
    HullTip,
    ResponsesTip,
    SeaState,
    Ship,
    tip_moments,
    tip_on_waves,
    tip_record,
)
from rope_twin.recording.motion_source import sea_of_waves
from rope_twin.scene.load import load_scene
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.raos import moved_by
from rope_twin.sea.ship_motion import BoxHull

ARM_M = (10.0, 18.0, 12.0)
TIP = ResponsesTip(read_responses("vessel_120m"), ARM_M)
SEA = SeaState(2.5, 9.0, 150.0)


def test_tip_moves_rigidly() -> None:
    """x_tip = x + θ × r, by numpy's cross product, to 1e-9."""
    random = np.random.default_rng(1)
    answer = random.standard_normal((6, 40)) + 1j * random.standard_normal((6, 40))
    expected = answer[:3].T + np.cross(answer[3:].T, np.array(ARM_M))
    np.testing.assert_allclose(moved_by(answer, ARM_M)[:3], expected.T, rtol=1e-9, atol=1e-12)


def test_height_of_the_spectrum_is_exact() -> None:
    """A_γ = 1 - 0.287·ln γ is a fit; the scaled spectrum has Hs to round-off."""
    for gamma in (1.0, 3.3, 7.0):
        found = SeaState(3.0, 8.0, 180.0, gamma).spectrum().significant_height_m
        assert found == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize("spreading", [None, 6.0])
def test_records_have_the_moments_of_the_spectrum(spreading: float | None) -> None:
    """Mean variance of 60 records within 4 standard errors of the spectral moment."""
    sea = SeaState(2.5, 9.0, 150.0, spreading=spreading)
    moments = tip_moments(TIP, sea)
    records = [tip_record(Ship(TIP, 0.4), sea, seed, 1800.0) for seed in range(60)]
    for values, rms in (
        ([r.position_m.var() for r in records], moments.rms_m),
        ([r.velocity_m_per_s.var() for r in records], moments.rms_m_per_s),
    ):
        error = np.std(values, ddof=1) / math.sqrt(len(values))
        assert np.mean(values) == pytest.approx(rms**2, abs=4.0 * error)
        assert np.std(values) > 0.02 * rms**2  # a Gaussian sea: no two records are equally high


def test_velocity_is_the_rate_of_position() -> None:
    """Central differences of the samples, to the error of 20 Hz."""
    record = tip_record(Ship(TIP, 0.0), SEA, 3, 120.0)
    rate = np.gradient(record.position_m, 0.05)[5:-5]
    assert np.abs(rate - record.velocity_m_per_s[5:-5]).max() < 2e-3
    assert record.lateral is not None
    rate = np.gradient(record.lateral[0], 0.05)[5:-5]
    assert np.abs(rate - record.lateral[2][5:-5]).max() < 2e-3


def test_a_seed_is_the_same_sea_whatever_its_height() -> None:
    """Twice the height is twice the motion, where the spectrum keeps its shape."""
    low = tip_record(Ship(TIP, 0.0), SeaState(1.0, 9.0, 150.0, 3.3), 5, 300.0)
    high = tip_record(Ship(TIP, 0.0), SeaState(2.0, 9.0, 150.0, 3.3), 5, 300.0)
    np.testing.assert_allclose(high.position_m, 2.0 * low.position_m, rtol=1e-9, atol=1e-12)


def test_bow_turns_the_motion_aside() -> None:
    """With the bow to the north, what was east is north."""
    east = tip_record(Ship(TIP, 0.0), SEA, 5, 60.0)
    north = tip_record(Ship(TIP, 0.5 * math.pi), SEA, 5, 60.0)
    assert east.lateral is not None
    assert north.lateral is not None
    np.testing.assert_allclose(north.lateral[1], east.lateral[0], atol=1e-12)
    np.testing.assert_allclose(north.lateral[0], -east.lateral[1], atol=1e-12)


def test_hull_on_waves_is_that_of_a_run() -> None:
    """The motion on a scene's waves agrees with the samples that a run feeds to its twin."""
    scene = load_scene("splash_zone")
    waves = scene.listed(WavesParams)
    assert waves is not None
    components = components_of(waves, 9.80665)
    record = tip_on_waves(Ship(HullTip(BoxHull()), 0.0), components, (0.0, 0.0), 20.0)
    sea = sea_of_waves(scene)
    assert sea is not None
    for k in (0, 4, 137, 400):
        sample = sea.sample(int(record.stamp_ns[k]))
        assert record.position_m[k] == pytest.approx(sample.position_m, abs=1e-9)
        assert record.velocity_m_per_s[k] == pytest.approx(sample.velocity_m_per_s, abs=1e-9)


def test_responses_on_waves_are_those_of_a_run_for_small_turns() -> None:
    """A run turns the ship by finite angles; the linear tip differs by their squares."""
    scene = load_scene("ship_6dof")
    waves = scene.listed(WavesParams)
    assert waves is not None
    tip = ResponsesTip(read_responses("vessel_120m"), (10.0, 18.0, 12.0))
    components = components_of(waves, 9.80665)
    record = tip_on_waves(Ship(tip, 0.0), components, (0.0, 0.0), 60.0)
    sea = sea_of_waves(scene)
    assert sea is not None
    samples = [sea.sample(int(stamp)) for stamp in record.stamp_ns]
    heave = np.array([one.position_m for one in samples])
    assert np.abs(heave).max() > 0.3
    assert np.abs(record.position_m - heave).max() < 0.02 * np.abs(heave).max()
    aside = np.array([one.lateral for one in samples if one.lateral is not None])
    assert record.lateral is not None
    assert np.abs(record.lateral[0] - aside[:, 0]).max() < 0.05 * np.abs(aside[:, 0]).max()
