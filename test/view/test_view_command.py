"""rope_twin view, as typed."""

from __future__ import annotations

import argparse
import ctypes
import re
import time
from pathlib import Path
from random import Random

import pytest
from PIL import Image
from rerun.chunk import RrdReader
from sample_snapshot import hanging_rope

from rope_twin import messages
from rope_twin.cli.displays import COMMANDS
from rope_twin.errors import BagError, InputError
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.topics import TOPICS
from rope_twin.view import sinks
from rope_twin.view.rope_view import RopeView

EPOCH_NS = 1_763_700_000_000_000_000


def command(*words: str) -> int:
    parser = argparse.ArgumentParser()
    COMMANDS["view"].add_arguments(parser.add_subparsers().add_parser("view"))
    args = parser.parse_args(["view", *words])
    return COMMANDS["view"].run(args)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    encoder = messages.Encoder(EPOCH_NS)
    with BagWriter(tmp_path / "lift", TOPICS) as writer:
        writer.write("twin/epoch", EPOCH_NS, messages.encode_epoch(EPOCH_NS))
        for k in range(40):
            snapshot = hanging_rope(51, time_s=k / 10, heave_m=0.1 * (k % 10))
            for topic in ("ropes/tension_top", "ropes/nodes"):
                data = encoder.encode(topic, snapshot)
                writer.write(topic, EPOCH_NS + snapshot.stamp_ns, data)
    return tmp_path / "lift"


def test_save(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "made" / "lift.rrd"
    assert command(str(bag), "--out", str(out), "--at", "2") == 0
    assert f"recording: {out}" in capsys.readouterr().out
    entities = {chunk.entity_path for chunk in RrdReader(out).stream()}
    assert {"/overview/rope", "/plots/tension/top"} <= entities


def test_the_rrd_of_a_run_is_opened_as_it_is(bag: Path, tmp_path: Path) -> None:
    rrd = tmp_path / "run.rrd"
    assert command(str(bag), "--out", str(rrd)) == 0
    for option in (("--at", "2"), ("--out", str(tmp_path / "b.rrd"))):
        with pytest.raises(InputError, match="--at and a recording as --out need the bag"):
            command(str(rrd), *option)
    with pytest.raises(InputError, match="it does not exist"):
        command(str(tmp_path / "nowhere.rrd"), "--out", str(rrd))


def test_a_file_that_is_no_recording_is_refused_at_once(bag: Path, tmp_path: Path) -> None:
    """A picture of random bytes was waited for for 90 s; a cut recording is still taken."""
    rrd = tmp_path / "run.rrd"
    assert command(str(bag), "--out", str(rrd)) == 0
    whole, random = rrd.read_bytes(), Random(1).randbytes(100_000)
    assert sinks.recording_fault(rrd) == ""
    rrd.write_bytes(whole[: len(whole) * 2 // 3])
    assert sinks.recording_fault(rrd) == ""
    faults = {
        random: "not a rerun recording",
        b"": "empty file",
        whole[:12]: "no message in the file",
        whole[:12] + random: "first message damaged",
    }
    for data, words in faults.items():
        rrd.write_bytes(data)
        began = time.monotonic()
        with pytest.raises(InputError, match=f"{words}; name an .rrd file of a run"):
            command(str(rrd), "--out", str(tmp_path / "a.png"))
        assert time.monotonic() - began < 5.0


@pytest.mark.parametrize("name", ["noise.mcap", "noise.db3", "noise"])
def test_random_bytes_are_no_bag(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(Random(1).randbytes(100_000))
    began = time.monotonic()
    with pytest.raises((InputError, BagError)):
        command(str(tmp_path / name), "--out", str(tmp_path / "a.png"))
    assert time.monotonic() - began < 5.0


def test_a_cut_bag_is_shown_and_its_loss_reported(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file,) = bag.glob("*.mcap")
    whole = file.read_bytes()
    file.write_bytes(whole[:-100])
    assert command(str(file), "--out", str(tmp_path / "a.rrd")) == 0
    assert file.name in capsys.readouterr().err


def test_no_screen_is_reported(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(InputError, match=r"no display; use --out FILE\.rrd or --out"):
        command(str(bag))


def test_what_debian_lacks_for_a_window_is_named(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> None:
        if "Xi" in name or "xkb" in name:
            raise OSError(name)

    monkeypatch.setenv("DISPLAY", ":77")
    monkeypatch.setattr(ctypes, "CDLL", missing)
    with pytest.raises(InputError, match="apt-get install libxi6 libxkbcommon-x11-0"):
        command(str(bag))


def test_nothing_is_written_for_a_bag_that_is_not_there(tmp_path: Path) -> None:
    out = tmp_path / "a.rrd"
    with pytest.raises(BagError, match="no such file"):
        command(str(tmp_path / "nowhere"), "--out", str(out))
    assert not out.exists()


@pytest.mark.parametrize("fault", ["after its end", "Ctrl-C"])
def test_a_failed_view_leaves_files_as_they_were(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str
) -> None:
    """Neither a part of a new recording nor an old one with a part of it behind."""
    out, words = tmp_path / "out" / "a.rrd", [str(bag)]
    expected: type[BaseException] = InputError
    if fault == "after its end":
        words += ["--at", "900"]
    else:
        expected, shown = KeyboardInterrupt, []

        def interrupt(*_: object) -> None:
            shown.append(0)
            if len(shown) > 20:
                raise KeyboardInterrupt

        monkeypatch.setattr(RopeView, "show", interrupt)
    for before in (None, b"an old recording"):
        if before is not None:
            out.write_bytes(before)
        with pytest.raises(expected):
            command(*words, "--out", str(out))
        left = {file.name: file.read_bytes() for file in out.parent.iterdir()}
        assert left == ({} if before is None else {out.name: before})


@pytest.mark.parametrize("at", ["0", "-3"])
def test_a_time_before_the_start_is_reported(bag: Path, tmp_path: Path, at: str) -> None:
    with pytest.raises(InputError, match=r"--at: .* is not a time in the bag"):
        command(str(bag), "--out", str(tmp_path / "a.rrd"), f"--at={at}")


def test_what_debian_lacks_for_a_picture_is_named(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> None:
        raise OSError(name)

    monkeypatch.setattr(ctypes, "CDLL", missing)
    monkeypatch.setattr(sinks, "_DRIVERS", (str(tmp_path),))
    with pytest.raises(InputError, match="apt-get install libvulkan1 mesa-vulkan-drivers"):
        command(str(bag), "--out", str(tmp_path / "a.png"))


def test_a_picture_without_a_screen(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    out = tmp_path / "lift.png"
    if missing := sinks.what_a_picture_lacks():  # a bare machine: then this is all there is
        with pytest.raises(InputError, match=re.escape(missing)):
            command(str(bag), "--out", str(out))
        return
    assert command(str(bag), "--out", str(out)) == 0
    with Image.open(out) as image:
        assert image.width == sinks.SIZE[0]
        rgb = image.convert("RGB")
        colours = {rgb.getpixel((x, y)) for x in range(0, 1600, 4) for y in range(0, 900, 4)}
    # the window is not empty: both ends of the colour bar, and slack
    for wanted in ((253, 231, 37), (68, 1, 84), (255, 64, 64)):
        near = min(max(abs(a - b) for a, b in zip(wanted, c, strict=True)) for c in colours)
        assert near < 12, wanted
