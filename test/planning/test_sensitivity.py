"""Weights of uncertain numbers: published functions, closed forms, and a small plan."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow.parquet as parquet
import pytest
from scipy import stats

from rope_twin.cli import main
from rope_twin.effects.current import CurrentParams
from rope_twin.errors import InputError
from rope_twin.planning.phases import legs_of
from rope_twin.planning.plan_reader import read_plan, tip_of
from rope_twin.planning.sensitivity import (
    Index,
    Sensitivity,
    case_of,
    design,
    indices,
    lowest_cell,
    outputs_at,
    panels,
    run_sensitivity,
)
from rope_twin.planning.uncertainties import Normal, Triangular, Uniform, with_values

SHARES = np.linspace(0.0, 1.0, 41)


def test_sobol_of_ishigami() -> None:
    """sin x1 + 7 sin² x2 + 0.1 x3⁴ sin x1 on ±π: the shares of Ishigami and Homma (1990)."""
    names = ["x1", "x2", "x3"]
    samples = design("sobol", names, 1024, 1)
    x = Uniform(from_=-math.pi, to=math.pi).quantile(samples).T
    y = np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0])
    found = {one.name: one for one in indices("sobol", names, samples, {"y": y}, 1)}
    for name, first, total in (("x1", 0.3139, 0.5576), ("x2", 0.4424, 0.4424),
                               ("x3", 0.0, 0.2437)):  # fmt: skip
        assert found[name].first == pytest.approx(first, abs=0.03)
        assert found[name].total == pytest.approx(total, abs=0.03)
        assert abs(found[name].first - first) < 2.0 * found[name].first_width
    assert list(found) == ["x1", "x2", "x3"], "the largest first"


def test_sobol_of_a_sum_of_normal_numbers() -> None:
    """Shares of a sum are those of the variances; a number without effect has none."""
    names = ["a", "b", "nothing"]
    samples = design("sobol", names, 512, 3)
    values = Normal(mean=5.0, std=3.0).quantile(samples[:, 0])
    values += Normal(mean=-2.0, std=4.0).quantile(samples[:, 1])
    found = {one.name: one for one in indices("sobol", names, samples, {"y": values}, 1)}
    assert found["a"].total == pytest.approx(9.0 / 25.0, abs=0.02)
    assert found["b"].total == pytest.approx(16.0 / 25.0, abs=0.02)
    assert found["nothing"].total == pytest.approx(0.0, abs=1e-9)


def test_morris_of_a_plane_and_a_product() -> None:
    """Effects of a plane are its slopes over the ranges; a product's vary by its other factor."""
    names = ["a", "b", "c", "d"]
    samples = design("morris", names, 12, 1)
    a, b = Uniform(from_=2.0, to=4.0).quantile(samples[:, 0]), samples[:, 1]
    values = {"plane": 3.0 * a - b, "product": samples[:, 2] * samples[:, 3]}
    found = {(one.output, one.name): one for one in indices("morris", names, samples, values, 1)}
    assert found["plane", "a"].first == pytest.approx(6.0)
    assert found["plane", "b"].first == pytest.approx(1.0)
    assert found["plane", "a"].total == pytest.approx(0.0, abs=1e-9)
    assert found["plane", "c"].first == pytest.approx(0.0, abs=1e-9)
    assert 0.2 < found["product", "c"].first < 0.8
    assert found["product", "c"].total > 0.1


def test_the_same_output_everywhere_depends_on_nothing() -> None:
    """No share of no variance."""
    samples = design("sobol", ["a", "b"], 8, 1)
    found = indices("sobol", ["a", "b"], samples, {"y": np.ones(len(samples))}, 1)
    assert [one.total for one in found] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("own", "expected"),
    [
        (Uniform(from_=-1.0, to=3.0), stats.uniform(-1.0, 4.0)),
        (Normal(mean=2.0, std=0.5), stats.truncnorm(-3.0, 3.0, 2.0, 0.5)),
        (Triangular(from_=1.0, mode=2.0, to=4.0), stats.triang(1.0 / 3.0, 1.0, 3.0)),
        (Triangular(from_=1.0, mode=1.0, to=4.0), stats.triang(0.0, 1.0, 3.0)),
        (Triangular(from_=1.0, mode=4.0, to=4.0), stats.triang(1.0, 1.0, 3.0)),
    ],
)
def test_quantiles(own: Uniform | Normal | Triangular, expected: stats.rv_continuous) -> None:
    """Those of scipy's distributions."""
    assert own.quantile(SHARES) == pytest.approx(expected.ppf(SHARES), abs=1e-9)


