"""`rope_twin scene raos`: what a file means, in this package's conventions."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import rao_samples as samples

from rope_twin.cli import ExitCode, main


@pytest.fixture
def vessel(tmp_path: Path) -> Path:
    path = tmp_path / "vessel.yml"
    model = samples.orcaflex_model(samples.box(), None, (2.5, 0.0, -1.9))
    path.write_text(samples.orcaflex_text(model))
    return path


def test_json_has_the_motion_of_the_crane_tip(
    vessel: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Modulus and phase of heave at (x, y): heave + y·roll - x·pitch of the closed form."""
    tip = ["--crane-tip", "10", "-18", "24"]
    assert main(["scene", "raos", str(vessel), *tip, "--heading", "135", "-45", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["heading_deg"] == [135.0, -45.0]
    assert shown["point_m"] == [10.0, -18.0, 24.0]
    assert shown["phase_origin_m"] == [0.0, 0.0, 0.0]
    assert shown["warnings"] == []
    f = 1.0 / np.array(shown["period_s"])
    for k, degrees in enumerate(shown["heading_deg"]):
        _, _, heave, roll, pitch, _ = samples.box().at(f, np.full(len(f), np.radians(degrees)))
        lead = np.radians(shown["phase_deg"][2][k])
        found = np.array(shown["modulus"][2][k]) * np.exp(1j * lead)
        assert found == pytest.approx(heave - 18.0 * roll - 10.0 * pitch, abs=1e-9)


def test_the_table_names_the_points_and_warns(
    vessel: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scene", "raos", str(vessel)]) == 0
    shown = capsys.readouterr().out
    assert "phases          relative to the crest at [0, 0, 0] m" in shown
    assert "heading 180° (0: following seas" in shown
    assert "  0.999   -1°  " in shown  # heave of the longest wave
    assert "warning" not in shown
    text = vessel.read_text()
    vessel.write_text(text.replace("RAOPhaseConvention: lags", "RAOPhaseConvention: leads"))
    assert main(["scene", "raos", str(vessel)]) == 0
    assert "pitch is" in capsys.readouterr().out


def test_a_picture_is_drawn(vessel: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "raos.png"
    assert main(["scene", "raos", str(vessel), "--picture", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["scene", "raos", str(vessel), "--picture", str(tmp_path / "raos.txt")]) == 1


def test_a_scene_shows_the_raos_that_it_rides_on(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scene", "raos", "ship_6dof", "--heading", "90"]) == 0
    assert "vessel_120m.csv" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("deep_lift", "its ship is not moved by a table of RAOs"),
        ("ship_6dof --symmetry none", "a scene states the conventions of its own file"),
        ("vessel_120m --crane-tip 1 2 3", "its RAOs are those of a point that is not stated"),
        ("vessel_120m --heading nan", "--heading: it is nan°; give degrees within ±360"),
        ("vessel_120m --heading 900", "--heading: it is 900°; give degrees within ±360"),
        ("vessel_120n", "did you mean 'vessel_120m'?"),
    ],
)
def test_what_cannot_be_shown_is_one_sentence(
    words: str, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scene", "raos", *words.split()]) == ExitCode.ERROR
    said = capsys.readouterr().err
    assert fault in said
    assert said.count("\n") == 1


def test_a_table_without_its_point_asks_for_the_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scene", "raos", "vessel_120m", "--crane-tip", "0", "0", "5"]) == ExitCode.ERROR
    assert "point that is not stated; give `origin_m`, or the option --origin." in (
        capsys.readouterr().err
    )
