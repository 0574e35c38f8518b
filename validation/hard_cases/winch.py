"""Robustness tests at the sheave: hauling to 2 m, a vanishing element, an emergency stop, a mesh of
0.2 m next to 50 m.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary
from rope_twin.scene.schema import Winch
from rope_twin.studies.driven_twin import march, still
from rope_twin.twin.snapshot import Snapshot
from validation.case import Finding, limited
from validation.hard_cases.limits import all_converged, front_pct, hard_case, off, rms_off
from validation.hard_cases.rigs import RigBench, sine
from validation.hard_cases.snap import HEAVE_4M, SNAP_VERTICAL
from validation.hard_cases.waves import HangingBar, ramped_speed
from validation.hard_cases.waves import top_tension as exact_top_tension
from validation.rigs import Rig
from validation.state_bench import Vector

STEEL = Rig(length=1000.0, elements=100)
JUMP_PCT = 0.01  # of the mean tension, at a split or merge
MARCH_S = 1e-3


def bar_of(rig: Rig) -> HangingBar:
    """Return the same rope for the exact travelling waves."""
    return HangingBar(rig.mass, rig.weight, rig.EA, rig.load, rig.load_weight)


def haul_to_two_metres() -> list[Finding]:
    """Haul from 60 m at 1 m/s until 2 m are left, and pay out again."""
    winch = Winch(
        speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=0.3, min_line_out_m=2.0,
        max_line_out_m=200.0,
    )  # fmt: skip
    rig = replace(STEEL, length=60.0, elements=60, damping=65e4, winch=winch)
    twin = rig.twin()
    snapshots = list(march(twin, still, 90.0, speeds=[(1.0, -1.0)]))
    short = snapshots[-1]
    snapshots += list(march(twin, still, 80.0, speeds=[(91.0, 1.0), (91.0 + 58.0, 0.0)]))
    paid_out, events = snapshots[-1], snapshots[-1].solver.splits + snapshots[-1].solver.merges
    short_rig = replace(rig, length=short.line_out_m)
    long_rig = replace(rig, length=paid_out.line_out_m)
    return [
        off("line out when hauled in against 2 m", short.line_out_m, 2.0, 0.01),
        off("pull there against W + w·L", short.tension_top_n, short_rig.top_weight, 1e-3),
        off(
            "depth after paying out again",
            -paid_out.payload_position_m[2],
            long_rig.hanging_depth,
            1e-4,
        ),
        limited("jump of the tension at an event", jump_pct(snapshots), JUMP_PCT),
        limited("events, fewer than 100 of them", float(max(100 - events, 0)), 0.0, ""),
        all_converged(paid_out.solver.unconverged_substeps),
    ]


def jump_pct(snapshots: list[Snapshot]) -> float:
    """Return the largest second difference of the top tension in the 11 samples after an event [%].

    It is relative to the mean, and valid only while the winch speed is constant: steps of its
    acceleration change the tension more.
    """
    tension = np.array([snapshot.tension_top_n for snapshot in snapshots])
    bend = np.abs(np.diff(tension, 2))
    count = np.array([snapshot.solver.splits + snapshot.solver.merges for snapshot in snapshots])
    speed = np.array([snapshot.payout_speed_m_per_s for snapshot in snapshots])
    largest_n = 0.0
    for k in np.flatnonzero(np.diff(count)) + 1:
        if k > 1 and np.ptp(speed[k - 2 : k + 11]) < 1e-9:
            largest_n = max(largest_n, float(bend[k - 1 : k + 10].max()))
    return 100.0 * largest_n / float(tension.mean())


def vanishing_element() -> list[Finding]:
    """Shrink an element at the sheave to 1 mm under heave before it is merged."""
    rig = replace(STEEL, length=200.0, elements=20)
    seconds, speed = 60.0, -0.05  # 2 m are gone after 42 s
    heave = sine(1.5, 8.0)
    t = rig.step * np.arange(round(seconds / rig.step) + 1)
    value, rate = np.zeros((2, len(t), rows.MOTIONS))
    for k, time in enumerate(t):
        value[k, rows.Z], rate[k, rows.Z] = heave(float(time))
    u = np.minimum(t / 4.0, 1.0)
    rate[:, rows.LINE] = speed * u**2 * (3.0 - 2.0 * u)
    eased = 4.0 * (u**3 - 0.5 * u**4) + np.maximum(t - 4.0, 0.0)
    value[:, rows.LINE] = rig.length - 8.0 + speed * eased
    bench = RigBench(rig)
    bench.length = rig.length - 8.0  # the top element starts with 2 m of its 10
    bench.s[-1] = bench.length
    bench.settle()
    bench.rope = bench.rope._replace(model=bench.rope.model._replace(merge_below=0.0))
    pulls, shortest = [], np.inf
    for k in range(len(t) - 1):
        pulls.append(bench.follow(Boundary(value[k : k + 2], rate[k : k + 2])))
        shortest = min(shortest, float(bench.s[-1] - bench.s[-2]))
    pull = np.concatenate(pulls)

    def line(time: float) -> tuple[float, float]:
        k = time / rig.step
        return float(np.interp(k, t / rig.step, value[:, rows.LINE])), float(
            np.interp(k, t / rig.step, rate[:, rows.LINE])
        )

    exact = exact_top_tension(bar_of(rig), line, heave, seconds, MARCH_S)[10::10]
    bend = float(np.abs(np.diff(pull - exact, 2)).max())
    return [
        limited("shortest element", 1e3 * shortest, 2.0, "mm"),
        rms_off("top tension against travelling waves, rms", pull, exact, 0.05),
        limited("bump over them", 100.0 * bend / float(exact.mean()), JUMP_PCT),
        all_converged(bench.unconverged),
    ]


def emergency_stop() -> list[Finding]:
    """Stop 20 t at 2 m/s within 0.2 s, lowering and hauling; compare with the exact solution."""
    winch = Winch(
        speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=10.0, min_line_out_m=12.0,
        max_line_out_m=3000.0,
    )  # fmt: skip
    rig = replace(STEEL, winch=winch)
    checks: list[Finding] = []
    for word, speed in (("lowering", 2.0), ("hauling", -2.0)):
        commands = [(1.0, speed), (10.0, 0.0)]
        snapshots = list(march(rig.twin(), still, 25.0, speeds=commands))
        pull_n = np.array([snapshot.tension_top_n for snapshot in snapshots])
        line = ramped_speed(rig.length, 10.0, commands)
        every = round(rig.step / MARCH_S)
        exact = exact_top_tension(bar_of(rig), line, still, 25.0, MARCH_S)[every::every]
        stop = slice(1000, None)
        checks += [
            off(f"{word}: highest pull after the stop", pull_n[stop].max(), exact[stop].max(), 1.0),
            rms_off(f"{word}: pull against travelling waves, rms", pull_n, exact, front_pct(10.0)),
            all_converged(snapshots[-1].solver.unconverged_substeps),
        ]
    return checks


def mixed_elements() -> list[Finding]:
    """Run 20 elements of 0.2 m at the sheave next to elements of 50 m, smooth and in snap."""
    short, long_m = np.full(20, 0.2), np.full(20, 50.0)
    rig = replace(STEEL, length=1004.0, elements=40)
    heave = sine(1.5, 8.0)
    smooth = mixed(rig, np.concatenate([long_m, short]))
    pull = smooth.heave(heave, 0, 6000)
    exact = exact_top_tension(bar_of(rig), lambda t: (rig.length, 0.0), heave, 60.0, MARCH_S)
    jerky = replace(SNAP_VERTICAL, length=2004.0, elements=60)
    slack = mixed(jerky, np.concatenate([np.full(40, 50.0), short]))
    peak = float(slack.heave(HEAVE_4M, 0, 6000).max())
    return [
        rms_off("top tension against travelling waves, rms", pull, exact[10::10], 0.05),
        off("snap peak against the explicit 172.36 kN", peak, 172.36e3, 1.0),
        all_converged(smooth.unconverged + slack.unconverged),
    ]


def mixed(rig: Rig, rests: Vector) -> RigBench:
    """Return a fixture at rest with elements of these lengths from the lower end up [m]."""
    bench = RigBench(rig)
    bench.s[1:] = np.cumsum(rests)
    depth = rig.length - bench.s
    bench.position[2] = -depth
    model = bench.rope.model._replace(split_above=np.inf, merge_below=0.0)
    bench.rope = bench.rope._replace(model=model)
    bench.settle()
    return bench


CASES = (
    hard_case("haul_to_2m", "hauled in to 2 m and out again", "closed form at rest at both ends; "
              "second difference of the tension", haul_to_two_metres, 2.0, True),
    hard_case("vanishing_element", "an element at the sheave shrinks to 1 mm under heave",
              "exact travelling waves with a moving boundary", vanishing_element, 1.0, True),
    hard_case("emergency_stop", "20 t at 2 m/s stopped in 0.2 s, lowering and hauling",
              "exact travelling waves with a moving boundary", emergency_stop, 3.0, True),
    hard_case("mixed_elements", "elements of 0.2 m beside 50 m, smooth and in snap",
              "exact travelling waves; explicit peak 172.36 kN", mixed_elements, 1.0, False),
)  # fmt: skip
