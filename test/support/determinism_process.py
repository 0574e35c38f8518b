"""Process that prints the digest of a run with heave, winch and a change of current."""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path

import numpy as np
from small_scene import digest, small_scene

from rope_twin import Twin

SAMPLE_NS = 50_000_000


def run(every: int) -> str:
    """Run twenty seconds in pieces of `every` steps, a snapshot each second."""
    with tempfile.TemporaryDirectory() as folder:
        twin = Twin(small_scene(Path(folder)))
    snapshots = []
    for k in range(420):
        t = k * SAMPLE_NS * 1e-9
        assert not twin.submit_heave(k * SAMPLE_NS, 2.5 * math.sin(t), 2.5 * math.cos(t))
    assert not twin.submit_speed(1_000_000_000, 1.5)
    for second in range(20):
        for _ in range(100 // every):
            twin.advance(every)
        snapshots.append(twin.snapshot())
        if second == 9:
            assert not twin.submit_speed(12_000_000_000, -1.0)
            assert not twin.submit_current(np.array([[0.0, 0.2, -0.4], [-300.0, 0.1, 0.0]]))
    assert snapshots[-1].solver.splits > 0
    return digest(snapshots)


if __name__ == "__main__":
    sys.stdout.write(run(int(sys.argv[1])))
