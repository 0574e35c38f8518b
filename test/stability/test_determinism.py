"""Determinism: equal inputs give equal bits in another process and in any call pattern."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from determinism_process import run

from rope_twin import Twin


def digest_of_another_process(every: int) -> str:
    """Return the digest that a new process computes."""
    folder = Path(__file__).parents[1] / "support"
    done = subprocess.run(
        [sys.executable, str(folder / "determinism_process.py"), str(every)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *sys.path])},
        check=True,
        capture_output=True,
        text=True,
    )
    return done.stdout


def test_two_processes_are_bit_identical() -> None:
    """Twenty seconds of a rope with heave, payout, splits and a changed current."""
    digests = {digest_of_another_process(2), digest_of_another_process(2), run(2)}
    assert len(digests) == 1
    assert len(digests.pop()) == 64


def test_a_run_is_independent_of_the_call_pattern() -> None:
    """One step at a time or a second at once."""
    assert run(1) == run(100)


def test_the_wave_phase_is_independent_of_the_call_pattern() -> None:
    """Time is counted in steps, not added up: the last bit of a wave's phase is always the same."""
    pieces = []
    for every in (1, 7, 350):
        twin = Twin("wave_zone")
        for _ in range(1400 // every):
            twin.advance(every)
        pieces.append(twin.snapshot().node_velocity_m_per_s.tobytes())
    assert pieces[0] == pieces[1] == pieces[2]
