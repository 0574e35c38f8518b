"""Choices of effects in a scene file, and effects that depend on others."""

from __future__ import annotations

from pathlib import Path

import pytest
from scene_text import GOOD

from rope_twin import load_scene
from rope_twin.effects import EFFECTS
from rope_twin.effects.waves import Jonswap, RegularWave, WavesParams
from rope_twin.errors import SceneError
from rope_twin.scene.rope_warnings import sense_checks

REFUSED = [
    ("wind: {velocity_m_per_s: [10.0, 0.0]}", "`wind` acts on the rope out of the water"),
    ("bed_friction: {}", "`bed_friction` acts on the seabed, which is not listed"),
    ("line_contact: {}", "`line_contact` acts between ropes, and this scene has one"),
    ("payload_contact: {bodies: [{name: payload, radius_m: 1.0}]}",
     "bodies lists 1; give at least two"),
    ("payload_contact: {bodies: [{name: a, radius_m: 1.0}, {name: a, radius_m: 2.0}]}",
     "bodies lists 'a' twice; list each once"),
    ("payload_contact: {bodies: [{name: a, radius_m: 1.0}, {name: b, radius_m: 2.0}]}",
     "`payload_contact` acts between payloads and joints, and this scene has one"),
    ("hull_contact: {boxes: []}", "boxes is empty; give one box at least"),
    ("hull_contact: {boxes: [{centre_m: [1.0, 0.0, -3.0], size_m: [4.0, 4.0, 8.0]}]}",
     "boxes[0] holds the hang-off; move its centre_m"),
    ("hull_contact: {boxes: [{centre_m: [9, 0, -9], size_m: [4, 4, 8], opening: true}]}",
     "boxes[0] is an opening beside the hang-off"),
    ("hull_contact: {payload_radius_m: 2.5, "
     "boxes: [{centre_m: [0.0, 0.0, -9.0], size_m: [4.0, 4.0, 8.0], opening: true}]}",
     "boxes[0] is an opening that the payload does not fit through"),
    ("depth_profiles: {}", "neither density_kg_per_m3 nor drag_factor; give one or both"),
    ("depth_profiles: {density_kg_per_m3: [[-9.0, 1025.0], [0.0, 1025.0]]}",
     "z = 0 m follows z = -9 m; order rows from the surface down"),
    ("depth_profiles: {drag_factor: [[3.0, 1.0]]}",
     "drag_factor: z = 3 m is outside the water; give 0 down to -12000 m"),
    ("depth_profiles: {density_kg_per_m3: [[0.0, 1.025]]}",
     "density_kg_per_m3: 1.025 at z = 0 m; give 900 to 1500 kg/m³"),
    ("depth_profiles: {drag_factor: [[0.0, 2.0]]}\n  - wake_oscillator: {}",
     "`depth_profiles` and `wake_oscillator`, whose water is the same all over"),
    ("depth_profiles: {density_kg_per_m3: [[0.0, 1020.0]]}\n  - fairing: {face_m2: 4.0}",
     "the water of `fairing` has one density, and `depth_profiles` another"),
    ("depth_profiles: {density_kg_per_m3: [[0.0, 1020.0]]}\n  - splash_zone: {height_m: 4.0}",
     "1020 kg/m³ at the top of `depth_profiles`, 1025 in `splash_zone`"),
    ("payload_oscillation: {size_m: [1.0, 1.0, 1.0]}",
     "neither drag nor added_mass; give rows [KC, factor] of one or both"),
    ("payload_oscillation: {size_m: [1.0, 1.0, 1.0], drag: [[3.0, 1.0], [2.0, 1.0]]}",
     "drag: Keulegan-Carpenter numbers are not ascending; order the rows"),
    ("payload_oscillation: {size_m: [1.0, 1.0, 1.0], added_mass: [[3.0, 1200.0]]}",
     "added_mass: a factor above 10; give factors on the payload's own figures"),
    ("payload_oscillation: {size_m: [1.0, 1.0, 1.0], drag: [[2.0, 1.5]]}\n"
     "  - splash_zone: {height_m: 4.0}",
     "`payload_oscillation` and `splash_zone` both change the figures of `payload`"),
    ("payload_oscillation: {size_m: [1.0, 1.0, 1.0], drag: [[2.0, 1.5]]}\n"
     "  - depth_profiles: {density_kg_per_m3: [[0.0, 1025.0]]}",
     "`payload_oscillation` knows one density of water, `depth_profiles` another"),
    ("modal_vibration: {lock_in: next}", "unknown lock_in 'next'; give one of nearest, strongest"),
    ("decomposed_force: {lock_in: next}", "unknown lock_in 'next'; give one of nearest, strongest"),
    ("travelling_waves: {initial_phase: odd}",
     "unknown initial_phase 'odd'; give one of standing, travelling"),
    ("waves: {regular: {height_m: 1.0, period_s: 8.0}, stretching: up}",
     "unknown stretching 'up'; give one of wheeler, none, linear"),
    ("waves: {regular: {height_m: 1.0, period_s: 8.0}, also: [{heading_deg: 10.0}]}",
     "0 sea states given; give one of regular, jonswap and measured"),
]  # fmt: skip
ACCEPTED = [
    "wetting: {}",
    "wetting: {}\n  - wind: {velocity_m_per_s: [10.0, 0.0]}",
    "payload_oscillation: {size_m: [3.0, 2.0, 1.5], drag: [[2.0, 1.5], [20.0, 1.0]]}",
    "depth_profiles: {density_kg_per_m3: [[0.0, 1025.0], [-900.0, 1030.0]]}",
    "depth_profiles: {density_kg_per_m3: [[0.0, 1025.0], [-900.0, 1030.0]], "
    "drag_factor: [[0.0, 1.4], [-30.0, 1.0]]}\n  - splash_zone: {height_m: 4.0}",
    "seabed: {depth_m: 2000.0}\n  - bed_friction: {axial: 0.3, lateral: 0.6, slip_m: 0.05}",
    "hull_contact: {boxes: [{centre_m: [0.0, 0.0, -9.0], size_m: [4.0, 4.0, 8.0], opening: true}, "
    "{centre_m: [30.0, 0.0, -9.0], size_m: [40.0, 20.0, 8.0]}], heading_deg: 40.0}",
    "modal_vibration: {lock_in: strongest, lift_factor: 0.5}",
    "strouhal_forcing: {fixed_lift: true}",
    "waves: {jonswap: {significant_height_m: 1.0, peak_period_s: 7.0}, stretching: linear, "
    "also: [{regular: {height_m: 1.0, period_s: 14.0, phase_deg: 90.0}, heading_deg: 90.0}]}",
]  # fmt: skip


