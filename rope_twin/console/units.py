"""Units of the screen and figures as text; everything else is in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeGuard

G_M_PER_S2 = 9.80665  # a tonne-force is the weight of a tonne at standard gravity
UNKNOWN, MINUS = "–", "−"


@dataclass(frozen=True)
class Units:
    """Units of force and speed that a screen shows."""

    force: str
    per_newton: float
    force_digits: int
    speed: str
    per_m_per_s: float
    speed_digits: int

    @property
    def name(self) -> str:
        """Return both units."""
        return f"{self.force} · {self.speed}"

    def forces(self, newton: float | None, signed: bool = False) -> str:
        """Return a force [N] as text without its unit."""
        return fixed(scaled(newton, self.per_newton), self.force_digits, signed)

    def speeds(self, m_per_s: float | None, signed: bool = False) -> str:
        """Return a speed [m/s] as text without its unit."""
        return fixed(scaled(m_per_s, self.per_m_per_s), self.speed_digits, signed)


_FORCES = (("kN", 1e-3, 1), ("t", 1e-3 / G_M_PER_S2, 2))
_SPEEDS = (("m/min", 60.0, 1), ("m/s", 1.0, 2))
UNITS = tuple(Units(*force, *speed) for speed in _SPEEDS for force in _FORCES)  # as on the page


def scaled(value: float | None, factor: float) -> float | None:
    """Return a value in another unit; None stays None."""
    return None if value is None else value * factor


def fixed(value: float | None, digits: int, signed: bool = False) -> str:
    """Return a number with so many decimals, or UNKNOWN; `signed`: + before a positive one."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    text = f"{abs(value):.{digits}f}"
    if float(text) == 0.0:
        return text
    return (MINUS if value < 0.0 else "+" if signed else "") + text


def known(value: object) -> TypeGuard[float]:
    """Return whether a value is a finite number."""
    return isinstance(value, int | float) and math.isfinite(value)
