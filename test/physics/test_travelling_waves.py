"""Travelling-wave VIV model: against an integrator and closed forms; block and power."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_cases import NODES, data_of, loads, some_work
from rigs import Bench, Vector, march, sine, with_nothing_below
from scipy.integrate import solve_ivp
from shedding_rigs import DENSITY, DIAMETER, HAULED, HAULING, Cylinder
from test_effects import BLOCKS, R, jacobian, matrix
from test_energy_accounts import seen, three

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.loads.accounts import account_sum
from rope_twin.effects import travelling_waves as tw
from rope_twin.effects.travelling_waves import TravellingWaves, TravellingWavesParams
from validation.published_ropes import LCD_CABLE
from validation.wave_lines import CABLE_EA, rig

PARAMS = TravellingWavesParams(periods=1.0, ramp_s=1.0, by_half_waves=False)
# The Strouhal frequency is the natural one.
RESONANT = Cylinder(speed=DIAMETER / PARAMS.strouhal, drag=0.0, step=0.01)


def waves_of(effects: tuple[Any, ...]) -> TravellingWaves:
    """The one among them."""
    return next(effect for effect in effects if isinstance(effect, TravellingWaves))


def shedding(cylinder: Cylinder) -> float:
    """ω [rad/s]."""
    return 2.0 * math.pi * PARAMS.strouhal * cylinder.speed / DIAMETER


def stepped(cylinder: Cylinder, seconds: float) -> Vector:
    """Places along e = U × t, which is -y, by the rope's own step; both nodes start alike."""
    bench = Bench(cylinder.scene(PARAMS))
    memory = waves_of(bench.rope.effects).memory
    bench.time = 1.0  # at 0 it would start from phases of its own; the lift is full now
    memory[: tw.CARRIED] = 0.0
    memory[tw.OMEGA] = shedding(cylinder)
    return -cylinder.run(bench, seconds)[:, 1]


def integrated(cylinder: Cylinder, seconds: float) -> float:
    """Integrate the equations, written out, by a method of high order."""
    omega, M = shedding(cylinder), cylinder.moving
    lift = 0.5 * DENSITY * DIAMETER * cylinder.speed**2
    k, c = M * (2.0 * math.pi * cylinder.frequency) ** 2, 2.0 * PARAMS.damping_fraction * M * omega

    def rate(t: float, state: Vector) -> list[float]:
        y, v, s = state
        A = math.sqrt(2.0 * max(s, 0.0)) / (omega * DIAMETER)
        force = lift * math.cos(omega * t) * (0.7 - 0.7 * A) - c * v - k * y
        return [v, force / M, (v * v - s) * omega / (2.0 * math.pi * PARAMS.periods)]

    computed = solve_ivp(rate, (0.0, seconds), [0.0, 0.0, 0.0], rtol=1e-9, atol=1e-12)
    return float(computed.y[0, -1])


def test_travelling_waves_are_of_second_order_in_the_step() -> None:
    """Phase and amplitude are solved in the stage: the error falls fourfold with the step."""
    exact = integrated(RESONANT, 4.0)
    steps = (0.02, 0.01, 0.005)
    errors = [abs(stepped(replace(RESONANT, step=h), 4.0)[-1] - exact) for h in steps]
    assert errors[-1] < 2e-3 * DIAMETER
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.4)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.3)


def test_amplitude_at_resonance_by_power_balance() -> None:
    """½·ρ·d·U²·(C0 - C1·a) = c·ω·a·d: there the lift feeds what the structure damps."""
    omega = shedding(RESONANT)
    lift = 0.5 * DENSITY * DIAMETER * RESONANT.speed**2
    damping = 2.0 * PARAMS.damping_fraction * RESONANT.moving * omega * omega * DIAMETER
    expected = 0.7 * lift / (0.7 * lift + damping)
    late = stepped(RESONANT, 40.0)[-400:]
    assert np.ptp(late) / 2.0 / DIAMETER == pytest.approx(expected, rel=0.02)


