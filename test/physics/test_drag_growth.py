"""Drag amplification per node: closed form, derivative, work, and transport through the winch."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_cases import NODES, data_of, loads, some_work
from rigs import Bench, Rig, Vector
from test_effects import BLOCKS, R, jacobian, matrix
from test_energy_accounts import seen, three

from rope_twin.core import state as rows
from rope_twin.core.loads.accounts import account_sum
from rope_twin.effects.coupled_vibration import ModalVibrationParams
from rope_twin.scene.schema import Scene, Winch
from rope_twin.vortex.drag_amplification import GROWTH, DragGrowth, set_growth
from rope_twin.vortex.drag_amplification import NODES as NOTED

NAMES = ("modal_vibration", "decomposed_force")
SPEED, LENGTH, WEIGHT = 1.0, 40.0, 4000.0
WEIGHTLESS = Rig(
    length=LENGTH, elements=80, mass=1025.0 * 0.25 * np.pi * 0.03**2, EA=2e7, diameter=0.03,
    density=1025.0, load=WEIGHT / 9.80665, current=((0.0, (SPEED, 0.0)),), drag=(1.2, 0.0),
    added_mass=1.0, step=0.01, tolerance=0.01,
    winch=Winch(speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=2.0, min_line_out_m=5.0,
                max_line_out_m=60.0),
)  # fmt: skip


def shaken(rig: Rig) -> Scene:
    scene = rig.scene()
    return replace(scene, effects=(*scene.effects, ModalVibrationParams()))


def growth_of(effects: tuple[Any, ...]) -> DragGrowth:
    """Return the drag amplification effect among these."""
    return next(effect for effect in effects if isinstance(effect, DragGrowth))


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
def test_static_lean_with_drag_amplification(low: float, high: float) -> None:
    """Amplification g varies linearly from the lower end to the upper one.

    Weightless, T = W all along: f·(1 + g)·cos² a per metre across it turns the rope, so its lean a
    from the vertical is W·tan a = ∫f·(1 + g) ds.

    Laid so, it stays; with another growth it would begin to swing, in four seconds a third of its
    period.
    """
    bench = Bench(shaken(WEIGHTLESS))
    state, f = bench.rope.state, 0.5 * 1025.0 * 0.03 * 1.2 * SPEED**2
    s = state.s[: bench.n + 1]
    middle = 0.5 * (s[1:] + s[:-1])
    below = f * middle * (1.0 + low + 0.5 * (high - low) * middle / LENGTH)
    position = np.zeros((2, bench.n + 1))
    position[:, 1:] = np.cumsum(np.stack([-below, 0.0 * below + WEIGHT]) / np.hypot(below, WEIGHT)
                             * (1.0 + WEIGHT / WEIGHTLESS.EA) * np.diff(s), axis=1)  # fmt: skip
    bench.position[0::2] = position - position[:, -1:]
    bench.time = 1.0  # at 0 it begins with none
    set_growth(growth_of(bench.rope.effects), state, low + (high - low) * s[:-1] / LENGTH)
    lean = position[0, 0] - position[0, -1]
    bench.hold(400)
    assert bench.position[0, 0] - bench.position[0, -1] == pytest.approx(lean, rel=1e-3)
    assert lean > 3.0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", [1, 2])
def test_amplified_drag_block_and_power(name: str, seed: int) -> None:
    """A = -dR/da is symmetric; the reported power is force times velocity."""
    random = np.random.default_rng(seed)
    effects, work = data_of(name), some_work(seed)
    (growth,) = effects
    growth.memory[GROWTH] = random.uniform(0.2, 1.5, growth.memory.shape[1])
    work[rows.FLOW : rows.FLOW + 3] = random.normal(0.0, 0.6, (3, NODES))
    result = loads(effects, work)
    for node in range(NODES):
        exact = jacobian(effects, work, node)
        assert matrix(result[BLOCKS, node]) == pytest.approx(exact, abs=1e-6 * np.abs(exact).max())
    growth.memory[GROWTH, NODES - 1] = growth.memory[GROWTH, NODES - 2]
    force = (loads(effects, work) - loads((), work))[R]
    position = seen(work, np.zeros((3, NODES)), 0.0)
    done = (force * three(work, rows.VELOCITY)).sum()
    assert account_sum("power", effects, position) == pytest.approx(done, rel=1e-9)
    assert done != 0.0


def test_drag_amplification_moves_with_the_material() -> None:
    """Paid out by 10 m, hauled in by 20: each metre keeps its value, new ones have the top's."""
    bench = Bench(shaken(WEIGHTLESS))
    state, growth = bench.rope.state, growth_of(bench.rope.effects)
    bench.hold(1)  # at 0 it begins with none
    set_growth(growth, state, 0.3 + 0.02 * state.s[: bench.n])
    top = float(growth.memory[GROWTH, bench.n - 1])
    counts = []
    for speed, seconds in ((1.0, 10.0), (-1.0, 20.0)):
        count = round(seconds / WEIGHTLESS.step)
        boundary = bench.still(count)
        boundary.value[:, rows.LINE] += speed * WEIGHTLESS.step * np.arange(count + 1)
        boundary.rate[:, rows.LINE] = speed
        bench.follow(boundary)
        boundary = bench.still(1)
        bench.follow(boundary)
        expected: Vector = np.minimum(0.3 + 0.02 * state.s[: bench.n], top)
        assert growth.memory[GROWTH, : bench.n] == pytest.approx(expected, abs=1e-9)
        assert growth.memory[NOTED, : bench.n] == pytest.approx(state.s[: bench.n])
        counts.append(bench.n)
    assert counts[0] > 80 > counts[1]
