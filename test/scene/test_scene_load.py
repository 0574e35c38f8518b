"""Valid scenes: every value is read, and the shipped scenes are valid."""

import hashlib
from pathlib import Path

import pytest
from scene_text import GOOD, spoilt, written

from rope_twin.effects import EFFECTS
from rope_twin.errors import SceneError
from rope_twin.scene.lift import lift_figures, listed_effects
from rope_twin.scene.load import load_scene, rope_preset, scene_names
from rope_twin.scene.rope_warnings import accepted_warnings, sense_checks
from rope_twin.scene.schema import Rope, ScheduleRow, SeaState
from rope_twin.scene.shapes import Box, Cylinder, Sphere

SHIPPED = {"deep_lift", "shallow_lift", "hmpe_lift", "storm", "still_water"}
ACCEPTED = {  # warnings that a shipped scene accepts, each with its reason
    "smooth_5km": ("without damping",),  # as the solver study had them
    "slack_5km": ("without damping",),
    "snap_vertical": ("expect a slack rope",),  # what they are for
    "snap_2km": ("expect a slack rope",),
    "splash_zone": ("rope's own axial wave", "vertical added mass"),
    "two_line_landing": ("rope's own axial wave", "vertical added mass"),
    "lift_off": ("bring no accuracy",),  # 21 m in blows: 0.5 m is too coarse for what they leave
    "manifold_lift": ("rope's own axial wave", "vertical added mass"),
    "net_wall": ("rope's own axial wave",),
    "net_screen": ("rope's own axial wave", "first axial period"),
    "cage_and_clump": ("rope's own axial wave",),
    "two_line_ascent": ("rope's own axial wave", "first axial period", "coarse for vortices"),
}


def test_every_value_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD)
    scene = load_scene(path)
    assert (scene.name, scene.path) == ("scene", path)
    assert scene.digest == hashlib.sha256(GOOD.encode()).hexdigest()
    assert (scene.about, scene.source, scene.look_at) == ("a good scene", "made up", "nothing")
    (line,) = scene.ropes
    assert line.rope == rope_preset("steel_wire_40mm")
    assert (line.name, line.length_m, line.elements, line.to) == ("hoist", 500.0, 50, "tool")
    assert line.damping.fraction_of_first_axial_mode == 0.02
    (payload,) = scene.payloads
    assert payload.shape == Box(length_m=3.0, width_m=2.0, height_m=1.5)
    assert scene.winch is not None
    assert scene.winch.schedule == (
        ScheduleRow(at_s=0.0, speed_m_per_s=0.5),
        ScheduleRow(at_s=20.0, speed_m_per_s=-0.5),
    )
    assert scene.sea_state == SeaState(start_s=10.0)
    assert scene.time.newton_tolerance_n == 100.0


def test_effects_are_in_the_order_of_the_table(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, GOOD))  # listed in reverse order
    order = [effect.params for effect in EFFECTS]
    computed = [order.index(type(params)) for params in scene.effects]
    assert computed == sorted(computed)
    assert listed_effects(scene)["current"].profile == ((0.0, (0.5, 0.0)), (-900.0, (0.1, 0.05)))
    assert listed_effects(scene)["drag"].tangential == 0.02


def test_omitted_values_have_defaults(tmp_path: Path) -> None:
    text = GOOD.replace(GOOD[GOOD.index("winch:") : GOOD.index("effects:")], "")
    scene = load_scene(written(tmp_path, text))
    assert scene.winch is None
    assert scene.sea_state.bag == ""
    assert scene.environment.water_density_kg_per_m3 == 1025.0
    assert scene.ship.hang_off_m == (0.0, 0.0, 0.0)


def test_integers_are_numbers_and_text_may_be_folded(tmp_path: Path) -> None:
    text = spoilt("length_m: 500.0", "length_m: 500").replace(
        "source: made up", "source: >\n  made\n  up"
    )
    scene = load_scene(written(tmp_path, text))
    assert type(scene.ropes[0].length_m) is float
    assert scene.source == "made up"


