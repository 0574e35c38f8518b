"""Fused multiply-add in exact kernels: only where they ask for it, at both widths."""

from __future__ import annotations

from typing import Any

import numpy as np

from rope_twin.core.jit.decorators import jit_entry, jit_exact
from rope_twin.core.jit.functions import FUSES, fused, rounded
from rope_twin.core.jit.wide import LANES, table
from rope_twin.core.lanes.effects import aligned

SMALL = 2.0**-30
NEAR_ONE = 1.0 + SMALL
LESS = -(1.0 + 2.0 * SMALL)  # minus the square of the one above, rounded: SMALL² is lost


@jit_exact
def _both_ways(row: Any) -> None:
    a, c = row[0], row[1]
    row[2] = fused(a, a, c)
    row[3] = a * a + c


@jit_entry
def _rounded_by_itself(row: Any) -> None:
    a, b, c = row[0], row[1], row[2]
    row[3] = rounded(a, a) + c
    row[4] = b * b + c


@jit_entry
def _one(row: Any) -> None:
    _both_ways(row)


@jit_entry
def _lanes(rows: Any) -> None:
    _both_ways(table(rows))


def test_fused_sums_of_scalars() -> None:
    row = np.array([NEAR_ONE, LESS, np.nan, np.nan])
    _one(row)
    assert row[2] == (SMALL * SMALL if FUSES else 0.0)
    assert row[3] == 0.0


def test_fused_sums_in_lanes() -> None:
    rows = aligned(4, LANES)
    rows[0] = NEAR_ONE + SMALL * np.arange(LANES)
    rows[1] = LESS
    expected = np.array([(a, LESS, 0.0, 0.0) for a in rows[0]])
    for row in expected:
        _one(row)
    _lanes(rows)
    assert rows[2, 0] == (SMALL * SMALL if FUSES else 0.0)
    assert np.array_equal(rows.T, expected)


def test_an_unfused_product_stays_unfused() -> None:
    """Also where others are, of which the kernel does not say so."""
    row = np.array([NEAR_ONE, NEAR_ONE, LESS, np.nan, np.nan])
    _rounded_by_itself(row)
    assert row[3] == 0.0
    assert row[4] == (SMALL * SMALL if FUSES else 0.0)
