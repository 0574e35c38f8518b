"""The rows on a fleet's speed: each with its error, and orders that part the line out."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.fleet_speed import ORDERS_M_PER_S, QUICK, SLOWEST, at_own_speeds, ordered
from rope_twin.twin.ensemble.fleet import FleetInputs


def test_a_cost_has_its_error(capsys: pytest.CaptureFixture[str]) -> None:
    """The JSON has the settings, then the orders; and the copies of states."""
    assert main(["fleet", "--quick", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    *settings, orders, meeting, own_speeds = found["rows"]
    given = [(row["elements"], row["step_s"]) for row in settings]
    assert given == list(QUICK.settings)
    assert orders["members"] == len(ORDERS_M_PER_S) * QUICK.seas_per_order
    assert meeting["work"] == "two_line_lift, 4 s"
    assert meeting["elements"] == own_speeds["elements"] > QUICK.chosen[0]
    for row in found["rows"]:
        assert row["failed"] == 0
        assert 0.0 < row["error_pct"] < 5.0
        assert 0.0 < row["cpu_best_s"] <= row["cpu_s"]
        node_steps = row["members"] * row["elements"] * QUICK.seconds / row["step_s"]
        assert row["ns_per_node_step"] == pytest.approx(1e9 * row["cpu_best_s"] / node_steps)
    assert len(found["states"]) == 5
    assert all(0.0 < row["microseconds_best"] <= row["microseconds"] for row in found["states"])


def test_orders_are_lines_of_their_own_speed() -> None:
    """Line out is the integral of its speed, and each order has every sea."""
    still = FleetInputs(np.ones((601, 5)), np.zeros((601, 5)), np.full(601, 3000.0), np.zeros(601))
    made = ordered(still, 0.05, 3)
    assert made.heave_m.shape == made.line_out_m.shape == (601, 12)
    speed = 0.5 * (made.line_speed_m_per_s[1:] + made.line_speed_m_per_s[:-1])
    assert np.allclose(np.diff(made.line_out_m, axis=0), 0.05 * speed, atol=1e-3)
    assert np.array_equal(made.line_speed_m_per_s[-1, ::3], ORDERS_M_PER_S)


def test_own_speeds_are_shares_of_the_schedule() -> None:
    """The speed of every winch is scaled; the lines begin at the same length."""
    line, speed = np.linspace(100.0, 106.0, 61), np.full(61, 0.1)
    given = FleetInputs(np.zeros((61, 3)), np.zeros((61, 3)), line, speed, {"aft": (line, speed)})
    made = at_own_speeds(given, 3)
    assert np.allclose(made.line_out_m[-1], 100.0 + 6.0 * np.array([SLOWEST, 0.75, 1.0]))
    assert np.allclose(made.line_speed_m_per_s[7], 0.1 * np.array([SLOWEST, 0.75, 1.0]))
    line, speed = made.lines["aft"]
    assert np.array_equal(line, made.line_out_m)
    assert np.array_equal(speed, made.line_speed_m_per_s)
