"""The nominal rope: one that follows the measured motion, for forecasts to begin from.

A forecast begins its members from the state that the rope had before the origin. Beside a live
twin that is the twin's own state of then; over a recording the nominal rope is run on measured
heave and line out from rest at the recording's beginning, on the mesh of the forecast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, SolverError, phrase
from rope_twin.forecast.heave_process import SAMPLE_S
from rope_twin.forecast.tension_forecast import ForecastSettings
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs, FleetState
from rope_twin.twin.motion.heave_track import ramp

Floats = NDArray[np.float64]

RAMP_S = 10.0  # over which the measured motion sets in
BATCH_S = 30.0
LEAST_LANES = 4  # members from which on they share a step


def scene_at_line(scene: Scene, line_out_m: float) -> Scene:
    """Return the scene with this line out at its beginning.

    Raises:
        SceneError: the line out is not possible.
    """
    if line_out_m == scene.ropes[0].length_m:
        return scene
    return change_scene(scene, [Change("ropes[0].length_m", float(line_out_m))])


class NominalRope:
    """Ropes that follow measured motion from rest, each in lanes of one fleet."""

    def __init__(self, scene: Scene, settings: ForecastSettings, ropes: int = 1) -> None:
        """Begin at rest at time 0, with the scene's line out.

        Raises:
            InputError: a scene that fleets do not step.
            SceneError: the scene has no static equilibrium.
        """
        self._settings, self._ropes = settings, ropes
        count = max(ropes, LEAST_LANES)
        self._fleet = Fleet(scene, count, elements=settings.elements, step_s=settings.step_s)
        self._lanes = np.arange(count) % ropes
        self._samples = 0  # SAMPLE_S since the beginning

    @property
    def time_s(self) -> float:
        """Time since the beginning [s]."""
        return self._samples * SAMPLE_S

    def follow(self, until_s: float, from_s: float, heave_m: Floats, line_out_m: Floats) -> None:
        """Advance to a time, a whole number of SAMPLE_S.

        heave_m: (n,) or (n, ropes), line_out_m: (n,), every SAMPLE_S from `from_s` on; they span
        the present of the ropes and `until_s`.

        Raises:
            InputError: they do not.
            SolverError: a rope failed.
        """
        from scipy.interpolate import CubicSpline  # slow to import

        own = self._settings
        heave = np.asarray(heave_m, np.float64).reshape(len(heave_m), -1)
        place = from_s + SAMPLE_S * np.arange(len(heave))
        target = round(until_s / SAMPLE_S)
        if target <= self._samples:
            return
        if place[0] > self.time_s + 1e-6 or place[-1] < until_s - 1e-6:
            what = f"motion from {place[0]:g} to {place[-1]:g} s"
            right = f"it must span {self.time_s:g} to {until_s:g} s"
            raise InputError(phrase("nominal rope", what, right))
        moved, line = CubicSpline(place, heave), CubicSpline(place, line_out_m)
        per_sample, per_batch = round(SAMPLE_S / own.step_s), round(BATCH_S / SAMPLE_S)
        while self._samples < target:
            some = min(per_batch, target - self._samples)
            number = np.arange(some * per_sample + 1)
            at = self.time_s + own.step_s * number
            shares = np.array([ramp(float(t), RAMP_S) for t in at])
            share, slope = shares[:, :1], shares[:, 1:]
            z, v = moved(at), moved(at, 1)
            z, v = share * z, share * v + slope * z
            record = self._fleet.advance(
                FleetInputs(z[:, self._lanes], v[:, self._lanes], line(at), line(at, 1)), per_sample
            )
            if record.failures:
                why = next(iter(record.failures.values()))
                raise SolverError(phrase("nominal rope", why.rstrip("."), "check its motion"))
            self._samples += some

    def states(self) -> list[FleetState]:
        """Return the present state of each rope."""
        return [self._fleet.state(k) for k in range(self._ropes)]


def nominal_states(
    scene: Scene,
    heave_m: Floats,
    line_out_m: Floats,
    samples: list[int],
    settings: ForecastSettings | None = None,
) -> list[list[FleetState]]:
    """Return the states of ropes that follow measured motion from rest, at some samples.

    Args:
        scene: with the line out of the first sample.
        heave_m: of each rope, every SAMPLE_S from time 0 on, (n,) or (n, ropes).
        line_out_m: (n,), that of the scene at first.
        samples: numbers of samples, ascending, at which the states are wanted.
        settings: mesh and step.

    Returns:
        For each sample a list of the state of each rope.

    Raises:
        InputError: the samples are not ascending or beyond the record.
        SolverError: a rope failed.
    """
    heave = np.asarray(heave_m, np.float64).reshape(len(heave_m), -1)
    if sorted(set(samples)) != samples or (samples and not 0 < samples[-1] < len(heave)):
        what = f"samples {samples} of {len(heave)}"
        raise InputError(phrase("nominal rope", what, "give ascending numbers within the record"))
    rope = NominalRope(scene, settings or ForecastSettings(), heave.shape[1])
    states = []
    for sample in samples:
        rope.follow(sample * SAMPLE_S, 0.0, heave, line_out_m)
        states.append(rope.states())
    return states
