"""Natural modes against closed forms: strings, bars, hanging ropes, sagging cables."""

from __future__ import annotations

import importlib.util
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigs import Rig, with_nothing_below
from scipy.optimize import brentq  # type: ignore[import-untyped]

from rope_twin import load_scene
from rope_twin.cli import main
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import InputError, SceneError
from rope_twin.files import share_dir
from rope_twin.scene.grid import Bar, first_axial_frequency
from rope_twin.scene.schema import Scene
from rope_twin.studies.modes import find_modes
from validation.swing import SWUNG, HangingRope

# Taut in water, without weight: strings in both directions.
STRING = Rig(
    length=500.0, elements=100, mass=6.4, EA=65e6, diameter=0.04, gravity=0.0, density=1025.0,
    added_mass=1.0, fixed_at=(301.5, 0.0, -402.0),
)  # fmt: skip
SAGGING = Rig(length=500.0, elements=100, mass=6.4, EA=65e6, diameter=0.04, gravity=9.81)


@pytest.mark.parametrize("end", [STRING.fixed_at, (502.5, 0.0, 0.0), (0.0, 0.0, -502.5)])
def test_taut_string_in_water(end: tuple[float, float, float]) -> None:
    """P2: n/(2l)·√(T/m), m stretched and with added mass; first five within 0.5 %; in pairs.

    In any direction, as along x and z, where a straight rope has no plane of its own.
    """
    computed = find_modes(replace(STRING, fixed_at=end).scene(), 10)
    chord = 502.5
    tension = STRING.EA * (chord / STRING.length - 1.0)
    area = 0.25 * math.pi * STRING.diameter**2
    mass = (STRING.mass + STRING.density * area) * STRING.length / chord
    exact = [n / (2.0 * chord) * math.sqrt(tension / mass) for n in range(1, 6)]
    assert [m.frequency_hz for m in computed.lowest[::2]] == pytest.approx(exact, rel=5e-3)
    assert [m.frequency_hz for m in computed.lowest[1::2]] == pytest.approx(exact, rel=5e-3)
    for pair in range(5):
        kinds = {mode.kind for mode in computed.lowest[2 * pair : 2 * pair + 2]}
        assert kinds == {"in-plane", "out-of-plane"}
    assert computed.lowest[0].largest_at_m == pytest.approx(250.0, abs=5.1)
    assert computed.lowest[0].in_plane_share + computed.lowest[0].out_of_plane_share > 1.0 - 1e-9


def test_bar_with_end_mass() -> None:
    """P3: x·tan x = m·L/M' for the first axial mode, 0.1 % at 200 elements; and the next ones."""
    rig = Rig(
        length=3000.0, elements=200, mass=23.2, EA=235e6, density=1025.0, load=100e3, volume=10.0,
        added=(1e3, 1e3, 50e3), current=((0.0, (0.3, 0.0)),),
    )  # fmt: skip
    scene = rig.scene()
    modes = find_modes(scene, 1).axial
    line = scene.ropes[0]
    assert line.rope is not None
    bar = Bar(line.rope, line.length_m, 0.0, 0.0)
    first = first_axial_frequency([bar], 150e3) / (2.0 * math.pi)
    assert modes[0].frequency_hz == pytest.approx(first, rel=1e-3)
    ratio, speed = rig.mass * rig.length / 150e3, math.sqrt(rig.EA / rig.mass)
    for k in (1, 2):
        x = brentq(lambda x: x * math.tan(x) - ratio, k * math.pi, (k + 0.5) * math.pi - 1e-9)
        exact = x * speed / rig.length / (2.0 * math.pi)
        assert modes[k].frequency_hz == pytest.approx(exact, rel=2e-3)
    assert all(mode.axial_share > 0.9 and mode.kind == "axial" for mode in modes)


def largest_hanging_error(elements: int) -> float:
    """Largest relative error of the first five swings of a hanging rope, out of plane."""
    scene = replace(SWUNG, elements=elements).scene()
    exact = [w / (2.0 * math.pi) for w in HangingRope(SWUNG).frequencies(5)]
    computed = [m.frequency_hz for m in find_modes(scene, 10).lowest if m.kind == "out-of-plane"]
    assert len(computed) == 5
    return float(np.abs(np.array(computed) / exact - 1.0).max())


