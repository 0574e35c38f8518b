"""The row on an ensemble's speed: consistent numbers, and a check of equality that can fail."""

from __future__ import annotations

import json
from typing import Any

import pytest

import benchmarks.ensemble_speed as study
from benchmarks.__main__ import main
from benchmarks.ensemble_speed import QUICK, Case, ensemble_rows, ensemble_table


def test_a_row_is_consistent() -> None:
    """Real-time factor and nanoseconds are two ways of saying one time."""
    reported: list[tuple[int, int]] = []
    (row,) = ensemble_rows(QUICK, lambda done, total, what: reported.append((done, total)))
    case = QUICK[0]
    assert (row.members, row.elements, row.step_s) == (case.members, case.elements, case.step_s)
    node_steps_per_s = row.members * row.elements / row.step_s
    assert row.ns_per_node_step * 1e-9 * node_steps_per_s / row.threads == pytest.approx(
        1.0 / row.real_time_factor
    )
    assert row.ns_per_node_step_best <= row.ns_per_node_step
    assert row.processor_share > 0.0
    assert row.in_lanes == case.members
    assert 0.0 < row.threads_only_ns_per_node_step_best <= row.threads_only_ns_per_node_step
    assert (row.checked, row.unequal, row.failed) == (3, 0, 0)
    assert reported == [(0, 1), (1, 1)]
    heads, cells = ensemble_table([row])
    shown = dict(zip(heads, cells, strict=False))
    assert shown["members"] == str(case.members)
    assert shown["equal to a twin"] == "3 of 3"
    assert len(heads) == len(cells)


def test_the_command_tells_the_rows(capsys: pytest.CaptureFixture[str]) -> None:
    """Results are printed as JSON and as a table."""
    assert main(["ensemble", "--quick", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["members"] == QUICK[0].members
    assert main(["ensemble", "--quick"]) == 0
    assert "3 of 3" in capsys.readouterr().out


def test_what_differs_from_a_twin_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """One step more is a difference."""
    alone = study._alone

    def later(scene: Any, own: Any, steps: int) -> Any:
        return alone(scene, own, steps + 1)

    monkeypatch.setattr(study, "_alone", later)
    (row,) = ensemble_rows((Case(2, 10, 0.05, seconds=1.0, repetitions=1),))
    assert (row.checked, row.unequal) == (2, 2)
    assert main(["ensemble", "--quick"]) == 1
