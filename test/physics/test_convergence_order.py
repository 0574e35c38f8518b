"""Order of the *published* top tension under heave: second in step and in element length.

deep_lift (3,000 m of steel, 20 t) under a sine of 1.5 m and 9 s. A tension read with the hang-off
one step late passes for a tension in a plot, and fails this test.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigs import Vector, march, sine, top_tension

from rope_twin import Twin, load_scene

HEAVE = sine(1.5, 9.0)
SECONDS, EVERY_S = 40.0, 0.2
STEPS = (0.04, 0.02, 0.01, 0.005)
FINEST_STEP = 0.00125
ELEMENTS = (25, 50, 100, 200, 400)
FINEST_ELEMENTS = 1600


def twin_of(elements: int, step: float) -> Twin:
    """deep_lift with this many elements and this step, Newton converged to 1 N."""
    scene = load_scene("deep_lift")
    line = replace(scene.ropes[0], elements=elements)
    time = replace(scene.time, step_s=step, newton_tolerance_n=1.0)
    return Twin(replace(scene, ropes=(line,), time=time))


def published(elements: int, step: float) -> Vector:
    """Snapshot.tension_top_n every EVERY_S [N]."""
    return top_tension(twin_of(elements, step), HEAVE, SECONDS, round(EVERY_S / step))


def order(sizes: Vector, errors: Vector) -> float:
    """Slope of the error over the size, both logarithmic."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def rms(values: Vector) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def test_second_order_in_the_step() -> None:
    """40, 20, 10 and 5 ms against 1.25 ms."""
    finest = published(100, FINEST_STEP)
    errors = [rms(published(100, step) - finest) for step in STEPS]
    assert order(np.array(STEPS), np.array(errors)) == pytest.approx(2.0, abs=0.2)
    assert errors[2] < 1e-5 * finest.mean()


def test_second_order_in_the_element_length() -> None:
    """25 to 400 elements against 1,600."""
    finest = published(FINEST_ELEMENTS, 0.01)
    errors = [rms(published(elements, 0.01) - finest) for elements in ELEMENTS]
    assert order(1.0 / np.array(ELEMENTS), np.array(errors)) == pytest.approx(2.0, abs=0.2)


def stale_error(elements: int, step: float) -> tuple[Vector, Vector]:
    """Top element's tension with the hang-off of the step before less that with its own [N].

    Second: EA·v·h/l0, v the hang-off's mean speed over the step.
    """
    twin = twin_of(elements, step)
    line = twin.scene.ropes[0]
    rest, EA = line.length_m / elements, line.rope.axial_stiffness_n
    late, predicted = [], []
    hang_off = twin.snapshot().hang_off_position_m
    for shot in march(twin, HEAVE, SECONDS):
        node = shot.node_position_m[1]
        own = EA * (np.linalg.norm(shot.hang_off_position_m - node) / rest - 1.0)
        stale = EA * (np.linalg.norm(hang_off - node) / rest - 1.0)
        late.append(stale - own)
        predicted.append(-EA * (shot.hang_off_position_m - hang_off)[2] / rest)
        hang_off = shot.hang_off_position_m
    return np.array(late), np.array(predicted)


def test_a_tension_read_one_step_late_fails_both() -> None:
    """Its error is EA·v·h/l0: first order in the step, and it *grows* with the elements."""
    late, predicted = stale_error(100, 0.01)
    assert np.abs(late - predicted).max() < 1e-3 * np.abs(predicted).max()
    assert np.abs(late).max() > 15e3, "the trap must be worth a test: 15 kN of 320"
    by_step = [rms(stale_error(100, step)[0]) for step in (0.04, 0.02, 0.01)]
    by_elements = [rms(stale_error(elements, 0.02)[0]) for elements in (25, 100, 400)]
    assert order(np.array([0.04, 0.02, 0.01]), np.array(by_step)) == pytest.approx(1.0, abs=0.05)
    assert order(1.0 / np.array([25, 100, 400]), np.array(by_elements)) == pytest.approx(
        -1.0, abs=0.05
    )
