"""Scheduled and immediate winch commands."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_scene import small_scene

from rope_twin.scene.load import load_scene
from rope_twin.twin.twin import Twin


def test_an_immediate_command_replaces_the_schedule(tmp_path: Path) -> None:
    """A stop at once throws away what was planned for 8 s; a start at 3 s is then in order."""
    twin = Twin(small_scene(tmp_path))
    assert twin.submit_speed(0, 1.0) == ""
    assert twin.submit_speed(8_000_000_000, -1.0) == ""
    twin.advance(100)
    assert twin.submit_speed(None, 0.0) == ""
    twin.advance(100)
    assert twin.snapshot().payout_speed_m_per_s == pytest.approx(0.0, abs=1e-9)
    assert twin.submit_speed(3_000_000_000, 0.5) == ""
    twin.advance(800)
    assert twin.snapshot().payout_speed_m_per_s == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("name", ["winch", "", "hoist"])
def test_a_single_line_winch_answers_to_its_name_and_the_ropes(tmp_path: Path, name: str) -> None:
    twin = Twin(small_scene(tmp_path))
    assert twin.submit_speed(None, 0.5, name) == ""
    twin.advance(400)
    assert twin.snapshot().payout_speed_m_per_s == pytest.approx(0.5, abs=1e-9)


def test_a_command_for_an_unknown_winch_is_rejected(tmp_path: Path) -> None:
    """A command for another crane is refused; the sentence has the right name."""
    twin = Twin(small_scene(tmp_path))
    sentence = twin.submit_speed(None, 0.5, "starboard_crane")
    assert sentence == (
        "winch command: there is no winch 'starboard_crane'; name it 'winch', or leave the name "
        "empty."
    )
    twin.advance(100)
    snapshot = twin.snapshot()
    assert snapshot.payout_speed_m_per_s == 0.0
    assert snapshot.inputs["winch_command"].impossible == 1


def test_a_speed_above_the_limit_is_warned_of_for_a_minute() -> None:
    """Also once it commands less again: the line out is another than was meant."""
    twin = Twin(load_scene("shallow_lift"))
    limit = twin.scene.winch.speed_limit_m_per_s
    assert twin.submit_speed(None, 10.0 * limit) == ""
    twin.advance(2)
    assert twin.submit_speed(None, 0.0) == ""
    twin.advance(200)
    warning = twin.snapshot().inputs["winch_command"].warning
    assert "m/s commanded" in warning
    assert f"at most {limit:g}" in warning or f"{limit:g} m/s at most" in warning