def scene_with(effect: str, folder: Path) -> Path:
    """The good scene with one effect more, or two."""
    path = folder / "scene.yaml"
    path.write_text(GOOD.replace("  - weight: {}\n", f"  - weight: {{}}\n  - {effect}\n"))
    return path


@pytest.mark.parametrize(("effect", "words"), REFUSED)
def test_invalid_effect_choices_are_rejected(effect: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError) as refused:
        load_scene(str(scene_with(effect, tmp_path)))
    assert words in str(refused.value)


def test_wetting_needs_weight(tmp_path: Path) -> None:
    path = scene_with("wetting: {}", tmp_path)
    path.write_text(path.read_text().replace("  - weight: {}\n", ""))
    with pytest.raises(SceneError, match="`wetting` corrects the buoyancy of `weight`"):
        load_scene(str(path))


def test_payload_oscillation_needs_a_payload_with_one_set_of_figures(tmp_path: Path) -> None:
    own = "payload_oscillation: {size_m: [1.0, 1.0, 1.0], drag: [[2.0, 1.5]]}"
    path = scene_with(own, tmp_path)
    text = path.read_text()
    path.write_text(text.replace("  - payload: {}\n", ""))
    with pytest.raises(SceneError, match="corrects the loads of `payload`, which is not listed"):
        load_scene(str(path))
    rising = "    mass_kg: 20000.0\n    rising: {added_mass_kg: 9000.0, drag_area_m2: 3.0}\n"
    path.write_text(text.replace("    mass_kg: 20000.0\n", rising))
    with pytest.raises(SceneError, match="its figures differ in ascent"):
        load_scene(str(path))


def test_profiles_that_end_early_or_fall_with_depth_are_warned_of(tmp_path: Path) -> None:
    """One row is meant to be all over; the winch of the scene has 800 m."""
    own = (
        "depth_profiles: {density_kg_per_m3: [[0.0, 1025.0], [-500.0, RHO]], "
        "drag_factor: [[0.0, 1.2]]}"
    )
    results = []
    for rho in ("1028.0", "1021.0"):
        scene = load_scene(str(scene_with(own.replace("RHO", rho), tmp_path)))
        results.append([text for text in sense_checks(scene) if "depth_profiles" in text])
    (early,) = results[0]
    assert "below its row at z = -500 m the value there (1028) is used" in early
    assert "z = -800 m; add a row there" in early
    assert "1021 kg/m³ at z = -500 m lies below 1025 at z = 0 m" in results[1][1]


