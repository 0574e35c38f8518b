"""Line model of the rope of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigs import Rig

from rope_twin.vortex.line_model import line_model
from rope_twin.vortex.modes import ModeSearch

CABLE = Rig(
    length=200.0, elements=40, mass=6.4, EA=6.5e7, diameter=0.04, load=3e3, density=1025.0,
    damping=1e5, current=((0.0, (0.3, 0.0)),), drag=(1.2, 0.02), added_mass=1.0, step=0.02,
)  # fmt: skip


def test_the_line_model_equals_the_twins_rope() -> None:
    """Tension, payload and length; frequencies of a hanging rope rise with its load."""
    twin = CABLE.twin()
    span = line_model(twin.rope)
    weight = CABLE.weight
    assert span.tension[-1] == pytest.approx(CABLE.top_weight - 2.5 * weight, rel=0.01)
    assert span.end_mass == pytest.approx(3e3)
    assert span.mass @ np.diff(span.s) == pytest.approx(200.0 * (6.4 + 1025.0 * 4e-4 * np.pi))
    light = ModeSearch(span, 0.5).found().frequency[1:]
    heavy = ModeSearch(line_model(replace(CABLE, load=6e3).twin().rope), 0.5).found().frequency[1:]
    assert (heavy[: len(light)] > light[: len(heavy)]).all()
