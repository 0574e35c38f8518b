"""`rope_twin export`: numbers of a bag as a table, none invented and none lost."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from bag_samples import START_NS, STEP_NS, swell, write_heave

from rope_twin.cli import main
from rope_twin.errors import BagError, InputError
from rope_twin.recording.series_export import SERIES, read_series, write_series
from rope_twin.topics import BY_NAME


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded run of 4 s."""
    bag = tmp_path_factory.mktemp("run") / "lift"
    words = ["run", "snap_vertical", "--duration", "4s", "--speed", "0", "--out", str(bag)]
    assert main([*words, "--allow-overload"]) == 0
    return bag


def test_a_heave_bag_is_its_rows(tmp_path: Path) -> None:
    """Position and velocity at their stamps; the elevation's other stamps leave gaps."""
    rows = swell(40)
    waves = [(10 * STEP_NS, 0.5), (10 * STEP_NS + 7, -0.25)]
    table = read_series(write_heave(tmp_path / "sea", rows, elevation=waves))
    assert len(table.time_s) == 41
    z = table.columns["ship/heave/z_m"]
    known = np.isfinite(z)
    assert known.sum() == 40
    assert z[known] == pytest.approx([row[1] for row in rows])
    assert table.columns["ship/heave/vz_m_per_s"][known] == pytest.approx([r[2] for r in rows])
    assert table.time_s[known] == pytest.approx(np.array([row[0] for row in rows]) * 1e-9)
    eta = table.columns["sea/elevation/z_m"]
    assert np.isfinite(eta).sum() == 2
    assert eta[np.isfinite(eta)].tolist() == [0.5, -0.25]
    assert START_NS % 1_000_000_000 == 0


def test_stamps_that_come_again_are_reported(tmp_path: Path) -> None:
    """Two recordings by one clock that was set back: half of them is not in the table."""
    rows = swell(40)
    again = [(stamp_ns, z + 1.0, v) for stamp_ns, z, v in rows]
    table = read_series(write_heave(tmp_path / "sea", rows + again))
    assert table.columns["ship/heave/z_m"] == pytest.approx([row[1] for row in again])
    said = "ship/heave: 40 stamps came again with other values, the last are exported"
    assert table.problems == (said,)
    assert read_series(write_heave(tmp_path / "same", rows + rows)).problems == ()


def test_a_run_keeps_its_mechanics(run: Path) -> None:
    """Top tension is the magnitude of the force on the hang-off; line out does not change."""
    table = read_series(run)
    assert table.problems == ()
    force = np.sqrt(sum(table.columns[f"hang_off/wrench/f{axis}_n"] ** 2 for axis in "xyz"))
    tension = table.columns["ropes/tension_top/hoist/tension_n"]
    both = np.isfinite(force) & np.isfinite(tension)
    assert both.sum() > 150
    assert tension[both] == pytest.approx(force[both], rel=1e-12)
    assert np.nanmax(table.columns["ropes/length/hoist/line_out_m"]) == 2000.0
    z, speed = (table.columns[f"payloads/state/payload/{name}"] for name in ("z_m", "vz_m_per_s"))
    own = np.isfinite(z)
    moved = np.diff(z[own]) / np.diff(table.time_s[own])
    mean = 0.5 * (speed[own][1:] + speed[own][:-1])
    assert moved == pytest.approx(mean, abs=1e-3)
    assert table.time_s[0] == pytest.approx(0.0, abs=0.2)
    assert table.time_s[own][-1] == pytest.approx(4.0, abs=0.05)


def test_formats_have_the_same_numbers(run: Path, tmp_path: Path) -> None:
    table = read_series(run, ["ropes/tension_top", "payloads/state"])
    for ending in ("csv", "parquet", "nc"):
        write_series(table, tmp_path / f"lift.{ending}")
    with (tmp_path / "lift.csv").open() as stream:
        rows = list(csv.reader(stream))
    assert rows[0] == ["time_s", *table.columns]
    cells = np.array([[float(cell or "nan") for cell in row] for row in rows[1:]])
    expected = np.stack([table.time_s, *table.columns.values()], axis=1)
    assert np.array_equal(cells, expected, equal_nan=True)
    parquet = pytest.importorskip("pyarrow.parquet")
    found = parquet.read_table(tmp_path / "lift.parquet")
    assert found.column_names == ["time_s", *table.columns]
    assert np.array_equal(found["time_s"].to_numpy(), table.time_s)
    pytest.importorskip("h5py")
    h5netcdf = pytest.importorskip("h5netcdf")
    with h5netcdf.File(tmp_path / "lift.nc", "r") as file:
        own = file.variables["ropes.tension_top.hoist.tension_n"]
        assert own.dimensions == ("time_s",)
        assert own.attrs["units"] == "N"
        assert file.variables["payloads.state.payload.vz_m_per_s"].attrs["units"] == "m s-1"
        name = "ropes/tension_top/hoist/tension_n"
        assert np.array_equal(own[...], table.columns[name], equal_nan=True)


def test_every_exported_topic_is_one_of_the_table() -> None:
    assert set(SERIES) <= set(BY_NAME)


def test_the_command_reports_what_it_wrote(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "lift.csv"
    assert main(["export", str(run), "--out", str(out), "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["rows"] == len(out.read_text().splitlines()) - 1
    assert "ropes/tension_top/hoist/tension_n" in shown["columns"]
    assert math.isclose(shown["end_s"], 4.0, abs_tol=0.05)


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("--out lift.xls", "'lift.xls' is no table that is written; end it in .csv"),
        ("--out lift.csv --topics ropes/tention_top", "did you mean 'ropes/tension_top'?"),
        ("--out lift.csv --topics winch/measured", "no topic with a time series; it must have"),
        ("--out /proc/nowhere/lift.csv", "it cannot be written"),
    ],
)
def test_what_cannot_be_exported_is_one_sentence(
    run: Path, words: str, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(run), *words.split()]) == 1
    said = capsys.readouterr().err
    assert fault in said
    assert said.count("\n") == 1


def test_no_bag_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(BagError):
        read_series(tmp_path)
    with pytest.raises(InputError):
        read_series(tmp_path, ["twin/epoch"])
