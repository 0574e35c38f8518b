"""Prescribed motion of the lower end of a single rope.

The solver holds node 0 (`first_free` 1); before each stage these kernels set its position, velocity
and acceleration, at the stage's time. Two kinds:

- `HarmonicEnd`: x = x_0 + r(t)·Σ A·sin(ω·t + φ) along each axis, with the build-up r of
  `twin.motion.heave_track.ramp`;
- `PrescribedEnd`: position and velocity at the coming step boundaries are written from outside,
  from samples of another simulator. The end is at rest until the first sample.

Between step boundaries both are cubic Hermite polynomials, as the motion of the hang-off is
(core/payout.prescribed). Both are inactive on the suspended part of a cut rope, which has a free
end.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, cos, sin
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.integrator import step_start
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.loads.hooks import kernel
from rope_twin.core.payout import hermite, prescribed
from rope_twin.core.state import ACCELERATION, POSITION, VELOCITY, Boundary, Floats

OMEGA, PHASE, WAVE_ROWS = 3, 4, 5  # behind the amplitudes along x, y, z
SAME_TIME = 1e-6  # of a step: a stage at a boundary belongs to the step that ends there


class HarmonicEnd(NamedTuple):
    """Kernel data of harmonics."""

    mean: Floats  # x, y, z [m]
    waves: Floats  # amplitudes x, y, z [m], ω [rad/s], φ [rad], (harmonics, WAVE_ROWS)
    ramp: float  # build-up time [s]


class PrescribedEnd(NamedTuple):
    """Kernel data of a motion between step boundaries."""

    value: Floats  # position at the boundaries [m], (boundaries, 3)
    rate: Floats  # velocity [m/s], (boundaries, 3)
    clock: Floats  # time of the first boundary, and between boundaries [s], (2,)


def prescribed_end(position: Sequence[float], boundaries: int) -> PrescribedEnd:
    """Return the data of an end at rest, with capacity for this number of step boundaries."""
    value = np.tile(np.array(position, dtype=float), (boundaries, 1))
    return PrescribedEnd(value, np.zeros_like(value), np.array([0.0, 1.0]))


def prescribed_of(effects: Sequence[Any]) -> PrescribedEnd | None:
    """Return the PrescribedEnd among a rope's effects, or None."""
    return next((effect for effect in effects if isinstance(effect, PrescribedEnd)), None)


def has_moved_end(effects: Sequence[Any]) -> bool:
    """Return whether a rope's lower end is moved."""
    return any(isinstance(effect, HarmonicEnd | PrescribedEnd) for effect in effects)


def without_motion(effects: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the effects of a rope whose lower end stays where it is."""
    return tuple(
        effect for effect in effects if not isinstance(effect, HarmonicEnd | PrescribedEnd)
    )


@jit_within
def _span(time: float, begin: float, h: float) -> Any:
    """Return the number of the step of h [s] since `begin` that contains a time, and its fraction.

    The fraction is computed from the step's own start: its rounding does not depend on `begin`.
    """
    row = max(ceil((time - begin) / h - SAME_TIME) - 1, 0)
    return row, min(max((time - step_start(begin, row, h)) / h, 0.0), 1.0)


@jit_within
def _set(work: Any, k: int, motion: Any) -> None:
    work[POSITION + k, 0], work[VELOCITY + k, 0], work[ACCELERATION + k, 0] = motion


@jit_within
def _harmonics(end: Any, k: int, time: float) -> Any:
    """Return displacement [m] along axis k and its rate [m/s] at a time."""
    u, T = min(max(time / end.ramp, 0.0), 1.0), end.ramp
    ramp = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
    slope = 30.0 * u * u * (1.0 - u) * (1.0 - u) / T
    displacement, rate = 0.0, 0.0
    for j in range(end.waves.shape[0]):
        A, omega = end.waves[j, k], end.waves[j, OMEGA]
        angle = omega * time + end.waves[j, PHASE]
        displacement += A * ramp * sin(angle)
        rate += A * (slope * sin(angle) + ramp * omega * cos(angle))
    return displacement, rate


@kernel("prepare", HarmonicEnd)
def move_by_harmonics(end: Any, rope: Any, stage: Any, kind: int) -> None:
    """Set the end to the harmonics around the stage's time."""
    if rope.model.first_free == 0:
        return
    h = rope.model.step
    row, fraction = _span(stage.time, 0.0, h)
    for k in range(3):
        x, u = _harmonics(end, k, row * h)
        y, v = _harmonics(end, k, (row + 1) * h)
        mean = end.mean[k]
        _set(rope.work, k, hermite(mean + x, mean + y, u * h, v * h, fraction, h))


@kernel("prepare", PrescribedEnd)
def move_as_prescribed(end: Any, rope: Any, stage: Any, kind: int) -> None:
    """Set the end to the motion between the boundaries around the stage's time."""
    if rope.model.first_free == 0:
        return
    h = end.clock[1]
    row, fraction = _span(stage.time, end.clock[0], h)
    border = Boundary(end.value, end.rate)
    if row > end.value.shape[0] - 2:
        row, fraction = end.value.shape[0] - 2, 1.0
    for k in range(3):
        _set(rope.work, k, prescribed(border, row, k, fraction, h))
