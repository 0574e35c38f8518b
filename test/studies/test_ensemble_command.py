"""`rope_twin ensemble`: members equal to runs of their own, tables, files, exit codes."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rope_twin.cli import main
from rope_twin.core.jit.wide import LANES
from rope_twin.files import share_dir

SHALLOW = "shallow_lift"
Printed = pytest.CaptureFixture[str]


def written() -> dict[str, Any]:
    """Return the text of the file of shallow_lift."""
    text = (share_dir() / "config" / "scenes" / f"{SHALLOW}.yaml").read_text(encoding="utf-8")
    scene: dict[str, Any] = yaml.safe_load(text)
    return scene


def scene_file(folder: Path, **changed: Any) -> Path:
    """shallow_lift with parts replaced; None leaves one out."""
    scene = {key: part for key, part in {**written(), **changed}.items() if part is not None}
    path = folder / "changed.yaml"
    path.write_text(yaml.safe_dump(scene, allow_unicode=True))
    return path


@pytest.fixture(scope="module")
def regular(tmp_path_factory: pytest.TempPathFactory) -> str:
    """shallow_lift in a sine instead of its recorded sea, its winch at rest."""
    sea = {"heave": {"amplitude_m": 0.3, "period_s": 8.0}}
    return str(scene_file(tmp_path_factory.mktemp("scene"), sea_state=sea, winch=None))


def run_json(capsys: Printed, *words: str) -> dict[str, Any]:
    """The JSON of a run that came to its end."""
    assert main([*words, "--json"]) == 0
    reported: dict[str, Any] = json.loads(capsys.readouterr().out)
    return reported


def test_each_member_equals_a_run_of_its_own(tmp_path: Path, capsys: Printed) -> None:
    """Same scene with the member's numbers in its file, through `rope_twin run --speed 0`."""
    reported = run_json(
        capsys, "ensemble", SHALLOW, "--vary", "payloads[0].mass_kg=15000,30000",
        "--sea-offset", "0..400s", "--members", "2", "--duration", "12", "--seed", "5",
    )  # fmt: skip
    assert reported["members"] == 4
    for row in reported["rows"]:
        scene = written()
        scene["payloads"][0]["mass_kg"] = row["payloads[0].mass_kg"]
        sea = {**scene["sea_state"], "start_s": row["sea_offset_s"]}
        path = scene_file(tmp_path, payloads=scene["payloads"], sea_state=sea)
        alone = run_json(
            capsys,
            "run",
            str(path),
            "--speed",
            "0",
            "--duration",
            "12",
            "--no-record",
            "--headless",
        )
        for name in ("tension_top_max_n", "tension_top_min_n"):
            assert row[name] == alone[name]
        assert row["tension_top_mean_n"] == pytest.approx(alone["tension_top_mean_n"], rel=1e-12)
        assert row["steps"] == alone["steps"]


def test_regular_seas_can_be_varied(regular: str, capsys: Printed) -> None:
    """Twice a small heave, twice the motion of the tension."""
    reported = run_json(
        capsys, "ensemble", regular, "--vary", "sea_state.heave.amplitude_m=0.01,0.02",
        "--duration", "20",
    )  # fmt: skip
    ranges = [row["tension_top_max_n"] - row["tension_top_min_n"] for row in reported["rows"]]
    assert ranges[0] > 100.0
    assert ranges[1] / ranges[0] == pytest.approx(2.0, rel=0.02)


def test_quantiles_and_csv_tell_the_same(regular: str, tmp_path: Path, capsys: Printed) -> None:
    out = tmp_path / "members.csv"
    words = ["ensemble", regular, "--sea-offset", "0..8", "--members", "7", "--duration", "5"]
    reported = run_json(capsys, *words, "--out", str(out))
    with out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["member"]) for row in rows] == list(range(7))
    tops = [float(row["tension_top_max_n"]) for row in rows]
    assert tops == [row["tension_top_max_n"] for row in reported["rows"]]
    assert reported["tension_top_max_n"] == pytest.approx(np.quantile(tops, reported["quantiles"]))
    assert reported["tension_top_max_n"][0] == min(tops)
    assert run_json(capsys, *words)["rows"] == reported["rows"]


