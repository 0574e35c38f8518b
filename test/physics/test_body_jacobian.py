"""What a rigid body leaves on the hook is the derivative of its pull, whatever it does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_cases import SMALL, Vector, apply, params_of, some_stage, some_work

from rope_twin.core import state as rows
from rope_twin.core.body import state as at
from rope_twin.effects.rigid_body import DeckParams
from rope_twin.scene.build import build_effects
from rope_twin.scene.shapes import PayloadFigures

FIGURES = PayloadFigures(
    mass_kg=600.0, volume_m3=0.1, added_mass_kg=(150.0, 200.0, 260.0), drag_area_m2=(0.8, 1.1, 1.5),
    added_mass_rising_kg=400.0, drag_area_rising_m2=2.5,
)  # fmt: skip
XX, XY, XZ, YY, YZ, ZZ = range(6)


def moving(seed: int) -> tuple[Any, Vector]:
    """A body under way: it turns, drifts and heels on taut slings, with corners on a deck."""
    deck = DeckParams(height_m=-90.0, penetration_m=0.05, friction=0.4)
    params = replace(params_of("rigid_body"), deck=deck)
    effects = build_effects(replace(SMALL.scene(), effects=(params,)), FIGURES)
    work, random = some_work(seed), np.random.default_rng(seed)
    stage = effects[0].stage
    stage[at.DECK_Z] = -1e3
    apply(effects, work.copy(), some_stage(), 0, 1)  # it is put to rest
    for place, size in ((at.TURN_HAT, 0.1), (at.FLOW_NOW, 0.5), (at.FROZEN, 0.5)):
        stage[place : place + 3] = random.normal(0.0, size, 3)
    stage[at.FLOW_GROWS : at.FLOW_GROWS + 3] = random.normal(0.0, 1.0, 3)
    stage[at.P_HAT : at.P_HAT + 3] += random.normal(0.0, 600.0, 3)
    stage[at.L_HAT : at.L_HAT + 3] += random.normal(0.0, 300.0, 3)
    stage[at.DECK_Z] = stage[at.PLACE + 2] - 0.35
    stage[at.DECK_SPEED] = 0.2
    return effects, work


def hooked(effects: Any, work: Vector) -> Vector:
    """The pull on the hook less its inertia, and the block, (9,)."""
    work = work.copy()
    apply(effects, work, some_stage(), 0, 1)
    return np.concatenate([
        work[rows.RESIDUAL : rows.RESIDUAL + 3, 0], work[rows.BLOCK : rows.BLOCK + 6, 0]
    ])  # fmt: skip


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_the_block_is_the_derivative_of_the_pull(seed: int) -> None:
    """Central differences over 0.1 m/s², up to the skew part that a block cannot hold; 1e-6."""
    effects, work = moving(seed)
    b = hooked(effects, work)[3:]
    stage, step, columns = some_stage(), 0.1, []
    for k in range(3):
        ends = []
        for sign in (1.0, -1.0):
            moved = work.copy()
            moved[rows.ACCELERATION + k, 0] += sign * step
            moved[rows.VELOCITY + k, 0] += sign * step * stage.q
            moved[rows.POSITION + k, 0] += sign * step * stage.p
            ends.append(hooked(effects, moved)[:3])
        columns.append((ends[1] - ends[0]) / (2.0 * step))
    exact = np.array(columns).T
    symmetric = 0.5 * (exact + exact.T)
    found = np.array([[b[XX], b[XY], b[XZ]], [b[XY], b[YY], b[YZ]], [b[XZ], b[YZ], b[ZZ]]])
    scale = np.abs(exact).max()
    assert np.abs(found - symmetric).max() < 1e-6 * scale
    assert np.abs(symmetric - np.eye(3) * SMALL.load).max() > 0.05 * scale, "it must feel the body"
