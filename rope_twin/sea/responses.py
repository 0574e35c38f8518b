"""Displacement RAOs of a ship in six degrees of freedom, from a table.

One row per heading and frequency: heading_deg (0: following seas, travelling to the bow; 180: head
seas; 90: travelling to port), frequency_hz, and for each degree of freedom an amplitude and a
phase. Ship axes (REP 103): x to the bow, y to port, z up, right-handed rotations, so that pitch is
positive bow down. A wave a·cos(ωt) at the reference point moves it by a·A·cos(ωt + ε): a positive
phase leads the wave. Waves from the other side are mirrored: sway, roll and yaw change sign.

A table need not cover the whole wave spectrum: below its lowest frequency the RAOs are constant,
above its highest they fade to zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.sea.columns import find_table, read_columns
from rope_twin.sea.components import Waves
from rope_twin.sea.spectrum import Vector

FOLDER = "responses"
SHIFTS, TURNS = ("surge", "sway", "heave"), ("roll", "pitch", "yaw")
AMPLITUDES = (*(f"{name}_m_per_m" for name in SHIFTS), *(f"{name}_deg_per_m" for name in TURNS))
PHASES = tuple(f"{name}_phase_deg" for name in (*SHIFTS, *TURNS))
COLUMNS = ("heading_deg", "frequency_hz", *AMPLITUDES, *PHASES)
FADE = 1.2  # times the highest frequency of a table: RAOs are zero above
MIRRORED = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])

Answers = NDArray[np.complex128]


@dataclass(frozen=True)
class Responses:
    """Complex RAOs per metre of wave amplitude: m/m for translations, rad/m for rotations."""

    heading_deg: Vector  # ascending from 0 to 180, (h,)
    frequency_hz: Vector  # ascending, (f,)
    answer: Answers  # (6, h, f)
    source: str

    def at(self, frequency_hz: Vector, heading: Vector) -> Answers:
        """Return RAOs, (6, n), for waves that travel at `heading` [rad] relative to the bow.

        Linear in heading and frequency, of real and imaginary part. Below the lowest frequency
        amplitude and phase are constant: a ship follows long waves. Above the highest they fade to
        zero (`fade`).
        """
        return np.asarray(self.fade(frequency_hz) * self._held(frequency_hz, heading))

    def fade(self, frequency_hz: Vector) -> Vector:
        """Return the factor on the highest frequency's RAOs at frequencies above it, (n,).

        Half a cosine, from 1 at the highest frequency to 0 at FADE times it.
        """
        beyond = (frequency_hz / self.frequency_hz[-1] - 1.0) / (FADE - 1.0)
        return np.asarray(0.5 * (1.0 + np.cos(np.pi * np.clip(beyond, 0.0, 1.0))))

    def share_left_out(self, waves: Waves, bow: float, arm_m: tuple[float, float, float]) -> float:
        """Return the fraction of a point's motion variance that is lost above the highest
        frequency.

        It is that of the motion in three directions with RAOs constant beyond the highest
        frequency, hence an upper bound where they decrease with frequency. bow: heading of the bow
        [rad]; arm_m: from the reference point to the point, in sea axes.
        """
        frequency = waves.omega / (2.0 * np.pi)
        c, s = np.cos(bow), np.sin(bow)
        x, y, z = c * arm_m[0] + s * arm_m[1], c * arm_m[1] - s * arm_m[0], arm_m[2]
        surge, sway, heave, roll, pitch, yaw = self._held(frequency, waves.heading - bow)
        moved = (
            surge + pitch * z - yaw * y,
            sway + yaw * x - roll * z,
            heave + roll * y - pitch * x,
        )
        variance = waves.amplitude_m**2 * sum(np.abs(one) ** 2 for one in moved)
        total = float(variance.sum())
        lost = float((variance * (1.0 - self.fade(frequency) ** 2)).sum())
        return lost / total if total > 0.0 else 0.0

    def _held(self, frequency_hz: Vector, heading: Vector) -> Answers:
        """Return RAOs, (6, n), constant beyond the outermost frequencies."""
        turn = np.angle(np.exp(1j * heading))
        side = np.where(turn < 0.0, -1.0, 1.0)
        i, a = _cells(self.heading_deg, np.abs(np.degrees(turn)))
        j, b = _cells(self.frequency_hz, frequency_hz)
        low = (1.0 - a) * self.answer[:, i, j] + a * self.answer[:, i + 1, j]
        high = (1.0 - a) * self.answer[:, i, j + 1] + a * self.answer[:, i + 1, j + 1]
        found = (1.0 - b) * low + b * high
        return np.asarray(np.where(side < 0.0, MIRRORED[:, None] * found, found))


def _cells(axis: Vector, at: Vector) -> tuple[NDArray[np.int64], Vector]:
    """Return the interval of each value, and the fraction inside it."""
    i = np.clip(np.searchsorted(axis, at, side="right") - 1, 0, len(axis) - 2)
    return i, np.clip((at - axis[i]) / (axis[i + 1] - axis[i]), 0.0, 1.0)


def read_responses(name_or_path: str) -> Responses:
    """Read RAOs from a table in config/responses/ or at a path.

    Raises:
        InputError: the table is invalid; one sentence.
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
