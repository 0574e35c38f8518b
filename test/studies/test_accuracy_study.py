"""The study of accuracy: Richardson on made-up errors, quantities in closed form, small ladders."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rope_twin.cli import main
from rope_twin.effects import EFFECTS
from rope_twin.errors import InputError
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import UnpacedRun
from rope_twin.scene import convergence
from rope_twin.scene.convergence import known_error, read_study
from rope_twin.scene.error_bound import Setting
from rope_twin.scene.load import Change, change_scene, load_scene
from rope_twin.studies.accuracy_run import (
    MotionWindow,
    Series,
    Trial,
    differences,
    snap_peak_n,
    values,
)
from rope_twin.studies.accuracy_study import SAFETY, judge, make_plan, uncertainty
from rope_twin.studies.driven_twin import variant
from rope_twin.studies.independent_code import IndependentResult, run_independent_code

LOOK_S = 0.2


def sheds(params: Any) -> bool:
    """Return whether these are a vortex model's."""
    return any(effect.sheds and type(params) is effect.params for effect in EFFECTS)


def series(tension_n: np.ndarray, step_s: float = 0.01, slack: Any = False) -> Series:
    """A run of these top tensions; the depth follows them."""
    every = round(LOOK_S / step_s)
    looks = len(tension_n) // every
    return Series(
        step_s,
        tension_n,
        LOOK_S,
        tension_n[every - 1 :: every] * 1e-5,
        np.broadcast_to(slack, looks).copy(),
        2.0,
        0,
        0.1,
    )


def cosine(step_s: float = 0.01, error_n: float = 0.0) -> Series:
    """10 s of 100 kN ± 10 kN every second, all too high by an error."""
    time = np.arange(1, round(10.0 / step_s) + 1) * step_s
    return series(1e5 + 1e4 * np.cos(2.0 * np.pi * time) + error_n, step_s)


def test_differences_in_closed_form() -> None:
    """100 N too high: of the mean 0.1, of the deviation 100·√2/1e4, of the peak 100/110e3."""
    found = differences(cosine(0.02, 100.0), cosine(0.01))
    of_std = 100.0 * 100.0 * math.sqrt(2.0) / 1e4
    assert found["tension_rms"] == pytest.approx(of_std)
    assert found["tension_mean"] == pytest.approx(0.1)
    assert found["tension_std"] == pytest.approx(0.0, abs=1e-9)
    assert found["tension_peak"] == pytest.approx(100.0 * 100.0 / 110e3)
    assert found["tension_trough"] == pytest.approx(of_std)
    assert found["slack_share"] == 0.0
    assert found["snap_peak"] is None
    same = differences(cosine(), cosine())
    assert all(not value for value in same.values())


def test_a_still_tension_is_reported_beside_its_mean() -> None:
    still = series(np.full(1000, 1e5))
    higher = series(np.full(1000, 1e5 + 50.0))
    assert differences(higher, still)["tension_rms"] == pytest.approx(0.05)


def test_snaps_are_the_taut_spells_after_slack() -> None:
    """Slack from 2 to 3 and 6 to 7 s, peaks of 20 and 30 kN after it; the first 2 s are no snap."""
    tension = np.full(1000, 1e4)
    tension[100], tension[320], tension[380], tension[800] = 9e4, 8e4, 2e4, 3e4
    slack = np.zeros(50, bool)
    slack[10:15] = slack[30:35] = True
    slack[17] = True  # taut for 0.4 s only before it: no spell
    assert snap_peak_n(series(tension, slack=slack)) == pytest.approx(2.5e4)
    assert values(series(tension, slack=slack))["slack_share"] == pytest.approx(0.22)
    assert snap_peak_n(series(tension)) is None


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0])
def test_the_uncertainty_is_that_of_a_power(order: float) -> None:
    """Errors C·lᵖ on l = 4, 2, 1: the finest has C, and 1.25·C is reported."""
    C = 0.7
    errors = [C * length**order for length in (4.0, 2.0, 1.0)]
    bound, found = uncertainty(errors[0] - errors[1], errors[1] - errors[2], "%")
    assert found == pytest.approx(order)
    assert bound == pytest.approx(SAFETY * C)


def test_an_order_by_chance_is_not_believed() -> None:
    """Differences of 1 and 1e-9 would be order 30: the bound stays that of second order."""
    bound, order = uncertainty(1.0, 1e-9, "%")
    assert order is not None
    assert order > 20.0
    assert bound == pytest.approx(SAFETY * 0.25 / 3.0)


