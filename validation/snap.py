"""P10: snap of a mass that falls taut, on a spring without mass and on a rope that has some."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from rope_twin.errors import SolverError, phrase
from rope_twin.studies.driven_twin import march
from rope_twin.studies.picture import Line, Panel
from rope_twin.twin.snapshot import Snapshot
from validation.case import Case, Found, within_pct
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
DROPS = ((1.0, 0.6), (3.0, 1.0), (6.0, 1.5))  # of the ship [m], within [s]


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
    for shot in march(rig.twin(), lift(-height, seconds), seconds + 4.0):
        left = shot.payload_position_m[2] - taut_at
        if before is not None and speed == 0.0 and left <= 0.0 and shot.time_s > seconds:
            way = before.payload_position_m[2] - taut_at
            v = before.payload_velocity_m_per_s[2]
            speed = math.sqrt(v * v + 2.0 * weight / moving * way)
        times.append(shot.time_s)
        pulls.append(shot.tension_top_n)
        before = shot
        if speed and shot.payload_velocity_m_per_s[2] > 0.0:
            if shot.solver.unconverged_substeps:
                raise SolverError(phrase("snap", "a substep did not converge", "shorten the step"))
            return Caught(speed, max(pulls), times, pulls)
    raise SolverError(phrase("snap", "the rope was never caught", "watch it for longer"))


def snap(weight: float, stiffness: float, mass: float, speed: float) -> float:
    """Return T_max = W + √(W² + K·M'·v²): energy of a mass that falls taut on a massless spring."""
    return weight + math.sqrt(weight**2 + stiffness * mass * speed**2)


def _snaps() -> Found:
    findings, lines = [], []
    for height, seconds in DROPS:
        seen = drop(SPRING, height, seconds)
        mass = SPRING.load + SPRING.added[2]
        expected = snap(SPRING.load_weight, SPRING.EA / SPRING.length, mass, seen.speed)
        words = f"mass on a spring, taut at {seen.speed:.2f} m/s: highest pull"
        findings.append(within_pct(words, seen.pull, expected, 1.0, "N"))
        lines += [
            Line(seen.time_s, [1e-3 * pull for pull in seen.tension_n], f"{seen.speed:.2f} m/s"),
            Line(seen.time_s[-1:], [1e-3 * expected], "", "kx"),
        ]
    seen = drop(ROPE, 3.0, 1.0)
    weight = ROPE.load_weight + ROPE.weight * ROPE.length
    mass = ROPE.load + ROPE.added[2]
    expected = snap(weight, ROPE.EA / ROPE.length, mass, seen.speed)
    words = f"rope of 5 % of the load's mass, taut at {seen.speed:.2f} m/s: highest pull"
    findings.append(within_pct(words, seen.pull, expected, 10.0, "N"))
    panels = (
        Panel("mass on a weightless spring; crosses: closed form", "time [s]", "top tension [kN]",
              tuple(lines)),
        Panel("rope with mass; cross: DNV-RP-N103", "time [s]", "top tension [kN]",
              (Line(seen.time_s, [1e-3 * pull for pull in seen.tension_n]),
               Line(seen.time_s[-1:], [1e-3 * expected], "", "kx"))),
    )  # fmt: skip
    return Found(tuple(findings), panels)


CASES = (
    Case("P10", "snap of a mass that falls taut: T_max = W + √(W² + K·M'·v²)",
         "closed form; DNV-RP-N103 for the rope", _snaps, 3.0),
)  # fmt: skip
