"""Conversion of readings to SI, the signs of REP 103, and ROS time; and the lines of a reading.

Heave is positive up, roll with port up, pitch with the bow down, payout and speed outward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rope_twin.feeds.configuration import (
    INSTRUMENT,
    MOTOR,
    SIGNS,
    UNITS,
    FeedSettings,
)
from rope_twin.feeds.readings import (
    NANOSECONDS,
    RANGE,
    TIME,
    LineReading,
    MotionReading,
    Reading,
    Refusal,
    nearest_day_ns,
)

# Beyond these a number is a fault of the line, whatever the ship.
MAX_TENSION_N, MAX_PAYOUT_M, MAX_SPEED_M_PER_S = 1e8, 20_000.0, 100.0
MAX_HEAVE_M, MAX_RATE_M_PER_S, MAX_TILT_DEG = 50.0, 50.0, 90.0
END_OF_TIME_NS = 2**31 * NANOSECONDS  # seconds of a ROS stamp are an int32


@dataclass(frozen=True)
class LineSample:
    """Measurement of a line monitor in SI; NaN: not measured."""

    stamp_ns: int
    tension_n: float
    speed_m_per_s: float  # positive: pay out
    payout_m: float
    motor_tension_n: float


@dataclass(frozen=True)
class MotionSample:
    """Measurement of a motion sensor in SI and REP 103; NaN: not measured."""

    stamp_ns: int
    heave_m: float
    heave_rate_m_per_s: float
    roll_rad: float
    pitch_rad: float
    heading_deg: float  # of the bow, clockwise from north


Sample = LineSample | MotionSample


class Converter:
    """Turns the readings of one instrument into samples."""

    def __init__(self, settings: FeedSettings) -> None:
        self._settings = settings
        units, positive = settings.units, settings.positive
        self._factor = {name: UNITS[name][unit] for name, unit in units.items()}
        self._sign = {name: SIGNS[name][word] for name, word in positive.items()}

    def convert(self, reading: Reading, arrival_ns: int) -> Sample | Refusal:
        """Return the sample of a reading that arrived at this time, or why it is refused."""
        stamp_ns = self._stamp(reading, arrival_ns)
        if stamp_ns is None:
            return Refusal(TIME, "the line has no time")
        if not 0 <= stamp_ns < END_OF_TIME_NS:
            return Refusal(TIME, "its time is not one of 1970 to 2037")
        if isinstance(reading, LineReading):
            return self._line(reading, stamp_ns)
        return self._motion(reading, stamp_ns)

    def _stamp(self, reading: Reading, arrival_ns: int) -> int | None:
        delay_s = self._settings.latency_s
        stamp_ns: int | None = arrival_ns
        if isinstance(reading, MotionReading):
            delay_s += reading.age_s
        if self._settings.stamp == INSTRUMENT:
            stamp_ns = reading.time_ns
            if stamp_ns is not None and isinstance(reading, MotionReading) and reading.in_day:
                stamp_ns = nearest_day_ns(stamp_ns, arrival_ns)
        return None if stamp_ns is None else stamp_ns - round(delay_s * 1e9)

    def _size(self, name: str) -> float:
        return self._factor.get(name, 1.0) * self._sign.get(name, 1.0)

    def _line(self, reading: LineReading, stamp_ns: int) -> LineSample | Refusal:
        force = self._size("tension")
        tension_n, motor_n = reading.tension * force, reading.motor_tension * force
        if self._settings.tension_of == MOTOR and math.isnan(motor_n):
            tension_n, motor_n = math.nan, tension_n
        speed, payout_m = reading.speed * self._size("speed"), reading.payout * self._size("payout")
        for value, most, what in (
            (tension_n, MAX_TENSION_N, "N of tension"),
            (motor_n, MAX_TENSION_N, "N of motor tension"),
            (speed, MAX_SPEED_M_PER_S, "m/s of line speed"),
            (payout_m, MAX_PAYOUT_M, "m of line out"),
        ):
            if abs(value) > most:
                return Refusal(RANGE, f"{value:g} {what}")
        return LineSample(stamp_ns, tension_n, speed, payout_m, motor_n)

    def _motion(self, reading: MotionReading, stamp_ns: int) -> MotionSample | Refusal:
        size = self._size("heave")
        heave, rate = reading.heave * size, reading.heave_rate * size
        for value, most, what in (
            (heave, MAX_HEAVE_M, "m of heave"),
            (rate, MAX_RATE_M_PER_S, "m/s of heave rate"),
            (reading.roll, MAX_TILT_DEG, "° of roll"),
            (reading.pitch, MAX_TILT_DEG, "° of pitch"),
            (reading.heading, 360.0, "° of heading"),
        ):
            if abs(value) > most:
                return Refusal(RANGE, f"{value:g} {what}")
        # Octans states port and bow by letters, and its parser gives port up, bow up.
        roll = reading.roll * self._sign.get("roll", 1.0)
        pitch = reading.pitch * self._sign.get("pitch", -1.0)
        return MotionSample(
            stamp_ns, heave, rate, math.radians(roll), math.radians(pitch), reading.heading
        )
