"""Comparison of two scenes with a VIV model each: VIV under heave and VIV without.

Both twins run with their own regular heave and winch schedule. With a model inside the time step
the influence of tension on the vibration is part of the rope itself, and no mode is solved for; the
motion is that of the grid's nodes across the surface current, over the rope's diameter. With a
model outside the time step its own motion is taken at each update.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.errors import SceneError, phrase
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.vortices import shedding_model
from rope_twin.studies.modes.equilibrium import water_at
from rope_twin.studies.picture import Field, Line, Panel, draw_panels
from rope_twin.studies.viv.moving import regular_motion
from rope_twin.studies.viv.own import expected_hz, refuse_short
from rope_twin.studies.viv.own_looks import made_even, marched
from rope_twin.twin.twin import Twin

PLACES = 150  # along the rope, over its length at the time
SAMPLE_S = 0.04  # or less, so that the fastest vortices have
LEAST_PER_PERIOD = 8.0  # samples in a period
SHOWN_S = 20.0  # of the motion in the picture
WINDOW_S = 2.0  # over which the motion's size is taken


@dataclass(frozen=True)
class Shaken:
    """A run; places are shares of the rope's length, 0 at the hang-off."""

    scene: str
    model: str
    every_s: float
    share: Floats  # (places,)
    time_s: Floats  # second half, (times,)
    motion: Floats  # across over the diameter, its mean taken off, (times, places)
    tension_top_n: Floats  # (times,)

    @property
    def rms(self) -> Floats:
        """Return the RMS of the motion, (places,)."""
        return np.asarray(self.motion.std(axis=0))

    @property
    def spectrum(self) -> tuple[Floats, Floats]:
        """Return frequencies [Hz] and power per Hz of all places together [d²/Hz]."""
        from scipy.signal import welch

        length = min(len(self.motion), round(40.0 / self.every_s))
        found: tuple[Floats, Floats] = welch(
            self.motion, fs=1.0 / self.every_s, nperseg=length, axis=0
        )
        return found[0], np.asarray(found[1].mean(axis=1))

    @property
    def size(self) -> tuple[Floats, Floats]:
        """Return times [s] and RMS of all places over WINDOW_S around them."""
        count = min(max(1, round(WINDOW_S / self.every_s)), len(self.motion))
        square = (self.motion**2).mean(axis=1)
        window = np.full(count, 1.0 / count)
        mean = np.convolve(square, window, "valid")
        return np.convolve(self.time_s, window, "valid"), np.asarray(np.sqrt(mean))

    def figures(self) -> ShakenFigures:
        """Return the results as numbers by name."""
        frequency, power = self.spectrum
        above = frequency > 0.0
        mean = float((power[above] * frequency[above]).sum() / power[above].sum())
        spread = float(
            np.sqrt((power[above] * (frequency[above] - mean) ** 2).sum() / power[above].sum())
        )
        pull, at = self.tension_top_n, int(self.rms.argmax())
        size = self.size[1]
        return ShakenFigures(
            self.scene, self.model, float(pull.mean()), float(pull.min()), float(pull.max()),
            float(self.rms[at]), float(self.share[at]), float(self.rms.mean()), mean, spread,
            float(size.std() / size.mean()),
        )  # fmt: skip


@dataclass(frozen=True)
class ShakenFigures:
    """Results of the second half of a run."""

    scene: str
    model: str
    tension_mean_n: float
    tension_min_n: float
    tension_max_n: float
    rms_max_diameters: float
    rms_max_at_share: float  # of the length, from the hang-off
    rms_mean_diameters: float
    frequency_hz: float  # centre of the motion's power
    bandwidth_hz: float  # its spread about that
    swelling: float  # standard deviation of the motion's size over its mean


