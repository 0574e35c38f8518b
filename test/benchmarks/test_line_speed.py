"""The benchmark of multi-line systems: a rope in parts has its elements and moves like the rope."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.__main__ import main
from benchmarks.line_speed import SYSTEMS, system_of


@pytest.mark.parametrize("kind", SYSTEMS)
def test_every_system_has_the_elements_of_the_rope(kind: str, tmp_path: Path) -> None:
    scene = system_of(kind, 40, tmp_path)
    assert sum(line.elements for line in scene.ropes) == 40
    lengths = {line.length_m / line.elements for line in scene.ropes}
    assert lengths == {50.0}


def test_costs_are_ratios_with_what_the_top_tension_differs_by(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["lines", "--quick", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["system"] for row in rows] == list(SYSTEMS)
    assert rows[0]["ratio"] == {"median": 1.0, "low": 1.0, "high": 1.0}
    assert all(row["ns_per_element_step"] > 0.0 for row in rows)
    whole, parts, loop = (row["difference_pct"] for row in rows)
    assert whole is None
    assert loop is None
    assert 0.0 < parts < 1e-2
