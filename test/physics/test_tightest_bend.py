"""Minimum bend radius against circles, catenaries and folds; its position; what is stored."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rope_twin import Twin, load_scene
from rope_twin.cli import main
from rope_twin.messages import Level
from rope_twin.messages.diagnostics import statuses
from rope_twin.run.summary import RunSummary, summarise
from rope_twin.scene.convergence import scene_digest
from rope_twin.scene.schema import RopeSection, Scene
from rope_twin.twin.run_record import curvatures, minimum_radii
from rope_twin.twin.snapshot import Vector
from validation.rigs import Rig


def on_circle(radius: float, angles: Vector) -> tuple[Vector, Vector]:
    nodes = radius * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    chords = np.sqrt((np.diff(nodes, axis=0) ** 2).sum(axis=1))
    return nodes, np.concatenate([[0.0], np.cumsum(chords)])


@pytest.mark.parametrize("elements", [3, 10, 100])
def test_bend_radius_of_a_circle_on_any_mesh(elements: int) -> None:
    bend = curvatures(*on_circle(2.5, np.linspace(0.0, 5.0, elements + 1)))
    assert 1.0 / bend[1:-1] == pytest.approx(2.5, rel=1e-12)
    assert bend[[0, -1]] == pytest.approx(0.0)


def test_bend_radius_on_unequal_elements_is_of_second_order() -> None:
    steps = np.array([0.1, 0.2, 0.1, 0.2, 0.1])
    error = [
        abs(2.5 * curvatures(*on_circle(2.5, share * np.cumsum(steps)))[1:-1] - 1.0).max()
        for share in (1.0, 0.5)
    ]
    assert error[0] < 2e-3
    assert error[0] / error[1] == pytest.approx(4.0, rel=0.01)


def test_bend_radius_at_a_clamp() -> None:
    nodes, arc = on_circle(2.5, np.linspace(0.0, 1.0, 21))
    bend = curvatures(nodes, arc, np.array([0.0, 1.0, 0.0]))
    assert bend[0] == pytest.approx(1.0 / 2.5, rel=1e-3)


def test_minimum_bend_radius_of_a_catenary() -> None:
    """1/a = w/H there; at the arc length s from there a + s²/a."""
    s = np.linspace(-100.0, 100.0, 201)
    nodes = np.stack([70.0 * np.arcsinh(s / 70.0), 0.0 * s, np.hypot(70.0, s)], axis=1)
    radius = 1.0 / curvatures(nodes, s)[1:-1]
    assert radius == pytest.approx((70.0 + s * s / 70.0)[1:-1], rel=1e-4)


def test_reported_bend_radius_is_at_least_half_an_element() -> None:
    """Half an element where a rope is folded back; one shrunk to a point is no division by zero."""
    arc = np.array([0.0, 3.0, 6.0])
    there_and_back = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert 1.0 / curvatures(there_and_back, arc)[1] == pytest.approx(1.5)
    assert np.isfinite(curvatures(np.zeros((3, 3)), arc)).all()


def limited(scene: Scene, radius_m: float) -> Scene:
    line = scene.ropes[0]
    assert line.rope is not None
    rope = replace(line.rope, minimum_bend_radius_m=radius_m)
    return replace(scene, ropes=(replace(line, rope=rope), *scene.ropes[1:]))


def swung() -> Scene:
    """100 m of rope whose hang-off holds it aslant."""
    return Rig(length=100.0, elements=20, EI=5e3, clamp=(0.3, 0.0, -1.0)).scene()


CANTILEVER = """\
about: a light pipe that leaves a wall level
ropes:
  - name: pipe
    rope:
      diameter_m: 0.05
      mass_kg_per_m: 6.0
      hydrodynamic_diameter_m: 0.05
      axial_stiffness_n: 50.0e+6
      breaking_load_n: 200.0e+3
    length_m: 4.0
    elements: 20
    damping: {newton_seconds: 1.0e+4}
    to: cap
payloads:
  - name: cap
    mass_kg: 1.0
    displaced_volume_m3: 0.0
    added_mass_kg: [0.0, 0.0, 0.0]
    drag_area_m2: [0.0, 0.0, 0.0]
effects:
  - current: {profile: [[0.0, [0.0, 0.0]], [-10.0, [0.0, 0.0]]]}
  - weight: {}
  - drag: {normal: 1.2, tangential: 0.01}
  - added_mass: {}
  - bending: {stiffness_n_m2: 5.0e+3, clamped_along: [1.0, 0.0, 0.0]}
  - payload: {}