@pytest.mark.parametrize(("coarse", "middle"), [(2.0, 2.0), (2.0, 4.0), (0.0, 2.0), (1.0, None)])
def test_what_does_not_fall_has_no_uncertainty(coarse: float, middle: float | None) -> None:
    assert uncertainty(coarse, middle, "%") == (None, None)


def test_what_does_not_fall_but_is_small_is_bounded() -> None:
    assert uncertainty(0.01, 0.02, "%") == (pytest.approx(0.06), None)
    assert uncertainty(None, None, "%") == (0.0, None)


def test_spread_in_place_of_an_error() -> None:
    """Grids that do not come together: no uncertainty, but their least and largest."""
    rising = [cosine(error_n=error) for error in (4e3, 2e3, 1e3)]
    found = judge(Setting(8, 0.01), [*rising, cosine(0.02, 4e3), cosine(0.04, 4e3)])
    doubt = found.doubts["tension_mean"]
    assert doubt.uncertainty is None
    assert doubt.spread == (pytest.approx(101e3), pytest.approx(104e3))
    assert found.doubts["slack_share"].uncertainty == 0.0


def test_the_run_is_that_of_the_command(tmp_path: Path) -> None:
    """Sea, winch and ramp of deep_lift: the same top tension, to the bit, as --speed 0."""
    scene = load_scene("deep_lift")
    course = MotionWindow(scene, 12.0, 0.1)
    seen = Trial(course, Setting(25, 0.02)).run()
    run = UnpacedRun(RunOptions(scene="deep_lift", speed=0.0, elements=25, step_s=0.02))
    for _ in range(600):
        run.advance_slot()
    assert run.last.time_s == pytest.approx(12.0)
    assert run.last.tension_top_n == seen.tension_n[-1]
    assert run.summary().tension_top_max_n == seen.tension_n.max()
    assert -run.last.payload_position_m[2] == seen.depth_m[-1]


@pytest.mark.parametrize(
    "name",
    [pytest.param("viv_calm", marks=pytest.mark.long), "vortices_modal", "vortices_decomposed"],
)
def test_the_run_of_a_rope_with_vortices_is_that_of_the_command(name: str) -> None:
    """The wake's memory, and what a model beside the step makes of the drag; also the second time.

    The first look of the study is timed or judged by runs after it, so each begins at rest.
    """
    scene = load_scene(name)
    elements, step_s = 20, 0.01
    trial = Trial(MotionWindow(scene, 6.0, 0.1), Setting(elements, step_s))
    first, again = trial.run(), trial.run()
    run = UnpacedRun(RunOptions(scene=name, speed=0.0, elements=elements, step_s=step_s))
    run.advance_blindly(6.0)
    assert run.twin.snapshot().tension_top_n == first.tension_n[-1]
    assert run.twin.statistics().tension_top_max_n == first.tension_n.max()
    assert np.array_equal(again.tension_n, first.tension_n)
    bare = replace(scene, effects=tuple(one for one in scene.effects if not sheds(one)))
    without = Trial(MotionWindow(bare, 6.0, 0.1), Setting(elements, step_s)).run()
    assert not np.array_equal(without.tension_n, first.tension_n), "the model is at work"


@pytest.mark.long
def test_the_run_of_ropes_that_meet_is_that_of_the_command() -> None:
    """Both winches' schedules and the sea; elements of both ropes halved."""
    scene = load_scene("two_line_lift")
    seen = Trial(MotionWindow(scene, 12.0, 0.1), Setting(30, 0.02)).run()
    run = UnpacedRun(RunOptions(scene="two_line_lift", speed=0.0, elements=30, step_s=0.02))
    assert [line.elements for line in run.twin.scene.ropes] == [30, 30]
    run.advance_blindly(12.0)
    snapshot = run.twin.snapshot()
    assert snapshot.tension_top_n == pytest.approx(seen.tension_n[-1], rel=1e-9)
    assert run.twin.statistics().tension_top_max_n == pytest.approx(seen.tension_n.max(), rel=1e-9)
    assert -snapshot.payloads[0].position_m[2] == pytest.approx(seen.depth_m[-1], rel=1e-9)


def test_elements_of_ropes_that_meet_go_together() -> None:
    """The study holds at any of them; not when one rope's are changed alone."""
    scene = load_scene("bridle_lift")
    assert [line.elements for line in variant(scene, 50).ropes] == [50, 4, 4, 3, 3]
    found = read_study(scene)
    assert found is not None
    assert found.rope_elements == (100, 8, 8, 6, 6)
    assert found.age(variant(scene, 25)) == found.age(scene)
    alone = change_scene(scene, [Change("ropes[1].elements", 16)])
    assert found.age(alone) == "the scene's elements were changed since its study was made"


