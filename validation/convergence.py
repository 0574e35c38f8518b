"""P4: order of convergence of the published top tension, in element length and in step.

deep_lift (3,000 m of steel, 20 t) under a sine of 1.5 m and 9 s, never slack: the scheme, TR-BDF2
on lumped elements, claims the second order in both.
"""

from __future__ import annotations

import numpy as np

from rope_twin.scene.load import load_scene
from rope_twin.studies.driven_twin import march, variant
from rope_twin.studies.picture import Line, Panel, Vector
from rope_twin.twin.twin import Twin
from validation.case import Case, Found, between, within
from validation.rigs import sine

SCENE, HEAVE = "deep_lift", sine(1.5, 9.0)
SECONDS, EVERY_S = 40.0, 0.2
STEPS_S, FINEST_STEP_S = (0.04, 0.02, 0.01, 0.005), 0.00125
ELEMENTS, FINEST_ELEMENTS = (25, 50, 100, 200, 400), 1600


def twin_of(elements: int, step_s: float) -> Twin:
    """Return deep_lift with this number of elements and time step, Newton tolerance 1 N."""
    return Twin(variant(load_scene(SCENE), elements, step_s, tolerance_n=1.0))


def published(elements: int, step_s: float) -> Vector:
    """Return Snapshot.tension_top_n every EVERY_S [N]."""
    snapshots = march(twin_of(elements, step_s), HEAVE, SECONDS, round(EVERY_S / step_s))
    return np.array([snapshot.tension_top_n for snapshot in snapshots])


def rms(values: Vector) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def slope(sizes: tuple[float, ...], errors: tuple[float, ...]) -> float:
    """Return the order: slope of the error over the size, both logarithmic."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def _orders() -> Found:
    finest = published(100, FINEST_STEP_S)
    by_step = tuple(rms(published(100, step) - finest) for step in STEPS_S)
    finest_mesh = published(FINEST_ELEMENTS, 0.01)
    by_element = tuple(rms(published(n, 0.01) - finest_mesh) for n in ELEMENTS)
    length = load_scene(SCENE).ropes[0].length_m
    sizes = tuple(length / n for n in ELEMENTS)
    findings = (
        within("order in the step, 40 to 5 ms", slope(STEPS_S, by_step), 2.0, 0.2),
        within("order in the element length, 120 to 7.5 m", slope(sizes, by_element), 2.0, 0.2),
        between("error of 10 ms, of the mean tension", by_step[2] / finest.mean(), (0.0, 1e-5),
                "small"),
    )  # fmt: skip
    scaled = [100.0 / finest.std() * np.array(row) for row in (by_step, by_element)]
    milliseconds = [1e3 * step for step in STEPS_S]
    panels = (
        _panel("100 elements, against 1.25 ms", "step [ms]", milliseconds, scaled[0]),
        _panel("10 ms, against 1,600 elements", "element [m]", list(sizes), scaled[1]),
    )
    note = (
        "`python -m benchmarks order` has the orders of a snap as well, which are lower: "
        "docs/performance.md says why."
    )
    return Found(findings, panels, (note,))


def _panel(title: str, x: str, sizes: list[float], errors: Vector) -> Panel:
    second = errors[0] * (np.array(sizes) / sizes[0]) ** 2
    lines = Line(sizes, errors, "ours", "o-"), Line(sizes, second, "order 2", "k:")
    return Panel(title, x, "rms error of the top tension [% of its std]", lines, log=True)


CASES = (
    Case("P4", "order of convergence in element length and in step: deep_lift, heave 1.5 m / 9 s",
         "theory: second order", _orders, 10.0),
)  # fmt: skip