def run_shaken(scene: Scene, duration_s: float) -> Shaken:
    """Run a scene from static equilibrium; the second half counts.

    Raises:
        SceneError: it has no VIV model, or no current at the surface.
        InputError: the run is too short, its sea is neither still nor a regular heave, or its winch
            has other commands than speeds.
        SolverError: the twin's next state would not be finite.
    """
    model, across = shedding_model(scene), _across(scene)
    if not model:
        what = "it lists no model of vortices"
        raise SceneError(phrase(f"{scene.path}: effects", what, "list one of them"))
    hz = expected_hz(scene)
    refuse_short(duration_s, hz)
    heave, speeds = regular_motion(scene)
    twin = Twin(scene)
    sample_s = min(SAMPLE_S, 1.0 / (LEAST_PER_PERIOD * hz))
    own, every = twin.viv_drag, max(1, int(sample_s / twin.step_s + 1e-6))
    share = np.linspace(0.0, 1.0, PLACES)

    def steps() -> int:
        return every if own is None else own.steps_to_sampling(twin.steps)

    rows = []
    for shot in marched(twin, heave, duration_s, speeds, steps):
        if shot.time_s < 0.5 * duration_s:
            continue
        line_m = shot.arc_length_m[-1]
        if own is None:
            place = np.interp(share, shot.arc_length_m / line_m, shot.node_position_m @ across)
        else:
            place = own.tracker.moved(twin.rope, (1.0 - share) * line_m)
        rows.append((shot.time_s, shot.tension_top_n, place))
    times, pulls, places = made_even(*(np.array(part) for part in zip(*rows, strict=True)))
    motion = places / scene.ropes[0].thinnest_m
    return Shaken(
        scene.name, model, float(times[-1] - times[0]) / (len(times) - 1), share, times,
        motion - motion.mean(axis=0), pulls,
    )  # fmt: skip


def _across(scene: Scene) -> Floats:
    """Return the horizontal unit vector across the current at the surface."""
    east, north, _ = water_at(scene, np.zeros(1))[:, 0]
    speed = float(np.hypot(east, north))
    if speed == 0.0:
        what = "no current at the surface, so no direction across it"
        raise SceneError(phrase(f"{scene.path}: effects", what, "give 'current' a speed there"))
    return np.array([-north / speed, east / speed, 0.0])


def beside_table(runs: tuple[Shaken, ...]) -> list[tuple[str, ...]]:
    """Return both runs as rows of text, below a head."""
    head = ("scene", "model", "mean kN", "min kN", "max kN", "rms/d most", "at", "rms/d mean",
            "Hz", "± Hz", "swelling")  # fmt: skip
    rows: list[tuple[str, ...]] = [head]
    for own in (run.figures() for run in runs):
        pulls = (own.tension_mean_n, own.tension_min_n, own.tension_max_n)
        rows.append(
            (own.scene, own.model, *(f"{1e-3 * pull:.1f}" for pull in pulls),
             f"{own.rms_max_diameters:.3f}", f"{own.rms_max_at_share:.0%}",
             f"{own.rms_mean_diameters:.3f}", f"{own.frequency_hz:.3f}",
             f"{own.bandwidth_hz:.3f}", f"{own.swelling:.0%}")
        )  # fmt: skip
    return rows


def beside_json(runs: tuple[Shaken, ...]) -> list[dict[str, Any]]:
    """Return both runs as plain data."""
    return [asdict(run.figures()) for run in runs]


def draw_beside(runs: tuple[Shaken, ...], path: Path) -> None:
    """Draw tension, RMS along the rope, spectrum, amplitude over time and final motion of each.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """

    def lines(x: Any, y: Any) -> tuple[Line, ...]:
        return tuple(Line(x(run), y(run), run.scene) for run in runs)

    top = 2.0 * max(run.figures().frequency_hz for run in runs)
    above = "share of the rope above the lower end"
    panels = [
        Panel("rms of the motion", "rms/d", above,
              lines(lambda run: run.rms, lambda run: 1.0 - run.share)),
        Panel("spectrum, all places", "[Hz]", "[d²/Hz]",
              lines(lambda run: run.spectrum[0][run.spectrum[0] < top],
                    lambda run: run.spectrum[1][run.spectrum[0] < top])),
        Panel(f"size of the motion over {WINDOW_S:g} s", "time [s]", "rms/d",
              lines(lambda run: run.size[0], lambda run: run.size[1])),
        Panel("top tension", "time [s]", "[kN]",
              lines(lambda run: _last(run, run.time_s), lambda run: _last(run, _kn(run)))),
    ]  # fmt: skip
    for run in runs:
        some = _last(run, run.motion).T[::-1]
        field = Field(some, (float(_last(run, run.time_s)[0]), float(run.time_s[-1])), (0.0, 1.0),
                      "y/d")  # fmt: skip
        panels.append(Panel(f"{run.scene}: motion", "time [s]", above, field=field))
    draw_panels(" beside ".join(run.scene for run in runs), panels, path)


def _kn(run: Shaken) -> Floats:
    return np.asarray(1e-3 * run.tension_top_n)


def _last(run: Shaken, values: Floats) -> Floats:
    """Return the rows of the last SHOWN_S."""
    return values[-round(SHOWN_S / run.every_s) :]