def test_rope_may_be_written_out(tmp_path: Path) -> None:
    figures = (
        "{diameter_m: 0.05, mass_kg_per_m: 9.9, hydrodynamic_diameter_m: 0.04,"
        " axial_stiffness_n: 1.0e+8, breaking_load_n: 1.5e+6}"
    )
    scene = load_scene(written(tmp_path, spoilt("steel_wire_40mm", figures)))
    assert scene.ropes[0].rope == Rope(
        diameter_m=0.05,
        mass_kg_per_m=9.9,
        hydrodynamic_diameter_m=0.04,
        axial_stiffness_n=1e8,
        breaking_load_n=1.5e6,
    )


@pytest.mark.parametrize(
    ("words", "shape"),
    [
        ("cylinder: {diameter_m: 5, height_m: 8.5}", Cylinder(diameter_m=5.0, height_m=8.5)),
        ("sphere: {diameter_m: 2.0}", Sphere(diameter_m=2.0)),
    ],
)
def test_other_shapes(words: str, shape: Cylinder | Sphere, tmp_path: Path) -> None:
    text = spoilt("{box: {length_m: 3.0, width_m: 2.0, height_m: 1.5}}", f"{{{words}}}")
    assert load_scene(written(tmp_path, text)).payloads[0].shape == shape


def test_fixed_lower_end(tmp_path: Path) -> None:
    text = spoilt("    to: tool\n", "    fixed_at_m: [10.0, 0.0, -480.0]\n")
    text = text.replace(text[text.index("payloads:") : text.index("winch:")], "")
    scene = load_scene(written(tmp_path, text.replace("  - payload: {}\n", "")))
    assert scene.ropes[0].fixed_at_m == (10.0, 0.0, -480.0)
    assert lift_figures(scene).payload is None


def test_bag_path_is_relative_to_the_scene(tmp_path: Path) -> None:
    (tmp_path / "mine" / "bag").mkdir(parents=True)
    folder = tmp_path / "scenes"
    folder.mkdir()
    scene = load_scene(written(folder, spoilt("{start_s", "{bag: ../mine/bag, start_s")))
    assert Path(scene.sea_state.bag) == (tmp_path / "mine" / "bag").resolve()


def test_the_same_text_gives_the_same_scene(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD)
    assert load_scene(path) == load_scene(str(path))


def test_shipped_scenes_are_listed() -> None:
    assert set(scene_names()) >= SHIPPED
    assert scene_names() == sorted(scene_names())


@pytest.mark.parametrize("name", scene_names())
def test_every_shipped_scene_is_valid(name: str) -> None:
    scene = load_scene(name)
    assert scene.name == name
    assert scene.about
    assert scene.source
    assert scene.look_at
    longest = 0.02 if name == "two_line_14km" else 0.01  # the step that its speed is asked for at
    assert scene.time.step_s <= longest
    assert sense_checks(scene) == []
    accepted, idle = accepted_warnings(scene)
    assert idle == []
    assert len(accepted) == len(ACCEPTED.get(name, ()))
    for words in ACCEPTED.get(name, ()):
        assert sum(words in warning for warning in accepted) == 1


def test_deep_lift_has_the_documented_values() -> None:
    scene = load_scene("deep_lift")
    (line,) = scene.ropes
    assert (line.length_m, line.elements, line.rope.diameter_m) == (3000.0, 100, 0.04)
    assert scene.payloads[0].mass_kg == 20000.0
    assert scene.sea_state.bag == "sea_2p5m"
    assert scene.winch is not None
    speeds = [row.speed_m_per_s for row in scene.winch.schedule if row.at_s < 50.0]
    assert max(speeds) > 0.0 > min(speeds)
    assert 0.0 in speeds


def test_an_invalid_effect_reports_its_check(tmp_path: Path) -> None:
    text = spoilt("[-900.0, [0.1, 0.05]]", "[-900.0, [99.0, 0.05]]")
    with pytest.raises(SceneError, match=r"effects\[2\]\.current: 99 m/s is not a plausible"):
        load_scene(written(tmp_path, text))