time: {step_s: 0.01}
"""


def test_a_bend_below_the_mbr_is_warned_of(tmp_path: Path) -> None:
    """In diagnostics and at the end; remembered, saved, and taken up again."""
    free = Twin(swung()).snapshot().bends[0]
    assert free.now.minimum_m == 0.0
    assert free.now.line_out_m == 0.0, "at the hang-off, which holds another direction"
    radius = free.now.radius_m
    for least, level in ((0.9 * radius, Level.OK), (1.1 * radius, Level.WARN)):
        scene = limited(swung(), least)
        twin = Twin(scene)
        snapshot = twin.snapshot()
        assert snapshot.bends[0].now == replace(free.now, minimum_m=least)
        (row,) = [row for row in statuses(snapshot, None) if row.name == "simulation: bend"]
        message = summarise(twin, snapshot, None)
        words = f"below the MBR of {least:g} m"
        assert row.level == level
        assert (words in row.message, words in message.as_text()) == (level == Level.WARN,) * 2
        assert RunSummary.from_values(message.row().values) == message
    twin.save(tmp_path / "state")
    assert Twin.restore(tmp_path / "state", scene).snapshot().bends == snapshot.bends


def test_compression_of_a_stiff_rope_is_warned_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A cantilever has no tension: all of it gets shorter, and its straight shape is not its own.

    One that hangs aslant from its clamp is in tension throughout, down to the end of the bend.
    """
    cantilever = tmp_path / "cantilever.yaml"
    cantilever.write_text(CANTILEVER)
    twin = Twin(cantilever)
    snapshot = twin.snapshot()
    assert snapshot.bends[0].compressed_m == pytest.approx(4.0)
    (row,) = [row for row in statuses(snapshot, None) if row.name == "simulation: bend"]
    assert row.level == Level.WARN
    assert "4 m would be in compression" in row.message
    message = summarise(twin, snapshot, None)
    assert "\nat the end, 4 m would be in compression" in message.as_text()
    assert RunSummary.from_values(message.row().values) == message
    hanging = Twin(swung())
    assert hanging.snapshot().bends[0].compressed_m == 0.0
    assert "compression" not in summarise(hanging, hanging.snapshot(), None).as_text()
    assert main(["scene", "check", str(cantilever)]) == 0
    assert "\nwarning: effects bending: in static equilibrium, 4 m " in capsys.readouterr().out


def test_the_smallest_radius_of_all_snapshots_is_stored() -> None:
    twin = Twin(swung())
    first = twin.snapshot().bends[0].now
    twin.rope.state.nodes[:2, :20] = 0.0  # straight but for its top
    later = twin.snapshot().bends[0]
    assert later.now.radius_m != first.radius_m
    assert later.tightest.radius_m == min(first.radius_m, later.now.radius_m)
    twin.rope.state.nodes[0, :21] = twin.rope.state.nodes[0, 20]
    straight = twin.snapshot().bends[0]
    assert straight.tightest == later.tightest


def test_each_section_has_its_mbr_and_a_junction_the_larger() -> None:
    scene = swung()
    line = scene.ropes[0]
    assert line.rope is not None
    stiff = replace(line.rope, minimum_bend_radius_m=4.0)
    lax = replace(line.rope, minimum_bend_radius_m=1.0)
    made = (RopeSection(rope=lax, length_m=50.0), RopeSection(rope=stiff))
    twin = Twin(replace(scene, ropes=(replace(line, rope=None, sections=made),)))
    (hung,) = twin.inspect().ropes.shapes(twin.rope, twin.snapshot())
    assert minimum_radii(hung).tolist() == [4.0] * 11 + [1.0] * 10


def test_a_straight_rope_reports_no_bend() -> None:
    scene = limited(load_scene("still_water"), 0.5)
    twin = Twin(scene)
    twin.rope.state.nodes[:2] = 0.0
    snapshot = twin.snapshot()
    assert math.isinf(snapshot.bends[0].now.radius_m)
    message = summarise(twin, snapshot, None)
    assert "straight" in message.as_text()
    assert '"radius_m": null' in message.as_json()


def test_an_mbr_does_not_invalidate_studies() -> None:
    """No study and no study of a scene ages when it is given."""
    scene = load_scene("still_water")
    assert scene_digest(limited(scene, 0.5)) == scene_digest(scene)


def test_both_parts_of_a_cut_rope_report_bends() -> None:
    twin = Twin(limited(load_scene("still_water"), 0.5))
    twin.snapshot()
    twin.submit_cut(None, 400.0)
    twin.advance(50)
    snapshot = twin.snapshot()
    assert [one.now.name for one in snapshot.bends] == ["hoist", "hoist/lower"]
    lengths = [one.line_out_m for one in snapshot.ropes]
    assert all(
        b.now.line_out_m <= length for b, length in zip(snapshot.bends, lengths, strict=True)
    )
