"""Flexible nets between ropes: what they are made of, and what a scene may not ask for."""

from __future__ import annotations

from pathlib import Path

import pytest

from rope_twin import load_scene
from rope_twin.effects.net_curtain import NetCurtainParams
from rope_twin.errors import SceneError
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import Scene

NET = (
    "{name: wall, between: [left, right], from_m: 2.0, to_m: 8.0, width_m: 6.0, columns: 3, "
    "rows: 2, twine_m: 0.003, bar_m: 0.03, twine_kg_per_m3: 950.0, twine_stiffness_n: 4.0e+3, "
    "twine_breaking_load_n: 400.0, damping: {newton_seconds: 2.0e+3}}"
)
LINE = "rope: steel_wire_40mm, damping: {newton_seconds: 2.0e+5}, length_m: 12.0, elements: 12"
TEXT = f"""about: a net between two lines
source: made up for a test
look_at: nothing
ropes:
  - {{name: left, {LINE}, to: sinker_left}}
  - {{name: right, {LINE}, from: top_right, to: sinker_right}}
nets:
  - {NET}
payloads:
  - {{name: sinker_left, mass_kg: 2000.0, shape: {{sphere: {{diameter_m: 0.8}}}}}}
  - {{name: sinker_right, mass_kg: 2000.0, shape: {{sphere: {{diameter_m: 0.8}}}}}}
hang_offs: [{{name: top_right, at_m: [0.0, 6.0, -5.0]}}]
ship: {{hang_off_m: [0.0, 0.0, -5.0], motion_ramp_s: 0.0}}
effects:
  - current: {{profile: [[0.0, [0.5, 0.0]]]}}
  - weight: {{}}
  - drag: {{normal: 1.2, tangential: 0.02}}
  - added_mass: {{normal: 1.0}}
  - payload: {{}}
time: {{step_s: 0.01}}
"""


def scene_of(text: str, folder: Path) -> Scene:
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(str(path))


def test_a_net_is_a_grid_of_ropes_with_the_stiffness_of_its_twines(tmp_path: Path) -> None:
    """Two of three columns' borders are inner ones; every twine is in a border, or half."""
    scene = scene_of(TEXT, tmp_path)
    assert scene.nets == ()
    lengths: dict[str, float] = {line.name: line.length_m for line in scene.ropes}
    for side in ("left", "right"):
        parts = [name for name in lengths if name == side or name.startswith(f"{side}_")]
        assert len(parts) == 4  # above, two beside the net, below
        assert sum(lengths[name] for name in parts) == pytest.approx(12.0)
    assert len(scene.joints) == 4 * 3
    upright = [line for line in scene.ropes if "_row_" in line.name]
    across = [line for line in scene.ropes if "_level_" in line.name]
    assert len(upright) == 2 * 2
    assert len(across) == 3 * 3
    assert sum(lengths[line.name] for line in across[:3]) == pytest.approx(2.0 * 3)
    stiffness = [line.rope.axial_stiffness_n for line in across if line.rope is not None]
    twines = 6.0 / 0.03  # across, in the height of the net; three columns of them
    assert sum(value or 0.0 for value in stiffness) == pytest.approx(3.0 * twines * 4e3)
    panels = scene.listed(NetCurtainParams)
    assert panels is not None
    assert (panels.to_m, panels.width_m) == (2.0, 3.0)
    assert len(panels.between) == 3 * 2
    area = panels.to_m * panels.width_m * len(panels.between)
    assert area == pytest.approx(6.0 * 6.0)


def test_borders_of_panels_are_no_ropes_to_be_warned_of(tmp_path: Path) -> None:
    """They are light, stiff and without drag by design; the lines that hold the net stay judged."""
    scene = scene_of(TEXT, tmp_path)
    about = {warning.split(":")[0].split(".")[0] for warning in sense_checks(scene)}
    assert about == {"effects current", "time"}
    soft = scene_of(TEXT.replace("2.0e+5", "2.0e+7"), tmp_path)
    about = {warning.split(":")[0].split(".")[0] for warning in sense_checks(soft)}
    assert about == {"effects current", "time", "ropes[0]", "ropes[1]"}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[left, right]", "[left, rihgt]", "nets[0].between: there is no rope 'rihgt'"),
        ("[left, right]", "[left]", "nets[0].between: it names no two different ropes"),
        ("to_m: 8.0", "to_m: 12.0", "the net reaches 12 m up 'left' of 12 m"),
        ("from_m: 2.0", "from_m: 9.0", "from 9 m up to 8 m; give from_m below to_m"),
        ("bar_m: 0.03", "bar_m: 0.003", "leaves no mesh between knots"),
        ("  - payload: {}\n", "  - payload: {}\n  - net_curtain: {to_m: 3.0, width_m: 1.0, "
         "twine_m: 0.003, bar_m: 0.03}\n", "`nets` brings its own panels"),
        (f"  - {NET}\n", f"  - {NET}\n  - {NET}\n", "a second net; keep one"),
        ("name: left, rope: steel_wire_40mm",
         "name: left, sections: [{rope: steel_wire_40mm}]", "'left' has sections or a grading"),
        ("time: {", "winch: {speed_limit_m_per_s: 1.0, acceleration_limit_m_per_s2: 1.0, "
         "least_line_out_m: 9.0, most_line_out_m: 20.0}\ntime: {", "'left' comes from a winch"),
        ("from_m: 2.0, ", "", None),
        ("from_m: 2.0, to_m: 8.0", "to_m: 8.0", None),
    ],
)  # fmt: skip
def test_a_net_that_cannot_hang_gets_its_sentence(
    old: str, new: str, words: str | None, tmp_path: Path
) -> None:
    text = TEXT.replace(old, new, 1)
    assert text != TEXT
    if words is None:
        assert scene_of(text, tmp_path).joints
        return
    with pytest.raises(SceneError) as refused:
        scene_of(text, tmp_path)
    assert words in str(refused.value)
