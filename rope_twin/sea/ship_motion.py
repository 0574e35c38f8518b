"""Motion of a ship without RAO tables: heave of a box-like hull, prescribed time histories.

Displacement RAOs are in `raos`, their files in `rao_files`.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError
from rope_twin.quantity import Quantity, quantity
from rope_twin.sea.tables import Vector, find_table, read_columns

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
                remedy = f"right is {rule.range_text()}"
                raise InputError(f"hull {field.name}", f"it is {value}", remedy)

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
    length_factor = np.sinc(0.5 * k * hull.length_m / np.pi)  # sin(x)/x
    force = np.exp(-k * draught) * np.sqrt((1.0 - k * draught) ** 2 + damping**2) * length_factor
    return np.asarray(force / (1.0 - 2.0 * k * draught + 1j * damping))


MOTIONS_FOLDER = "motions"
FASTEST_M_PER_S = 15.0  # largest plausible speed; the twin rejects faster input, too
TRIALS = 8  # points between two rows where the spline's speed is checked


class TimeHistory:
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
            problem = first if len(time_s) != 1 else "it has one row"
            raise InputError(self.source, problem, "give two rows or more from t_s = 0 on")
        late = np.flatnonzero(np.diff(time_s) <= 0.0)
        if late.size:
            problem = f"{time_s[late[0] + 1]:g} s follows {time_s[late[0]]:g} s"
            raise InputError(self.source, problem, "t_s must ascend from row to row")

    def _check_speed(self, trials: Vector, time_s: Vector, place: NDArray[np.float64]) -> None:
        remedy = f"a ship moves by at most {FASTEST_M_PER_S:g} m/s"
        distance = np.sqrt((np.diff(place, axis=0) ** 2).sum(axis=1))
        jump = np.flatnonzero(distance > FASTEST_M_PER_S * np.diff(time_s))
        if jump.size:
            k = int(jump[0])
            problem = f"it jumps by {distance[k]:.1f} m from {time_s[k]:g} s to {time_s[k + 1]:g} s"
            raise InputError(self.source, problem, remedy)
        speed = np.sqrt((self._spline(trials, 1) ** 2).sum(axis=1))
        if speed.max() > FASTEST_M_PER_S:
            k = int(np.argmax(speed))
            problem = f"the spline through it reaches {speed[k]:.1f} m/s at {trials[k]:g} s"
            raise InputError(self.source, problem, f"{remedy}; give more rows there")


def read_time_history(name_or_path: str) -> TimeHistory:
    """Read a time history from a table in config/motions/ or at a path.

    Raises:
        InputError: the table is invalid; one sentence.
    """
    path = find_table(name_or_path, MOTIONS_FOLDER)
    columns = read_columns(path, ("t_s", "x_m", "y_m", "z_m"))
    place = np.stack([columns[name] for name in ("x_m", "y_m", "z_m")], axis=1)
    return TimeHistory(columns["t_s"], place, str(path))
