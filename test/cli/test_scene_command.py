"""`rope_twin scene list | show | check`, through the parser that the command adds."""

import argparse
import json
from pathlib import Path

import pytest
from scene_text import GOOD, spoilt, written

from rope_twin.cli import scene
from rope_twin.scene.load import load_scene, scene_names

# By the step of deep_lift, so that no other one is compiled.
COMMON = GOOD.replace("  - payload: {}\n", "  - added_mass: {}\n  - payload: {}\n")


def command(*words: str) -> int:
    parser = argparse.ArgumentParser(prog="rope_twin")
    scene.add_arguments(parser.add_subparsers(required=True).add_parser("scene"))
    args = parser.parse_args(["scene", *words])
    code = scene.run(args)
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
        "static top tension   319.5 kN, safety factor 3.17, without current",
        "first axial period   10.06 s",
        "1.5 % of critical",
        "-0.5 m/s from 30 s",
    ):
        assert words in out
    assert "warning" not in out


BENCH = """\
about: a kilogram on a metre of cord
source: bench model
ropes:
  - name: cord
    rope: {diameter_m: 0.002, hydrodynamic_diameter_m: 0.002, mass_kg_per_m: 0.003,
           axial_stiffness_n: 2000.0, breaking_load_n: 100.0}
    length_m: 1.0
    elements: 3
    damping: {fraction_of_first_axial_mode: 0.01}
    to: load
payloads: [{name: load, mass_kg: 1.0, shape: {sphere: {diameter_m: 0.05}}}]
effects: [weight: {}, payload: {}]
time: {step_s: 0.0002}
"""


def test_show_prints_two_digits_of_small_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An MBL of 100 N is not 0 kN; three elements, the fewest, are not too many for 1 m."""
    assert command("show", str(written(tmp_path, BENCH))) == 0
    out = capsys.readouterr().out
    for words in (
        "EA 0.002 MN, MBL 0.1 kN",
        "rope in water        -0.0022 N/m",
        "payload in water     0.0091 kN",
        "static elongation    0.0046 m",
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
    path = written(tmp_path, COMMON)
    assert command("check", str(path)) == 0
    out, err = capsys.readouterr()
    assert out == f"{path}: valid, no warnings\n"
    assert err == ""


def test_check_prints_warnings_and_stays_at_zero(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = COMMON.replace("elements: 50", "elements: 5").replace("step_s: 0.01", "step_s: 0.04")
    path = written(tmp_path, text)
    assert command("check", str(path)) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(": ")[:2] for line in lines[:2]] == [
        ["warning", "ropes[0].elements"],
        ["warning", "time.step_s"],
    ]
    assert lines[-1].endswith(": valid, 3 warnings")


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


def test_check_of_a_payload_that_floats_up_is_one_json_object(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    light = "mass_kg: 1.0\n    displaced_volume_m3: 9.0"
    path = written(tmp_path, spoilt("mass_kg: 20000.0", light))
    assert command("check", str(path), "--json") == 1
    found = json.loads(capsys.readouterr().out)
    assert found["valid"] is False
    assert [sentence for sentence in found["errors"] if "floats up" in sentence]
    assert any("payloads[0]: it floats" in sentence for sentence in found["warnings"])
    assert command("check", str(path)) == 1
    out, err = capsys.readouterr()
    assert "floats up" in err
    assert out.splitlines() == [f"warning: {sentence}" for sentence in found["warnings"]]


def errors_of(text: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return the errors that `scene check` prints: `line, key path: problem; remedy`."""
    path = written(folder, text)
    assert command("check", str(path)) == 1
    out, err = capsys.readouterr()
    assert out == ""
    *found, last = err.splitlines()
    assert last == f"{len(found)} errors"
    assert all(sentence.startswith(f"{path}, line ") for sentence in found)
    assert all(": " in sentence and "; " in sentence and sentence[-1] in ".?" for sentence in found)
    return [sentence.removeprefix(f"{path}, line ") for sentence in found]


def test_check_lists_all_errors_of_single_values_by_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It stopped at the first: mending a scene took as many rounds as it had errors."""
    text = spoilt("elements: 50", "elements: many").replace("source:", "sauce:")
    text = text.replace("mass_kg: 20000.0", "mass_kg: -1.0").replace("{at_s: 20.0, ", "{")
    text = text.replace("normal: 1.2, tangential: 0.02", "normal: 99.0, tangental: .nan")
    text = text.replace("[0.0, [0.5, 0.0]]", "[0.0, [fast, 0.0]]").replace("[0.0, 0.0, 0.0]", "0")
    text = text.replace("  - weight: {}", "  - weight: {}\n  - weight: {}")
    text = text.replace("    to: tool\n", "    to: tool\n    to: tools\n")
    starts = (
        "2, sauce: unknown key; did you mean 'source'?",
        "8, ropes[0].elements: the text 'many' is not a number; give a number (",
        "11, ropes[0].to: the key 'to' is given a second time (first in line 10); keep",
        "14, payloads[0].mass_kg: -1 kg is out of range; give 0 to 1e+07 kg",
        "23, winch.schedule[1]: at_s missing; add at_s",
        "25, ship.hang_off_m: the number 0 instead of a list; give a list",
        "30, effects[1].drag.tangental: unknown key; did you mean 'tangential'?",
        "30, effects[1].drag.normal: 99 is out of range; give 0 to 10",
        "31, effects[2].current.profile[0][1][0]: the text 'fast' is not a number",
        "33, effects[4].weight: this effect is listed a second time; keep one of them.",
    )
    found = errors_of(text, tmp_path, capsys)
    assert len(found) == len(starts), found
    for sentence, start in zip(found, starts, strict=True):
        assert sentence.startswith(start)


def test_check_lists_all_errors_between_values_by_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = spoilt("fraction_of_first_axial_mode: 0.02", "").replace("to: tool", "to: toll")
    text = text.replace("speed_m_per_s: 0.5", "speed_m_per_s: 1.5").replace(
        "repeats_every_s: 40.0", "repeats_every_s: 10.0"
    )
    text = text.replace("{start_s: 10.0", "{on_waves: {}, start_s: 10.0")
    starts = (
        "9, ropes[0].damping: no damping is given; ",
        "10, ropes[0].to: there is no payload 'toll'; did you mean 'tool'?",
        "12, payloads[0]: no rope holds 'tool'; ",
        "21, winch.schedule[0].speed_m_per_s: 1.5 m/s exceeds the winch's 1; ",
        "23, winch.schedule_repeats_every_s: 10 s cuts off the row at 20 s; ",
        "25, sea_state.on_waves: `waves` is not listed; ",
    )
    found = errors_of(text, tmp_path, capsys)
    assert len(found) == len(starts), found
    for sentence, start in zip(found, starts, strict=True):
        assert sentence.startswith(start)


def test_a_slope_is_reported_in_figures(capsys: pytest.CaptureFixture[str]) -> None:
    """Not as a table of two rows."""
    assert command("show", "landing") == 0
    assert "seabed depth_m 400, slope (0.02, 0)," in " ".join(capsys.readouterr().out.split())
