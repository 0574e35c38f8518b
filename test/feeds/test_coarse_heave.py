"""A motion sensor that rounds or has noise, and the rope below: with and without a fit."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from feed_samples import settings

from rope_twin import Twin, load_scene
from rope_twin.core.state import Floats
from rope_twin.feeds.instrument import MotionSample
from rope_twin.feeds.motion_track import HeaveOutput, MotionTrack

SECONDS, SLOT_S, AHEAD_S = 100.0, 0.02, 2.0
SETTLED = slice(round(20.0 / SLOT_S), None)
OMEGA = np.array([0.5, 0.62, 0.75, 0.9, 1.1, 1.4])
AMPLITUDE_M = np.array([0.25, 0.35, 0.3, 0.2, 0.1, 0.04])
PHASE = np.random.default_rng(4).uniform(0.0, 2.0 * math.pi, len(OMEGA))


def sensor(rate_hz: float, digit_m: float, noise_m: float, fit_samples: int) -> list[HeaveOutput]:
    """Heave of six waves as a sensor without a rate reports it, through a feed."""
    track = MotionTrack(settings("tss1", fit_samples=fit_samples))
    times = np.arange(round((SECONDS + AHEAD_S) * rate_hz)) / rate_hz
    heave = (AMPLITUDE_M * np.sin(np.outer(times, OMEGA) + PHASE)).sum(axis=1)
    heave = heave + noise_m * np.random.default_rng(7).standard_normal(len(times))
    if digit_m:
        heave = np.round(heave / digit_m) * digit_m
    unknown = (math.nan,) * 4
    samples = (
        MotionSample(round(t * 1e9), z, *unknown)
        for t, z in zip(times, heave.tolist(), strict=True)
    )
    outputs = [output for sample in samples for output in track.take(sample)]
    assert all(isinstance(output, HeaveOutput) for output in outputs)
    return [output for output in outputs if isinstance(output, HeaveOutput)]


@cache
def top_tension_n(rate_hz: float, digit_m: float, noise_m: float, fit_samples: int) -> Floats:
    """Top tension of `shallow_lift` with that heave, each 20 ms."""
    twin = Twin(load_scene("shallow_lift"))
    twin.prescribe_motion()
    waiting = iter(sensor(rate_hz, digit_m, noise_m, fit_samples))
    newest_ns, tension = -1, []
    for slot in range(round(SECONDS / SLOT_S)):
        while newest_ns < ((slot + 1) * SLOT_S + 0.5 * AHEAD_S) * 1e9:
            motion = next(waiting)
            twin.submit_heave(motion.stamp_ns, motion.heave_m, motion.heave_rate_m_per_s)
            newest_ns = motion.stamp_ns
        twin.advance(round(SLOT_S / twin.step_s))
        tension.append(twin.snapshot().tension_top_n)
    return np.array(tension)[SETTLED]


@pytest.mark.long
@pytest.mark.parametrize(
    ("rate_hz", "digit_m", "noise_m", "fit_samples", "gain"),
    [(10.0, 0.01, 0.0, 7, 1.0), (50.0, 0.01, 0.0, 25, 4.0), (100.0, 0.01, 0.0, 51, 10.0),
     (50.0, 0.0, 0.005, 25, 4.0)],
)  # fmt: skip
def test_a_fit_takes_rounding_and_noise_from_the_tension(
    rate_hz: float, digit_m: float, noise_m: float, fit_samples: int, gain: float
) -> None:
    """RMS error of the top tension with and without a fit of 0.5 s, against exact heave."""
    exact = top_tension_n(50.0, 0.0, 0.0, 3)
    raw, fitted = (
        (top_tension_n(rate_hz, digit_m, noise_m, count) - exact).std() / exact.std()
        for count in (3, fit_samples)
    )
    print(f"{rate_hz:g} Hz: {raw:.1%} without a fit, {fitted:.1%} with one")
    assert fitted < raw / gain
    assert fitted < 0.15


@pytest.mark.long
def test_a_fit_keeps_the_tension_of_exact_heave() -> None:
    """The shortest wave, of 4.5 s, keeps all but 1e-4 of its height in a fit of 0.5 s."""
    exact, fitted = (top_tension_n(50.0, 0.0, 0.0, count) for count in (3, 25))
    assert (fitted - exact).std() < 2e-3 * exact.std()
