"""Figures of MoorPy that a validation case carries: computed again where it is installed."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
import pytest

from validation.moorpy_lines import FRICTION, IN_SECTIONS, PRINTED, RUBBING, SECTIONS, STRETCHING

HERE = importlib.util.find_spec("moorpy") is not None
pytestmark = pytest.mark.skipif(not HERE, reason="MoorPy is not installed")


@pytest.mark.parametrize("line", [*PRINTED, STRETCHING, RUBBING], ids=lambda line: line.name)
def test_lines_of_one_material(line) -> None:
    """Forces at both ends to 1e-6, as MoorPy's own tolerance on its ends leaves them."""
    from moorpy.Catenary import catenary

    friction = FRICTION if line is RUBBING else 0.0
    computed = catenary(
        line.across, line.up, line.length, line.EA, line.weight,
        CB=friction if line.on_bed else -1000.0, Tol=1e-9,
    )  # fmt: skip
    np.testing.assert_allclose(computed[:2], line.lower, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(computed[2:4], line.upper, rtol=1e-6)


def test_a_line_in_two_sections() -> None:
    """Its weights are set by masses, to MoorPy's own gravity, of lines without volume."""
    import moorpy

    depth = 200.0
    system = moorpy.System(depth=depth)
    for k, (_, weight, EA) in enumerate(SECTIONS):
        system.lineTypes[str(k)] = {
            "name": str(k), "material": "line", "m": weight / system.g, "w": weight, "EA": EA,
            "d_vol": 1e-7, "d_nom": 0.1, "input_d": 0.1, "EAd": 0, "EAd_Lm": 0, "BA": 0, "EI": 0,
            "Cd": 0, "Ca": 0, "CdAx": 0, "CaAx": 0, "cost": 0, "MBL": 0, "notes": "",
        }  # fmt: skip
    line = moorpy.Subsystem(mooringSys=system, depth=depth, span=IN_SECTIONS.across)
    line.makeGeneric([length for length, *_ in SECTIONS], ["0", "1"], suspended=0)
    line.setEndPosition([0.0, 0.0, -depth], endB=0)
    line.setEndPosition([IN_SECTIONS.across, 0.0, IN_SECTIONS.up - depth], endB=1)
    line.staticSolve(tol=1e-7)
    ends = line.lineList[0].fA[[0, 2]], line.lineList[-1].fB[[0, 2]]
    np.testing.assert_allclose(ends[0], IN_SECTIONS.lower, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(ends[1], IN_SECTIONS.upper, rtol=1e-6)


def test_a_figure_of_another_line_would_be_seen() -> None:
    """Stretch shows in MoorPy's figure of the same line by 27 N of 96,643."""
    other = replace(STRETCHING, EA=PRINTED[0].EA)
    with pytest.raises(AssertionError):
        test_lines_of_one_material(other)
