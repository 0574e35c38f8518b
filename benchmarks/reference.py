"""A converged solution of a scene, how far to trust it, and the error of others against it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.trial import Trial, Vector
from rope_twin.scene.load import load_scene
from rope_twin.studies.driven_twin import variant


@dataclass(frozen=True)
class Errors:
    """Errors of a top tension against a reference, at its own times."""

    mean_pct: float  # mean magnitude, of the reference's standard deviation
    rms_pct: float  # of the reference's standard deviation
    peak_pct: float  # of the reference's maximum
    trough_pct: float  # of the reference's standard deviation, since a trough may be zero


@dataclass(frozen=True)
class Reference:
    """The top tension of a scene after each of its fine steps."""

    scene: str
    nodes: int
    step_s: float
    tension_n: Vector

    def errors(self, tension_n: Vector, step_s: float) -> Errors:
        """Return the errors of a tension after each step of `step_s`, a multiple of the
        reference's.
        """
        every = round(step_s / self.step_s)
        there = self.tension_n[every - 1 :: every]
        scale = float(self.tension_n.std())
        apart = tension_n - there
        return Errors(
            100.0 * float(np.mean(np.abs(apart))) / scale,
            100.0 * float(np.sqrt(np.mean(apart**2))) / scale,
            100.0 * float(tension_n.max() / self.tension_n.max() - 1.0),
            100.0 * float(tension_n.min() - self.tension_n.min()) / scale,
        )


def find_reference(name: str, nodes: int, step_s: float, seconds: float) -> Reference:
    """Run a shipped scene with this number of elements (as many as moving nodes) and this step."""
    outcome = Trial(variant(load_scene(name), nodes, step_s), seconds).run()
    return Reference(name, nodes, step_s, outcome.tension_n)


def doubt(reference: Reference, seconds: float) -> Errors:
    """Return the difference of a run with half the elements and twice the step to the reference.

    The reference's own error is a third of this at second order, all of it at first.
    """
    coarse = find_reference(reference.scene, reference.nodes // 2, 2.0 * reference.step_s, seconds)
    return reference.errors(coarse.tension_n, coarse.step_s)
