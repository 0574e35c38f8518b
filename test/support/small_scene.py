"""A small complete scene as a file, for tests of the running twin."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

import numpy as np

from rope_twin import Snapshot, load_scene
from rope_twin.scene.schema import Scene

SMALL_SCENE = """\
about: a small scene with every effect
source: made up
look_at: nothing
ropes:
  - name: hoist
    rope: steel_wire_40mm
    length_m: 200.0
    elements: 20
    damping: {fraction_of_first_axial_mode: 0.02}
    to: tool
payloads:
  - name: tool
    mass_kg: 8000.0
    shape: {box: {length_m: 2.0, width_m: 1.5, height_m: 1.0}}
    displaced_volume_m3: 1.5
winch:
  speed_limit_m_per_s: 1.5
  acceleration_limit_m_per_s2: 0.3
  min_line_out_m: 50.0
  max_line_out_m: 400.0
ship:
  motion_ramp_s: 2.0
  max_hang_off_speed_m_per_s: 15.0  # heave is drawn up to there
  max_hang_off_acceleration_m_per_s2: 50.0
effects:
  - current: {profile: [[0.0, [0.5, 0.1]], [-150.0, [0.1, 0.3]], [-500.0, [0.0, 0.0]]]}
  - weight: {}
  - drag: {normal: 1.5, tangential: 0.03}
  - added_mass: {normal: 1.0}
  - payload: {}
time: {step_s: 0.01}
"""


def small_scene(folder: Path) -> Scene:
    """Write the scene to `folder` and load it."""
    path = folder / "small.yaml"
    path.write_text(SMALL_SCENE)
    return load_scene(path)


# no plain numbers, or there only for who asks or in multi-line systems
NO_FIGURES = {
    "solver", "inputs", "winch_at_limit", "study_error", "energy", "error_interval",
    "no_error_interval", "seabed", "ropes",
    "payloads", "struts", "sheaves", "winches", "cut", "vibration", "fatigue", "lines",
    "line_events", "body", "compensator", "fluid_factors", "strength", "breaches", "touchdowns",
    "landings", "bends", "residuals", "contacts", "forecast_score", "quality",
}  # fmt: skip


def figures(snapshot: Snapshot) -> dict[str, np.ndarray]:
    """Return every physical number of a snapshot by name, a rigid body's included."""
    reported = {
        field.name: getattr(snapshot, field.name)
        for field in dataclasses.fields(snapshot)
        if field.name not in NO_FIGURES
    }
    reported["strength"] = [one.max_n for one in snapshot.strength]
    for one in snapshot.touchdowns:
        place = (*one.position_m, one.line_out_m, one.layback_m)
        reported[f"touchdown of {one.name}"] = (*place, one.tension_n, one.angle_deg)
    for bend in snapshot.bends:  # not the tightest so far: that is of all looks
        place = (bend.now.line_out_m, *bend.position_m)
        reported[f"bend of {bend.now.name}"] = (1.0 / bend.now.radius_m, *place)
    if snapshot.body is not None:
        of_body = {
            field.name: getattr(snapshot.body, field.name)
            for field in dataclasses.fields(snapshot.body)
        }
        reported |= {f"body.{name}": value for name, value in of_body.items() if value is not None}
    if snapshot.compensator is not None:
        of_unit = dataclasses.asdict(snapshot.compensator)
        reported |= {f"compensator.{name}": value for name, value in of_unit.items()}
    return {name: np.asarray(value, dtype=float) for name, value in reported.items()}


def not_finite(snapshot: Snapshot) -> list[str]:
    """Return the names of the figures with a number that is not finite."""
    return [name for name, value in figures(snapshot).items() if not np.isfinite(value).all()]


def digest(snapshots: list[Snapshot]) -> str:
    """Return SHA-256 over every bit of the figures."""
    total = hashlib.sha256()
    for snapshot in snapshots:
        for value in figures(snapshot).values():
            total.update(np.ascontiguousarray(value).tobytes())
    return total.hexdigest()
