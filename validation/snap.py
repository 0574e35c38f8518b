"""P10: snap of a mass that falls taut, on a spring without mass and on a rope that has some.

DNV-RP-N103 puts F_snap = v·√(K·(M + A33)) on top of the static load. It is the energy of a mass on
a massless spring that carries no weight; a rope with mass carries a wave of the tension m·c·v,
which the lower end and the hang-off reflect.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rope_twin.errors import SolverError
from rope_twin.studies.driven_twin import march
from rope_twin.studies.picture import Line, Panel, Vector
from rope_twin.twin.motion.heave_track import ramp
from rope_twin.twin.snapshot import Snapshot
from validation.case import Case, Finding, Found, derived, shown, within_pct
from validation.rigs import Rig
from validation.state_bench import lift

SPRING = Rig(
    length=100.0, elements=3, mass=1e-2, EA=6.9e6, diameter=1e-3, load=5e3, volume=1.0,
    added=(2e3, 2e3, 2e3), density=1025.0,
)  # fmt: skip
ROPE = replace(
    SPRING, length=500.0, elements=50, mass=2.9, EA=206e6, diameter=0.06, load=20e3, volume=3.0,
    added=(7e3, 7e3, 7e3),
)  # fmt: skip
LINE = Rig(length=2000.0, elements=100, mass=2.9, EA=206e6, density=1025.0, step=2.5e-3)
SHARES = (0.05, 0.2, 0.5)  # of the rope's mass in M'
SINKING = 2e-3  # acceleration of the almost weightless line and its load [m/s²]
SNAP_SPEED, LOWERED, LOWERING_S, GAINING_S = 3.0, 1.0, 1.0, 0.3  # of the hang-off [m/s, m, s, s]
WATCHED = 8.2  # after the snap [L/c]
DROPS = ((1.0, 0.6), (3.0, 1.0), (6.0, 1.5))  # of the ship [m], within [s]


NOTES = (
    "DNV-RP-N103 adds F_snap = v·√(K·(M + A33)) to the static load W. The exact pull on a massless "
    "spring is W + √(W² + K·M'·v²): the weight goes on working while the spring stretches, which "
    "the formula leaves out. It is low by 2 to 14 % here, by a half where v is 0, and exact for "
    "fast snaps.",
    "A rope with mass pulls more than the formula: stopped or jerked at its top it carries a wave "
    "of the tension m·c·v = v·√(K·m·L), which comes back from the load almost doubled and is "
    "doubled again at the hang-off, on top of the slow pull. So the ratio grows with the rope's "
    "share in the moving mass, whatever the speed. K·M'·v² alone, or with a third of the rope's "
    "mass in M', does not see it.",
    "The front is a jump, and a mesh without damping overshoots it, the more the finer it is "
    "(Gibbs): so the pulls are compared as means over a fifth of the time in which a wave runs "
    "through the rope. A rope with damping has no such jump.",
)


@dataclass(frozen=True)
class Caught:
    """A fall and how it was caught."""

    speed: float  # when the rope came taut [m/s]
    pull: float  # the highest [N]
    time_s: list[float]
    tension_n: list[float]


def drop(rig: Rig, height: float, seconds: float) -> Caught:
    """Motion of a ship that drops faster than the load falls, then stops.

    With neither drag nor damping the load falls freely: v² = v_k² + 2·(W/M')·(way left).

    Raises:
        SolverError: the rope was never caught, or a substep did not converge.
    """
    moving, weight = rig.load + rig.added[2], rig.load_weight
    taut_at = -height - rig.length
    before: Snapshot | None = None
    speed = 0.0
    times: list[float] = []
    pulls: list[float] = []
    for snapshot in march(rig.twin(), lift(-height, seconds), seconds + 4.0):
        remaining = snapshot.payload_position_m[2] - taut_at
        if before is not None and speed == 0.0 and remaining <= 0.0 and snapshot.time_s > seconds:
            way = before.payload_position_m[2] - taut_at
            v = before.payload_velocity_m_per_s[2]
            speed = math.sqrt(v * v + 2.0 * weight / moving * way)
        times.append(snapshot.time_s)
        pulls.append(snapshot.tension_top_n)
        before = snapshot
        if speed and snapshot.payload_velocity_m_per_s[2] > 0.0:
            if snapshot.solver.unconverged_substeps:
                raise SolverError("snap", "a substep did not converge", "shorten the step")
            return Caught(speed, max(pulls), times, pulls)
    raise SolverError("snap", "the rope was never caught", "watch it for longer")


def snap(weight: float, stiffness: float, mass: float, speed: float) -> float:
    """Return T_max = W + √(W² + K·M'·v²): energy of a mass that falls taut on a massless spring."""
    return weight + math.sqrt(weight**2 + stiffness * mass * speed**2)


def n103(weight: float, stiffness: float, mass: float, speed: float) -> float:
    """Return F_static + F_snap of DNV-RP-N103, F_snap = v·√(K·(M + A33))."""
    return weight + speed * math.sqrt(stiffness * mass)


def wave_pull(share: float, spans: int = 4, parts: int = 2000) -> tuple[Vector, Vector]:
    """Return the top tension over m·c·v of a rope with an end mass, stopped at its top at once.

    By characteristics (d'Alembert): at the top D = U + 1, at the end mass (U - D)' + r·(U - D) =
    -2·r·D with r = m·L/M', for the tensions D and U of the waves running down and up, each late by
    L/c from the other end. Returns times over L/c and tensions.
    """
    later = 2 * parts
    shrink = math.exp(-share / parts)
    downward, upward = np.ones(spans * later + 1), np.zeros(spans * later + 1)  # at the lower end
    difference = 0.0
    for i in range(len(downward)):
        if i >= later:
            downward[i] += upward[i - later]
        if i > 0:
            middle = 0.5 * (upward[i - later] + upward[i - later - 1]) if i > later else 0.0
            difference = difference * shrink - 2.0 * (1.0 + middle) * (1.0 - shrink)
        upward[i] = downward[i] + difference
    top = 1.0 + 2.0 * np.concatenate([np.zeros(later), upward])
    return np.arange(len(top)) / parts, top


def _jerk(time: float) -> tuple[float, float]:
    """Return position and velocity of a hang-off that makes slack, then moves up at a speed."""
    if time < LOWERING_S:
        share, rate = ramp(time, LOWERING_S)
        return -LOWERED * share, -LOWERED * rate
    elapsed = time - LOWERING_S
    gained = min(elapsed, GAINING_S)
    rate = SNAP_SPEED / GAINING_S
    return -LOWERED + rate * gained * (elapsed - 0.5 * gained), rate * gained


def _smooth(values: Vector, count: int) -> Vector:
    return np.convolve(values, np.ones(count) / count, mode="same")


def _wave(share: float) -> tuple[list[Finding], Panel]:
    """Jerk an almost weightless rope with its load from rest, from slack, at a speed."""
    moving = LINE.mass * LINE.length / share
    lighter = 1.0 - SINKING / LINE.gravity
    rig = replace(
        LINE, load=0.75 * moving, added=(0.25 * moving,) * 3,
        volume=(0.75 * moving - moving * SINKING / LINE.gravity) / LINE.density,
        diameter=math.sqrt(lighter * LINE.mass / (0.25 * math.pi * LINE.density)),
    )  # fmt: skip
    celerity = math.sqrt(rig.EA / rig.mass)
    transit = rig.length / celerity
    taut = LOWERING_S + 0.5 * GAINING_S + LOWERED / SNAP_SPEED
    snapshots = march(rig.twin(), _jerk, taut + (WATCHED + 0.3) * transit)
    time, pull = np.array([(snapshot.time_s, snapshot.tension_top_n) for snapshot in snapshots]).T
    speed = SNAP_SPEED + SINKING * taut
    times, exact = wave_pull(share)
    exact *= rig.mass * celerity * speed
    fine = np.where(time >= taut, np.interp((time - taut) / transit, times, exact), 0.0)
    count = round(0.2 * transit / rig.step)
    slack = times[exact < 0.0]  # the waves are those of a taut rope
    end = min(WATCHED, slack[0]) if len(slack) else WATCHED
    window = (time > taut) & (time < taut + end * transit)
    ours, fine_peak = (float(_smooth(row, count)[window].max()) for row in (pull, fine))
    load = n103(0.0, rig.EA / rig.length, moving, speed)
    name = f"rope of {100.0 * share:g} % of the load's mass, jerked at {speed:.2f} m/s"
    findings = [
        derived(within_pct(f"{name}: highest pull over L/5c", ours, fine_peak, 2.0, "N")),
        shown(f"{name}: highest pull over N103's", float(pull[window].max()) / load,
              f"{exact[times < end].max() / load:.3f} by waves (derived)"),
    ]  # fmt: skip
    kilo = 1e-3
    picture = Panel(
        f"rope of {100.0 * share:g} % of the load's mass", "time from the snap [L/c]",
        "top tension [kN]",
        (Line((time[window] - taut) / transit, kilo * pull[window], "ours"),
         Line(times[times < end], kilo * exact[times < end], "waves", "--"),
         Line((0.0, end), (kilo * load,) * 2, "DNV-RP-N103", "k:")),
    )  # fmt: skip
    return findings, picture


def _snaps() -> Found:
    findings, lines = [], []
    for height, seconds in DROPS:
        drop_run = drop(SPRING, height, seconds)
        mass = SPRING.load + SPRING.added[2]
        expected = snap(SPRING.load_weight, SPRING.EA / SPRING.length, mass, drop_run.speed)
        quantity = f"mass on a spring, taut at {drop_run.speed:.2f} m/s: highest pull"
        findings.append(within_pct(quantity, drop_run.pull, expected, 1.0, "N"))
        load = n103(SPRING.load_weight, SPRING.EA / SPRING.length, mass, drop_run.speed)
        quantity = f"mass on a spring, taut at {drop_run.speed:.2f} m/s: highest pull over N103's"
        findings.append(derived(within_pct(quantity, drop_run.pull / load, expected / load, 1.0)))
        lines += [
            Line(
                drop_run.time_s,
                [1e-3 * pull for pull in drop_run.tension_n],
                f"{drop_run.speed:.2f} m/s",
            ),
            Line(drop_run.time_s[-1:], [1e-3 * expected], "", "kx"),
        ]
    drop_run = drop(ROPE, 3.0, 1.0)
    weight = ROPE.load_weight + ROPE.weight * ROPE.length
    mass = ROPE.load + ROPE.added[2]
    expected = snap(weight, ROPE.EA / ROPE.length, mass, drop_run.speed)
    quantity = f"rope of 5 % of the load's mass, taut at {drop_run.speed:.2f} m/s: highest pull"
    findings.append(within_pct(quantity, drop_run.pull, expected, 10.0, "N"))
    panels: tuple[Panel, ...] = (
        Panel("mass on a weightless spring; crosses: closed form", "time [s]", "top tension [kN]",
              tuple(lines)),
        Panel("rope with mass that falls; cross: closed form", "time [s]", "top tension [kN]",
              (Line(drop_run.time_s, [1e-3 * pull for pull in drop_run.tension_n]),
               Line(drop_run.time_s[-1:], [1e-3 * expected], "", "kx"))),
    )  # fmt: skip
    for share in SHARES:
        wave_findings, picture = _wave(share)
        findings += wave_findings
        panels += (picture,)
    return Found(tuple(findings), panels, NOTES)


CASES = (
    Case("P10", "snap of a mass that falls taut: T_max = W + √(W² + K·M'·v²)",
         "closed form; DNV-RP-N103 for the rope", _snaps, 5.0),
)  # fmt: skip
