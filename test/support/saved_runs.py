"""A run with everything that a saved state must hold; as a process it resumes from a file.

    python saved_runs.py FILE FOLDER UNTIL

prints the digest of what follows in the scene that was written to FOLDER.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
from small_scene import digest, small_scene

from rope_twin import Snapshot
from rope_twin.twin.twin import Twin

SAMPLE_NS = 50_000_000  # 20 Hz
AHEAD_NS = 200_000_000
GAP_S = (6.0, 8.0)
CURRENT = np.array([[0.0, 0.2, -0.4], [-300.0, 0.1, 0.0]])


def feed(twin: Twin) -> None:
    """Send the inputs of the next step: heave with a gap and a jump, commands, NaN, a current."""
    step, step_ns = twin.steps, twin.step_ns
    due = step * step_ns + AHEAD_NS
    if due % SAMPLE_NS == 0:
        t = due * 1e-9
        if not GAP_S[0] < t < GAP_S[1]:
            jump_m = 1.0 if t >= GAP_S[1] else 0.0
            twin.submit_heave(due, 1.5 * math.sin(t) + jump_m, 1.5 * math.cos(t))
    if step == 50:
        for stamp_ns, speed in ((1_000_000_000, 1.5), (7_500_000_000, 0.2), (9_500_000_000, -1.2)):
            assert not twin.submit_speed(stamp_ns, speed)
    if step == 300:
        assert twin.submit_heave(due, math.nan, 0.0)
        assert twin.submit_speed(1, 0.5)
    if step == 500:
        assert not twin.submit_current(CURRENT)


def run_until(twin: Twin, last: int) -> list[Snapshot]:
    """Step until `last`; return a snapshot of every seventh step."""
    snapshots = []
    while twin.steps < last:
        feed(twin)
        twin.advance(1)
        if twin.steps % 7 == 0:
            snapshots.append(twin.snapshot())
    return snapshots


if __name__ == "__main__":
    scene = small_scene(Path(sys.argv[2]))
    sys.stdout.write(digest(run_until(Twin.restore(sys.argv[1], scene), int(sys.argv[3]))))