TABLE = "{roughness: 0.0001, rows: [[2.0, 0.8], [12.0, 1.6]]}"
ROUGH = "{roughness: 0.01, rows: [[2.0, 1.2], [12.0, 2.0]]}"
NUMBERS = [
    ("{tables: []}", "no tables; give at least one"),
    ("{tables: [{roughness: 0.01, rows: []}]}", "no rows; give at least one row [KC, factor]"),
    ("{tables: [{roughness: 0.01, rows: [[3.0, 1.0], [2.0, 1.0]]}]}",
     "Keulegan-Carpenter numbers are not ascending; order the rows"),
    (f"{{tables: [{ROUGH}, {TABLE}], roughness: 0.001}}",
     "the roughness of the tables is not ascending; order them"),
    (f"{{tables: [{TABLE}, {ROUGH}]}}", "no roughness of the rope; give one for the tables"),
    (f"{{tables: [{TABLE}, {ROUGH}], roughness: 0.02}}",
     "roughness 0.02 is outside the tables; give 0.0001 to 0.01"),
    (f"{{tables: [{TABLE}]}}, relative: false",
     "over_keulegan_carpenter and relative: false exclude each other; remove one"),
    (f"{{tables: [{TABLE}]}}}}\n  - wetting: {{",
     "over_keulegan_carpenter of `drag` and `wetting` both change the rope's drag"),
    (f"{{tables: [{TABLE}]}}}}\n  - strouhal_forcing: {{",
     "over_keulegan_carpenter of `drag` and `strouhal_forcing` both change the rope's drag"),
    (f"{{tables: [{TABLE}, {ROUGH}], roughness: 0.001, window_s: 90.0}}", ""),
]  # fmt: skip


@pytest.mark.parametrize(("given", "words"), NUMBERS)
def test_drag_over_keulegan_carpenter_numbers(given: str, words: str, tmp_path: Path) -> None:
    path = scene_with("added_mass: {}", tmp_path)
    old = "tangential: 0.02}"
    new = f"tangential: 0.02, over_keulegan_carpenter: {given}}}"
    path.write_text(path.read_text().replace(old, new))
    if not words:
        assert load_scene(str(path)).name == "scene"
        return
    with pytest.raises(SceneError) as refused:
        load_scene(str(path))
    assert words in str(refused.value)


PROFILES = "depth_profiles: {density_kg_per_m3: [[0.0, 1025.0]], drag_factor: [[0.0, 1.2]]}"
BESIDE = [
    ("  - weight: {}\n", "", "`depth_profiles` corrects the buoyancy of `weight`"),
    ("  - drag: {normal: 1.2, tangential: 0.02}\n", "", "scales the coefficients of `drag`"),
    ("tangential: 0.02}", "tangential: 0.02, over_reynolds: [[10000.0, 1.0]]}",
     "`depth_profiles` and `drag` both have a factor on the drag coefficient"),
    ("water_density_kg_per_m3: 1025.0", "water_density_kg_per_m3: 0.0",
     "a density over depth is relative to the scene's water, and there is none"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "words"), BESIDE)
def test_depth_profiles_need_other_effects(old: str, new: str, words: str, tmp_path: Path) -> None:
    path = scene_with(PROFILES, tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(SceneError) as refused:
        load_scene(str(path))
    assert words in str(refused.value)


@pytest.mark.parametrize("effect", ACCEPTED)
def test_valid_effect_choices_are_read(effect: str, tmp_path: Path) -> None:
    computed = load_scene(str(scene_with(effect, tmp_path)))
    names = {one.params: one.name for one in EFFECTS}
    assert effect.split(":")[0] in [names[type(params)] for params in computed.effects]


def test_studies_from_before_these_keys_stay_valid() -> None:
    """A digest is made of the words for a sea: keys that came later are there if they are used."""
    plain = WavesParams(jonswap=Jonswap(significant_height_m=1.0, peak_period_s=7.0))
    assert "also" not in repr(plain)
    assert "stretching" not in repr(plain)
    wave = RegularWave(height_m=1.0, period_s=8.0, phase_deg=10.0)
    assert "phase_deg=10.0" in repr(WavesParams(regular=wave, stretching="none"))
    assert "stretching='none'" in repr(WavesParams(regular=wave, stretching="none"))
