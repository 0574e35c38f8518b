"""Wave spectra: measured files, JONSWAP, Pierson-Moskowitz, invalid files."""

from math import gamma

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rope_twin.errors import InputError
from rope_twin.sea.spectrum import band_spectrum, jonswap, read_spectrum


@pytest.mark.parametrize(
    ("column", "height_m", "peak_s"),
    [
        ("1996-07-30T13Z", 1.20, 14.3),
        ("1996-10-16T00Z", 2.50, 12.5),
        ("1996-11-29T15Z", 4.00, 9.1),
        ("1996-03-13T10Z", 6.47, 11.1),
    ],
)
def test_measured_spectra_have_the_heights_and_periods_of_their_table(column, height_m, peak_s):
    spectrum = read_spectrum("ndbc_46042_1996", column)
    assert spectrum.significant_height_m == pytest.approx(height_m, abs=0.006)
    assert spectrum.peak_period_s == pytest.approx(peak_s, abs=0.05)
    assert spectrum.frequency_hz[[0, -1]] == pytest.approx([0.03, 0.40])


def test_whole_heading_names_a_column_too():
    short = read_spectrum("ndbc_46042_1996", "1996-10-16T00Z")
    long = read_spectrum("ndbc_46042_1996", "S_1996-10-16T00Z_m2_per_hz")
    assert np.array_equal(short.density_m2_per_hz, long.density_m2_per_hz)


def test_density_is_linear_between_and_zero_outside():
    spectrum = read_spectrum("ndbc_46042_1996", "1996-10-16T00Z")
    here, there = spectrum.density_m2_per_hz[4:6]
    middle = spectrum.density_at(np.array([0.075, 0.0299, 0.4001]))
    assert middle == pytest.approx([0.5 * (here + there), 0.0, 0.0])


@given(height=st.floats(0.3, 15.0), period=st.floats(3.0, 20.0), peak=st.floats(1.0, 7.0))
def test_jonswap_height_and_peak_period(height, period, peak):
    spectrum = jonswap(height, period, peak)
    assert spectrum.significant_height_m == pytest.approx(height, rel=0.01)
    assert spectrum.peak_period_s == pytest.approx(period, rel=0.006)
    # at the peak both exponentials are known: S = A·(5/16)·Hs²·Tp·e^-1.25·γ
    top = (1 - 0.287 * np.log(peak)) * 0.3125 * height**2 * period * np.exp(-1.25) * peak
    assert spectrum.density_at(np.array([1.0 / period]))[0] == pytest.approx(top, rel=1e-3)


@pytest.mark.parametrize(
    ("height_m", "period_s", "factor"),
    # sea states 3 to 6 by Tp/√Hs; one steeper than any of them
    [
        (0.9, 7.5, 1.0),
        (1.9, 8.8, 1.0),
        (3.3, 9.7, 1.0),
        (5.0, 12.4, 1.0),
        (4.0, 8.0, 3.16),
        (5, 7, 5),
    ],
)
def test_peak_factor_follows_from_steepness(height_m, period_s, factor):
    assert f"gamma {factor:.3g}" in jonswap(height_m, period_s).source


def test_pierson_moskowitz_has_its_closed_form_moments():
    spectrum = jonswap(3.0, 10.0, gamma=1.0)
    # ∫ f·S df = (5/64)·Hs²·fp·1.25^(−3/4)·Γ(3/4) over all f; cut off are f⁻⁴ beyond 5·fp
    whole = 5 / 64 * 9.0 * 0.1 * 1.25**-0.75 * gamma(0.75)
    tail = 5 / 16 * 9.0 * 0.1 / (3 * 5**3)
    assert spectrum.moment(0) == pytest.approx(9.0 / 16.0 * np.exp(-1.25 / 625), rel=1e-4)
    assert spectrum.moment(1) == pytest.approx(whole - tail, rel=1e-4)


@pytest.mark.parametrize("arguments", [(0.0, 8.0), (2.0, np.nan), (2.0, 50.0), (2.0, 8.0, 0.5)])
def test_invalid_jonswap_parameters_are_rejected(arguments):
    with pytest.raises(InputError, match="right is"):
        jonswap(*arguments)


@given(band=st.integers(1, 199), amplitude=st.floats(0.01, 10.0), phase=st.floats(0.0, 6.3))
def test_band_spectrum_finds_a_wave_and_its_variance(band, amplitude, phase):
    time_s = np.arange(2000) / 4.0
    wave = amplitude * np.cos(2 * np.pi * 0.01 * band * time_s + phase)
    spectrum = band_spectrum(wave, 4.0)
    assert spectrum.peak_period_s == pytest.approx(100.0 / band)
    assert 0.01 * spectrum.density_m2_per_hz.sum() == pytest.approx(0.5 * amplitude**2)


HEAD = "frequency_hz,S_a_m2_per_hz,S_b_m2_per_hz\n"
BAD_FILES = {
    "empty": (b"", "it is empty"),
    "heading alone": (HEAD.encode(), "it has a header and no rows"),
    "another first column": (b"period_s,S_a_m2_per_hz\n1,2\n2,3\n", "no column frequency_hz"),
    "a missing cell": ((HEAD + "0.1,1,1\n0.2,1\n").encode(), "line 3: 2 values"),
    "a word": ((HEAD + "0.1,1,1\n0.2,one,1\n").encode(), "line 3: 'one'"),
    "nan": ((HEAD + "0.1,1,1\n0.2,nan,1\n").encode(), "line 3: 'nan'"),
    "infinite": ((HEAD + "0.1,inf,1\n0.2,1,1\n").encode(), "line 2: 'inf'"),
    "negative density": ((HEAD + "0.1,1,1\n0.2,-1,1\n").encode(), "line 3: the density of 'a'"),
    "frequencies fall": ((HEAD + "0.2,1,1\n0.1,1,1\n").encode(), "line 3: the frequency 0.1 Hz"),
    "a frequency twice": ((HEAD + "0.1,1,1\n0.2,1,1\n0.2,1,1\n").encode(), "line 4"),
    "frequency zero": ((HEAD + "0,1,1\n0.2,1,1\n").encode(), "line 2: the frequency 0 Hz"),
    "one frequency": ((HEAD + "0.1,1,1\n").encode(), "it has one frequency"),
    "no energy": ((HEAD + "0.1,0,1\n0.2,0,1\n").encode(), "'a' is zero everywhere"),
    "not text": (b"\xff\xfe\x00" * 20, "it is not UTF-8 text (byte 0xff at 0)"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_invalid_spectrum_files_are_rejected_with_the_line(tmp_path, name):
    content, reported = BAD_FILES[name]
    path = tmp_path / "sea.csv"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_spectrum(path, "a")
    text = str(caught.value)
    assert reported in text
    assert text.startswith(str(path))
    assert text.endswith(".")
    assert "\n" not in text


def test_unknown_columns_and_names_are_reported_with_the_nearest():
    with pytest.raises(InputError, match="did you mean '1996-10-16T00Z'"):
        read_spectrum("ndbc_46042_1996", "1996-10-16T01Z")
    with pytest.raises(InputError, match="did you mean 'ndbc_46042_1996'"):
        read_spectrum("ndbc_46042_1997", "1996-10-16T00Z")
