"""Natural modes of a rope with a rigid body below it, against closed forms."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from body_rigs import LINE, scene_of

from rope_twin import load_scene
from rope_twin.cli import main
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.errors import SceneError
from rope_twin.scene.schema import Scene
from rope_twin.studies.modes import find_modes, find_system_modes
from rope_twin.studies.viv_frequency_domain import spans_of

G, MASS, LENGTH_M = 9.80665, 2000.0, 20.0
INERTIA = (800.0, 1300.0, 1900.0)
# a rope without weight and a load that air does not carry
RIG = replace(
    LINE, length=LENGTH_M, elements=10, EA=1e10, load=MASS, mass=1e-4, gravity=G, density=1.0,
    volume=1e-3, added=(0.0, 0.0, 0.0),
)  # fmt: skip
DRY = {"added_inertia_kg_m2": (0.0, 0.0, 0.0), "turning_drag_m5": (0.0, 0.0, 0.0)}


def pinned(above_m: float) -> Scene:
    """A body that hangs from a pin so far above its centre of gravity."""
    return scene_of(
        RIG,
        RigidBodyParams(
            size_m=(4.0, 3.0, 1.0), inertia_kg_m2=INERTIA, pinned_at_m=(0.0, 0.0, above_m),
            pin_stiffness_n_per_m=1e11, **DRY,
        ),
    )  # fmt: skip


def test_a_pinned_body_is_a_double_pendulum() -> None:
    """Rope and body in both planes; nothing holds the body's turn about the rope.

    M = [m·l², m·l·h; m·l·h, I + m·h²], K = diag(m·g·l, m·g·h) of the two angles.
    """
    h, l = 0.8, LENGTH_M
    wanted = [math.inf]
    for inertia in INERTIA[:2]:
        M = np.array([[MASS * l * l, MASS * l * h], [MASS * l * h, inertia + MASS * h * h]])
        squares = np.linalg.eigvals(np.linalg.solve(M, np.diag([MASS * G * l, MASS * G * h])))
        wanted += (2.0 * math.pi / np.sqrt(squares)).tolist()
    computed = find_modes(pinned(h), 5).lowest
    assert [mode.period_s for mode in computed] == pytest.approx(
        sorted(wanted, reverse=True), rel=2e-5
    )
    kinds = [mode.kind for mode in computed]
    assert kinds[0] == kinds[3] == kinds[4] == "turning"
    assert {kinds[1], kinds[2]} == {"in-plane", "out-of-plane"}
    for mode in computed:
        shares = mode.axial_share, mode.in_plane_share, mode.out_of_plane_share
        assert sum(shares) + mode.turning_share == pytest.approx(1.0)


def test_axial_mode_of_a_body_on_rope_and_slings() -> None:
    """One upright sling: m·ω² = 1/(l/EA + 1/k), with the mass of the water along z."""
    k, added = 4e5, 1500.0
    body = RigidBodyParams(
        size_m=(4.0, 3.0, 1.0), inertia_kg_m2=INERTIA,
        slings=(Sling(to_m=(0.0, 0.0, 0.5), length_m=5.0, stiffness_n_per_m=k),), **DRY,
    )  # fmt: skip
    rig = replace(RIG, EA=2e7, added=(0.0, 0.0, added))
    bounce = find_modes(scene_of(rig, body), 6).axial[0]
    stiffness = 1.0 / (LENGTH_M / 2e7 + 1.0 / k)
    assert bounce.kind == "axial"
    assert bounce.frequency_hz * 2.0 * math.pi == pytest.approx(
        math.sqrt(stiffness / (MASS + added)), rel=1e-4
    )


def test_righting_mode_by_buoyancy() -> None:
    """A body held at its centre of gravity: I·ω² = B·b, B the lift at b above it."""
    lift = 1.2 * 1025.0 * G
    body = RigidBodyParams(
        size_m=(4.0, 3.0, 1.0), inertia_kg_m2=INERTIA, centre_of_buoyancy_m=(0.0, 0.0, 0.4),
        pinned_at_m=(0.0, 0.0, 1e-6), pin_stiffness_n_per_m=1e11, **DRY,
    )  # fmt: skip
    rig = replace(RIG, density=1025.0, volume=1.2, load=4000.0)
    computed = [mode for mode in find_modes(scene_of(rig, body), 5).lowest if mode.period_s < 1e3]
    turning = [mode for mode in computed if mode.kind == "turning"]
    wanted = [2.0 * math.pi * math.sqrt(inertia / (lift * 0.4)) for inertia in (1300.0, 800.0)]
    assert [mode.period_s for mode in turning] == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "words"),
    [("lift_off", "stands on the deck"), ("manifold_lift", "not fully submerged")],
)
def test_modes_of_a_grounded_body_are_rejected(name: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        find_modes(load_scene(name), 3)


def test_modes_of_a_body_on_two_lines(capsys: pytest.CaptureFixture[str]) -> None:
    """The command prints turning modes; an assessment of VIV in modes needs a point or an end."""
    assert main(["modes", "load_transfer", "--count", "4", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    lowest = [row for row in rows if row["group"] == "lowest"]
    assert [row["kind"] for row in lowest].count("turning") >= 1
    assert max(row["turning_share"] for row in lowest) > 0.9
    with pytest.raises(SceneError, match="not assessed in modes"):
        spans_of(load_scene("load_transfer"))
    assert len(find_system_modes(load_scene("load_transfer"), 4).lowest) == 4
