"""Limits of a plan on the console: what they allow in the sea that a page enters."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from console_rig import ConsoleRig, replies

from rope_twin.cli import main
from rope_twin.console.requests import SeaLimits
from rope_twin.scene.load_chart import read_load_chart

PHASE = {"kind": "lowering", "governing": [["swl_n"] * 2] * 2, "hook_load_n": [[3e5] * 2] * 2}
CHART = {
    "format": 1, "plan": "deep", "scene": "deep_lift", "scene_digest": "", "percentile": 90.0,
    "tp_s": [7.0, 9.0], "heading_deg": [135.0, 180.0], "symmetric": True,
    "phases": {
        "lowering": {**PHASE, "depth_m": [100.0, 2000.0],
                     "limiting_hs_m": [[2.0, 2.5], [1.5, 2.0]]},
        "landing": {**PHASE, "depth_m": [2000.0, 2010.0],
                    "limiting_hs_m": [[1.0, 1.0], [0.5, 0.0]]},
    },
}  # fmt: skip


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return the path of a chart."""
    (tmp_path / "load_chart.json").write_text(json.dumps(CHART))
    return tmp_path / "load_chart.json"


def shown(path: Path) -> tuple[ConsoleRig, SeaLimits]:
    """Return a rig that shows the chart."""
    rig = ConsoleRig()
    limits = SeaLimits(rig.pages, read_load_chart(path), lambda: 60.0)
    limits.connect(rig.desk)
    return rig, limits


def entered(rig: ConsoleRig, **numbers: Any) -> dict[str, Any]:
    """Enter a sea, and return the answer."""
    page = rig.page(signed_in=True)
    replies(page)
    rig.desk.take(page, {"do": "sea", "id": 3, **numbers})
    (answer,) = [one for one in replies(page) if one.get("id") == 3]
    return answer


def test_the_sea_that_is_entered_is_judged_for_every_phase(path: Path) -> None:
    """Between the periods of the chart the lower limit counts; beyond them nothing is allowed."""
    rig, limits = shown(path)
    assert [row["may"] for row in limits.state()["rows"]] == [None, None]
    assert entered(rig, hs_m=1.5, tp_s=8.0, heading_deg=180.0)["ok"]
    lowering, landing = limits.state()["rows"]
    assert (lowering["allowed_hs_m"], lowering["may"]) == (2.0, True)
    assert (landing["allowed_hs_m"], landing["may"]) == (0.0, False)
    assert limits.state()["sea"]["age_s"] == 0.0
    entered(rig, hs_m=0.2, tp_s=12.0, heading_deg=180.0)
    assert [row["may"] for row in limits.state()["rows"]] == [False, False]


def test_the_phase_at_the_depth_of_the_payload_is_marked(path: Path) -> None:
    """By the newest row of the trend."""
    _, limits = shown(path)
    for depth, here in ((50.0, [False, False]), (1500.0, [True, False]), (2000.0, [True, True]),
                        (2008.0, [False, True]), (None, [False, False])):  # fmt: skip
        limits.see([{"depth_m": depth}])
        assert [row["here"] for row in limits.state()["rows"]] == here


def test_a_chart_of_another_scene_says_so(path: Path) -> None:
    """Once the scene is known."""
    rig, limits = shown(path)
    rig.pages.facts = {"scene": "deep_lift"}
    assert not limits.state()["other_scene"]
    rig.pages.facts = {"scene": "shallow_lift"}
    assert limits.state()["other_scene"]


@pytest.mark.parametrize(
    "numbers",
    [{}, {"hs_m": 1.0}, {"hs_m": -1.0, "tp_s": 8.0, "heading_deg": 0.0},
     {"hs_m": 10**400, "tp_s": 8.0, "heading_deg": 0.0},
     {"hs_m": math.nan, "tp_s": 8.0, "heading_deg": 0.0},
     {"hs_m": True, "tp_s": 8.0, "heading_deg": 0.0},
     {"hs_m": 1.0, "tp_s": "8", "heading_deg": 0.0},
     {"hs_m": 1.0, "tp_s": 8.0, "heading_deg": 1e4}],
)  # fmt: skip
def test_what_is_no_sea_is_refused_in_one_sentence(path: Path, numbers: dict[str, Any]) -> None:
    """And the one before it stays."""
    rig, limits = shown(path)
    answer = entered(rig, **numbers)
    assert not answer["ok"]
    assert answer["words"].startswith("sea: ")
    assert limits.sea is None


def test_the_terminal_has_no_chart(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One sentence."""
    assert main(["console", "--terminal", "--load-chart", str(path)]) == 1
    assert "leave --load-chart out" in capsys.readouterr().err
