"""The made sea: its height, its spectrum, its phases, its period and its seed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rope_twin.errors import InputError
from rope_twin.sea.ship_motion import BoxHull, heave_response
from rope_twin.sea.spectrum import jonswap, random_phases, read_spectrum
from rope_twin.twin.motion.ship_motion import synthesise

MEASURED = read_spectrum("ndbc_46042_1996", "1996-10-16T00Z")
HULL = BoxHull()


@settings(max_examples=20)
@given(st.integers(0, 2**63 - 1))
def test_every_seed_has_the_height_of_the_spectrum(seed):
    sea = synthesise(MEASURED, HULL, seed)
    assert 4.0 * np.std(sea.elevation_m) == pytest.approx(MEASURED.significant_height_m, rel=0.01)
    assert abs(np.mean(sea.elevation_m)) < 1e-9


def test_heave_spectrum_is_response_squared_times_wave_spectrum_with_its_phase():
    sea = synthesise(MEASURED, HULL, seed=7)
    count = len(sea.heave_m)
    frequency = np.fft.rfftfreq(count, 1.0 / sea.rate_hz)
    wave, heave = np.fft.rfft(sea.elevation_m), np.fft.rfft(sea.heave_m)
    line = 2.0 / (count**2 * frequency[1])
    inside = (frequency > 0.031) & (frequency < 0.399)
    response = heave_response(HULL, frequency[inside])
    assert line * np.abs(wave[inside]) ** 2 == pytest.approx(
        MEASURED.density_at(frequency[inside]), rel=1e-6, abs=1e-12
    )
    assert line * np.abs(heave[inside]) ** 2 == pytest.approx(
        np.abs(response) ** 2 * MEASURED.density_at(frequency[inside]), rel=1e-6, abs=1e-12
    )
    strong = np.abs(response) > 0.01
    apart = np.angle(heave[inside] / wave[inside] / response)
    assert np.max(np.abs(apart[strong])) < 1e-6
    assert np.max(np.abs(heave[~((frequency >= 0.03) & (frequency <= 0.4001))])) < 1e-8


def test_velocity_is_the_rate_of_the_heave_and_the_record_closes():
    sea = synthesise(MEASURED, HULL, seed=3, rate_hz=100.0)
    around = np.concatenate([sea.heave_m[-2:], sea.heave_m, sea.heave_m[:2]])
    step = 1.0 / sea.rate_hz
    rate = (8 * (around[3:-1] - around[1:-3]) - (around[4:] - around[:-4])) / (12 * step)
    assert rate == pytest.approx(sea.heave_velocity_m_per_s, abs=1e-6)  # the border included
    assert sea.duration_s == 1200.0


def test_long_waves_move_the_ship_as_they_move_the_water():
    swell = jonswap(2.0, 30.0)
    sea = synthesise(swell, BoxHull(length_m=20.0, breadth_m=5.0, draught_m=1.0), seed=1)
    lag = sea.heave_m - sea.elevation_m
    assert np.std(lag) < 0.1 * np.std(sea.elevation_m)


def test_seed_names_the_sea():
    one, same, other = (synthesise(MEASURED, HULL, seed) for seed in (5, 5, 6))
    assert np.array_equal(one.heave_m, same.heave_m)
    assert np.max(np.abs(one.heave_m - other.heave_m)) > 0.1
    assert "seed 5" in one.source
    # numpy promises PCG64's raw words; the bags in bags/ hang on it
    assert random_phases(25, 3) == pytest.approx(PHASES_OF_25, abs=1e-15)


PHASES_OF_25 = [1.0098412911951349, 0.0019605748017733657, 1.360928289470431]


@pytest.mark.parametrize(
    ("arguments", "reported"),
    [
        ({"seed": -1}, "seed: it is -1"),
        ({"duration_s": 5.0}, "duration: it is 5 s"),
        ({"duration_s": np.nan}, "duration: it is nan s"),
        ({"rate_hz": 0.5}, "rate: it is 0.5 Hz"),
        ({"rate_hz": np.inf}, "rate: it is inf Hz"),
        ({"duration_s": 100.03, "rate_hz": 10.0}, "no whole number of samples"),
    ],
)
def test_impossible_record_is_refused(arguments, reported):
    with pytest.raises(InputError, match=reported):
        synthesise(MEASURED, HULL, **({"seed": 1} | arguments))
