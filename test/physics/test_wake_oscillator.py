"""Wake oscillator against Runge-Kutta: second order, block and power."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from effect_cases import NODES, data_of, loads, some_work
from hypothesis import given
from hypothesis import strategies as st
from rigs import Bench, Vector, march, sine, still
from shedding_rigs import DENSITY, DIAMETER, HAULED, HAULING, Cylinder, runge_kutta
from test_effects import BLOCKS, R, jacobian, matrix
from test_energy_accounts import seen, three

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.loads.accounts import account_sum
from rope_twin.effects import wake_oscillator as wake
from rope_twin.effects.wake_oscillator import WakeOscillator, WakeOscillatorParams
from rope_twin.vortex.wake import _shed

SET = wake.SETS["qu_metrikine"]
AROUND = SimpleNamespace(room=4, water_density_kg_per_m3=1025.0)
RATE = 1.0  # of q at the start [1/s]


def wake_of(effects: tuple[Any, ...]) -> WakeOscillator:
    """The one among them."""
    return next(effect for effect in effects if isinstance(effect, WakeOscillator))


def stepped(cylinder: Cylinder, seconds: float) -> Vector:
    """Places in line and across [m] by the rope's own step; both nodes start alike."""
    bench = Bench(cylinder.scene(WakeOscillatorParams(shape_over_s=1e4)))
    memory = wake_of(bench.rope.effects).memory
    bench.time = 1.0  # at 0 it would start from its own noise
    p, epsilon = RATE / shedding(cylinder), SET.upright[1]
    memory[: wake.SHAPE] = np.array([[0.0], [RATE], [p], [epsilon * RATE]])
    return cylinder.run(bench, seconds)


def shedding(cylinder: Cylinder) -> float:
    """ω_s [rad/s]."""
    return 2.0 * math.pi * SET.strouhal * cylinder.speed / DIAMETER


def integrated(cylinder: Cylinder, seconds: float, step: float) -> Vector:
    """Integrate the equations of [QM], written out, by Runge and Kutta."""
    A, epsilon = SET.upright
    V, M, omega = cylinder.speed, cylinder.moving, shedding(cylinder)
    k = M * (2.0 * math.pi * cylinder.frequency) ** 2
    half = 0.5 * DENSITY * DIAMETER

    def slope(state: Vector) -> Vector:
        x, y, vx, vy, q, rate = state
        ux, uy = V - vx, -vy
        speed = math.hypot(ux, uy)
        # drag along U, lift along U × t with t upward
        drag, lift = half * cylinder.drag * speed, half * 0.5 * SET.lift * q * speed
        ax = (drag * ux + lift * uy - k * x) / M
        ay = (drag * uy - lift * ux - k * y) / M
        return np.array(
            [vx, vy, ax, ay, rate,
             -epsilon * omega * (q * q - 1.0) * rate - omega**2 * q - A / DIAMETER * ay]
        )  # fmt: skip

    at_rest = half * cylinder.drag * V * V / k
    states = runge_kutta(
        slope, np.array([at_rest, 0.0, 0.0, 0.0, 0.0, RATE]), step, round(seconds / step)
    )
    return states[:, :2]


def test_the_wake_oscillator_converges_to_runge_kutta_in_second_order() -> None:
    """Twelve periods up to lock-in at one diameter: 0.013 D at 10 ms, a fourth at half the step."""
    exact = integrated(Cylinder(), 12.0, 1e-3)
    assert 1.0 < np.abs(exact[:, 1]).max() / DIAMETER < 1.1
    errors = []
    for step in (0.04, 0.02, 0.01):
        computed = stepped(Cylinder(step=step), 12.0)
        every = round(step / 1e-3)
        errors.append(float(np.abs(computed - exact[every - 1 :: every]).max()) / DIAMETER)
    assert errors[-1] < 0.013
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.3)
    assert errors[1] / errors[2] == pytest.approx(4.0, abs=0.3)


