"""The scenes that docs/how-to/own_scenes.md gives, against the hand calculations beside them."""

from __future__ import annotations

import re
from dataclasses import replace
from math import asinh, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigs import CALM
from scipy.optimize import brentq

from rope_twin import Snapshot, Twin, load_scene
from rope_twin.effects.current import CurrentParams
from rope_twin.scene.load import rope_preset
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import Rope

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "own_scenes.md"
WHOLE = r"```yaml\n(about:.*?)```"  # not a part of a scene
BUOY, CRANES, CABLE, TOW = re.findall(WHOLE, PAGE.read_text(), re.DOTALL)
G, RHO = 9.80665, 1025.0


STILL = CurrentParams(profile=((0.0, (0.0, 0.0)),))


def at_rest(text: str, folder: Path, *idle: Any) -> Snapshot:
    """Return the snapshot at the start of the scene, which gives no warning.

    idle: effects besides that do nothing, by which its step is one that is compiled anyway.
    """
    (folder / "own.yaml").write_text(text)
    scene = load_scene(folder / "own.yaml")
    assert sense_checks(scene) == []
    return Twin(replace(scene, effects=(*scene.effects, *idle))).snapshot()


def in_water(rope: Rope) -> float:
    """Weight [N/m]."""
    return (rope.mass_kg_per_m - RHO * pi / 4.0 * rope.hydrodynamic_diameter_m**2) * G


def test_buoyancy_of_a_buoy_above_its_chain(tmp_path: Path) -> None:
    """By the step of test_cut_joined."""
    snapshot = at_rest(BUOY, tmp_path, STILL, CALM)
    assert snapshot.seabed is not None
    lying_m = snapshot.seabed.rope_on_bed_m
    assert lying_m == pytest.approx(60.0 - 49.3, abs=1.5)  # to half an element
    rope = (
        in_water(rope_preset("chain_76mm")) * 49.3
        + in_water(rope_preset("polyester_100mm")) * 150.0
    )
    wet = (8000.0 + rope / G) / RHO / 40.0
    assert snapshot.payload_position_m[2] == pytest.approx(4.0 * (0.5 - wet), abs=0.1)
    assert snapshot.tension_payload_n == pytest.approx(rope, rel=0.02)


def test_two_crane_tensions(tmp_path: Path) -> None:
    """Tension of each crane: its load, half of the beam, its wire; 1e-3."""
    snapshot = at_rest(CRANES, tmp_path, STILL)
    beam = 20000.0 * (1.0 - RHO / 7850.0)
    wire = 100.0 * in_water(rope_preset("steel_wire_76mm"))
    for rope, load in zip(
        snapshot.ropes, (120000.0 - 15.0 * RHO, 60000.0 - 7.5 * RHO), strict=True
    ):
        assert rope.tension_top_n == pytest.approx((load + 0.5 * beam) * G + wire, rel=1e-3)


def level_catenary(depth: float, length: float, span: float) -> float:
    """a = H/w of a rope that lies from its touchdown to its end `span` away [m]."""

    def lack(a: float) -> float:
        hangs = sqrt(depth**2 + 2.0 * depth * a)
        return a * asinh(hangs / a) + length - hangs - span

    return float(brentq(lack, 1.0, 1000.0))


@pytest.mark.long
def test_a_laid_cable_is_a_catenary(tmp_path: Path) -> None:
    snapshot = at_rest(CABLE, tmp_path)
    w = (30.0 - RHO * pi / 4.0 * 0.12**2) * G
    depth, length = 300.0, 450.0
    a = level_catenary(depth, length, 250.0)
    hangs = sqrt(depth**2 + 2.0 * depth * a)
    assert snapshot.tension_top_n == pytest.approx(w * (depth + a), rel=1e-3)
    assert snapshot.hang_off_force_n[0] == pytest.approx(w * a, rel=2e-3)
    assert snapshot.seabed is not None
    assert snapshot.seabed.rope_on_bed_m == pytest.approx(length - hangs, abs=3.0)  # an element
    (touchdown,) = snapshot.touchdowns
    assert touchdown.line_out_m == pytest.approx(hangs, abs=0.3)  # a tenth of an element
    assert touchdown.layback_m == pytest.approx(a * asinh(hangs / a), abs=0.3)
    assert touchdown.position_m == pytest.approx((touchdown.layback_m, 0.0, -depth), abs=0.05)
    assert touchdown.tension_n == pytest.approx(w * a, rel=2e-3)
    assert touchdown.angle_deg == 0.0
    (bend,) = snapshot.bends
    assert bend.now.radius_m == pytest.approx(a, rel=0.02)
    assert bend.now.line_out_m == pytest.approx(hangs, abs=6.0)  # EI lies about it
    assert not bend.tightest.too_tight


@pytest.mark.long
def test_the_touchdown_point_moves_continuously_on_coarse_elements(tmp_path: Path) -> None:
    """Elements of 9 m, while the lower end moves 10 m and two nodes are lifted off."""
    (tmp_path / "own.yaml").write_text(CABLE)
    scene = load_scene(tmp_path / "own.yaml")
    depth, length = 300.0, 450.0
    for span in np.linspace(250.0, 260.0, 8):
        line = replace(scene.ropes[0], elements=50, fixed_at_m=(float(span), 0.0, -depth))
        (touchdown,) = Twin(replace(scene, ropes=(line,))).snapshot().touchdowns
        a = level_catenary(depth, length, float(span))
        hangs = sqrt(depth**2 + 2.0 * depth * a)
        assert touchdown.line_out_m == pytest.approx(hangs, abs=0.2)
        assert touchdown.layback_m == pytest.approx(a * asinh(hangs / a), abs=0.2)


def test_tow_tension_is_weight_and_drag(tmp_path: Path) -> None:
    snapshot = at_rest(TOW, tmp_path)
    rope, flow = rope_preset("whoi_cable_17mm"), np.array([-2.0, 0.0])
    d, w = rope.hydrodynamic_diameter_m, in_water(rope)
    pull = np.array([-0.5 * RHO * 0.2 * 4.0, -(1000.0 - 0.25 * RHO) * G])
    position, step = np.zeros(2), 500.0 / 5000
    for _ in range(5000):
        up = -pull / np.hypot(*pull)
        along = (flow @ up) * up
        across = flow - along
        drag = 1.5 * np.hypot(*across) * across + 0.02 * pi * np.hypot(*along) * along
        pull = pull + (0.5 * RHO * d * drag - np.array([0.0, w])) * step
        position = position + up * step
    assert -snapshot.payload_position_m[[0, 2]] == pytest.approx(position, rel=2e-3)
    assert snapshot.tension_top_n == pytest.approx(np.hypot(*pull), rel=2e-3)
