"""Choices of effects in a scene file, and effects that act beside others only."""

from __future__ import annotations

from pathlib import Path

import pytest
from scene_text import GOOD

from rope_twin import load_scene
from rope_twin.effects import EFFECTS
from rope_twin.effects.waves import Jonswap, RegularWave, WavesParams
from rope_twin.errors import SceneError

REFUSED = [
    ("wind: {velocity_m_per_s: [10.0, 0.0]}", "`wind` acts on the rope out of the water"),
    ("bed_friction: {}", "`bed_friction` acts on the seabed, which is not listed"),
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
    "seabed: {depth_m: 2000.0}\n  - bed_friction: {axial: 0.3, lateral: 0.6, slip_m: 0.05}",
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
def test_what_cannot_be_gets_its_sentence(effect: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError) as refused:
        load_scene(str(scene_with(effect, tmp_path)))
    assert words in str(refused.value)


def test_wetting_needs_weight(tmp_path: Path) -> None:
    path = scene_with("wetting: {}", tmp_path)
    path.write_text(path.read_text().replace("  - weight: {}\n", ""))
    with pytest.raises(SceneError, match="`wetting` corrects the buoyancy of `weight`"):
        load_scene(str(path))


@pytest.mark.parametrize("effect", ACCEPTED)
def test_what_can_be_is_read(effect: str, tmp_path: Path) -> None:
    found = load_scene(str(scene_with(effect, tmp_path)))
    names = {one.params: one.name for one in EFFECTS}
    assert effect.split(":")[0] in [names[type(params)] for params in found.effects]


def test_studies_from_before_these_keys_stay_valid() -> None:
    """A digest is made of the words for a sea: keys that came later are there if they are used."""
    plain = WavesParams(jonswap=Jonswap(significant_height_m=1.0, peak_period_s=7.0))
    assert "also" not in repr(plain)
    assert "stretching" not in repr(plain)
    wave = RegularWave(height_m=1.0, period_s=8.0, phase_deg=10.0)
    assert "phase_deg=10.0" in repr(WavesParams(regular=wave, stretching="none"))
    assert "stretching='none'" in repr(WavesParams(regular=wave, stretching="none"))
