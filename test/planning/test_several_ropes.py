"""Plans of multi-line scenes: criteria of each rope; lateral offset in a current."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray

from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.planning.cells import Cell, RowStore
from rope_twin.planning.dataset import write_netcdf
from rope_twin.planning.phases import Leg, legs_of, suspended_at
from rope_twin.planning.pictures import show_cell
from rope_twin.planning.plan_reader import read_plan, tip_of
from rope_twin.planning.results import result_object, summary_lines, table_rows
from rope_twin.planning.run import PlanResult, run_plan
from rope_twin.planning.runs import watch_twin
from rope_twin.planning.seas import LEAD_SAMPLES, Ship, tip_record
from rope_twin.planning.simplified import lateral_offset_m, lift_of
from rope_twin.planning.tables import further_tables
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.schema import Scene

TWO = """scene: two_line_lift
vessel: {responses: vessel_120m, crane_tip_m: [10.0, 18.0, 12.0], bow_deg: 30.0}
sea: {hs_m: {from: 1.0, to: 2.0, step: 1.0}, tp_s: [9.0], headings_deg: [135.0]}
phases:
  - {name: together, from_scene: {exposure_s: 15.0}}
criteria: {swl_n: 1.6e+5, safety_factor: 4.0}
method: {seeds: {start: 3, most: 3}, elements: 8, step_s: 0.05, settle_s: 2.0}
"""


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> PlanResult:
    """Return the result of a plan of two winches."""
    path = tmp_path_factory.mktemp("plan") / "two.yaml"
    path.write_text(TWO)
    own, scene = read_plan(path)
    return run_plan(own, scene, RowStore(), threads=1)


def test_each_rope_has_its_criteria(two: PlanResult) -> None:
    """SWL, MBL and slack of fore and aft; the governing one is named with its rope."""
    (work,), (cell,) = two.works, two.cells
    keys = {limit.key for limit in work.limits}
    kinds = ("swl_n", "safety_factor", "uplift_share")
    assert keys == {f"{kind}[{rope}]" for kind in kinds for rope in ("fore", "aft")}
    judged = cell.judged or cell.beyond
    assert judged is not None
    worst = max(judged.uses, key=lambda key: judged.uses[key].value)
    assert cell.governing == worst
    named = table_rows(two)[1][5]
    assert any(rope in named for rope in ("fore", "aft"))
    values = judged.values
    top = max(values[f"rope_load[{rope}]"].value for rope in ("fore", "aft"))
    assert top == pytest.approx(values["hook_load"].value, rel=0.02)
    assert judged.uses["safety_factor[fore]"].value == pytest.approx(
        values["rope_load[fore]"].value * 4.0 / two.scene.ropes[0].breaking_load_n
    )


def test_static_loads_of_two_ropes_carry_the_weight(two: PlanResult) -> None:
    """Both upper ends: payload and wires, by the small inclination of the two."""
    leg = two.works[0].legs[0]
    scene, density = leg.scene, two.scene.environment.water_density_kg_per_m3
    wires = sum(
        (line.rope.mass_kg_per_m - density * 0.25 * math.pi * line.rope.hydrodynamic_diameter_m**2)
        * line.length_m
        for line in scene.ropes
        if line.rope is not None
    )
    weight = 9.80665 * (25_000.0 - 5.0 * density + wires)
    assert sum(one.upper_n for one in leg.ropes) == pytest.approx(weight, rel=0.01)
    assert [one.from_ship for one in leg.ropes] == [True, True]


def test_results_without_a_simplified_method(two: PlanResult) -> None:
    """Tables and objects say so instead of numbers."""
    found = result_object(two)
    assert found["cells"][0]["simplified"] == []
    assert table_rows(two)[1][-2:] == ["–", "–"]
    _, values = further_tables(two)  # without snap loads, which are those of the method
    assert any("tension, aft" in word for word in values.rows[0])
    hours = f"{two.runs} runs of {round(two.simulated_s / 3600.0, 2):g} h in all"
    assert any(line.startswith(hours) for line in summary_lines(two))
    assert two.simulated_s > 0.0


def test_loads_of_each_rope_are_in_the_dataset(two: PlanResult, tmp_path: Path) -> None:
    """By names with units, without those of the simplified method, read back from netCDF."""
    write_netcdf(two, tmp_path / "plan.nc")
    with xarray.open_dataset(tmp_path / "plan.nc") as data:
        data.load()
    judged = two.cells[0].judged
    assert judged is not None
    for rope in ("fore", "aft"):
        load = judged.values[f"rope_load[{rope}]"]
        assert data[f"rope_load_{rope}_n"].item() == load.value
        assert data[f"rope_load_{rope}_interval_n"].values.ravel().tolist() == [load.low, load.high]
        assert data[f"rope_load_{rope}_n"].attrs["units"] == "N"
        assert data.criterion_unit.sel(criterion=f"swl_n[{rope}]") == "N"
        assert data.criterion_unit.sel(criterion=f"uplift_share[{rope}]") == "1"
        runs = [row[f"rope_load[{rope}]"] for row in two.rows]
        assert data[f"run_rope_load_{rope}_n"].values.tolist() == runs
    assert np.isnan(data.simplified_hook_load_n).all()


def test_a_cell_shows_the_hook_load_that_governs(two: PlanResult, tmp_path: Path) -> None:
    """That of the rope with the larger one, in its numbers and in its series."""
    (cell,), store = two.cells, RowStore({row["run"]: row for row in two.rows})
    search = Cell(two.plan, two.works[0], (0, 0, 0), store)
    shown = show_cell(search, cell, tmp_path)
    (row,) = (r for r in two.rows if (r["hs_m"], r["seed"]) == (shown["hs_m"], shown["seed"]))
    loads = [row[f"rope_load[{rope}]"] for rope in ("fore", "aft")]
    assert shown["hook_load_max_n"] == row["top_max_n"] == pytest.approx(max(loads), rel=1e-3)
    assert shown["payload_tension_min_n"] == row["payload_min_n"]
    series = np.loadtxt(shown["series"], delimiter=",", skiprows=1)
    assert series[:, 1].max() == pytest.approx(row["top_max_n"], rel=1e-5)


def test_hang_off_follows_the_record_of_the_tip(two: PlanResult) -> None:
    """Six degrees of freedom about the reference point: at small angles the tip's own record."""
    plan, scene, leg = two.plan, two.scene, two.works[0].legs[0]
    tip, bow, sea = tip_of(plan, scene), plan.bow_of(scene), plan.sea_state(1.0, 0, 0)
    short = replace(leg, seconds=14.0)
    samples = list(watch_twin(short, Ship(tip, bow), sea, 5))
    series = tip_record(Ship(tip, bow), sea, 5, 14.0)
    late = [sample for sample in samples if sample.time_s >= scene.ship.motion_ramp_s]
    time = np.array([sample.time_s for sample in late])
    at = series.stamp_ns[LEAD_SAMPLES:] * 1e-9
    assert series.lateral is not None
    expected = [series.lateral[0], series.lateral[1], series.position_m]
    moved = np.array([sample.hang_off_m for sample in late]) - scene.ship.hang_off_m
    for own, right in zip(moved.T, expected, strict=True):
        assert own == pytest.approx(np.interp(time, at, right[LEAD_SAMPLES:]), abs=0.01)


