"""Forecasts over a recording: reading it, one origin, a score, and the command."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bag_samples import START_NS
from small_scene import small_scene

from benchmarks.foresight.seas import DrawnSea, recorded_spectrum
from rope_twin.cli import main
from rope_twin.errors import BagError, InputError
from rope_twin.estimation.recorded_lift import read_lift as read_to_learn
from rope_twin.forecast.heave_process import SAMPLE_S, MotionError
from rope_twin.forecast.offline import RecordingForecaster
from rope_twin.forecast.orders import read_order
from rope_twin.forecast.recorded_lift import RecordedLift, _on_at, read_lift, tension_unit_warning
from rope_twin.forecast.tension_forecast import TENSION, ForecastSettings
from rope_twin.messages import encode_heave, encode_measurement
from rope_twin.messages.cdr import decode, serialise
from rope_twin.recording.bag import BagReader
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.scene.winch import HeaveCompensation
from rope_twin.topics import BY_NAME
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs
from rope_twin.twin.motion.heave_track import ramp
from rope_twin.twin.readings import Measurement

LENGTH_S = 420.0
PERIOD_S = 0.05
AHC = HeaveCompensation(
    efficiency=0.95, lag_s=0.1, stroke_m=3.0, speed_limit_m_per_s=2.0,
    acceleration_limit_m_per_s2=2.0,
)  # fmt: skip
SETTINGS = ForecastSettings(members=19, burn_in_s=30.0)


def write_lift(folder: Path, skip: slice | None = None) -> Path:
    """Record ship/heave and winch/measured of the small scene's rope in a drawn sea."""
    scene = small_scene(folder)
    count = round(LENGTH_S / PERIOD_S)
    sea = DrawnSea.draw(recorded_spectrum("sea_2p5m"), np.random.default_rng(1))
    heave = sea.heave_m(count + 1, PERIOD_S)
    rate = np.gradient(heave, PERIOD_S)
    shares = np.array([ramp(k * PERIOD_S, 10.0) for k in range(count + 1)])
    z = shares[:, 0] * heave
    v = shares[:, 0] * rate + shares[:, 1] * heave
    fleet = Fleet(scene, 4, elements=20, step_s=PERIOD_S)
    line = np.full(count + 1, 200.0)
    tension = fleet.advance(FleetInputs(z, v, line, 0.0 * line)).top_tension_n[:, 0]
    path = folder / "lift"
    with BagWriter(path, [BY_NAME["ship/heave"], BY_NAME["winch/measured"]]) as bag:
        for k in range(count):
            if skip is not None and skip.start <= k < skip.stop:
                continue
            stamp_ns = START_NS + round(k * PERIOD_S * 1e9)
            bag.write("ship/heave", stamp_ns, encode_heave(stamp_ns, heave[k], rate[k]))
            reading = Measurement.of_winch(stamp_ns, 200.0, 0.0, tension[max(k - 1, 0)])
            bag.write("winch/measured", stamp_ns, encode_measurement(stamp_ns, reading)[1])
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the scene and its lift."""
    made: Path = tmp_path_factory.mktemp("lift")
    write_lift(made)
    return made


@pytest.fixture(scope="module")
def lift(folder: Path) -> RecordedLift:
    """The lift, read."""
    return read_lift(folder / "lift", str(folder / "small.yaml"))


def test_series_of_a_recording(lift: RecordedLift) -> None:
    """Every half second, measured topics first."""
    assert lift.sources == ("ship/heave", "winch/measured", "winch/measured")
    assert len(lift.heave_m) == round(LENGTH_S / SAMPLE_S)
    assert abs(lift.heave_m.mean()) < 0.1 * lift.heave_m.std()
    assert (lift.line_out_m == 200.0).all()
    assert np.isfinite(lift.tension_n).all()
    assert (lift.peak_n[1:] >= lift.mean_n[1:]).all()
    known = lift.known_at(400)
    assert known.time_s == 200.0
    assert len(known.heave_m) == 401
    (plan,) = lift.plans_at(800, SETTINGS, 60.0).values()  # beyond the end: as it is there
    assert plan.out_m == pytest.approx(200.0)


def test_forecast_of_a_recording(lift: RecordedLift) -> None:
    """With known figures and heave the first 2 s are those recorded; orders differ."""
    certain = replace(SETTINGS, spread={}, motion_error=MotionError(coloured_m=0.0))
    forecaster = RecordingForecaster(lift, certain)
    sample = forecaster.sample_of(330.0)
    hold, haul = forecaster.at(sample, [read_order("hold"), read_order("haul:1")])
    error = hold.band()[1, :4] - lift.tension_n[sample + 1 : sample + 5]
    assert np.abs(error).max() < 0.3 * np.std(lift.tension_n)
    assert (haul.values[TENSION] != hold.values[TENSION]).any()
    with pytest.raises(InputError, match="give"):
        forecaster.sample_of(10.0)
    assert forecaster.sample_of(None) == len(lift.heave_m) - 1


def test_score_of_a_recording(lift: RecordedLift) -> None:
    """Skill where heave is known, its lack where it is not; the parts are those of the module."""
    forecaster = RecordingForecaster(lift, SETTINGS)
    limit = float(np.quantile(lift.peak_n[60:], 0.97))
    seen: list[int] = []
    found = forecaster.score(40.0, limit, lambda done, total, what: seen.append(done))
    assert found.origins == seen[-1] == 6
    assert found.leads[0].skill > 0.8
    assert found.leads[0].crps_gain > found.leads[-1].crps_gain
    assert 0.5 < found.coverage <= 1.0
    assert [one.span_s for one in found.events] == [10.0, 20.0, 30.0, 60.0]
    with pytest.raises(InputError, match="fit"):
        forecaster.score(1e4, limit, lambda *_: None)


def test_a_score_knows_of_a_load_pin_that_was_left_out(lift: RecordedLift) -> None:
    """Half the load, as of one of two load pins: at every origin, and at none without it."""
    for factor, origins in ((1.0, 0), (0.5, 3)):
        forecaster = RecordingForecaster(
            dataclasses.replace(lift, mean_n=factor * lift.mean_n), SETTINGS
        )
        assert forecaster.score(90.0, 90e3, lambda *_: None).origins == 3
        assert len(forecaster.pin_faults) == origins


def test_command(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Text and JSON of one origin with orders."""
    words = ["ahead", str(folder / "lift"), "--scene", str(folder / "small.yaml"), "--at", "5min",
             "--members", "19", "--what-if", "lower:0.5", "stop", "--limit", "80kN"]  # fmt: skip
    assert main(words) == 0
    printed = capsys.readouterr().out
    for part in ("origin 300 s", "95 %", "P(T > 80 kN)", "lower:0.5", "lower in", "climatology"):
        assert part in printed
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [one["order"] for one in found["forecasts"]] == ["hold", "lower:0.5", "stop"]
    assert len(found["forecasts"][0]["bands"]["top_tension_n"][0]) == 120
    assert main([*words[:4], "--what-if", "jump"]) == 1
    assert "no 'jump'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--quiet-time", "60s"], "--quiet-time: it is 60 s; give more than 0 and at most 50 s"),
        (["--limit", "0"], "--limit: it is 0 N; give more than 0"),
        (["--members", "100000"], "--members: 100000 ropes are too many; give at most 960"),
        (["--score", "--every", "0"], "--every: the origins are 0 s apart; give 0.5 s or more"),
        (["--score", "--at", "5min"], "--at: it is for one origin"),
        (["--score", "--what-if", "stop"], "--what-if: it is for one origin"),
        (["--score", "--picture", "x.png"], "--picture: it is for one origin"),
    ],
)
def test_options_are_refused_before_anything_is_computed(
    words: list[str], said: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither half an answer nor an option that is left out without a word."""
    assert main(["ahead", str(folder / "lift"), "--scene", str(folder / "small.yaml"), *words]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err


def test_speed_of_an_order_takes_a_unit() -> None:
    """Orders read speeds with units, as all options of the command line do."""
    assert read_order("lower:30m/min").speed_m_per_s == pytest.approx(0.5)
    assert read_order("haul:1kn@aft").speed_m_per_s == pytest.approx(1852.0 / 3600.0)
    with pytest.raises(InputError, match=r"like lower:0\.5"):
        read_order("lower:0.5kN")


def test_tension_in_other_units_is_doubted(lift: RecordedLift) -> None:
    """A load cell in kN, or in mN, is named; one in N is not."""
    assert tension_unit_warning(lift) == ""
    doubt = tension_unit_warning(replace(lift, peak_n=1e-3 * lift.peak_n))
    assert "winch/measured" in doubt
    assert "unit (N)" in doubt
    assert "unit (N)" in tension_unit_warning(replace(lift, peak_n=1e3 * lift.peak_n))


def test_recordings_that_do_not_serve(tmp_path: Path) -> None:
    """A gap of heave and line, and a bag without a winch."""
    gap = write_lift(tmp_path, slice(2000, 2100))
    with pytest.raises(BagError, match=r"missing for 5\.\d s"):
        read_lift(gap, str(tmp_path / "small.yaml"))
    with pytest.raises(BagError, match="no line out"):
        read_lift("sea_2p5m", str(tmp_path / "small.yaml"))
    with pytest.raises(BagError, match="session"):
        read_lift("sea_2p5m")


def test_two_minutes_suffice_as_in_a_run(tmp_path: Path) -> None:
    two_minutes = write_lift(tmp_path, slice(2440, 10**6))
    short = read_lift(two_minutes, str(tmp_path / "small.yaml"))
    assert len(short.heave_m) > short.first_origin
    (tmp_path / "less").mkdir()
    less = write_lift(tmp_path / "less", slice(2380, 10**6))
    with pytest.raises(BagError, match=r"119 s of it have heave.*a forecast needs 120\.5 s"):
        read_lift(less, str(tmp_path / "less" / "small.yaml"))


def test_messages_that_a_twin_would_refuse_are_left_out(folder: Path, tmp_path: Path) -> None:
    """By one rule for `ahead` and `learn`: heave of no orientation, bytes that do not decode."""
    topics = [BY_NAME["ship/heave"], BY_NAME["winch/measured"]]
    with BagReader(folder / "lift") as whole, BagWriter(tmp_path / "lift", topics) as bag:
        for topic in topics:
            for number, (log_ns, data) in enumerate(whole.messages(f"/{topic.name}")):
                sent = data
                if number == 1000 and topic.name == "ship/heave":
                    message = decode(topic.name, data)
                    message.pose.pose.orientation.w = 0.0
                    message.pose.pose.position.z = 900.0
                    sent = serialise(message)
                elif number == 1001:
                    sent = data[:20]
                bag.write(topic.name, log_ns, sent)
    read = read_lift(tmp_path / "lift", str(folder / "small.yaml"))
    assert abs(read.heave_m).max() < 10.0
    assert read.problems == (
        "2 messages of ship/heave could not be read and were left out",
        "1 message of winch/measured could not be read and was left out",
    )
    assert set(read_to_learn(tmp_path / "lift").problems) == set(read.problems)


def test_values_that_a_twin_would_refuse_are_left_out(
    folder: Path, lift: RecordedLift, tmp_path: Path
) -> None:
    """Spikes of counter and load cell, whatever their messages hold else."""
    topics = [BY_NAME["ship/heave"], BY_NAME["winch/measured"]]
    with BagReader(folder / "lift") as whole, BagWriter(tmp_path / "lift", topics) as bag:
        for topic in topics:
            for number, (log_ns, data) in enumerate(whole.messages(f"/{topic.name}")):
                sent = data
                if topic.name == "winch/measured" and number % 1000 == 500:
                    message = decode(topic.name, data)
                    message.position = message.position + 30.0
                    message.effort = np.array([1e9])
                    sent = serialise(message)
                bag.write(topic.name, log_ns, sent)
    read = read_lift(tmp_path / "lift", str(folder / "small.yaml"))
    assert np.array_equal(read.line_out_m, lift.line_out_m)
    assert np.nanmax(read.peak_n) == np.nanmax(lift.peak_n)
    assert read.problems == (
        "8 values of line out, impossible for the scene's winch, left out",
        "8 values of tension, impossible for the scene's winch, left out",
    )


def test_a_line_out_in_another_unit_is_refused(tmp_path: Path) -> None:
    """In one sentence with what a twin would say of it."""
    write_lift(tmp_path)
    other, text = tmp_path / "other.yaml", (tmp_path / "small.yaml").read_text()
    for old, new in (("max_line_out_m: 400.0", "max_line_out_m: 150.0"),
                     ("length_m: 200.0\n", "length_m: 100.0\n")):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    other.write_text(text)
    with pytest.raises(BagError, match="line out 200 m; this winch has 0 to 150 m out"):
        read_lift(tmp_path / "lift", str(other))


def test_a_bag_that_was_cut_off_is_read_up_to_its_break(
    folder: Path, lift: RecordedLift, tmp_path: Path
) -> None:
    """For `ahead` and `learn`, with a sentence on the damage, with or without its metadata."""
    whole = next((folder / "lift").glob("*.mcap"))
    kept = whole.read_bytes()[: whole.stat().st_size * 3 // 4]
    for number, metadata in enumerate((True, False)):
        bag = tmp_path / f"cut{number}"
        bag.mkdir()
        (bag / whole.name).write_bytes(kept)
        if metadata:
            (bag / "metadata.yaml").write_bytes((folder / "lift/metadata.yaml").read_bytes())
        cut = read_lift(bag, str(folder / "small.yaml"))
        (words,) = cut.problems
        assert words.startswith(whole.name)
        count = len(cut.heave_m)
        assert 0.5 < count / len(lift.heave_m) < 0.8
        assert cut.heave_m == pytest.approx(lift.heave_m[:count], abs=1e-12)
        learned = read_to_learn(bag)
        assert learned.problems == (words,)
        assert len(learned.lift.tension.table) == pytest.approx(
            count * SAMPLE_S / PERIOD_S, rel=0.05
        )
    assert not lift.problems


def test_compensation_is_on_as_recorded(lift: RecordedLift) -> None:
    """On before the first state that was heard, then as the last one said; unheard: on."""
    switched = np.array([[1.0, 0.0], [2.0, 1.0]])
    assert _on_at(switched, np.array([0.5, 1.0, 1.5, 2.5])) is not None
    assert np.array(_on_at(switched, np.array([0.5, 1.0, 1.5, 2.5]))).tolist() == [
        True, False, False, True,
    ]  # fmt: skip
    assert _on_at(np.empty((0, 2)), np.array([0.5])) is None
    assert lift.scene.winch is not None
    winch = replace(lift.scene.winch, heave_compensation=AHC)
    off = np.arange(len(lift.heave_m)) >= 500
    own = replace(lift, scene=replace(lift.scene, winch=winch), compensated=~off)
    assert own.known_at(499).compensated
    assert not own.known_at(500).compensated
    assert replace(own, compensated=None).known_at(500).compensated


def test_known_offsets_are_subtracted(folder: Path, lift: RecordedLift, tmp_path: Path) -> None:
    """Offsets of the load cell and of the line-out counter are subtracted."""
    scene = tmp_path / "offset.yaml"
    offsets = "measured: {tension: {bias_n: 500.0}, line_out: {bias_m: 2.0}}\n"
    scene.write_text((folder / "small.yaml").read_text() + offsets)
    own = read_lift(folder / "lift", str(scene))
    assert own.tension_n == pytest.approx(lift.tension_n - 500.0)
    assert own.line_out_m == pytest.approx(lift.line_out_m - 2.0)
