"""Rope presets against the values that their sources quote."""

from math import pi
from pathlib import Path

import pytest

from rope_twin.errors import SceneError
from rope_twin.scene.load import rope_preset, rope_presets
from rope_twin.scene.schema import Rope


def in_water(rope: Rope) -> float:
    """Submerged mass per metre in sea water [kg/m]."""
    return rope.mass_kg_per_m - 1025.0 * 0.25 * pi * rope.hydrodynamic_diameter_m**2


# preset: nominal diameter [m], mass [kg/m], mass in water, EA [MN], breaking load [kN]
QUOTED = {
    "hmpe_76mm": (0.0762, 2.88, -0.15, 206.0, 3650.0),
    "hmpe_25mm": (0.0254, 0.320, None, 21.7, 385.0),
    "steel_wire_76mm": (0.0762, 23.2, 20.2, 235.0, None),
    "whoi_cable_17mm": (0.0173, 1.12, None, 12.72, 205.0),
}


@pytest.mark.parametrize("name", QUOTED)
def test_presets_have_the_quoted_values(name: str) -> None:
    diameter, mass, submerged, stiffness, breaking = QUOTED[name]
    rope = rope_preset(name)
    assert rope.diameter_m == diameter
    assert rope.mass_kg_per_m == pytest.approx(mass, rel=2.5e-3)
    assert rope.axial_stiffness_n == pytest.approx(1e6 * stiffness, rel=2.5e-3)
    if submerged is not None:
        assert in_water(rope) == pytest.approx(submerged, abs=0.03)
    if breaking is not None:
        assert rope.breaking_load_n == pytest.approx(1e3 * breaking, rel=2.5e-3)


def test_hmpe_displaces_more_water_than_its_own_mass() -> None:
    rope = rope_preset("hmpe_76mm")
    assert 1.05 <= (rope.mass_kg_per_m - in_water(rope)) / rope.mass_kg_per_m <= 1.62


def test_steel_wire_40mm_by_hand_calculation() -> None:
    rope = rope_preset("steel_wire_40mm")
    assert rope.mass_kg_per_m == pytest.approx(3989.7 * 0.0016)
    assert rope.axial_stiffness_n == pytest.approx(64.64e6)
    assert rope.breaking_load_n == pytest.approx(1.01344e6)
    assert rope.hydrodynamic_diameter_m == pytest.approx(0.032)


def test_polyester_by_hand_calculation() -> None:
    rope = rope_preset("polyester_100mm")
    assert rope.axial_stiffness_n == pytest.approx(14.0 * rope.breaking_load_n)
    assert rope.mass_kg_per_m == pytest.approx(6.7875)
    assert rope.hydrodynamic_diameter_m == pytest.approx(0.079, rel=5e-3)


def test_submerged_weight_of_the_measured_cable() -> None:
    assert 9.80665 * in_water(rope_preset("whoi_cable_17mm")) == pytest.approx(8.89, rel=0.035)


def test_every_preset_has_a_description_and_source() -> None:
    presets = rope_presets()
    assert len(presets) >= 6
    for rope in presets.values():
        assert rope.about
        assert rope.source


def test_an_unknown_preset_is_rejected() -> None:
    for name in ("hpme_76mm", "steel_wire_52", "steel_wire_052.mm", "whoi_cable_18mm"):
        with pytest.raises(SceneError, match=rf"named '{name}'; .*steel_wire_52mm.*hmpe_76mm"):
            rope_preset(name)
    for name in ("steel_wire_7mm", "chain_201mm"):
        with pytest.raises(SceneError, match="out of the range of figures by diameter, 8 to 200"):
            rope_preset(name)


@pytest.mark.parametrize("mm", [16, 28, 44, 52, 60])
def test_steel_wire_of_any_diameter_is_near_the_standard(mm: int) -> None:
    """EN 12385-4, class 6x36 with steel core, 1770: W = 0.409·d² kg per 100 m, F = 0.356·R·d².

    W2 and K2 as a rope maker tabulates them (vornbaeumen.de, technical notes, calculation
    variables).
    """
    rope = rope_preset(f"steel_wire_{mm}mm")
    assert rope.diameter_m == pytest.approx(1e-3 * mm)
    assert rope.mass_kg_per_m == pytest.approx(0.409e-2 * mm**2, rel=0.03)
    assert rope.breaking_load_n == pytest.approx(0.356 * 1770.0 * mm**2, rel=0.01)
    assert f"{mm} mm steel wire rope" in rope.about


def test_a_diameter_of_a_preset_gives_the_preset() -> None:
    """It has 76.2 mm, 3 in."""
    assert rope_preset("steel_wire_76mm").diameter_m == 0.0762
    assert rope_preset("steel_wire_76.2mm") == rope_preset("steel_wire_76mm")


BOOK = """\
constructions:
  wire: {about: wire, source: table, mass_per_d2: 4000.0, hydrodynamic_over_nominal: 0.8,
         breaking_load_per_d2: 6.0e+8, stiffness_per_d2: 4.0e+10}
by_diameter:
  wire_50mm: {construction: wire, diameter_m: 0.05}
by_figures: {}
"""


def test_a_users_own_rope_file(tmp_path: Path) -> None:
    path = tmp_path / "ropes.yaml"
    path.write_text(BOOK)
    assert rope_presets(path)["wire_50mm"].mass_kg_per_m == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("construction: wire", "construction: wier", r"by_diameter\.wire_50mm: .*mean 'wire'\?"),
        (
            ", stiffness_per_d2: 4.0e+10",
            "",
            r"constructions\.wire: stiffness must be given exactly once",
        ),
        (
            "4.0e+10}",
            "4.0e+10, stiffness_over_breaking_load: 14.0}",
            r"stiffness must be given exactly once",
        ),
        ("diameter_m: 0.05", "diameter_m: 50", r"wire_50mm\.diameter_m: 50 m is out of range"),
        ("by_figures: {}", "by_figures: {wire_50mm: 1}", r"by_figures\.wire_50mm: the number 1"),
        (", diameter_m: 0.05", "", r"by_diameter\.wire_50mm: diameter_m missing"),
    ],
)
def test_an_invalid_rope_file_is_rejected_with_its_line(
    old: str, new: str, words: str, tmp_path: Path
) -> None:
    assert BOOK.count(old) == 1
    path = tmp_path / "ropes.yaml"
    path.write_text(BOOK.replace(old, new))
    with pytest.raises(SceneError, match=words):
        rope_presets(path)
