"""Payload whose drag and added mass depend on its Keulegan-Carpenter number."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from oscillation_rigs import EVEN, in_time, oscillating, payload_by
from rigs import Rig, march, march_to_end, sine

from rope_twin import Twin
from rope_twin.effects.payload_oscillation import (
    MEAN,
    RATE2,
    SQUARE,
    PayloadOscillation,
    PayloadOscillationParams,
)
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin.monitors import Monitors

RHO = 1025.0
# A weightless rope that hardly stretches: the payload moves as the hang-off.
STIFF = Rig(
    length=20.0, elements=4, mass=0.02, EA=2e9, diameter=0.005, load=30e3, volume=4.0,
    added=(8e3, 8e3, 12e3), area=(6.0, 6.0, 9.0), density=RHO, damping=1e5, step=0.01, ramp=4.0,
)  # fmt: skip
SIZE = 0.8
# constant about the number of the test, 7.07
DRAG = ((1.0, 2.0), (5.0, 1.5), (9.0, 1.5), (20.0, 1.0))
ADDED = ((1.0, 0.6), (5.0, 1.3), (9.0, 1.3), (20.0, 1.8))


def plain_of(rig: Rig, *more: object) -> Scene:
    scene = rig.scene()
    return replace(scene, effects=(*scene.effects, *more))


def scene_of(rig: Rig, *more: object) -> Scene:
    return in_time(rig.scene(), *more)


def by_number(drag: object = DRAG, added: object = ADDED) -> PayloadOscillationParams:
    return payload_by(drag, added, SIZE)


def memory_of(twin: Twin) -> np.ndarray:
    (own,) = (effect for effect in twin.rope.effects if isinstance(effect, PayloadOscillation))
    return np.asarray(own.memory[:, 0])


@pytest.mark.parametrize(
    ("amplitude", "drag", "added"),
    [
        (0.9, 1.5, 1.3),
        pytest.param(0.05, 2.0, 0.6, marks=pytest.mark.long),
        pytest.param(3.2, 1.0, 1.8, marks=pytest.mark.long),
    ],
)
def test_factors_of_a_heaving_payload_by_keulegan_carpenter_number(
    amplitude: float, drag: float, added: float
) -> None:
    """T = W + (M + c_A·A)·a + c_D·½·ρ·CdA·|v|·v, fitted to a period; KC = 2π·a/L in all of it."""
    period = 6.0
    twin = Twin(scene_of(STIFF, by_number()))
    omega = 2.0 * math.pi / period
    rows_, pulls = [], []
    for snapshot in march(twin, sine(amplitude, period), 180.0):
        if snapshot.time_s > 174.0:
            v = amplitude * omega * math.cos(omega * snapshot.time_s)
            a = -amplitude * omega**2 * math.sin(omega * snapshot.time_s)
            rows_.append((1.0, a, abs(v) * v))
            pulls.append(snapshot.tension_top_n)
    assert min(pulls) > 0.0, "a slack rope says nothing"
    fit, *_ = np.linalg.lstsq(np.array(rows_), np.array(pulls), rcond=None)
    assert fit[1] == pytest.approx(30e3 + added * 12e3, rel=2e-3)
    assert fit[2] == pytest.approx(drag * 0.5 * RHO * 9.0, rel=5e-3)
    m = memory_of(twin)
    sigma = math.sqrt(m[SQUARE + 2] - m[MEAN + 2] ** 2)
    number = (abs(m[MEAN + 2]) + math.sqrt(2.0) * sigma) * 2.0 * math.pi * sigma / SIZE
    assert number / math.sqrt(m[RATE2 + 2]) == pytest.approx(
        2.0 * math.pi * amplitude / SIZE, rel=0.12
    )


SEA = WavesParams(regular=RegularWave(height_m=3.0, period_s=7.0), ramp_s=4.0)
SOFT = replace(STIFF, length=30.0, EA=4e7, diameter=0.05, mass=9.0, hang_off=(0.0, 0.0, 2.0))


def test_payload_factors_of_one_change_nothing() -> None:
    """In waves, to round-off."""
    positions = []
    for scene in (plain_of(SOFT, SEA), scene_of(SOFT, SEA, by_number(EVEN, EVEN))):
        snapshot = march_to_end(Twin(scene), sine(0.5, 5.0), 10.0)
        positions.append(snapshot.node_position_m)
    assert np.abs(positions[0] - positions[1]).max() < 1e-9


@pytest.mark.long
def test_connected_payloads_have_their_own_factors() -> None:
    """A bridle: factors of one change nothing, tables change the motion."""
    scene = load_scene("bridle_lift")
    positions = []
    for each in (
        scene, oscillating(scene, by_number(EVEN, EVEN)), oscillating(scene, by_number())
    ):  # fmt: skip
        snapshot = march_to_end(Twin(each), sine(1.0, 5.0), 4.0)
        positions.append(np.concatenate([rope.node_position_m for rope in snapshot.ropes]))
    assert np.abs(positions[0] - positions[1]).max() < 1e-9
    assert np.abs(positions[0] - positions[2]).max() > 1e-4


def test_constant_factors_equal_scaled_coefficients() -> None:
    """Twice the drag and 1.5 times the added mass, by tables of one row or by the payload."""
    more = by_number(((3.0, 2.0),), ((3.0, 1.5),))
    other = replace(
        SOFT, added=tuple(1.5 * a for a in SOFT.added), area=tuple(2.0 * a for a in SOFT.area)
    )
    positions = []
    for scene in (scene_of(SOFT, SEA, more), plain_of(other, SEA), plain_of(SOFT, SEA)):
        snapshot = march_to_end(Twin(scene), sine(0.5, 5.0), 10.0)
        positions.append(snapshot.node_position_m)
    assert np.abs(positions[0] - positions[1]).max() < 1e-7
    assert np.abs(positions[0] - positions[2]).max() > 0.01


def test_energy_balance_with_varying_payload_factors() -> None:
    """A factor held over a step is late by a part of it: an error of first order, below 1e-4."""
    shares = []
    for step in (0.01, 0.005):
        scene = scene_of(replace(SOFT, step=step), SEA, by_number())
        twin = Twin(scene, Monitors(energy=True))
        snapshot = march_to_end(twin, sine(1.0, 5.0), 14.0)
        assert snapshot.energy is not None
        shares.append(abs(snapshot.energy.residual_j) / snapshot.energy.exchanged_j)
    assert shares[1] < 1e-4
    assert shares[1] < 0.6 * shares[0]
