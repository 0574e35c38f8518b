"""Range of a scene's model: what lies outside it is named, and what lies inside is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sample_snapshot import RESIDUAL, hanging_rope
from small_scene import small_scene

from rope_twin.files import share_dir
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_warnings import sense_checks, validity_warnings
from rope_twin.twin.snapshot import (
    BedContact,
    Crossing,
    InputHealth,
    LinesSnapshot,
    Nearest,
    PayloadSnapshot,
    Snapshot,
)
from rope_twin.twin.twin import Twin
from rope_twin.twin.validity import DOUBTED, OUTSIDE, Finding, ModelRange

SHOT = replace(hanging_rope(), residuals=(), seabed=None, inputs={}, payloads=())
SCENES = sorted((share_dir() / "config" / "scenes").glob("*.yaml"))


def findings(scene: Any, snapshot: Snapshot, **factors: float) -> list[Finding]:
    """Reasons for leaving the range of a scene."""
    loaded = load_scene(scene) if isinstance(scene, str | Path) else scene
    return list(ModelRange(loaded).outside(snapshot, (), factors))


def only(found: list[Finding], value: float, *words: str) -> None:
    """There is one finding, with this value and these words."""
    assert len(found) == 1, found
    assert found[0].value == pytest.approx(value)
    for one in words:
        assert one in found[0].reason


def at_depth(depth_m: float, **fields: Any) -> Snapshot:
    return replace(SHOT, payload_position_m=np.array([0.0, 0.0, -depth_m]), **fields)


@pytest.mark.parametrize("path", SCENES, ids=lambda one: one.stem)
def test_no_scene_of_the_suite_begins_outside(path: Path) -> None:
    """But those whose payload begins at the surface, or that warn of it themselves."""
    scene = load_scene(path)
    assert not validity_warnings(scene)


def test_warnings_of_a_scene_stand_until_they_are_accepted(tmp_path: Path) -> None:
    text = (share_dir() / "config" / "scenes" / "shallow_lift.yaml").read_text("utf-8")
    path = tmp_path / "dense.yaml"
    path.write_text(text + "\nenvironment: {water_density_kg_per_m3: 1200.0}\n", "utf-8")
    only(findings(path, at_depth(100.0)), DOUBTED, "the scene warns: ", "1200 kg/m³")
    key = "environment.water_density_kg_per_m3"
    accepted = f"accept:\n  - {{key: {key}, says: neither fresh, reason: brine}}\n"
    path.write_text(path.read_text("utf-8") + accepted, "utf-8")
    assert not findings(path, at_depth(100.0))
    coarse = text.replace("elements: 40", "elements: 3")
    path.write_text(coarse, "utf-8")
    scene = load_scene(path)
    assert sense_checks(scene)
    assert not validity_warnings(scene), "a mesh is judged by its convergence study"


def test_a_payload_at_the_surface_without_a_splash_zone() -> None:
    found = findings("shallow_lift", at_depth(0.2))
    only(found, OUTSIDE, "at the surface, z = -0.2 m", "splash_zone")
    assert not findings("shallow_lift", at_depth(20.0))
    assert not findings("splash_zone", at_depth(0.2))


def test_a_payload_below_the_bed() -> None:
    for height_m, value in ((0.0, None), (-0.4, None), (-1.25, 0.5), (-3.0, 0.0)):
        bed = BedContact(height_m, 1e4, 0.0, 0.0)
        found = findings("landing", at_depth(200.0, seabed=bed))
        if value is None:
            assert not found
        else:
            only(found, value, f"{-height_m:.1f} m in the seabed")
    high = BedContact(10.0, 0.0, 0.0, 0.0)
    deeper = replace(RESIDUAL, quantity="payload_depth_m", half_width=1.0, measured=212.0)
    found = findings("landing", at_depth(200.0, seabed=high, residuals=(deeper,)))
    only(found, OUTSIDE, "measured depth, 212.0 m", "seabed at 210.0 m")
    inside = replace(deeper, measured=211.0)
    assert not findings("landing", at_depth(200.0, seabed=high, residuals=(inside,)))


def test_the_bed_below_loads_under_a_hook() -> None:
    """The bed is where the loads meet it, not as far below the hook; the deepest load counts."""
    place = np.array([0.0, 0.0, -1.0])
    loads = tuple(
        PayloadSnapshot(name, depth_m * place, 0.0 * place)
        for name, depth_m in (("port", 214.0), ("starboard", 213.0))
    )
    bed = BedContact(1.0, 0.0, 0.0, 0.0, ((1.0, 0.0), (2.0, 0.0)))
    hook = replace(RESIDUAL, quantity="payload_depth_m", half_width=1.0, measured=204.0)
    hanging = at_depth(200.0, payloads=loads, seabed=bed)
    assert not findings("landing", replace(hanging, residuals=(hook,)))
    below = replace(hook, measured=217.0)
    found = findings("landing", replace(hanging, residuals=(below,)))
    only(found, OUTSIDE, "measured depth, 217.0 m", "seabed at 215.0 m")


def test_a_line_that_is_followed_beyond_the_winch() -> None:
    scene = load_scene("shallow_lift")
    assert scene.winch is not None
    most, limit = scene.winch.max_line_out_m, scene.winch.speed_limit_m_per_s
    inputs = {"line_following": InputHealth(accepted=5)}
    for length_m, speed, words in (
        (most + 2.0, 0.0, f"line out of {most + 2.0:.1f} m"),
        (most, 1.3 * limit, f"at most {limit:g} m/s"),
    ):
        snapshot = at_depth(100.0, line_out_m=length_m, payout_speed_m_per_s=speed, inputs=inputs)
        only(findings(scene, snapshot), DOUBTED, words)
        assert not findings(scene, replace(snapshot, inputs={}))
    snapshot = at_depth(100.0, line_out_m=most, payout_speed_m_per_s=limit, inputs=inputs)
    assert not findings(scene, snapshot)


def test_a_current_that_ends_far_above_the_payload(tmp_path: Path) -> None:
    twin = Twin(small_scene(tmp_path))
    depth_m = -float(twin.snapshot().payload_position_m[2])

    def found(last_m: float, speed: float) -> list[Finding]:
        twin.submit_current([[0.0, 0.5, 0.0], [-last_m, speed, 0.0]])
        snapshot = twin.snapshot()
        effects = twin.inputs.current.effects
        return list(ModelRange(twin.scene).outside(snapshot, effects, {}))

    only(found(0.3 * depth_m, 0.4), DOUBTED, "the current ends", "0.40 m/s")
    assert not found(0.3 * depth_m, 0.1)
    assert not found(0.95 * depth_m, 0.4)


def test_lines_that_cross_without_contact() -> None:
    lines = LinesSnapshot(Nearest(2.0, 836.0, 0.02), (Crossing(836.0, 1.0, 0.02),))
    only(findings("shallow_lift", at_depth(100.0, lines=lines)), DOUBTED, "cross at 836 m")


def test_a_learned_lift_that_is_another_one() -> None:
    """Weight is known to 6 % before the lift, drag to 30 %."""
    assert not findings("shallow_lift", at_depth(100.0), submerged_weight=1.15, payload_drag=0.5)
    found = findings("shallow_lift", at_depth(100.0), submerged_weight=1.3, payload_drag=1.0)
    only(found, DOUBTED, "the learned submerged weight is 1.3 times")
    assert not findings("shallow_lift", at_depth(100.0), current=3.0)
