"""Tension along each rope with its range of the last minute, and the history of the trend.

Nodes of a rope move through the winch, so the range is kept at fixed fractions of the line out.
"""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rope_twin.console.readings import Readings, Values, number
from rope_twin.messages import decode, read_cloud

Vector = NDArray[np.float64]

WINDOW_S = 60.0  # of the range and of the trend
POINTS = 41  # of a rope on the page
OLD_S = 1.0  # age from which the reading of an instrument is no longer drawn as measured
_FRACTIONS = np.linspace(0.0, 1.0, POINTS)


class _Look(NamedTuple):
    """Tension along a rope at one instant."""

    at_s: float
    tension_n: Vector  # (POINTS,)


class RopeProfile:
    """Tension and shape of each rope at POINTS fractions of its length, and its range."""

    def __init__(self) -> None:
        self._looks: dict[int, deque[_Look]] = {}

    def update(self, data: bytes, at_s: float) -> list[dict[str, Any]]:
        """Return the profile of each rope in a ropes/nodes message.

        at_s: the twin's time [s], by which the range is kept.

        Raises:
            InputError: the bytes are not such a message.
        """
        points = read_cloud(decode("ropes/nodes", data))
        return [
            self._rope(number_of, points[points["rope"] == number_of], at_s)
            for number_of in range(int(points["rope"].max()) + 1 if len(points) else 0)
        ]

    def forget(self) -> None:
        """Forget the range."""
        self._looks.clear()

    def _rope(self, number_of: int, nodes: NDArray[Any], at_s: float) -> dict[str, Any]:
        place = np.column_stack([nodes["x"], nodes["y"], nodes["z"]]).astype(np.float64)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))])
        wanted = _FRACTIONS * along[-1]
        tension_n = np.interp(wanted, along, nodes["tension_n"].astype(np.float64))
        looks = self._looks.setdefault(number_of, deque())
        if looks and looks[-1].at_s > at_s:
            looks.clear()
        looks.append(_Look(at_s, tension_n))
        while looks[0].at_s < at_s - WINDOW_S:
            looks.popleft()
        table = np.stack([look.tension_n for look in looks])
        low_n, high_n = table.min(axis=0), table.max(axis=0)
        x, y, z = (np.interp(wanted, along, place[:, axis]) for axis in range(3))
        return {
            "along_m": _rounded(wanted, 1),
            "x_m": _rounded(x, 2),
            "y_m": _rounded(y, 2),
            "z_m": _rounded(z, 2),
            "tension_n": _rounded(tension_n, 0),
            "low_n": _rounded(low_n, 0),
            "high_n": _rounded(high_n, 0),
            "span_s": round(at_s - looks[0].at_s, 1),
            "least_now_n": number(float(nodes["tension_n"].min())),
            "least_n": number(float(low_n.min())),
            "least_at_m": number(float(wanted[int(low_n.argmin())])),
        }


def _rounded(values: Vector, digits: int) -> list[float]:
    return [float(one) for one in np.round(values, digits)]


TREND = ("time_s", "tension_n", "low_n", "high_n", "measured_n", "line_out_m",
         "line_speed_m_per_s", "depth_m", "heave_m")  # fmt: skip


class Trend:
    """Rows of the trend of each rope, for a page that connects or reconnects."""

    def __init__(self, rate_hz: float) -> None:
        self._most = round(WINDOW_S * rate_hz) + 1
        self._rows: list[deque[tuple[float | None, ...]]] = [deque(maxlen=self._most)]

    def add(
        self, readings: Readings, facts: Values | None = None
    ) -> list[dict[str, float | None]] | None:
        """Add and return the newest values, a row for each rope; None if the time has not advanced.

        facts: of the scene; heave counts from its mean hang-off, or from z = 0 where none is known.
        A time before that of the last row belongs to another run: the rows before are dropped.
        """
        time_s = readings.time_s
        if time_s is None:
            return None
        last = self._rows[0][-1][0] if self._rows[0] else None
        if last is not None and time_s <= last:
            if time_s == last:
                return None
            self.forget()
        rows = [
            _trend_row(readings, time_s, facts or {}, rope)
            for rope in range(max(1, len(readings.values.get("tension_n", ()))))
        ]
        while len(self._rows) < len(rows):
            self._rows.append(deque(maxlen=self._most))
        for kept, row in zip(self._rows, rows, strict=False):
            kept.append(tuple(row[name] for name in TREND))
        return rows

    def columns(self, rope: int = 0) -> dict[str, list[float | None]]:
        """Return all rows of a rope as columns."""
        rows = list(self._rows[rope])
        return {name: [row[place] for row in rows] for place, name in enumerate(TREND)}

    @property
    def ropes(self) -> int:
        """Return the number of ropes that have rows, at least one."""
        return len(self._rows)

    def forget(self) -> None:
        """Drop all rows."""
        self._rows = [deque(maxlen=self._most)]


def _trend_row(
    readings: Readings, time_s: float, facts: Values, rope: int
) -> dict[str, float | None]:
    values = readings.values
    named = facts.get("ropes") or ()
    own = named[rope] if rope < len(named) else {}
    payloads, interval = values.get("payloads"), values.get("error_interval")
    payload = next((one for one in payloads or () if one["name"] == own.get("payload")),
                   payloads[0] if payloads else None)  # fmt: skip
    depth = payload["place_m"][2] if payload else None
    hang_off, mean = values.get("hang_off_m"), facts.get("hang_off_m")
    height_m = hang_off[2] if hang_off else None
    # a residual keeps its last reading for ever: only its age shows that the instrument is lost
    measured = next((row["measured"] for row in values.get("residuals", ())
                     if row["quantity"] == "top_tension_n" and (row["age_s"] or 0.0) < OLD_S
                     and (len(named) < 2 or row["name"] == own.get("winch"))),
                    None)  # fmt: skip
    return {
        "time_s": round(time_s, 3),
        "tension_n": _at(values.get("tension_n"), rope),
        "low_n": interval[rope]["lower_n"] if interval and rope < len(interval) else None,
        "high_n": interval[rope]["upper_n"] if interval and rope < len(interval) else None,
        "measured_n": measured,
        "line_out_m": _at(values.get("line_out_m"), rope),
        "line_speed_m_per_s": _at(values.get("line_speed_m_per_s"), rope),
        "depth_m": None if depth is None else -depth,
        "heave_m": None if height_m is None else height_m - (mean[2] if mean else 0.0),
    }


def _at(values: list[float | None] | None, rope: int) -> float | None:
    return values[rope] if values and rope < len(values) else None
