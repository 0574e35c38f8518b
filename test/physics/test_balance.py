"""Forces, work and energy add up."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from payout_rigs import SEA
from rigs import Bench, Rig, Vector

from rope_twin import Snapshot
from rope_twin.core.state import Boundary

CURRENT = ((0.0, (0.9, 0.2)), (-400.0, (0.2, 0.6)), (-900.0, (-0.1, 0.1)))
IN_FLOW = replace(SEA, current=CURRENT, area=(5.0, 5.0, 8.0), load=6e3, drag=(1.2, 0.3))


def water_at(rig: Rig, z: Vector) -> Vector:
    """The current at heights z [m/s], (3, n); the end values hold outside the profile."""
    heights = [row[0] for row in reversed(rig.current)]
    parts = [np.interp(z, heights, [row[1][k] for row in reversed(rig.current)]) for k in (0, 1)]
    return np.stack([*parts, np.zeros_like(z)])


def drag_on_rope(rig: Rig, shot: Snapshot) -> Vector:
    """Morison drag of a rope at rest, cross-flow principle, summed over the nodes [N], (3,).

    Per metre ½·ρ·d·Cdn·|U_n|·U_n + ½·ρ·pi·d·Cdt·|U_t|·U_t; each node has half of its elements.
    """
    x, s = shot.node_position_m.T, shot.arc_length_m
    rest = np.diff(s)
    along = np.diff(x) / np.linalg.norm(np.diff(x), axis=0)
    tangent = np.concatenate([along[:, :1], along[:, :-1] + along[:, 1:], along[:, -1:]], axis=1)
    tangent /= np.linalg.norm(tangent, axis=0)
    lump = 0.5 * (np.concatenate([[0.0], rest]) + np.concatenate([rest, [0.0]]))
    U = water_at(rig, x[2])
    part = (U * tangent).sum(axis=0)
    across = U - part * tangent
    pressure = 0.5 * rig.density * rig.diameter * lump
    force = pressure * rig.drag[0] * np.linalg.norm(across, axis=0) * across
    force += pressure * math.pi * rig.drag[1] * np.abs(part) * part * tangent
    return np.asarray(force.sum(axis=1))


def test_the_pull_balances_weight_and_drag() -> None:
    """At rest in a turning current: pull on the hang-off = weight in water and drag below it."""
    shot = IN_FLOW.twin().snapshot()
    U = water_at(IN_FLOW, shot.payload_position_m[2:])[:, 0]
    total = drag_on_rope(IN_FLOW, shot)
    total += 0.5 * IN_FLOW.density * np.array(IN_FLOW.area) * np.linalg.norm(U) * U
    total[2] -= IN_FLOW.load_weight + IN_FLOW.weight * IN_FLOW.length
    assert np.linalg.norm(total[:2]) > 5e3
    assert shot.hang_off_force_n == pytest.approx(total, abs=1e-6 * shot.tension_top_n)
    assert shot.tension_top_n == pytest.approx(np.linalg.norm(shot.hang_off_force_n), rel=1e-14)


def energy(bench: Bench, rig: Rig) -> float:
    """Motion, stretch and height of rope and payload [J]; nodes carry half of their elements."""
    rest = np.diff(bench.rope.state.s[: bench.n + 1])
    mass = 0.5 * rig.mass * (np.concatenate([[0.0], rest]) + np.concatenate([rest, [0.0]]))
    mass[0] += rig.load
    strain = np.linalg.norm(np.diff(bench.position), axis=0) / rest - 1.0
    motion = 0.5 * (mass * (bench.velocity**2).sum(axis=0)).sum()
    height = (mass * rig.gravity * bench.position[2]).sum()
    return float(motion + height + 0.5 * rig.EA * (rest * np.maximum(strain, 0.0) ** 2).sum())


@pytest.mark.parametrize(("step", "most_lost"), [(0.01, 1e-5), (0.05, 3e-4)])
def test_energy_of_a_swing_in_vacuum(step: float, most_lost: float) -> None:
    """P5: released at 30 degrees, undamped: energy never grows, and little of it is lost.

    The scheme dissipates what the mesh cannot carry; the swing itself keeps its energy.
    """
    rig = Rig(length=100.0, elements=20, load=2e3, EA=20e6, step=step, tolerance=1e-3)
    bench = Bench(rig.scene())
    hanging = energy(bench, rig)
    depth, angle = -bench.position[2].copy(), math.radians(30.0)
    bench.position[0], bench.position[2] = depth * math.sin(angle), -depth * math.cos(angle)
    start = energy(bench, rig)
    highest, last = start, start
    for _ in range(round(60.0 / step / 10)):
        bench.hold(10)
        last = energy(bench, rig)
        highest = max(highest, last)
    swing = start - hanging
    assert swing > 1e5
    assert highest - start <= 1e-6 * swing
    assert start - last <= most_lost * swing


def test_payout_does_the_work_of_the_tension() -> None:
    """P5: what rope and payload lose while paid out is what the sheave takes.

    Hang-off fixed, vacuum: d(energy)/dt = V·(m·w²/2 + T²/(2·EA)) - V·T·(dz/ds) of the rope that
    passes the sheave at w = V·dz/ds, its height being 0 there. Within 5e-5 of ∫T·V dt.
    """
    rig = Rig(length=200.0, elements=20, step=0.005, winch=SEA.winch, tolerance=1e-3)
    bench = Bench(rig.scene())
    t = rig.step * np.arange(4001)
    u = np.minimum(t / 5.0, 1.0)
    value, rate = np.zeros((len(t), 4)), np.zeros((len(t), 4))
    rate[:, 3] = 2.0 * u**2 * (3.0 - 2.0 * u)
    value[:, 3] = rig.length + 2.0 * (5.0 * (u**3 - 0.5 * u**4) + np.maximum(t - 5.0, 0.0))
    start = energy(bench, rig)
    pull = np.array([bench.hold(1)[0]])  # the static pull, before the winch starts
    pulls = [bench.follow(Boundary(value[k : k + 2], rate[k : k + 2])) for k in range(len(t) - 1)]
    pull = np.concatenate([pull, *pulls])
    V, stretch = rate[:, 3], 1.0 + pull / rig.EA
    taken = np.trapezoid(V * pull * stretch, t)
    brought = V * (0.5 * rig.mass * (V * stretch) ** 2 + 0.5 * pull**2 / rig.EA)
    assert bench.n > rig.elements
    change = energy(bench, rig) - start
    assert change == pytest.approx(np.trapezoid(brought, t) - taken, abs=5e-5 * taken)
