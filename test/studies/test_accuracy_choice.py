"""`run --within` and `--budget`: what is bought from a study, what is said, what is refused."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from study_samples import (
    ELEMENTS,
    STEPS_S,
    UNCERTAINTY_PCT,
    error_pct,
    sample_study,
    studied_scene,
    write_study,
)

from rope_twin.cli import build_parser, main, selection
from rope_twin.cli.selection import (
    AIM,
    CEILING_PCT,
    LEAST,
    MOST,
    Cost,
    Selection,
    measure_shares,
    refine,
)
from rope_twin.errors import InputError
from rope_twin.run.options import read_options
from rope_twin.scene import convergence
from rope_twin.scene.convergence import known_error, read_study
from rope_twin.scene.error_bound import AccuracyLevel, Setting, StudyLevel
from rope_twin.scene.schema import Scene
from rope_twin.studies.accuracy_within import cheapest_within, most_accurate, sure_bound
from rope_twin.studies.driven_twin import variant
from rope_twin.twin.level import OverloadProtection
from rope_twin.twin.pacing import SLOT_S, steps_in_slot
from rope_twin.twin.twin import Twin


def levels_of_study(scene: Scene) -> tuple[StudyLevel, ...]:
    found = read_study(scene)
    assert found is not None
    return found.own_levels


def unpaced(scene: Scene, *words: str) -> list[str]:
    """A command line that runs 0.2 s of twin time."""
    return ["run", str(scene.path), "--speed", "0", "--duration", "0.2", "--no-record", *words]


@pytest.mark.parametrize("target", [0.08, 0.15, 0.3, 0.6, 5.0])
def test_the_cheapest_within_is_that_of_all_that_serve(tmp_path: Path, target: float) -> None:
    """By hand: of all pairs whose error is within the target the one with the least work."""
    level = cheapest_within(levels_of_study(studied_scene(tmp_path)), convergence.RMS, target)
    pairs = [(n / h, n, h) for n in ELEMENTS for h in STEPS_S]
    good = [pair for pair in pairs if error_pct(*pair[1:]) + UNCERTAINTY_PCT <= target]
    if not good:
        assert level is None
    else:
        assert level is not None
        assert (level.elements, level.step_s) == min(good)[1:]


def test_luck_is_not_bought(tmp_path: Path) -> None:
    """A coarse level that hits the reference counts with the error of the finer ones."""
    scene = studied_scene(tmp_path)
    content = sample_study(scene)
    content["rows"][2]["figures"][convergence.RMS] = {"error": 0.0, "at_most": 1e-3}  # 10 at 20 ms
    write_study(scene, content)
    levels = levels_of_study(scene)
    lucky = levels[2]
    assert lucky.bound(convergence.RMS) == 1e-3
    assert sure_bound(lucky, levels, convergence.RMS) == pytest.approx(
        error_pct(10, 0.01) + UNCERTAINTY_PCT
    )
    assert cheapest_within(levels, convergence.RMS, 0.04) is None


def test_a_budget_buys_the_most_accurate_that_fits(tmp_path: Path) -> None:
    levels = levels_of_study(studied_scene(tmp_path))
    costs = [1.0 / level.real_time_factor for level in levels]
    dear = most_accurate(levels, convergence.RMS, costs, math.inf)
    assert dear is not None
    assert (dear.elements, dear.step_s) == (40, 0.005)
    cheap = most_accurate(levels, convergence.RMS, costs, min(costs))
    assert cheap is not None
    assert (cheap.elements, cheap.step_s) == (10, 0.02)
    assert most_accurate(levels, convergence.RMS, costs, 0.5 * min(costs)) is None
    for budget in sorted(costs):
        level = most_accurate(levels, convergence.RMS, costs, budget)
        assert level is not None
        assert costs[levels.index(level)] <= budget


def test_of_equals_the_cheapest_is_taken(tmp_path: Path) -> None:
    """Errors below what the reference can tell apart are no reason to pay."""
    levels = levels_of_study(studied_scene(tmp_path))
    alike = {
        name: convergence.Figure(0.0, UNCERTAINTY_PCT)
        for name in (convergence.RMS, convergence.PEAK)
    }
    same = [replace(level, figures=alike) for level in levels]
    costs = [1.0 / level.real_time_factor for level in levels]
    level = most_accurate(same, convergence.RMS, costs, math.inf)
    assert level is not None
    assert (level.elements, level.step_s) == (10, 0.02)


def test_a_run_within_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It runs what it says, and the last line has the error of the setting that ran."""
    scene = studied_scene(tmp_path)
    assert main(unpaced(scene, "--within", "0.6%", "--json")) == 0
    out, said = capsys.readouterr()
    reported: dict[str, Any] = json.loads(out)
    assert reported["step_s"] == 0.01
    assert reported["tension_top_error_pct"] == pytest.approx(error_pct(10, 0.01) + UNCERTAINTY_PCT)
    assert reported["tension_top_peak_error_pct"] == pytest.approx(
        0.5 * error_pct(10, 0.01) + UNCERTAINTY_PCT
    )
    assert reported["chosen"] in said
    assert reported["chosen"].startswith(
        "--within 0.6 %: 10 elements at 10 ms, the cheapest with an error of tension_rms "
        "within 0.51 % in the study's run of 30 s; next better, 10 elements at 5 ms (within "
        "0.44 %), costs 2 "
    )
    assert "error ≤ 0.51 %" in said


