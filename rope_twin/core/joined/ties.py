"""Links: spring-dampers from a connection to a fixed point (tether) or another one (strut).

The tension of a link along the line between its ends is FORCE + STIFFNESS·(l - LENGTH) +
DAMPING·dl/dt, never less than LEAST: 0 for a rope, minus infinity for a bar that also takes
compression. A tether with FORCE alone is a constant-tension tugger.

Its block is AXIAL·d·dᵀ + GEOMETRIC·I like that of an element. A bar in compression has no geometric
part: it would be negative, p·T/l, which is negligible relative to the mass at its ends.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.guards import LINK2_MIN
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import column
from rope_twin.core.state import CORRECTION, POSITION, RESIDUAL, VELOCITY

ANCHORED = -1  # in the row SECOND: the link's other end is the fixed point AT
# Properties of a link, and results of the step; one column per link:
FIRST, SECOND = 0, 1  # joints at its ends
AT = 2  # the fixed point [m]
FORCE, LENGTH, STIFFNESS, DAMPING, LEAST = 5, 6, 7, 8, 9  # [N], [m], [N/m], [N·s/m], [N]
TOWARDS = 10  # unit vector from the first end to the second
PULL, EXPECTED, AXIAL, GEOMETRIC, TIE_ROWS = 13, 14, 15, 16, 17


@jit_within
def _difference(ties: Any, work: Any, first: int, k: int, fixed: Any) -> Any:
    """Return a vector at the second end relative to the first."""
    ax, ay, az = column(work, first, int(ties[FIRST, k]))
    second = int(ties[SECOND, k])
    if second != ANCHORED:
        fixed = column(work, first, second)
    return fixed[0] - ax, fixed[1] - ay, fixed[2] - az


@jit
def pull_ties(ties: Any, work: Any, p: float, q: float) -> None:
    """Set direction, tension and stiffness of all links from the motion of the connections."""
    still = (0.0, 0.0, 0.0)
    for k in range(ties.shape[1]):
        x, y, z = _difference(ties, work, POSITION, k, column(ties, AT, k))
        vx, vy, vz = _difference(ties, work, VELOCITY, k, still)
        length = sqrt(x * x + y * y + z * z + LINK2_MIN)
        x, y, z = x / length, y / length, z / length
        rate = x * vx + y * vy + z * vz
        pull = ties[FORCE, k] + ties[STIFFNESS, k] * (length - ties[LENGTH, k])
        pull += ties[DAMPING, k] * rate
        acts = pull > ties[LEAST, k]
        pull = pull if acts else ties[LEAST, k]
        across = p * max(pull, 0.0) / length
        along = p * ties[STIFFNESS, k] + q * ties[DAMPING, k] - across
        ties[TOWARDS, k], ties[TOWARDS + 1, k], ties[TOWARDS + 2, k] = x, y, z
        ties[PULL, k] = pull
        ties[AXIAL, k] = max(along, 0.0) if acts else 0.0
        ties[GEOMETRIC, k] = across


@jit
def add_ties(ties: Any, work: Any, matrix: Any) -> None:
    """Add forces and blocks of the links to the connections (the matrix's lower triangle)."""
    for k in range(ties.shape[1]):
        i, j = int(ties[FIRST, k]), int(ties[SECOND, k])
        for a in range(3):
            force = ties[PULL, k] * ties[TOWARDS + a, k]
            work[RESIDUAL + a, i] += force
            if j != ANCHORED:
                work[RESIDUAL + a, j] -= force
            for b in range(3):
                block = ties[AXIAL, k] * ties[TOWARDS + a, k] * ties[TOWARDS + b, k]
                if a == b:
                    block += ties[GEOMETRIC, k]
                if a >= b:
                    matrix[3 * i + a, 3 * i + b] += block
                if j != ANCHORED:
                    if a >= b:
                        matrix[3 * j + a, 3 * j + b] += block
                    matrix[3 * max(i, j) + a, 3 * min(i, j) + b] -= block


@jit
def expect_pulls(ties: Any, work: Any) -> None:
    """Store the tension that the linearisation predicts after the correction."""
    for k in range(ties.shape[1]):
        dx, dy, dz = _difference(ties, work, CORRECTION, k, (0.0, 0.0, 0.0))
        x, y, z = column(ties, TOWARDS, k)
        along = x * dx + y * dy + z * dz
        ties[EXPECTED, k] = ties[PULL, k] + (ties[AXIAL, k] + ties[GEOMETRIC, k]) * along


@jit
def count_unexpected_ties(ties: Any, tolerance: float) -> int:
    """Return the number of links whose tension deviates from the linearisation, or is NaN."""
    wrong = 0
    for k in range(ties.shape[1]):
        wrong += not (abs(ties[PULL, k] - ties[EXPECTED, k]) <= tolerance)
    return wrong
