"""Instruments of a scene: standard uncertainty, known offset and resolution of what they measure.

They judge the residuals (measured minus computed) of a run; nothing that is computed depends on
them, except the resolution of a line-out counter that the winch follows.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from rope_twin.quantity import quantity, text

SHEAVE, MOTOR = "sheave", "motor"
TENSION_PLACES = (SHEAVE, MOTOR)


@dataclass(frozen=True, kw_only=True)
class MeasuredTension:
    """Load cell: its reading, less the offset, is compared with the computed top tension."""

    uncertainty_n: float | None = quantity(
        "standard uncertainty, constant part", "N", 0.0, 1e9, default=None
    )
    uncertainty_pct: float | None = quantity(
        "standard uncertainty, part proportional to the reading", "%", 0.0, 100.0, default=None
    )
    bias_n: float = quantity("known offset of the reading", "N", -1e9, 1e9, default=0.0)
    at: str = text(
        "reading that is compared with the top tension: `sheave` (winch/measured) or `motor` "
        "(winch/motor_tension)",
        SHEAVE,
    )

    def check(self) -> str | None:
        """Return a fault if the place is unknown, or None."""
        if self.at in TENSION_PLACES:
            return None
        return (
            f"'{self.at}' is no place of the measured tension; give {' or '.join(TENSION_PLACES)}"
        )

    def uncertainty(self, reading: float) -> float | None:
        """Return the standard uncertainty of a reading [N]; None: not given."""
        return _combined(self.uncertainty_n, self.uncertainty_pct, reading)

    @property
    def bias(self) -> float:
        """Known offset [N]."""
        return self.bias_n


@dataclass(frozen=True, kw_only=True)
class MeasuredLength:
    """Line-out counter or depth sensor: its reading, less the offset, is compared."""

    uncertainty_m: float | None = quantity(
        "standard uncertainty, constant part", "m", 0.0, 1e4, default=None
    )
    uncertainty_pct: float | None = quantity(
        "standard uncertainty, part proportional to the reading", "%", 0.0, 100.0, default=None
    )
    bias_m: float = quantity("known offset of the reading", "m", -1e4, 1e4, default=0.0)
    resolution_m: float = quantity(
        "resolution: smallest difference of two readings", "m", 0.0, 100.0, default=0.0
    )

    def uncertainty(self, reading: float) -> float | None:
        """Return the standard uncertainty of a reading [m]; None: not given.

        A resolution r adds r/√12, the standard deviation of rounding (GUM, JCGM 100:2008, F.2.2.1).
        """
        combined = _combined(self.uncertainty_m, self.uncertainty_pct, reading)
        return combined if combined is None else hypot(combined, self.resolution_m / 12.0**0.5)

    @property
    def bias(self) -> float:
        """Known offset [m]."""
        return self.bias_m


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Instruments of the winches and of the payload."""

    tension: MeasuredTension = text("load cell of each winch", MeasuredTension())
    line_out: MeasuredLength = text("line-out counter of each winch", MeasuredLength())
    payload_depth: MeasuredLength = text(
        "altimeter, USBL or CTD on the payload (the reading is its depth)", MeasuredLength()
    )


def _combined(constant: float | None, pct: float | None, reading: float) -> float | None:
    """Return the root of the sum of squares of both parts; None if neither is given."""
    if constant is None and pct is None:
        return None
    return hypot(constant or 0.0, 0.01 * (pct or 0.0) * reading)
