"""Rows of the scratch matrix: views of a span of nodes, filling, copying.

Loops over a view count from 0, which lets the compiler vectorise them; over low to high it would
have to allow for negative indices.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit import jit_inline
from rope_twin.core.state import BLOCK


@jit_inline
def rows(work: Any, first: int, low: int, high: int) -> Any:
    """The x, y and z rows of the vector that begins at row `first`, nodes low to high."""
    return work[first][low:high], work[first + 1][low:high], work[first + 2][low:high]


@jit_inline
def blocks(work: Any, low: int, high: int) -> Any:
    """The xx, xy, xz, yy, yz and zz rows of the node blocks, nodes low to high."""
    return (
        work[BLOCK][low:high], work[BLOCK + 1][low:high], work[BLOCK + 2][low:high],
        work[BLOCK + 3][low:high], work[BLOCK + 4][low:high], work[BLOCK + 5][low:high],
    )  # fmt: skip


@jit_inline
def fill(table: Any, first: int, value: float, low: int, high: int) -> None:
    """Set a vector to `value` for the nodes low <= i < high."""
    for k in range(first, first + 3):
        row = table[k][low:high]
        for i in range(high - low):
            row[i] = value


@jit_inline
def copy(source: Any, first: int, target: Any, first_target: int, count: int, n: int) -> None:
    """Copy `count` rows for the nodes 0 <= i < n."""
    for k in range(count):
        a, b = source[first + k], target[first_target + k]
        for i in range(n):
            b[i] = a[i]