def in_motion(seed: int) -> tuple[tuple[Any, ...], Vector]:
    """The effect on scratch in any motion, as a stage has it."""
    effects, work = data_of("travelling_waves"), some_work(seed)
    random, waves = np.random.default_rng(seed), waves_of(effects)
    work[rows.FLOW : rows.FLOW + 3] = random.normal(0.0, 0.6, (3, NODES))
    memory = waves.memory
    arc = np.append(0.0, np.cumsum(work[rows.REST, :-1]))
    length = np.zeros(NODES)
    length[:-1] += 0.5 * np.diff(arc)
    length[1:] += 0.5 * np.diff(arc)
    per_diameter = np.sqrt(0.25 * math.pi * length / work[rows.VOLUME])
    memory[tw.OMEGA, :NODES] = random.uniform(5.0, 9.0, NODES)
    memory[tw.OMEGA, NODES - 1] = memory[tw.OMEGA, NODES - 2]
    memory[tw.OMEGA_NOW] = memory[tw.OMEGA]
    memory[tw.COSINE] = random.uniform(-1.0, 1.0, memory.shape[1])
    memory[tw.COSINE, NODES - 1] = memory[tw.COSINE, NODES - 2]
    memory[tw.SQUARE_HAT], memory[tw.SHARE] = 0.5, 0.2
    memory[tw.PER_DIAMETER, :NODES] = per_diameter
    memory[tw.STRENGTH, :NODES] = waves.half_density * length / per_diameter
    moved = work[rows.MASS] + waves.added * work[rows.VOLUME]
    memory[tw.DAMPING, :NODES] = waves.damping * memory[tw.OMEGA, :NODES] * moved
    return effects, work


@pytest.mark.parametrize("seed", [1, 2])
def test_travelling_wave_block_is_the_derivative_of_the_force(seed: int) -> None:
    """-dF/da through velocity and amplitude; the tangent is given here. 1e-6."""
    effects, work = in_motion(seed)
    result = loads(effects, work)
    for node in range(NODES - 1):
        exact = jacobian(effects, work, node)
        assert np.abs(matrix(result[BLOCKS, node]) - exact).max() < 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("seed", [1, 2])
def test_travelling_wave_power_is_force_times_velocity(seed: int) -> None:
    """With the mean square that the end of a step has."""
    effects, work = in_motion(seed)
    memory = waves_of(effects).memory
    memory[tw.SQUARE], memory[tw.SHARE] = memory[tw.SQUARE_HAT], 0.0
    force = (loads(effects, work) - loads((), work))[R]
    assert np.abs(force).max() > 1.0
    position = seen(work, np.zeros((3, NODES)), 0.0)
    done = float((force * three(work, rows.VELOCITY)).sum())
    assert done == pytest.approx(account_sum("power", effects, position), rel=1e-7)


def hauled(**given: Any) -> Twin:
    """A short rope with waves that a winch pays out and hauls in."""
    scene = replace(HAULED, winch=HAULING).scene()
    return Twin(replace(scene, effects=(*scene.effects, TravellingWavesParams(**given))))


@pytest.mark.parametrize("by_half_waves", [True, False])
def test_wave_phase_is_continuous_through_splits_and_merges(by_half_waves: bool) -> None:
    """Paid out and hauled in at 1 m/s under heave: it moves, converges, and no phase jumps."""
    twin = hauled(by_half_waves=by_half_waves)
    memory = waves_of(twin.rope.effects).memory
    across, turned, phase = [], [], np.zeros(60)
    for snapshot in march(twin, sine(0.2, 6.0), 24.0, speeds=[(2.0, 1.0), (12.0, -1.0)]):
        across.append(np.abs(snapshot.node_position_m[:, 1]).max())
        turned.append(float(np.abs(memory[tw.PHASE, :8] - phase[:8]).max()))
        phase[:8] = memory[tw.PHASE, :8]
    fastest = 2.0 * math.pi * 0.17 * 0.6 / 0.03 * HAULED.step
    assert max(turned[5:]) < 1.5 * fastest
    assert 0.005 < max(across) < 0.3
    assert np.isfinite(memory).all()
    assert twin.snapshot().solver.unconverged_substeps == 0


