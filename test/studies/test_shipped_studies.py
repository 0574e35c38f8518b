"""The studies that come with the scenes: whole, readable, and what a new run of the study finds."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rope_twin.files import share_dir
from rope_twin.scene.convergence import FOLDER, read_study, study_path
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.studies import accuracy_study as accuracy
from rope_twin.studies.accuracy_run import BY_NAME
from rope_twin.studies.accuracy_study import make_plan

STUDIES = share_dir() / "config" / "scenes" / FOLDER
NAMES = sorted(path.stem for path in STUDIES.glob("*.json"))
CHEAP = "shallow_lift"
BAND = 0.1  # of an error: what another processor's rounding and a later solver may change


def content(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((STUDIES / f"{name}.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("name", NAMES)
def test_a_study_is_of_a_scene_and_whole(name: str) -> None:
    """Page and picture beside it; the scene's own setting is among the rows, with its error."""
    scene = load_scene(name)
    study = read_study(scene)
    assert study is not None
    assert study.scene == name
    own = study.at(scene.ropes[0].elements, scene.time.step_s)
    assert len(own) == 1
    assert own[0].real_time_factor > 1.0
    assert set(own[0].figures) == set(BY_NAME)
    page = study_path(scene).with_suffix(".md").read_text(encoding="utf-8")
    assert page.startswith(f"# {name}: what accuracy costs")
    assert f"{study.scene_digest}, solver version {study.solver}." in page
    assert f"]({name}.png)" in page
    assert 5_000 < len(study_path(scene).with_suffix(".png").read_bytes()) < 100_000


@pytest.mark.parametrize("name", NAMES)
def test_no_error_without_its_uncertainty(name: str) -> None:
    """A bound is the error and what the reference may be wrong by; neither stands alone."""
    found = content(name)
    doubts = found["reference"]["doubts"]
    for row in found["rows"]:
        for quantity, figure in row["figures"].items():
            doubt = doubts[quantity]["uncertainty"]
            assert (figure["at_most"] is None) == (figure["error"] is None)
            if figure["at_most"] is not None:
                assert figure["at_most"] == pytest.approx(abs(figure["error"]) + doubt, rel=1e-4)
            elif doubt is None:
                assert doubts[quantity]["spread"] is not None


def check_again(name: str) -> None:
    """Run the whole study again, but for times and the independent code, and compare each error."""
    scene, shipped = load_scene(name), content(name)
    plan = make_plan(scene, shipped["seconds"])
    again = accuracy.as_content(
        accuracy.measure_accuracy(scene, plan, lambda *said: None, timed=False)
    )
    assert len(again["rows"]) == len(shipped["rows"])
    for new, old in zip(again["rows"], shipped["rows"], strict=True):
        assert (new["elements"], new["step_s"]) == (old["elements"], old["step_s"])
        for quantity, figure in old["figures"].items():
            found = new["figures"][quantity]["error"]
            if figure["error"] is None or found is None:
                assert found == figure["error"]
                continue
            doubt = shipped["reference"]["doubts"][quantity]["uncertainty"]
            band = BAND * abs(figure["error"]) + doubt + 1e-6
            assert found == pytest.approx(figure["error"], abs=band)


def test_a_study_is_what_a_new_run_finds() -> None:
    """Errors within a tenth and the reference's uncertainty; speeds are another machine's."""
    check_again(CHEAP)


@pytest.mark.long
@pytest.mark.parametrize("name", scene_names())
def test_every_scene_has_a_current_study(name: str) -> None:
    """`pytest -m long test/studies/test_shipped_studies.py`, some ten minutes: before a release."""
    scene = load_scene(name)
    study = read_study(scene)
    assert study is not None
    assert study.age(scene) == ""
    check_again(name)
