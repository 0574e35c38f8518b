"""Measurements of a bag in unpaced runs: residuals offline, lines that follow, and refusals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from small_scene import SMALL_SCENE

from rope_twin.cli import main
from rope_twin.errors import BagError
from rope_twin.messages import decode, encode_epoch, encode_measurement
from rope_twin.recording.bag import BagReader
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.exact_replay import Outcome, verify
from rope_twin.recording.motion_source import open_measured
from rope_twin.run.options import RunOptions
from rope_twin.run.summary import RunSummary
from rope_twin.run.unpaced import run_unpaced
from rope_twin.topics import TOPICS
from rope_twin.twin.readings import Measurement

S = 1_000_000_000
EPOCH_NS = 1_700_000_000 * S
SEA = "sea_state: {heave: {amplitude_m: 0.5, period_s: 8.0}}\n"
SENSORS = "measured: {tension: {uncertainty_n: 500.0}}\n"
BIAS_N, SECONDS = 700.0, 6.0


def bag(path: Path, readings: list[tuple[int, Measurement]], epoch_ns: int = 0) -> Path:
    """A bag of measurements with their ROS times, and the epoch of a run if it has one."""
    with BagWriter(path, TOPICS) as made:
        if epoch_ns:
            made.write("twin/epoch", epoch_ns, encode_epoch(epoch_ns))
        for at_ns, one in readings:
            topic, data = encode_measurement(at_ns, one)
            made.write(topic, at_ns, data)
    return path


def run(scene: Path, **more: object) -> RunSummary:
    options = RunOptions(scene=str(scene), end_s=SECONDS, speed=0.0, **more)  # type: ignore[arg-type]
    summary = run_unpaced(options, lambda _: None, EPOCH_NS)
    assert not summary.error
    return summary


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scene") / "small.yaml"
    path.write_text(SMALL_SCENE + SEA + SENSORS)
    return path


@pytest.fixture(scope="module")
def measured(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record the readings of a load cell that reads too much on a run of the scene."""
    folder = tmp_path_factory.mktemp("run")
    run(scene, record=folder / "run")
    readings = []
    with BagReader(folder / "run") as recorded:
        for _, data in recorded.messages("/ropes/tension_top"):
            message = decode("ropes/tension_top", data)
            at_ns = message.header.stamp.sec * S + message.header.stamp.nanosec
            reading = Measurement.of_winch(at_ns, tension_n=float(message.effort[0]) + BIAS_N)
            readings.append((at_ns, reading))
    assert len(readings) > 100
    return bag(folder / "measured", readings, EPOCH_NS)


def test_residuals_of_a_recording_are_those_of_the_run_that_it_is_of(
    scene: Path, measured: Path, tmp_path: Path
) -> None:
    """Its t = 0 is the epoch of the bag; readings lie on the twin's own samples of 20 ms."""
    summary = run(scene, measured=str(measured), record=tmp_path / "bag")
    (one,) = summary.residuals
    assert (one["name"], one["quantity"]) == ("winch", "top_tension_n")
    assert one["mean"] == pytest.approx(BIAS_N, rel=1e-9)
    assert one["rms"] == pytest.approx(BIAS_N, rel=1e-9)
    assert one["half_width"] == pytest.approx(1.96 * 500.0)
    assert one["readings"] > 100
    found = verify(tmp_path / "bag")
    assert (found.outcome, found.difference) == (Outcome.EQUAL, None)
    assert found.applied["winch/measured"] > 100


def test_a_winch_follows_a_recording_in_place_of_its_schedule(scene: Path, tmp_path: Path) -> None:
    """Without an epoch t = 0 is the first reading's time."""

    def line(t: float) -> tuple[float, float]:
        return 200.0 + 0.1 * (1.0 - math.cos(2.0 * t)), 0.2 * math.sin(2.0 * t)

    times = np.arange(0.0, SECONDS + 1.0, 0.05)
    readings = [
        (EPOCH_NS + round(t * 1e9), Measurement.of_winch(0, *line(float(t)))) for t in times
    ]
    path = bag(tmp_path / "measured", readings)
    run(scene, measured=str(path), follow_measured=True, record=tmp_path / "bag")
    with BagReader(tmp_path / "bag") as recorded:
        found = [decode("ropes/length", data) for _, data in recorded.messages("/ropes/length")]
    stamps = [one.header.stamp.sec * S + one.header.stamp.nanosec - EPOCH_NS for one in found]
    off = [one.position[0] - line(at * 1e-9)[0] for one, at in zip(found, stamps, strict=True)]
    assert np.abs(off).max() < 1e-5  # of the cubic between readings: (ω·h)⁴/384 of 0.1 m is 3e-8
    assert verify(tmp_path / "bag").outcome is Outcome.EQUAL


def test_heave_of_the_same_voyage_decides_where_readings_belong(tmp_path: Path) -> None:
    reading = [(EPOCH_NS + 12 * S, Measurement.of_motor(0, 1e5))]
    path = bag(tmp_path / "measured", reading, EPOCH_NS)
    assert open_measured(str(path)).between(0, 99 * S)[0].stamp_ns == 12 * S
    found = open_measured(str(path), EPOCH_NS + 10 * S)
    assert [one.stamp_ns for one in found.between(0, 99 * S)] == [2 * S]
    assert found.between(0, 2 * S) == []
    assert "1 motor tension reading, from 2.00 to 2.00 s" in found.source
    with pytest.raises(BagError, match=r"its readings begin 3 s before t = 0; .* of the same time"):
        open_measured(str(path), EPOCH_NS + 15 * S)


def test_messages_that_are_none_are_counted_and_a_bag_without_any_is_refused(
    tmp_path: Path,
) -> None:
    path = bag(tmp_path / "stamped", [(EPOCH_NS, Measurement.of_depth(0, 90.0)),
                                      (0, Measurement.of_depth(0, 90.0))])  # fmt: skip
    assert (
        "1 message left out: payload/measured_depth: its stamp is 0"
        in open_measured(str(path)).note
    )
    empty = bag(tmp_path / "empty", [], EPOCH_NS)
    with pytest.raises(BagError, match="it has no measurements; name one with winch/measured"):
        open_measured(str(empty))


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--measured", "bag"], "give --speed 0 too"),
        (["--follow-measured", "--speed", "0", "--duration", "1s"], "nothing is measured"),
        (["--measured", "no_bag", "--speed", "0", "--duration", "1s"], "no such file or name"),
    ],
)
def test_impossible_options_are_one_sentence(
    words: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "still_water", "--no-record", *words]) == 1
    assert reason in capsys.readouterr().err
