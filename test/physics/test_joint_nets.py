"""Nets and fairings of payloads in multi-line systems: closed forms, and a rope cut by a ring."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rope_twin import Twin, load_scene
from rope_twin.core.state import Floats
from rope_twin.effects.payload_faces import FairingParams, NetParams, coefficients
from rope_twin.twin.monitors import ENERGY

LINE = "rope: steel_wire_40mm, damping: {newton_seconds: 2.0e+5}"
WHOLE = f"ropes:\n  - {{name: hoist, {LINE}, length_m: 40.0, elements: 10, to: tool}}\n"
CUT = f"""ropes:
  - {{name: hoist, {LINE}, length_m: 24.0, elements: 6, to: ring}}
  - {{name: sling, {LINE}, length_m: 16.0, elements: 4, from: ring, to: tool}}
joints: [{{name: ring}}]
"""
LIFT = """about: payload with a net and a fairing in a current
source: made up for a test
look_at: nothing
payloads:
  - name: tool
    mass_kg: 8000.0
    shape: {box: {length_m: 2.0, width_m: 1.5, height_m: 1.0}}
    displaced_volume_m3: 2.0
ship: {hang_off_m: [0.0, 0.0, 0.0], motion_ramp_s: 0.0}
effects:
  - current: {profile: [[0.0, [0.9, 0.2]], [-60.0, [0.5, 0.4]]]}
  - weight: {}
  - drag: {normal: 1.2, tangential: 0.02}
  - added_mass: {normal: 1.0}
  - payload: {}
  - net: {width_m: 6.0, height_m: 4.0, solidity: 0.2, facing_deg: 40.0, panels: 2}
  - fairing: {face_m2: 3.0, drag: 0.9, axis: [0.3, -0.2, 1.0]}
time: {step_s: 0.01, newton_tolerance_n: 1.0e-5}
"""
SAMPLE_NS = 50_000_000


def heaved(text: str, path: Path, seconds: float = 8.0) -> Floats:
    """Top tension and the payload's place every 0.1 s, in a heave of 0.8 m in 5 s."""
    path.write_text(text, encoding="utf-8")
    twin, omega, seen = Twin(load_scene(str(path))), 2.0 * math.pi / 5.0, []
    for stamp in range(0, round(seconds * 1e9) + SAMPLE_NS, SAMPLE_NS):
        t = stamp * 1e-9
        z, v = 0.8 * (1.0 - math.cos(omega * t)), 0.8 * omega * math.sin(omega * t)
        assert not twin.submit_heave(stamp, z, v)
    for _ in range(round(10.0 * seconds)):
        twin.advance(10)
        snapshot = twin.snapshot()
        end = (snapshot.ropes[-1] if snapshot.ropes else snapshot).node_position_m[-1]
        seen.append([snapshot.tension_top_n, *end])
    return np.array(seen)


@pytest.mark.long
def test_a_payload_net_and_fairing_on_a_rope_with_a_ring(tmp_path: Path) -> None:
    """Tension and position over 8 s of heave equal those of a single rope."""
    cut, whole = (heaved(ropes + LIFT, tmp_path / "scene.yaml") for ropes in (CUT, WHOLE))
    without = heaved(WHOLE + LIFT.replace("panels: 2", "panels: 1"), tmp_path / "scene.yaml")
    assert np.abs(without - whole).max() > 1e-2, "the net matters"
    scale = np.abs(whole).max(axis=0)
    assert (np.abs(cut - whole).max(axis=0) < 1e-8 * scale).all()


@pytest.mark.long
def test_net_curtains_on_connected_ropes_equal_one_curtain(tmp_path: Path) -> None:
    """Up to 16 m on each of the two ropes, which is all of the lower one: 32 m of the whole.

    1e-4 of what the lower net does: at the ring each rope's half node has a tangent of its own. The
    whole rope has waves of no height: its step is that of the shipped net_curtain.
    """
    listed = LIFT[LIFT.index("  - net:") : LIFT.index("time:")]
    net = "width_m: 2.0, twine_m: 0.003, bar_m: 0.03, heading_deg: 120.0"
    calm = "  - waves: {regular: {height_m: 0.0, period_s: 8.0}}\n"
    cut, whole, upper = (
        heaved(ropes + LIFT.replace(listed, f"  - net_curtain: {{{net}, {own}}}\n{more}"),
               tmp_path / "scene.yaml", 4.0)
        for ropes, own, more in ((CUT, "to_m: 16.0", ""), (WHOLE, "to_m: 32.0", calm),
                                 (CUT, "to_m: 16.0, rope: hoist", ""))
    )  # fmt: skip
    matters = np.abs(upper - whole).max(axis=0)
    assert matters[0] > 100.0
    assert matters[1:].max() > 0.5
    assert (np.abs(cut - whole).max(axis=0) < 1e-4 * matters).all()