def test_a_run_says_its_error_or_that_it_is_unknown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = studied_scene(tmp_path)
    assert main(unpaced(scene)) == 0
    out, said = capsys.readouterr()
    assert "top-tension error: 0.21 % RMS, 0.11 % peak, at most, in the study's" in out
    assert main(unpaced(scene, "--json", "--bag", "sea_1p2m")) == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported["tension_top_error_pct"] is reported["tension_top_peak_error_pct"] is None
    assert reported["tension_top_error_reason"] == "unknown: the study's run has another sea"
    assert main(unpaced(scene, "--bag", "sea_1p2m")) == 0
    assert "  error unknown  " in capsys.readouterr().err, "on the way as at the end"
    convergence.study_path(scene).unlink()
    assert main(unpaced(scene)) == 0
    out, said = capsys.readouterr()
    assert "top-tension error unknown: no study" in out
    assert "error unknown" in said


def test_a_scene_is_shown_with_its_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = studied_scene(tmp_path)
    assert main(["scene", "show", str(scene.path)]) == 0
    assert "top tension 0.21 % rms, 0.11 % at its maximum, at most" in capsys.readouterr().out
    convergence.study_path(scene).unlink()
    assert main(["scene", "show", str(scene.path)]) == 0
    assert "accuracy             unknown: no study" in capsys.readouterr().out


def test_a_snapshot_has_its_error(tmp_path: Path) -> None:
    scene = studied_scene(tmp_path)
    assert Twin(scene).snapshot().study_error.rms_pct == pytest.approx(
        error_pct(20, 0.01) + UNCERTAINTY_PCT
    )
    coarser = Twin(variant(scene, 5))
    assert math.isnan(coarser.snapshot().study_error.rms_pct)
    assert math.isnan(coarser.branch().snapshot().study_error.rms_pct)


NO_AMOUNT = "tension_rms is in %; write a number above 0 and its unit, like 1%."


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--within", "1"], f"--within 1: {NO_AMOUNT}"),
        (["--within=-1%"], f"--within -1%: {NO_AMOUNT}"),
        (["--within", "nan%"], f"--within nan%: {NO_AMOUNT}"),
        (["--within", ""], f"--within : {NO_AMOUNT}"),
        (["--within", "1m"], f"--within 1m: {NO_AMOUNT}"),
        (["--within", "0.01%"], "no setting of the study is that accurate, the best is 0.06 %"),
        (
            ["--within", "1%", "--quantity", "tension_rsm"],
            "'tension_rsm'; did you mean 'tension_rms'?",
        ),
        (
            ["--within", "1m", "--quantity", "payload_depth"],
            "its convergence study has no error of payload_depth; give --quantity with one of",
        ),
        (
            ["--within", "1%", "--quantity", "payload_depth"],
            "--within 1%: payload_depth is in m; write a number above 0 and its unit, like 0.05m.",
        ),
        (
            ["--within", "1%", "--bag", "sea_1p2m"],
            "small: its convergence study is for its own sea, not for --bag sea_1p2m; leave",
        ),
        (
            ["--quantity", "tension_rms"],
            "--quantity: there is nothing to select; give --within 1% too.",
        ),
        (["--budget", "30%"], "--budget: --speed 0 takes a whole core; give up to 100 %"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], sentence: str
) -> None:
    assert main(unpaced(studied_scene(tmp_path), *words)) == 1
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1


