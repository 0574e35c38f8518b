"""Parameter studies of multi-line scenes: against one rope, against statics, and by rope."""

from __future__ import annotations

import copy
import json
import math
from pathlib import Path
from typing import Any

import pyarrow.parquet as parquet
import pytest
import yaml

from rope_twin.cli import main
from rope_twin.core.jit.wide import LANES
from rope_twin.files import share_dir
from rope_twin.scene.load import Change, load_scene
from rope_twin.studies.ensemble import MemberHeave
from rope_twin.studies.study_design import (
    FatigueRequest,
    StudyRun,
    new_counts,
    run_system,
    run_together,
)
from rope_twin.twin.ensemble.ensemble import Variation

Row = dict[str, Any]
STUDY = """\
about: a small one
scene: {scene}.yaml
seconds: 2.0
vary:
  - {{path: "payloads[0].mass_kg", values: [16000.0, 20000.0]}}
  - {{path: sea_offset_s, values: [0.0, 30.0]}}
fatigue: {{curve: stranded_wire, piece_m: 25.0, sample_s: 0.1}}
"""


def shipped(name: str) -> dict[str, Any]:
    """A scene's file as plain values."""
    text = (share_dir() / "config" / "scenes" / f"{name}.yaml").read_text(encoding="utf-8")
    found: dict[str, Any] = yaml.safe_load(text)
    return found


def write_scene(path: Path, scene: dict[str, Any]) -> None:
    """Write a scene's file; values that are one object are written out each time."""
    path.write_text(yaml.safe_dump(json.loads(json.dumps(scene))), encoding="utf-8")


def rows_of(folder: Path, name: str, scene: dict[str, Any], study: str = STUDY) -> list[Row]:
    """The rows of a study of a scene."""
    write_scene(folder / f"{name}.yaml", scene)
    path = folder / f"study_of_{name}.yaml"
    path.write_text(study.format(scene=name), encoding="utf-8")
    assert main(["study", str(path), "--out", str(folder / f"{name}_rows")]) == 0
    found: list[Row] = parquet.read_table(folder / f"{name}_rows" / "runs.parquet").to_pylist()
    return found


def whole_and_parted() -> tuple[dict[str, Any], dict[str, Any]]:
    """A lift, and the same with a ring of no mass in the middle of its rope."""
    whole = shipped("shallow_lift")
    whole["time"]["newton_tolerance_n"] = 5.0
    (line,) = whole["ropes"]
    line["damping"] = {"newton_seconds": 1e6}
    parted = copy.deepcopy(whole)
    half = {**line, "length_m": 100.0, "elements": 20}
    parted["ropes"] = [
        {**half, "name": "upper", "to": "ring"},
        {**half, "name": "lower", "from": "ring"},
    ]
    parted["joints"] = [{"name": "ring"}]
    return whole, parted


def test_a_rope_in_two_parts_has_the_rows_of_the_rope(tmp_path: Path) -> None:
    """In a sea, with the winch paying out, at other loads and from elsewhere in the sea."""
    whole, parted = whole_and_parted()
    expected, found = rows_of(tmp_path, "whole", whole), rows_of(tmp_path, "parted", parted)
    assert len(expected) == len(found) == 4
    assert len({row["tension_top_max_n"] for row in found}) == 4
    for ours, one in zip(found, expected, strict=True):
        assert ours["failure"] == ""
        for name in ("steps", "seconds", "elements", "slack_share", "unconverged_substeps"):
            assert ours[name] == one[name]
        for end in ("max", "mean", "min"):
            top = one[f"tension_top_{end}_n"]
            assert ours[f"tension_top_{end}_n"] == pytest.approx(top, rel=1e-5)
            assert ours[f"upper.tension_{end}_n"] == ours[f"tension_top_{end}_n"]
        share = one["max_utilisation"]
        assert ours["max_utilisation"] == pytest.approx(share, rel=1e-5)
        damage = ours["lower.damage"] + ours["upper.damage"]
        assert damage[:7] == pytest.approx(one["damage"][:7], rel=1e-3)
        assert ours["damage_worst"] == max(damage)


