"""Mode competition: which mode excites which part of a rope, without jumps."""

from __future__ import annotations

import numpy as np
import pytest

from rope_twin.vortex.shedding import parts_below, share_out

Floats = np.ndarray


def by_rank(size: Floats, locked: Floats) -> Floats:
    """The largest takes what it locks in, the next what is left: one after the other."""
    given, free = np.zeros_like(locked), np.ones(len(locked))
    for mode in np.argsort(-size):
        if size[mode] > 0.0:
            given[:, mode] = locked[:, mode] * free
            free = free - given[:, mode]
    return given


def test_distinct_modes_take_their_bands_in_order() -> None:
    """Sizes a fifth and more apart, bands that overlap, whole places and parts, one of size 0."""
    rng = np.random.default_rng(5)
    size = 1.2 ** rng.permutation(12).astype(float)
    size[4] = 0.0
    position = np.linspace(0.0, 1.0, 40)[:, None]
    locked = np.clip(8.0 * (0.25 - np.abs(position - np.linspace(0.0, 1.0, 12))), 0.0, 1.0)
    np.testing.assert_allclose(share_out(size, locked, 0.1), by_rank(size, locked), atol=1e-12)


def test_equal_modes_share_their_band_continuously() -> None:
    """Equal ones take halves; from a tenth smaller to a tenth larger no step is a jump."""
    locked = np.array([[1.0, 1.0, 0.0], [0.4, 1.0, 0.3]])
    assert share_out(np.array([2.0, 2.0, 1.0]), locked, 0.1)[0] == pytest.approx([0.5, 0.5, 0.0])
    sizes = np.linspace(0.88, 1.12, 481)
    given = np.array([share_out(np.array([one, 1.0, 0.95]), locked, 0.1) for one in sizes])
    assert np.abs(np.diff(given, axis=0)).max() < 0.02
    whole = 1.0 - np.prod(1.0 - locked, axis=1)
    np.testing.assert_allclose(given.sum(axis=2), np.broadcast_to(whole, (481, 2)), atol=1e-12)
    assert given[0, 0] == pytest.approx([0.0, 1.0, 0.0])
    assert given[-1, 0] == pytest.approx([1.0, 0.0, 0.0])


def test_parts_of_places() -> None:
    """A rise and a stretch that keeps still; the parts add up to where a straight line crosses."""
    values = np.array([0.0, 1.0, 3.0, 3.0, 3.0])
    parts = parts_below(values, np.array([-0.1, 0.25, 2.5, 3.0, 3.5]))
    assert parts[:, 0].tolist() == [0.0] * 5
    assert parts[:, 1] == pytest.approx([0.5, 0.0, 0.0, 0.0, 0.0])
    assert parts[:, 2] == pytest.approx([1.0, 1.0, 0.5, 0.0, 0.0])
    assert parts[:, 4].tolist() == [1.0] * 5
    line = np.linspace(0.0, 2.0, 21)
    lengths = np.full(21, 0.1)
    lengths[[0, -1]] = 0.05
    below = parts_below(line, np.linspace(0.0, 2.0, 57))
    assert lengths @ below == pytest.approx(np.linspace(0.0, 2.0, 57))
