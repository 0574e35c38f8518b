"""Results of a plan with named axes, read back from netCDF."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import xarray

from rope_twin.planning.dataset import SUFFIXES, write_netcdf
from rope_twin.planning.judgement import QUANTITIES
from rope_twin.planning.pictures import limits_figure, series_figure
from rope_twin.planning.results import result_object, table_rows
from rope_twin.planning.run import PlanResult, plan

PLAN = """about: two depths
scene: deep_lift
vessel:
  responses: vessel_120m
  crane_tip_m: [10.0, 18.0, 12.0]
sea:
  hs_m: {from: 1.0, to: 4.0, step: 0.5}
  tp_s: [9.0, 12.0]
  headings_deg: [135.0, 180.0]
phases:
  - {name: halfway, at_depth: {depth_m: 1500.0, exposure_s: 60.0}}
  - {name: deep, at_depth: {depth_m: 2900.0, exposure_s: 60.0}}
criteria: {swl_n: 330000.0}
method: {seeds: {start: 4, most: 4}, settle_s: 20.0, elements: 10, step_s: 0.1}
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> PlanResult:
    """Return the result of the plan."""
    path = tmp_path_factory.mktemp("plan") / "two.yaml"
    path.write_text(PLAN)
    return plan(path)


def test_limits_of_the_simplified_method_at_the_end_of_the_grid_are_bounds(
    found: PlanResult,
) -> None:
    """In each output, as those of the runs are."""
    head, *rows = table_rows(found)
    column = head.index("simplified Hs m")
    cells = result_object(found)["cells"]
    ends = 0
    for row, cell in zip(rows, cells, strict=True):
        at_end = cell["simplified_hs_m"] == 4.0
        ends += at_end
        height = "none" if cell["simplified_hs_m"] is None else f"{cell['simplified_hs_m']:g}"
        assert row[column] == ("≥ 4" if at_end else height)
        assert cell["simplified_capped"] == ("end of the grid" if at_end else "")
    assert 0 < ends < len(cells)
    drawn = [
        line
        for axes in limits_figure(found).axes
        for line in axes.lines
        if line.get_marker() == "^" and line.get_fillstyle() == "none"
    ]
    assert sum(len(line.get_xdata()) for line in drawn) == ends


def test_the_picture_of_a_run_names_its_quantities(found: PlanResult) -> None:
    limit = next(cell for cell in found.cells if cell.shown is not None)
    time_s = np.arange(0.0, 300.0, 0.5)
    series = np.column_stack([3e5 + np.sin(time_s), 2e5 + np.sin(time_s), 1500.0 + time_s])
    labels = [axes.get_ylabel() for axes in series_figure(limit, time_s, series).axes]
    assert labels == ["hook load [kN]"] * 2 + ["tension at\npayload [kN]", "depth [m]"]


def test_every_limit_is_at_its_place(found: PlanResult, tmp_path: Path) -> None:
    """Arrays over phase, period and heading, read by their names."""
    write_netcdf(found, tmp_path / "plan.nc")
    with xarray.open_dataset(tmp_path / "plan.nc") as data:
        data.load()
    assert data.sizes["phase"] == 2
    for cell in found.cells:
        own = data.sel(phase=cell.phase, tp_s=cell.period_s, heading_deg=cell.heading_deg)
        height = math.nan if cell.height_m is None else cell.height_m
        assert float(own.limiting_hs_m) == pytest.approx(height, nan_ok=True)
        low, high = own.crossing_hs_interval_m.values
        assert (low, high) == (cell.low_m, cell.high_m)
        assert str(own.governing.values) == cell.governing
        assert str(own.capped.values) == cell.capped
        assert str(own.simplified_capped.values) == cell.simplified_capped
        if cell.judged is None:
            assert np.isnan(own.hook_load_n)
            continue
        load = cell.judged.values["hook_load"]
        assert float(own.hook_load_n) == load.value
        assert tuple(own.hook_load_interval_n.values) == (load.low, load.high)
        assert float(own.use.sel(criterion="swl_n")) == pytest.approx(load.value / 330e3)
    assert data.criterion_limit.sel(criterion="swl_n").values.tolist() == [330e3, 330e3]
    assert (data.static_hook_load_n.diff("phase") > 0.0).all(), "more wire hangs deeper"


def test_every_run_can_be_found_again(found: PlanResult, tmp_path: Path) -> None:
    """Seed, setting and error of each run, with units."""
    write_netcdf(found, tmp_path / "plan.nc")
    with xarray.open_dataset(tmp_path / "plan.nc") as data:
        data.load()
    assert data.sizes["run"] == found.runs
    for row in found.rows[:: len(found.rows) // 7]:
        own = data.sel(run=row["run"])
        for name in ("phase", "hs_m", "seed", "sea_seed", "elements", "step_s", "top_max_n"):
            assert own[f"run_{name}"].item() == row[name]
    largest = data.run_top_max_n.groupby(data.run_phase).max()
    assert float(largest.sel(run_phase="deep")) > float(largest.sel(run_phase="halfway"))


def test_every_variable_says_what_it_is(found: PlanResult) -> None:
    """CF: a meaning for each, a unit for each number; the file says what made it."""
    data = found.dataset
    for name, variable in data.variables.items():
        assert variable.attrs["long_name"], name
        if variable.dtype.kind in "fi":
            assert name == "criterion_limit" or variable.attrs["units"], name
        else:
            assert "units" not in variable.attrs, name
    assert data.tp_s.attrs["units"] == "s"
    assert data.hook_load_n.attrs["units"] == "N"
    assert data.run_min_n.attrs["units"] == "N"
    assert data.criterion_unit.sel(criterion="swl_n") == "N"
    assert data.attrs["plan_digest_sha256"] == found.plan.digest
    assert data.attrs["scene_digest_sha256"] == found.scene.digest
    assert data.attrs["percentile"] == 90.0
    assert {one.unit for one in QUANTITIES.values()} <= SUFFIXES.keys()
