"""Top tension under heave against values on which independent codes agree."""

from __future__ import annotations

import pytest
from reference_scenes import reference
from rigs import top_tension


@pytest.mark.parametrize(
    ("elements", "step"), [(100, 0.02), pytest.param(250, 0.01, marks=pytest.mark.long)]
)
def test_top_tension_of_smooth_2km(elements: int, step: float) -> None:
    """Mean, highest and minimum top tension from 40 to 120 s within 0.05 %.

    Explicit integration with 1000 elements: 167.573, 205.23 and 129.86 kN; three outside codes
    (MoorDyn and two others) 167.57, 204.6 and 130.4 kN.
    """
    twin, heave = reference("smooth_2km", elements, step)
    tension = top_tension(twin, heave, 120.0)[round(40.0 / step) - 1 :]
    assert tension.mean() == pytest.approx(167.573e3, rel=5e-4)
    assert tension.max() == pytest.approx(205.23e3, rel=5e-4)
    assert tension.min() == pytest.approx(129.86e3, rel=5e-4)
    assert twin.snapshot().solver.unconverged_substeps == 0


def test_peak_tension_of_smooth_5km() -> None:
    """5 km of buoyant rope, whose axial period of 7 s amplifies the heave: peak 227.48 kN."""
    twin, heave = reference("smooth_5km", 1000, 0.02)
    assert top_tension(twin, heave, 60.0).max() == pytest.approx(227.48e3, rel=5e-4)
