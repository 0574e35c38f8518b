"""Factor reuse (simplified Newton): residual of a correction with the previous factors.

Both stages of a step have the same weights p and q, and the rope changes little between them. Where
the first needed one correction, the second tries the first's factors: that costs a third of an
elimination. Its loads and blocks are still its own, and the residual after the correction is
evaluated with them: the change of both element forces exactly, that of the loads by the block.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit
from rope_twin.core.jit.rows import rows, span
from rope_twin.core.jit.wide import count_beyond
from rope_twin.core.rope.elastic import find_change
from rope_twin.core.state import BLOCK, CHANGE, CORRECTION, ELEMENTS, RESIDUAL, REST

# Residual tolerance at a node over that of a tension: residuals of many nodes may add up.
SHARE = 1e-3


@jit
def count_left(rope: Any, stage: Any, chunk: int) -> int:
    """Return nonzero (for SIMD batches: lane bits) if a node has a residual after the correction.

    Direction and tension are set as if motion were corrected. Nodes follow one behind the elements.
    Column e - start + 2 of CHANGE belongs to element e; below the lowest there is none.
    """
    work, n, first = rope.work, rope.state.counts[ELEMENTS], rope.model.first_free
    none, left = 0.0 * work[REST, 0], 0
    for k in range(CHANGE, CHANGE + 3):
        work[k, 1] = none
    for start in range(0, n, chunk):
        end = min(start + chunk, n)
        done, last = max(start - 1, 0), n if end == n else end - 1
        find_change(rope, stage, done, last, done - start + 2)
        left |= _count(rope, max(start - 1, first), last, start)
        for k in range(CHANGE, CHANGE + 3):
            work[k, 0] = work[k, last - start + 1]
    return left


@jit
def _count(rope: Any, low: int, high: int, start: int) -> int:
    """Return nonzero if one of the nodes low <= i < high has a residual."""
    work, least = rope.work, SHARE * rope.model.tolerance
    fx, fy, fz = rows(work, CHANGE, low - start + 2)
    gx, gy, gz = rows(work, CHANGE, low - start + 1)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    count = 0
    for i in range(high - low):
        x = Rx[i] + (fx[i] - gx[i]) - (Axx[i] * dx[i] + Axy[i] * dy[i] + Axz[i] * dz[i])
        y = Ry[i] + (fy[i] - gy[i]) - (Axy[i] * dx[i] + Ayy[i] * dy[i] + Ayz[i] * dz[i])
        z = Rz[i] + (fz[i] - gz[i]) - (Axz[i] * dx[i] + Ayz[i] * dy[i] + Azz[i] * dz[i])
        count = count_beyond(count, abs(x) + abs(y) + abs(z), 0.0, least)
    return count
