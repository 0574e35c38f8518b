"""Steady current: a profile over depth that turns, linear between its points.

Above the first and below the last point the end values hold. U is horizontal.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.state import FLOW, POSITION, Floats
from rope_twin.core.terms import kernel
from rope_twin.quantity import quantity

Point = tuple[float, tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class CurrentParams:
    """Rows of height z (from the surface down) and velocity east, north."""

    profile: tuple[Point, ...] = quantity("rows of z [m] and [east, north] [m/s]", "")

    def check(self) -> str | None:
        """What is wrong with the profile and what would be right, or None."""
        heights = [z for z, _ in self.profile]
        if len(heights) < 1:
            return "it has no row; give at least one [z, [east, north]]"
        for above, below in itertools.pairwise(heights):
            if not below < above:
                return f"z = {below:g} m follows z = {above:g} m; order rows from the surface down"
        if max(heights) > 0.0 or min(heights) < -12e3:
            return "a row lies outside the water; give z from 0 down to -12000 m"
        speeds = [abs(u) for _, velocity in self.profile for u in velocity]
        if max(speeds) > 10.0:
            return f"{max(speeds):g} m/s is no sea current; give at most 10 m/s"
        return None


class Current(NamedTuple):
    """What the kernel sees, from the bottom up."""

    z: Floats  # heights [m], (rows,)
    U: Floats  # velocity east, north [m/s], (2, rows)
    slope: Floats  # its derivative over z between the rows [1/s], (2, rows)


def build(params: CurrentParams, rope: Any, payload: Any, environment: Any) -> Current:
    """From the scene's profile."""
    rows = np.array([[z, *velocity] for z, velocity in params.profile], dtype=float)
    return from_rows(rows)


def from_rows(rows: Floats) -> Current:
    """From an array of z, east, north, ordered from the surface down; shape (rows, 3)."""
    upward = rows[::-1]
    z = np.ascontiguousarray(upward[:, 0])
    U = np.ascontiguousarray(upward[:, 1:].T)
    slope = np.zeros_like(U)
    if len(z) > 1:
        slope[:, :-1] = np.diff(U, axis=1) / np.diff(z)
    return Current(z, U, slope)


@kernel("add_flow", Current)
def add_flow(current: Any, model: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """flow += U(z); the row is searched from the neighbour's, since depth changes slowly."""
    z, U, slope = current.z, current.U, current.slope
    last = z.shape[0] - 1
    heights = work[POSITION + 2]
    row = 0
    for i in range(low, high):
        height = heights[i]
        while row < last and z[row + 1] <= height:
            row += 1
        while row > 0 and z[row] > height:
            row -= 1
        above = min(max(height - z[row], 0.0), z[min(row + 1, last)] - z[row])
        work[FLOW, i] += U[0, row] + slope[0, row] * above
        work[FLOW + 1, i] += U[1, row] + slope[1, row] * above
