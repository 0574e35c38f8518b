"""Coefficients near the surface: an unbounded fluid, the mirror image, and energy of the waves."""

from __future__ import annotations

import importlib.util
import json
import math

import numpy as np
import pytest

from rope_twin.cli import main
from rope_twin.errors import InputError
from rope_twin.scene.shapes import Box, Cylinder
from rope_twin.studies.near_surface import near_surface

CUBE = Box(length_m=2.0, width_m=2.0, height_m=2.0)


def test_a_missing_capytaine_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says what to install."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"install it with `pip install 'rope_twin\[hydrodyn"):
        near_surface(CUBE, 4.0, [8.0])


def test_a_cube_in_an_unbounded_fluid() -> None:
    """Equal along its axes, and the 0.68 of the displaced mass of DNV-RP-H103 (table A-2, rounded
    from experiments) within 7 %.
    """
    pytest.importorskip("capytaine")
    (found,) = near_surface(CUBE, 100.0, [math.inf])
    assert found.added_mass_kg[0] == pytest.approx(found.added_mass_kg[1], rel=1e-3)
    assert found.added_mass_kg[1] / (1025.0 * 8.0) == pytest.approx(0.68, rel=0.07)
    assert 0.0 < found.error < 0.02
    assert found.damping_kg_per_s == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_thin_disc_has_that_of_the_closed_form() -> None:
    """8/3·ρ·a³ along its axis (Lamb 1932, 102), a little more for its thickness."""
    pytest.importorskip("capytaine")
    disc = Cylinder(diameter_m=4.0, height_m=0.1)
    (found,) = near_surface(disc, 50.0, [math.inf])
    assert found.added_mass_kg[1] == pytest.approx(8.0 / 3.0 * 1025.0 * 8.0, rel=0.06)


def test_deep_down_it_is_that_of_the_unbounded_fluid() -> None:
    """Ten heights below, and no waves are radiated."""
    pytest.importorskip("capytaine")
    shape = Cylinder(diameter_m=3.0, height_m=4.0)
    deep, free = near_surface(shape, 40.0, [6.0, math.inf])
    assert deep.added_mass_kg == pytest.approx(free.added_mass_kg, rel=2e-3)
    assert max(deep.damping_kg_per_s) < 1e-4 * free.added_mass_kg[0]


def test_damping_is_the_energy_of_the_waves_of_a_small_body() -> None:
    """Haskind's relation in deep water, B33 = k/(8π·ρ·g·c_g)·∫|F|²·dθ, with the force of a wave on
    a body that is small against it, F = (ρ·V + A33)·ω²·exp(-k·d) per metre (Newman 1977, 6.17).
    """
    pytest.importorskip("capytaine")
    shape, depth, period = Box(length_m=1.0, width_m=1.0, height_m=1.0), 4.0, 5.0
    (found,) = near_surface(shape, depth, [period])
    g, rho, omega = 9.80665, 1025.0, 2.0 * math.pi / period
    k = omega**2 / g
    force = (rho * 1.0 + found.added_mass_kg[1]) * omega**2 * math.exp(-k * depth)
    group = 0.5 * g / omega
    right = k / (8.0 * math.pi * rho * g * group) * 2.0 * math.pi * force**2
    assert found.damping_kg_per_s[1] == pytest.approx(right, rel=0.03)


def test_the_surface_raises_the_added_mass_of_slow_heave() -> None:
    """A rigid lid, which long waves are, mirrors the body; the nearer, the more."""
    pytest.importorskip("capytaine")
    near, far = (near_surface(CUBE, depth, [30.0])[0].added_mass_kg[1] for depth in (1.5, 3.0))
    free = near_surface(CUBE, 3.0, [math.inf])[0].added_mass_kg[1]
    assert near > 1.1 * far > 1.1 * free


def test_the_command_prints_a_table_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    """The command takes the scene's payload and shows its own added mass beside."""
    pytest.importorskip("capytaine")
    words = ["scene", "coefficients", "splash_zone", "--depth", "3", "--period", "8"]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    (row,) = found["rows"]
    assert np.isfinite(row["added_mass_kg"]).all()
    assert 0.0 < row["error"] < 0.03
    assert main(words) == 0
    assert "A33 over the scene's" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["splash_zone", "--payload", "box"], "there is no such payload"),
        (["splash_zone", "--depth", "-50"], "m above the water, and it is"),
        (["splash_zone", "--period", "0"], "period: 0 s; give positive ones"),
        (["rov_tether"], "'rov_tether' has no payload; give a scene with one"),
    ],
)
def test_wrong_words_are_refused(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence each."""
    pytest.importorskip("capytaine")
    assert main(["scene", "coefficients", *words]) == 1
    assert said in capsys.readouterr().err
