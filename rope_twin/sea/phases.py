"""Reproducible random numbers from a seed."""

from __future__ import annotations

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.sea.spectrum import Vector


def random_shares(seed: int, count: int) -> Vector:
    """Return uniform random numbers in [0, 1), (count,).

    Made from the raw words of PCG64, whose stream numpy guarantees, so that a seed gives the same
    sea with every version of numpy.

    Raises:
        InputError: a negative seed.
    """
    if seed < 0:
        raise InputError(phrase("seed", f"it is {seed}", "right is a whole number from 0"))
    words = np.random.PCG64(seed).random_raw(count)
    return (words >> np.uint64(11)).astype(np.float64) * 2.0**-53


def random_phases(seed: int, count: int) -> Vector:
    """Return uniform random phases [rad], (count,).

    Raises:
        InputError: a negative seed.
    """
    return 2.0 * np.pi * random_shares(seed, count)
