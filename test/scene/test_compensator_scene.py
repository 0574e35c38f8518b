"""Scenes with a heave compensator: what fits together, and what is unlikely."""

from __future__ import annotations

from pathlib import Path

import pytest

from rope_twin import load_scene
from rope_twin.errors import SceneError
from rope_twin.files import share_dir
from rope_twin.scene.rope_warnings import sense_checks

SCENE = (share_dir() / "config" / "scenes" / "passive_lift.yaml").read_text(encoding="utf-8")
UNIT = SCENE[SCENE.index("  - name: hoist") : SCENE.index("      - {rope: steel_wire_40mm}")]
LOAD = SCENE[SCENE.index("    to: module") : SCENE.index("winch:")]
ONE_SECTION = "  - name: hoist\n    rope: steel_wire_40mm\n"
REFUSED = [
    (UNIT + "      - {rope: steel_wire_40mm}\n", ONE_SECTION,
     "`compensator` is the rope's lowest section, and it has one"),
    ("min_line_out_m: 100.0", "min_line_out_m: 10.0",
     "10 m hauls the compensator of 8 m in; give at least twice its length, 16 m"),
    ("  - weight: {}\n", "  - weight: {}\n  - bending: {stiffness_n_m2: 1.0e+4}\n",
     "`bending` acts on the whole rope, and its lowest section is a compensator"),
    ("  - weight: {}\n", "  - weight: {}\n  - wake_oscillator: {}\n",
     "`wake_oscillator` acts on the whole rope"),
    ("gas_volume_m3: 1.0", "gas_volume_m3: 0.05",
     "gas_volume_m3 is 0.05 m³ at mid stroke and half the stroke sweeps 0.05025 m³"),
]  # fmt: skip


def changed(old: str, new: str, folder: Path) -> str:
    """Return the path of the shipped scene with one change."""
    assert old in SCENE
    path = folder / "scene.yaml"
    path.write_text(SCENE.replace(old, new), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(("old", "new", "words"), REFUSED)
def test_invalid_compensators_are_rejected(old: str, new: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError) as refused:
        load_scene(changed(old, new, tmp_path))
    assert words in str(refused.value)


def test_a_compensator_on_a_fixed_end_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    fixed = SCENE.replace(LOAD, "    fixed_at_m: [0.0, 0.0, -3000.0]\n\n")
    path.write_text(fixed.replace("  - payload: {}\n", ""), encoding="utf-8")
    with pytest.raises(SceneError, match="`compensator` carries a payload, and this end is fixed"):
        load_scene(str(path))


@pytest.mark.parametrize(
    ("pressure", "side", "right"),
    [("12.0e+6", "retracted", "7.92e+06 Pa"), ("5.0e+6", "extended", "7.92e+06 Pa")],
)
def test_a_static_load_at_a_stop_is_a_warning(
    pressure: str, side: str, right: str, tmp_path: Path
) -> None:
    """The gas pressure that holds it at mid stroke is the remedy."""
    path = changed("gas_pressure_pa: 7.92e+6", f"gas_pressure_pa: {pressure}", tmp_path)
    (warning,) = [one for one in sense_checks(load_scene(path)) if "compensator" in one]
    assert f"159 kN of static load leave it {side}" in warning
    assert right in warning
    assert not [one for one in sense_checks(load_scene("passive_lift")) if "compensator" in one]
