"""`python -m benchmarks compile`: which scenes share compiled code, and what a first start is."""

from __future__ import annotations

import json

import pytest

from benchmarks.__main__ import main
from benchmarks.compile_time import (
    COLD_LIMIT_S,
    WARM_LIMIT_S,
    CompileRow,
    compile_table,
    distinct_sets,
)


def test_scenes_whose_code_is_the_same_are_one_set() -> None:
    """Elements, figures and number of ropes do not count; effects, tables and joints do."""
    scenes = ("deep_lift", "storm", "still_water", "hybrid_lift", "bridle_lift", "two_line_lift")
    assert distinct_sets(scenes) == [
        ["deep_lift", "storm"], ["still_water"], ["hybrid_lift"], ["bridle_lift", "two_line_lift"],
    ]  # fmt: skip


def test_a_start_over_its_limit_is_reported() -> None:
    rows = [CompileRow("one", (), ("drag",), 1, 25.0, 26.0, 0.5, 0.6)]
    rows.append(CompileRow("two", (), ("drag",), 1, 15.0, 16.0, 0.5, 0.6))
    assert [row.ok for row in rows] == [False, True]
    assert [line[-1] for line in compile_table(rows)[1:]] == ["over 20 or 1 s", ""]


@pytest.mark.long
def test_a_first_start_is_measured_with_a_cache_of_its_own(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Some twelve seconds: it compiles. `pytest -m long test/benchmarks/test_compile_time.py`."""
    code = main(["compile", "--quick", "--json"])
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (row["scene"], row["ropes"]) == ("still_water", 1)
    assert row["effects"] == ["weight", "drag", "added_mass", "payload"]
    assert row["cold_s"] > 0.0
    assert row["warm_s"] > 0.0
    assert row["ok"] == (row["cold_s"] <= COLD_LIMIT_S and row["warm_s"] <= WARM_LIMIT_S)
    assert code == (0 if row["ok"] else 1)


def test_a_scene_that_there_is_not_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compile", "still_watr"]) == 1
    assert "still_water" in capsys.readouterr().err
