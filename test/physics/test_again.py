"""Reuse of the first stage's factors for the second stage: only where every node is balanced."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from payout_rigs import SEA
from rigs import Bench

from rope_twin.core import state as rows
from rope_twin.core.integrator import BDF2, GAMMA, SEARCH, TRAPEZOID
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.loads.memory import begin_step
from rope_twin.core.newton import RESIDUAL_SHARE, _eliminate, _evaluate, _push, count_left
from rope_twin.core.state import Boundary, Floats
from rope_twin.core.step import stage_at
from rope_twin.effects.wake_oscillator import WakeOscillatorParams

RIG = replace(
    SEA,
    elements=150,
    tolerance=10.0,
    current=((0.0, (0.9, 0.2)), (-400.0, (0.2, 0.6)), (-900.0, (-0.1, 0.1))),
)


@jit_entry
def second_stage_by_first_factors(rope: Any, boundary: Any, spoil: float, complete: float) -> int:
    """A step up to the second stage's correction by the first one's factors; then its balance.

    Factors are multiplied by `spoil`; the share `complete` of the correction is added to motion.
    """
    work, n, first = rope.work, rope.state.counts[rows.ELEMENTS], rope.model.first_free
    c = 0.5 * GAMMA * rope.model.step
    stage = stage_at(rope, boundary, 0, GAMMA, 0.0, c)
    begin_step(rope.effects, rope, 0.0, n)
    _evaluate(rope, stage, TRAPEZOID, 0.0, 0.0)
    _eliminate(rope.effects, work, first, n)
    stage = stage_at(rope, boundary, 0, 1.0, 0.0, c)
    _evaluate(rope, stage, BDF2, 1.0, 0.0)
    for k in range(rows.ELIMINATED, rows.REST):
        for i in range(n):
            work[k, i] *= spoil
    _push(rope.effects, work, first, n)
    left = count_left(rope, stage, 64)
    _evaluate(rope, stage, SEARCH, complete, 0.0)
    return int(left)


@pytest.fixture(params=["bare", "bent and shaken"])
def moving(request: Any) -> tuple[Any, Boundary]:
    """A rope in a current, pulled up at 0.5 m/s² from rest; also bent, and with wakes behind it."""
    scene = RIG.scene()
    if request.param != "bare":
        scene = replace(RIG, EI=1e5).scene()
        scene = replace(scene, effects=(*scene.effects, WakeOscillatorParams()))
    bench = Bench(scene)
    value = np.array([[*bench.hang_off, bench.length]] * 2)
    rate = np.zeros_like(value)
    h = bench.rope.model.step
    value[1, 2] += 0.25 * h * h
    rate[1, 2] = 0.5 * h
    return bench.rope, Boundary(value, rate)


def residual(rope: Any) -> Floats:
    """Residual of every free node [N]."""
    n = int(rope.state.counts[rows.ELEMENTS])
    return np.asarray(np.abs(rope.work[rows.RESIDUAL : rows.RESIDUAL + 3, :n]).sum(axis=0))


def test_factors_of_the_first_stage_solve_the_second(moving: tuple[Any, Boundary]) -> None:
    """Every node is balanced under all loads after the correction, and was not before."""
    rope, boundary = moving
    assert second_stage_by_first_factors(rope, boundary, 1.0, 0.0) == 0
    assert residual(rope).max() > rope.model.tolerance
    assert second_stage_by_first_factors(rope, boundary, 1.0, 1.0) == 0
    assert residual(rope).max() < 2.0 * RESIDUAL_SHARE * rope.model.tolerance


def test_wrong_factors_are_rejected_and_the_prediction_stays(moving: tuple[Any, Boundary]) -> None:
    """Factors of 0, NaN and 0.99 times the right ones leave the prediction bit-identical."""
    rope, boundary = moving
    start = rope.work.copy()  # which wakes start from
    second_stage_by_first_factors(rope, boundary, 1.0, 0.0)
    predicted = rope.work[: rows.NODE_ROWS].copy()
    for spoil in (0.0, np.nan, 0.99):
        rope.work[:] = start
        assert second_stage_by_first_factors(rope, boundary, spoil, 0.0) != 0
    assert np.array_equal(rope.work[: rows.NODE_ROWS], predicted)
