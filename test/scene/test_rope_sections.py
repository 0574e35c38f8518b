"""Sections, mesh grading and damping of a rope: reading, mesh and first mode."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from scene_text import GOOD, assert_refused, spoilt, written

from rope_twin.core import state as rows
from rope_twin.scene.grid import (
    Bar,
    damping_fraction,
    first_axial_frequency,
    node_coordinates,
)
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import load_scene, rope_preset
from rope_twin.scene.rope_model import build
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import Grading

ROPE = "    rope: steel_wire_40mm\n"
SECTIONS = """\
    sections:
      - {rope: chain_42mm, length_m: 20.0}
      - {rope: hmpe_76mm, length_m: 400.0}
      - {rope: steel_wire_40mm}
"""
JOINED = spoilt(ROPE, SECTIONS)
DAMPING = "{fraction_of_first_axial_mode: 0.02}"
ELEMENTS = "    elements: 50\n"

BAD = {
    "both": (spoilt(ROPE, ROPE + SECTIONS), "ropes[0]", ("both `rope` and `sections`",)),
    "neither": (spoilt(ROPE, ""), "ropes[0]", ("material is not given", "`sections`")),
    "endless below": (
        JOINED.replace("{rope: hmpe_76mm, length_m: 400.0}", "{rope: hmpe_76mm}"),
        "ropes[0].sections[1]",
        ("only the topmost section",),
    ),
    "too short": (
        JOINED.replace("{rope: steel_wire_40mm}", "{rope: steel_wire_40mm, length_m: 100.0}"),
        "ropes[0].sections",
        ("520 m long in total", "800 m"),
    ),
    "fewer elements than sections": (
        JOINED.replace("elements: 50", "elements: 3")
        .replace("    length_m: 500.0", "    length_m: 700.0")
        .replace("400.0}\n", "400.0}\n      - {rope: hmpe_25mm, length_m: 5.0}\n"),
        "ropes[0].elements",
        ("3 elements for 4 sections", "at least 4"),
    ),
    "unknown preset": (
        JOINED.replace("chain_42mm", "chain_43"),
        "ropes[0].sections[0].rope",
        ("'chain_43'", "by its properties, one of chain, ", " or one of: chain_42mm"),
    ),
    "own drag on nothing": (
        JOINED.replace("tangential: 0.02", "tangential: 0.0"),
        "ropes[0]",
        ("drag.tangential is 0", "0.366"),
    ),
    "grading without a kind": (
        spoilt(ELEMENTS, f"{ELEMENTS}    grading: {{growth: 1.5}}\n"),
        "ropes[0].grading",
        ("neither of lowest_m and nodes_m",),
    ),
    "grading longer than equal elements": (
        spoilt(ELEMENTS, f"{ELEMENTS}    grading: {{lowest_m: 20.0}}\n"),
        "ropes[0].grading",
        ("20 m is longer than equal elements of 10 m",),
    ),
    "grading that does not reach": (
        spoilt(ELEMENTS, f"{ELEMENTS}    grading: {{lowest_m: 0.1, growth: 1.02}}\n"),
        "ropes[0].grading",
        ("reach only 8.458 m",),
    ),
    "nodes out of order": (
        spoilt(ELEMENTS, f"{ELEMENTS}    grading: {{nodes_m: [0.2, 0.1]}}\n"),
        "ropes[0].grading",
        ("do not ascend",),
    ),
    "lowest element too long to haul in": (
        spoilt(ELEMENTS, f"{ELEMENTS}    grading: {{nodes_m: [60.0]}}\n"),
        "ropes[0].grading",
        ("60 m", "hauls in to 50 m"),
    ),
    "three dampings": (
        spoilt(DAMPING, "{fraction_of_first_axial_mode: 0.02, newton_seconds: 1.0,"
               " fraction_of_one_element: 0.1}"),
        "ropes[0].damping",
        ("three dampings",),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_invalid_sections_are_rejected(name: str, tmp_path: Path) -> None:
    text, position, words = BAD[name]
    (tmp_path / "bag").mkdir()
    assert_refused(text, position, words, tmp_path)


def test_section_ends_are_nodes_with_their_own_properties(tmp_path: Path) -> None:
    """A chain of 20 m, 400 m of HMPE and steel wire, on 50 elements."""
    scene = load_scene(written(tmp_path, JOINED))
    line, rope = scene.ropes[0], build(scene)
    s = rope.state.s[:51]
    assert s[[0, 2, 42, 50]] == pytest.approx([0.0, 20.0, 420.0, 500.0], abs=1e-12)
    assert rope.sections[rows.END] == pytest.approx([20.0, 420.0, np.inf])
    assert line.lengths_m(500.0) == [20.0, 400.0, 80.0]
    assert line.lengths_m(300.0) == [20.0, 280.0, 0.0]
    chain, wire = rope.sections[:, 0], rope.sections[:, 2]
    drag = next(effect for effect in rope.effects if type(effect).__name__ == "Drag")
    assert drag.kn * chain[rows.PER_METRE + 2] == pytest.approx(0.5 * 1025.0 * 2.4 * 0.042)
    assert drag.kt * chain[rows.PER_METRE + 3] == pytest.approx(
        0.5 * 1025.0 * 1.15 * 0.042, rel=1e-3
    )
    assert wire[rows.PER_METRE + 2] == pytest.approx(0.032)
    figures = lift_figures(scene)
    weights = [
        (preset.mass_kg_per_m - 1025.0 * 0.25 * pi * preset.hydrodynamic_diameter_m**2) * 9.80665
        for preset in (rope_preset(n) for n in ("chain_42mm", "hmpe_76mm", "steel_wire_40mm"))
    ]
    below = figures.payload_weight_n + 20.0 * weights[0] + 280.0 * weights[1]
    assert figures.top_tension_n(300.0) == pytest.approx(below)
    assert figures.damping_fraction == pytest.approx(0.02)


def test_first_axial_mode_of_three_sections() -> None:
    """Against the smallest eigenvalue of the rope on 3,000 springs and masses."""
    ropes = [rope_preset(name) for name in ("chain_42mm", "hmpe_76mm", "steel_wire_76mm")]
    bars = [Bar(rope, length, 0.0, 0.0) for rope, length in zip(ropes, (50, 900, 800), strict=True)]
    computed = first_axial_frequency(bars, 30e3)
    l, K, M = [], [], []
    for bar in bars:
        cells = 1000
        K += [bar.stiffness_n / (bar.length_m / cells)] * cells
        l += [bar.rope.mass_kg_per_m * bar.length_m / cells] * cells
    mass = np.array(l)
    M = 0.5 * np.concatenate([[0.0], mass[:-1]]) + 0.5 * mass
    M[0] += 30e3
    # inverse iteration: forces of the inertia, summed up from below, stretch the springs
    u, omega2 = np.ones(len(K)), 0.0
    for _ in range(60):
        stretch = np.cumsum(M * u) / np.array(K)
        new = np.cumsum(stretch[::-1])[::-1]
        omega2 = float(u @ (M * u) / (new @ (M * u)))
        u = new / new[0]
    assert computed == pytest.approx(sqrt(omega2), rel=1e-6)
    c = [0.02 * bar.stiffness_n for bar in bars]
    assert damping_fraction(bars, c, 30e3) == pytest.approx(0.01 * computed, rel=1e-12)
    parts = [Bar(bars[1].rope, length, 0.0, 0.0) for length in (300.0, 600.0)]
    whole = [Bar(bars[1].rope, 900.0, 0.0, 0.0)]
    for end in (30e3, 0.0, np.inf):
        assert first_axial_frequency(parts, end) == pytest.approx(
            first_axial_frequency(whole, end), rel=1e-12
        )
    wave = pi * sqrt(whole[0].stiffness_n / ropes[1].mass_kg_per_m) / 900.0
    assert first_axial_frequency(whole, np.inf) == pytest.approx(wave, rel=1e-12)
    assert first_axial_frequency(whole, 0.0) == pytest.approx(0.5 * wave, rel=1e-12)


def test_damping_per_element_is_warned_about(tmp_path: Path) -> None:
    """ζ·l·√(EA·m) of elements of 10 m; the warning names the fraction that stays."""
    scene = load_scene(written(tmp_path, spoilt(DAMPING, "{fraction_of_one_element: 0.8}")))
    (c,) = lift_figures(scene).damping_newton_seconds
    assert c == pytest.approx(0.8 * 10.0 * sqrt(64.64e6 * 6.38352))
    (warning,) = [words for words in sense_checks(scene) if "per element" in words]
    assert "ropes[0].damping" in warning
    assert "50 elements" in warning
    fraction = float(warning.split("fraction_of_first_axial_mode: ")[1].split("`")[0])
    assert fraction == pytest.approx(lift_figures(scene).damping_fraction, rel=5e-3)
    finer = replace(scene, ropes=(replace(scene.ropes[0], elements=100),))
    assert lift_figures(finer).damping_newton_seconds == pytest.approx((0.5 * c,))


def test_graded_elements(tmp_path: Path) -> None:
    """From the lowest up each is longer by the growth, until they are equal."""
    line = replace(
        load_scene(written(tmp_path, GOOD)).ropes[0], grading=Grading(lowest_m=1.0, growth=1.5)
    )
    rest = np.diff(node_coordinates(line, 50.0))
    assert (len(rest), rest.sum()) == (50, pytest.approx(500.0))
    growing = np.flatnonzero(np.diff(rest) > 1e-9)
    assert rest[0] == pytest.approx(1.0, rel=1e-9)
    assert rest[growing[:-1] + 1] / rest[growing[:-1]] == pytest.approx(1.5, rel=1e-9)
    assert rest[growing[-1] + 1 :] == pytest.approx(rest[-1], rel=1e-9)
    listed = replace(line, grading=Grading(nodes_m=(0.2, 0.4, 50.0)))
    assert node_coordinates(listed, 50.0)[:5] == pytest.approx([0.0, 0.2, 0.4, 50.0, 59.574468])


def test_lowest_elements_fit_what_the_winch_leaves(tmp_path: Path) -> None:
    """Ten metres a piece, hauled in to 2 m: the lowest is divided; to 50 m they stay equal."""
    line = load_scene(written(tmp_path, GOOD)).ropes[0]
    assert np.diff(node_coordinates(line, 50.0)) == pytest.approx(10.0)
    rest = np.diff(node_coordinates(line, 2.0))
    assert rest[:4] == pytest.approx([1.0, 2.0, 4.0, 3.0])
    assert rest[4:] == pytest.approx([10.0] * 49)