def test_nodes_of_a_half_wave_share_one_frequency() -> None:
    """From the hang-off down: one ω until the phase has turned by π, then the next."""
    scene = replace(HAULED, current=((0.0, (1.0, 0.0)), (-30.0, (0.2, 0.0)))).scene()
    twin = Twin(replace(scene, effects=(*scene.effects, TravellingWavesParams())))
    twin.advance(2)
    memory = waves_of(twin.rope.effects).memory
    held = memory[tw.HELD, :30]
    values = np.unique(held)
    assert 1 < len(values) < 15
    assert (np.diff(held) >= 0.0).all()
    per_metre = 2.0 + DENSITY * 0.25 * math.pi * 0.03**2
    tension = HAULED.load_weight  # of most of the short rope
    for omega in values[1:-1]:
        half = math.pi / (omega * math.sqrt(per_metre / tension))
        assert (held == omega).sum() == pytest.approx(half, abs=1.6)


def test_a_rope_at_rest_in_still_water_stays_at_rest() -> None:
    scene = replace(HAULED, current=((0.0, (0.0, 0.0)),)).scene()
    twin = Twin(replace(scene, effects=(*scene.effects, TravellingWavesParams())))
    twin.advance(200)
    assert np.abs(twin.snapshot().node_position_m[:, 1]).max() == 0.0


def at_start(speeds: tuple[float, float], **given: Any) -> tuple[Vector, Vector, Vector]:
    """Phase, ω and own Strouhal ω of the nodes of a cable at rest; speeds: at bottom and top."""
    own = rig(LCD_CABLE, CABLE_EA, 300, 0.01)
    profile = ((0.0, (speeds[1], 0.0)), (-300.0, (speeds[0], 0.0)))
    scene = with_nothing_below(replace(own, current=profile).scene())
    params = TravellingWavesParams(**given)
    bench = Bench(replace(scene, effects=(*scene.effects, params)))
    bench.hold(1)
    memory, n = waves_of(bench.rope.effects).memory, 300
    flow = np.linspace(*speeds, n + 1)[:n]
    omega = memory[tw.HELD, 1:n]
    phase = memory[tw.PHASE, 1:n] - 0.01 * omega  # of the start
    return phase, omega, 2.0 * math.pi * params.strouhal * flow[1:] / LCD_CABLE.diameter


def test_initial_phase_of_standing_and_travelling_waves() -> None:
    """Five half waves of 1.7 Hz: 0, -π, -2π ... or falling all the way by the same."""
    phase, omega, _ = at_start((0.2, 0.2))
    assert omega == pytest.approx(2.0 * math.pi * 1.7, rel=1e-3)
    assert np.unique(np.round(phase / math.pi, 6)) == pytest.approx([-4.0, -3.0, -2.0, -1.0, 0.0])
    falling, _, _ = at_start((0.2, 0.2), initial_phase="travelling")
    assert (np.diff(falling) > 0.0).all()
    assert np.abs(np.floor(-falling / math.pi) * -math.pi - phase).max() < 1e-6


@pytest.mark.parametrize(("bottom", "top"), [(0.2, 1.5), (1.5, 0.0), (1.5, 1e-3)])
def test_a_half_wave_has_the_frequency_of_its_fastest_node(bottom: float, top: float) -> None:
    """Its upper end's where the current falls with depth; and none stands still below a still top.

    A half wave is long where the flow is slow: each of its nodes has at least its own pace.
    """
    _, held, own = at_start((bottom, top))
    assert (held >= own * (1.0 - 1e-3)).all()
    changes = np.flatnonzero(np.abs(np.diff(held)) > 1e-9)
    assert 10 < len(changes) < 60
    parts = np.split(np.arange(len(held)), changes + 1)
    for part in parts[1:-1]:
        assert held[part[0]] == pytest.approx(own[part].max(), rel=2e-3)