def test_depth_phases_of_several_ropes_are_refused(tmp_path: Path) -> None:
    """One sentence with the way out."""
    path = tmp_path / "two.yaml"
    path.write_text(TWO.replace("from_scene: {exposure_s: 15.0}", "at_depth: {depth_m: 500.0}"))
    with pytest.raises(Exception, match="ropes of 'two_line_lift' meet, and depths are those of"):
        read_plan(path)


def uniform(scene: Scene, speed: float) -> Scene:
    """Return a scene in a uniform current to the east."""
    current = CurrentParams(profile=((0.0, (speed, 0.0)),))
    kept = [own for own in scene.effects if not isinstance(own, CurrentParams)]
    return replace(scene, effects=(current, *kept))


def test_lateral_offset_in_a_uniform_current() -> None:
    """∫ (F + f·s)/(W + w·s) ds = (f/w)·L + (F - f·W/w)/w·ln(1 + w·L/W), small angles."""
    plan, scene = read_plan("deep_installation")
    speed, depth = 0.2, 1500.0
    moved = uniform(scene, speed)
    (leg,) = legs_of(
        plan,
        moved,
        replace(plan.phases[1], at_depth=replace(plan.phases[1].at_depth, depth_m=depth)),
    )  # type: ignore[type-var]
    lift, figures = lift_of(leg), lift_figures(moved)
    drag, rope = moved.listed(DragParams), moved.ropes[0].made_of[0].rope
    assert drag is not None
    assert figures.payload is not None
    half = 0.5 * moved.environment.water_density_kg_per_m3 * speed**2
    F, f = half * figures.payload.drag_area_m2[0], half * drag.normal * rope.hydrodynamic_diameter_m
    W, L = lift.weight_n, lift.length_m
    w = (lift.static_hook_n - W) / L
    below = L - scene.ship.hang_off_m[2]  # in water
    right = f / w * below + (F - f * W / w) / w * math.log1p(w * below / W)
    above = L - below
    right += above * (F + f * below) / (W + w * (L - 0.5 * above))
    assert right < 0.05 * L
    assert lateral_offset_m(leg, lift) == pytest.approx(right, rel=0.005)
    assert leg.offset_m == pytest.approx(right, rel=0.01)
    assert suspended_at(moved, depth).offset_m == leg.offset_m


