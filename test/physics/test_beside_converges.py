"""The tension of a rope whose vortices are computed beside the step, over elements and step."""

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
    """At the top, ten a second, of the scene on so many times its elements in calm water [N]."""
    scene = replace(load_scene(name), sea_state=SeaState())
    twin = Twin(variant(scene, times * scene.ropes[0].elements, step_s))
    found = []
    for _ in range(round(SECONDS / EVERY_S)):
        twin.advance(round(EVERY_S / twin.step_s))
        found.append(twin.snapshot().tension_top_n)
    return np.array(found)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values * values)))


@pytest.mark.parametrize("name", ["vortices_modal", "vortices_decomposed"])
def test_the_error_falls_with_the_elements(name: str) -> None:
    """In 15 s modes take over from each other four times, at the same second on every grid."""
    own, twice, four = (tensions(name, times) for times in (1, 2, 4))
    assert rms(own - four) < 1e-5 * four.mean()
    assert rms(twice - four) < 0.6 * rms(own - four)


@pytest.mark.parametrize("name", ["vortices_modal", "vortices_decomposed"])
def test_looks_and_searches_do_not_hang_on_the_step(name: str) -> None:
    """A step of 10 ms and one of 2.5 ms have looks at the same instants, and the same modes."""
    assert rms(tensions(name, 1) - tensions(name, 1, 0.0025)) < 3e-6 * 86e3
