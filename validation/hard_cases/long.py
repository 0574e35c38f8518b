"""Hard cases of size and duration: 7,000 elements, a simulated day; and explicit added mass."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary
from validation.case import Finding, limited
from validation.hard_cases.limits import all_converged, hard_case, off
from validation.hard_cases.rigs import settled, sine
from validation.hard_cases.snap import SMOOTH_2KM, run_at_rest_in_heave
from validation.rigs import Rig
from validation.stepping import (
    DERIVED_M,
    STEPS_S,
    STIFFNESS,
    lagged_matrix,
    lagged_positions,
    largest_error,
    our_positions,
)

DAY_S = 86400.0
CYCLE_S = 80.0  # ten heaves; the winch goes out and in once
WAY_M = 15.0  # the winch's way: one split and one merge at least


def seven_thousand_elements() -> list[Finding]:
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


def simulated_day() -> list[Finding]:
    """Run 24 hours of heave and current, with the winch out and in by 15 m every 80 s.

    Everything repeats after 80 s, so the rope must: as it was after the first hour it must be after
    the last.
    """
    rig = replace(SMOOTH_2KM, elements=100, step=0.02)
    bench = settled(rig)
    motion = cycle(rig)
    per_hour = round(3600.0 / CYCLE_S)
    for _ in range(per_hour):
        pull = bench.follow(motion)
    hour, shape = pull, bench.position.copy()
    for _ in range(round(DAY_S / CYCLE_S) - per_hour):
        pull = bench.follow(motion)
    drift = float(np.abs(bench.position - shape).max())
    events = int(bench.rope.state.health[rows.SPLITS] + bench.rope.state.health[rows.MERGES])
    line = abs(float(bench.s[-1]) - rig.length)
    fresh = settled(rig)
    pulls, expected = bench.hold(round(7200.0 / rig.step)), fresh.hold(1)
    return [
        limited("largest change of the top tension of a cycle, last hour against first",
                100.0 * float(np.abs(pull / hour - 1.0).max()), 1e-6),
        limited("largest way of a node meanwhile", 1e3 * drift, 1e-3, "mm"),
        limited("line out lost or gained", 1e3 * line, 1e-3, "mm"),
        limited("splits and merges, fewer than 2,000 of them", max(2000 - events, 0), 0.0, ""),
        off("pull once the ship rests against a fresh rope", float(pulls[-1]), float(expected[-1]),
            1e-6),
        all_converged(bench.unconverged),
    ]  # fmt: skip


def cycle(rig: Rig) -> Boundary:
    """Return the motion of hang-off and line out over one cycle."""
    t = rig.step * np.arange(round(CYCLE_S / rig.step) + 1)
    value, rate = np.zeros((2, len(t), rows.MOTIONS))
    omega, slow = 2.0 * math.pi / 8.0, 2.0 * math.pi / CYCLE_S
    value[:, rows.Z] = 0.75 * (1.0 - np.cos(omega * t))
    rate[:, rows.Z] = 0.75 * omega * np.sin(omega * t)
    value[:, rows.LINE] = rig.length + 0.5 * WAY_M * (1.0 - np.cos(slow * t))
    rate[:, rows.LINE] = 0.5 * WAY_M * slow * np.sin(slow * t)
    return Boundary(value, rate)


def explicit_added_mass() -> list[Finding]:
    """Test the published oscillator: lagged added mass fails once it exceeds the mass."""
    errors = [
        largest_error(lagged_positions(11.0, 10.0, h), math.sqrt(STIFFNESS / 21.0), h)
        for h in STEPS_S
    ]
    lagged = float(np.abs(np.subtract(errors, DERIVED_M)).max())
    radius = min(
        float(np.abs(np.linalg.eigvals(lagged_matrix(m, added, h))).max())
        for m, added in ((10.0, 11.0), (1.0, 10.0))
        for h in STEPS_S
    )
    omega = math.sqrt(STIFFNESS / 11.0)
    # of 1 m, at which the rope stays taut, scaled to the published 10 m
    ours = [
        0.1 * largest_error(our_positions(1.0, 10.0, h, 1.0), omega, h) for h in (0.1, 0.05, 0.01)
    ]
    order = math.log(ours[0] / ours[1]) / math.log(2.0)
    return [
        limited("lagged, m 11, m_a 10: difference from the printed errors, 3.24 to 0.020 m", lagged,
                0.005, "m"),
        limited("lagged, m_a > m: growth a step, 1 over the spectral radius", 1.0 / radius, 0.9999,
                ""),
        limited("ours, m 1, m_a 10: largest error at 0.1 s over the amplitude", 100.0 * ours[0],
                1.0),
        limited("and at 0.01 s", 100.0 * ours[2], 0.01),
        limited("distance of its order from 2", abs(order - 2.0), 0.1, ""),
    ]  # fmt: skip


CASES = (
    hard_case("elements_7000", "7,000 elements of 0.29 m on 2 km",
              "fine explicit 167.573, 205.23, 129.86 kN", seven_thousand_elements, 6.0),
    hard_case("simulated_day", "24 hours of heave and current, 15 m out and in every 80 s",
              "what is periodic returns; a fresh rope at rest", simulated_day, 60.0),
    hard_case("explicit_added_mass", "added mass as a lagged force, and ours",
              "published errors and blow-up at m_a > m; x0·cos(ωt)",
              explicit_added_mass, 0.5, True),
)  # fmt: skip
