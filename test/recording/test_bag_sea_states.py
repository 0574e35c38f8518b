"""The bags that come with the package: their size, their origin, what is in them."""

import argparse
import re
import shlex

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from rope_twin.cli import sea_state
from rope_twin.errors import InputError
from rope_twin.files import share_dir
from rope_twin.recording.bag import list_bags
from rope_twin.recording.heave import read_heave
from rope_twin.sea.ship_motion import BoxHull
from rope_twin.sea.spectrum import read_spectrum
from rope_twin.twin.motion.ship_motion import synthesise

README = (share_dir() / "bags" / "README.md").read_text(encoding="utf-8")
COMMANDS = {
    line.split("bags/")[-1].strip(): shlex.split(line)
    for line in re.findall(r"^rope_twin (sea-state make .*)$", README, re.MULTILINE)
}
ROWS = {
    cells[1].strip("` "): [cell.strip() for cell in cells[2:-1]]
    for cells in (line.split("|") for line in README.splitlines() if line.startswith("| `sea_"))
}
MADE_WITH_ZSTD = (1, 5, 7)


def run(*words: str) -> int:
    parser = argparse.ArgumentParser()
    sea_state.add_arguments(parser.add_subparsers().add_parser("sea-state"))
    args = parser.parse_args(words)
    return int(sea_state.run(args))


def messages(path):
    with path.open("rb") as stream:
        reader = make_reader(stream)
        return [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages()]


def test_readme_bags_and_commands_are_the_same_three():
    assert set(COMMANDS) == set(ROWS) == set(list_bags()) == {"sea_1p2m", "sea_2p5m", "sea_6p5m"}


@pytest.mark.parametrize("name", COMMANDS)
def test_the_stated_command_makes_the_tracked_bag_byte_by_byte(tmp_path, name, capsys):
    words = COMMANDS[name]
    again = tmp_path / name
    assert run(*words[:-1], str(again)) == 0
    tracked = list_bags()[name]
    assert (again / "metadata.yaml").read_bytes() == (tracked / "metadata.yaml").read_bytes()
    made, kept = again / f"{name}_0.mcap", tracked / f"{name}_0.mcap"
    if zstandard.ZSTD_VERSION == MADE_WITH_ZSTD:
        assert made.read_bytes() == kept.read_bytes()
    assert messages(made) == messages(kept)


@pytest.mark.parametrize("name", COMMANDS)
def test_bag_is_small_regular_and_stamped_with_its_log_time(name):
    path = list_bags()[name]
    assert sum(file.stat().st_size for file in path.iterdir()) < 1_000_000
    stamps: dict[str, list[int]] = {"/ship/heave": [], "/sea/elevation": []}
    with AnyReader([path]) as reader:
        for connection, log_ns, data in reader.messages():
            header = reader.deserialize(data, connection.msgtype).header
            assert header.frame_id == "sea"
            assert header.stamp.sec * 10**9 + header.stamp.nanosec == log_ns
            stamps[connection.topic].append(log_ns)
    heave, elevation = (np.array(values) for values in stamps.values())
    assert heave[0] == elevation[0] == 946_684_800 * 10**9
    assert len(heave) == 24_000
    assert len(elevation) == 4_800
    assert set(np.diff(heave)) == {50_000_000}
    assert set(np.diff(elevation)) == {250_000_000}


@pytest.mark.parametrize("name", COMMANDS)
def test_bag_holds_the_sea_of_its_spectrum_and_seed(name):
    column, seed = ROWS[name][0].strip("`"), int(ROWS[name][1])
    spectrum = read_spectrum("ndbc_46042_1996", column)
    sea = synthesise(spectrum, BoxHull(), seed)
    record = read_heave(list_bags()[name])
    half = 0.5 * 2.0**-13 + 1e-12
    assert np.max(np.abs(record.position_m - sea.heave_m)) <= half
    assert np.max(np.abs(record.velocity_m_per_s - sea.heave_velocity_m_per_s)) <= half
    assert np.max(np.abs(record.elevation_m - sea.elevation_m[::5])) <= half
    assert 4 * np.std(record.elevation_m) == pytest.approx(spectrum.significant_height_m, rel=0.01)
    assert record.note == ""


@pytest.mark.parametrize("name", COMMANDS)
def test_info_prints_the_figures_of_the_readme(name, capsys):
    assert run("sea-state", "info", name) == 0
    reported = capsys.readouterr().out
    wave, heave, largest, rate = ROWS[name][2:]
    assert "1200 s of heave at 20 Hz" in reported
    assert re.search(rf"wave +Hs {wave.replace(', ', ', Tp ')}", reported)
    assert re.search(rf"heave +Hs {heave.replace(', ', ', Tp ')}, max {largest}", reported)
    assert re.search(rf"heave_rate +max {rate}", reported)
    assert re.search(rf"seed +{ROWS[name][1]}\n", reported)
    assert "Jensen, Mansour, Olsen 2004" in reported
    assert "note" not in reported


def test_jonswap_makes_a_bag_too(tmp_path, capsys):
    words = "--jonswap 3.3 9.7 --seed 1 --duration 300 --hull 80 18 5 0.8 --out"
    assert run("sea-state", "make", *words.split(), str(tmp_path / "sea")) == 0
    assert "wave           Hs 3.30 m" in capsys.readouterr().out
    assert read_heave(tmp_path / "sea").source.startswith("JONSWAP, Hs 3.3 m, Tp 9.7 s, gamma 1;")


@pytest.mark.parametrize(("rate", "elevation_hz"), [("10Hz", 5.0), ("7Hz", 7.0), ("3Hz", 3.0)])
def test_the_elevation_rate_divides_that_of_the_heave(tmp_path, rate, elevation_hz):
    words = f"--jonswap 4 11 2 --seed 7 --duration 100 --rate {rate} --out"
    assert run("sea-state", "make", *words.split(), str(tmp_path / "sea")) == 0
    record = read_heave(tmp_path / "sea")
    steps_s = np.diff(record.elevation_time_ns) * 1e-9
    assert steps_s == pytest.approx(1.0 / elevation_hz, abs=2e-9)


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        ("--spectrum ndbc_46042_1996 --seed 1", "--column: it is missing"),
        ("--jonswap 3 --seed 1", "--jonswap: 1 numbers"),
        ("--jonswap 3 8 --seed -1", "seed: it is -1"),
        ("--jonswap 3 8 --seed 1 --elevation-rate 3", "elevation rate: it is 3 Hz"),
        ("--jonswap 3 8 --seed 1 --elevation-rate 0", "elevation rate: it is 0 Hz"),
        ("--jonswap 3 8 --seed 1 --hull 120 23 7 1.4", "hull block_coefficient: it is 1.4"),
    ],
)
def test_wrong_options_get_a_sentence_and_leave_nothing(tmp_path, words, reported):
    with pytest.raises(InputError, match=re.escape(reported)):
        run("sea-state", "make", *words.split(), "--out", str(tmp_path / "sea"))
    assert not (tmp_path / "sea").exists()
