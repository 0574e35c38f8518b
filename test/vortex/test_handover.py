"""How places go over from one mode to another, where a rope changes."""

from __future__ import annotations

import numpy as np
import pytest

from rope_twin.vortex.shedding import PERIODS, handed_over


def test_a_place_goes_over_in_periods_of_its_own_vortices() -> None:
    """By 1 - 1/e in PERIODS of them, as well in one piece as in ten; a still place stays."""
    before, wanted, locked = np.eye(3)[:, :2], np.array([[0, 1.0], [1, 0], [1, 0]]), np.ones((3, 2))
    before[2] = [0.0, 1.0]
    hz = np.array([2.0, 1.0, 0.0])
    found = handed_over(before, wanted, locked, hz, PERIODS / 2.0)
    part = 1.0 - np.exp(-np.array([1.0, 0.5, 0.0]))
    assert found == pytest.approx(before + part[:, None] * (wanted - before))
    assert found.sum(axis=1) == pytest.approx(1.0)
    some = before
    for _ in range(10):
        some = handed_over(some, wanted, locked, hz, PERIODS / 20.0)
    assert some == pytest.approx(found)


def test_what_is_driven_as_it_was_stays_to_the_bit_and_what_is_not_locked_in_ends() -> None:
    zones = np.random.default_rng(3).uniform(0.0, 0.5, (40, 5))
    hz = np.linspace(0.1, 2.0, 40)
    assert np.array_equal(handed_over(zones, zones, np.ones_like(zones), hz, 1.0), zones)
    locked = np.ones_like(zones)
    locked[10:20, 2] = 0.0
    found = handed_over(zones, zones * locked, locked, hz, 1.0)
    assert not found[10:20, 2].any()


def test_other_places_and_modes_take_over_from_where_they_lie() -> None:
    """A line along the rope is the same line on half as many places; a new mode begins at 0."""
    line = np.stack([np.linspace(0.0, 1.0, 41), np.linspace(1.0, 0.0, 41)], axis=1)
    found = handed_over(line, np.ones((21, 3)), np.ones((21, 3)), np.ones(21), 0.0)
    assert found[:, 0] == pytest.approx(np.linspace(0.0, 1.0, 21))
    assert found[:, 1] == pytest.approx(np.linspace(1.0, 0.0, 21))
    assert not found[:, 2].any()