def test_the_ladder_holds_the_scene_and_its_neighbours() -> None:
    plan = make_plan(load_scene("deep_lift"))
    assert plan.seconds == 80.0  # a round of the winch schedule
    assert plan.own == Setting(100, 0.01)
    assert {one.elements for one in plan.settings} == {12, 25, 50, 100, 200, 400}
    assert {one.step_s for one in plan.settings} == {0.005, 0.01, 0.02, 0.05}
    assert [one.tolerance_n for one in plan.settings if one.tolerance_n] == [50.0, 5000.0]
    assert plan.reference.elements == 800
    assert plan.reference.step_s == 0.0025
    assert all(round(plan.sampling_s / one.step_s, 6).is_integer() for one in plan.settings)
    waves = make_plan(load_scene("wave_zone"))  # dear: fewer settings over a shorter window
    assert waves.seconds == 30.0
    assert waves.own in waves.settings
    assert waves.reference.step_s == 0.5 * waves.own.step_s
    with pytest.raises(InputError, match=r"--duration: 0.5 s is too short; give 1 or more"):
        make_plan(load_scene("deep_lift"), 0.5)


@pytest.fixture(scope="module")
def snap_result() -> IndependentResult:
    """snap_2km with its first snap, by both codes."""
    found = run_independent_code(load_scene("snap_2km"), 0.0025, 14.0)
    assert isinstance(found, IndependentResult)
    return found


def test_the_independent_code_agrees(snap_result: IndependentResult) -> None:
    """An explicit code of its own finds the same tension, in a snap too."""
    assert snap_result.seconds == 14.0
    assert snap_result.rms_pct < 0.1
    assert abs(snap_result.peak_pct) < 0.05
    assert "explicit leapfrog" in str(snap_result)
    stiff = run_independent_code(load_scene("riser_300m"), 0.0025)
    assert stiff == "none: the explicit code does not know the effect of Bending"


