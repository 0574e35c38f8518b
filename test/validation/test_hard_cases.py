"""The hard cases: the quick ones here, all of them with `pytest -m long test/validation`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rope_twin.errors import SolverError
from validation import registry
from validation.__main__ import main
from validation.case import Case, Finding, limited, run_case
from validation.hard_cases.limits import hard_case
from validation.registry import HARD_CASES

DOCUMENT = Path(__file__).parents[2] / "docs" / "stability.md"


def failures(case: Case) -> list[str]:
    """Return the conditions that fail, in words."""
    row = run_case(case)
    assert row.refusal == ""
    missed = [one for one in row.found.findings if not one.ok]
    return [f"{one.quantity}: {one.ours:.4g}, limit {one.high:g}" for one in missed]


QUICK = [case for case in HARD_CASES if case.quick]
LONG = [case for case in HARD_CASES if not case.quick]


@pytest.mark.parametrize("case", QUICK, ids=lambda case: case.id)
def test_a_quick_robustness_case_passes(case: Case) -> None:
    """Every figure is within its limit."""
    assert failures(case) == []


@pytest.mark.long
@pytest.mark.parametrize("case", LONG, ids=lambda case: case.id)
def test_a_long_robustness_case_passes(case: Case) -> None:
    """Run the cases that take longer: `pytest -m long test/validation`."""
    assert failures(case) == []


def test_the_document_has_every_case() -> None:
    """docs/stability.md: a row for each, with what it is held against."""
    rows = [line for line in DOCUMENT.read_text().splitlines() if line.startswith("| `")]
    assert [row.split("|")[1].strip(" `") for row in rows] == [case.id for case in HARD_CASES]
    for row, case in zip(rows, HARD_CASES, strict=True):
        assert f"| {case.about} | {case.source} |" in row


def test_json_output_of_robustness_cases(capsys: pytest.CaptureFixture[str]) -> None:
    """Rows of id, ok, figure, limit, what; exit code 0 when all hold."""
    assert main(["--hard-cases", "--json", "neutral_slack", "explicit_added_mass"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["id"] for row in rows] == ["neutral_slack", "explicit_added_mass"]
    for row in rows:
        assert row["ok"] is True
        assert row["figure"] <= row["limit"]
        assert row["what"] in [check["what"] for check in row["checks"]]


def broken() -> list[Finding]:
    """A solver that gives up."""
    raise SolverError("step 3: not finite; shorten the step.")


NOT_HELD = [
    hard_case("beyond", "a", "b", lambda: [limited("is 2", 2, 1), limited("is 0", 0, 1)], 1.0),
    hard_case("not_a_number", "a", "b", lambda: [limited("is NaN", float("nan"), 1.0)], 1.0),
    hard_case("broken", "a", "b", broken, 1.0),
]


@pytest.mark.parametrize("case", NOT_HELD, ids=lambda case: case.id)
@pytest.mark.parametrize("form", [[], ["--json"], ["--markdown"]])
def test_a_failing_robustness_case_is_an_error(
    case: Case,
    form: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Exit code 1 and the reason, in every form; JSON stays JSON."""
    monkeypatch.setattr(registry, "HARD_CASES", (case,))
    assert main(["--hard-cases", *form]) == 1
    message = capsys.readouterr().out
    what = "not finite" if case.id == "broken" else case.run().findings[0].quantity
    assert what in message
    if form == ["--json"]:
        (row,) = json.loads(message)
        assert row["ok"] is False
        assert row["figure"] in (2.0, None)


def test_an_unknown_case_id_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    """In one sentence with the nearest one."""
    assert main(["--hard-cases", "emergency_stp"]) == 1
    assert "did you mean 'emergency_stop'?" in capsys.readouterr().err
