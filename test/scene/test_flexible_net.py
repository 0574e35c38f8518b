"""Flexible nets between ropes: mesh, stiffness, shared ropes and refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

from rope_twin import load_scene
from rope_twin.effects.net_curtain import NetCurtainParams
from rope_twin.errors import SceneError
from rope_twin.scene.rigging import panels_beside
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import Scene

NET = (
    "{name: wall, between: [left, right], from_m: 2.0, to_m: 8.0, width_m: 6.0, columns: 3, "
    "rows: 2, twine_m: 0.003, bar_m: 0.03, twine_kg_per_m3: 950.0, twine_stiffness_n: 4.0e+3, "
    "twine_breaking_load_n: 400.0, damping: {newton_seconds: 2.0e+3}}"
)
UPPER = NET.replace("name: wall", "name: hem").replace(
    "from_m: 2.0, to_m: 8.0", "from_m: 8.0, to_m: 10.0"
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


BESIDE = (
    UPPER.replace("[left, right]", "[right, far]")
    .replace("from_m: 8.0", "from_m: 5.0")
    .replace("bar_m: 0.03", "bar_m: 0.05")
)


def test_adjacent_nets_share_the_rope_between_them(tmp_path: Path) -> None:
    """It is divided at 2, 5, 7.5, 8 and 10 m: at 5 m both have a level, and one connection."""
    third = (
        f"  - {{name: far, {LINE}, from: top_far, to: sinker_far}}\n",
        "  - {name: sinker_far, mass_kg: 2000.0, shape: {sphere: {diameter_m: 0.8}}}\n",
        "hang_offs: [{name: top_far, at_m: [0.0, 12.0, -5.0]}, ",
    )
    text = TEXT.replace(f"  - {NET}\n", f"  - {NET}\n  - {BESIDE}\n")
    text = text.replace("nets:\n", f"{third[0]}nets:\n").replace("hang_offs: [", third[2])
    scene = scene_of(text.replace("payloads:\n", f"payloads:\n{third[1]}"), tmp_path)
    parts = {line.name: line for line in scene.ropes}
    shared = [parts[f"right_{k}"] for k in range(4)]
    assert [part.length_m for part in shared] == pytest.approx([3.0, 2.5, 0.5, 2.0])
    assert parts["right"].length_m + parts["right_below"].length_m == pytest.approx(4.0)
    meeting = "wall_right_1"
    assert (shared[0].from_, shared[1].to) == (meeting, meeting)
    assert parts["wall_level_1_2"].to == meeting
    assert parts["hem_level_0_0"].from_ == meeting
    assert len(scene.joints) == 3 + 2 * 3 + 5 + 2 * 3 + 3  # left, inner, right, inner, far
    panels = scene.listed(NetCurtainParams)
    assert panels is not None
    assert panels_beside(parts["wall_level_0_0"], panels) == panels
    own = panels_beside(parts["hem_level_0_0"], panels)
    assert (own.to_m, own.width_m, own.bar_m) == (2.0, 2.5, 0.05)
    assert len(panels.between) == 2 * 3 * 2
    assert [pair for pair in panels.between if pair in own.between] == list(own.between)


def test_the_winch_of_a_rope_with_a_net_counts_from_its_upper_edge(tmp_path: Path) -> None:
    winch = (
        "winch: {speed_limit_m_per_s: 1.0, acceleration_limit_m_per_s2: 1.0, min_line_out_m: 9.5,"
        " max_line_out_m: 20.0, schedule: [{at_s: 1.0, line_out_m: 14.0}]}\n"
    )
    scene = scene_of(TEXT.replace("time: {", f"{winch}time: {{"), tmp_path)
    own = scene.winch
    assert own is not None
    assert (own.min_line_out_m, own.max_line_out_m) == (1.5, 12.0)
    assert [row.line_out_m for row in own.schedule] == [6.0]
    assert scene.ropes[0].length_m == 4.0


def test_panel_borders_are_exempt_from_rope_warnings(tmp_path: Path) -> None:
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
        (f"  - {NET}\n", f"  - {NET}\n  - {NET}\n", "'wall' is the name of another net"),
        (f"  - {NET}\n", f"  - {NET}\n  - {UPPER.replace('from_m: 8.0', 'from_m: 7.0')}\n",
         "nets[1].between: it and 'wall' hang between the same ropes at the same height"),
        (f"  - {NET}\n", f"  - {NET}\n  - {UPPER.replace('from_m: 8.0', 'from_m: 8.3')}\n",
         "on 'left' a level at 8.3 m is close to one of 'wall' at 8 m"),
        ("name: left, rope: steel_wire_40mm",
         "name: left, sections: [{rope: steel_wire_40mm}]", "'left' has sections or a grading"),
        ("time: {", "winch: {speed_limit_m_per_s: 1.0, acceleration_limit_m_per_s2: 1.0, "
         "min_line_out_m: 8.5, max_line_out_m: 20.0}\ntime: {",
         "of which its winch may leave no more than 8.5 m out; raise min_line_out_m to 9 m"),
        ("time: {", "winch: {speed_limit_m_per_s: 1.0, acceleration_limit_m_per_s2: 1.0, "
         "min_line_out_m: 9.0, max_line_out_m: 20.0, follows: measured}\ntime: {",
         "the winch of 'left' follows a measured line out, which no net divides"),
        ("time: {", "winch: {speed_limit_m_per_s: 1.0, acceleration_limit_m_per_s2: 1.0, "
         "min_line_out_m: 13.0, max_line_out_m: 20.0}\ntime: {",
         "ropes[0].length_m: 12 m is outside the winch's 13 to 20 m"),
        ("from_m: 2.0, ", "", None),
        ("from_m: 2.0, to_m: 8.0", "to_m: 8.0", None),
    ],
)  # fmt: skip
def test_invalid_flexible_nets_are_rejected(
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