def test_the_witness_can_object(snap_result: IndependentResult) -> None:
    """A payload 1 % heavier in one of the two would stand out."""
    light = load_scene("snap_2km")
    heavy = change_scene(light, [Change("payloads[0].mass_kg", 1.01, multiply=True)])
    course = [MotionWindow(replace(one, winch=None), 14.0, 0.0025) for one in (light, heavy)]
    seen = [Trial(one, Setting(snap_result.elements, 0.0025)).run() for one in course]
    apart = differences(*seen)["tension_rms"]
    assert apart is not None
    assert apart > 10.0 * snap_result.rms_pct


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of few elements with its study, made by the command."""
    folder = tmp_path_factory.mktemp("scenes")
    text = load_scene("shallow_lift").path.read_text(encoding="utf-8")
    path = folder / "small.yaml"
    path.write_text(text.replace("elements: 40", "elements: 20"), encoding="utf-8")
    assert main(["accuracy", str(path), "--duration", "6"]) == 0
    return path


def test_a_study_is_made_and_read(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By the command, beside the scene, as text, picture and page; the run then knows its error."""
    folder = made.parent / convergence.FOLDER
    assert sorted(path.name for path in folder.iterdir()) == ["small.json", "small.md", "small.png"]
    picture = (folder / "small.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert 10_000 < len(picture) < 100_000
    page = (folder / "small.md").read_text(encoding="utf-8")
    assert "# small: what accuracy costs" in page
    assert "| 20 * | 10 |" in page
    assert "Independent check: explicit leapfrog" in page
    scene = load_scene(made)
    found = known_error(scene)
    assert 0.0 < found.rms_pct < 0.5
    content = json.loads((folder / "small.json").read_text(encoding="utf-8"))
    row = next(r for r in content["rows"] if (r["elements"], r["step_s"]) == (20, 0.01))
    assert row["error_rms_pct"] == found.rms_pct
    assert row["real_time_factor"] > 0.0
    assert row["memory_mb"] > 0.0
    assert {"elements", "step_s", "real_time_factor", "error_rms_pct", "error_peak_pct"} <= set(row)


def test_within_holds_when_measured_afterwards(made: Path) -> None:
    """The level that is bought, run again against a reference of its own, keeps its error."""
    scene = load_scene(made)
    options = [
        "run",
        str(made),
        "--speed",
        "0",
        "--duration",
        "6",
        "--no-record",
        "--within",
        "0.3%",
    ]
    assert main(options) == 0
    content = json.loads(convergence.study_path(scene).read_text(encoding="utf-8"))
    good = [row for row in content["rows"] if row["error_rms_pct"] <= 0.3]
    course = MotionWindow(scene, 6.0, 0.1)
    truth = Trial(course, Setting(400, 0.00125)).run()
    for row in good:
        seen = Trial(course, Setting(row["elements"], row["step_s"])).run()
        error = differences(seen, truth)["tension_rms"]
        assert error is not None
        assert error < 0.3


def with_bounds(made: Path, folder: Path, at_most: Callable[[float], float | None]) -> Path:
    """The made scene, with a study that promises other bounds on the rms."""
    place = folder / "small.yaml"
    place.write_text(made.read_text(encoding="utf-8"), encoding="utf-8")
    content = json.loads(convergence.study_path(load_scene(made)).read_text(encoding="utf-8"))
    for row in content["rows"]:
        figure = row["figures"]["tension_rms"]
        figure["at_most"] = at_most(figure["at_most"])
    (folder / convergence.FOLDER).mkdir()
    (folder / convergence.FOLDER / "small.json").write_text(json.dumps(content), encoding="utf-8")
    return place


def test_what_within_buys_is_measured_anew(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It holds; a study that promises a hundred times too much sells what does not."""
    words = ["--within", "0.3%", "--json"]
    assert main(["accuracy", str(made), *words]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert 0.0 < row["error"] <= row["at_most"] <= 0.3
    assert row["seconds"] == 6.0, "the study's window"
    assert main(["accuracy", str(made), *words, "--duration", "9"]) == 0
    (longer,) = json.loads(capsys.readouterr().out)["rows"]
    assert longer["seconds"] == 9.0
    assert 0.0 < longer["error"] != row["error"], "another run"
    place = with_bounds(made, tmp_path, lambda bound: 0.01 * bound)
    assert main(["accuracy", str(place), *words]) == 3
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["error"] > 0.3 > row["at_most"]
    assert row["ok"] is False


def test_what_a_study_does_not_sell_is_reported(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It breaks no word: an rms that does not converge, an error below the best."""
    assert main(["accuracy", str(made), "--within", "0.000001%"]) == 0
    assert "nothing selected: the best of its study is 0." in capsys.readouterr().out
    place = with_bounds(made, tmp_path, lambda bound: None)
    assert main(["accuracy", str(place), "--within", "1%"]) == 0
    assert "nothing selected: its study knows no error of tension_rms" in capsys.readouterr().out
    assert main(["accuracy", str(made), "--within", "1"]) == 1
    assert "write a number above 0 and its unit" in capsys.readouterr().err


@pytest.mark.long
def test_within_holds_in_every_scene() -> None:
    """`pytest -m long -k within_holds_in_every_scene`, some eight minutes: 1 % of every study."""
    assert main(["accuracy", "--all", "--within", "1%"]) == 0


def test_old_studies_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    """One line a scene; exit code 0 only if all are current."""
    code = main(["accuracy", "--status", "--json"])
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {row["scene"] for row in rows} >= {"deep_lift", "snap_2km"}
    shown = {row["study"] for row in rows}
    assert code == (0 if shown == {"current"} else 3)
    assert all((row["error_rms_pct"] is None) or row["study"] == "current" for row in rows)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["deep_lift", "--duration", "0"], "--duration: 0 s is not possible; give a time above"),
        (["deep_lift", "--out", "/proc/nowhere"], "the study cannot be written"),
        (["deap_lift"], "did you mean 'deep_lift'?"),
        (
            ["deep_lift", "--quantity", "tension_rms"],
            "--quantity: a study has every quantity; give --within 1%",
        ),
        (["deep_lift", "--within", "1%", "--out", "x"], "--out: --within writes no files; leave"),
    ],
)
def test_refusals(words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["accuracy", *words]) == 1
    assert sentence in capsys.readouterr().err


def test_grids_that_cannot_be_varied_are_refused(tmp_path: Path) -> None:
    line = load_scene("still_water")
    graded = variant(line, 50)
    path = tmp_path / "graded.yaml"
    text = line.path.read_text(encoding="utf-8")
    path.write_text(
        text.replace("    elements: 50", "    elements: 50\n    grading: {nodes_m: [1.0, 2.0]}"),
        encoding="utf-8",
    )
    assert graded.ropes[0].grading is None
    with pytest.raises(InputError, match="nodes_m holds the elements fixed"):
        make_plan(load_scene(path))
