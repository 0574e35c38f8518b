"""The same inputs give the same bits: in another process, and however the run is cut up."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from determinism_process import run

from rope_twin import Twin


def in_a_process_of_its_own(every: int) -> str:
    """The digest that a fresh process finds."""
    folder = Path(__file__).parents[1] / "support"
    done = subprocess.run(
        [sys.executable, str(folder / "determinism_process.py"), str(every)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *sys.path])},
        check=True,
        capture_output=True,
        text=True,
    )
    return done.stdout


def test_two_processes_agree_to_the_bit() -> None:
    """Twenty seconds of a rope with heave, payout, splits and a changed current."""
    digests = {in_a_process_of_its_own(2), in_a_process_of_its_own(2), run(2)}
    assert len(digests) == 1
    assert len(digests.pop()) == 64


def test_the_pieces_of_a_run_do_not_matter() -> None:
    """One step at a time or a second at once."""
    assert run(1) == run(100)


def test_the_phase_of_waves_neither() -> None:
    """Time is counted in steps, not added up: the last bit of a wave's phase is always the same."""
    pieces = []
    for every in (1, 7, 350):
        twin = Twin("wave_zone")
        for _ in range(1400 // every):
            twin.advance(every)
        pieces.append(twin.snapshot().node_velocity_m_per_s.tobytes())
    assert pieces[0] == pieces[1] == pieces[2]
