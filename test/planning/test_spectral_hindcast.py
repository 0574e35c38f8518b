"""Hindcasts of wave spectra: heights and directions by wavespectra, where it is installed."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from rope_twin.errors import InputError
from rope_twin.planning.weather_files import read_spectra

HERE = importlib.util.find_spec("wavespectra") is not None
needs_wavespectra = pytest.mark.skipif(not HERE, reason="wavespectra is not installed")


def test_a_missing_wavespectra_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="needs wavespectra, and it is not there; install it"):
        read_spectra(tmp_path / "era5.nc", "era5")


@needs_wavespectra
def test_spectra_give_height_period_and_direction(tmp_path: Path) -> None:
    """A triangle over f and one direction: Hs = 4·√(∫S df), Tp its top, waves from 225°."""
    import wavespectra  # gives data sets their `spec`
    import xarray

    f, directions = np.linspace(0.05, 0.25, 41), np.arange(0.0, 360.0, 15.0)
    top = np.maximum(0.0, 1.0 - np.abs(f - 0.1) / 0.04)
    heights = np.array([1.0, 2.0, 3.0])
    density = np.zeros((3, len(f), len(directions)))
    density[:, :, 15] = (heights**2 / 16.0)[:, None] * top / np.trapezoid(top, f) / 15.0
    times = np.array(["2001-01-31T21", "2001-02-01T00", "2001-02-01T06"], "datetime64[ns]")
    dataset = xarray.Dataset(
        {"efth": (("time", "freq", "dir"), density)},
        {"time": times, "freq": f, "dir": directions},
    )
    assert wavespectra.read_netcdf
    dataset.spec.to_netcdf(str(tmp_path / "spectra.nc"))
    with pytest.raises(InputError, match="wavespectra has no reader 'era6'; did you mean"):
        read_spectra(tmp_path / "spectra.nc", "era6")
    found = read_spectra(tmp_path / "spectra.nc", "netcdf")
    known = np.isfinite(found.hs_m)
    assert found.hs_m[known] == pytest.approx(heights, rel=2e-3)
    assert found.tp_s[known] == pytest.approx(10.0, rel=2e-2)
    assert found.towards_deg is not None
    assert found.towards_deg[known] == pytest.approx(45.0, abs=1e-6)
    assert found.month[0] == 1
    assert found.month[-1] == 2
    assert found.step_s == 3.0 * 3600.0
    assert known.tolist() == [True, True, False, True]


@needs_wavespectra
def test_a_file_of_another_format_is_refused(tmp_path: Path) -> None:
    (tmp_path / "spectra.nc").write_text("no spectra")
    with pytest.raises(InputError, match=r"spectra\.nc: it cannot be read \("):
        read_spectra(tmp_path / "spectra.nc", "era5")