def test_hanging_rope_with_a_submerged_mass() -> None:
    """P7, Bessel functions: within 0.05 % at 200 elements, and of second order in their length."""
    coarse, fine = largest_hanging_error(50), largest_hanging_error(200)
    assert fine < 5e-4
    assert math.log(coarse / fine, 4.0) == pytest.approx(2.0, abs=0.2)


def irvine(sag: float) -> float:
    """First symmetric in-plane x = ω·L·√(m/H) of a level cable: tan(x/2) = x/2 - 4/λ²·(x/2)³.

    Irvine and Caughey 1974, eq. 22, λ² = sag.
    """

    def miss(x: float) -> float:
        y = 0.5 * x
        return math.sin(y) - math.cos(y) * (y - 4.0 / sag * y**3)

    return float(brentq(miss, 0.5 * math.pi, 2.9 * math.pi))


@pytest.mark.parametrize("span", [499.0, 499.9])
def test_sagging_cable(span: float) -> None:
    """Out of plane a string; in plane, antisymmetric 2·string, symmetric Irvine's: within 1 %."""
    rig = replace(SAGGING, fixed_at=(span, 0.0, 0.0))
    actual = find_modes(rig.scene(), 8)
    w, m = rig.mass * 9.81, rig.mass
    position = actual.place
    sag = float(-position[:, 2].min())
    H = w * span**2 / (8.0 * sag)
    long = span * (1.0 + 8.0 * (sag / span) ** 2)
    parameter = (w * span / H) ** 2 * span * rig.EA / (H * long)
    unit = math.sqrt(H / m) / span / (2.0 * math.pi)
    out = [mode.frequency_hz for mode in actual.lowest if mode.kind == "out-of-plane"]
    assert out[:2] == pytest.approx([math.pi * unit, 2.0 * math.pi * unit], rel=1e-2)
    inside = [mode.frequency_hz for mode in actual.lowest if mode.kind == "in-plane"]
    expected = sorted([2.0 * math.pi * unit, irvine(parameter) * unit])
    assert inside[:2] == pytest.approx(expected, rel=1e-2)


def test_axial_modes_of_a_sagging_cable_are_reported_once() -> None:
    """Its stretch is shared by several modes: the first three of all that are mostly axial."""
    rig = replace(SAGGING, length=150.0, elements=75, fixed_at=(60.0, 0.0, -20.0))
    computed = find_modes(rig.scene(), 160)
    axial = [mode.frequency_hz for mode in computed.lowest if mode.kind == "axial"]
    assert [mode.frequency_hz for mode in computed.axial] == pytest.approx(axial[:3], rel=1e-6)


def test_modes_list_strouhal_and_wave_frequency_ratios() -> None:
    """Strouhal 0.17·U/d where a mode moves most; the ratio is 1 for periods of 4 to 20 s."""
    rig = Rig(
        length=1000.0, elements=50, density=1025.0, volume=2.0, diameter=0.04,
        current=((0.0, (0.8, 0.0)),),
    )  # fmt: skip
    computed = find_modes(rig.scene(), 6)
    assert computed.strouhal_max_hz == pytest.approx(0.17 * 0.8 / 0.04, rel=1e-3)
    for mode in computed.lowest:
        assert mode.strouhal_hz == pytest.approx(3.4, rel=1e-3)
        ratio = max(mode.period_s / 20.0, 1.0) * min(mode.period_s / 4.0, 1.0)
        assert mode.wave_ratio == pytest.approx(ratio)


def test_slack_ropes_and_too_many_modes_are_rejected() -> None:
    """A slack rope, and more modes than there can be."""
    slack = replace(STRING, length=600.0)
    with pytest.raises(SceneError, match=r"slack at rest, so it has no natural frequency"):
        find_modes(slack.scene(), 3)
    with pytest.raises(InputError, match=r"--count: 5000 of a rope with 99 free nodes; give 1 to"):
        find_modes(STRING.scene(), 5000)


