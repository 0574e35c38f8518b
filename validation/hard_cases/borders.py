"""Hard cases where the rope meets another medium: waves that break over slack rope, stick and slip.

Both run the twin itself, as a scene would.
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np

from rope_twin.effects.bed_friction import BedFrictionParams
from rope_twin.effects.rope_in_air import WettingParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.scene.schema import Scene, Winch
from rope_twin.studies.driven_twin import march, still
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.twin import Twin
from validation.case import Finding, between, limited
from validation.hard_cases.limits import all_converged, hard_case, off
from validation.hard_cases.rigs import sine
from validation.rigs import WATER, Rig

SPLASHED = Rig(
    length=45.0, elements=30, mass=20.0, EA=4e7, diameter=0.08, damping=4e5, load=300.0,
    volume=0.05, added=(50.0,) * 3, area=(1.0,) * 3, density=WATER, drag=(1.2, 0.02),
    added_mass=1.0, hang_off=(0.0, 0.0, 15.0), step=0.01,
)  # fmt: skip
STEEP = WavesParams(regular=RegularWave(height_m=10.0, period_s=8.5), ramp_s=8.0)
CHAIN_M, DEPTH_M, SUNK_M, MU = 200.0, 50.0, 0.0902, 0.6
CHAIN = Rig(
    length=CHAIN_M, elements=200, mass=100.0, EA=2e6, diameter=0.1, damping=2e4, load=0.0,
    fixed_at=(0.0, 0.0, -DEPTH_M - SUNK_M), hang_off=(CHAIN_M, 0.0, -DEPTH_M - SUNK_M),
    density=WATER, drag=(1.0, 0.1), step=0.02, winch=Winch(
        speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=2.0, min_line_out_m=190.0,
        max_line_out_m=210.0,
    ),
)  # fmt: skip
PULL_M, SPEED, CYCLES = 0.6, 0.01, 4


def _with(rig: Rig, *effects: Any) -> Scene:
    scene = rig.scene()
    return replace(scene, effects=(*scene.effects, *effects))


def breaking_surface() -> list[Finding]:
    """Run 300 kg on 45 m of wire through waves of 10 m, in a heave of 4 m and 5 s."""
    heave, tops = sine(4.0, 5.0), []
    for step in (0.01, 0.0025):
        scene = _with(replace(SPLASHED, step=step), STEEP, WettingParams())
        snapshots = list(march(Twin(scene, Monitors(energy=True)), heave, 40.0))
        tops.append(np.array([snapshot.tension_top_max_n for snapshot in snapshots]))
        if step == 0.01:
            slack = np.mean([snapshot.element_tension_n.min() == 0.0 for snapshot in snapshots])
            energy, unconverged = snapshots[-1].energy, snapshots[-1].solver.unconverged_substeps
    assert energy is not None
    gained = 100.0 * max(-energy.residual_j, 0.0) / energy.exchanged_j
    return [
        between("share of the time with slack rope", float(slack), (0.1, 1.0), "> 0"),
        off(
            "peak of the top tension against a fourth of the step",
            tops[0].max(),
            tops[1].max(),
            3.0,
        ),
        limited("energy from nowhere, of what is exchanged", gained, 0.1),
        all_converged(unconverged),
    ]


def stick_slip() -> list[Finding]:
    """Haul a chain over the bed, pay a fourth of it out again, haul, four times."""
    speeds, time = [(0.0, -SPEED)], PULL_M / SPEED
    marks = [time]
    for _ in range(CYCLES):
        for speed in (SPEED, -SPEED):
            speeds.append((time, speed))
            time += 0.25 * PULL_M / SPEED
            marks.append(time)
    speeds.append((time, 0.0))
    scene = _with(
        CHAIN, SeabedParams(depth_m=DEPTH_M, friction=MU), BedFrictionParams(slip_m=0.002)
    )
    snapshots = list(march(Twin(scene), still, time + 60.0, speeds=speeds))
    stamps = np.array([snapshot.time_s for snapshot in snapshots])
    pulls_n = [
        float(np.interp(mark, stamps, [s.element_tension_n[0] for s in snapshots]))
        for mark in marks
    ]
    pulled = sqrt(2.0 * MU * CHAIN.weight * CHAIN.EA * PULL_M)
    last_n = float(snapshots[-1].element_tension_n[0])
    return [
        off("first pull against √(2·μ·w·EA·δ)", pulls_n[0], pulled, 1.5),
        off(
            "a fourth paid out again: 1 - 1/√2 of it",
            pulls_n[1],
            (1.0 - 1.0 / sqrt(2.0)) * pulled,
            4.0,
        ),
        off("the loop closes: last pull against the first", pulls_n[-1], pulls_n[0], 0.5),
        off("held for a minute", last_n, pulls_n[-1], 1.5),
        limited("tension at the far end", float(snapshots[-1].tension_payload_n) / 1e3, 0.2, "kN"),
        all_converged(snapshots[-1].solver.unconverged_substeps),
    ]


CASES = (
    hard_case("breaking_surface", "300 kg on slack wire through waves of 10 m, half in air",
              "a fourth of the step; energy", breaking_surface, 30.0),
    hard_case("stick_slip", "a chain hauled to and fro over the bed",
              "elastic bar on a Coulomb bed, closed form (Masing's rule)", stick_slip, 15.0),
)  # fmt: skip