def test_the_text_has_a_line_for_each_figure_and_point(regular: str, capsys: Printed) -> None:
    words = ["--vary", "effects.drag.normal=1.0..2.0:2", "--sea-offset", "0..8"]
    each, count = LANES // 4, LANES // 2  # fewer than fill a batch
    assert main(["ensemble", regular, *words, "--members", f"{each}", "--duration", "2"]) == 0
    reported = capsys.readouterr()
    assert f"changed: {count} members, 2 s each" in reported.out
    assert "maximum top tension [kN]" in reported.out
    points = [line.split()[0] for line in reported.out.split("(median")[1].splitlines()[1:3]]
    assert points == ["1", "2"]
    assert "0 stopped early" in reported.out
    stepped = f"0 of {count} members stepped in SIMD batches of {LANES}; {count} one by one"
    assert f"{stepped} (too few" in reported.out
    assert f"{count} members are in static equilibrium" in reported.err


def test_members_that_stop_are_named(regular: str, capsys: Printed, tmp_path: Path) -> None:
    """Exit code 3 with one, 1 with all of them; a payload that floats cannot start."""
    mass = "payloads[0].mass_kg"
    words = ["ensemble", regular, "--duration", "0.5", "--out", str(tmp_path / "rows.csv")]
    assert main([*words, "--vary", f"{mass}=0,20000"]) == 3
    reported = capsys.readouterr()
    assert "1 stopped early" in reported.out
    assert "member 0: " in reported.err
    assert "at rest it floats" in reported.err
    with (tmp_path / "rows.csv").open(encoding="utf-8") as file:
        first, second = csv.DictReader(file)
    assert first["steps"] == "0"
    assert first["tension_top_max_n"] == second["failure"] == ""
    assert main([*words, "--vary", f"{mass}=0", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["failed"] == 1


def test_a_rope_that_would_break_is_counted(regular: str, capsys: Printed) -> None:
    share = "ropes[0].rope.breaking_load_n"
    reported = run_json(
        capsys, "ensemble", regular, "--vary", f"{share}=1e5,1e6", "--duration", "0.5"
    )
    assert reported["overloaded"] == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "ensemble: nothing varies"),
        (["--vary", "payloads[0].mas_kg=1..2"], "payloads[0].mas_kg: unknown key; did you mean"),
        (["--vary", "effects.drag.normal=9..99"], "effects.drag.normal: "),
        (["--vary", "time.step_s=0.01..0.02"], "time.step_s: all members have it in common"),
        (["--sea-offset=-9..-1"], "--sea-offset: -4.9"),
        (["--sea-offset", "0..9", "--duration", "0"], "--duration: 0 s is not possible"),
        (["--sea-offset", "0..9", "--duration", "0.0153"], "--duration: 0.0153 s is not possible"),
        (["--sea-offset", "0..9", "--time-step", "0.5"], "--time-step: 0.5 s is not possible"),
        (["--sea-offset", "0..9", "--slack-interval", "0"], "--slack-interval: 0.0 s is not pos"),
        (["--sea-offset", "0..9", "--jobs", "0"], "--jobs: 0 threads; give 1 or more."),
        (["--sea-offset", "0..9", "--seed", "-1"], "--seed: -1 is negative"),
        (["--sea-offset", "0..9", "--out", "/nowhere/x.csv"], "--out: there is no folder"),
    ],
)
def test_what_cannot_be_is_reported_in_one_sentence(
    regular: str, words: list[str], said: str, capsys: Printed
) -> None:
    assert main(["ensemble", regular, "--members", "2", *words]) == 1
    reported = capsys.readouterr()
    assert said in reported.err
    assert reported.err.strip().count("\n") == 0
    assert reported.out == ""


def test_an_offset_beyond_a_looped_record_is_refused_as_by_a_run(
    tmp_path: Path, capsys: Printed
) -> None:
    path = str(scene_file(tmp_path, sea_state={"bag": "sea_1p2m"}))
    words = "it lasts 1200 s; right is 0 to less than 1200 s."
    for command in (
        ["run", path, "--speed", "0", "--sea-offset", "360000"],
        ["ensemble", path, "--sea-offset", "100h,100h"],
    ):
        assert main([*command, "--duration", "12"]) == 1
        assert capsys.readouterr().err == f"start of the record at 360000 s: {words}\n"


def test_a_sea_that_ends_too_early(tmp_path: Path, capsys: Printed) -> None:
    path = scene_file(tmp_path, sea_state={"bag": "sea_1p2m", "loop": False})
    words = [
        "ensemble",
        str(path),
        "--sea-offset",
        "0..1100",
        "--members",
        "20",
        "--duration",
        "300",
    ]
    assert main(words) == 1
    assert "--duration 300: the sea of member" in capsys.readouterr().err
    still = scene_file(tmp_path, sea_state={})
    assert main(["ensemble", str(still), "--sea-offset", "0..9"]) == 1
    assert "--sea-offset: the scene's ship lies still; leave it out" in capsys.readouterr().err
