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
from rope_twin.scene.change import Change, change_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs, FleetState
from rope_twin.twin.motion.heave_track import ramp

Floats = NDArray[np.float64]

RAMP_S = 10.0  # over which the measured motion sets in
BATCH_S = 30.0
LEAST_LANES = 4  # members of a fleet from which on they share a step; a lone rope is stepped so too


def scene_at_line(scene: Scene, line_out_m: float) -> Scene:
    """Return the scene with this line out at its beginning.

    Raises:
        SceneError: the line out is not possible.
    """
    if line_out_m == scene.ropes[0].length_m:
        return scene
    return change_scene(scene, [Change("ropes[0].length_m", float(line_out_m))])


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
    from scipy.interpolate import CubicSpline  # slow to import

    own = settings or ForecastSettings()
    heave = np.asarray(heave_m, np.float64).reshape(len(heave_m), -1)
    ropes = heave.shape[1]
    if sorted(set(samples)) != samples or (samples and not 0 < samples[-1] < len(heave)):
        what = f"samples {samples} of {len(heave)}"
        raise InputError(phrase("nominal rope", what, "give ascending numbers within the record"))
    fleet = Fleet(scene, max(ropes, LEAST_LANES), elements=own.elements, step_s=own.step_s)
    spare = np.arange(max(ropes, LEAST_LANES)) % ropes
    place = SAMPLE_S * np.arange(len(heave))
    moved, line = CubicSpline(place, heave), CubicSpline(place, line_out_m)
    per_sample, per_batch = round(SAMPLE_S / own.step_s), round(BATCH_S / own.step_s)
    done, states = 0, []
    for sample in samples:
        while done < sample * per_sample:
            some = min(per_batch, sample * per_sample - done)
            at = own.step_s * np.arange(done, done + some + 1)
            shares = np.array([ramp(float(t), RAMP_S) for t in at])
            share, slope = shares[:, :1], shares[:, 1:]
            z, v = moved(at), moved(at, 1)
            z, v = share * z, share * v + slope * z
            record = fleet.advance(
                FleetInputs(z[:, spare], v[:, spare], line(at), line(at, 1)), per_sample
            )
            if record.failures:
                why = next(iter(record.failures.values()))
                raise SolverError(phrase("nominal rope", why.rstrip("."), "check the recording"))
            done += some
        states.append([fleet.state(k) for k in range(ropes)])
    return states
