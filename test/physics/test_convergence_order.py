"""Tension from a stale hang-off position is of first order only and grows with refinement.

That the published one is of second order in step and element length: case P4 of validate.
"""

from __future__ import annotations

import numpy as np
import pytest
from rigs import Vector, march

from validation.convergence import HEAVE, SECONDS, rms, slope, twin_of


def stale_error(elements: int, step: float) -> tuple[Vector, Vector]:
    """Return the error of a tension computed with the hang-off of the previous step [N].

    Second: EA·v·h/l0, v the hang-off's mean speed over the step.
    """
    twin = twin_of(elements, step)
    line = twin.scene.ropes[0]
    rest, EA = line.length_m / elements, line.rope.axial_stiffness_n
    late, predicted = [], []
    hang_off = twin.snapshot().hang_off_position_m
    for snapshot in march(twin, HEAVE, SECONDS):
        node = snapshot.node_position_m[1]
        own = EA * (np.linalg.norm(snapshot.hang_off_position_m - node) / rest - 1.0)
        stale = EA * (np.linalg.norm(hang_off - node) / rest - 1.0)
        late.append(stale - own)
        predicted.append(-EA * (snapshot.hang_off_position_m - hang_off)[2] / rest)
        hang_off = snapshot.hang_off_position_m
    return np.array(late), np.array(predicted)


def test_a_tension_one_step_late_is_of_first_order_and_grows_with_elements() -> None:
    """Its error is EA·v·h/l0: first order in the step, inverse in the element length."""
    late, predicted = stale_error(100, 0.01)
    assert np.abs(late - predicted).max() < 1e-3 * np.abs(predicted).max()
    assert np.abs(late).max() > 15e3, "the trap must be worth a test: 15 kN of 320"
    steps, lengths = (0.04, 0.02, 0.01), (120.0, 30.0, 7.5)
    by_step = tuple(rms(stale_error(100, step)[0]) for step in steps)
    by_length = tuple(rms(stale_error(round(3000.0 / l0), 0.02)[0]) for l0 in lengths)
    assert slope(steps, by_step) == pytest.approx(1.0, abs=0.05)
    assert slope(lengths, by_length) == pytest.approx(-1.0, abs=0.05)