def test_without_a_valid_study_nothing_is_selected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = studied_scene(tmp_path)
    write_study(scene, sample_study(scene) | {"solver": "old"})
    assert main(unpaced(scene, "--within", "1%")) == 1
    assert (
        "small: the convergence study is outdated: the solver was changed"
        in capsys.readouterr().err
    )
    convergence.study_path(scene).unlink()
    assert main(unpaced(scene, "--within", "1%")) == 1
    said = capsys.readouterr().err
    right = f"make it with `rope_twin accuracy {scene.path}`."
    assert f"it has no convergence study; {right}" in said, "what it names can be typed"


def test_what_is_better_for_hardly_more_is_said_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Not "1 times as much"."""
    scene = studied_scene(tmp_path)
    content = sample_study(scene)
    for row in content["rows"]:
        row["real_time_factor"] = 1000.0 - row["elements"] - 100.0 * row["step_s"]
    write_study(scene, content)
    assert main(unpaced(scene, "--within", "5%")) == 0
    assert "costs little more" in capsys.readouterr().err


def test_a_window_that_ends_before_the_run_is_reported_or_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The scene asks for a minute: what a study of 30 s promises holds for 30 s."""
    scene = studied_scene(tmp_path)
    words = ["run", str(scene.path), "--speed", "0", "--no-record", "--within", "1%", "--duration"]
    assert main([*words, "30.02"]) == 1
    right = f"make it again with `rope_twin accuracy {scene.path}`, or give --duration 30."
    said = f"its convergence study is for 30 s, but the events of the scene take 60 s; {right}\n"
    assert capsys.readouterr().err == f"--within, scene small: {said}"
    assert main([*words, "30"]) == 0
    assert "in the study's run of 30 s; next better" in capsys.readouterr().err
    write_study(scene, sample_study(scene) | {"seconds": 60.0})
    assert main([*words, "30.02"]) == 0
    assert "in the study's run of 60 s; next better" in capsys.readouterr().err
    assert main([*words, "60.02"]) == 0
    longer = (
        "in the study's run of 60 s (the error is unknown after that: the study's run "
        "ended at 60 s);"
    )
    assert longer in capsys.readouterr().err


def test_a_doubted_study_says_nothing_on_any_rung(tmp_path: Path) -> None:
    """A branch of the twin reports no error either."""
    twin = Twin(studied_scene(tmp_path, elements=40))
    assert twin.snapshot().study_error.rms_pct > 0.0
    twin.invalidate_error("it was a drill")
    own, step_ns = twin.level, twin.step_ns
    for level in (own, AccuracyLevel(2 * step_ns), AccuracyLevel(2 * step_ns, 1), own):
        twin.set_level(level)
        assert "unknown: it was a drill" in OverloadProtection(twin).words()
        for one in (twin, twin.branch()):
            error = one.snapshot().study_error
            assert math.isnan(error.rms_pct)
            assert math.isnan(error.peak_pct)
            assert error.words == "unknown: it was a drill"


def test_shares_are_measured_on_this_machine(tmp_path: Path) -> None:
    """Whatever speed the study's machine had."""
    scene = studied_scene(tmp_path)
    slow = [replace(level, real_time_factor=1e-3) for level in levels_of_study(scene)]
    assert all(0.0 < share < 100.0 for share in measure_shares(scene, slow, 1.0))