PLAN = """about: one depth, three uncertain numbers
scene: deep_lift
vessel: {responses: vessel_120m, crane_tip_m: [10.0, 18.0, 12.0]}
sea: {hs_m: {from: 0.5, to: 6.0, step: 0.5}, tp_s: [9.0, 12.0], headings_deg: [180.0]}
phases:
  - at_depth: {depth_m: 2900.0, exposure_s: 60.0}
criteria: {swl_n: 345000.0}
method: {seeds: {start: 4, most: 16}, settle_s: 10.0, elements: 8, step_s: 0.1}
uncertainties:
  - key: scene.payloads[0].mass_kg
    name: mass
    normal: {mean: 20000.0, std: 400.0}
    source: weighing
  - {key: criteria.swl_n, name: SWL, uniform: {from: 335000.0, to: 355000.0}, source: crane chart}
  - key: scene.ropes[0].rope.axial_stiffness_n
    name: EA
    factor: true
    triangular: {from: 0.9, mode: 1.0, to: 1.05}
    source: data sheet
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return the path of a small plan."""
    (tmp_path / "small.yaml").write_text(PLAN)
    return tmp_path / "small.yaml"


def test_numbers_reach_plan_and_scene(path: Path) -> None:
    """By key, as they are or as factors; the rest stays."""
    plan, scene = read_plan(path)
    made, changed = with_values(plan, scene, plan.uncertainties, [21e3, 350e3, 0.95])
    assert made.criteria.swl_n == 350e3
    assert changed.payloads[0].mass_kg == 21e3
    before, after = scene.ropes[0].rope, changed.ropes[0].rope
    assert before is not None
    assert after is not None
    assert after.axial_stiffness_n == pytest.approx(0.95 * before.axial_stiffness_n)
    assert (made.sea, made.vessel) == (plan.sea, plan.vessel)


def test_motions_and_current_are_numbers_of_a_plan(path: Path) -> None:
    """Factors on the RAOs, and the design current: its speed moves the object by its square."""
    text = (
        PLAN[: PLAN.index("uncertainties")]
        + """uncertainties:
  - {key: vessel.motion_factor, uniform: {from: 0.8, to: 1.2}, source: loading condition}
  - {key: vessel.heave_factor, uniform: {from: 0.8, to: 1.2}, source: loading condition}
  - {key: current.speed_m_per_s, uniform: {from: 0.1, to: 0.6}, source: hindcast}
  - {key: current.direction_deg, uniform: {from: -90.0, to: 90.0}, source: hindcast}
"""
    )
    current = "current: {speed_m_per_s: 0.2, direction_deg: 0.0, profile: [[0, 1], [-3000, 0.5]]}\n"
    path.write_text(text.replace("phases:", current + "phases:"))
    plan, scene = read_plan(path)
    numbers = plan.uncertainties
    f, heading = np.array([0.08, 0.11]), np.full(2, math.pi)
    at_rest = tip_of(plan, scene)
    made, changed = with_values(plan, scene, numbers, [1.1, 0.9, 0.4, 90.0])
    freedoms = at_rest.freedoms(f, heading)
    assert tip_of(made, changed).freedoms(f, heading) == pytest.approx(
        freedoms * 1.1 * np.array([1.0, 1.0, 0.9, 1.0, 1.0, 1.0])[:, None]
    )
    found = [one.listed(CurrentParams).table for one in (scene, changed)]
    assert found[0] == pytest.approx(np.array([[0.0, 0.2, 0.0, 0.0], [-3000.0, 0.1, 0.0, 0.0]]))
    assert found[1] == pytest.approx(np.array([[0.0, 0.0, 0.4, 0.0], [-3000.0, 0.0, 0.2, 0.0]]))
    assert len({scene.digest, changed.digest}) == 2
    along = with_values(plan, scene, numbers, [1.1, 0.9, 0.4, 0.0])
    near, far = (legs_of(*pair, plan.phases[0])[0].offset_m for pair in ((plan, scene), along))
    assert far == pytest.approx(4.0 * near, rel=0.02)
    case = case_of(plan, scene, (0, 0, 0))
    calm = outputs_at(case, [0.9, 0.9, 0.2, 0.0])
    rough = outputs_at(case, [1.1, 1.1, 0.2, 0.0])
    assert rough["hook_load"] > calm["hook_load"]
    assert rough["limiting_hs_m"] < calm["limiting_hs_m"]


