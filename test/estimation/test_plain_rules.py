"""Plain rules: stuck load pin, motion sensor and encoder, and a payload that is gone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rope_twin import load_scene
from rope_twin.estimation.alarms import largest_deceleration
from rope_twin.estimation.fault_tests import LostPayload, RepeatedSample, StuckEncoder
from rope_twin.scene.winch import EmergencyStop

RATE_HZ = 20.0


def times(seconds: float) -> np.ndarray:
    """Instants of samples."""
    return np.arange(round(seconds * RATE_HZ)) / RATE_HZ


def stuck_at(rule: RepeatedSample, values: np.ndarray) -> float | None:
    """Time at which the sensor is found stuck, or None."""
    for time_s, value in zip(times(len(values) / RATE_HZ), values, strict=True):
        rule.take(float(time_s), float(value))
        if rule.stuck:
            return float(time_s)
    return None


def test_a_load_pin_that_repeats_for_a_second_is_stuck() -> None:
    """Found 1 s after its last new sample, which it names; noise before is not stuck."""
    values = np.round(3e5 + 3750.0 * np.random.default_rng(0).standard_normal(1200), -1)
    values = np.tile(values, 2)
    values[2000:] = values[2000]
    rule = RepeatedSample()
    assert stuck_at(rule, values) == pytest.approx(101.0)
    assert rule.since_s == pytest.approx(100.0)


def test_coarse_heave_at_its_crests_is_not_stuck() -> None:
    """2 cm of resolution, 6 cm of swell: repeats of more than 1 s are ordinary there."""
    heave = np.round(0.06 * np.sin(2.0 * np.pi * times(300.0) / 12.0) / 0.02) * 0.02
    rule = RepeatedSample()
    assert stuck_at(rule, heave) is None
    assert 2.0 < rule.limit_s < 5.0


def test_a_sensor_that_was_stuck_does_not_become_ordinary() -> None:
    """A repeat of a minute that ends leaves the limit as it was."""
    values = np.random.default_rng(1).standard_normal(6000)
    values[2000:3200] = 0.5
    rule = RepeatedSample()
    assert stuck_at(rule, values[:3200]) == pytest.approx(101.0)
    for k, value in enumerate(values[2021:3200]):
        rule.take(101.05 + k / RATE_HZ, float(value))
    assert rule.stuck
    for k, value in enumerate(values[3200:]):
        rule.take(160.0 + k / RATE_HZ, float(value))
        assert not rule.stuck
    assert rule.limit_s == 1.0


def test_missing_samples_are_no_repeats() -> None:
    """NaN for a minute: a hole is missing data, and slow sensors need five equal samples."""
    rule = RepeatedSample()
    rule.take(0.0, 1.0)
    for k in range(1200):
        rule.take(k / RATE_HZ, float("nan"))
    assert not rule.stuck
    for time_s in (60.0, 62.0, 64.0):
        rule.take(time_s, 2.0)
    assert not rule.stuck


def encoder(line_out: np.ndarray) -> tuple[float | None, float]:
    """Time at which an encoder is found stuck, and since when."""
    rule = StuckEncoder(0.3, 0.01)
    for k, value in enumerate(line_out):
        rule.take(k / RATE_HZ, float(round(value, 2)))
        if rule.stuck:
            return k / RATE_HZ, rule.since_s
    return None, rule.since_s


def test_an_encoder_stuck_while_paying_out_is_found() -> None:
    """1 m/s cannot stop at once by 0.3 m/s²."""
    line = 3000.0 + times(30.0)
    line[400:] = line[400]
    found, since = encoder(line)
    assert found == pytest.approx(21.0, abs=0.06)
    assert since == pytest.approx(20.0, abs=0.06)


def test_a_winch_that_stops_within_its_limit_is_not_stuck() -> None:
    """It slows down by 0.3 m/s² and stands for minutes."""
    time = times(60.0)
    for speed in (1.0, 0.3, 0.05):
        slowing = np.clip(time - 20.0, 0.0, speed / 0.3)
        line = 3000.0 + speed * np.minimum(time, 20.0) + speed * slowing - 0.15 * slowing**2
        assert encoder(line)[0] is None


def test_an_encoder_of_a_line_at_rest_is_not_stuck() -> None:
    """It repeats, and nothing has moved before."""
    assert encoder(np.full(200, 3000.0))[0] is None


def lost_at(measured: np.ndarray, predicted: np.ndarray) -> tuple[float | None, float | None]:
    """Time at which the payload (156 kN, 160 kN of rope) is found lost, and since when."""
    rule = LostPayload()
    for k, (one, other) in enumerate(zip(measured, predicted, strict=True)):
        begun = rule.take(0.25 * k, float(one), float(other), 160e3, 156e3)
        if begun is not None:
            return 0.25 * k, begun
    return None, None


def test_a_lost_payload_is_found_within_two_seconds() -> None:
    """The measured tension falls from 318 to 170 kN."""
    predicted = 318e3 + 20e3 * np.sin(0.6 * 0.25 * np.arange(120))
    measured = predicted.copy()
    measured[60:] -= 150e3
    found, begun = lost_at(measured, predicted)
    assert found is not None
    assert 15.0 < found <= 17.0
    assert begun == pytest.approx(15.0)


def test_a_storm_that_unloads_the_rope_is_no_lost_payload() -> None:
    """110 kN of amplitude in measurement and prediction, half a second apart."""
    k = np.arange(2400)
    predicted = 318e3 + 110e3 * np.sin(0.6 * 0.25 * k)
    measured = 318e3 + 110e3 * np.sin(0.6 * (0.25 * k - 0.5))
    assert lost_at(measured, predicted)[0] is None
    assert lost_at(np.full(2400, np.nan), predicted)[0] is None


def test_a_sensor_that_has_not_begun_to_move_is_not_stuck() -> None:
    """A minute of exact zeros before the first message; after that a repeat is a fault."""
    values = np.concatenate([np.zeros(1200), np.random.default_rng(2).standard_normal(2400)])
    rule = RepeatedSample()
    assert stuck_at(rule, values) is None
    for k in range(60):
        rule.take(180.0 + k / RATE_HZ, 0.5)
    assert rule.stuck


def test_an_emergency_stop_is_no_stuck_encoder() -> None:
    """1 m/s stops by 2 m/s², far beyond the ordinary 0.3 m/s², and the winch stands."""
    winch = load_scene("deep_lift").winch
    assert winch is not None
    hard = dataclasses.replace(
        winch,
        acceleration_limit_m_per_s2=0.3,
        emergency_stop=EmergencyStop(deceleration_m_per_s2=2.0),
    )
    assert largest_deceleration(None) == 0.0
    assert largest_deceleration(dataclasses.replace(hard, emergency_stop=None)) == 0.3
    rule = StuckEncoder(largest_deceleration(hard), 0.01)
    for time_s in times(40.0):
        slowing = min(max(time_s - 20.0, 0.0), 0.5)
        line = 3000.0 + min(time_s, 20.0) + slowing - slowing**2
        rule.take(float(time_s), round(float(line), 2))
        assert not rule.stuck
