"""The documentation builds without a warning: every page is listed, every link leads somewhere."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the documentation by the command that CONTRIBUTING.md gives, into another folder."""
    built = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "docs", str(built)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return built


@pytest.mark.parametrize("page", ["validation", "performance", "how-to/own_scenes"])
def test_pages_are_built(site: Path, page: str) -> None:
    assert (site / f"{page}.html").stat().st_size > 0