BRIDLE = f"""about: two payloads under a bar, a third below one of them, in an even current
source: made up for a test
look_at: nothing
ropes:
  - {{name: hoist, {LINE}, length_m: 40.0, elements: 8, to: hook}}
  - {{name: leg_port, {LINE}, length_m: 5.0, elements: 4, from: hook, to: port}}
  - {{name: leg_starboard, {LINE}, length_m: 5.0, elements: 4, from: hook, to: starboard}}
  - {{name: sling, {LINE}, length_m: 6.0, elements: 4, from: port, to: lower}}
joints: [{{name: hook, mass_kg: 200.0}}]
struts: [{{name: bar, between: [port, starboard], length_m: 5.0, mass_kg: 300.0}}]
payloads:
"""
PAYLOAD = """  - name: {name}
    mass_kg: {mass}
    displaced_volume_m3: 0.5
    added_mass_kg: [500.0, 500.0, 500.0]
    drag_area_m2: [0.0, 0.0, 0.0]
"""
CURRENT = (0.8, 0.3)
WATER = f"""ship: {{hang_off_m: [0.0, 0.0, 0.0]}}
effects:
  - current: {{profile: [[0.0, [{CURRENT[0]}, {CURRENT[1]}]]]}}
  - weight: {{}}
  - drag: {{normal: 0.0, tangential: 0.0}}
  - added_mass: {{normal: 1.0}}
  - payload: {{}}
  - net: {{width_m: 5.0, height_m: 3.0, solidity: 0.2, facing_deg: 25.0, payload: lower}}
  - fairing: {{face_m2: 2.0, drag: 0.9, axis: [1.0, 0.0, 0.0], payload: NAME}}
time: {{step_s: 0.01}}
"""
OWN_NET = "    net: {width_m: 2.0, height_m: 2.0, solidity: 0.1, facing_deg: 90.0}\n"
OWN_FAIRING = "    fairing: {face_m2: 0.5, axis: [0.0, 1.0, 0.0]}\n"
HALF = 0.5 * 1025.0  # ½·ρ


def bridle(own: dict[str, str], fairing_of: str) -> str:
    """The bridle's scene, with keys that payloads have of their own."""
    masses = {"port": 3000.0, "starboard": 6000.0, "lower": 4000.0}
    payloads = [PAYLOAD.format(name=name, mass=mass) + own.get(name, "")
                for name, mass in masses.items()]  # fmt: skip
    return BRIDLE + "".join(payloads) + WATER.replace("NAME", fairing_of)


def pull_east_north(text: str, path: Path) -> Floats:
    """Horizontal force on the ship in equilibrium, which is the drag of all that hangs [N]."""
    path.write_text(text, encoding="utf-8")
    return Twin(load_scene(str(path))).snapshot().hang_off_force_n[:2]


def net_force(params: NetParams) -> Floats:
    """½·ρ·A·(C_D·|U|·U + C_L·|U|²·the direction across the flow towards the normal) [N]."""
    U, angle = np.array(CURRENT), math.radians(params.facing_deg)
    speed, normal = math.hypot(*CURRENT), np.array([math.cos(angle), math.sin(angle)])
    along, facing, lift = coefficients(params)
    cosine = float(normal @ U) / speed
    assert cosine > 0.0
    across = normal - cosine * U / speed
    across /= np.sqrt(across @ across)
    C_D, C_L = along + facing * cosine, lift * math.sin(2.0 * math.acos(cosine))
    area = params.width_m * params.height_m
    return np.asarray(HALF * area * (C_D * speed * U + C_L * speed**2 * across))


def fairing_force(params: FairingParams) -> Floats:
    """½·ρ·C_D·A·|V|·V along the axis, V = U·e [N]."""
    axis = np.array(params.axis[:2])
    V = float(axis @ np.array(CURRENT))
    return np.asarray(HALF * params.drag * params.face_m2 * abs(V) * V * axis)


LISTED_NET = NetParams(width_m=5.0, height_m=3.0, solidity=0.2, facing_deg=25.0)
LISTED_FAIRING = FairingParams(face_m2=2.0, drag=0.9, axis=(1.0, 0.0, 0.0))
NET_OF_PORT = NetParams(width_m=2.0, height_m=2.0, solidity=0.1, facing_deg=90.0)
FAIRING_OF_LOWER = FairingParams(face_m2=0.5, axis=(0.0, 1.0, 0.0))


@pytest.mark.parametrize(
    ("own", "fairing_of", "nets", "fairings"),
    [
        ({}, "starboard", [LISTED_NET], [LISTED_FAIRING]),
        ({"port": OWN_NET, "lower": OWN_FAIRING}, "starboard",
         [LISTED_NET, NET_OF_PORT], [LISTED_FAIRING, FAIRING_OF_LOWER]),
        ({}, "''", [LISTED_NET], 3 * [LISTED_FAIRING]),
    ],
    ids=["at the named payloads", "of their own", "at each payload"],
)  # fmt: skip
def test_the_horizontal_pull_of_a_bridle_is_its_net_and_fairing_drag(
    own: dict[str, str], fairing_of: str, nets: list[NetParams], fairings: list[FairingParams],
    tmp_path: Path,
) -> None:  # fmt: skip
    """Static equilibrium where nothing else has drag."""
    actual = pull_east_north(bridle(own, fairing_of), tmp_path / "scene.yaml")
    expected = sum(map(net_force, nets)) + sum(map(fairing_force, fairings))
    assert actual == pytest.approx(np.asarray(expected), abs=1e-4)


def test_energy_balance_of_a_bridle_with_nets() -> None:
    """In a heave of 1 m in 6 s, with the power of nets and fairings."""
    scene = load_scene("bridle_lift")
    face = FairingParams(face_m2=4.0, payload="half_port")
    scene = replace(
        scene,
        effects=(*scene.effects, replace(LISTED_NET, payload="half_starboard"), face),
        time=replace(scene.time, newton_tolerance_n=0.1),
    )
    twin, omega = Twin(scene, ENERGY), 2.0 * math.pi / 6.0
    for k in range(121):
        t = 0.05 * k
        twin.submit_heave(round(t * 1e9), math.sin(omega * t), omega * math.cos(omega * t))
    twin.advance(round(6.0 / twin.step_s))
    energy = twin.snapshot().energy
    assert energy is not None
    assert energy.exchanged_j > 1e5
    assert abs(energy.residual_j) < 5e-6 * energy.exchanged_j
