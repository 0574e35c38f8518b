"""VIV under heave and pay-out, compared with VIV at constant tension ([SJTU] ch. 5).

The twin runs with its scene's regular heave and winch schedule; a one-way coupled modal VIV model
runs along, whose modes are recomputed at a given rate as tension, length and relative water speed
change.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.errors import InputError, phrase
from rope_twin.recording.heave import RegularSea
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import Motion, Speeds, march, still
from rope_twin.studies.picture import write_picture
from rope_twin.twin.modal_vibration import ModalVibration
from rope_twin.twin.twin import Twin
from rope_twin.vortex.modal_response import ModalResponse
from rope_twin.vortex.shedding import Shedding

PLACES = 200  # along the rope, over its length at the time
SAMPLE_S = 0.1  # how often the vibration is looked at


@dataclass(frozen=True)
class MovingRun:
    """Amplitudes over the diameter at shares of the rope's length, 0 at the hang-off."""

    share: Floats  # (places,)
    time_s: Floats  # (times,)
    amplitude: Floats  # (times, places)
    frequency_hz: Floats  # (times, places)
    tension_top_n: Floats  # (times,)
    rms_constant: Floats  # of the motion at constant tension, (places,)
    solves: int  # how often modes were found
    every_s: float
    cost: float  # time that the vibration took over the time simulated
    slack_share: float  # of the time in which part of the rope was slack

    @property
    def rms(self) -> Floats:
        """Return the RMS of the motion in the second half; an amplitude A counts as A/√2."""
        late = self.amplitude[len(self.amplitude) // 2 :]
        return np.asarray(np.sqrt(0.5 * (late**2).mean(axis=0)))


def run_moving(scene: Scene, shedding: Shedding, duration_s: float, every_s: float) -> MovingRun:
    """Run a scene with its regular heave or winch schedule from static equilibrium.

    Raises:
        InputError: the scene's sea is neither still nor a regular heave, its winch has other
            commands than speeds, or the rope is slack in static equilibrium.
        SceneError: a multi-line system, or a rope without static equilibrium.
        SolverError: the twin's next state would not be finite.
    """
    heave, speeds = regular_motion(scene)
    twin = Twin(scene)
    vibration = ModalVibration(twin, shedding, every_s)
    constant = ModalResponse(vibration.response.span, shedding)
    every = max(1, round(SAMPLE_S / twin.step_s))
    share = np.linspace(0.0, 1.0, PLACES)
    rows, squares, slack = [], [], 0
    for shot in march(twin, heave, duration_s, every, speeds):
        seen = vibration.follow()
        at = seen.from_hang_off_m / seen.from_hang_off_m[-1]
        moved = [np.interp(share, at, row) for row in (seen.amplitude, seen.frequency_hz)]
        rows.append((shot.time_s, shot.tension_top_n, *moved))
        slack += seen.slack
        constant.advance(every * twin.step_s)
        squares.append(constant.amplitude[::-1] ** 2)
    own = (constant.span.s[-1] - constant.span.s)[::-1] / constant.span.s[-1]
    steady = np.sqrt(0.5 * np.mean(squares[len(squares) // 2 :], axis=0))
    times, tensions, amplitudes, frequencies = zip(*rows, strict=True)
    return MovingRun(
        share, np.array(times), np.array(amplitudes), np.array(frequencies), np.array(tensions),
        np.interp(share, own, steady), vibration.solves, every_s,
        vibration.computing_s / duration_s, slack / len(rows),
    )  # fmt: skip


def regular_motion(scene: Scene) -> tuple[Motion, Speeds]:
    """Return heave over time and the winch's speeds.

    Raises:
        InputError: the sea is neither still nor a regular heave, or the winch has other commands.
    """
    sea = scene.sea_state
    if sea.moves and sea.heave is None:
        right = "give `sea_state: {heave: {amplitude_m: 1.5, period_s: 8.0}}`"
        raise InputError(phrase(f"scene {scene.name}", "its sea is not a regular heave", right))
    heave = RegularSea(sea.heave, sea.start_s).at if sea.heave is not None else still
    schedule = scene.winch.schedule if scene.winch else ()
    speeds = []
    for row in schedule:
        if row.speed_m_per_s is None:
            what = f"at {row.at_s:g} s its winch is told something else than a speed"
            raise InputError(phrase(f"scene {scene.name}", what, "give speed_m_per_s there"))
        speeds.append((row.at_s, row.speed_m_per_s))
    return heave, speeds


def draw_moving(name: str, run: MovingRun, path: Path) -> None:
    """Draw the amplitude over time and length, with both RMS profiles."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 5.5), layout="constrained")
    tension, field, along = figure.subplots(1, 3, width_ratios=(2, 3, 2))
    tension.plot(run.time_s, 1e-3 * run.tension_top_n, linewidth=0.7)
    tension.set_xlabel("time [s]")
    tension.set_ylabel("top tension [kN]")
    image = field.imshow(
        run.amplitude.T, aspect="auto",
        extent=(float(run.time_s[0]), float(run.time_s[-1]), 1.0, 0.0),
    )  # fmt: skip
    figure.colorbar(image, ax=field, label="A/d")
    field.set_xlabel("time [s]")
    field.set_ylabel("share of the rope below the hang-off")
    along.plot(run.rms, run.share, label="tension as it moves")
    along.plot(run.rms_constant, run.share, label="constant tension")
    along.invert_yaxis()
    along.set_xlabel("rms A/d")
    along.legend(fontsize=7)
    figure.suptitle(f"{name}: modes found {run.solves} times, every {run.every_s:g} s")
    write_picture(figure, path, 100)
