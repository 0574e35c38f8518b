"""Current profiles received by a running twin: invalid ones are rejected, jumps are flagged."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from ramp_rigs import in_time
from small_scene import SMALL_SCENE, not_finite, small_scene

from rope_twin import load_scene
from rope_twin.errors import SceneError
from rope_twin.messages import Level, Status, statuses
from rope_twin.scene.shapes import payload_figures
from rope_twin.twin.health import RECENT_NS
from rope_twin.twin.inputs import MAX_ROWS
from rope_twin.twin.twin import Twin


def profile(rows: int) -> np.ndarray:
    """A calm profile of so many rows, from the surface to 500 m."""
    z = np.linspace(0.0, -500.0, rows)
    return np.column_stack([z, np.full(rows, 0.4), np.zeros(rows)])


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([[0.0, 0.1, 0.0], [-1e-308, 9.0, 0.0]], "apart; give rows at least 0.01 m apart"),
        ([[0.0, 0.1, 0.0], [-0.009, 0.1, 0.0]], "rows 0 and 1 are 0.009 m apart"),
        ([[0.0, 0.1, 0.0], [-0.02, 9.0, 0.0]], "m/s a metre below row 0; give at most 100"),
        ([[0.0, 0.1, 0.0], [-1e300, 0.1, 0.0]], "the deepest row may lie at -12000 m"),
        (profile(MAX_ROWS + 1).tolist(), "it has 1001 rows; give 1000 at most"),
    ],
    ids=["subnormal", "close", "steep", "deep", "many"],
)
def test_a_profile_of_infinite_slope_is_rejected(
    tmp_path: Path, rows: list[list[float]], words: str
) -> None:
    """It passed once, and then no step could be made."""
    twin = Twin(small_scene(tmp_path))
    assert words in twin.submit_current(rows)
    twin.advance(20)
    snapshot = twin.snapshot()
    assert not not_finite(snapshot)
    assert snapshot.inputs["current"].impossible == 1
    assert snapshot.inputs["current"].accepted == 0


def test_the_largest_profile_is_accepted(tmp_path: Path) -> None:
    twin = Twin(small_scene(tmp_path))
    assert twin.submit_current(profile(MAX_ROWS)) == ""
    twin.advance(20)
    assert not not_finite(twin.snapshot())


def test_a_jump_of_the_profile_is_flagged_for_a_minute(tmp_path: Path) -> None:
    """The warning states the number and ends; a change as slow as the sea's is not flagged."""
    twin = Twin(small_scene(tmp_path))
    assert twin.submit_current([[0.0, 0.6, 0.1], [-150.0, 0.2, 0.3], [-500.0, 0.0, 0.0]]) == ""
    twin.advance(1)
    assert _row(twin).level == Level.OK
    assert twin.submit_current([[0.0, 1.6, 0.1], [-150.0, 0.2, 0.3], [-500.0, 0.0, 0.0]]) == ""
    twin.advance(1)
    row = _row(twin)
    assert row.level == Level.WARN
    assert "the profile changed by 1.00 m/s at z = 0 m" in row.message
    twin.advance(round(RECENT_NS / twin.step_ns))
    assert _row(twin).level == Level.OK


OWN = "[[0.0, [0.5, 0.1]], [-150.0, [0.1, 0.3]], [-500.0, [0.0, 0.0]]]"


def test_a_vertical_component_needs_one_in_the_scene(tmp_path: Path) -> None:
    """It would compile other code during the run; zeros are accepted."""
    twin = Twin(small_scene(tmp_path))
    reported = twin.submit_current([[0.0, 0.4, 0.0, 0.0], [-500.0, 0.4, 0.0, 0.2]])
    assert "current: it has a vertical component, which this scene's current has not" in reported
    assert twin.snapshot().inputs["current"].impossible == 1
    assert twin.submit_current([[0.0, 0.4, 0.0, 0.0], [-500.0, 0.4, 0.0, 0.0]]) == ""


def test_a_vertical_component_changes_the_tension(tmp_path: Path) -> None:
    """A downward flow of 2 m/s adds the drag on the payload's face."""
    path = tmp_path / "up.yaml"
    path.write_text(SMALL_SCENE.replace(OWN, "[[0.0, [0.0, 0.0, 0.0]]]"))
    twin = Twin(in_time(load_scene(path)))  # the step of test_fluid_ramp
    still = twin.snapshot().tension_top_n
    assert twin.submit_current([[0.0, 0.0, 0.0, -2.0], [-500.0, 0.0, 0.0, -2.0]]) == ""
    twin.advance(1)
    assert "changed by 2.00 m/s" in _row(twin).message
    twin.advance(9000)
    faster = twin.snapshot().tension_top_n
    assert twin.submit_current([[0.0, 0.0, 0.0], [-500.0, 0.0, 0.0]]) == ""
    twin.advance(9000)
    assert twin.snapshot().tension_top_n == pytest.approx(still, abs=1.0)
    scene = load_scene(path)
    (load,), rope = scene.payloads, scene.ropes[0].rope
    assert rope is not None
    face = payload_figures(load, 1025.0).drag_area_m2[2]
    skin = math.pi * rope.hydrodynamic_diameter_m * 0.03 * 200.0
    assert faster - still == pytest.approx(0.5 * 1025.0 * 4.0 * (face + skin), rel=1e-3)


def _row(twin: Twin) -> Status:
    rows = {row.name: row for row in statuses(twin.snapshot(), None)}
    return rows["simulation: input current"]


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("[[0.0, [0.1, 0.0]], [-1.0e-300, [9.0, 0.0]]]", "give rows at least 0.01 m apart"),
        ("[[0.0, [0.1, 0.0]], [-0.02, [9.0, 0.0]]]", "changes by 445 m/s a metre below row 0"),
    ],
)
def test_a_scenes_own_profile_has_the_same_rules(tmp_path: Path, rows: str, words: str) -> None:
    path = tmp_path / "steep.yaml"
    path.write_text(SMALL_SCENE.replace(OWN, rows))
    with pytest.raises(SceneError, match=words):
        load_scene(path)
