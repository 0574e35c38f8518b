"""Any stream of heave samples is rejected with a reason or used; every number stays finite."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_scene import not_finite, small_scene

from rope_twin.scene.schema import Scene
from rope_twin.twin.motion.hang_off import HangOffTrack
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.twin import Twin

LIMIT_M = 100.0  # no motion of the hang-off may come near this


@dataclass(frozen=True)
class Sample:
    """A sample relative to the clock: stamp now + `after_ms`; then the twin steps on."""

    after_ms: int
    position_m: float
    velocity_m_per_s: float
    steps: int


finite = st.floats(-40.0, 40.0)
anything = st.one_of(finite, st.floats(), st.sampled_from([math.nan, math.inf, -math.inf, 1e308]))
plausible = st.builds(
    Sample, st.integers(0, 300), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.integers(0, 30)
)
wild = st.builds(
    Sample,
    st.one_of(st.integers(-2000, 3000), st.sampled_from([0, -(10**12), 10**12])),
    anything,
    anything,
    st.integers(0, 120),
)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """The small scene, read once."""
    with tempfile.TemporaryDirectory() as folder:
        return small_scene(Path(folder))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(samples=st.lists(st.one_of(plausible, plausible, wild), max_size=40))
def test_results_stay_finite_for_any_heave_sample(scene: Scene, samples: list[Sample]) -> None:
    """Missing, repeated, late, early, not finite or absurd samples are counted and rejected."""
    twin = Twin(scene)
    refused = 0
    for sample in samples:
        stamp_ns = twin.time_ns + sample.after_ms * 1_000_000
        message = twin.submit_heave(stamp_ns, sample.position_m, sample.velocity_m_per_s)
        assert "\n" not in message
        refused += bool(message)
        twin.advance(sample.steps)
        snapshot = twin.snapshot()
        assert not not_finite(snapshot)
        assert abs(snapshot.heave_m) < LIMIT_M
    health = twin.snapshot().inputs["heave"]
    assert health.refused == refused
    assert health.accepted == len(samples) - refused
    twin.advance(100)
    assert not not_finite(twin.snapshot())


faults = st.fixed_dictionaries(
    {
        "lasts": st.integers(1, 60),  # samples
        "jump_m": st.sampled_from([0.0, 0.0, 0.5, 5.0, 12.0]),
        "position_times": st.sampled_from([1.0, 1.0, -1.0, 3.0]),
        "rate_times": st.sampled_from([1.0, 1.0, -1.0, 10.0, 100.0]),
        "kept_of_40": st.sampled_from([40, 40, 20, 1, 0]),
        "ahead_ns": st.sampled_from([0, 0, 1_500_000_000, -1_500_000_000]),
    }
)


@settings(max_examples=150, deadline=None)
@given(series=st.lists(faults, min_size=1, max_size=8), posed=st.booleans())
def test_results_stay_finite_for_any_sequence_of_faults(
    scene: Scene, series: list[dict[str, float]], posed: bool
) -> None:
    """Single and combined faults of heave and of poses, at 20 Hz."""
    track, k, omega = HangOffTrack(scene), 0, 2.0 * math.pi / 8.0
    for fault in series:
        for _ in range(int(fault["lasts"])):
            k += 1
            phase = omega * 0.05 * k
            z = fault["position_times"] * 2.0 * math.sin(phase) + fault["jump_m"]
            v = fault["rate_times"] * 2.0 * omega * math.cos(phase)
            stamp_ns = k * 50_000_000 + int(fault["ahead_ns"])
            if k % 40 < fault["kept_of_40"]:
                if posed:
                    track.submit_pose(ShipPose(stamp_ns, (0.0, 0.0, z), (0.0, 0.0, v)))
                else:
                    track.submit(stamp_ns, z, v)
            now_ns = (k - 3) * 50_000_000
            position_m, speed = track.at(now_ns)
            health = track.health(now_ns)
            assert math.isfinite(position_m)
            assert math.isfinite(speed)
            assert health.accepted + health.refused <= k


@settings(max_examples=30, deadline=None)
@given(
    commands=st.lists(
        st.tuples(
            st.one_of(st.none(), st.integers(-(10**10), 10**11)), anything, st.integers(0, 100)
        ),
        max_size=30,
    )
)
def test_line_out_stays_within_limits_for_any_speed_command(
    scene: Scene, commands: list[tuple[int | None, float, int]]
) -> None:
    """Under any speed commands the line out stays within the winch's limits."""
    twin = Twin(scene)
    for stamp_ns, speed, steps in commands:
        assert "\n" not in twin.submit_speed(stamp_ns, speed)
        twin.advance(steps)
        snapshot = twin.snapshot()
        assert not not_finite(snapshot)
        assert 50.0 - 1e-9 <= snapshot.line_out_m <= 400.0 + 1e-9
        assert abs(snapshot.payout_speed_m_per_s) <= 1.5
