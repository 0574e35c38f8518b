"""How a ship answers waves in six degrees of freedom: response amplitude operators in a table.

A row for each heading and frequency: heading_deg (0: waves from astern, travelling to the bow;
180: from ahead; 90: travelling to port), frequency_hz, and for each degree of freedom an amplitude
and a phase. Axes of the ship (REP 103): x to the bow, y to port, z up, turns right-handed, so that
pitch is positive bow down. A wave a·cos(ωt) at the reference point moves it by
a·A·cos(ωt + ε): a positive phase comes before the wave. Waves from the other side are mirrored:
sway, roll and yaw change sign.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.sea.columns import find_table, read_columns
from rope_twin.sea.spectrum import Vector

FOLDER = "responses"
SHIFTS, TURNS = ("surge", "sway", "heave"), ("roll", "pitch", "yaw")
AMPLITUDES = (*(f"{name}_m_per_m" for name in SHIFTS), *(f"{name}_deg_per_m" for name in TURNS))
PHASES = tuple(f"{name}_phase_deg" for name in (*SHIFTS, *TURNS))
COLUMNS = ("heading_deg", "frequency_hz", *AMPLITUDES, *PHASES)
MIRRORED = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])

Answers = NDArray[np.complex128]


@dataclass(frozen=True)
class Responses:
    """Complex responses per metre of wave: m/m for shifts, rad/m for turns."""

    heading_deg: Vector  # rising from 0 to 180, (h,)
    frequency_hz: Vector  # rising, (f,)
    answer: Answers  # (6, h, f)
    source: str

    def check_reach(self, frequency_hz: Vector) -> None:
        """See that waves of these frequencies are answered.

        Raises:
            InputError: the table does not reach so far.
        """
        low, high = float(frequency_hz.min()), float(frequency_hz.max())
        first, last = self.frequency_hz[[0, -1]]
        if low < first or high > last:
            what = f"it answers {first:g} to {last:g} Hz, the waves have {low:.3g} to {high:.3g} Hz"
            raise InputError(phrase(self.source, what, "give a table that reaches so far"))

    def at(self, frequency_hz: Vector, heading: Vector) -> Answers:
        """Answers, (6, n), to waves that travel `heading` [rad] against the bow's direction.

        Linear in heading and frequency, of real and imaginary part. Raises InputError as
        `check_reach` does.
        """
        self.check_reach(frequency_hz)
        turn = np.angle(np.exp(1j * heading))
        side = np.where(turn < 0.0, -1.0, 1.0)
        i, a = _cells(self.heading_deg, np.abs(np.degrees(turn)))
        j, b = _cells(self.frequency_hz, frequency_hz)
        low = (1.0 - a) * self.answer[:, i, j] + a * self.answer[:, i + 1, j]
        high = (1.0 - a) * self.answer[:, i, j + 1] + a * self.answer[:, i + 1, j + 1]
        found = (1.0 - b) * low + b * high
        return np.asarray(np.where(side < 0.0, MIRRORED[:, None] * found, found))


def _cells(axis: Vector, at: Vector) -> tuple[NDArray[np.int64], Vector]:
    """The interval of each value, and how far in it."""
    i = np.clip(np.searchsorted(axis, at, side="right") - 1, 0, len(axis) - 2)
    return i, np.clip((at - axis[i]) / (axis[i + 1] - axis[i]), 0.0, 1.0)


def read_responses(name_or_path: str) -> Responses:
    """From a table in config/responses/ or at a path.

    Raises:
        InputError: one sentence on what is wrong with it.
    """
    path = find_table(name_or_path, FOLDER)
    columns = read_columns(path, COLUMNS)
    headings, frequencies = (np.unique(columns[name]) for name in COLUMNS[:2])
    where, count = str(path), len(headings) * len(frequencies)
    if len(headings) < 2 or headings[0] != 0.0 or headings[-1] != 180.0:
        what = f"headings from {headings[0]:g}° to {headings[-1]:g}°"
        raise InputError(phrase(where, what, "they must reach from 0° to 180°"))
    if len(frequencies) < 2 or frequencies[0] <= 0.0:
        what = f"{len(frequencies)} frequencies from {frequencies[0]:g} Hz"
        raise InputError(phrase(where, what, "give two or more, above 0"))
    order = np.lexsort((columns["frequency_hz"], columns["heading_deg"]))
    grid = np.stack([columns[name][order] for name in COLUMNS[:2]])
    full = np.stack([np.repeat(headings, len(frequencies)), np.tile(frequencies, len(headings))])
    if grid.shape != full.shape or (grid != full).any():
        what = (
            f"{grid.shape[1]} rows of {len(headings)} headings and {len(frequencies)} frequencies"
        )
        raise InputError(phrase(where, what, f"each once for each: {count} rows"))
    amplitude = np.stack([columns[name][order] for name in AMPLITUDES])
    if (amplitude < 0.0).any():
        name = AMPLITUDES[int(np.flatnonzero((amplitude < 0.0).any(axis=1))[0])]
        raise InputError(phrase(where, f"{name} is negative", "give 0 or more, and a phase"))
    phases = np.radians(np.stack([columns[name][order] for name in PHASES]))
    amplitude[3:] = np.radians(amplitude[3:])
    shape = (6, len(headings), len(frequencies))
    answer: Answers = np.asarray(amplitude * np.exp(1j * phases), np.complex128).reshape(shape)
    return Responses(headings, frequencies, answer, where)
