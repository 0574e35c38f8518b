"""The convergence study of the vortex models: its figures, its words, its page."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rope_twin.errors import InputError
from validation import vortex_convergence as study
from validation.__main__ import main
from validation.case import choose
from validation.marked_page import read_json
from validation.page import CONVERGENCE, RESULTS

DOCS = Path(__file__).resolve().parents[2] / "docs"


def second_order(elements: int, step_s: float) -> study.Response:
    """An amplitude of 1 D at 10 Hz, off by 4·(8/n)² + (h/10 ms)² %."""
    off = 4.0 * (8.0 / elements) ** 2 + (step_s / 0.01) ** 2
    return 1.0 + 0.01 * off, 10.0


def sweep(elements: tuple[int, ...], steps_s: tuple[float, ...]) -> study.Sweep:
    return study.Sweep("L2", "a formula", elements, steps_s, second_order, 80.0, 100.0)


def heard(done: int, total: int, what: str) -> None:
    """Nobody."""


def test_a_sweep_says_from_where_it_is_converged() -> None:
    """At 8 elements 3.93 % off the finest, at 16 0.94 %: the first within 2 % is 16, 2 per wave."""
    (found,) = study.measure([sweep((8, 16, 32, 64), (1e-3,))], heard)
    assert found.refined == "element"
    assert [round(point.rms_off_pct, 2) for point in found.points] == [3.93, 0.94, 0.19, 0.0]
    point = found.converged
    assert point is not None
    assert (point.elements, point.per_wave) == (16, pytest.approx(2.0))
    assert "from elements of 5 m (2 per wave) on." in found.words
    (steps,) = study.measure([sweep((64,), (2e-2, 1e-2, 5e-3))], heard)
    assert steps.converged is not None
    assert steps.converged.per_period == pytest.approx(10.0)
    assert "from steps of 10 ms (10 per period) on." in steps.words
    spoilt = replace(found.points[2], rms_off_pct=-3.0)
    none = replace(found, points=(*found.points[:2], spoilt, found.points[3]))
    assert none.converged is None, "a finer one that is off again spoils those before it"
    assert "not within 2 %" in none.words


def test_the_frequency_of_a_sine_between_two_lines_of_the_spectrum() -> None:
    """10.123 Hz over 10 s: lines are 0.1 Hz apart, the answer is right to 0.002 Hz."""
    t = 0.01 * np.arange(1000)
    motion = np.stack([np.sin(2.0 * math.pi * 10.123 * t), 0.3 * np.cos(0.7 * t)], axis=1)
    assert study.peak_hz(motion, 0.01) == pytest.approx(10.123, abs=2e-3)


def test_the_command_runs_a_sweep(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cable by modes, 450 and 900 elements: table, JSON, picture and page."""
    whole = next(one for one in study.SWEEPS if one.model == "modes")
    monkeypatch.setattr(study, "SWEEPS", (replace(whole, elements=(450, 900)),))
    (tmp_path / "validation.md").write_text((DOCS / "validation.md").read_text())
    assert main(["--convergence", "--json", "--into", str(tmp_path)]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    coarse, fine = row["points"]
    assert coarse["rms_diameters"] == pytest.approx(fine["rms_diameters"], rel=0.05)
    assert coarse["frequency_hz"] == pytest.approx(12.72, abs=0.02)
    page = (tmp_path / "validation.md").read_text()
    assert row["words"] in page
    assert (tmp_path / "images" / "validation_convergence.png").stat().st_size > 5_000
    with pytest.raises(InputError, match="there is no case 'Q9'; known: L2"):
        choose("validation", study.SWEEPS, ["Q9"])


def test_the_page_tells_where_both_cases_are_converged() -> None:
    """docs/validation.md has each sweep's words."""
    stored = read_json(DOCS / RESULTS / CONVERGENCE)
    assert {(row["case"], row["refined"]) for row in stored} == {
        (case, refined) for case in ("Q1", "L2") for refined in ("element", "step")
    }
    page = (DOCS / "validation.md").read_text()
    assert all(row["words"] in page for row in stored)
    assert (DOCS / "images" / "validation_convergence.png").exists()
