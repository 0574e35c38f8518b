"""Travelling waves of [LCD] (Le Cunff and Durand 1999) on their riser and cable, by the twin."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_banded

from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.studies.picture import Field, Panel, Vector
from rope_twin.vortex.line_model import Span
from validation.case import Finding, between, shown, within_pct
from validation.published_ropes import (
    DENSITY,
    GRAVITY,
    LCD_CABLE,
    LCD_RISER,
    PublishedRope,
    lcd_current,
)
from validation.rigs import Rig
from validation.state_bench import Bench

PROFILE = ((0.0, (1.5, 0.0)), (-50.0, (1.5, 0.0)), (-300.0, (0.2, 0.0)), (-310.0, (0.2, 0.0)))
RISER_EA, CABLE_EA = 1.171e9, 2e7  # N; the cable's is not printed and enters the shape alone
VARIANTS = (
    ("initial phase of a travelling wave", TravellingWavesParams(initial_phase="travelling")),
    ("damping ratio 1.5 %", TravellingWavesParams(damping_fraction=0.015)),
    ("amplitude over half a period", TravellingWavesParams(periods=0.5)),
    ("over four periods", TravellingWavesParams(periods=4.0)),
    ("each node its own frequency", TravellingWavesParams(by_half_waves=False)),
)
KEPT = (
    "Waves: the paper leaves open damping and how |A| is found. Kept: structural damping alone "
    "(1.5 % as a loss factor, as for the modes), the printed initial phase of a standing wave, one "
    "frequency for each half wave (the largest on it, so its upper end's), |A| = √2·rms(y')/ω over "
    "one period, solved in the stage. Peaks are half waves of the motion in an instant, the median."
)

SLOW = (
    "A slow motion as strong as the paper's appears where y is solved for in complex numbers and "
    "|A| is its modulus (rows `complex y`, a line of its own beside the twin): through |y| the "
    "lift then feeds motions that turn against it, in the lowest modes (0.36, 0.73, 1.09 Hz). "
    "Which of them wins depends on step and mesh. The real equation, as the twin has it, does not "
    "feed them."
)


@dataclass(frozen=True)
class WaveRun:
    """Steady half of a run of the twin."""

    step: float
    motion: Vector  # across over the diameter, (times, nodes) from the lower end up
    factor: float  # times real time, by time spent computing

    @property
    def rms(self) -> Vector:
        """Return the RMS of the motion at the nodes."""
        return np.asarray(self.motion.std(axis=0))

    @property
    def spectrum(self) -> tuple[Vector, Vector]:
        """Return frequencies [Hz] and power of all nodes together."""
        moved = (self.motion - self.motion.mean(axis=0)) * np.hanning(len(self.motion))[:, None]
        power = (np.abs(np.fft.rfft(moved, axis=0)) ** 2).sum(axis=1)
        frequency: Vector = np.asarray(np.fft.rfftfreq(len(moved), self.step), dtype=np.float64)
        return frequency, np.asarray(power)

    @property
    def dominant_hz(self) -> float:
        """Return the frequency of most power [Hz]."""
        frequency, power = self.spectrum
        return float(frequency[power.argmax()])

    @property
    def peaks(self) -> float:
        """Return the median number of half waves along the rope."""
        inner = self.motion[:, 1:-1]
        return float(np.median((inner[:, 1:] * inner[:, :-1] < 0.0).sum(axis=1) + 1))

    def slow_hz(self, below: float) -> tuple[float, float]:
        """Return the dominant frequency of the slow motion, and its share of the power."""
        frequency, power = self.spectrum
        slow = (frequency > 0.1) & (frequency < below)
        peak = int(np.where(slow, power, 0.0).argmax())
        return float(frequency[peak]), float(power[slow].sum() / power.sum())


def rig(rope: PublishedRope, EA: float, elements: int, step: float) -> Rig:
    """Return the upright rope between its fixed ends, stretched to its length at its tension."""
    weight = (rope.mass - DENSITY * 0.25 * np.pi * rope.diameter**2) * GRAVITY
    mean = rope.top_tension - 0.5 * weight * rope.length
    return Rig(
        length=rope.length / (1.0 + mean / EA), elements=elements, mass=rope.mass, EA=EA,
        diameter=rope.diameter, density=DENSITY, fixed_at=(0.0, 0.0, -rope.length),
        current=PROFILE, added_mass=rope.added_mass, EI=rope.stiffness or None, step=step,
        tolerance=1.0,
    )  # fmt: skip


def wave_run(line_rig: Rig, params: TravellingWavesParams, duration: float) -> WaveRun:
    """Run the twin's core for a time; the second half is recorded."""
    scene = line_rig.scene()
    bench = Bench(replace(scene, effects=(*scene.effects, params)))
    count = round(duration / line_rig.step)
    bench.hold(count // 2)
    motion = np.zeros((count // 2, line_rig.elements + 1))
    for row in range(len(motion)):
        bench.hold(1)
        motion[row] = bench.position[1] / line_rig.diameter
    began = time.process_time()
    bench.hold(count // 4)
    spent = time.process_time() - began
    return WaveRun(line_rig.step, motion, (count // 4) * line_rig.step / spent)


def waves_of_riser(duration: float = 200.0) -> tuple[list[Finding], Panel, str]:
    """Run L1 by waves: values, a picture, and the variants."""
    line_rig = rig(LCD_RISER, RISER_EA, 150, 0.025)
    run = wave_run(line_rig, TravellingWavesParams(), duration)
    findings = [
        within_pct("waves: dominant frequency", run.dominant_hz, 1.02, 1.0, "Hz"),
        between("waves: peaks", run.peaks, (7.0, 7.0), "7"),
        shown("waves: largest rms/d", float(run.rms.max()), "0.401"),
        shown("waves: speed on one core", run.factor, "100 or more", "× real time"),
    ]
    return findings, _panel(run, LCD_RISER, 12.0), _note(line_rig, duration)


def waves_of_cable(duration: float = 48.0) -> tuple[list[Finding], Panel, str]:
    """Run L2 by waves; frequency and slow motion."""
    line_rig = rig(LCD_CABLE, CABLE_EA, 300, 0.004)
    run = wave_run(line_rig, TravellingWavesParams(), duration)
    slow, part = run.slow_hz(1.0)
    steps = (0.004, 0.002)
    by_modulus = [complex_waves(0.5 * duration, step).slow_hz(1.0) for step in steps]
    findings = [
        shown("waves: dominant frequency", run.dominant_hz, "not printed", "Hz"),
        shown("waves: slow motion, strongest at", slow, "about 0.33", "Hz"),
        shown("waves: share of the power that is slow", part, "not printed"),
        *(
            finding
            for step, (hz, power) in zip(steps, by_modulus, strict=True)
            for finding in (
                shown(f"complex y, {1e3 * step:g} ms: slow motion at", hz, "about 0.33", "Hz"),
                shown(f"complex y, {1e3 * step:g} ms: share that is slow", power, "not printed"),
            )
        ),
        shown("waves: largest rms/d", float(run.rms.max()), "0.166"),
        shown("waves: speed on one core", run.factor, "100 or more", "× real time"),
    ]
    return findings, _panel(run, LCD_CABLE, 1.0), f"{_note(line_rig, 0.5 * duration)} {SLOW}"


def complex_waves(duration: float, step: float = 0.002, nodes: int = 301) -> WaveRun:
    """Return the cable's motion where y is complex and |A| is its modulus.

    Straight taut line, force L·(C0 - C1·|Y|/d)·e^(i(ωt + φ)), trapezoidal rule, |Y| iterated to the
    end of the step; the real part over the second half.
    """
    cable, params = LCD_CABLE, TravellingWavesParams()
    speed = lcd_current(nodes)
    span = cable.span(speed)
    length = span.node_length
    omega, phase = _half_waves(2.0 * np.pi * params.strouhal * speed / cable.diameter, span)
    mass, damping = (
        cable.moved * length,
        2.0 * params.damping_fraction * cable.moved * length * omega,
    )
    lift = 0.5 * DENSITY * cable.diameter * speed**2 * length
    tie = span.tension / np.diff(span.s)
    inner = slice(1, -1)
    bands = np.zeros((3, nodes - 2))
    bands[0, 1:] = bands[2, :-1] = -tie[1:-1]
    bands[1] = tie[1:] + tie[:-1] + (4.0 * mass / step**2 + 2.0 * damping / step)[inner]
    y, rate, push = np.zeros((3, nodes), dtype=complex)
    count = round(duration / step)
    motion = np.zeros((count // 2, nodes))
    for row in range(count):
        time_s = (row + 1) * step
        turn = min(time_s / params.ramp_s, 1.0) * np.exp(1j * (omega * time_s + phase))
        known = mass * (4.0 * y / step**2 + 4.0 * rate / step + push) + damping * 2.0 * y / step
        known += damping * rate
        new = y
        for _ in range(3):
            force = lift * (params.lift[0] - params.lift[1] * np.abs(new) / cable.diameter) * turn
            new = np.zeros_like(y)
            new[inner] = solve_banded((1, 1), bands, (known + force)[inner])
        moved = 2.0 * (new - y) / step - rate
        push = 2.0 * (moved - rate) / step - push
        y, rate = new, moved
        if row >= count - len(motion):
            motion[row - count + len(motion)] = y.real / cable.diameter
    return WaveRun(step, motion, 0.0)


def _half_waves(pace: Vector, span: Span) -> tuple[Vector, Vector]:
    """Return ω of each half wave, from the upper end down, and its phase: 0 and π in turn."""
    slowness = np.sqrt(span.mass / span.tension)
    omega, phase, turned, pace_here, sign = pace.copy(), np.zeros(len(pace)), 0.0, pace[-1], 0
    for i in range(len(pace) - 1, -1, -1):
        if turned >= np.pi:
            turned, pace_here, sign = turned - np.pi, pace[i], 1 - sign
        omega[i], phase[i] = pace_here, np.pi * sign
        turned += pace_here * slowness[i - 1] * (span.s[i] - span.s[i - 1]) if i else 0.0
    return omega, phase


def _note(line_rig: Rig, duration: float) -> str:
    trials = []
    for name, params in VARIANTS:
        run = wave_run(line_rig, params, duration)
        trials.append(
            f"{name}: {run.dominant_hz:.3g} Hz, {run.peaks:g} peaks, rms/d {run.rms.max():.3f}"
        )
    return f"{KEPT} Tried: {'; '.join(trials)}."


def _panel(run: WaveRun, rope: PublishedRope, lasting: float) -> Panel:
    last = run.motion[-max(2, int(lasting / run.step)) :]
    field = Field(last.T, (0.0, lasting), (0.0, rope.length), "y/d")
    return Panel("travelling waves: motion", "time [s]", "height [m]", field=field)
