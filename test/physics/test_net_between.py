"""Nets between ropes, against nets of fixed heading and the force of each panel."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rope_twin import Twin, load_scene
from rope_twin.core import state as rows
from rope_twin.core.loads.panel import panel_coefficients
from rope_twin.core.state import Floats
from rope_twin.effects.net_curtain import SHARE, NetCurtain
from rope_twin.scene.relations import faults
from rope_twin.twin.monitors import ENERGY

LINE = "rope: steel_wire_40mm, damping: {newton_seconds: 2.0e+5}"
NET = "twine_m: 0.003, bar_m: 0.03, solidity: 0.2, from_m: 2.0, to_m: 22.0"
APART_M, TURN_DEG = 6.0, 35.0
SPAN = (math.cos(math.radians(TURN_DEG)), math.sin(math.radians(TURN_DEG)))
FLOW = (-0.8 * SPAN[1], 0.8 * SPAN[0])  # across the span


def spread(nets: str, masses: tuple[float, ...], flow: tuple[float, float] = FLOW) -> str:
    """Lines side by side from hang-offs along SPAN, sinkers below them, joined by bars."""
    names = [f"line_{k}" for k in range(len(masses))]
    at = [[APART_M * k * part for part in SPAN] for k in range(len(masses))]
    ropes = [
        f"  - {{name: {name}, {LINE}, length_m: 24.0, elements: 12, to: sinker_{k}"
        + (f", from: top_{k}}}" if k else "}")
        for k, name in enumerate(names)
    ]
    sinkers = [
        f"  - {{name: sinker_{k}, mass_kg: {mass}, displaced_volume_m3: 0.1,"
        " added_mass_kg: [100.0, 100.0, 100.0], drag_area_m2: [0.0, 0.0, 0.0]}"
        for k, mass in enumerate(masses)
    ]
    tops = [f"  - {{name: top_{k}, at_m: [{at[k][0]}, {at[k][1]}, -5.0]}}"
            for k in range(1, len(masses))]  # fmt: skip
    bars = [
        f"  - {{name: bar_{k}, between: [sinker_{k}, sinker_{k + 1}], length_m: {APART_M},"
        " mass_kg: 50.0}"
        for k in range(len(masses) - 1)
    ]
    return "\n".join([
        "about: nets between lines", "source: made up for a test", "look_at: nothing",
        "ropes:", *ropes, "payloads:", *sinkers, "hang_offs:", *tops, "struts:", *bars,
        "ship: {hang_off_m: [0.0, 0.0, -5.0], motion_ramp_s: 0.0}",
        "effects:",
        f"  - current: {{profile: [[0.0, [{flow[0]}, {flow[1]}]]]}}",
        "  - weight: {}", "  - drag: {normal: 0.0, tangential: 0.0}",
        "  - added_mass: {normal: 1.0}", "  - payload: {}", f"  - net_curtain: {{{NET}, {nets}}}",
        "time: {step_s: 0.01, newton_tolerance_n: 1.0e-5}", "",
    ])  # fmt: skip


def twin_of(text: str, folder: Path, energy: bool = False) -> Twin:
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    scene = load_scene(str(path))
    return Twin(scene, ENERGY) if energy else Twin(scene)


def heaved(twin: Twin, seconds: float = 4.0) -> Floats:
    """All nodes every 0.2 s, in a heave of 0.5 m in 4 s."""
    omega, seen = 0.5 * math.pi, []
    for stamp in range(0, round(seconds * 1e9) + 50_000_000, 50_000_000):
        t = stamp * 1e-9
        z, v = 0.5 * (1.0 - math.cos(omega * t)), 0.5 * omega * math.sin(omega * t)
        assert not twin.submit_heave(stamp, z, v)
    for _ in range(round(5.0 * seconds)):
        seen.append(np.concatenate([rope.node_position_m for rope in twin.snapshot().ropes]))
        twin.advance(20)
    return np.array(seen)


def test_a_net_between_equal_lines_equals_nets_of_fixed_heading(tmp_path: Path) -> None:
    """Two equal lines keep their distance: half of the width on each, along the span."""
    between = heaved(
        twin_of(spread("width_m: 6.0, between: [[line_0, line_1]]", (900.0, 900.0)), tmp_path)
    )
    held = heaved(
        twin_of(spread(f"width_m: 3.0, heading_deg: {TURN_DEG}", (900.0, 900.0)), tmp_path)
    )
    assert np.abs(held[0] - held[-5]).max() > 0.2, "it must move"
    lean = held[0][12] - held[0][0]
    assert math.hypot(*lean[:2]) > 5.0, "the net must matter"
    assert np.abs(between - held).max() < 1e-7


def net_m(rope: rows.Rope) -> float:
    """Length of rope that carries net, as the nodes have it."""
    n = int(rope.state.counts[rows.ELEMENTS])
    (net,) = (effect for effect in rope.effects if isinstance(effect, NetCurtain))
    half = 0.5 * np.diff(rope.state.s[: n + 1])
    return float(net.memory[SHARE, : n + 1] @ (np.append(half, 0.0) + np.append(0.0, half)))


def shape_force(lines: list[Floats], pairs: list[tuple[int, int]]) -> Floats:
    """Drag and lift of all panels, from where the nodes are: half elements, half widths [N]."""
    along, facing, lift = panel_coefficients("loeland", 0.2)
    U, total = np.array([*FLOW, 0.0]), np.zeros(3)
    speed = float(np.linalg.norm(U))
    for own, other in (*pairs, *(pair[::-1] for pair in pairs)):
        x, far = lines[own], lines[other]
        steps = np.diff(x, axis=0)
        units = steps / np.linalg.norm(steps, axis=1)[:, None]
        for i in range(1, 12):  # 2 m above each end: whole nodes but for the outermost halves
            t = units[i - 1] + units[i]
            n = np.cross(t, far[i] - x[i])
            n /= np.linalg.norm(n)
            cosine = float(n @ U) / speed
            n, cosine = (n, cosine) if cosine > 0.0 else (-n, -cosine)
            across = n - cosine * U / speed
            size = math.sqrt(float(across @ across))
            C_L = lift * 2.0 * cosine * size
            area = 6.0 * 0.5 * (1.0 if 1 < i < 11 else 0.5) * 2.0
            C_D = along + facing * cosine
            total += 0.5 * 1025.0 * area * (C_D * speed * U + C_L * speed**2 * across / size)
    return total


def test_top_forces_of_three_unequal_lines_with_nets(tmp_path: Path) -> None:
    """The forces are those of panels that turn with the distances of the lines."""
    twin = twin_of(
        spread("width_m: 6.0, between: [[line_0, line_1], [line_1, line_2]]",
               (700.0, 1500.0, 900.0)), tmp_path,
    )  # fmt: skip
    snapshot = twin.snapshot()
    lines = [rope.node_position_m for rope in snapshot.ropes]
    pull = np.zeros(3)
    for rope in snapshot.ropes:  # above the net a line has no load but its weight
        step = rope.node_position_m[0] - rope.node_position_m[1]
        pull -= rope.element_tension_n[0] * step / np.linalg.norm(step)
    expected = shape_force(lines, [(0, 1), (1, 2)])
    middle, side = lines[1][6] - lines[1][0], lines[0][6] - lines[0][0]
    assert np.abs(middle - side).max() > 0.2, "the lines must lean differently"
    assert pull[:2] == pytest.approx(expected[:2], rel=1e-5)


def test_energy_balance_of_a_net_between_lines(tmp_path: Path) -> None:
    """Unequal lines in heave, with the nets' own power."""
    twin = twin_of(
        spread("width_m: 6.0, between: [[line_0, line_1]]", (700.0, 1500.0)), tmp_path, energy=True
    )
    heaved(twin)
    energy = twin.snapshot().energy
    assert energy is not None
    assert abs(energy.water_j) > 1e3
    assert abs(energy.residual_j) < 2e-5 * energy.exchanged_j


