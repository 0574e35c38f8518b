"""Discretisation errors of a plan: bought by a target, and measured against a much finer run."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from rope_twin.cli import main
from rope_twin.cli.selection import read_share
from rope_twin.errors import InputError, RopeTwinError
from rope_twin.planning.cells import Cell, CellLimit, RowStore
from rope_twin.planning.plan_reader import read_plan, with_error
from rope_twin.planning.run import find_within, prepare
from rope_twin.planning.runs import run_seeds, sea_seed
from rope_twin.scene.error_bound import Setting

PLAN = """about: one depth near resonance
scene: deep_lift
vessel: {responses: vessel_120m, crane_tip_m: [10.0, 18.0, 12.0]}
sea: {hs_m: {from: 1.0, to: 4.0, step: 0.5}, tp_s: [9.0], headings_deg: [135.0]}
phases:
  - at_depth: {depth_m: 2900.0, exposure_s: 60.0}
criteria: {swl_n: 345000.0}
method: {seeds: {start: 4, most: 4}, settle_s: 20.0}
"""
COARSE = Setting(4, 0.2)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return the path of a small plan."""
    (tmp_path / "small.yaml").write_text(PLAN)
    return tmp_path / "small.yaml"


@pytest.mark.parametrize("tenths", [7, 11, 14, 19, 28, 55])
def test_an_error_in_per_cent_is_the_number_of_the_file(path: Path, tenths: int) -> None:
    """1.1 times 0.01 is not 0.011: a folder was refused, being that of another plan."""
    share = float(f"{tenths}e-3")
    path.write_text(PLAN.replace("method: {", f"method: {{error_within: {share}, "))
    plan, _ = read_plan(path)
    assert with_error(plan, read_share("--within", f"{tenths / 10:g} %", "the error")) is plan


@pytest.mark.parametrize("text", ["0%", "-1%", "nan%", "sNaN%", "inf%", "1e999999%", "1", "x%"])
def test_an_error_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="write a number above 0 and its unit, like 1%"):
        read_share("--within", text, "the error")


def coarse_limit(path: Path, within: float) -> tuple[CellLimit, CellLimit, RowStore]:
    """Return the limit of a cell at a coarse setting, that within an error, and its rows."""
    plan, scene = read_plan(path)
    given = replace(plan.method, elements=COARSE.elements, step_s=COARSE.step_s)
    works = prepare(replace(plan, method=given), scene)
    own = with_error(plan, within)
    store = RowStore()
    fixed = Cell(replace(own, method=given), works[0], (0, 0, 0), store)
    coarse = find_within(fixed)[1]
    search, limit = find_within(Cell(own, works[0], (0, 0, 0), store))
    assert search.work.settings == limit.settings
    return coarse, limit, store


def test_errors_are_bought(path: Path) -> None:
    """Where the error is above the target the cell is searched again with a finer setting."""
    within = 5e-4
    coarse, limit, store = coarse_limit(path, within)
    assert (coarse.settings, coarse.refinements) == ((COARSE,), 0)
    assert coarse.error > within >= limit.error
    assert limit.refinements >= 1
    assert limit.setting.elements > COARSE.elements
    assert limit.setting.step_s < COARSE.step_s
    assert limit.runs > coarse.runs
    rows = [row for row in store.rows.values() if row["purpose"] == "statistics"]
    assert len(rows) == limit.runs, "rows of both settings have numbers of their own"
    assert {row["elements"] for row in store.rows.values()} >= {4, limit.setting.elements}


def test_the_error_is_that_against_a_much_finer_run(path: Path) -> None:
    """Four times the elements and a quarter of the step: within the target, by a run alone."""
    within = 5e-4
    _, limit, store = coarse_limit(path, within)
    judged = limit.judged
    assert judged is not None
    plan, scene = read_plan(path)
    work = prepare(plan, scene)[0]
    fine = Setting(4 * limit.setting.elements, 0.25 * limit.setting.step_s)
    search = Cell(plan, work, (0, 0, 0), store)
    leg = work.legs[0].at_setting(fine)
    seed = sea_seed(plan.method.seed, 0, 0, judged.governing_seed)
    reference = run_seeds(leg, work.ship, search.sea(judged.height_m), [seed])[0]
    own = next(
        row for row in store.rows.values()
        if row["elements"] == limit.setting.elements and row["hs_m"] == judged.height_m
        and row["seed"] == judged.governing_seed
    )  # fmt: skip
    apart = abs(own["top_max_n"] / reference["top_max_n"] - 1.0)
    assert apart <= within
    assert apart <= 1.5 * limit.error + 1e-4


def test_the_command_buys_and_says_so(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--within is in the digest, so that rows of another target do not mix; a run can be shown."""
    out = path.parent / "out"
    words = ["plan", str(path), "--out", str(out)]
    assert main([*words, "--within", "0.1%", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    cell = found["cells"][0]
    assert cell["discretisation_error"] <= 1e-3
    assert found["plan_digest"] != read_plan(path)[0].digest
    assert main([*words, "--within", "0.1%", "--cell", "at_depth,9,135", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["seed"] == cell["at_limit"]["governing_seed"]
    assert main(words) == 1
    assert "its rows are of another plan" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("share", "said"),
    [
        ("200%", "--within, method.error_within: 2 is out of range; give 0.0001 to 0.5"),
        ("0%", "--within 0%: the error is in %; write a number above 0 and its unit, like 1%"),
        ("nan%", "--within nan%: the error is in %"),
        ("little", "--within little: the error is in %"),
    ],
)
def test_wrong_targets_are_refused(
    share: str, said: str, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence each."""
    assert main(["plan", str(path), "--within", share]) == 1
    assert said in capsys.readouterr().err


def test_plans_with_a_setting_of_their_own_are_refused(path: Path) -> None:
    """A plan that decides on elements and step leaves nothing to be bought."""
    path.write_text(PLAN.replace("settle_s: 20.0", "elements: 10, step_s: 0.1"))
    with pytest.raises(RopeTwinError, match="--within: 'small' gives elements and step_s; leave"):
        with_error(read_plan(path)[0], 0.01)
