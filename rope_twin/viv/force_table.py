"""Table of forces on a cylinder in forced cross-flow motion: C_Lv and C_a.

C_Lv is the lift in phase with velocity (positive: it excites the motion), C_a the added mass, over
amplitude A/D and frequency f·D/U (first measured by Gopalkrishnan 1993). The source of the table is
in the header of its file, config/viv.
"""

from __future__ import annotations

import csv
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.share import share_dir
from rope_twin.viv.span import Floats

COLUMNS = ("frequency", "amplitude", "C_Lv", "C_a")


class ForceTable(NamedTuple):
    """Force coefficients, bilinear between rows; constant beyond the ends."""

    frequency: Floats  # f·D/U, ascending, (n,)
    amplitude: Floats  # A/D, ascending, (m,)
    lift: Floats  # C_Lv, (n, m)
    added_mass: Floats  # C_a, (n, m)

    def lift_at(self, amplitude: Floats, frequency: Floats) -> Floats:
        """Return C_Lv."""
        return self._at(self.lift, amplitude, frequency)

    def added_mass_at(self, amplitude: Floats, frequency: Floats) -> Floats:
        """Return C_a."""
        return self._at(self.added_mass, amplitude, frequency)

    def both_at(self, amplitude: Floats, frequency: Floats) -> tuple[Floats, Floats]:
        """Return C_Lv and C_a."""
        both = np.stack([self.lift, self.added_mass])
        lift, added_mass = self._at(both, amplitude, frequency)
        return lift, added_mass

    def lift_along(self, amplitude: float, frequency: Floats) -> Floats:
        """Return C_Lv of one amplitude for all frequencies."""
        return np.interp(frequency, self.frequency, self._row(self.lift, amplitude))

    def added_mass_row(self, amplitude: float) -> Floats:
        """Return C_a of one amplitude at the table's frequencies."""
        return self._row(self.added_mass, amplitude)

    def _row(self, values: Floats, amplitude: float) -> Floats:
        (j,), (v,) = _place(self.amplitude, np.array([amplitude]))
        return np.asarray((1.0 - v) * values[:, j] + v * values[:, j + 1])

    def _at(self, values: Floats, amplitude: Floats, frequency: Floats) -> Floats:
        i, u = _place(self.frequency, frequency)
        j, v = _place(self.amplitude, amplitude)
        low = (1.0 - v) * values[..., i, j] + v * values[..., i, j + 1]
        high = (1.0 - v) * values[..., i + 1, j] + v * values[..., i + 1, j + 1]
        return np.asarray((1.0 - u) * low + u * high)


def _place(knots: Floats, at: Floats) -> tuple[np.ndarray, Floats]:
    """Return the index of the knot below, and the fraction from it to the next."""
    inside = np.clip(at, knots[0], knots[-1])
    i = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, len(knots) - 2)
    return i, (inside - knots[i]) / (knots[i + 1] - knots[i])


@lru_cache
def fitted_forces() -> ForceTable:
    """Return the table of the package: a fit, as its header states."""
    return read_force_table(share_dir() / "config" / "viv" / "fitted_forces.csv")


def read_force_table(path: Path) -> ForceTable:
    """Read a table with the columns frequency, amplitude, C_Lv and C_a; # begins a comment.

    Raises:
        InputError: it cannot be read, or its rows are not a full grid.
    """
    right = f"give rows of {', '.join(COLUMNS)}, every amplitude for every frequency"
    try:
        lines = path.read_text("utf-8").splitlines()
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        figures = np.array([[float(row[name]) for name in COLUMNS] for row in rows])
        figures = figures.reshape(-1, len(COLUMNS))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            phrase(str(path), f"it is not a table of forces ({error})", right)
        ) from error
    frequency, amplitude = (np.unique(figures[:, k]) for k in (0, 1))
    shape = (len(frequency), len(amplitude))
    if min(shape) < 2 or len(figures) != shape[0] * shape[1]:
        what = f"{len(figures)} rows are not a grid of frequencies and amplitudes"
        raise InputError(phrase(str(path), what, right))
    figures = figures[np.lexsort((figures[:, 1], figures[:, 0]))]
    if not (figures[:, 1].reshape(shape) == amplitude).all() or not np.isfinite(figures).all():
        raise InputError(phrase(str(path), "an amplitude is missing or not finite", right))
    return ForceTable(
        frequency, amplitude, figures[:, 2].reshape(shape), figures[:, 3].reshape(shape)
    )