def test_legs_of_a_bridle_share_the_load(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In still water each leg carries what hangs below it over twice the cosine of its slope."""
    scene = shipped("bridle_lift")
    del scene["sea_state"], scene["winch"]["schedule"], scene["winch"]["schedule_repeats_every_s"]
    still = {"current": {"profile": [[0.0, [0.0, 0.0]]]}}  # listed, so that nothing is compiled
    scene["effects"] = [still if "current" in one else one for one in scene["effects"]]
    study = """\
about: both halves
scene: {scene}.yaml
seconds: 1.0
vary:
  - name: halves
    cases:
      - {{name: light, set: {{"payloads[0].mass_kg": 6000.0, "payloads[1].mass_kg": 6000.0}}}}
      - {{name: heavy, set: {{"payloads[0].mass_kg": 9000.0, "payloads[1].mass_kg": 9000.0}}}}
"""
    light, heavy = rows_of(tmp_path, "bridle", scene, study)
    shown = capsys.readouterr().out
    assert "maximum tension of sling_starboard [kN]" in shown
    for row in (light, heavy):
        legs, slings = (
            [row[f"{kind}_{side}.tension_mean_n"] for side in ("port", "starboard")]
            for kind in ("leg", "sling")
        )
        assert legs[0] == pytest.approx(legs[1], rel=1e-4)
        assert slings[0] == pytest.approx(slings[1], rel=1e-4)
        highest = max(row[name] for name in row if name.endswith("tension_max_n"))
        line = load_scene("bridle_lift").ropes[0]
        share = highest / line.breaking_load_n
        assert row["max_utilisation"] == pytest.approx(share, rel=1e-12)
    for kind, slope in (("leg", math.cos(math.radians(30.0))), ("sling", 1.0)):
        more = heavy[f"{kind}_port.tension_mean_n"] - light[f"{kind}_port.tension_mean_n"]
        assert more == pytest.approx(3000.0 * 9.80665 / slope, rel=2e-3)
    more = heavy["hoist.tension_mean_n"] - light["hoist.tension_mean_n"]
    assert more == pytest.approx(6000.0 * 9.80665, rel=2e-3)


@pytest.mark.parametrize(
    "counted", [None, FatigueRequest(curve="six_strand_tension", piece_m=50.0)]
)
def test_runs_together_have_the_rows_of_lone_runs(counted: FatigueRequest | None) -> None:
    """To the bit: in lanes, each with its own drag and from elsewhere in the sea."""
    scene = load_scene("bridle_lift")
    runs = [
        StudyRun(k, (), scene, (Change("effects.drag.normal", 1.0 + 0.1 * k),), 3.0 * k)
        for k in range(LANES)
    ]
    seas = MemberHeave(scene, 5.0)
    own = [Variation(one.changes, seas.heave(one.changes, one.sea_offset_s)) for one in runs]
    together = run_together(scene, own, 3.0, 0.5, counted)
    assert together == [run_system(one, 3.0, 0.5, counted) for one in runs]
    assert len({row["tension_top_max_n"] for row in together}) == LANES
    assert all(row["steps"] == 300 for row in together)


def test_ropes_over_a_sheave_are_one_material_in_a_row() -> None:
    """The loop: 1,500 m of the two ropes on its lower sheave are counted with the first of them."""
    scene = load_scene("two_line_loop")
    request = FatigueRequest(curve="six_strand_tension", piece_m=20.0)
    counts = new_counts(scene, request)
    assert [len(count.middles) for count in counts.values()] == [65, 75, 65]
    row = run_system(StudyRun(0, (), scene, (), 0.0), 0.5, 0.1, request)
    assert len(row["below_descending.damage"]) == 75
    assert "below_ascending.damage" not in row
    lists = [row[f"{scene.ropes[number].name}.damage"] for number in counts]
    assert row["damage_worst"] == max(map(max, lists)) > 0.0


def test_a_run_without_a_start_is_a_row(tmp_path: Path) -> None:
    """A load that floats: the run has its reason and no figures, the other one is whole."""
    _, scene = whole_and_parted()
    study = """\
about: a load that floats
scene: {scene}.yaml
seconds: 0.5
vary:
  - {{path: "payloads[0].displaced_volume_m3", values: [4.0, 60.0]}}
"""
    write_scene(tmp_path / "parted.yaml", scene)
    path = tmp_path / "study.yaml"
    path.write_text(study.format(scene="parted"), encoding="utf-8")
    assert main(["study", str(path), "--out", str(tmp_path / "rows")]) == 3
    sunk, afloat = parquet.read_table(tmp_path / "rows" / "runs.parquet").to_pylist()
    assert sunk["failure"] == ""
    assert sunk["lower.tension_min_n"] > 0.0
    assert afloat["failure"]
    assert afloat["lower.tension_min_n"] is None
    assert afloat["tension_top_max_n"] is None
