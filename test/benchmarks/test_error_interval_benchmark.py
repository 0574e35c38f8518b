"""`python -m benchmarks error_interval`: its variants, its judgement and docs/error_interval.md."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from benchmarks import error_interval as benchmark
from benchmarks.__main__ import main
from benchmarks.error_interval import IntervalResult, IntervalRow, Series, Variant
from rope_twin.errors import InputError
from rope_twin.scene.load import load_scene
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.schema import Scene

DOCS = Path(__file__).resolve().parents[2] / "docs"
ROW = IntervalRow("storm", 50, 0.01, 2.5e4, 0.53, 4.24, 97.0, 100.0, "", 48.6)
UNKNOWN = replace(
    ROW, error_n=np.nan, bound_n=np.nan, covered_pct=np.nan, known_pct=0.0, unknown="unknown: cut"
)


def drawn(scene: str, **factors: float) -> Scene:
    """A variant with factors of 1 but these."""
    ones = dict.fromkeys(("depth", "payload", "sea", "current", "elements", "step"), 1.0)
    return Variant(scene, start_s=7.0, **(ones | factors)).scene()


def test_a_seed_draws_the_same_variants_each_time_and_another_one_others() -> None:
    first, again, other = (list(islice(benchmark.draw_variants(seed), 30)) for seed in (3, 3, 4))
    assert first == again != other
    assert "still_water" not in {one.name for one in first}
    only = islice(benchmark.draw_variants(3, ["storm"]), 5)
    assert {one.name for one in only} == {"storm"}


def test_a_variant_has_its_factors_on_the_values_of_the_scene() -> None:
    scene = drawn("deep_lift", depth=0.8, payload=1.2, current=0.5, elements=1.5, step=2.0)
    own = load_scene("deep_lift")
    (line,), (was,) = scene.ropes, own.ropes
    assert (line.length_m, line.elements) == (0.8 * was.length_m, 150)
    assert scene.payloads[0].mass_kg == 1.2 * own.payloads[0].mass_kg
    assert scene.time.step_s == 2.0 * own.time.step_s
    assert scene.sea_state.start_s == own.sea_state.start_s + 7.0
    assert scene.winch is not None
    assert own.winch is not None
    assert scene.winch.max_line_out_m == 0.8 * own.winch.max_line_out_m


@pytest.mark.parametrize("name", ["landing", "riser_300m", "two_line_lift"])
def test_depth_stays_with_a_seabed_or_a_fixed_end_and_in_multi_line_scenes(name: str) -> None:
    lengths = [line.length_m for line in drawn(name, depth=0.8).ropes]
    own = load_scene(name)
    bound = is_joined(own) or name == "landing" or own.ropes[0].fixed_at_m is not None
    assert bound == (lengths == [line.length_m for line in own.ropes])


def test_coverage_is_the_share_of_the_known_time_with_the_reference_inside() -> None:
    time = np.arange(0.0, 12.0)
    bound = np.where(time < 4.0, np.nan, 1.0)
    reference = np.where(time == 11.0, 2.0, 0.5)
    scene = load_scene("shallow_lift")
    series = Series(time, np.zeros(12), reference, bound, "", 10.0)
    row = benchmark.row_of("shallow_lift", scene, series)
    assert row.covered_pct == pytest.approx(100.0 * 7.0 / 8.0)
    assert row.known_pct == pytest.approx(100.0 * 8.0 / 10.0)
    assert (row.known, row.covered) == (True, False)


def test_the_result_counts_variants_that_had_an_interval() -> None:
    result = IntervalResult(3, 45.0, (ROW, replace(ROW, covered_pct=80.0), UNKNOWN))
    assert (len(result.known), result.covered, result.ok) == (2, 1, False)
    assert result.ratio == pytest.approx(8.0)
    assert "known in 2 of 3 variants" in result.as_sentence()
    found = benchmark.as_json(result)
    assert json.loads(json.dumps(found, allow_nan=False))["rows"][2]["covered_pct"] is None
    assert IntervalResult(3, 45.0, (UNKNOWN,)).ok


def test_the_command_writes_the_page_and_fails_if_too_few_are_covered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [ROW]
    monkeypatch.setattr(benchmark, "measure_variants", lambda *_: iter(rows))
    words = ["error_interval", "--variants", "1", "--seed", "3", "--into", str(tmp_path)]
    assert main(words) == 1
    assert "it has no lines" in capsys.readouterr().err
    page = tmp_path / "error_interval.md"
    page.write_text(f"before\n{benchmark.PAGE.begin}\nold\n{benchmark.PAGE.end}\nafter\n")
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["covered"] == 1
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "--variants 1 --seed 3`: The interval is known in 1 of 1 variants" in text
    assert "| storm | 50 | 10 | 25 | 0.53 | 4.2 | 8.0 | 97.0 | 49 |  |" in text
    rows[0] = replace(ROW, covered_pct=80.0)
    assert main(words) == 1


def test_there_is_no_page_without_marks(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="it has no lines"):
        benchmark.PAGE.around(tmp_path)
    benchmark.PAGE.around(DOCS)