def test_a_cut_line_divides_its_net(tmp_path: Path) -> None:
    """9 m stay on the upper part and 11 m go down; a saved run resumes bit-identically."""
    text = spread("width_m: 6.0, between: [[line_0, line_1]]", (900.0, 900.0))
    twin = twin_of(text, tmp_path)
    assert not twin.submit_cut(500_000_000, 11.0, "line_0")
    twin.advance(100)
    assert twin.joined is not None
    shares = [net_m(rope) for rope in twin.joined.system(twin.rope).ropes]
    assert shares == pytest.approx([9.0, 20.0, 11.0])
    twin.save(tmp_path / "state")
    other = Twin.restore(tmp_path / "state", load_scene(str(tmp_path / "scene.yaml")))
    for run in (twin, other):
        run.advance(100)
    for own, restored in zip(twin.snapshot().ropes, other.snapshot().ropes, strict=True):
        assert np.array_equal(own.node_position_m, restored.node_position_m)


@pytest.mark.parametrize(
    ("nets", "said"),
    [
        ("between: [[line_0, line_9]]", "there is no rope 'line_9'"),
        ("between: [[line_0, line_0]]", "a rope is paired with itself"),
        ("between: [[line_0, line_1], [line_1, line_0]]", "is listed twice"),
        ("between: [[line_0, line_1], [line_0, line_1], [line_1, line_0]]", "has two sides"),
    ],
)
def test_nets_between_wrong_ropes_are_rejected(nets: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(spread("width_m: 6.0, heading_deg: 0.0", (900.0, 900.0)), encoding="utf-8")
    good = load_scene(str(path))
    assert not list(faults(good))
    path.write_text(spread(f"width_m: 6.0, {nets}", (900.0, 900.0)), encoding="utf-8")
    with pytest.raises(Exception, match=said):
        load_scene(str(path))
