"""`python -m benchmarks`: figures that can be right, a page and a picture. No time is asserted."""

from __future__ import annotations

import importlib.util
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import ensemble_speed, orders, speed
from benchmarks.__main__ import main
from benchmarks.ensemble_speed import QUICK, EnsembleRow, ensemble_rows
from benchmarks.performance_page import as_markdown
from benchmarks.trial import Reference, Trial
from rope_twin.core.jit.functions import chain
from rope_twin.errors import InputError
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import UnpacedRun
from rope_twin.scene.load import load_scene
from rope_twin.studies.accuracy_study import this_machine
from rope_twin.studies.driven_twin import variant

ROOT = Path(__file__).resolve().parents[2]
SAID: list[tuple[int, int, str]] = []


def listen(done: int, total: int, what: str) -> None:
    """Keep what a study reports."""
    SAID.append((done, total, what))


@pytest.mark.parametrize(
    ("action", "about"),
    [
        ("speed", "Cost of a step and error of the top tension"),
        ("vortices", "Cost of the vortex models"),
        ("report", "Speed, order, ensemble and peers"),
    ],
)
def test_the_help_of_each_says_what_it_measures(
    action: str, about: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main([action, "--help"])
    assert about in " ".join(capsys.readouterr().out.split())


@pytest.fixture(scope="module")
def measured() -> speed.Speed:
    SAID.clear()
    return speed.measure_speed(speed.QUICK, listen)


@pytest.fixture(scope="module")
def curves() -> tuple[orders.Curve, ...]:
    return orders.measure_orders(orders.QUICK, listen)


@pytest.fixture(scope="module")
def many() -> list[EnsembleRow]:
    return ensemble_rows(QUICK, listen)


@pytest.fixture
def as_measured(
    measured: speed.Speed,
    curves: tuple[orders.Curve, ...],
    many: list[EnsembleRow],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The command finds what was measured already."""
    monkeypatch.setattr(ensemble_speed, "ensemble_rows", lambda cases, report: many)
    monkeypatch.setattr(speed, "measure_speed", lambda plan, report: measured)
    monkeypatch.setattr(orders, "measure_orders", lambda sweeps, report: curves)


def test_speed_and_error_belong_together(measured: speed.Speed) -> None:
    rows = {(row.nodes, row.step_s): row for row in measured.rows}
    assert set(rows) == {(n, h) for n in speed.QUICK.nodes for h in speed.QUICK.steps_s}
    for row in (*measured.rows, *measured.snaps):
        seconds = row.ns_per_node_step * 1e-9 * row.nodes / row.step_s
        assert row.real_time_factor == pytest.approx(1.0 / seconds)
        assert 0.0 < row.ns_per_node_step_best <= row.ns_per_node_step
        if row in measured.snaps:
            assert row.longest_step_s is not None
            assert row.longest_step_s > 0.0
        else:
            assert row.longest_step_s is None
        assert row.repetitions >= speed.QUICK.repetitions
        assert row.solves_per_step >= 2.0
        assert row.unconverged == 0
        assert 0.0 < row.processor_share < 1.1
    for row in measured.rows:
        assert 0.0 < row.error_pct < 0.1
        assert abs(row.peak_error_pct) < 0.01
    # Where the elements' part is small the error is the step's, and that is of second order.
    assert rows[200, 0.02].error_pct == pytest.approx(4.0 * rows[200, 0.01].error_pct, rel=0.5)
    assert all(basis.doubt.rms_pct < 0.05 for basis in measured.references[:1])
    assert set(measured.exponents) == {"0.01", "0.02"}


def test_progress_is_reported_every_case(measured: speed.Speed) -> None:
    reported = SAID[: len(measured.references) + len(measured.rows) + len(measured.snaps) + 1]
    assert [done for done, _, _ in reported] == list(range(len(reported)))
    assert "smooth_2km, 200 nodes at 20 ms" in [what for _, _, what in reported]
    assert reported[-1][2] == "done"


def test_the_exponent_is_the_slope(measured: speed.Speed) -> None:
    row = measured.rows[0]
    rows = tuple(
        replace(row, nodes=n, step_s=0.01, ns_per_node_step_best=60.0 * n**0.03)
        for n in (20, 100, 1000, 7000)
    )
    fast_below = (replace(rows[0], ns_per_node_step_best=1.0), *rows[1:])
    assert speed.exponent(fast_below, 0.01) == pytest.approx(1.03)


def test_errors_against_a_reference() -> None:
    """A cosine of 2 on 10, read with an offset of 0.1: every measure in closed form."""
    time = np.arange(1, 4001) * 0.001
    truth = 10.0 + 2.0 * np.cos(2.0 * np.pi * time)
    reference = Reference("made up", 1, 0.001, truth)
    errors = reference.errors(truth[9::10] + 0.1, 0.01)
    assert errors.mean_pct == pytest.approx(100.0 * 0.1 / math.sqrt(2.0))
    assert errors.rms_pct == pytest.approx(100.0 * 0.1 / math.sqrt(2.0))
    assert errors.peak_pct == pytest.approx(100.0 * 0.1 / 12.0)
    assert errors.trough_pct == pytest.approx(100.0 * 0.1 / math.sqrt(2.0))


def test_the_smooth_case_is_of_second_order(curves: tuple[orders.Curve, ...]) -> None:
    for curve in curves[:2]:
        assert curve.rms_order == pytest.approx(2.0, abs=0.1)
        assert curve.mean_order == pytest.approx(2.0, abs=0.1)
    assert [curve.refined for curve in curves] == ["step", "element", "step"]
    assert curves[1].sizes == (100.0, 50.0, 25.0)


def test_a_slope_is_a_power() -> None:
    assert orders.slope((4.0, 2.0, 1.0), (48.0, 12.0, 3.0)) == pytest.approx(2.0)


def test_a_trial_is_what_the_twin_computes() -> None:
    """The twin is fed samples at 20 Hz, the trial the exact sine; 6e-9 of the heave apart."""
    scene = variant(load_scene("smooth_2km"), step_s=0.02)
    tension = Trial(scene, 10.0).run().tension_n
    run = UnpacedRun(RunOptions(scene="smooth_2km", speed=0.0, step_s=0.02))
    run.advance_blindly(10.0)
    assert run.twin.snapshot().tension_top_n == pytest.approx(tension[-1], rel=1e-6)
    assert run.twin.statistics().tension_top_max_n == pytest.approx(tension.max(), rel=1e-6)


def test_a_trial_repeats_to_the_bit_in_any_pieces() -> None:
    trial = Trial(variant(load_scene("snap_2km"), 50), 8.0)
    whole, pieces = trial.run(), trial.run(steps_at_once=7)
    assert np.array_equal(whole.tension_n, pieces.tension_n)
    assert len(pieces.took_s) == math.ceil(trial.steps / 7)


def test_a_scene_with_a_bag_is_no_trial() -> None:
    with pytest.raises(InputError, match=r"deep_lift: its sea is not a regular heave; give"):
        Trial(load_scene("deep_lift"), 1.0)


def test_the_yardstick_computes_its_chain() -> None:
    """x ← x/2 + 1 from 0: 2·(1 − 2⁻ⁿ)."""
    assert [chain(0.0, 0.5, 1.0, n) for n in (0, 1, 10)] == [0.0, 1.0, 2.0 - 2.0**-9]
    machine = this_machine()
    assert machine.cores >= 1
    assert 0.05 < machine.multiply_add_ns < 1e3
    assert machine.processor in machine.as_text()


@pytest.mark.usefixtures("as_measured")
def test_json_and_tables(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["speed", "--quick", "--json"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    wanted = {"nodes", "step_s", "ns_per_node_step", "real_time_factor", "error_pct"}
    assert all(wanted <= set(row) for row in found["rows"] + found["snaps"])
    assert main(["speed", "--quick"]) == 0
    shown = capsys.readouterr().out
    assert "ns/node/step" in shown
    assert "a dependent multiply-add takes" in shown
    assert "Cost of a step from 100 to 200 nodes" in shown
    assert main(["order", "--quick", "--json"]) == 0
    assert {"scene", "rms_order"} <= set(json.loads(capsys.readouterr().out)["rows"][0])


@pytest.mark.usefixtures("as_measured")
def test_the_page_and_its_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "--quick", "--into", str(tmp_path / "docs")]) == 0
    page = tmp_path / "docs" / "performance.md"
    assert capsys.readouterr().out.strip() == str(page)
    text = page.read_text(encoding="utf-8")
    assert "| smooth_2km | 200 | 20 |" in text
    assert "](images/orders.png)" in text
    picture = (tmp_path / "docs" / "images" / "orders.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) > 20_000


def test_the_page_that_we_ship_is_the_one_that_is_written(
    measured: speed.Speed, curves: tuple[orders.Curve, ...], many: list[EnsembleRow]
) -> None:
    """Its words; its figures are those of a machine."""

    def prose(text: str) -> list[str]:
        lines = [line for line in text.splitlines() if line and not line.startswith("|")]
        machine = (
            "multiply-add",
            "Cost of",
            "ropes of one kind",
            "doubles wide",
        )  # lines with its figures
        return [line for line in lines if not any(words in line for words in machine)]

    page = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
    shipped, _, _ = page.partition("\n## Comparison with other programs")  # that one: test_peers
    written = as_markdown(replace(measured, seconds=speed.FULL.seconds), curves, many)
    assert prose(shipped) == prose(written)
    assert shipped.count("\n| smooth_2km |") == len(speed.FULL.nodes) * len(speed.FULL.steps_s) + 1


def test_a_picture_that_cannot_be_is_refused_at_once(
    curves: tuple[orders.Curve, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match=r"'.jpg' is no picture that can be drawn; end it in"):
        orders.draw_orders(curves, tmp_path / "orders.jpg")
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="give a place that can be written"):
        orders.draw_orders(curves, tmp_path / "file" / "orders.png")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"matplotlib: .* `pip install 'rope_twin\[plot\]'"):
        orders.draw_orders(curves, tmp_path / "orders.png")


def test_effects_cost_nothing_where_they_are_absent(capsys: pytest.CaptureFixture[str]) -> None:
    """Steps with and without; none of the effect's functions is in the code without."""
    assert main(["effects", "--quick", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (row["effect"], row["nodes"], row["symbols_off"]) == ("current", 50, 0)
    assert min(row[f"us_per_step_{name}"] for name in ("base", "off", "on")) > 0.0
