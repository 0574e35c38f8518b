"""The reported keys of a scene file: those that are read, with their meaning."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from rope_twin.cli import main
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.scene.reference import scene_keys

KNOWN = {key.path: key for key in scene_keys()}


def paths_in(value: object, path: str = "") -> set[str]:
    """Return the paths of all keys below a value as YAML reads it."""
    found: set[str] = set()
    if isinstance(value, dict):
        for name, child in value.items():
            at = f"{path}.{name}" if path else str(name)
            found |= {at} | paths_in(child, at)
    elif isinstance(value, list):
        for child in value:
            found |= paths_in(child, f"{path}[]")
    return found


@pytest.mark.parametrize("name", scene_names())
def test_every_key_of_a_scene_is_reported(name: str) -> None:
    document = yaml.safe_load(load_scene(name).path.read_text(encoding="utf-8"))
    paths = {
        re.sub(r"^hang_offs\[\]\.winch\.", "winch.", path)
        .replace("ropes[].sections[].rope.", "ropes[].rope.")
        .replace("nets[].damping.", "ropes[].damping.")
        for path in paths_in(document)
    }
    assert paths <= set(KNOWN)


def test_each_key_has_a_meaning_and_a_unique_path() -> None:
    assert all(key.meaning and key.wants for key in KNOWN.values())
    assert len(KNOWN) == len(scene_keys())
    drum = KNOWN["winch.drum.turns_per_layer"]
    assert (drum.wants, drum.range, drum.default) == ("number", "1 to 1000", None)
    assert KNOWN["hang_offs[].winch"].wants == "mapping as winch"
    assert KNOWN["effects[].waves.components"].default == "200"
    assert KNOWN["ropes[].fixed_at_m"].wants == "3 numbers"
    assert KNOWN["effects[].current.over_time"].wants == "rows of 2 numbers"


def test_missing_required_keys_are_rejected(tmp_path: Path) -> None:
    """`needed` is what the reader asks for: a time without its step."""
    assert KNOWN["time.step_s"].default is None
    text = load_scene("still_water").path.read_text(encoding="utf-8")
    scene = tmp_path / "scene.yaml"
    scene.write_text(re.sub(r"^time:.*$", "time: {}", text, flags=re.MULTILINE), encoding="utf-8")
    with pytest.raises(Exception, match="step_s missing"):
        load_scene(scene)


def test_a_part_of_the_keys_is_shown(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    assert main(["scene", "keys", "winch.drum"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert (
        lines[1]
        == "winch.drum.core_radius_m: radius of the bare drum, r_0 (number, 0.05 to 10 m, needed)"
    )
    assert len(lines) == 4


def test_a_path_is_found_as_messages_and_studies_write_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for path in ("payloads[0].mass_kg", "payloads[].mass_kg", "effects.added_mass.tangential"):
        assert main(["scene", "keys", path]) == 0
    lines = capsys.readouterr().out.splitlines()
    computed = [line.partition(":")[0] for line in lines if line[0] != " "]
    assert computed == [*["payloads[].mass_kg"] * 2, "effects[].added_mass.tangential"]


def test_an_unknown_part_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scene", "keys", "drumm"]) == 1
    assert capsys.readouterr().err.strip().endswith("did you mean 'drum'?")


def test_keys_by_python_dash_m() -> None:
    reported = subprocess.run(
        [sys.executable, "-m", "rope_twin", "scene", "keys", "time.step_s"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert reported.stdout == "time.step_s: time step (number, 1e-05 to 0.2 s, needed)\n"