def test_the_wake_restarts_at_time_zero_without_lift() -> None:
    """Two runs from rest are one; the rope at rest hangs straight down the current."""
    scene = Cylinder().scene(WakeOscillatorParams())
    one, two = Twin(scene), Twin(scene)
    assert abs(one.snapshot().node_position_m[1, 1]) < 1e-12
    for twin in (one, two):
        twin.advance(50)
    assert np.array_equal(one.snapshot().node_position_m, two.snapshot().node_position_m)
    assert abs(one.snapshot().node_position_m[1, 1]) > 1e-6


def with_wake(seed: int, moving: bool) -> tuple[tuple[Any, ...], Vector]:
    """The effect on scratch in any motion; not `moving`: its q is fixed, as a step's end has it."""
    effects, work = data_of("wake_oscillator"), some_work(seed)
    random, memory = np.random.default_rng(seed), wake_of(effects).memory
    arc = np.append(0.0, np.cumsum(work[rows.REST, :-1]))
    length = np.zeros(NODES)
    length[:-1] += 0.5 * np.diff(arc)
    length[1:] += 0.5 * np.diff(arc)
    memory[0, :NODES] = random.normal(0.0, 1.5, NODES)
    memory[0, NODES - 1] = memory[0, NODES - 2]
    memory[wake.HAT] = memory[0]
    strength = wake_of(effects).strength
    memory[wake.STRENGTH, :NODES] = strength * np.sqrt(4.0 / math.pi * work[rows.VOLUME] * length)
    memory[wake.GUESS] = memory[0]
    if moving:
        memory[wake.OMEGA], memory[wake.EPSILON] = 8.0, 0.3
        memory[wake.WAKE_HAT] = 0.6
        shape = memory[wake.COUPLING : wake.COUPLING + 3].shape
        memory[wake.COUPLING : wake.COUPLING + 3] = random.normal(0.0, 60.0, shape)
    return effects, work


@pytest.mark.parametrize("seed", [1, 2])
def test_wake_block_is_the_derivative_of_the_force(seed: int) -> None:
    """The symmetric part of -dF/da, through q as well, 1e-6."""
    effects, work = with_wake(seed, True)
    for _ in range(4):  # each evaluation starts from the q of the one before
        result = loads(effects, work)
    for node in range(NODES - 1):
        exact = jacobian(effects, work, node)
        symmetric = 0.5 * (exact + exact.T)
        scale = np.abs(exact).max()
        assert np.abs(matrix(result[BLOCKS, node]) - symmetric).max() < 1e-6 * scale


@pytest.mark.parametrize("seed", [1, 2])
def test_wake_power_is_force_times_velocity(seed: int) -> None:
    effects, work = with_wake(seed, False)
    force = (loads(effects, work) - loads((), work))[R]
    assert np.abs(force).max() > 1.0
    position = seen(work, np.zeros((3, NODES)), 0.0)
    done = float((force * three(work, rows.VELOCITY)).sum())
    assert done == pytest.approx(account_sum("power", effects, position), rel=1e-9)


@given(seed=st.integers(0, 10**6), speed=st.sampled_from([0.0, 1e-12, 1e-3, 1.0, 30.0]))
def test_the_wake_does_no_work_on_still_water(seed: int, speed: float) -> None:
    """The lift is across the relative velocity, whatever q: none at rest, no work where none flows.

    To round-off of the tangent: 1e-12 of force times speed.
    """
    effects, work = with_wake(seed, False)
    velocity = slice(rows.VELOCITY, rows.VELOCITY + 3)
    work[velocity] *= speed
    work[rows.ACCELERATION : rows.ACCELERATION + 3] = 0.0  # so that the lift is all there is
    result = loads(effects, work)
    force = result[R]
    assert np.isfinite(result).all()
    done = np.abs((force * work[velocity]).sum(axis=0))
    sizes = np.linalg.norm(force, axis=0) * np.linalg.norm(work[velocity], axis=0)
    assert (done <= 1e-12 * sizes).all()
    assert (sizes > 0.0).all() == (speed > 0.0)
    work[rows.FLOW : rows.FLOW + 3] = work[velocity]  # it drifts with the water
    assert (loads(effects, work)[R] == 0.0).all()


