"""Seas in which runs do not reach their end: they count as too high, with the reason."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rope_twin.planning.plan_reader import read_plan
from rope_twin.planning.results import load_chart, notes, result_object, table_rows
from rope_twin.planning.run import SETTINGS, PlanResult, plan, prepare

LOW_START = """about: a landing that begins half a metre above the seabed
scene: landing
vessel: {responses: vessel_120m, crane_tip_m: [10.0, 18.0, 12.0]}
sea: {hs_m: {from: 0.5, to: 3.5, step: 1.0}, tp_s: [11.0], headings_deg: [180.0]}
phases:
  - landing: {above_m: 0.5, speed_m_per_s: 0.2}
criteria: {swl_n: 300000.0, landing_speed_m_per_s: 2.0}
method: {settle_s: 30.0, seeds: {start: 4, most: 4}, elements: 12, step_s: 0.1, within: 0.5}
"""
EARLY = "it touched the seabed before it was lowered; raise above_m"


@pytest.fixture(scope="module")
def low_start(tmp_path_factory: pytest.TempPathFactory) -> PlanResult:
    path = tmp_path_factory.mktemp("plan") / "low_start.yaml"
    path.write_text(LOW_START)
    return plan(path)


def test_a_landing_before_the_lowering_is_none(low_start: PlanResult) -> None:
    """Its loads afloat are not known, and neither is its landing speed on the winch."""
    (cell,) = low_start.cells
    assert cell.height_m is not None
    assert not cell.capped
    assert cell.governing == EARLY
    assert cell.beyond is not None
    assert cell.beyond.failures > 0
    # the limits of the criteria are far, and not crossed where the runs fail
    assert cell.crossing_m == cell.low_m == cell.high_m == cell.height_m
    assert table_rows(low_start)[1][5] == EARLY
    assert load_chart(low_start)["phases"]["landing"]["governing"] == [[EARLY]]
    assert any(note.endswith(EARLY) for note in notes(low_start))
    found = json.loads(json.dumps(result_object(low_start)))["cells"][0]
    assert found["beyond"]["failure"] == EARLY
    assert found["at_limit"]["values"]["uplift"]["value"] < 1.0


def test_a_run_that_fails_by_its_sea_does_not_choose_the_mesh(tmp_path: Path) -> None:
    """The other seeds tell the error."""
    path = tmp_path / "low_start.yaml"
    own = LOW_START.replace(", elements: 12, step_s: 0.1", "").replace("to: 3.5", "to: 4.5")
    path.write_text(own)
    (work,) = prepare(*read_plan(path))
    assert work.settings[0] != SETTINGS[-1]
    assert work.legs[0].setting_error <= 0.02
