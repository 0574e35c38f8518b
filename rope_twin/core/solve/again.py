"""Whether a correction by factors of before leaves every node in balance.

Both stages of a step have the same weights p and q, and the rope hardly changes between them. Where
the first took one correction, the second tries the first's factors: that costs a third of an
elimination. Its loads and blocks are its own all the same, and what the correction leaves at a node
is found with them: the change of both element forces exactly, that of the loads by the block.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit
from rope_twin.core.jit.rows import rows, span
from rope_twin.core.jit.wide import count_beyond
from rope_twin.core.rope.elastic import find_change, growth_of
from rope_twin.core.state import BLOCK, CHANGE, CORRECTION, ELEMENTS, RESIDUAL

# What may be left at a node, of the tolerance for a tension: many nodes may lean the same way.
SHARE = 1e-3


@jit
def count_left(rope: Any, stage: Any, chunk: int) -> int:
    """Not 0 (of lanes: bits) where a node is left with a force, were motion corrected.

    Direction and tension are as if it were. Nodes follow one behind the elements. Column
    e - start + 2 of CHANGE is of element e; below the lowest there is none.
    """
    work, n, first = rope.work, rope.state.counts[ELEMENTS], rope.model.first_free
    none, left = 0.0 * growth_of(rope, stage), 0
    for k in range(CHANGE, CHANGE + 3):
        work[k, 1] = none
    for start in range(0, n, chunk):
        last = min(start + chunk, n) - 1
        done = max(start - 1, 0)
        find_change(rope, stage, none, done, last, done - start + 2)
        left |= _count(rope, max(start - 1, first), last, start)
        if last == n - 1:
            find_change(rope, stage, growth_of(rope, stage), last, n, last - start + 2)
            left |= _count(rope, max(last, first), n, start)
        else:
            for k in range(CHANGE, CHANGE + 3):
                work[k, 0] = work[k, last - start + 1]
    return left


@jit
def _count(rope: Any, low: int, high: int, start: int) -> int:
    """The same of the nodes low <= i < high."""
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
