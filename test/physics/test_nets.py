"""Net panels against published coefficients, from every side; fairings by own and tow speed."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_cases import loads, some_stage, some_work
from rigs import Rig, Vector

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.effects import Surroundings
from rope_twin.effects.payload_faces import (
    FairingParams,
    NetParams,
    build_fairing,
    build_net,
    coefficients,
)
from rope_twin.scene.relations import faults

WATER = Surroundings(1025.0, 9.80665, 0.0)
PANEL = NetParams(width_m=20.0, height_m=10.0, solidity=0.2)
HALF = 0.5 * 1025.0 * 200.0  # ½·ρ·A


def force(effect: Any, velocity: tuple[float, float, float]) -> Vector:
    """Force on the lower end that moves through still water."""
    work = some_work()
    work[rows.VELOCITY : rows.VELOCITY + 3, 0] = velocity
    found: Vector = (loads((effect,), work) - loads((), work))[3:6, 0]
    return found


def pushed(params: NetParams, flow: tuple[float, float, float]) -> Vector:
    x, y, z = flow
    return force(build_net(params, None, WATER), (-x, -y, -z))


@pytest.mark.parametrize(
    ("law", "drag", "lift"), [("aarsnes", 0.2600, 0.0532), ("loeland", 0.2886, 0.0679)]
)
def test_published_net_coefficients(law: str, drag: float, lift: float) -> None:
    """Sn 0.2: C_D across the flow and C_L at 45°, as printed; C_D 0.04 along the flow."""
    params = replace(PANEL, law=law)
    assert pushed(params, (2.0, 0.0, 0.0)) / (HALF * 4.0) == pytest.approx(
        [drag, 0.0, 0.0], abs=5e-5
    )
    assert pushed(params, (0.0, 2.0, 0.0)) / (HALF * 4.0) == pytest.approx(
        [0.0, 0.04, 0.0], abs=1e-12
    )
    root = math.sqrt(0.5)
    at_45 = pushed(params, (2.0 * root, 2.0 * root, 0.0)) / (HALF * 4.0)
    towards_normal = np.array([root, -root, 0.0])
    assert at_45 @ towards_normal == pytest.approx(lift, abs=5e-5)
    facing = 0.04 + (drag - 0.04) * root
    assert at_45 @ np.array([root, root, 0.0]) == pytest.approx(facing, abs=5e-5)


def test_net_forces_under_reversal_and_rotation() -> None:
    """Reversed flow reverses the force; a turned panel in turned flow has the turned force."""
    flow = (0.7, 0.4, -0.3)
    ahead, astern = pushed(PANEL, flow), pushed(PANEL, (-0.7, -0.4, 0.3))
    assert astern == pytest.approx(-ahead)
    c, s = math.cos(math.radians(50.0)), math.sin(math.radians(50.0))
    turned = pushed(replace(PANEL, facing_deg=50.0), (0.7 * c - 0.4 * s, 0.7 * s + 0.4 * c, -0.3))
    x, y, z = ahead
    assert turned == pytest.approx([c * x - s * y, s * x + c * y, z])
    up = pushed(PANEL, (0.0, 0.0, 1.0))
    assert up == pytest.approx([0.0, 0.0, 0.04 * HALF], abs=1e-9)


def test_wake_shielding_of_panels_in_a_row() -> None:
    """The n-th sees (1 - 0.46·C_D)^(n-1) of the speed: forces are a geometric series."""
    drag = 0.2886
    one, three = (pushed(replace(PANEL, panels=n), (1.0, 0.0, 0.0))[0] for n in (1, 3))
    slower = (1.0 - 0.46 * drag) ** 2
    assert three / one == pytest.approx(1.0 + slower + slower**2, rel=1e-4)


def test_solidity_of_a_mesh() -> None:
    """Square meshes of 3 mm twine and 30 mm bars: 1 - 0.9² = 0.19."""
    meshed = NetParams(width_m=1.0, height_m=1.0, twine_m=0.003, bar_m=0.03)
    assert meshed.check() is None
    assert coefficients(meshed) == pytest.approx(
        coefficients(NetParams(width_m=1.0, height_m=1.0, solidity=0.19))
    )


def test_static_angle_of_a_towed_net() -> None:
    """At rest in a current: the lowest element points along drag and weight, 0.1 %."""
    rig = Rig(
        length=100.0, elements=10, mass=0.5, load=4e3, volume=0.5, density=1025.0, damping=1e5,
        step=0.02, current=((0.0, (1.2, 0.0)), (-200.0, (1.2, 0.0))),
    )  # fmt: skip
    scene = rig.scene()
    twin = Twin(replace(scene, effects=(*scene.effects, PANEL)))
    nodes = twin.snapshot().node_position_m
    east, _, up = nodes[-2] - nodes[-1]
    weight = (4e3 - 0.5 * 1025.0) * 9.80665
    drag = 0.2886 * HALF * 1.2**2
    rope = 0.5 * 5.0 * 9.80665  # half of the lowest element
    assert -east / up == pytest.approx(drag / (weight + rope), rel=5e-3)


@pytest.mark.parametrize(
    ("params", "said"),
    [
        (replace(PANEL, law="aarsness"), "unknown law 'aarsness'; give one of"),
        (replace(PANEL, twine_m=0.003), "given exactly once"),
        (replace(PANEL, solidity=None), "given exactly once"),
        (replace(PANEL, solidity=None, twine_m=0.003, bar_m=0.01), "solidity 0.51 is above 0.35"),
        (replace(PANEL, solidity=None, twine_m=0.02, bar_m=0.01), "leaves no mesh between knots"),
    ],
)  # fmt: skip
def test_invalid_nets_are_rejected(params: NetParams, said: str) -> None:
    assert said in (params.check() or "")


FACE = FairingParams(face_m2=6.0, drag=0.8)


def test_fairing_drag_by_own_speed() -> None:
    k = 0.5 * 1025.0 * 0.8 * 6.0
    built = build_fairing(FACE, None, WATER)
    assert force(built, (1.0, 2.0, -1.5)) == pytest.approx([0.0, 0.0, k * 2.25])
    tilted = build_fairing(replace(FACE, axis=(3.0, 0.0, 4.0)), None, WATER)
    V = 0.6 * 1.0 + 0.8 * 2.0
    assert force(tilted, (1.0, 5.0, 2.0)) == pytest.approx([-0.6 * k * V * V, 0, -0.8 * k * V * V])


def test_fairing_drag_by_tow_speed() -> None:
    """Whatever the payload does; at 3 s of a ramp of 12 s a quarter of it."""
    k = 0.5 * 1025.0 * 0.8 * 6.0
    assert some_stage().time == 3.0
    up = build_fairing(replace(FACE, tow_speed_m_per_s=1.5), None, WATER)
    assert force(up, (1.0, 2.0, -7.0)) == pytest.approx([0.0, 0.0, -k * 2.25])
    slow = build_fairing(replace(FACE, tow_speed_m_per_s=-1.5, ramp_s=12.0), None, WATER)
    assert force(slow, (0.0, 0.0, 0.0)) == pytest.approx([0.0, 0.0, 0.25 * k * 2.25])


def test_invalid_fairings_are_rejected() -> None:
    assert "zero vector" in (replace(FACE, axis=(0.0, 0.0, 0.0)).check() or "")
    assert "without a tow speed" in (replace(FACE, ramp_s=3.0).check() or "")
    scene = Rig(length=50.0, elements=5, load=100.0, volume=0.0).scene()
    line = replace(scene.ropes[0], to="", fixed_at_m=(0.0, 0.0, -50.0))
    bare = replace(scene, payloads=(), effects=(PANEL, FACE), ropes=(line,))
    reported = [what for where, what, _ in faults(bare) if where == "effects"]
    assert reported == [
        "`net` is at the payload, and there is none",
        "`fairing` is at the payload, and there is none",
    ]
