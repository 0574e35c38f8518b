"""Hard cases of size and duration: 7,000 elements, a simulated day; and explicit added mass."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rope_twin.core import state as rows
from validation.hard_cases.check import Case, Check, all_converged, off
from validation.hard_cases.rigs import Arrays, sine
from validation.hard_cases.snap import SMOOTH_2KM, run_at_rest_in_heave
from validation.rigs import Rig
from validation.state_bench import Vector

DAY_S = 86400.0
CYCLE_S = 80.0  # ten heaves; the winch goes out and in once
WAY_M = 15.0  # the winch's way: one split and one merge at least
STIFFNESS = 9.0  # N/m, of the published oscillator


def seven_thousand_elements() -> list[Check]:
    """Run smooth_2km with elements of 0.29 m."""
    rig = replace(SMOOTH_2KM, elements=7000, step=0.02)
    pull, unconverged = run_at_rest_in_heave(rig, sine(1.5, 8.0), 120.0)
    late = pull[round(40.0 / rig.step) - 1 :]
    return [
        off("mean top tension against 167.573 kN", float(late.mean()), 167.573e3, 0.05),
        off("highest against 205.23 kN", float(late.max()), 205.23e3, 0.05),
        off("lowest against 129.86 kN", float(late.min()), 129.86e3, 0.05),
        all_converged(unconverged),
    ]


def simulated_day() -> list[Check]:
    """Run 24 hours of heave and current, with the winch out and in by 15 m every 80 s.

    Everything repeats after 80 s, so the rope must: as it was after the first hour it must be after
    the last.
    """
    rig = replace(SMOOTH_2KM, elements=100, step=0.02)
    arrays = Arrays(rig)
    arrays.settle()
    value, rate = cycle(rig)
    per_hour = round(3600.0 / CYCLE_S)
    for _ in range(per_hour):
        pull = arrays.follow(value, rate)
    hour, shape = pull, arrays.position.copy()
    for _ in range(round(DAY_S / CYCLE_S) - per_hour):
        pull = arrays.follow(value, rate)
    drift = float(np.abs(arrays.position - shape).max())
    events = int(arrays.rope.state.health[rows.SPLITS] + arrays.rope.state.health[rows.MERGES])
    line = abs(float(arrays.s[-1]) - rig.length)
    still = Arrays(rig)
    still.settle()
    rest, expected = arrays.hold(round(7200.0 / rig.step)), still.hold(1)
    return [
        Check("largest change of the top tension of a cycle, last hour against first",
              100.0 * float(np.abs(pull / hour - 1.0).max()), 1e-6),
        Check("largest way of a node meanwhile", 1e3 * drift, 1e-3, "mm"),
        Check("line out lost or gained", 1e3 * line, 1e-3, "mm"),
        Check("splits and merges, fewer than 2,000 of them", float(max(2000 - events, 0)), 0.0, ""),
        off("pull once the ship rests against a fresh rope", float(rest[-1]), float(expected[-1]),
            1e-6),
        all_converged(arrays.unconverged),
    ]  # fmt: skip


def cycle(rig: Rig) -> tuple[Vector, Vector]:
    """Return hang-off and line out over one cycle: values and rates, (steps + 1, MOTIONS)."""
    t = rig.step * np.arange(round(CYCLE_S / rig.step) + 1)
    value, rate = np.zeros((2, len(t), rows.MOTIONS))
    omega, slow = 2.0 * math.pi / 8.0, 2.0 * math.pi / CYCLE_S
    value[:, rows.Z] = 0.75 * (1.0 - np.cos(omega * t))
    rate[:, rows.Z] = 0.75 * omega * np.sin(omega * t)
    value[:, rows.LINE] = rig.length + 0.5 * WAY_M * (1.0 - np.cos(slow * t))
    rate[:, rows.LINE] = 0.5 * WAY_M * slow * np.sin(slow * t)
    return value, rate


def lagged_matrix(m: float, added: float, h: float) -> Vector:
    """Return the matrix of x, v, a over one trapezoidal step of m·a1 + k·x1 = -m_a·a0."""
    p, q = 0.25 * h * h, 0.5 * h
    x_hat, v_hat = np.array([1.0, h, p]), np.array([0.0, 1.0, q])
    a = (np.array([0.0, 0.0, -added]) - STIFFNESS * x_hat) / (m + STIFFNESS * p)
    return np.array([x_hat + p * a, v_hat + q * a, a])


def lagged_error(m: float, added: float, h: float, x0: float) -> float:
    """Return the largest error of the lagged form over 20 s [m]."""
    omega = math.sqrt(STIFFNESS / (m + added))
    step, state = lagged_matrix(m, added, h), np.array([x0, 0.0, -(omega**2) * x0])
    worst = 0.0
    for k in range(round(20.0 / h)):
        state = step @ state
        worst = max(worst, abs(state[0] - x0 * math.cos(omega * h * (k + 1))))
    return float(worst)


def our_error(m: float, added: float, h: float, x0: float) -> float:
    """Return the largest error of a payload on a massless rope, k = EA/L, about equilibrium [m]."""
    arrays = Arrays(
        Rig(
            length=100.0,
            elements=3,
            mass=1e-6,
            EA=100.0 * STIFFNESS,
            load=m,
            added=(added,) * 3,
            step=h,
        )
    )
    arrays.settle()
    omega = math.sqrt(STIFFNESS / (m + added))
    rest, share = arrays.position[2].copy(), np.linspace(1.0, 0.0, 4)
    arrays.position[2] += x0 * share
    arrays.find_acceleration()
    worst = 0.0
    for k in range(round(20.0 / h)):
        arrays.hold(1)
        x = float(arrays.position[2, 0] - rest[0])
        worst = max(worst, abs(x - x0 * math.cos(omega * (h * (k + 1) + 1e-6))))
    return worst


def explicit_added_mass() -> list[Check]:
    """Test the published oscillator: lagged added mass fails once it exceeds the mass."""
    printed = ((0.2, 3.24), (0.1, 1.78), (0.05, 0.93), (0.01, 0.19), (0.001, 0.020))
    lagged = max(abs(lagged_error(11.0, 10.0, h, 10.0) - error) for h, error in printed)
    radius = min(
        float(np.abs(np.linalg.eigvals(lagged_matrix(m, added, h))).max())
        for m, added in ((10.0, 11.0), (1.0, 10.0))
        for h, _ in printed
    )
    ours = [our_error(1.0, 10.0, h, 1.0) for h in (0.1, 0.05, 0.01)]
    order = math.log(ours[0] / ours[1]) / math.log(2.0)
    return [
        Check("lagged, m 11, m_a 10: difference from the printed errors, 3.24 to 0.020 m", lagged,
              0.005, "m"),
        Check("lagged, m_a > m: growth a step, 1 over the spectral radius", 1.0 / radius, 0.9999,
              ""),
        Check("ours, m 1, m_a 10: largest error at 0.1 s over the amplitude", 100.0 * ours[0], 1.0),
        Check("and at 0.01 s", 100.0 * ours[2], 0.01),
        Check("distance of its order from 2", abs(order - 2.0), 0.1, ""),
    ]  # fmt: skip


CASES = (
    Case("elements_7000", "7,000 elements of 0.29 m on 2 km",
         "fine explicit 167.573, 205.23, 129.86 kN", seven_thousand_elements, 6.0),
    Case("simulated_day", "24 hours of heave and current, 15 m out and in every 80 s",
         "what is periodic returns; a fresh rope at rest", simulated_day, 60.0),
    Case("explicit_added_mass", "added mass as a lagged force, and ours",
         "published errors and blow-up at m_a > m; x0·cos(ωt)", explicit_added_mass, 0.5, True),
)  # fmt: skip
