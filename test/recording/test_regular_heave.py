"""A sine in place of a recorded sea: strictly read, exactly sampled, fed like a bag."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scene_text import assert_refused, spoilt, written

from rope_twin.cli import main
from rope_twin.errors import InputError
from rope_twin.recording.motion_source import FIRST_NS, SAMPLE_PERIOD_NS, RegularSea, open_sea
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import UnpacedRun
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import RegularHeave
from rope_twin.twin.motion.heave_track import HeaveTrack, ramp

SEA = "sea_state: {start_s: 10.0, loop: true}"
SINE = "heave: {amplitude_m: 1.5, period_s: 8.0}"
S = 1_000_000_000


def with_sea(words: str) -> str:
    """The good scene with this sea."""
    return spoilt(SEA, f"sea_state: {{{words}}}")


def test_it_is_read(tmp_path: Path) -> None:
    sea = load_scene(written(tmp_path, with_sea(f"{SINE}, start_s: 2.0"))).sea_state
    assert sea.heave == RegularHeave(amplitude_m=1.5, period_s=8.0)
    assert sea.start_s == 2.0
    assert sea.moves


@pytest.mark.parametrize(
    ("words", "place", "reported"),
    [
        (f"bag: sea_2p5m, {SINE}", "sea_state", ("both `bag`", "keep the record or the sine")),
        (f"{SINE}, loop: false", "sea_state.loop", ("has no end", "remove `loop`")),
        ("heave: {amplitude_m: 10.0, period_s: 4.0}", "sea_state.heave", ("15.7 m/s", "15 m/s")),
        ("heave: {amplitude_m: 1.5}", "sea_state.heave", ("period_s missing", "0.2 to 100 s")),
        ("heave: {amplitude_m: -1.0, period_s: 8.0}", "sea_state.heave.amplitude_m", ("0 to 30",)),
        ("heave: {amplitude_m: 1.0, period_s: 0.1}", "sea_state.heave.period_s", ("0.2 to 100 s",)),
        ("heave: {amplitude: 1.0, period_s: 8.0}", "sea_state.heave.amplitude", ("amplitude_m",)),
        ("heave: 1.5", "sea_state.heave", ("the number 1.5 instead of a mapping",)),
    ],
)  # fmt: skip
def test_a_bad_one_gets_its_sentence(
    words: str, place: str, reported: tuple[str, ...], tmp_path: Path
) -> None:
    assert_refused(with_sea(words), place, reported, tmp_path)


def test_a_start_without_a_ramp_is_warned_of(tmp_path: Path) -> None:
    text = with_sea(SINE).replace("motion_ramp_s: 8.0", "motion_ramp_s: 0.0")
    assert any(
        "ship.motion_ramp_s" in words for words in sense_checks(load_scene(written(tmp_path, text)))
    )


def test_the_scene_command_tells_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scene", "show", "smooth_2km"]) == 0
    assert "regular heave, ±1.5 m every 8 s" in capsys.readouterr().out


def test_samples_are_exact_and_each_comes_once() -> None:
    """Cut anywhere; a start of 2 s is a quarter of the period."""
    sea = RegularSea(RegularHeave(amplitude_m=3.0, period_s=8.0), start_s=2.0)
    cuts = [FIRST_NS, 0, 1, 7 * S, 7 * S + SAMPLE_PERIOD_NS, 20 * S]
    samples = [x for a, b in pairwise(cuts) for x in sea.between(a, b)]
    assert [x.stamp_ns for x in samples] == list(range(FIRST_NS, 20 * S, SAMPLE_PERIOD_NS))
    time = np.array([x.stamp_ns for x in samples]) * 1e-9
    omega = 2.0 * np.pi / 8.0
    assert np.allclose([x.position_m for x in samples], 3.0 * np.cos(omega * time), atol=1e-13)
    rates = [x.velocity_m_per_s for x in samples]
    assert np.allclose(rates, -3.0 * omega * np.sin(omega * time), atol=1e-13)
    assert not sea.is_over(10**18)


@pytest.mark.parametrize("period_s", [2.0, 7.3, 8.0, 100.0])
def test_what_the_twin_reads_between_samples_is_the_sine(period_s: float) -> None:
    """Cubic Hermite pieces over h: at most (ω·h)⁴/384 of the amplitude off (2e-6 at 2 s)."""
    sea, track = RegularSea(RegularHeave(amplitude_m=2.0, period_s=period_s)), HeaveTrack()
    errors = []
    for sample in sea.between(FIRST_NS, FIRST_NS + 20 * S):
        assert track.submit(sample.stamp_ns, sample.position_m, sample.velocity_m_per_s) == ""
        if sample.stamp_ns > 0:
            for part in (0.25, 0.5, 0.75):
                at_ns = sample.stamp_ns - round((1.0 - part) * SAMPLE_PERIOD_NS)
                errors.append(track.at(at_ns)[0] - sea.at(at_ns * 1e-9)[0])
    bound = (2.0 * math.pi / period_s * SAMPLE_PERIOD_NS * 1e-9) ** 4 / 384.0
    assert 0.5 * bound - 1e-14 < np.abs(errors).max() / 2.0 < 1.01 * bound + 1e-14 < 1e-5


def test_an_unpaced_run_heaves_as_the_scene_says() -> None:
    run = UnpacedRun(RunOptions(scene="smooth_2km", speed=0.0))
    for _ in range(250):
        snapshot = run.advance_slot()
        share, _ = ramp(snapshot.time_s, 8.0)
        wanted = share * 1.5 * math.sin(2.0 * math.pi * snapshot.time_s / 8.0)
        assert snapshot.heave_m == pytest.approx(wanted, abs=1.5e-8)
    assert snapshot.time_s == pytest.approx(5.0)
    assert snapshot.inputs["heave"].refused == 0


def test_a_bag_wins_and_a_topic_wants_one() -> None:
    scene = load_scene("smooth_2km")
    bag, own = open_sea(scene, "sea_2p5m"), open_sea(scene, start_s=2.0)
    assert bag is not None
    assert "seed 25" in bag.source
    assert own is not None
    assert own.between(0, 1)[0].position_m == 1.5
    with pytest.raises(InputError, match="no bag to look for it in"):
        open_sea(scene, topic="ship/heave")
