"""`rope_twin scene list | show | check`, through the parser that the command adds."""

import argparse
from pathlib import Path

import pytest
from scene_text import GOOD, spoilt, written

from rope_twin.commands import scene
from rope_twin.scene.load import load_scene, scene_names


def command(*words: str) -> int:
    parser = argparse.ArgumentParser(prog="rope_twin")
    scene.add_parser(parser.add_subparsers(required=True))
    args = parser.parse_args(["scene", *words])
    code = args.run(args)
    assert isinstance(code, int)
    return code


@pytest.mark.parametrize(("columns", "most"), [(60, 60), (300, 100)])
def test_list_tells_each_scene_as_wide_as_the_terminal(
    columns: int, most: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name begins a line, what does not fit stands below the words; 100 columns at most."""
    monkeypatch.setenv("COLUMNS", str(columns))
    assert command("list") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if line[0] != " "] == scene_names()
    assert all(load_scene(name).about.split()[-1] in " ".join(lines) for name in scene_names())
    assert most - 20 < max(len(line) for line in lines) <= most


def test_show_tells_parts_and_what_follows(capsys: pytest.CaptureFixture[str]) -> None:
    assert command("show", "deep_lift") == 0
    out = capsys.readouterr().out
    for words in (
        "3000 m in 100 elements",
        "bag sea_2p5m",
        "drag normal 1.9, tangential 0.03",
        "current profile 4 rows",
        "payload in water     155.9 kN",
        "static top tension   319.5 kN, safety factor 3.17",
        "first axial period   10.06 s",
        "1.5 % of critical",
        "-0.5 m/s from 30 s",
    ):
        assert words in out
    assert "warning" not in out


def test_show_takes_a_fixed_end_and_warns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = spoilt("    to: tool\n", "    fixed_at_m: [0.0, 0.0, -510.0]\n")
    text = text.replace(text[text.index("payloads:") : text.index("winch:")], "")
    path = written(tmp_path, text.replace("  - payload: {}\n", ""))
    assert command("show", str(path)) == 0
    out = capsys.readouterr().out
    assert "to the fixed point (0.0, 0.0, -510.0) m" in out
    assert "static top tension" not in out
    assert "warning: ropes[0].fixed_at_m: " in out


def test_check_of_a_sound_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, GOOD)
    assert command("check", str(path)) == 0
    out, err = capsys.readouterr()
    assert out == f"{path}: scene 'scene' is sound, no warning\n"
    assert err == ""


def test_check_prints_warnings_and_stays_at_zero(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = spoilt("elements: 50", "elements: 5").replace("step_s: 0.01", "step_s: 0.04")
    path = written(tmp_path, text)
    assert command("check", str(path)) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(": ")[:2] for line in lines[:2]] == [
        ["warning", "ropes[0].elements"],
        ["warning", "time.step_s"],
    ]
    assert lines[-1].endswith("is sound, 3 warnings")


@pytest.mark.parametrize("action", ["check", "show"])
def test_a_bad_scene_gets_one_sentence_and_one(
    action: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, spoilt("elements: 50", "elements: many"))
    assert command(action, str(path)) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"{path}, line 8, ropes[0].elements: the text 'many' is not a number; ")
    assert err.count("\n") == 1


def test_a_slope_is_told_in_figures(capsys: pytest.CaptureFixture[str]) -> None:
    """Not as a table of two rows."""
    assert command("show", "landing") == 0
    assert "seabed depth_m 400, slope (0.02, 0)," in " ".join(capsys.readouterr().out.split())