def test_a_coarse_mesh_has_all_its_modes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three elements between fixed ends: two nodes, six modes, by LAPACK as by ARPACK."""
    rig = replace(STRING, elements=3)
    every, some = find_modes(rig.scene()), find_modes(rig.scene(), 4)
    assert every.of_mesh == len(every.lowest) == 6
    frequencies = [[mode.frequency_hz for mode in own.lowest] for own in (some, every)]
    assert frequencies[0] == pytest.approx(frequencies[1][:4], rel=1e-6)
    with pytest.raises(InputError, match=r"7 of a rope with 2 free nodes; give 1 to 6\."):
        find_modes(rig.scene(), 7)
    coarse = tmp_path / "coarse.yaml"
    text = (share_dir() / "config" / "scenes" / "bridle_lift.yaml").read_text()
    coarse.write_text(re.sub(r"elements: \d+", "elements: 3", text))
    assert main(["modes", str(coarse), "--count", "54"]) == 0
    assert capsys.readouterr().out.startswith("all 54 modes of the mesh; the highest are")
    assert main(["modes", str(coarse)]) == 0
    assert "modes of the mesh" not in capsys.readouterr().out


def test_an_axial_row_that_is_not_axial_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    """The first axial row of a bent pipe moves 1 % along it; a straight lift has no such row."""
    for scene, explained in (("curved_pipe", True), ("shallow_lift", False)):
        assert main(["modes", scene]) == 0
        out = capsys.readouterr().out
        (first,) = [line for line in out.splitlines() if line.startswith("axial 1")]
        assert ("in-plane" in first) is explained
        assert ("no mode there moves mainly along the rope" in out) is explained


def test_the_modes_command_prints_table_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    """deep_lift's first axial period lies among wave periods."""
    assert main(["modes", "deep_lift", "--count", "4"]) == 0
    table = capsys.readouterr().out
    assert main(["modes", "deep_lift", "--count", "4", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["group"] for row in rows] == ["lowest"] * 4 + ["axial"] * 3
    for row in rows:
        shares = [row[f"{kind}_share"] for kind in ("axial", "in_plane", "out_of_plane")]
        assert sum(shares) == pytest.approx(1.0, abs=1e-6)
        assert f"{row['period_s']:.4g}" in table
    assert rows[4]["kind"] == "axial"
    assert rows[4]["wave_ratio"] == pytest.approx(1.0) or rows[4]["period_s"] < 4.0


@pytest.mark.skipif(importlib.util.find_spec("matplotlib") is None, reason="needs matplotlib")
def test_the_modes_command_writes_a_png(tmp_path: Path) -> None:
    """A PNG of some size."""
    picture = tmp_path / "modes.png"
    assert main(["modes", "deep_lift", "--count", "2", "--out", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_beam_under_tension() -> None:
    """n/(2L)·√(T/(m·(1 + strain)) + n²·pi²·EI/(m·L²)): 0.2 % at 100 elements, second order."""
    rig = Rig(
        length=20.0, mass=5.0, EA=1e8, gravity=0.0, EI=2e4, fixed_at=(0.0, 20.001, 0.0),
    )  # fmt: skip
    tension = rig.EA * 0.001 / 20.0 / (1.0 + 0.001 / 20.0)
    n = np.arange(1, 6)
    exact = n / 40.0 * np.sqrt((tension + (n * math.pi / 20.0) ** 2 * 2e4) / 5.0)
    errors = []
    for elements in (50, 100):
        scene = with_nothing_below(replace(rig, elements=elements).scene())
        computed = np.array([m.frequency_hz for m in find_modes(scene, 10).lowest[::2]])
        errors.append(1.0 - computed / exact)
    assert errors[1].max() < 2e-3
    assert errors[0] == pytest.approx(4.0 * errors[1], rel=0.02)


def swing(scene: Scene, number: int) -> float:
    """Frequency of a swing between the ends, out of plane [Hz]; 0 is the pendulum."""
    computed = find_modes(scene, 3 * number).lowest
    return [mode.frequency_hz for mode in computed if mode.kind == "out-of-plane"][number]


def test_seventh_mode_of_a_published_riser() -> None:
    """Seventh mode of riser_300m at 0.941 Hz (Le Cunff, Durand 1999); bending is 1.7 % of it."""
    scene = load_scene("riser_300m")
    seventh = swing(scene, 7)
    assert seventh == pytest.approx(0.941, rel=2e-3)
    limp = replace(
        scene, effects=tuple(e for e in scene.effects if not isinstance(e, BendingParams))
    )
    assert swing(limp, 7) < 0.985 * seventh