@pytest.mark.parametrize("left", [0.0, 1e-9, 1e-3])
def test_the_wake_decays_when_the_current_stops(left: float) -> None:
    """From lock-in to no current at once: q stays bounded, and the vibration dies away.

    Carried as q and q' it grew in proportion to time, to thousands.
    """
    scene = replace(HAULED, current=((0.0, (0.6, 0.0)),)).scene()
    twin = Twin(replace(scene, effects=(*scene.effects, WakeOscillatorParams())))
    memory = wake_of(twin.rope.effects).memory
    q, across = [], []
    for stop in (False, True):
        if stop:
            twin.submit_current(np.array([[0.0, left, 0.0]]))
        for snapshot in march(twin, still, 12.0, 5):
            across.append(snapshot.node_position_m[:, 1])
            q.append(float(np.abs(memory[wake.Q]).max()))
    y = np.array(across)
    shaken = np.abs(y[6:] - 2.0 * y[3:-3] + y[:-6]).max(axis=1)  # at 3.4 Hz, not as it swings back
    assert shaken[100:230].max() > 0.3 * 0.03
    assert shaken[-80:].max() < 0.1 * shaken[100:230].max()
    assert max(q) < 12.0
    assert twin.snapshot().solver.unconverged_substeps == 0


def test_wakes_move_with_the_material_through_splits_and_merges() -> None:
    """Paid out and hauled in at 1 m/s the wakes of old nodes are kept, new ones lie between."""
    scene = replace(HAULED, winch=HAULING).scene()
    twin = Twin(replace(scene, effects=(*scene.effects, WakeOscillatorParams())))
    memory = wake_of(twin.rope.effects).memory
    counts, odd = [], []
    q, rate = np.zeros(60), np.zeros(60)
    for snapshot in march(twin, sine(0.2, 6.0), 24.0, speeds=[(2.0, 1.0), (12.0, -1.0)]):
        counts.append(len(snapshot.element_tension_n))
        old = min(counts[-2:]) - 2
        fastest = np.maximum(np.abs(rate[:old]), np.abs(memory[1, :old]))
        odd.append((np.abs(memory[0, :old] - q[:old]) - 0.0105 * fastest).max())
        q[: counts[-1]], rate[: counts[-1]] = memory[:2, : counts[-1]]
    assert max(counts) > 36
    assert counts[-1] < max(counts) - 6
    assert np.isfinite(memory).all()
    assert np.abs(q).max() > 1.0
    assert max(odd[5:]) < 0.02, "no wake moves by more than its rate times the step"
    assert twin.snapshot().solver.unconverged_substeps == 0


def test_wake_parameters_change_at_the_inclination_key() -> None:
    """(A, ε) of a node by its inclination to the normal of the flow, about 45° and about 30°."""
    shed = getattr(_shed, "py_func", _shed)
    for critical in (45.0, 30.0):
        params = WakeOscillatorParams(critical_angle_deg=critical)
        for tilt in (critical - 0.5, critical + 0.5):
            angle = math.radians(tilt)
            water, tangent = (1.0, 0.0, 0.0), (math.sin(angle), 0.0, math.cos(angle))
            _, _, A, epsilon = shed(wake.build(params, None, AROUND), water, tangent)
            assert (A, epsilon) == (SET.upright if tilt < critical else SET.inclined)
    assert wake.build(WakeOscillatorParams(), None, AROUND).critical == math.sqrt(0.5)
    assert "critical_angle_deg" not in repr(WakeOscillatorParams()), "digests of other scenes"
