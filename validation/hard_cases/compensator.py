"""A hard case of the heave compensator: driven to both ends of its stroke, slack included."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sin

import numpy as np
from scipy.integrate import solve_ivp

from rope_twin.effects.compensator import CompensatorParams
from rope_twin.scene.schema import Rope, RopeSection, Scene
from rope_twin.studies.driven_twin import march
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.twin import Twin
from validation.case import Finding, between, limited
from validation.hard_cases.limits import all_converged, hard_case, off, rms_off
from validation.rigs import Rig, sine
from validation.state_bench import Vector

UNIT_M, UNIT_KG_PER_M, STOP_N_PER_M = 6.0, 200.0, 5e6
ABOVE_M, ABOVE = 300.0, 3  # rope above the unit, and its elements
RIG = Rig(
    length=UNIT_M + ABOVE_M, elements=ABOVE + 1, mass=6.4, EA=65e6, diameter=0.04, damping=4e6,
    load=20e3, step=0.005, tolerance=5.0,
)  # fmt: skip
GRAVITY = RIG.gravity
AREA, STROKE, VOLUME, EXPONENT, CHI, OIL = 0.02, 2.0, 0.4, 1.3, 0.5, 2e3
LOAD_N = (RIG.load + 0.5 * UNIT_M * UNIT_KG_PER_M) * GRAVITY
UNIT = CompensatorParams(
    stroke_m=STROKE, piston_area_m2=AREA, gas_pressure_pa=LOAD_N / AREA, gas_volume_m3=VOLUME,
    exponent=EXPONENT, damping_newton_seconds_per_m=OIL, stop_damping_s_per_m=CHI,
)  # fmt: skip
AMPLITUDE_M, PERIOD_S, SECONDS = 3.0, 5.0, 20.0


def _scene(step: float) -> Scene:
    """Return the rig's scene with the unit as its lowest section."""
    scene = replace(RIG, step=step).scene()
    (line,) = scene.ropes
    assert line.rope is not None
    unit = Rope(
        diameter_m=0.5, mass_kg_per_m=UNIT_KG_PER_M, hydrodynamic_diameter_m=0.5,
        axial_stiffness_n=STOP_N_PER_M * UNIT_M, breaking_load_n=1e7,
    )  # fmt: skip
    sections = (RopeSection(rope=unit, length_m=UNIT_M), RopeSection(rope=line.rope))
    line = replace(line, rope=None, sections=sections)
    return replace(scene, ropes=(line,), effects=(*scene.effects, UNIT))


def _pull_of_unit(x: float, v: float) -> float:
    """Return the tension of the unit at a stroke and its rate, typed out [N]."""
    piston = min(max(x, 0.0), STROKE)
    gas = LOAD_N * (VOLUME / (VOLUME - AREA * (piston - 0.5 * STROKE))) ** EXPONENT
    if x > STROKE:
        gas += STOP_N_PER_M * (x - STROKE) * max(1.0 + CHI * v, 0.0)
    if x < 0.0:
        gas += STOP_N_PER_M * x * max(1.0 - CHI * v, 0.0)
    return float(max(gas + OIL * v, 0.0))


def _by_scipy(times: Vector) -> tuple[Vector, Vector]:
    """Return top element tension [N] and stroke [m] of the same chain of masses, by DOP853."""
    segment_m = ABOVE_M / ABOVE
    rope = np.full(ABOVE + 1, RIG.mass * segment_m)
    rope[0] *= 0.5
    mass = np.concatenate([[RIG.load + 0.5 * UNIT_M * UNIT_KG_PER_M], rope[:-1]])
    mass[1] += 0.5 * UNIT_M * UNIT_KG_PER_M
    k, c, omega = RIG.EA / segment_m, RIG.damping / segment_m, 2.0 * pi / PERIOD_S

    def tensions(t: float, state: Vector) -> Vector:
        z, v = state.reshape(2, -1)
        top = AMPLITUDE_M * sin(omega * t), AMPLITUDE_M * omega * np.cos(omega * t)
        span, rate = np.diff(np.append(z, top[0])), np.diff(np.append(v, top[1]))
        pull = np.maximum(k * (span - segment_m) + c * rate, 0.0)
        pull[0] = _pull_of_unit(span[0] - UNIT_M, rate[0])
        return pull

    def change(t: float, state: Vector) -> Vector:
        pull = tensions(t, state)
        force = pull - np.append(0.0, pull[:-1]) - mass * GRAVITY
        return np.concatenate([state[len(mass) :], force / mass])

    supported_n = np.cumsum(mass) * GRAVITY
    span = np.append(UNIT_M + 0.5 * STROKE, segment_m + supported_n[1:] / k)
    z = -np.cumsum(span[::-1])[::-1]
    began = np.concatenate([z, np.zeros_like(z)])
    solution = solve_ivp(
        change, (0.0, times[-1]), began, "DOP853", times, rtol=1e-9, atol=1e-9, max_step=0.02
    )
    pulls = np.array([tensions(t, y)[-1] for t, y in zip(times, solution.y.T, strict=True)])
    return pulls, solution.y[1] - solution.y[0] - UNIT_M


def stroke_end() -> list[Finding]:
    """Heave 3 m in 5 s on a unit of 2 m of stroke: stop, slack and snap in every period."""
    twin = Twin(_scene(RIG.step), Monitors(energy=True))
    snapshots = list(march(twin, sine(AMPLITUDE_M, PERIOD_S), SECONDS))
    times = np.array([snapshot.time_s for snapshot in snapshots])
    pulls, strokes = _by_scipy(times)
    tension_n = np.array([snapshot.element_tension_n[0] for snapshot in snapshots])
    units = [snapshot.compensator for snapshot in snapshots]
    stroke = np.array([unit.stroke_m for unit in units if unit is not None])
    slack = np.mean([snapshot.element_tension_n[-1] == 0.0 for snapshot in snapshots])
    energy, unconverged = snapshots[-1].energy, snapshots[-1].solver.unconverged_substeps
    assert energy is not None
    gained = 100.0 * max(-energy.residual_j, 0.0) / energy.exchanged_j
    return [
        between("share of the time with a slack unit", float(slack), (0.02, 1.0), "> 0"),
        limited("least depth of the extended stop", 0.001 / max(stroke.max() - STROKE, 1e-9), 1.0),
        off("peak tension at the stop, over the rope", tension_n.max(), pulls.max(), 2.0),
        off("longest stroke", stroke.max(), strokes.max(), 0.2),
        rms_off("tension over 20 s", tension_n, pulls, 3.0),
        limited("energy from nowhere, of what is exchanged", gained, 0.1),
        all_converged(unconverged),
    ]


CASES = (
    hard_case("stroke_end", "a compensator driven to both ends of its stroke, with slack and snap",
              "the chain of masses by scipy (DOP853)", stroke_end, 10.0),
)  # fmt: skip
