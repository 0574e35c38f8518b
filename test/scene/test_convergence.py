"""Reading a convergence study: the error of a setting, and when it is unknown."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest
from study_samples import UNCERTAINTY_PCT, error_pct, sample_study, studied_scene, write_study

from rope_twin.effects import EFFECTS
from rope_twin.errors import SceneError
from rope_twin.scene import convergence
from rope_twin.scene.convergence import known_error, read_study, solver_version
from rope_twin.scene.error_bound import RMS, format_bound
from rope_twin.scene.load import Change, change_scene, load_scene
from rope_twin.studies.driven_twin import variant


def test_a_studied_setting_has_the_error_of_its_row(tmp_path: Path) -> None:
    scene = studied_scene(tmp_path)
    computed = known_error(scene)
    assert computed.rms_pct == pytest.approx(error_pct(20, 0.01) + UNCERTAINTY_PCT)
    assert computed.peak_pct == pytest.approx(0.5 * error_pct(20, 0.01) + UNCERTAINTY_PCT)
    assert computed.words == "at most, in the study's run of 30 s"


@pytest.mark.parametrize(
    ("elements", "step_s", "worst"),
    [(30, 0.01, (20, 0.01)), (20, 0.015, (20, 0.02)), (11, 0.006, (10, 0.01))],
)
def test_between_studied_settings_the_largest_neighbour_holds(
    tmp_path: Path, elements: int, step_s: float, worst: tuple[int, float]
) -> None:
    """The true error lies below where the errors of a study fall as squares."""
    scene = variant(studied_scene(tmp_path), elements, step_s)
    computed = known_error(scene).rms_pct
    assert computed == pytest.approx(error_pct(*worst) + UNCERTAINTY_PCT)
    assert computed > error_pct(elements, step_s)


@pytest.mark.parametrize(("elements", "step_s"), [(9, 0.01), (20, 0.05), (60, 0.05)])
def test_settings_coarser_than_the_study_are_unknown(
    tmp_path: Path, elements: int, step_s: float
) -> None:
    computed = known_error(variant(studied_scene(tmp_path), elements, step_s))
    assert math.isnan(computed.rms_pct)
    assert computed.words == "unknown: this setting is not one of the convergence study"


def test_without_a_study_the_error_is_unknown(tmp_path: Path) -> None:
    scene = studied_scene(tmp_path)
    convergence.study_path(scene).unlink()
    assert read_study(scene) is None
    assert known_error(scene).words == "unknown: no study"
    assert math.isnan(known_error(scene).rms_pct)


def test_a_changed_scene_has_no_error(tmp_path: Path) -> None:
    """Neither in its file nor by a change in memory; words, elements and step do not count."""
    scene = studied_scene(tmp_path)
    heavier = change_scene(scene, [Change("payloads[0].mass_kg", 1.01, multiply=True)])
    assert known_error(heavier).words.startswith("unknown: the scene was changed")
    text = scene.path.read_text(encoding="utf-8")
    scene.path.write_text(text.replace("tangential: 0.03", "tangential: 0.04"), encoding="utf-8")
    assert math.isnan(known_error(load_scene(scene.path)).rms_pct)
    message = text.replace("about: 20 t", "about: some 20 t").replace(
        "elements: 20", "elements: 40"
    )
    scene.path.write_text(message, encoding="utf-8")
    assert known_error(load_scene(scene.path)).rms_pct < error_pct(20, 0.01)


def test_a_changed_solver_invalidates_the_study(tmp_path: Path) -> None:
    scene = studied_scene(tmp_path)
    write_study(scene, sample_study(scene) | {"solver": "0"})
    computed = read_study(scene)
    assert computed is not None
    assert (
        computed.age(scene)
        == "the convergence study is outdated: the solver was changed since it was made"
    )
    assert known_error(scene).words.startswith("unknown: the convergence study is outdated")


def test_only_listed_effects_invalidate_a_study(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bending is no effect of still_water's: another version of it leaves that study current."""
    assert solver_version(load_scene("still_water")) == "1"
    changed = tuple(
        dataclasses.replace(one, version=3) if one.name == "bending" else one for one in EFFECTS
    )
    monkeypatch.setattr(convergence, "EFFECTS", changed)
    assert solver_version(load_scene("still_water")) == "1"
    assert solver_version(load_scene("riser_300m")) == "1, bending 3"


def test_connections_have_a_version_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """A change of how ropes meet leaves the studies of single ropes current."""
    monkeypatch.setattr(convergence, "CONNECTIONS_VERSION", 2)
    assert solver_version(load_scene("two_line_lift")) == "1, connections 2"
    assert solver_version(load_scene("still_water")) == "1"


@pytest.mark.parametrize(
    ("bound", "reported"),
    [
        (0.0, "0"), (0.01, "0.01"), (0.0101, "0.011"), (9.99, "10"), (0.123, "0.13"), (5.0, "5"),
        (math.nan, "unknown"), (2.5e-7, "2.5e-07"), (121.0, "130"), (99.5, "100"),
    ],
)  # fmt: skip
def test_a_bound_is_rounded_up(bound: float, reported: str) -> None:
    assert format_bound(bound) == reported


def test_an_unconverged_quantity_is_unknown(tmp_path: Path) -> None:
    scene = studied_scene(tmp_path)
    content = sample_study(scene)
    for row in content["rows"]:
        row["figures"][RMS]["at_most"] = None
    write_study(scene, content)
    computed = known_error(scene)
    assert math.isnan(computed.rms_pct)
    assert computed.peak_pct > 0.0
    assert "does not converge" in computed.words


@pytest.mark.parametrize(
    "text", ["", "{", "[1, 2]", '{"format": 1}', '{"format": 99}', "\udcff"], ids=range(6)
)
def test_a_damaged_study_is_reported_in_one_sentence(tmp_path: Path, text: str) -> None:
    scene = studied_scene(tmp_path)
    convergence.study_path(scene).write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(SceneError, match=r"small\.json: .*; make it again with `rope_twin acc"):
        read_study(scene)
    assert known_error(scene).words.startswith("unknown: ")
