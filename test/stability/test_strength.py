"""Maximum tension of each rope since the start, and its utilisation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from rope_twin import Twin, load_scene
from rope_twin.run.summary import summarise
from rope_twin.scene.schema import RopeLine


def weaker(line: RopeLine, breaking_load_n: float) -> RopeLine:
    assert line.rope is not None
    return replace(line, rope=replace(line.rope, breaking_load_n=breaking_load_n))


def test_maximum_tension_at_rest_is_the_suspended_weight() -> None:
    scene = load_scene("still_water")
    (strength,) = Twin(scene).snapshot().strength
    weight = (20000.0 - 1025.0 * 4.0 + (6.38352 - 1025.0 * 8.0424772e-4) * 1000.0) * 9.80665
    assert strength.name == "hoist"
    assert strength.max_n == pytest.approx(weight, rel=1e-2)  # without the uppermost half
    assert strength.breaking_load_n == pytest.approx(6.334e8 * 0.04**2)


def test_a_peak_between_two_snapshots_is_reported_and_saved(tmp_path: Path) -> None:
    """A jerk of the winch: the rope is looked at once, when the tension is down again."""
    scene = load_scene("still_water")
    scene = replace(scene, ropes=(weaker(scene.ropes[0], 215e3),))
    twin = Twin(scene)
    assert "parted" not in summarise(twin, twin.snapshot(), None).as_text()
    twin.submit_speed(None, -0.5)
    twin.advance(500)
    twin.submit_speed(None, 0.0)
    twin.advance(1500)
    snapshot = twin.snapshot()
    (strength,) = snapshot.strength
    assert strength.max_n == twin.statistics().tension_top_max_n > snapshot.tension_top_n
    assert strength.utilisation > 1.0
    message = summarise(twin, snapshot, None).as_text()
    assert "MBL exceeded" in message
    assert "MBL 215 kN" in message
    twin.save(tmp_path / "state")
    assert Twin.restore(tmp_path / "state", scene).snapshot().strength == snapshot.strength


def test_each_rope_has_its_own_maximum_tension(tmp_path: Path) -> None:
    scene = load_scene("two_line_lift")
    fore, aft = scene.ropes
    twin = Twin(replace(scene, ropes=(fore, weaker(aft, 200e3))))
    twin.submit_speed(None, 0.2)  # fore pays out: aft carries nearly all
    twin.advance(800)
    snapshot = twin.snapshot()
    first, second = snapshot.strength
    assert [first.name, second.name] == ["fore", "aft"]
    assert first.utilisation < 0.5
    assert second.max_n >= snapshot.ropes[1].tension_top_n > 200e3
    message = summarise(twin, snapshot, None).as_text()
    assert "maximum tension of 'aft' " in message
    assert "maximum tension of 'fore' " not in message
    twin.save(tmp_path / "state")
    assert Twin.restore(tmp_path / "state", twin.scene).snapshot().strength == snapshot.strength
