"""VIV assessment in the time domain: a run of the scene's twin with its VIV model.

A scene without a VIV model is run with the modal one (`with_model`). The second half of the run
counts; heave and winches move as in the scene. In a multi-line scene every line is sampled.

With a model inside the time step, motion slower than a fifth of the fastest vortices (ship, winch,
sway) is removed from the nodes' motion by a Butterworth filter, forward and backward in time, and
the rest is resolved into cross-flow and in-line components. A filter has edge effects: sampling
begins AROUND_PERIODS before the evaluated part, and continues for as long after it. A model outside
the time step (rope_twin.vortex.coupled) has its own motion, which has no in-line component; it is
sampled right after each of its updates.

Drag amplification is that of the run: the mean of f·|u_n|·u_n over |U_n|·U_n, with the velocity of
the water relative to the rope and normal to it, u_n, its mean, U_n, and f, the drag amplification
of a model outside the time step. Bending strain is d/2 times the curvature of the rope on its
nodes, or of the motion of the model, in the direction in which it is largest; stress is E times the
strain; damage is that of tension and bending together (rope_twin.vortex.results), per year of the
run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.effects.coupled_vibration import ModalVibrationParams
from rope_twin.errors import InputError, SceneError
from rope_twin.recording.motion_source import RegularSea
from rope_twin.scene.grid import ends_m
from rope_twin.scene.joined_model import first_places
from rope_twin.scene.lift import alone, lift_figures
from rope_twin.scene.rigging import is_joined, winch_of, winches_by_name
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.scene.vortex import expected_pace, shedding_model
from rope_twin.studies.driven_twin import Motion, Speeds, still, with_effect
from rope_twin.studies.viv_frequency_domain import YEAR_S
from rope_twin.studies.viv_samplers import (
    PLACES,
    Sample,
    Sampler,
    advance_by,
    resampled,
    samplers_of,
)
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.vortex.drag_amplification import amplified_drag
from rope_twin.vortex.fatigue import metal_area
from rope_twin.vortex.line_model import bending_stiffness
from rope_twin.vortex.monitor import CUT_OFF
from rope_twin.vortex.results import DamageSettings, MaterialFatigue, RopeDamage

STEADY = 0.5  # of a run: the part that counts
MIN_PERIODS = 10  # of the fastest vortices in that part
# periods before and after it, for the filter: in five its edge effects fall to 1.2 %, as
# exp(-t·√½·2π·CUT_OFF·f)
AROUND_PERIODS = 5.0
SPECTRUM_S = 40.0  # part of the run that resolves a spectrum
WINDOW_S = 2.0  # over which the size of the motion is taken


class Spectrum(NamedTuple):
    """Cross-flow motion over frequency, mean of all places."""

    centre_hz: float  # of the power
    bandwidth_hz: float  # standard deviation of the power about the centre


@dataclass(frozen=True)
class TimeDomainRun:
    """The steady part of a run of one line; places are from its upper end down."""

    scene: str
    line: str
    model: str
    vortices_hz: float  # the fastest that were expected
    every_s: float
    from_hang_off_m: Floats  # unstretched, at the end, (places,)
    time_s: Floats  # (times,)
    # across the flow and with it (NaN: its model has none), over the diameter, (2, times, places)
    motion: Floats
    tension_top_n: Floats  # (times,)
    drag_amplification: Floats  # (places,)
    strain_rms: Floats  # of bending, (places,)
    stress_rms_pa: Floats  # of bending; NaN where no stress is known, (places,)
    fatigue: MaterialFatigue | None  # None: no stress is known

    @property
    def rms(self) -> Floats:
        """Return the RMS of cross-flow and in-line motion over the diameter, (2, places)."""
        return np.asarray(self.motion.std(axis=1))

    @property
    def growth(self) -> float:
        """Return the cross-flow RMS of all places in the second half over that in the first.

        1: settled; else it still builds up or fades, or swells slowly. NaN: nothing moved at first.
        """
        middle = len(self.time_s) // 2
        early_rms, late_rms = (
            float(np.sqrt(part.var(axis=0).mean()))
            for part in (self.motion[0, :middle], self.motion[0, middle:])
        )
        return late_rms / early_rms if early_rms > 0.0 else float("nan")

    @property
    def in_line(self) -> bool:
        """Return whether its model has in-line motion."""
        return bool(np.isfinite(self.motion[1]).all())

    @property
    def frequency_hz(self) -> Floats:
        """Return Rice's (1944) mean frequency of both directions, 0 without motion, (2, places)."""
        rise = np.diff(self.motion, axis=1).std(axis=1)
        total = (self.motion[:, 1:] + self.motion[:, :-1]).std(axis=1)
        moves = total > 1e-9
        angle = np.arctan(rise / np.where(moves, total, 1.0))
        return np.where(moves, angle / (np.pi * self.every_s), 0.0)

    @property
    def damage_per_year(self) -> Floats:
        """Return Miner's sum per year of such a run; NaN where no stress is known, (places,)."""
        if self.fatigue is None:
            return np.full(len(self.from_hang_off_m), np.nan)
        distance_m, damage = self.fatigue.from_hang_off_m[::-1], self.fatigue.used[::-1]
        return np.interp(self.from_hang_off_m, distance_m, damage) * YEAR_S / self.fatigue.counted_s

    @property
    def vandiver(self) -> Floats:
        """Return the drag amplification of such a motion by Vandiver (1983), (places,)."""
        return amplified_drag(self.rms[0])

    def spectra(self) -> tuple[Floats, Floats]:
        """Return frequencies [Hz] and cross-flow power [d²/Hz], (frequencies, places)."""
        from scipy.signal import welch

        length = max(16, len(self.time_s) // 2)
        spectra: tuple[Floats, Floats] = welch(
            self.motion[0], fs=1.0 / self.every_s, nperseg=length, axis=0
        )
        return spectra

    @property
    def spectrum(self) -> Spectrum:
        """Return the cross-flow spectrum of all places together."""
        from scipy.signal import welch

        length = min(len(self.time_s), round(SPECTRUM_S / self.every_s))
        frequency, power = welch(self.motion[0], fs=1.0 / self.every_s, nperseg=length, axis=0)
        frequency, power = frequency[1:], power[1:].mean(axis=1)
        total = power.sum() or 1.0
        centre = float((power * frequency).sum() / total)
        width = float(np.sqrt((power * (frequency - centre) ** 2).sum() / total))
        return Spectrum(centre, width)

    @property
    def size(self) -> tuple[Floats, Floats]:
        """Return times [s] and cross-flow RMS of all places over WINDOW_S around them."""
        count = min(max(1, round(WINDOW_S / self.every_s)), len(self.time_s))
        motion = self.motion[0] - self.motion[0].mean(axis=0)
        window = np.full(count, 1.0 / count)
        mean = np.convolve((motion**2).mean(axis=1), window, "valid")
        return np.convolve(self.time_s, window, "valid"), np.sqrt(np.maximum(mean, 0.0))

    @property
    def modulation(self) -> float:
        """Return the standard deviation of `size` over its mean; 0 without motion."""
        size = self.size[1]
        return float(size.std() / (size.mean() or 1.0))


def with_model(scene: Scene, strouhal: float | None = None, damping: float | None = None) -> Scene:
    """Return the scene with the VIV model that it lists, else with the modal one.

    strouhal, damping: Strouhal number and structural damping ratio of the modal model; None: as
    the scene has them.

    Raises:
        InputError: a value is given, and the scene lists another model.
    """
    is_adjusted = strouhal is not None or damping is not None
    listed, model = scene.listed(ModalVibrationParams), shedding_model(scene)
    if model and listed is None and is_adjusted:
        problem = f"the scene's own {model} is not the modal model"
        raise InputError("--strouhal, --damping", problem, "leave them out")
    if model and not is_adjusted:
        return scene
    params = listed or ModalVibrationParams()
    params = replace(
        params,
        strouhal=params.strouhal if strouhal is None else strouhal,
        damping_fraction=params.damping_fraction if damping is None else damping,
    )
    others = tuple(effect for effect in scene.effects if effect is not listed)
    return with_effect(replace(scene, effects=others), params)


@dataclass
class _SampledLine:
    """One line of a run while it is sampled."""

    line: RopeLine
    hz: float  # of its fastest vortices
    sampler: Sampler
    damage: RopeDamage | None  # None: part of it is neither solid steel nor a pipe
    seen: list[tuple[float, float, Sample]]  # time, top tension
    marks: tuple[float, float] = (0.0, 0.0)  # material coordinates of its ends, upper one first

    def take(self, snapshot: Snapshot, counts: bool) -> None:
        """Take an instant; counts: whether it belongs to the steady part."""
        rope = self.sampler.rope
        pull_n = (
            snapshot.ropes[rope.number].tension_top_n if snapshot.ropes else snapshot.tension_top_n
        )
        self.seen.append((snapshot.time_s, pull_n, self.sampler.sample()))
        if not counts:
            return
        places = rope.places
        self.marks = float(places[0]), float(places[-1])
        if self.damage is not None:
            self.damage.take(rope.now, pull_n, self.sampler.bent(self.damage.middles))

    def result(self, scene: Scene, from_s: float, until_s: float) -> TimeDomainRun:
        """Return the results between two times."""
        top, low = self.marks
        length_m = abs(top - low)
        from_top, marks = np.linspace(0.0, length_m, PLACES), np.linspace(top, low, PLACES)
        EI = bending_stiffness(self.sampler.rope.now.effects)
        diameter, radius, stiff = _figures(self.line, marks, EI)
        seen_s, seen_n, samples = zip(*self.seen, strict=True)
        parts = (np.array(part) for part in zip(*samples, strict=True))
        times, pulls, displacement, *others = resampled(np.array(seen_s), np.array(seen_n), *parts)
        every_s = float(times[-1] - times[0]) / (len(times) - 1)
        motion = displacement.transpose(1, 0, 2) / diameter
        if self.sampler.has_slow_parts:
            motion = _fast(motion, self.hz, every_s)
        steady = (from_s <= times) & (times <= until_s)
        across, amplified, curvature = (part[steady] for part in others)
        curvature_rms = _worst_rms(curvature)
        fatigue = None
        if self.damage is not None:
            fatigue = self.damage.snapshot(length_m, float(steady.sum() * every_s))
            if low > top:  # the core counts from the upper end
                fatigue = _upside_down(fatigue, length_m)
        return TimeDomainRun(
            scene.name, self.line.name, shedding_model(scene), self.hz, every_s, from_top,
            times[steady], motion[:, steady], pulls[steady], _amplification(across, amplified),
            radius * curvature_rms, stiff * curvature_rms, fatigue,
        )  # fmt: skip


def _upside_down(fatigue: MaterialFatigue, length_m: float) -> MaterialFatigue:
    """Return the damage of a line whose upper end is the core's first node, from its lower end."""
    from_upper_m = fatigue.from_lower_end_m[::-1]
    return replace(
        fatigue,
        from_lower_end_m=length_m - from_upper_m,
        from_hang_off_m=from_upper_m,
        used=fatigue.used[::-1],
    )


def run_time_domain(scene: Scene, duration_s: float, curve: str) -> list[TimeDomainRun]:
    """Run a scene from static equilibrium with its regular heave and winch schedules.

    The second half counts. A scene without a VIV model gets the modal one.
    curve: name of an S-N curve of stress.

    Returns:
        The result of each line, in the order of the scene.

    Raises:
        SceneError: it has no flow, or cannot be built.
        InputError: the run is too short, its sea is neither still nor a regular heave, or its winch
            has other commands than speeds.
        SolverError: the twin's next state would not be finite.
    """
    scene = with_model(scene)
    own_hz = expected_hz(scene)
    hz = max(own_hz)
    refuse_short(duration_s, hz)
    heave, speeds = regular_motion(scene)
    twin = Twin(scene)
    lines = [
        _SampledLine(line, line_hz or hz, sampler, _new_damage(scene, line, sampler, curve), [])
        for line, line_hz, sampler in zip(scene.ropes, own_hz, samplers_of(twin, hz), strict=True)
    ]
    first = lines[0].sampler
    around_s = AROUND_PERIODS / hz if first.has_slow_parts else 0.0
    from_s = STEADY * duration_s
    for snapshot in advance_by(twin, heave, duration_s + around_s, speeds, first.steps):
        if snapshot.time_s >= from_s - around_s:
            for sampled_line in lines:
                sampled_line.take(snapshot, from_s <= snapshot.time_s <= duration_s)
    return [sampled_line.result(scene, from_s, duration_s) for sampled_line in lines]


def refuse_short(duration_s: float, vortices_hz: float) -> None:
    """Reject a run whose evaluated part is shorter than MIN_PERIODS.

    Raises:
        InputError: the run is too short.
    """
    min_s = MIN_PERIODS / (vortices_hz * (1.0 - STEADY))
    if duration_s < min_s:
        problem = f"{duration_s:g} s are too short for vortices of {vortices_hz:.3g} Hz"
        raise InputError("--duration", problem, f"give {math.ceil(min_s)} or more")


def expected_hz(scene: Scene) -> list[float]:
    """Return the frequency of the fastest vortices of each line [Hz], 0 without flow.

    Raises:
        SceneError: there are none.
    """
    scenes = [scene]
    if is_joined(scene):
        tops = first_places(scene)
        # each line with its upper end in its place, approximately
        ships = [
            replace(scene.ship, hang_off_m=tuple(tops[line.from_].tolist())) for line in scene.ropes
        ]
        scenes = [replace(alone(scene, number), ship=ship) for number, ship in enumerate(ships)]
    paces = [expected_pace(line_scene, lift_figures(line_scene)) for line_scene in scenes]
    if not any(paces):
        problem = "nothing flows, so no vortices"
        raise SceneError(f"{scene.path}: effects", problem, "give 'current' a speed")
    return [0.0 if pace is None else pace.frequency_hz for pace in paces]


def _figures(line: RopeLine, marks: Floats, EI: float) -> tuple[Floats, Floats, Floats]:
    """Return hydrodynamic diameter and d/2 [m], and E·d/2 [Pa·m] at places; NaN: not solid steel.

    A coating makes the hydrodynamic diameter larger than d.
    """
    ropes = [section.rope for section in line.made_of]
    index = np.minimum(np.searchsorted(ends_m(line), marks, side="right"), len(ropes) - 1)
    diameter = np.array([rope.hydrodynamic_diameter_m for rope in ropes])
    radius = np.array([0.5 * rope.diameter_m for rope in ropes])
    stiff = radius * [rope.tangent_n(0.0) / metal_area(rope, EI) for rope in ropes]
    return diameter[index], radius[index], stiff[index]


def _new_damage(scene: Scene, line: RopeLine, sampler: Sampler, curve: str) -> RopeDamage | None:
    """Return the fatigue counter, or None if part of the rope is neither solid steel nor a pipe."""
    EI = bending_stiffness(sampler.rope.now.effects)
    if any(np.isnan(metal_area(section.rope, EI)) for section in line.made_of):
        return None
    winch = winch_of(scene, line)
    max_line_m = winch.max_line_out_m if winch else line.length_m
    return RopeDamage(line, ends_m(line), max_line_m, DamageSettings(curve, True), EI)


def _fast(motion: Floats, hz: float, every_s: float) -> Floats:
    """Return motion without slow components (ship, winch); (sides, times, places)."""
    from scipy.signal import butter, sosfiltfilt

    mean = motion.mean(axis=1, keepdims=True)
    filtered = sosfiltfilt(
        butter(2, CUT_OFF * hz, "highpass", fs=1.0 / every_s, output="sos"), motion - mean, axis=1
    )
    return np.asarray(filtered)


def _amplification(across: Floats, amplified: Floats) -> Floats:
    """Return mean drag over that of the mean velocity, 1 without flow, (places,).

    across: (times, 3, places); amplified: drag amplification of the model, (times, places).
    """
    speed = np.sqrt((across * across).sum(axis=1, keepdims=True))
    drag, mean = (amplified[:, None] * speed * across).mean(axis=0), across.mean(axis=0)
    speed_squared = (mean * mean).sum(axis=0)
    flows = speed_squared > 1e-12
    vibrating = (drag * mean).sum(axis=0) / np.sqrt(np.where(flows, speed_squared, 1.0))
    return np.where(flows, vibrating / np.where(flows, speed_squared, 1.0), 1.0)


def _worst_rms(curvature: Floats) -> Floats:
    """Return the largest standard deviation of vectors (times, 2, places) over direction,
    (places,).
    """
    deviation = curvature - curvature.mean(axis=0)
    xx, yy = (deviation * deviation).mean(axis=0)
    xy = (deviation[:, 0] * deviation[:, 1]).mean(axis=0)
    return np.asarray(np.sqrt(0.5 * (xx + yy + np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy))))


def regular_motion(scene: Scene) -> tuple[Motion, Speeds]:
    """Return heave over time and the winches' speeds.

    Raises:
        InputError: the sea is neither still nor a regular heave, or a winch has other commands.
    """
    sea = scene.sea_state
    if sea.moves and sea.heave is None:
        remedy = "give `sea_state: {heave: {amplitude_m: 1.5, period_s: 8.0}}`"
        raise InputError(f"scene {scene.name}", "its sea is not a regular heave", remedy)
    heave = RegularSea(sea.heave, sea.start_s).at if sea.heave is not None else still
    speeds = []
    for name, winch in winches_by_name(scene).items():
        for row in winch.schedule:
            if row.speed_m_per_s is None:
                problem = f"at {row.at_s:g} s its winch gets another command than a speed"
                raise InputError(f"scene {scene.name}", problem, "give speed_m_per_s there")
            speeds.append((row.at_s, row.speed_m_per_s, name))
    return heave, sorted(speeds)
