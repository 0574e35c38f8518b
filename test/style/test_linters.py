"""Lint, format and types, as everyone runs them: on the whole project, without exceptions here."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


CODE = ["rope_twin", "validation", "benchmarks", "test", "docs", "launch", "setup.py"]
COMMANDS = [["ruff", "check", *CODE], ["ruff", "format", "--check", *CODE], ["mypy"]]


@pytest.mark.parametrize("command", COMMANDS, ids=["lint", "format", "types"])
def test_clean(command: list[str]) -> None:
    """The tool has nothing to say."""
    done = subprocess.run(
        [sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
