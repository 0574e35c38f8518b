"""Planned winch commands and commands at once."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_scene import small_scene

from rope_twin import Twin


def test_a_new_plan_may_follow_a_command_at_once(tmp_path: Path) -> None:
    """A stop at once throws away what was planned for 8 s; a start at 3 s is then in order."""
    twin = Twin(small_scene(tmp_path))
    assert twin.offer_speed(0, 1.0) == ""
    assert twin.offer_speed(8_000_000_000, -1.0) == ""
    twin.advance(100)
    assert twin.offer_speed(None, 0.0) == ""
    twin.advance(100)
    assert twin.snapshot().payout_speed_m_per_s == pytest.approx(0.0, abs=1e-9)
    assert twin.offer_speed(3_000_000_000, 0.5) == ""
    twin.advance(800)
    assert twin.snapshot().payout_speed_m_per_s == pytest.approx(0.5, abs=1e-9)
