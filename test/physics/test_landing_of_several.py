"""Multi-line systems on the seabed: each payload lands by itself; ropes without a payload."""

from __future__ import annotations

from pathlib import Path

import pytest

from rope_twin import Twin, fed, load_scene
from rope_twin.alerts.situations import SituationMonitor

WINCH = """speed_limit_m_per_s: 1.5, acceleration_limit_m_per_s2: 0.2,
    min_line_out_m: 5.0, max_line_out_m: 80.0, schedule: [{at_s: 0.0, speed_m_per_s"""
ROPES = f"""
about: two ropes, 30 m apart, over a level bed
hang_offs: [{{name: tip, at_m: [30.0, 0.0, 0.0], winch: {{{WINCH}: 1.0}}]}}}}]
winch: {{{WINCH}: 0.2}}]}}
effects:
  - weight: {{}}
  - drag: {{normal: 1.2, tangential: 0.02}}
  - added_mass: {{}}
  - seabed: {{depth_m: 40.0}}
  - payload: {{}}
time: {{step_s: 0.01}}
ropes:
"""
LINE = """  - {{name: {to} on {start}, from: {start}, rope: steel_wire_40mm, length_m: {length_m},
     elements: 4, damping: {{newton_seconds: 2000000.0}}, to: {to}}}
"""
LOAD = """  - {{name: {0}, mass_kg: 8000.0, displaced_volume_m3: 2.0, drag_area_m2: [6.0, 6.0, 6.0],
     added_mass_kg: [3000.0, 3000.0, 3000.0]}}
"""


def test_each_payload_lands_at_its_own_speed(tmp_path: Path) -> None:
    """The slower one of two lands first, while the other still sinks at five times its speed."""
    path = tmp_path / "two_loads.yaml"
    lines = LINE.format(start="winch", to="slow", length_m=39.4)
    lines += LINE.format(start="tip", to="fast", length_m=35.5)
    loads = "payloads:\n" + LOAD.format("slow") + LOAD.format("fast")
    limits = "limits: {landing_speed_m_per_s: 0.8, bed_clearance_m: 1.0}\n"
    path.write_text(ROPES + lines + loads + limits)
    scene = load_scene(path)
    twin, watch = Twin(scene), SituationMonitor(scene)
    watch.crew.set("landing_speed_m_per_s", "0.5")
    alerts, near = set(), {}
    for snapshot in fed(twin, 10.0):
        alerts |= {one.where for one in watch.observe(snapshot) if one.identifier == 10011}
        near.update({b.where: b for b in snapshot.breaches if b.limit == "bed_clearance_m"})
        if snapshot.landings is not None and snapshot.landings.count == 1:
            assert not any(b.limit == "landing_speed_m_per_s" for b in snapshot.breaches)
            first = snapshot
    assert first.landings.first_m_per_s == pytest.approx(0.2, rel=0.02)
    landings = snapshot.landings
    assert landings is not None
    assert landings.count == 2
    assert landings.fastest_m_per_s == pytest.approx(1.0, rel=0.02)
    (breach,) = (b for b in snapshot.breaches if b.limit == "landing_speed_m_per_s")
    assert (breach.where, breach.worst) == ("fast", landings.fastest_m_per_s)
    assert alerts == {"fast landing_speed_m_per_s"}
    assert near["slow"].first_s < near["fast"].first_s, "each has its own clearance"
    assert snapshot.seabed is not None
    weight_n = (8000.0 - 1025.0 * 2.0) * 9.80665
    assert [reaction_n for _, reaction_n in snapshot.seabed.payloads] == pytest.approx(
        [weight_n, weight_n], rel=0.02
    )


def test_ropes_without_a_payload_hang_over_the_bed(tmp_path: Path) -> None:
    """Two ropes that meet in a joint: its height is that of the lower ends."""
    path = tmp_path / "joined.yaml"
    lines = LINE.format(start="winch", to="ring", length_m=38.0)
    lines += LINE.format(start="tip", to="ring", length_m=38.0)
    path.write_text(ROPES + lines + "joints: [{name: ring, mass_kg: 50.0}]\n")
    snapshot = Twin(path).snapshot()
    assert snapshot.seabed is not None
    assert snapshot.seabed.payload_height_m == pytest.approx(
        40.0 + float(snapshot.ropes[0].node_position_m[-1, 2]), abs=1e-9
    )
    assert snapshot.seabed.payload_reaction_n == 0.0
    assert snapshot.landings is None
