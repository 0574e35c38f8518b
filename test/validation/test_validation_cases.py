"""The validation cases pass, in their short form by default; page and command."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from rope_twin.errors import InputError
from validation.__main__ import main
from validation.case import Case, Found, Row, between, choose, run_case, shown, within_pct
from validation.page import BEGIN, END, keep_results, read_results, write_page
from validation.registry import CASES

DOCS = Path(__file__).resolve().parents[2] / "docs"


def missed(found: Found) -> list[str]:
    return [f"{f.quantity} is {f.ours:g}, not {f.published}" for f in found.findings if not f.ok]


DAILY = [case for case in CASES if case.quick]
HEAVY = ("L4", "P4", "P13", "Q1")  # even in short


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.id, marks=[pytest.mark.long] if case.id in HEAVY else [])
        for case in DAILY
    ],
)
def test_validation_case_in_short_form(case: Case) -> None:
    """Every judged figure of the daily form is met, unless the page tells that it is not."""
    computed = (case.short or case.run)()
    assert any(finding.judged for finding in computed.findings)
    (reported,) = (result for result in read_results(DOCS) if result["id"] == case.id)
    known = {row["quantity"] for row in reported["rows"] if row["met"] is False}
    assert not [words for words in missed(computed) if words.split(" is ")[0] not in known]


WHOLE = [case for case in CASES if case.short is not None or not case.quick]


@pytest.mark.long
@pytest.mark.parametrize("case", WHOLE, ids=[case.id for case in WHOLE])
def test_validation_case_in_full_form(case: Case) -> None:
    """`pytest -n 0 -m long test/validation/test_validation_cases.py`: what the page tells is so.

    A case that the page tells as not met may not be met.
    """
    reported = {result["id"]: result for result in read_results(DOCS)}
    row = run_case(case)
    assert not row.refusal
    assert row.ok == reported[case.id]["met"], missed(row.found)


def test_the_page_has_every_case() -> None:
    """docs/validation.md is made from docs/validation, which has every case and its picture."""
    results = read_results(DOCS)
    assert [result["id"] for result in results] == [case.id for case in CASES]
    page = (DOCS / "validation.md").read_text()
    for result in results:
        assert f"### {result['id']}: {result['about']}" in page
        picture = DOCS / f"images/validation_{result['id'].lower()}.png"
        assert not result["picture"] or picture.exists()
        assert result["met"] or result["notes"], "what is not met says why"


def test_findings_compare_with_inclusive_limits() -> None:
    """Limits are inclusive; what is not a number is never met; what is shown always is."""
    assert within_pct("x", 1.01, 1.0, 1.0).ok
    assert not within_pct("x", 1.011, 1.0, 1.0).ok
    assert within_pct("x", -1.01, -1.0, 1.0).ok
    assert not within_pct("x", float("nan"), 1.0, 1.0).ok
    assert between("x", 2.0, (2.0, float("inf")), "2").tolerance == "at least 2"
    assert shown("x", float("nan"), "?").ok


def test_a_run_of_some_cases_keeps_the_others(tmp_path: Path) -> None:
    """Results are replaced by id; the page is theirs; text around the marks stays."""
    one, two = CASES[0], CASES[1]
    (tmp_path / "validation.md").write_text(f"head\n{BEGIN}\nold\n{END}\ntail\n")
    good, bad = Found((within_pct("x", 1.0, 1.0, 1.0),)), Found((within_pct("x", 2.0, 1.0, 1.0),))
    keep_results([Row(two, bad)], tmp_path)
    results = keep_results([Row(one, good)], tmp_path)
    assert [result["met"] for result in results] == [True, False]
    text = write_page(results, tmp_path).read_text()
    assert text.startswith("head\n")
    assert text.endswith("tail\n")
    assert "old" not in text
    assert f"Not passed: {two.id};" in text
    (tmp_path / "validation.md").write_text("no marks")
    with pytest.raises(InputError, match="it has no lines"):
        write_page(results, tmp_path)


def test_an_unknown_case_is_refused() -> None:
    with pytest.raises(InputError, match="there is no case 'P99'"):
        choose("validation", CASES, ["P99"])


def test_the_command_prints_computed_and_published_values(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """S2 as JSON: every row has both numbers, as in its case."""
    assert main(["S2", "--json"]) == 0
    reported = json.loads(capsys.readouterr().out)
    (result,) = reported["cases"]
    assert result["id"] == "S2"
    assert result["met"]
    assert len(reported["rows"]) == len(result["rows"])
    assert all(row["ours"] is not None and row["published"] for row in reported["rows"])
    assert {row["id"] for row in reported["rows"]} == {"S2"}
    assert all(row["pass"] is not False and row["source"] for row in reported["rows"])


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("P9 --into {folder}", "{folder}/validation.md: it has no lines"),
        ("p9", "python -m validation: there is no case 'p9'; did you mean 'P9'?"),
        ("--hard-cases emergency_stp", "--hard-cases: there is no case 'emergency_stp'; did you"),
    ],
)
def test_a_wrong_request_is_rejected_before_anything_runs(
    words: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([word.format(folder=tmp_path) for word in words.split()]) == 1
    printed = capsys.readouterr()
    assert reason.format(folder=tmp_path) in printed.err
    assert printed.err.count("\n") == 1
    assert not printed.out
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("option", ["--convergence", "--into=docs"])
def test_hard_cases_write_no_page(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--hard-cases", option])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("python -m validation: --hard-cases: ")


def test_it_runs_in_a_clone_with_the_numbers_of_the_page() -> None:
    """`python -m validation P9 --json` in a process of its own."""
    words = [sys.executable, "-m", "validation", "P9", "--json"]
    done = subprocess.run(words, cwd=DOCS.parent, capture_output=True, text=True, check=True)
    (result,) = json.loads(done.stdout)["cases"]
    (page,) = (one for one in read_results(DOCS) if one["id"] == "P9")
    kept = [(row["quantity"], row["tolerance"], row["met"]) for row in page["rows"]]
    assert [(row["quantity"], row["tolerance"], row["met"]) for row in result["rows"]] == kept
    ours = [row["ours"] for row in page["rows"]]
    assert [row["ours"] for row in result["rows"]] == pytest.approx(ours, rel=1e-4)
