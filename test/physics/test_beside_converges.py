"""Convergence in elements and step of the tension with a VIV model outside the step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rope_twin import load_scene
from rope_twin.scene.schema import SeaState
from rope_twin.studies.driven_twin import variant
from rope_twin.twin.twin import Twin

SECONDS, EVERY_S = 15.0, 0.1


def tensions(name: str, times: int, step_s: float = 0.01) -> np.ndarray:
    """Top tension, ten a second, on `times` as many elements in calm water [N]."""
    scene = replace(load_scene(name), sea_state=SeaState())
    twin = Twin(variant(scene, times * scene.ropes[0].elements, step_s))
    results = []
    for _ in range(round(SECONDS / EVERY_S)):
        twin.advance(round(EVERY_S / twin.step_s))
        results.append(twin.snapshot().tension_top_n)
    return np.array(results)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values * values)))


@pytest.mark.parametrize("name", ["vortices_modal", "vortices_decomposed"])
def test_viv_tension_converges_with_elements(name: str) -> None:
    """Modes change four times in 15 s, at the same instants on every mesh."""
    own, twice, four = (tensions(name, times) for times in (1, 2, 4))
    assert rms(own - four) < 1e-5 * four.mean()
    assert rms(twice - four) < 0.6 * rms(own - four)


@pytest.mark.parametrize("name", ["vortices_modal", "vortices_decomposed"])
def test_viv_sampling_is_independent_of_the_step(name: str) -> None:
    """Steps of 10 ms and 2.5 ms sample at the same instants and find the same modes."""
    assert rms(tensions(name, 1) - tensions(name, 1, 0.0025)) < 3e-6 * 86e3
