"""Travelling waves of [LCD] (Le Cunff and Durand 1999) on their riser and cable, by the twin."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.studies.picture import Field, Panel, Vector
from validation.case import Finding, between, shown, within_pct
from validation.published_ropes import DENSITY, GRAVITY, LCD_CABLE, LCD_RISER, PublishedRope
from validation.rigs import Rig
from validation.state_bench import Bench

PROFILE = ((0.0, (1.5, 0.0)), (-50.0, (1.5, 0.0)), (-300.0, (0.2, 0.0)), (-310.0, (0.2, 0.0)))
RISER_EA, CABLE_EA = 1.171e9, 2e7  # N; the cable's is not printed and enters the shape alone
VARIANTS = (
    ("amplitude over half a period", TravellingWavesParams(periods=0.5)),
    ("over four periods", TravellingWavesParams(periods=4.0)),
    ("each node its own frequency", TravellingWavesParams(by_half_waves=False)),
)
KEPT = (
    "Waves: the paper leaves open damping, phase and how |A| is averaged. Kept: structural damping "
    "alone, one frequency for each half wave (its upper end's), |A| = √2·rms(y')/ω over one "
    "period, solved in the stage. Peaks are half waves of the motion in an instant, the median."
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
        at = int(np.where(slow, power, 0.0).argmax())
        return float(frequency[at]), float(power[slow].sum() / power.sum())


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


def wave_run(own: Rig, params: TravellingWavesParams, duration: float) -> WaveRun:
    """Run the twin's core for a time; the second half is recorded."""
    scene = own.scene()
    bench = Bench(replace(scene, effects=(*scene.effects, params)))
    count = round(duration / own.step)
    bench.hold(count // 2)
    motion = np.zeros((count // 2, own.elements + 1))
    for row in range(len(motion)):
        bench.hold(1)
        motion[row] = bench.position[1] / own.diameter
    began = time.process_time()
    bench.hold(count // 4)
    spent = time.process_time() - began
    return WaveRun(own.step, motion, (count // 4) * own.step / spent)


def waves_of_riser(duration: float = 200.0) -> tuple[list[Finding], Panel, str]:
    """Run L1 by waves: values, a picture, and the variants."""
    own = rig(LCD_RISER, RISER_EA, 150, 0.025)
    run = wave_run(own, TravellingWavesParams(), duration)
    findings = [
        within_pct("waves: dominant frequency", run.dominant_hz, 1.02, 1.0, "Hz"),
        between("waves: peaks", run.peaks, (7.0, 7.0), "7"),
        shown("waves: largest rms/d", float(run.rms.max()), "0.401"),
        shown("waves: speed on one core", run.factor, "100 or more", "× real time"),
    ]
    return findings, _panel(run, LCD_RISER, 12.0), _told(own, duration)


def waves_of_cable(duration: float = 48.0) -> tuple[list[Finding], Panel, str]:
    """Run L2 by waves; frequency and slow motion."""
    own = rig(LCD_CABLE, CABLE_EA, 300, 0.004)
    run = wave_run(own, TravellingWavesParams(), duration)
    slow, part = run.slow_hz(1.0)
    findings = [
        shown("waves: dominant frequency", run.dominant_hz, "not printed", "Hz"),
        shown("waves: slow motion, strongest at", slow, "about 0.33", "Hz"),
        shown("waves: share of the power that is slow", part, "not printed"),
        shown("waves: largest rms/d", float(run.rms.max()), "0.166"),
        shown("waves: speed on one core", run.factor, "100 or more", "× real time"),
    ]
    return findings, _panel(run, LCD_CABLE, 1.0), _told(own, 0.5 * duration)


def _told(own: Rig, duration: float) -> str:
    words = []
    for name, params in VARIANTS:
        run = wave_run(own, params, duration)
        words.append(
            f"{name}: {run.dominant_hz:.3g} Hz, {run.peaks:g} peaks, rms/d {run.rms.max():.3f}"
        )
    return f"{KEPT} Tried: {'; '.join(words)}."


def _panel(run: WaveRun, rope: PublishedRope, lasting: float) -> Panel:
    last = run.motion[-max(2, int(lasting / run.step)) :]
    field = Field(last.T, (0.0, lasting), (0.0, rope.length), "y/d")
    return Panel("travelling waves: motion", "time [s]", "height [m]", field=field)
