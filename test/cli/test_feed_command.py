"""`rope_twin feed`: what it prints of recorded lines, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from feed_samples import DATA

from rope_twin.cli import main


def test_a_recorded_winch_is_printed_in_si(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["feed", str(DATA / "cwnc.txt"), "--settings", "lci90i_pounds", "--speed", "0"]
    assert main(words) == 0
    reported = capsys.readouterr()
    lines = reported.out.splitlines()
    assert len(lines) == 300
    assert lines[0] == (
        "20:04:03.313000  winch  line out 0.00 m  speed +0.000 m/s  tension -10369 N"
    )
    assert reported.err.splitlines()[-1] == (
        "winch: 300 lines, 300 accepted, 0 refused; 1 hole, the longest of 19.0 s"
    )


def test_a_recorded_ship_as_one_object(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["feed", str(DATA / "seap.txt"), "--settings", "seapath", "--speed", "0", "--json"]
    assert main(words) == 0
    feed = json.loads(capsys.readouterr().out)["feeds"]["ship"]
    assert (feed["accepted"], feed["refused"], feed["other_sentences"]) == (50, {}, 300)
    assert feed["last"]["heave_rate_m_per_s"] is None


def test_lines_of_another_instrument_are_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["feed", str(DATA / "seap.txt"), "--settings", "lci90i_pounds", "--speed", "0"]
    assert main(words) == 1
    assert "0 accepted" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        (["x.log", "--settings", "seapath"], "x.log"),
        (["--settings", "seapth"], "did you mean 'seapath'?"),
        (["udp://:1", "--settings", "seapath", "--speed", "-1"], "--speed"),
        (["udp://:1", "--settings", "seapath", "--duration", "0s"], "--duration"),
        (["http://x:1", "--settings", "seapath"], "it is no address"),
    ],
)
def test_what_cannot_be_read_is_reported_in_one_sentence(
    words: list[str], reported: str, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["feed", *words]) == 1
    (sentence,) = capsys.readouterr().err.splitlines()
    assert reported in sentence
