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

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.quantity import Quantity, quantity
from rope_twin.sea.components import Waves
from rope_twin.sea.tables import Vector, find_table, read_columns, read_grid

_GRAVITY_M_PER_S2 = 9.80665


@dataclasses.dataclass(frozen=True, kw_only=True)
class BoxHull:
    """Hull dimensions; defaults are those of a medium-sized offshore construction vessel.

    Raises:
        InputError: a number out of its range.
    """

    length_m: float = quantity("waterline length", "m", 10.0, 500.0, default=120.0)
    breadth_m: float = quantity("waterline breadth", "m", 2.0, 100.0, default=23.0)
    draught_m: float = quantity("draught", "m", 0.5, 40.0, default=7.0)
    block_coefficient: float = quantity("block coefficient", "", 0.3, 1.0, default=0.7)

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            rule: Quantity = field.metadata["quantity"]
            value = getattr(self, field.name)
            if not rule.admits(value):
                raise InputError(
                    phrase(f"hull {field.name}", f"it is {value}", f"right is {rule.range_text()}")
                )

    def describe(self) -> str:
        """Return the response in one sentence, for the header of a bag."""
        return (
            "heave at amidships by the closed-form expressions of Jensen, Mansour, Olsen 2004, "
            f"head seas, zero speed, length {self.length_m:g} m, breadth {self.breadth_m:g} m, "
            f"draught {self.draught_m:g} m, block coefficient {self.block_coefficient:g}"
        )


def heave_response(hull: BoxHull, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return heave of the hang-off per metre of wave elevation there, for the factor exp(+iωt).

    Frequencies [Hz] above zero, any shape; the result has the same shape. |H| → 1 in long waves and
    → 0 in short ones; a negative angle means that heave lags the wave.
    """
    omega = 2.0 * np.pi * np.asarray(frequency_hz, dtype=np.float64)
    k = omega**2 / _GRAVITY_M_PER_S2
    draught = hull.draught_m
    breadth = hull.breadth_m * hull.block_coefficient
    radiated = 2.0 * np.sin(0.5 * k * breadth) * np.exp(-k * draught)  # A
    damping = radiated**2 / (k * breadth)
    along = np.sinc(0.5 * k * hull.length_m / np.pi)  # sin(x)/x
    force = np.exp(-k * draught) * np.sqrt((1.0 - k * draught) ** 2 + damping**2) * along
    return np.asarray(force / (1.0 - 2.0 * k * draught + 1j * damping))


RESPONSES_FOLDER = "responses"
SHIFTS, TURNS = ("surge", "sway", "heave"), ("roll", "pitch", "yaw")
AMPLITUDES = (*(f"{name}_m_per_m" for name in SHIFTS), *(f"{name}_deg_per_m" for name in TURNS))
PHASES = tuple(f"{name}_phase_deg" for name in (*SHIFTS, *TURNS))
HEADING, FREQUENCY = "heading_deg", "frequency_hz"
COLUMNS = (HEADING, FREQUENCY, *AMPLITUDES, *PHASES)
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
    path = find_table(name_or_path, RESPONSES_FOLDER)
    where, names = str(path), (*AMPLITUDES, *PHASES)
    headings, frequencies, columns = read_grid(path, (HEADING, FREQUENCY), names)
    if headings[0] != 0.0 or headings[-1] != 180.0:
        what = f"headings from {headings[0]:g}° to {headings[-1]:g}°"
        raise InputError(phrase(where, what, "they must reach from 0° to 180°"))
    if frequencies[0] <= 0.0:
        what = f"frequencies from {frequencies[0]:g} Hz"
        raise InputError(phrase(where, what, "give them above 0"))
    for name in AMPLITUDES:
        if (columns[name] < 0.0).any():
            raise InputError(phrase(where, f"{name} is negative", "give 0 or more, and a phase"))
    amplitude = np.stack([columns[name] for name in AMPLITUDES])
    amplitude[3:] = np.radians(amplitude[3:])
    phases = np.radians(np.stack([columns[name] for name in PHASES]))
    answer: Answers = np.asarray(amplitude * np.exp(1j * phases), np.complex128)
    return Responses(headings, frequencies, answer, where)


WAYS_FOLDER = "ways"
FASTEST_M_PER_S = 15.0  # largest plausible speed; the twin rejects faster input, too
TRIALS = 8  # points between two rows where the spline's speed is checked


class Way:
    """Splined time history; `end_s` is its last time.

    Raises:
        InputError: times do not begin at 0 and ascend, or it is faster than a ship.
    """

    def __init__(self, time_s: Vector, place_m: NDArray[np.float64], source: str) -> None:
        """Interpolate a time history; time_s: (n,); place_m: (n, 3)."""
        from scipy.interpolate import CubicSpline  # slow to import, and rarely needed

        self.source = source
        self._check_times(time_s)
        self.end_s = float(time_s[-1])
        self._spline: Any = CubicSpline(time_s, place_m)
        share = np.arange(TRIALS) / TRIALS
        trials = np.append(time_s[:-1, None] + np.diff(time_s)[:, None] * share, time_s[-1])
        self._check_speed(trials, time_s, place_m)

    def at(self, time_s: Vector) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return displacement [m] and velocity [m/s] at times up to the end, (k, 3) each.

        Before t = 0 it is extrapolated linearly.
        """
        inside = np.maximum(time_s, 0.0)
        velocity = self._spline(inside, 1)
        return self._spline(inside) + velocity * (time_s - inside)[:, None], velocity

    def _check_times(self, time_s: Vector) -> None:
        if len(time_s) < 2 or time_s[0] != 0.0:
            first = f"it begins at t = {time_s[0]:g} s" if len(time_s) else "it is empty"
            what = first if len(time_s) != 1 else "it has one row"
            raise InputError(phrase(self.source, what, "give two rows or more from t_s = 0 on"))
        late = np.flatnonzero(np.diff(time_s) <= 0.0)
        if late.size:
            what = f"{time_s[late[0] + 1]:g} s follows {time_s[late[0]]:g} s"
            raise InputError(phrase(self.source, what, "t_s must ascend from row to row"))

    def _check_speed(self, trials: Vector, time_s: Vector, place: NDArray[np.float64]) -> None:
        right = f"a ship moves by at most {FASTEST_M_PER_S:g} m/s"
        between = np.sqrt((np.diff(place, axis=0) ** 2).sum(axis=1))
        leap = np.flatnonzero(between > FASTEST_M_PER_S * np.diff(time_s))
        if leap.size:
            k = int(leap[0])
            what = f"it jumps by {between[k]:.1f} m from {time_s[k]:g} s to {time_s[k + 1]:g} s"
            raise InputError(phrase(self.source, what, right))
        speed = np.sqrt((self._spline(trials, 1) ** 2).sum(axis=1))
        if speed.max() > FASTEST_M_PER_S:
            k = int(np.argmax(speed))
            what = f"the spline through it reaches {speed[k]:.1f} m/s at {trials[k]:g} s"
            raise InputError(phrase(self.source, what, f"{right}; give more rows there"))


def read_way(name_or_path: str) -> Way:
    """Read a time history from a table in config/ways/ or at a path.

    Raises:
        InputError: the table is invalid; one sentence.
    """
    path = find_table(name_or_path, WAYS_FOLDER)
    columns = read_columns(path, ("t_s", "x_m", "y_m", "z_m"))
    place = np.stack([columns[name] for name in ("x_m", "y_m", "z_m")], axis=1)
    return Way(columns["t_s"], place, str(path))
