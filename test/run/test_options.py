"""Options of a run: where it records, and what its first line announces."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rope_twin.errors import InputError
from rope_twin.run import options
from rope_twin.run.options import RunOptions, add_arguments, read_options

SAME_SECOND = time.struct_time((2026, 11, 26, 12, 0, 0, 3, 330, 0))


def read(*words: str) -> RunOptions:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return read_options(parser.parse_args(words))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    at = time.strftime("%Y%m%d_%H%M%S", SAME_SECOND)
    monkeypatch.setattr(options.time, "strftime", lambda form: at)
    return tmp_path / "recordings"


def test_runs_of_one_second_record_apart(folder: Path) -> None:
    """A bag or its view that is there, and one that another run is about to make."""
    (folder / "shallow_lift_20261126_120000").mkdir(parents=True)
    (folder / "shallow_lift_20261126_120000_2.rrd").touch()
    words = (
        "import sys, time; from rope_twin.run.options import _is_free; from pathlib import Path;"
        "print(_is_free(Path(sys.argv[1])), flush=True); time.sleep(60)"
    )
    third = folder / "shallow_lift_20261126_120000_3"
    other = subprocess.Popen([sys.executable, "-c", words, str(third)], stdout=subprocess.PIPE)
    try:
        assert other.stdout is not None
        assert other.stdout.readline() == b"True\n"
        assert read("shallow_lift").record == folder / "shallow_lift_20261126_120000_4"
        assert read("shallow_lift").record == folder / "shallow_lift_20261126_120000_5"
        assert read("storm").record == folder / "storm_20261126_120000"
    finally:
        other.kill()
        other.wait()
    assert read("shallow_lift").record == third, "its claim is gone with its process"


def test_a_view_is_announced_only_where_there_will_be_one(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = read("shallow_lift", "--headless")
    monkeypatch.setattr(options, "has_rerun", lambda: True)
    assert f"view written to {chosen.record}.rrd" in chosen.announcement
    monkeypatch.setattr(options, "has_rerun", lambda: False)
    assert "no view: rerun is missing, install it with pip" in chosen.announcement
    assert ".rrd" not in chosen.announcement
    assert "rerun" not in read("shallow_lift", "--headless", "--no-record").announcement


@pytest.mark.parametrize("address", ["foo", "127.0.0.1:99999"])
def test_a_wrong_console_address_is_refused_before_the_run_begins(
    folder: Path, address: str
) -> None:
    with pytest.raises(InputError, match="not an address; give HOST:PORT"):
        read("shallow_lift", "--console", address)
    assert not folder.exists(), "no bag was begun"
