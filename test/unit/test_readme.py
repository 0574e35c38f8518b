"""The README and what it speaks of stay the same: the topic table, the commands, CI's one line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rope_twin.cli import COMMANDS, main
from rope_twin.scene.load import scene_names
from rope_twin.topics import TOPICS

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def table(heading: str) -> list[list[str]]:
    """Cells of the first table below a heading, without its two head rows."""
    below = README.split(f"\n## {heading}\n", 1)[1]
    rows = re.search(r"(?:^\|.*\n)+", below, re.MULTILINE)
    assert rows is not None
    lines = rows.group().splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]


def test_the_topic_table_is_the_one_in_the_code() -> None:
    expected = [
        [
            f"`{topic.name}`",
            topic.type_name.replace("/msg/", "/"),
            topic.publisher or "(a sensor)",
            f"{topic.rate_hz:g} Hz" if topic.rate_hz else "on change",
            topic.qos.value,
            topic.about,
        ]
        for topic in TOPICS
    ]
    assert table("Topics") == expected


def test_all_scenes_are_told_of() -> None:
    assert sorted(row[0] for row in table("Scenes")) == sorted(scene_names())


def test_it_opens_with_two_commands_and_ci_runs_the_second() -> None:
    commands = README.split("```")[1].strip().splitlines()
    assert len(commands) == 2
    assert commands[0].endswith("rope_twin run")
    assert commands[1] in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("command", [name.replace("_", "-") for name in COMMANDS])
def test_the_commands_exist(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert f"`rope_twin {command}" in README
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    assert "usage: rope_twin" in capsys.readouterr().out
