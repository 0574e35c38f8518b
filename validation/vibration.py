"""Natural vibration of ropes, measured from free oscillations of the twin: P2, P3."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rope_twin.studies.driven_twin import march
from rope_twin.studies.picture import Line, Panel, Vector
from validation.case import Case, Finding, Found, within_pct
from validation.rigs import Rig
from validation.state_bench import frequency, lift, pluck

TENSION = 100e3
STRING = Rig(length=300.0, mass=6.4, diameter=0.04, density=1025.0, gravity=0.0)
STRETCHED = STRING.length * (1.0 + TENSION / STRING.EA)
STRINGS = ((6.4, 0.04, 0.0), (2.9, 0.06, 1.0), (2.9, 0.06, 10.0))  # kg/m, m, Ca
MODES = 5
STEEL = Rig(mass=3989.7 * 0.076**2, EA=4.04e10 * 0.076**2, diameter=0.8 * 0.076)
HMPE = Rig(
    mass=495.7 * 0.0762**2, EA=56.5 * (5.795e8 * 0.0762**2 + 6.507e8 * 0.0762**3), diameter=0.0613
)
SHOWN_PERIODS = 4.0  # of the motion in the picture
MOVING = 150e3  # M': 100 t of payload, 50 t of water that moves with it
PERIODS_S = (
    ("steel", STEEL, 1e3, 5.17), ("steel", STEEL, 3e3, 9.39), ("steel", STEEL, 5e3, 12.68),
    ("HMPE", HMPE, 1e3, 5.37), ("HMPE", HMPE, 3e3, 9.36), ("HMPE", HMPE, 5e3, 12.17),
)  # fmt: skip


def _one_string(mass: float, diameter: float, Ca: float) -> tuple[list[Finding], Line]:
    """Return the projection on a mode of the discrete string, a sine that oscillates by itself."""
    rig = replace(
        STRING, mass=mass, diameter=diameter, added_mass=Ca, fixed_at=(STRETCHED, 0.0, 0.0)
    )
    per_metre = mass + Ca * rig.density * 0.25 * math.pi * diameter**2
    first = 0.5 / STRETCHED * math.sqrt(TENSION / (per_metre * rig.length / STRETCHED))
    duration = 0.8 / (MODES * first)
    snapshots = march(rig.twin(), pluck(0.05, duration), duration + 12.0 / first, every=2)
    free = np.array([s.node_position_m[:, 2] for s in snapshots if s.time_s > duration])
    s = np.linspace(0.0, 1.0, rig.elements + 1)
    findings, orders = [], range(1, MODES + 1)
    for n in orders:
        ours = frequency(free @ np.sin(n * math.pi * s), 2 * rig.step)
        findings.append(
            within_pct(f"{mass:g} kg/m, Ca {Ca:g}: frequency {n}", ours, n * first, 0.5, "Hz")
        )
    errors_pct = [100.0 * (findings[n - 1].ours / (n * first) - 1.0) for n in orders]
    return findings, Line(list(orders), errors_pct, f"{mass:g} kg/m, Ca {Ca:g}", "o-")


def _strings(cases: Sequence[tuple[float, float, float]] = STRINGS) -> Found:
    pairs = [_one_string(*case) for case in cases]
    findings = [finding for string_findings, _ in pairs for finding in string_findings]
    lines = tuple(line for _, line in pairs)
    picture = Panel("Frequencies of a taut string in water", "mode", "off [%]", lines)
    return Found(tuple(findings), (picture,))


def _period(rope: Rig, length: float) -> tuple[float, float, Vector, Vector]:
    """Return exact and measured period [s]; time [s] and first-mode motion after one lift."""
    from scipy.optimize import brentq

    ratio = rope.mass * length / MOVING
    x = brentq(lambda x: x * math.tan(x) - ratio, 1e-9, 0.5 * math.pi - 1e-9)
    period = 2.0 * math.pi * length / math.sqrt(rope.EA / rope.mass) / x
    rig = replace(
        rope, length=length, elements=200, load=100e3, volume=10.0, added=(1e3, 1e3, 50e3),
        density=1025.0, step=0.02,
    )  # fmt: skip
    twin = rig.twin()
    rest_z = twin.snapshot().node_position_m[:, 2]
    snapshots = march(twin, lift(0.2, 0.5 * period), 12.0 * period, every=5)
    rows = [
        (s.time_s, s.node_position_m[:, 2] - rest_z) for s in snapshots if s.time_s > 0.5 * period
    ]
    mass = np.full(rig.elements + 1, rope.mass * length / rig.elements)
    mass[0] *= 0.5
    mass[-1] = 0.5 * mass[-1] + MOVING
    mode = np.cos(x * np.linspace(1.0, 0.0, rig.elements + 1))
    motion = np.array([row[1] for row in rows]) @ (mass * mode) / mass.sum()
    time = np.array([row[0] for row in rows])
    return period, 1.0 / frequency(motion, 5 * rig.step), time, motion


def _periods(cases: Sequence[tuple[str, Rig, float, float]] = PERIODS_S) -> Found:
    findings, lines = [], []
    for name, rope, length, printed in cases:
        exact, ours, time, motion = _period(rope, length)
        quantity = f"{name}, {length / 1e3:g} km: axial period"
        findings.append(within_pct(f"{quantity}, x·tan x = m·L/M'", ours, exact, 0.2, "s"))
        findings.append(within_pct(f"{quantity}, as printed", ours, printed, 0.3, "s"))
        first = time < SHOWN_PERIODS * exact
        lines.append(Line(time[first] / exact, motion[first], f"{name}, {length / 1e3:g} km"))
    periods = "time over the period in closed form"
    picture = Panel("150 t after one lift of the hang-off", periods, "motion [m]", tuple(lines))
    notes = ("The printed periods have three digits: they are held to 0.3 %.",)
    return Found(tuple(findings), (picture,), notes)


CASES = (
    Case("P2", "taut string in water: n/(2L)·√(T/m) with added mass, 100 elements", "closed form",
         _strings, 10.0, lambda: _strings(STRINGS[1:2])),
    Case("P3", "axial periods of rope and payload, 150 t, 200 elements",
         "closed form x·tan x = m·L/M'", _periods, 10.0, lambda: _periods(PERIODS_S[4:5])),
)  # fmt: skip
