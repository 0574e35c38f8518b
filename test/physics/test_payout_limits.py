"""Hauling in to the minimum payout, paying out again, and the limits of the winch."""

from __future__ import annotations

from dataclasses import replace

import pytest
from payout_rigs import KELVIN_VOIGT_S, SEA, WINCH
from rigs import march, sine

from rope_twin import Snapshot, Twin

SHORT = replace(SEA, length=40.0, elements=4, damping=SEA.EA * KELVIN_VOIGT_S)


def hauled_in(heave: float) -> tuple[Twin, Snapshot]:
    """The rope hauled in at 1 m/s until the winch holds it."""
    twin = SHORT.twin()
    assert twin.submit_speed(0, -1.0) == ""
    *_, snapshot = march(twin, sine(heave, 8.0), 40.0, every=10)
    return twin, snapshot


def test_the_minimum_payout_is_never_passed() -> None:
    """It brakes within its acceleration limit and stops at the limit, not beyond."""
    _, snapshot = hauled_in(0.0)
    least = WINCH.min_line_out_m
    assert least - 1e-9 <= snapshot.line_out_m <= least + 0.02
    assert snapshot.payout_speed_m_per_s == pytest.approx(0.0, abs=1e-6)
    assert "12 m" in snapshot.winch_at_limit


@pytest.mark.parametrize(("step", "speed"), [(0.01, 1.0), (0.02, 2.0), (0.1, 3.0)])
def test_the_maximum_payout_is_never_passed(step: float, speed: float) -> None:
    """Braking at the upper limit is as at the lower one, at any speed and step."""
    rig = replace(SHORT, step=step, winch=replace(WINCH, max_line_out_m=80.0))
    twin = rig.twin()
    assert twin.submit_speed(0, speed) == ""
    longest = max(snapshot.line_out_m for snapshot in march(twin, sine(0.0, 8.0), 90.0))
    assert 80.0 - 0.1 <= longest <= 80.0 + 1e-9


@pytest.mark.parametrize("heave", [0.0, 0.5])
def test_hauled_in_to_two_elements_and_paid_out_again(heave: float) -> None:
    """The pull stays near the weight below it, and the rope ends where a fresh one hangs."""
    twin, snapshot = hauled_in(heave)
    assert len(snapshot.element_tension_n) == 2
    assert snapshot.tension_top_n == pytest.approx(
        SHORT.load_weight + SHORT.weight * snapshot.line_out_m, rel=0.1
    )
    assert twin.submit_speed(None, 1.0) == ""
    snapshots = list(march(twin, sine(heave, 8.0), 30.0))
    assert twin.submit_speed(None, 0.0) == ""
    snapshots += list(march(twin, sine(heave, 8.0), 20.0))
    assert max(abs(s.tension_top_n / SHORT.load_weight - 1.0) for s in snapshots) < 0.2
    last = snapshots[-1]
    assert last.line_out_m > 40.0
    assert last.solver.unconverged_substeps == 0
    assert last.solver.splits >= 2
    fresh = replace(SHORT, length=last.line_out_m, elements=5).twin().snapshot()
    assert last.payload_position_m[2] - last.heave_m == pytest.approx(
        fresh.payload_position_m[2], abs=0.05
    )