def test_command_ranks_the_numbers_of_a_plan(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The heavier, the lower the limit; the SWL does not change loads; a second call runs none."""
    out = path.parent / "out"
    words = ["sensitivity", str(path), "--count", "2", "--out", str(out)]
    assert main([*words, "--cell", "at_depth,9,180", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["cell"] == "at_depth, Tp 9 s, heading 180°"
    assert found["samples"] == 2 * 4
    weights = {(one["output"], one["name"]): one["mean_effect"] for one in found["indices"]}
    assert weights["hook_load", "SWL"] == weights["uplift", "SWL"] == 0.0
    assert weights["limiting_hs_m", "mass"] > weights["limiting_hs_m", "EA"] > 0.0
    assert weights["limiting_hs_m", "SWL"] > 0.0
    static_n = 9.80665 * 6.0 * 400.0  # of the mass from end to end of its distribution
    assert weights["hook_load", "mass"] == pytest.approx(static_n, rel=0.3)
    assert (out / "sensitivity.png").stat().st_size > 5000
    rows = parquet.read_table(out / "runs.parquet").to_pylist()
    assert [row["run"] for row in rows] == list(range(8))
    assert {"mass", "SWL", "EA", "limiting_hs_m", "failure"} <= rows[0].keys()
    heavy, light = max(rows, key=lambda row: row["mass"]), min(rows, key=lambda row: row["mass"])
    assert heavy["hook_load"] > light["hook_load"]
    stamp = (out / "runs.parquet").stat().st_mtime_ns
    assert main([*words, "--cell", "at_depth,9,180"]) == 0
    shown = capsys.readouterr().out
    assert (out / "runs.parquet").stat().st_mtime_ns == stamp
    assert re.search(r"limiting Hs: [1-6]\.\d* m by the plan", shown)
    assert re.search(r"hook load: 3\d\d\.\d kN by the plan; of the samples P10 3\d\d", shown)
    assert "Morris takes the ends of a distribution as often as its middle" in shown
    load, *_ = [row for row in shown[shown.index("hook load:") :].splitlines() if "mass " in row]
    assert float(load.split()[1]) == pytest.approx(1e-3 * weights["hook_load", "mass"], rel=0.01)
    assert "weighing" in shown
    assert main([*words, "--cell", "at_depth,12,180"]) == 1
    assert "its rows are of another sensitivity study" in capsys.readouterr().err


def test_a_number_has_one_colour_in_all_panels() -> None:
    """In the order of the plan, whatever its weight for an output."""
    names = ["mass", "SWL"]
    weights = [Index(name, output, weight, 0.0, 0.1, math.nan) for output, name, weight in (
        ("limiting_hs_m", "SWL", 2.0), ("limiting_hs_m", "mass", 1.0),
        ("hook_load", "mass", 3.0), ("hook_load", "SWL", 0.0),
    )]  # fmt: skip
    case: Any = SimpleNamespace(names=names)
    spread = dict.fromkeys(("limiting_hs_m", "hook_load"), (1.0, 2.0, 3.0))
    found = panels(Sensitivity(case, "morris", 6, 0, tuple(weights), spread))
    assert [[line.label for line in panel.lines] for panel in found] == [names, names]


def test_the_lowest_cell_is_found_by_the_simplified_method(path: Path) -> None:
    """The tip moves more in waves of 12 s, so that their limit is lower."""
    assert lowest_cell(*read_plan(path)) == (0, 1, 0)


def test_plans_without_uncertain_numbers_are_refused(path: Path) -> None:
    """It says what to add."""
    path.write_text(PLAN[: PLAN.index("uncertainties")])
    with pytest.raises(InputError, match="0 uncertain numbers; list two or more under"):
        case_of(*read_plan(path), (0, 0, 0))


def test_a_factor_counts_once(path: Path) -> None:
    """A sample within the range of a key is not judged by factors on the sample itself."""
    share = "factor: true, uniform: {from: 0.9, to: 1.05}, source: a guess"
    text = PLAN.replace("345000.0}", "345000.0, uplift_share: 0.95}", 1)
    path.write_text(f"{text}  - {{key: criteria.uplift_share, {share}}}\n")
    plan, scene = read_plan(path)
    found = outputs_at(case_of(plan, scene, (0, 0, 0)), [20e3, 345e3, 1.0, 1.04])
    assert found["limiting_hs_m"] > 0.0


def test_samples_that_cannot_be_run_are_said(path: Path) -> None:
    """Numbers that do not go together end the study with the first reason."""
    text = PLAN.replace(
        "normal: {mean: 20000.0, std: 400.0}", "uniform: {from: 3000.0, to: 20000.0}"
    )
    path.write_text(text)
    case = case_of(*read_plan(path), (0, 0, 0))
    with pytest.raises(InputError, match=r"samples cannot be run, the first: .*floats with"):
        run_sensitivity(case, "morris", 2, path.parent / "out")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--count", "1"], "--count: 1; give 2 to 100,000"),
        (["--count", "12", "--method", "sobol"], "--count: 12; give a power of 2 for Sobol's"),
        (["--threads", "0"], "--threads: 0; give 1 to 256"),
        (["--cell", "deep,9,180"], "there is no phase 'deep'; known: at_depth"),
    ],
)
def test_wrong_options_are_refused(
    options: list[str], words: str, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence each."""
    assert main(["sensitivity", str(path), *options]) == 1
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
