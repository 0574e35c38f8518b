"""Several flexible nets on the same ropes, and ropes with nets that come from winches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rope_twin import Snapshot, Twin, load_scene
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import UnpacedRun

G, DENSITY = 9.80665, 1025.0
LINE = "rope: steel_wire_40mm, damping: {newton_seconds: 2.0e+5}, length_m: 12.0, elements: 12"
MESH = (
    "between: [left, right], width_m: 6.0, columns: 1, twine_m: 0.003, bar_m: 0.03,"
    " twine_kg_per_m3: 1025.0, twine_stiffness_n: 4.0e+3, twine_breaking_load_n: 400.0,"
    " damping: {newton_seconds: 2.0e+3}"
)
WINCH = (
    "{speed_limit_m_per_s: 1.0, acceleration_limit_m_per_s2: 1.0, min_line_out_m: 9.5,"
    " max_line_out_m: 20.0, schedule: [{at_s: 0.1, line_out_m: 13.0}]}"
)
TEXT = f"""about: nets between two lines
source: made up for a test
look_at: nothing
ropes:
  - {{name: left, {LINE}, to: sinker_left}}
  - {{name: right, {LINE}, from: top_right, to: sinker_right}}
NETS
payloads:
  - {{name: sinker_left, mass_kg: 2000.0, shape: {{sphere: {{diameter_m: 0.8}}}}}}
  - {{name: sinker_right, mass_kg: 2000.0, shape: {{sphere: {{diameter_m: 0.8}}}}}}
hang_offs: [{{name: top_right, at_m: [0.0, 6.0, -5.0], winch: {WINCH}}}]
winch: {WINCH}
ship: {{hang_off_m: [0.0, 0.0, -5.0], motion_ramp_s: 0.0}}
effects:
  - current: {{profile: [[0.0, [0.5, 0.0]]]}}
  - weight: {{}}
  - drag: {{normal: 1.2, tangential: 0.02}}
  - added_mass: {{normal: 1.0}}
  - payload: {{}}
time: {{step_s: 0.01, newton_tolerance_n: 1.0e-3}}
"""
ONE = f"nets:\n  - {{name: wall, {MESH}, from_m: 2.0, to_m: 8.0, rows: 2}}"
TWO = (
    f"nets:\n  - {{name: foot, {MESH}, from_m: 2.0, to_m: 5.0, rows: 1}}\n"
    f"  - {{name: head, {MESH}, from_m: 5.0, to_m: 8.0, rows: 1}}"
)


def twin_of(nets: str, folder: Path, speed: float = 0.5) -> Twin:
    path = folder / "scene.yaml"
    path.write_text(TEXT.replace("NETS", nets).replace("[0.5, 0.0]", f"[{speed}, 0.0]"), "utf-8")
    return Twin(load_scene(str(path)))


def lines(snapshot: Snapshot) -> tuple[np.ndarray, np.ndarray]:
    """Places of the sinkers [m], and tension at the tops of the two lines [N]."""
    tops = [rope.element_tension_n[0] for rope in snapshot.ropes if rope.name in ("left", "right")]
    return np.array([payload.position_m for payload in snapshot.payloads]), np.array(tops)


def test_two_adjacent_nets_equal_one_net(tmp_path: Path) -> None:
    """Two half borders between the same connections carry what the whole one does."""
    whole = twin_of(ONE, tmp_path).snapshot()
    parts = twin_of(TWO, tmp_path).snapshot()
    for one, other in zip(lines(whole), lines(parts), strict=True):
        assert other == pytest.approx(one, rel=1e-5, abs=1e-4)
    named = {rope.name: rope.element_tension_n for rope in (*whole.ropes, *parts.ropes)}
    halves = named["foot_level_1_0"] + named["head_level_0_0"]
    assert halves == pytest.approx(named["wall_level_1_0"], rel=1e-4)
    assert halves.min() > 100.0


def test_each_net_has_the_drag_of_its_solidity(tmp_path: Path) -> None:
    """With bars twice as long the upper net pulls with its own solidity, as it would alone."""
    wide = TWO.replace("bar_m: 0.03", "bar_m: 0.06").replace("bar_m: 0.06", "bar_m: 0.03", 1)
    alone = {
        name: twin_of(f"nets:\n{row}", tmp_path)
        for name, row in zip(("foot", "head"), wide.split("\n")[1:], strict=True)
    }
    both, without = twin_of(wide, tmp_path), twin_of("", tmp_path)
    drift = {name: lines(twin.snapshot())[0][:, 0].sum() for name, twin in alone.items()}
    bare = lines(without.snapshot())[0][:, 0].sum()
    together = lines(both.snapshot())[0][:, 0].sum()
    assert drift["foot"] - bare > 1.2 * (drift["head"] - bare) > 0.0
    assert together - bare == pytest.approx(drift["foot"] + drift["head"] - 2.0 * bare, rel=0.03)


def test_winches_lower_a_net_by_the_payout(tmp_path: Path) -> None:
    """In still water: sinkers 1 m lower, and 1 m of rope's weight more at the tops.

    The net follows by its drag, which draws the lines together alike.
    """
    twin_of(TWO, tmp_path, speed=0.0)
    run = UnpacedRun(RunOptions(scene=str(tmp_path / "scene.yaml"), speed=0.0))
    positions, tops = lines(run.twin.snapshot())
    while run.twin.time_ns < 30_000_000_000:
        run.advance_slot()
    after, pulled = lines(run.twin.snapshot())
    assert (after - positions)[:, 2] == pytest.approx(-1.0, abs=2e-3)
    assert after.sum(axis=0)[:2] == pytest.approx(positions.sum(axis=0)[:2], abs=1e-4)
    rope = load_scene(str(tmp_path / "scene.yaml")).ropes[0].rope
    assert rope is not None
    area = 0.25 * np.pi * (rope.hydrodynamic_diameter_m or 0.0) ** 2
    weight = G * (rope.mass_kg_per_m - DENSITY * area)
    assert pulled - tops == pytest.approx(weight, rel=0.05)