def test_a_share_is_what_a_slot_and_its_steps_cost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slot of 20 ms costs 100 µs and 10 µs for each step of two solves."""
    scene = studied_scene(tmp_path)
    monkeypatch.setattr(selection, "_slot_costs", lambda twin: (100e-6, 10e-6))
    levels = levels_of_study(scene)[:3]  # 5, 10 and 20 ms
    assert measure_shares(scene, levels, 1.0) == pytest.approx([0.7, 0.6, 0.55])
    assert measure_shares(scene, levels, 2.0) == pytest.approx([1.4, 1.2, 1.1])
    busy = [replace(level, solves_per_step=4.0) for level in levels]
    assert measure_shares(scene, busy, 1.0) == pytest.approx([0.9, 0.7, 0.6])


def plain_cost(setting: Setting) -> Cost:
    """A slot that costs 0.4 %, 100 ns a node and step, and 2 µs a node for messages."""
    steps = 0.4 + 1e-5 * setting.elements / setting.step_s
    return Cost(steps, 1e-3 * setting.elements)


@pytest.mark.parametrize("budget", [1.0, 3.0, 10.0, 30.0, 60.0])
@pytest.mark.parametrize("start", [Setting(40, 0.005), Setting(100, 0.02), Setting(20, 0.01)])
def test_a_budget_is_spent_on_elements_and_steps_alike(budget: float, start: Setting) -> None:
    """The rest is left for the middleware and the rest of the process."""
    found = refine(start, budget, 20_000, plain_cost)
    assert isinstance(found, Selection)
    setting, cost = found.setting, found.cost
    assert cost == plain_cost(setting)
    assert LEAST * min(budget, CEILING_PCT / AIM) <= cost.pct <= MOST * budget
    finer_elements, finer_step = setting.elements / start.elements, start.step_s / setting.step_s
    assert finer_elements >= 1.0
    assert finer_step >= 1.0
    assert 0.5 <= finer_elements / finer_step <= 2.0
    assert steps_in_slot(setting.step_s) * setting.step_s == pytest.approx(SLOT_S)
    assert found.better.elements > setting.elements
    assert found.better.step_s < setting.step_s
    assert found.better_pct > cost.pct


def test_what_a_budget_is_not_enough_for_is_not_bought() -> None:
    start = Setting(400, 0.005)
    share = plain_cost(start).pct
    assert refine(start, share, 20_000, plain_cost) == plain_cost(start)
    found = refine(start, share / AIM, 20_000, plain_cost)
    assert isinstance(found, Selection)
    assert found.setting == start


def test_a_rope_has_no_more_elements_than_it_may_and_slots_keep_room() -> None:
    found = refine(Setting(100, 0.005), 30.0, 150, plain_cost)
    assert isinstance(found, Selection)
    assert found.setting.elements == 150
    full = refine(Setting(100, 0.005), 100.0, 20_000, plain_cost)
    assert isinstance(full, Selection)
    assert 0.9 * CEILING_PCT <= full.cost.pct <= 1.05 * CEILING_PCT


def test_finer_than_the_ladder_the_finest_bound_holds(tmp_path: Path) -> None:
    scene = studied_scene(tmp_path)
    finest = known_error(variant(scene, 40, 0.005))
    for finer in (variant(scene, 500, 0.001), variant(scene, 500, 0.005)):
        found = known_error(finer)
        assert (found.rms_pct, found.peak_pct) == (finest.rms_pct, finest.peak_pct)
        assert found.words == finest.words + ", which ends at a coarser setting"
    coarse = known_error(variant(scene, 500, 0.02))
    assert coarse.rms_pct == pytest.approx(error_pct(40, 0.02) + UNCERTAINTY_PCT)
    assert math.isnan(known_error(variant(scene, 500, 0.05)).rms_pct)


def test_a_budget_in_another_sea_claims_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Settings are bought all the same: what costs more is finer in any sea."""
    scene = studied_scene(tmp_path)
    cheap = Cost(1.0, 0.1)
    monkeypatch.setattr(
        selection, "measure_shares", lambda scene, levels, speed: [1.0] * len(levels)
    )
    monkeypatch.setattr(selection, "measure_setting", lambda *args, **more: cheap)
    words = ["run", str(scene.path), "--no-record", "--budget", "20%"]
    for more, said in (
        (
            [],
            "error of tension_rms 0.06 % at most in the study's run of 30 s (the error",
        ),
        (["--bag", "sea_1p2m"], "its error is unknown: the study's run has another sea;"),
    ):
        args = build_parser().parse_args([*words, *more])
        assert said in selection.choose(args, read_options(args)).chosen


@pytest.mark.parametrize("budget", ["20%", "0.0001%"])
def test_a_budget_is_reported_with_what_the_next_setting_costs(tmp_path: Path, budget: str) -> None:
    """Measured, so that no number is expected; too little is one sentence."""
    scene = studied_scene(tmp_path)
    words = ["run", str(scene.path), "--no-record", "--budget", budget]
    args = build_parser().parse_args(words)
    if budget == "0.0001%":
        with pytest.raises(
            InputError, match=r"the cheapest setting of the study needs .* give more"
        ):
            selection.choose(args, read_options(args))
        return
    options = selection.choose(args, read_options(args))
    assert (options.elements or 0) >= 10
    assert options.budget_pct == 20.0
    assert options.calibrated_pct is not None
    assert options.chosen.startswith(f"--budget 20 %: {options.elements} elements at ")
    assert "; next better, " in options.chosen
    assert " needs about " in options.chosen
