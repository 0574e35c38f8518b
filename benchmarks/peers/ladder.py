"""Cases and errors of the comparison with peer codes, and rope_twin's own settings.

Errors are of the top tension over whole periods of the heave after its build-up: the largest of the
errors of mean, maximum and minimum, each in per cent of itself; the minimum of a rope that goes
slack in per cent of the mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.trial import Trial
from rope_twin.effects.current import CurrentParams
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import variant

# A scheme of MoorDyn still runs at so many times the inverse of an element's frequency, critically
# damped.
REACH = {
    "Euler": 1.93, "RK2": 1.93, "RK4": 2.67, "Midpoint4": 5.95, "Midpoint5": 7.07,
    "BEuler5": 4.20, "ACA5": 3.46,
}  # fmt: skip
CABLEDYN_S = (0.04, 0.02, 0.01, 0.005)
CABLEDYN_LONG_S = (0.01,)
STEPS_S = (0.2, 0.16, 0.125, 0.1, 0.08, 0.05, 0.04, 0.025, 0.02, 0.0125, 0.01, 0.005, 0.0025)
ELEMENTS = (20, 50, 100, 250, 500, 1000, 2500, 5000)
REFERENCE_STEP_S = 0.005
SLACK = 0.05  # of the mean: a lower minimum is that of a rope that falls slack


@dataclass(frozen=True)
class Case:
    """One comparison."""

    scene: str
    segments: int
    seconds: float
    from_s: float  # the start is not judged
    schemes: tuple[str, ...] = tuple(REACH)
    cabledyn_s: tuple[float, ...] = CABLEDYN_S
    still: bool = False  # without the scene's current

    @property
    def job(self) -> Scene:
        """Return the case as a job for a peer code."""
        scene = load_scene(self.scene)
        if not self.still:
            return scene
        effects = [params for params in scene.effects if not isinstance(params, CurrentParams)]
        return replace(scene, effects=tuple(effects))


@dataclass(frozen=True)
class Marks:
    """Quantities that the error is taken of [N]."""

    mean: float
    highest: float
    lowest: float

    @property
    def slack(self) -> bool:
        """Return whether the rope goes slack."""
        return self.lowest < SLACK * self.mean

    def error_pct(self, other: Marks) -> float:
        """Return the error of other quantities relative to these [%]; infinite if not a number."""
        apart = (
            abs(other.mean / self.mean - 1.0),
            abs(other.highest / self.highest - 1.0),
            abs(other.lowest - self.lowest) / (self.mean if self.slack else self.lowest),
        )
        return 100.0 * max(apart) if np.isfinite(apart).all() else float("inf")


def marks(tension_n: NDArray[np.float64], every_s: float, case: Case) -> Marks | None:
    """Return the quantities of a tension at the ends of equal intervals; None if it ended early."""
    times = every_s * np.arange(1, len(tension_n) + 1)
    if not len(times) or times[-1] < case.seconds - 1e-6:
        return None
    seen = tension_n[(times > case.from_s) & (times <= case.seconds + 1e-6)]
    return Marks(float(seen.mean()), float(seen.max()), float(seen.min()))


class Ours:
    """Results of rope_twin in a case: its reference, and each setting once."""

    def __init__(self, case: Case) -> None:
        self.case, self.scene = case, case.job
        fine = max(1000, 2 * case.segments)
        half = self._marks(fine // 2, 2.0 * REFERENCE_STEP_S)
        self.truth = self._marks(fine, REFERENCE_STEP_S)
        self.doubt_pct = self.truth.error_pct(half)
        self._found: dict[tuple[int, float], float] = {}

    def trial(self, elements: int, step_s: float) -> Trial:
        """Return the scene, ready to run with this setting."""
        return Trial(variant(self.scene, elements, step_s), self.case.seconds)

    def cheapest(self, within_pct: float, elements: Sequence[int]) -> tuple[int, float] | None:
        """Return elements and largest step within an error, for the first suitable number of
        elements.
        """
        for number in elements:
            for step_s in STEPS_S:
                if self.error_pct(number, step_s) <= within_pct:
                    return number, step_s
        return None

    def error_pct(self, elements: int, step_s: float) -> float:
        """Return the error of a setting [%]."""
        key = elements, step_s
        if key not in self._found:
            self._found[key] = self.truth.error_pct(self._marks(*key))
        return self._found[key]

    def _marks(self, elements: int, step_s: float) -> Marks:
        found = marks(self.trial(elements, step_s).run().tension_n, step_s, self.case)
        assert found is not None
        return found
