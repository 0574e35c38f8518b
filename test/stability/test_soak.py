"""Memory of long runs: a day of twin time as fast as possible, and paced runs in real time.

`pytest -m long -n 0 -s test/stability/test_soak.py` prints what was measured. The paced runs take
ROPE_TWIN_SOAK_S seconds of real time each (default: an hour).
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

DAY_S = 86_400
PACED_S = float(os.environ.get("ROPE_TWIN_SOAK_S", "3600"))
SETTLED = 0.2  # share of the run after which all that is made once has been made
GROWTH_PCT = 1.0


def resident_mb(arguments: list[str], folder: Path) -> list[float]:
    """Run `rope_twin` and return its resident memory [MB] of about every 1/200 of the run."""
    command = [sys.executable, "-m", "rope_twin", "run", "deep_lift", "--headless", *arguments]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)
    watched = psutil.Process(process.pid)
    found: list[float] = []
    while process.poll() is None:
        children = watched.children(recursive=True)
        total = sum(one.memory_info().rss for one in (watched, *children) if one.is_running())
        found.append(total / 1e6)
        time.sleep(1.0)
    assert process.returncode == 0
    return found


@pytest.mark.long
@pytest.mark.parametrize(
    "arguments",
    [
        ["--speed", "0", "--duration", str(DAY_S), "--no-record"],
        ["--duration", f"{PACED_S:g}", "--no-record"],
        ["--duration", f"{PACED_S:g}", "--out", "bag"],
    ],
    ids=["a day, unpaced", "paced", "paced and recorded"],
)
def test_memory_use_does_not_grow(arguments: list[str], tmp_path: Path) -> None:
    """By less than 1 % from the end of the first fifth to the end, by the line of best fit."""
    resident = resident_mb(arguments, tmp_path)
    settled = np.array(resident[int(SETTLED * len(resident)) : -2])
    slope, begin = np.polyfit(np.arange(len(settled)), settled, 1)
    growth_pct = 100.0 * slope * len(settled) / begin
    print(f"{' '.join(arguments)}: {begin:.1f} MB, {growth_pct:+.2f} % over {len(settled)} s")
    assert growth_pct < GROWTH_PCT
