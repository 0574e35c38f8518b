"""The block that a rigid body adds at the hook is the derivative of its pull."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_cases import SMALL, Vector, apply, params_of, some_stage, some_work
from scipy.spatial.transform import Rotation

from rope_twin.core import state as rows
from rope_twin.core.body import state as at
from rope_twin.core.body.components import HAT, WEIGHT
from rope_twin.core.body.solution import balance
from rope_twin.core.body.state import PlaneBed, RigidBody, vector
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.loads.balance import is_active_set_unchanged
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.payload_shedding import PayloadSheddingParams
from rope_twin.effects.rigid_body import DeckParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.scene.rope_model import build_effects
from rope_twin.scene.shapes import PayloadFigures

FIGURES = PayloadFigures(
    mass_kg=600.0, volume_m3=0.1, added_mass_kg=(150.0, 200.0, 260.0), drag_area_m2=(0.8, 1.1, 1.5),
    added_mass_rising_kg=400.0, drag_area_rising_m2=2.5,
)  # fmt: skip
XX, XY, XZ, YY, YZ, ZZ = range(6)


def moving(seed: int) -> tuple[Any, Vector]:
    """Return a body that turns, drifts and heels on taut slings, in contact and half afloat."""
    deck = DeckParams(height_m=-90.0, penetration_m=0.05, friction=0.4)
    params = replace(params_of("rigid_body"), deck=deck)
    bed = SeabedParams(depth_m=500.0, slope=(0.2, -0.1), friction=0.5)
    zone = SplashZoneParams(height_m=1.0, bottom_area_m2=3.0)
    sheds = PayloadSheddingParams(strouhal=0.2, lift_coefficient=2.0, diameter_m=0.5)
    effects = build_effects(replace(SMALL.scene(), effects=(bed, params, zone, sheds)), FIGURES)
    body = next(effect for effect in effects if isinstance(effect, RigidBody))
    work, random = some_work(seed), np.random.default_rng(seed)
    stage = body.stage
    stage[at.SURFACE_Z] = 0.0
    stage[at.DECK_Z] = -1e3
    apply(effects, work.copy(), some_stage(), 0, 1)  # it is put to rest
    for position, size in ((at.TURN_HAT, 0.1), (at.FLOW_NOW, 0.5), (at.FROZEN, 0.5)):
        stage[position : position + 3] = random.normal(0.0, size, 3)
    stage[at.FLOW_ACCELERATION : at.FLOW_ACCELERATION + 3] = random.normal(0.0, 1.0, 3)
    stage[at.P_HAT : at.P_HAT + 3] += random.normal(0.0, 600.0, 3)
    stage[at.L_HAT : at.L_HAT + 3] += random.normal(0.0, 300.0, 3)
    stage[at.DECK_Z] = stage[at.PLACE + 2] - 0.35
    stage[at.DECK_SPEED] = 0.2
    bed = next(part for part in body.parts if isinstance(part, PlaneBed))
    x, y, z = stage[at.PLACE : at.PLACE + 3]
    lifted = bed._replace(shape=bed.shape._replace(height=z - 0.4 - 0.2 * x + 0.1 * y))
    stage[at.SURFACE_Z : at.SURFACE_Y + 1] = z + 0.1, 0.05, -0.1
    for where, low in ((at.SUBMERGED_ARM, -0.2), (at.ARM_HELD, -0.25)):
        stage[where : where + 3] = 0.05, -0.03, low
    stage[at.SUBMERGED], stage[at.SUBMERGED_HELD] = 0.6, 0.55
    stage[HAT], stage[WEIGHT] = 0.7, 0.02
    parts = tuple(lifted if part is bed else part for part in body.parts)
    effects = tuple(
        effect._replace(parts=parts) if effect is body else effect for effect in effects
    )
    return effects, work


def hooked(effects: Any, work: Vector) -> Vector:
    """Return the pull on the hook less its inertia, and the block, (9,)."""
    work = work.copy()
    apply(effects, work, some_stage(), 0, 1)
    return np.concatenate([
        work[rows.RESIDUAL : rows.RESIDUAL + 3, 0], work[rows.BLOCK : rows.BLOCK + 6, 0]
    ])  # fmt: skip


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_the_hook_block_is_the_derivative_of_the_pull(seed: int) -> None:
    """Central differences over 0.1 m/s², without the skew part that a block cannot hold; 1e-6."""
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
    computed = np.array([[b[XX], b[XY], b[XZ]], [b[XY], b[YY], b[YZ]], [b[XZ], b[YZ], b[ZZ]]])
    scale = np.abs(exact).max()
    assert np.abs(computed - symmetric).max() < 1e-6 * scale
    assert np.abs(symmetric - np.eye(3) * SMALL.load).max() > 0.05 * scale, "it must feel the body"


@jit_entry
def _is_calm(body: Any, work: Any, stage: Any) -> bool:
    return bool(is_active_set_unchanged((body,), work, stage, 1, 1.0))


@pytest.mark.parametrize("size", [1.0, 30.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_the_body_is_calm_within_tolerance_of_the_predicted_pull(seed: int, size: float) -> None:
    """The limit lies where pull and prediction by the block differ by the tolerance; 1 %."""
    effects, work = moving(seed)
    body, stage = next(effect for effect in effects if isinstance(effect, RigidBody)), some_stage()
    change = np.random.default_rng(seed).normal(0.0, size, 3)
    moved = work.copy()
    for row, weight in (
        (rows.ACCELERATION, 1.0),
        (rows.VELOCITY, stage.q),
        (rows.POSITION, stage.p),
    ):
        moved[row : row + 3, 0] += weight * change
    before, after = hooked(effects, work), hooked(effects, moved)
    b = before[3:]
    A = np.array([[b[XX], b[XY], b[XZ]], [b[XY], b[YY], b[YZ]], [b[XZ], b[YZ], b[ZZ]]])
    miss = float(np.linalg.norm(after[:3] - before[:3] + A @ change))
    assert miss > 1e-6 * np.abs(A @ change).max(), "slings are not linear"
    reported = []
    for share in (1.01, 0.99):
        hooked(effects, work)
        work[rows.CORRECTION : rows.CORRECTION + 3, 0] = change
        body.tangent[at.ALLOWED] = share * miss
        reported.append(_is_calm(body, work, stage))
    assert reported == [True, False]


def test_a_body_with_nan_balance_is_not_converged() -> None:
    """Its pull is infinite, as a maximum would ignore NaN."""
    effects, work = moving(1)
    body = next(effect for effect in effects if isinstance(effect, RigidBody))
    body.stage[at.P_HAT] = np.nan
    assert np.all(np.isinf(hooked(effects, work)[:3]))
    body.tangent[at.ALLOWED] = np.inf
    assert not _is_calm(body, work, some_stage())


@jit_entry
def _balance(body: Any, q: float, place: Any, speed: Any) -> None:
    balance(body, q, (vector(place, 0), vector(speed, 0)))


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_the_body_jacobian_is_the_derivative_of_its_momentum_balance(seed: int) -> None:
    """Derivatives to velocity and turn rate, each entry to 1e-7 of its column."""
    effects, work = moving(seed)
    body: Any = next(effect for effect in effects if isinstance(effect, RigidBody))
    stage, q = body.stage, some_stage().q
    hook = [work[row : row + 3, 0].copy() for row in (rows.POSITION, rows.VELOCITY)]
    hooked(effects, work)
    sought = np.concatenate([three(stage, at.SPEED), three(stage, at.TURN_RATE)])
    sought += np.random.default_rng(seed).normal(0.0, 0.05, 6)

    def missing(change: Vector) -> Vector:
        """Return the residual of the balance, in the frame."""
        stage[at.SPEED : at.SPEED + 3] = (sought + change)[:3]
        stage[at.TURN_RATE : at.TURN_RATE + 3] = (sought + change)[3:]
        _balance(body, q, *hook)
        force = three(stage, at.P_HAT) + q * three(stage, at.PULL) - three(stage, at.P_NOW)
        moment = three(stage, at.L_HAT) + q * three(stage, at.TWIST) - three(stage, at.L_NOW)
        return np.concatenate([force, moment])

    missing(np.zeros(6))
    A, turn = body.matrix[:, :6].copy(), Rotation.from_quat(stage[at.ATTITUDE : at.ATTITUDE + 4])
    both = np.kron(np.eye(2), turn.as_matrix())  # into body axes, and back
    into = np.vstack([np.hstack([turn.as_matrix(), np.zeros((3, 3))]), np.eye(6)[3:]])
    for k, axis in enumerate(into.T):
        step = 1e-5
        change = (missing(step * axis) - missing(-step * axis)) / (2.0 * step)
        exact = -both.T @ change
        for part in (slice(0, 3), slice(3, 6)):
            assert np.abs(A[part, k] - exact[part]).max() < 1e-7 * np.abs(exact).max(), (k, part)


def three(table: Vector, i: int) -> Vector:
    """Three numbers."""
    return table[i : i + 3].copy()
