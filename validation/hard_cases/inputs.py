"""Hard cases of the inputs: a step of 100 ms, a current that jumps, heave with a gap and a jump."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rope_twin.studies.driven_twin import Motion, march, still
from rope_twin.twin.snapshot import Snapshot
from validation.case import Finding, limited
from validation.hard_cases.limits import all_converged, front_pct, hard_case, off, rms_off
from validation.hard_cases.rigs import sine
from validation.hard_cases.snap import (
    HEAVE_4M,
    SMOOTH_2KM,
    SNAP_VERTICAL,
    run_at_rest_in_heave,
)
from validation.hard_cases.waves import HangingBar
from validation.hard_cases.waves import top_tension as exact_top_tension
from validation.rigs import WATER, Rig
from validation.state_bench import Vector

MARCH_S = 1e-3
SAMPLE_NS = 50_000_000  # heave at 20 Hz
AHEAD_NS = 150_000_000
# A jump is led over with 0.5 m/s²; the heave itself has 0.9, and the speed assumed in the gap
# differs from the one measured after it.
GENTLE = 2.0  # m/s²
BACK = 2350  # steps until the jump is led over: 2.5 m with 0.5 m/s² take sqrt(6·2.5/0.5) s


def step_of_100_ms() -> list[Finding]:
    """Run smooth_2km and snap_vertical with ten times the usual time step."""
    smooth, first = run_at_rest_in_heave(replace(SMOOTH_2KM, step=0.1), sine(1.5, 8.0), 120.0)
    late = smooth[399:]
    snap, second = run_at_rest_in_heave(replace(SNAP_VERTICAL, step=0.1), HEAVE_4M, 60.0)
    # second order: 0.064 % rms of the spread at 50 ms make 0.256 % at 100 ms
    return [
        off("mean top tension against 167.573 kN", float(late.mean()), 167.573e3, 0.256),
        off("highest against 205.23 kN", float(late.max()), 205.23e3, 0.256),
        off("lowest against 129.86 kN", float(late.min()), 129.86e3, 0.256),
        limited("snap peak above the converged 172.4 kN",
                100.0 * (float(snap.max()) / 172.4e3 - 1.0), 0.0),
        all_converged(first + second),
    ]  # fmt: skip


def current_step() -> list[Finding]:
    """Expose a bare cable in still water to a current of 2 m/s at once, and remove it again.

    In the steady state it hangs straight at the critical angle a from the vertical, w·sin a =
    ½·ρ·d·Cdn·U²·cos² a (its end has no load), and pulls with w·L·cos a + ½·ρ·pi·d·Cdt·U²·sin² a·L.
    """
    diameter, normal, tangential, U = 0.0173, 1.5, 0.01, 2.0
    mass = 8.89 / 9.80665 + WATER * 0.25 * math.pi * diameter**2  # 8.89 N/m in water
    rig = Rig(
        length=500.0, elements=100, mass=mass, EA=1.272e7, diameter=diameter, density=WATER,
        load=0.0, drag=(normal, tangential), added_mass=1.0, damping=1e4,
    )  # fmt: skip
    twin = rig.twin()
    snapshots = list(march(twin, still, 5.0, 10))
    twin.submit_current(np.array([[0.0, U, 0.0]]))
    snapshots += list(march(twin, still, 900.0, 10))
    force_n_per_m, skin = (
        0.5 * WATER * diameter * normal * U * U,
        0.5 * WATER * math.pi * diameter * tangential,
    )
    ratio = force_n_per_m / rig.weight  # sin a = r·(1 - sin² a)
    sine_a = (math.sqrt(1.0 + 4.0 * ratio * ratio) - 1.0) / (2.0 * ratio)
    end = snapshots[-1]
    angle_deg = math.degrees(math.atan2(end.payload_position_m[0], -end.payload_position_m[2]))
    pull = rig.weight * rig.length * math.sqrt(1.0 - sine_a**2)
    pull += skin * U * U * sine_a**2 * rig.length
    twin.submit_current(np.array([[0.0, 0.0, 0.0]]))
    still_again = list(march(twin, still, 900.0, 10))[-1]
    return [
        limited("angle against the critical angle of "
                f"{math.degrees(math.asin(sine_a)):.1f}°",
                abs(angle_deg - math.degrees(math.asin(sine_a))), 0.2, "°"),
        off("pull in the steady current", end.tension_top_n, pull, 0.1),
        limited(
            "largest push of the hang-off", max(0.0, -min(s.tension_top_min_n for s in snapshots)),
            0.0, "N",
        ),
        off("pull in still water again", still_again.tension_top_n, rig.top_weight, 0.1),
        all_converged(still_again.solver.unconverged_substeps),
    ]  # fmt: skip


def heave_jump() -> list[Finding]:
    """Interrupt a heave of 1.5 m / 8 s for 2 s, and resume it 1 m higher.

    The tension must be that of the hang-off's motion as the twin published it, and that motion must
    be gentle.
    """
    rig = Rig(load=20e3, damping=0.0)
    twin = rig.twin()
    heave = sine(1.5, 8.0)
    snapshots: list[Snapshot] = []
    k = 0
    for step in range(3000):
        while k * SAMPLE_NS <= step * twin.step_ns + AHEAD_NS:
            t = k * SAMPLE_NS * 1e-9
            if not 16.0 < t < 18.0:
                z, v = heave(t)
                twin.submit_heave(k * SAMPLE_NS, z + (1.0 if t >= 18.0 else 0.0), v)
            k += 1
        twin.advance(1)
        snapshots.append(twin.snapshot())
    motion = motion_made(snapshots, rig.step)
    bar = HangingBar(rig.mass, rig.weight, rig.EA, rig.load, rig.load_weight)
    exact = exact_top_tension(bar, lambda t: (rig.length, 0.0), motion, 30.0, MARCH_S)[10::10]
    pull = np.array([snapshot.tension_top_n for snapshot in snapshots])
    speed = np.array([snapshot.hang_off_velocity_m_per_s[2] for snapshot in snapshots])
    kick = float(np.abs(np.diff(speed)).max()) / rig.step
    track = np.array([heave(snapshot.time_s)[0] + 1.0 for snapshot in snapshots[BACK:]])
    deviation_m = np.array([snapshot.heave_m for snapshot in snapshots[BACK:]]) - track
    return [
        rms_off("top tension before the gap, rms", pull[:1600], exact[:1600], 0.05),
        rms_off("top tension over the whole, rms", pull, exact, front_pct(GENTLE)),
        limited("largest acceleration of the hang-off", kick, GENTLE, "m/s²"),
        limited("heave against the track 5.5 s after the gap",
                np.abs(deviation_m).max(), 1e-3, "m"),
        all_converged(snapshots[-1].solver.unconverged_substeps),
    ]  # fmt: skip


def motion_made(snapshots: list[Snapshot], step: float) -> Motion:
    """Return the hang-off's heave as published, cubic between the step boundaries."""
    z: Vector = np.array(
        [0.0, *(snapshot.heave_m for snapshot in snapshots), snapshots[-1].heave_m]
    )
    speeds = [snapshot.hang_off_velocity_m_per_s[2] for snapshot in snapshots]
    v: Vector = np.array([0.0, *speeds, speeds[-1]])

    def at(time: float) -> tuple[float, float]:
        k = min(int(time / step + 1e-9), len(z) - 2)
        u, d0, d1 = time / step - k, v[k] * step, v[k + 1] * step
        c2, c3 = 3.0 * (z[k + 1] - z[k]) - 2.0 * d0 - d1, 2.0 * (z[k] - z[k + 1]) + d0 + d1
        value = z[k] + u * (d0 + u * (c2 + u * c3))
        return float(value), float((d0 + u * (2.0 * c2 + u * 3.0 * c3)) / step)

    return at


CASES = (
    hard_case("step_100ms", "a step of 100 ms, smooth and in snap",
              "fine explicit 167.573, 205.23, 129.86 kN within second order of 50 ms; no overshoot",
              step_of_100_ms, 1.0, True),
    hard_case("current_step", "a current that steps from 0 to 2 m/s and back",
              "critical angle w·sin a = ½ρ·d·Cdn·U²·cos² a; skin drag; W + w·L",
              current_step, 12.0),
    hard_case("heave_jump", "heave that jumps 1 m after a gap of 2 s",
              "exact travelling waves for the motion made; 2 m/s²; back on the track in 5.5 s",
              heave_jump, 1.0, True),
)  # fmt: skip
