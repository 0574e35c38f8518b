"""Energy balance of multi-line systems: sheaves, friction, tethers and bars."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from joint_rigs import HEAVY, STIFF, JointBench, Line, tie
from sheave_rigs import atwood, flow, let_run

from rope_twin import load_scene
from rope_twin.core import state as rows
from rope_twin.core.energy import SystemStepEnergy, dissipated, measure_system
from rope_twin.scene.schema import Scene
from rope_twin.twin.monitors import ENERGY
from rope_twin.twin.snapshot import EnergyBalance
from rope_twin.twin.twin import Twin

FINE_N = 0.1  # of the solver: what it leaves must not be what is measured


def fine(name: str) -> Scene:
    """A scene solved finely."""
    scene = load_scene(name)
    return replace(scene, time=replace(scene.time, newton_tolerance_n=FINE_N))


def balance(scene: Scene, seconds: float, winches: dict[str, float]) -> EnergyBalance:
    """Return the balance after a run in a heave of 1 m in 6 s, with these winch speeds."""
    twin, omega = Twin(scene, ENERGY), 2.0 * math.pi / 6.0
    for name, speed in winches.items():
        assert twin.submit_speed(0, speed, name) == ""
    for half in range(round(2.0 * seconds)):
        for k in range(11):
            t = 0.5 * half + 0.05 * k
            twin.submit_heave(round(t * 1e9), math.sin(omega * t), omega * math.cos(omega * t))
        twin.advance(round(0.5 / twin.step_s))
    computed = twin.snapshot()
    assert computed.energy is not None
    if len(winches) > 1:
        assert min(computed.solver.splits, computed.solver.merges) > 0
    return computed.energy


def test_energy_balance_of_a_loop_over_a_tethered_sheave() -> None:
    """Both winches run, elements split and merge at ship and sheave, with friction.

    Without the sheave's own terms it does not close: friction alone takes a thousand times the
    residual.
    """
    scene = fine("two_line_loop")
    scene = replace(scene, sheaves=(replace(scene.sheaves[0], friction=0.2),))
    energy = balance(scene, 14.0, {"winch": 1.0, scene.hang_offs[0].name: -1.0})
    assert energy.exchanged_j > 1e5
    assert abs(energy.residual_j) < 5e-6 * energy.exchanged_j
    assert energy.damped_j > 1000.0 * abs(energy.residual_j)


def test_energy_balance_of_a_bridle_with_a_spreader_bar() -> None:
    """Joints, slings and a bar in compression, while the hoist pays out."""
    energy = balance(fine("bridle_lift"), 6.0, {"winch": 0.5})
    assert energy.exchanged_j > 1e5
    assert abs(energy.residual_j) < 5e-6 * energy.exchanged_j


def borders(bench: JointBench, steps: int) -> Iterator[SystemStepEnergy]:
    """Measure a system whose ropes have no hang-off, after each step."""
    still = np.zeros(len(bench.lines))
    for _ in range(steps):
        pulls = bench.hold(1)[:, 0]
        yield measure_system(bench.system, pulls, still, bench.time)


def test_sheave_friction_dissipates_tension_difference_times_travel() -> None:
    """Two loads over a fixed post: F - F' = F'·(exp(μ·π) - 1), which the loads lose.

    In a vacuum; the post is fixed, so nothing else takes or gives anything.
    """
    friction, ratio = 0.1, math.exp(0.1 * math.pi)
    bench = atwood(500.0, 1000.0, friction=friction)
    let_run(bench)
    bench.hold(50)
    seen = list(borders(bench, 200))
    heat = sum(dissipated(a, b, bench.step) for a, b in pairwise(seen))
    change = seen[-1].store.total - seen[0].store.total
    moved = abs(seen[-1].store.potential - seen[0].store.potential)
    assert change == pytest.approx(-heat, abs=1e-5 * moved)
    a, b, g = 500.0, 1000.0, 9.80665  # masses: accelerate by (b - a·ratio)·g/(b + a·ratio)
    accelerates = (b - a * ratio) * g / (b + a * ratio)
    assert abs(flow(bench)[2]) == pytest.approx(accelerates, rel=0.05)  # the rope has 40 kg
    light = a * (g + accelerates) * (ratio - 1.0)
    passed = 0.5 * accelerates * (2.5**2 - 0.5**2)
    assert heat == pytest.approx(light * passed, rel=0.06)


def test_a_tether_stores_the_work_of_its_tension() -> None:
    """A tether of 5 kN, 2 kN/m and 3 m from slack to taut: stored energy ∫F·dl, 0 while slack."""
    line = Line(rig=replace(STIFF, load=HEAVY), low=(0.0, 0.0, -20.0), high=(0.0, 0.0, 0.0))
    below = Line(
        rig=replace(STIFF, length=5.0, elements=3), low=(0.0, 0.0, -25.0), high=line.low, upper=0
    )
    held = tie(0, anchor=(0.0, 0.0, 0.0), force=-5e3, length=3.0, stiffness=2e3)
    bench = JointBench([replace(line, lower=0), below], held)
    pulls, still = np.zeros((2, rows.PULL_COLUMNS)), np.zeros(2)
    position = bench.system.joints.nodes
    lengths = np.linspace(1.0, 9.0, 161)
    stored = []
    for length in lengths:
        position[:3, 0] = (0.0, 0.0, -length)
        stored.append(measure_system(bench.system, pulls, still, 0.0).elements[-1].stored[0])
    pull = np.maximum(-5e3 + 2e3 * (lengths - 3.0), 0.0)
    work = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(lengths) * (pull[1:] + pull[:-1]))])
    assert np.array(stored) - stored[0] == pytest.approx(work, abs=1e-6)
    assert stored[0] == stored[80], "slack up to 5.5 m"
