"""Strouhal forcing against Runge-Kutta: second order, block and power."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from effect_cases import NODES, RESULTS, apply, data_of, loads, some_work
from rigs import Bench, Vector
from shedding_rigs import DENSITY, DIAMETER, Cylinder, runge_kutta
from test_effects import BLOCKS, R, jacobian, matrix
from test_energy_accounts import seen, three

from rope_twin.core import state as rows
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.loads.accounts import account_sum
from rope_twin.effects import strouhal_forcing as strouhal
from rope_twin.effects.strouhal_forcing import StrouhalForcing, StrouhalForcingParams

LIFT, IN_LINE, LIMIT = 0.6, 0.1, 1.0


def forcing_of(effects: tuple[Any, ...]) -> StrouhalForcing:
    """The one among them."""
    return next(effect for effect in effects if isinstance(effect, StrouhalForcing))


@jit_entry
def frequency_at(shed: Any, speed: float, per_diameter: float) -> Any:
    return strouhal.frequency(shed, speed, per_diameter)


def test_strouhal_number_by_reynolds_range() -> None:
    """No shedding up to Re 40; St 0.2 to 1e6; above it linear."""
    params = StrouhalForcingParams(drag=1.0, strouhal_rise=0.9, viscosity_m2_per_s=1e-6)
    around = type("Water", (), {"water_density_kg_per_m3": 1000.0, "drag_normal": 0.0, "room": 4})
    shed = strouhal.build(params, None, around)
    per_diameter = 1.0 / 0.1
    assert frequency_at(shed, 40.0 * 1e-6 / 0.1, per_diameter) == 0.0
    for re, number in ((41.0, 0.2), (1e5, 0.2), (1e6, 0.2), (2e6, 0.3), (1e7, 1.1)):
        speed = re * 1e-6 / 0.1
        computed = frequency_at(shed, speed, per_diameter) / (speed * per_diameter)
        assert computed == pytest.approx(number, rel=1e-12)


def integrated(cylinder: Cylinder, seconds: float, step: float, limit: float | None) -> Vector:
    """Places in line and across by Runge and Kutta from the paper's equations, written out."""
    V, M = cylinder.speed, cylinder.moving
    k = M * (2.0 * math.pi * cylinder.frequency) ** 2
    half = 0.5 * DENSITY * DIAMETER * cylinder.drag

    def slope(state: Vector) -> Vector:
        x, y, vx, vy, phase, square = state
        ux, uy = V - vx, -vy
        speed = math.hypot(ux, uy)
        f = 0.2 * speed / DIAMETER
        across = (vx * uy - vy * ux) / speed  # along v × t, t upward
        amplitude = math.sqrt(2.0 * square) / (2.0 * math.pi * f)
        share = LIFT if limit is None else LIFT * max(1.0 - amplitude / (limit * DIAMETER), 0.0)
        lift = half * speed * share * math.sin(phase)
        drag = half * speed * (1.0 + IN_LINE * math.sin(2.0 * phase))
        ax = (drag * ux + lift * uy - k * x) / M
        ay = (drag * uy - lift * ux - k * y) / M
        return np.array([vx, vy, ax, ay, 2.0 * math.pi * f, f * (across**2 - square)])

    start = np.array([half * V * V / k, 0.0, 0.0, 0.0, 0.0, 0.0])
    return runge_kutta(slope, start, step, round(seconds / step))[:, :2]


def stepped(cylinder: Cylinder, seconds: float, limit: float | None) -> Vector:
    params = StrouhalForcingParams(
        lift_over_drag=LIFT, in_line=IN_LINE, fixed_lift=limit is None, limit_diameters=limit or 1.0
    )
    return cylinder.run(Bench(cylinder.scene(params)), seconds)


@pytest.mark.parametrize("limit", [None, LIMIT])
def test_strouhal_forcing_converges_to_runge_kutta_in_second_order(limit: float | None) -> None:
    """Eight periods near resonance: some 1 % of a diameter at 10 ms, a fourth at half the step."""
    speed = 0.5
    exact = integrated(Cylinder(speed=speed), 8.0, 1e-3, limit)
    errors = []
    for step in (0.02, 0.01, 0.005):
        computed = stepped(Cylinder(speed=speed, step=step), 8.0, limit)
        every = round(step / 1e-3)
        errors.append(float(np.abs(computed - exact[every - 1 :: every]).max()) / DIAMETER)
    assert np.abs(exact[:, 1]).max() > 0.3 * DIAMETER
    assert errors[1] < 0.01
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.4)
    assert errors[1] / errors[2] == pytest.approx(4.0, abs=0.4)


def test_the_limiter_bounds_the_amplitude() -> None:
    """Fixed λ answers with more than the limited one, which stays below its end."""
    free, held = (np.abs(integrated(Cylinder(speed=0.5), 20.0, 2e-3, a)[5000:, 1]).max()
                  for a in (None, LIMIT))  # fmt: skip
    assert free > 1.2 * held
    assert held < LIMIT * DIAMETER


def shedding(seed: int) -> tuple[tuple[Any, ...], Vector]:
    """The effect on scratch in any motion, its vortices anywhere in their period."""
    effects, work = data_of("strouhal_forcing"), some_work(seed)
    random, memory = np.random.default_rng(seed), forcing_of(effects).memory
    arc = np.append(0.0, np.cumsum(work[rows.REST, :-1]))
    length = np.zeros(NODES)
    length[:-1] += 0.5 * np.diff(arc)
    length[1:] += 0.5 * np.diff(arc)
    d = np.sqrt(4.0 / math.pi * work[rows.VOLUME] / length)
    memory[0, :NODES] = memory[strouhal.PHASE_HAT, :NODES] = random.uniform(0.0, 6.0, NODES)
    memory[0, NODES - 1] = memory[0, NODES - 2]
    memory[strouhal.PHASE_HAT, NODES - 1] = memory[0, NODES - 2]
    memory[strouhal.PER_DIAMETER, :NODES] = 1.0 / d
    memory[strouhal.STRENGTH, :NODES] = forcing_of(effects).strength * d * length
    return effects, work


@pytest.mark.parametrize("seed", [1, 2])
def test_strouhal_block_is_the_derivative_of_the_force(seed: int) -> None:
    """The symmetric part of -dF/da, through φ as well; λ is fixed, for what m adds is dropped."""
    effects, work = shedding(seed)
    effects = (effects[0]._replace(per_limit=0.0),)
    result = loads(effects, work)
    for node in range(NODES - 1):
        exact = jacobian(effects, work, node)
        symmetric = 0.5 * (exact + exact.T)
        computed = matrix(result[BLOCKS, node])
        assert np.abs(computed - symmetric).max() < 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("seed", [1, 2])
def test_strouhal_power_is_force_times_velocity(seed: int) -> None:
    """With the vortices as they are: the rate of a stage's phase is not in it."""
    effects, work = shedding(seed)
    force = (loads_at_rest(effects, work) - loads_at_rest((), work))[R]
    assert np.abs(force).max() > 1.0
    position = seen(work, np.zeros((3, NODES)), 0.0)
    done = float((force * three(work, rows.VELOCITY)).sum())
    assert done == pytest.approx(account_sum("power", effects, position), rel=1e-6)


def loads_at_rest(effects: tuple[Any, ...], work: Vector) -> Vector:
    """Loads of a stage without weight: nothing of the effects moves on in it."""
    work = work.copy()
    apply(effects, work, rows.Stage(3.0, 0.0, 0.0, 0.0), 0, NODES)
    return np.concatenate([work[part] for part in RESULTS])
