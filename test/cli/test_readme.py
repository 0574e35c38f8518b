"""The README is short, opens with the two commands, and links to what is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rope_twin.cli import COMMANDS, main

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_it_opens_with_two_commands_and_ci_runs_the_second() -> None:
    commands = README.split("```")[1].strip().splitlines()
    assert len(commands) == 2
    assert commands[0].endswith("rope_twin run")
    assert commands[1] in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()


def test_it_fits_a_few_screens() -> None:
    assert len(README.splitlines()) <= 150


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md"])
def test_links_lead_somewhere(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#]+)", text)
    assert [link for link in links if not (ROOT / link).exists()] == []


@pytest.mark.parametrize("command", [name.replace("_", "-") for name in COMMANDS])
def test_the_commands_exist(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    assert "usage: rope_twin" in capsys.readouterr().out
