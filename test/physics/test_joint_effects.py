"""Sea, splash zone and seabed at joints: a rope with a massless ring equals a single rope."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from joint_rigs import STIFF, JointBench, Line

from rope_twin import Snapshot, Twin, load_scene
from rope_twin.core import state as rows
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.joined.joints import LOOSE, Joined
from rope_twin.core.joined.stage import count_unbalanced
from rope_twin.core.state import Floats

LINE = "rope: steel_wire_40mm, damping: {newton_seconds: 5.0e+5}"
WHOLE = f"ropes:\n  - {{name: hoist, {LINE}, length_m: 8.0, elements: 6, to: tool}}\n"
CUT = f"""ropes:
  - {{name: hoist, {LINE}, length_m: 4.0, elements: 3, to: ring}}
  - {{name: sling, {LINE}, length_m: 4.0, elements: 3, from: ring, to: tool}}
joints: [{{name: ring}}]
"""
REST = """about: payload through the surface and onto the bed
source: made up for a test
look_at: nothing
payloads:
  - name: tool
    mass_kg: 20000.0
    shape: {box: {length_m: 4.0, width_m: 3.0, height_m: 2.5}}
    displaced_volume_m3: 6.0
winch: {speed_limit_m_per_s: 1.0, acceleration_limit_m_per_s2: 0.5, min_line_out_m: 3.0,
        max_line_out_m: 40.0}
ship: {hang_off_m: [0.0, 0.0, 9.0]}
sea_state: {bag: sea_1p2m}
effects:
  - current: {profile: [[0.0, [0.4, 0.1]], [-30.0, [0.2, 0.1]]]}
  - waves: {regular: {height_m: 1.5, period_s: 6.0}, depth_m: 12, ramp_s: 2, neglected_m_per_s: 0}
  - weight: {}
  - drag: {normal: 1.9, tangential: 0.03}
  - added_mass: {normal: 1.0}
  - seabed: {depth_m: 12.0, slope: [0.05, 0.0], stiffness_n_per_m3: 1.0e+5}
  - payload: {}
  - splash_zone: {height_m: 2.5, bottom_area_m2: 12.0}
time: {step_s: 0.005, newton_tolerance_n: 0.001}
"""
SECOND_NS, SAMPLE_NS = 1_000_000_000, 50_000_000
SECONDS, TURN = 28, 17


def lowered(text: str, path: Path) -> list[Snapshot]:
    """Pay out at 0.8 m/s for 17 s, then haul in, in a heave of 0.3 m; sample each second."""
    path.write_text(text, encoding="utf-8")
    twin, snapshots = Twin(load_scene(str(path))), []
    assert not twin.submit_heave(0, 0.0, 0.3)
    for second in range(SECONDS):
        for stamp in range(SAMPLE_NS, SECOND_NS + 1, SAMPLE_NS):
            angle = second + stamp * 1e-9
            z, v = 0.3 * math.sin(angle), 0.3 * math.cos(angle)
            assert not twin.submit_heave(second * SECOND_NS + stamp, z, v)
        if second in (0, TURN):
            assert not twin.submit_speed(None, 0.8 if second == 0 else -0.8)
        twin.advance(round(1.0 / twin.step_s))
        snapshots.append(twin.snapshot())
    return snapshots


def seen(snapshots: list[Snapshot]) -> Floats:
    """Top tension now, its extremes in the last second, the load's place, the seabed reaction."""
    rows = []
    for snapshot in snapshots:
        assert snapshot.seabed is not None
        assert not snapshot.not_converged
        extremes = snapshot.tension_top_min_n, snapshot.tension_top_max_n
        end = (snapshot.ropes[-1] if snapshot.ropes else snapshot).node_position_m[-1]
        bed = snapshot.seabed.payload_reaction_n, snapshot.seabed.payload_height_m
        rows.append([snapshot.tension_top_n, *extremes, *end, *bed])
    return np.array(rows)


def test_a_rope_with_a_ring_equals_a_single_rope_in_surface_and_seabed(tmp_path: Path) -> None:
    """Through surface and waves onto the bed and off: tension, position, bed reaction.

    Without the waves' short cut, whose stretches end where a rope does.
    """
    cut, whole = (seen(lowered(rope + REST, tmp_path / "scene.yaml")) for rope in (CUT, WHOLE))
    assert whole[0, 5] > -1.0, "it begins in the splash zone"
    assert whole[TURN, 6] > 1e5, "it lies on the bed"
    assert whole[-1, 6] == 0.0, "and is lifted again"
    assert whole[:, 1].min() < 0.05 * whole[:, 2].max(), "slack on the bed"
    scale = np.abs(whole).max(axis=0)
    assert (np.abs(cut - whole).max(axis=0) < 1e-5 * scale).all(), "found: 4e-6 after a snap"


@jit_entry
def left(system: Joined) -> int:
    """Number of connections above the tolerance."""
    return int(count_unbalanced(system))


def test_a_connection_with_nan_force_is_not_converged() -> None:
    """Tolerance 5 N: one of three connections is below, one above, one NaN."""
    rig = replace(STIFF, tolerance=5.0)
    depths, ends = [0.0, -20.0, -40.0, -60.0, -80.0], [LOOSE, 0, 1, 2, LOOSE]
    lines = [
        Line(rig=rig, low=(0.0, 0.0, low), high=(0.0, 0.0, high), lower=below, upper=above)
        for (high, low), (above, below) in zip(pairwise(depths), pairwise(ends), strict=True)
    ]
    system = JointBench(lines).system
    joined = Joined(system.stack, system.joints, system.sheaves)
    residual = system.joints.work[rows.RESIDUAL : rows.RESIDUAL + 3]
    residual[:, 0] = 3.0, 0.0, 3.9
    assert left(joined) == 0
    residual[:, 1] = 3.0, 0.0, 4.1
    assert left(joined) == 1
    residual[1, 2] = np.nan
    assert left(joined) == 2
