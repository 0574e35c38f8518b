"""The scenes of the solver study, as shipped, with any number of elements."""

from __future__ import annotations

from rigs import Heave, sine

from rope_twin import Twin, load_scene
from rope_twin.studies.driven_twin import variant


def reference(name: str, elements: int, step_s: float) -> tuple[Twin, Heave]:
    """Return the twin of a shipped scene and the scene's own heave as a function of time."""
    scene = variant(load_scene(name), elements, step_s)
    heave = scene.sea_state.heave
    assert heave is not None
    return Twin(scene), sine(heave.amplitude_m, heave.period_s)
