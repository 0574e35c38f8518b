"""Heave evaluated for many steps at once: the bits of the running track, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rope_twin.core.interpolation import Times
from rope_twin.core.state import MOTIONS, Boundary, Z
from rope_twin.errors import InputError
from rope_twin.twin.motion.heave_track import HeaveSeries, HeaveTrack

Sample = tuple[int, float, float]


@st.composite
def seas(draw: st.DrawFn) -> list[Sample]:
    """Any motion that a ship can make, sampled unevenly; it begins before 0."""
    stamp, z = draw(st.integers(-400_000_000, -1)), draw(st.floats(-5.0, 5.0))
    samples = []
    for _ in range(draw(st.integers(3, 40))):
        samples.append((stamp, z, draw(st.floats(-15.0, 15.0))))
        gap = draw(st.integers(1, 500_000_000))
        z += draw(st.floats(-1.0, 1.0)) * (14.0 * gap * 1e-9)
        z = min(max(z, -29.0), 29.0)
        stamp += gap
    return samples


@settings(max_examples=150, deadline=None)
@given(samples=seas(), start_ns=st.integers(0, 10**9), step_ns=st.integers(10**6, 10**8))
def test_it_is_the_track_to_the_bit(samples: list[Sample], start_ns: int, step_ns: int) -> None:
    """From wherever it starts."""
    series = HeaveSeries.of(samples).starting_at(start_ns)
    times = np.arange(0, series.end_ns + 1, step_ns)
    if not len(times):
        return
    boundary = Boundary(*np.zeros((2, len(times) + 1, MOTIONS)))
    series.move(boundary, Times(times, np.ones(len(times)), np.zeros(len(times))))
    z, v = (table[1:, Z] for table in boundary)
    track = HeaveTrack()
    for stamp, position, velocity in samples:
        assert not track.submit(stamp - start_ns, position, velocity)
    one_by_one = np.array([track.at(int(time_ns)) for time_ns in times])
    assert z.tobytes() == one_by_one[:, 0].tobytes()
    assert v.tobytes() == one_by_one[:, 1].tobytes()


def wave(seconds: float) -> list[Sample]:
    """2 m, 8 s, a sample each 0.1 s."""
    w = math.tau / 8.0
    return [
        (k * 10**8, 2.0 * math.sin(w * k / 10), 2.0 * w * math.cos(w * k / 10))
        for k in range(round(10 * seconds))
    ]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({5: (400_000_000, 0.0, 0.0)}, "the stamp 0.400 s is not after the one before it"),
        ({5: (500_000_000, math.nan, 0.0)}, "position nan m, velocity 0 m/s at sample 5"),
        ({5: (500_000_000, 0.0, -20.0)}, "a ship stays within ±30 m and ±15 m/s"),
        ({5: (500_000_000, 25.0, 0.0)}, "it jumps by 24.38 m at 0.40 s; a ship moves by at most"),
        (dict.fromkeys(range(5, 12)), "0.80 s without a sample after 0.40 s; an ensemble"),
        (dict.fromkeys(range(1, 50)), "give three of one length, 2 or more"),
    ],
)
def test_what_no_ship_does_is_refused(wrong: dict[int, Sample | None], words: str) -> None:
    samples = [wrong.get(k, sample) for k, sample in enumerate(wave(5.0))]
    with pytest.raises(InputError) as refused:
        HeaveSeries.of([sample for sample in samples if sample is not None])
    assert words in str(refused.value)


def test_it_tells_where_it_ends() -> None:
    series = HeaveSeries.of(wave(5.0)).starting_at(10**9)
    times = Times(np.array([3 * 10**9, 4 * 10**9]), np.ones(2), np.zeros(2))
    boundary = Boundary(*np.zeros((2, 3, MOTIONS)))
    with pytest.raises(InputError, match=r"samples from -1 s to 3\.9 s, wanted from 3 s to"):
        series.move(boundary, times)


def test_a_track_gives_the_same_however_early_it_is_fed() -> None:
    """Also at the samples themselves, where the next piece may or may not be known yet."""
    early, late = HeaveTrack(), HeaveTrack()
    samples = wave(20.0)
    for sample in samples:
        assert not early.submit(*sample)
    assert not late.submit(*samples[0])
    for sample in samples[1:]:
        assert not late.submit(*sample)
        for time_ns in range(sample[0] - 80_000_000, sample[0] + 1, 20_000_000):
            assert late.at(time_ns) == early.at(time_ns)
