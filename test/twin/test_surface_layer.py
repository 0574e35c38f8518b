"""What a companion's difference tells of the error where waves die within an element."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rope_twin import Twin
from rope_twin.core.state import Floats
from rope_twin.effects.drag import DragParams
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.scene.load import load_scene
from rope_twin.scene.model.rope import build
from rope_twin.scene.schema import Scene, SeaState
from rope_twin.studies.driven_twin import variant
from rope_twin.twin.accuracy.error_fraction import THIRD, excess_load_m, wave_error_fraction

ELEMENTS, STEP_S, SECONDS, RAMP_S = 50, 0.02, 6.0, 2.0


def in_regular_waves(period_s: float) -> Scene:
    """400 m of wire from a hang-off that does not move, in waves of 10 cm, without drag."""
    scene = load_scene("ship_6dof")
    wave = WavesParams(regular=RegularWave(height_m=0.1, period_s=period_s), ramp_s=RAMP_S)
    effects = tuple(
        wave
        if isinstance(own, WavesParams)
        else replace(own, normal=0.0, tangential=0.0)
        if isinstance(own, DragParams)
        else own
        for own in scene.effects
    )
    return replace(scene, effects=effects, sea_state=SeaState())


def tensions(scene: Scene, elements: int) -> Floats:
    twin = Twin(variant(scene, elements, STEP_S))
    found = []
    while twin.time_ns < SECONDS * 1e9:
        twin.advance(2)
        found.append(twin.snapshot().tension_top_n)
    return np.array(found)


@pytest.mark.parametrize("k", [1e-6, 0.02, 0.3, 3.0])
@pytest.mark.parametrize("length", [2.0, 16.0])
def test_the_surplus_is_that_of_the_sum_over_nodes(k: float, length: float) -> None:
    """Against the sum itself, down to where e^{kz} is gone, or an element at which it hardly is."""
    nodes = max(int(40.0 / (k * length)), 1) if k > 1e-3 else 1
    z = -length * np.arange(nodes + 1)
    exact = -np.expm1(k * z[-1]) / k
    below = -np.expm1(k * z[-1])  # the half of the lowest node, and all that is under it
    found = np.trapezoid(np.exp(k * z[::-1]), z[::-1]) - exact
    assert excess_load_m(np.array([k]), length)[0] * below == pytest.approx(
        found, rel=1e-4, abs=1e-9
    )


def test_a_rope_without_waves_has_richardsons_third() -> None:
    assert wave_error_fraction(build(load_scene("deep_lift"))) == THIRD


@pytest.mark.parametrize(("period_s", "share"), [(2.0, 0.753), (3.0, 0.527), (6.0, 0.351)])
def test_the_error_of_a_rope_in_waves_is_that_share_of_the_difference(
    period_s: float, share: float
) -> None:
    """Waves of 6 to 56 m on elements of 8 m; the truth is extrapolated."""
    scene = in_regular_waves(period_s)
    told = wave_error_fraction(build(variant(scene, ELEMENTS, STEP_S)))
    assert told == pytest.approx(share, abs=0.001)
    coarse, own, finer, finest = (tensions(scene, n * ELEMENTS // 2) for n in (1, 2, 8, 16))
    exact = finest + (finest - finer) / 3.0
    settled = np.arange(len(own)) * 2 * STEP_S > RAMP_S
    error, difference = (np.linalg.norm(x[settled]) for x in (own - exact, coarse - own))
    assert error / difference == pytest.approx(told, rel=0.05)