def test_offset_is_a_criterion(tmp_path: Path) -> None:
    """The largest offset of a leg stands in its rows."""
    path = tmp_path / "lift.yaml"
    path.write_text(
        "scene: deep_lift\n"
        "vessel: {responses: vessel_120m, crane_tip_m: [10.0, 18.0, 12.0]}\n"
        "sea: {hs_m: {from: 1.0, to: 2.0, step: 1.0}, tp_s: [9.0], headings_deg: [135.0]}\n"
        "phases:\n  - at_depth: {depth_m: 1000.0, exposure_s: 60.0}\n"
        "criteria: {offset_m: 0.5}\n"
        "method: {seeds: {start: 3, most: 3}, elements: 8, step_s: 0.1, settle_s: 2.0}\n"
    )
    own, scene = read_plan(path)
    result = run_plan(own, scene, RowStore(), threads=1)
    leg: Leg = result.works[0].legs[0]
    assert leg.offset_m > 0.5
    (cell,) = result.cells
    assert cell.height_m is None
    assert cell.governing == "offset_m"
    assert cell.beyond is not None
    assert cell.beyond.values["offset"].value == pytest.approx(leg.offset_m)


def test_winch_with_a_drive_is_planned_from_its_scene(tmp_path: Path) -> None:
    """Its line out depends on the tension, so that a twin steps it; depths are refused."""
    path = tmp_path / "drive.yaml"
    path.write_text(
        TWO.replace("two_line_lift", "emergency_stop").replace("1.6e+5", "9.0e+5")
        .replace("exposure_s: 15.0", "exposure_s: 10.0").replace("to: 2.0", "to: 1.0")
    )  # fmt: skip
    own, scene = read_plan(path)
    result = run_plan(own, scene, RowStore(), threads=1)
    judged = result.cells[0].judged or result.cells[0].beyond
    assert judged is not None
    assert judged.failures == 0
    assert set(judged.uses) == {"swl_n", "safety_factor", "uplift_share"}
    assert judged.values["hook_load"].value > 0.9 * result.works[0].static_hook_n
    path.write_text(path.read_text().replace("from_scene: {exposure_s: 10.0}",
                                             "at_depth: {depth_m: 500.0}"))  # fmt: skip
    with pytest.raises(
        Exception, match="leave drive and passive_compensation out of the winch, or"
    ):
        read_plan(path)
