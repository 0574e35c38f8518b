"""The study's scenes hold the study's own figures (smooth_2km and the others, in its letters)."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from rope_twin import load_scene
from rope_twin.scene.lift import lift_figures, listed_effects
from rope_twin.scene.shapes import payload_figures

RHO, G = 1025.0, 9.81


@dataclass(frozen=True)
class Study:
    """A row of the study's table."""

    length: float
    diameter: float  # nominal, that drag and added mass are on
    net: float  # rope's weight in water [N/m]
    load: float
    volume: float
    added: float
    area: float
    damping: float
    heave: float
    ramp: float
    current: tuple[float, float]  # at the surface and at the end of the rope


HEAVY, HEAVIER, LIGHT = (
    (20e3, 2.927, RHO * 2.927, 6.0),
    (20e3, 4.0, 8e3, 8.0),
    (2e3, 0.5, 512.5, 8.0),
)
FLOATING = 3.6 * G * (1.0 - RHO / 975.0)
ROWS = {
    "smooth_2km": Study(2000.0, 0.076, 0.04 * G, *HEAVY, 5e5, 1.5, 8.0, (0.5, 0.0)),
    "smooth_5km": Study(5000.0, 0.08, FLOATING, *HEAVIER, 0.0, 1.5, 16.0, (1.0, 0.2)),
    "slack_5km": Study(5000.0, 0.08, FLOATING, *HEAVIER, 0.0, 5.0, 16.0, (1.0, 0.2)),
    "snap_vertical": Study(2000.0, 0.076, 0.04 * G, *LIGHT, 5e5, 4.0, 8.0, (0.0, 0.0)),
    "snap_2km": Study(2000.0, 0.076, 0.04 * G, *LIGHT, 5e5, 4.0, 8.0, (0.2, 0.2)),
}  # fmt: skip


@pytest.mark.parametrize("name", ROWS)
def test_study_scenes_have_the_table_values(name: str) -> None:
    row, scene = ROWS[name], load_scene(name)
    line, payload = scene.ropes[0], payload_figures(scene.payloads[0], RHO)
    assert (line.length_m, line.rope.mass_kg_per_m, line.rope.axial_stiffness_n) == (
        row.length, 3.6, 1.5e8,
    )  # fmt: skip
    assert lift_figures(scene).damping_newton_seconds == (row.damping,)
    assert lift_figures(scene).rope_weight_n_per_m == pytest.approx(row.net, rel=1e-5)
    assert (payload.mass_kg, payload.volume_m3) == (row.load, row.volume)
    assert payload.added_mass_kg == pytest.approx((row.added,) * 3)
    assert payload.drag_area_m2 == (row.area,) * 3
    assert scene.sea_state.heave is not None
    assert (scene.sea_state.heave.amplitude_m, scene.sea_state.heave.period_s) == (row.heave, 8.0)
    assert scene.ship.motion_ramp_s == row.ramp
    assert (scene.environment.water_density_kg_per_m3, scene.environment.gravity_m_per_s2) == (
        RHO, G,
    )  # fmt: skip


@pytest.mark.parametrize("name", ROWS)
def test_study_scene_drag_and_added_mass_coefficients(name: str) -> None:
    """Cdn·d, Cdt·d and Ca·d² are 1.2·d, 0.01·d and d² of the nominal diameter.

    The scene's own are on the diameter of the rope's volume.
    """
    row, scene = ROWS[name], load_scene(name)
    diameter, listed = scene.ropes[0].rope.hydrodynamic_diameter_m, listed_effects(scene)
    assert listed["drag"].normal * diameter == pytest.approx(1.2 * row.diameter, rel=1e-6)
    assert listed["drag"].tangential * diameter == pytest.approx(0.01 * row.diameter, rel=1e-6)
    assert listed["added_mass"].normal * diameter**2 == pytest.approx(row.diameter**2, rel=1e-6)
    current = listed.get("current")
    rows = current.profile if current else ((0.0, (0.0, 0.0)), (-row.length, (0.0, 0.0)))
    assert rows == ((0.0, (row.current[0], 0.0)), (-row.length, (row.current[1], 0.0)))
