"""Limits of wave steepness: what a wave spectrum can hold, and what is rarely exceeded.

The significant steepness of a sea state is Hs over the deep-water wave length of a period, s =
2π·Hs/(g·T²). Sea states stay below s = 1/15 for peak periods up to 8 s and 1/25 from 15 s on,
linear between (DNV-RP-C205, 3.5.4). A single wave breaks at a height of 0.142 of its length (Miche
1944): a sea state whose significant height at its mean zero-crossing period exceeds that is
impossible.
"""

from __future__ import annotations

import math

from rope_twin.errors import phrase
from rope_twin.sea.spectrum import WaveSpectrum

BREAKING = 0.142  # height over length of a breaking wave in deep water
STANDARD_GRAVITY = 9.80665
_PEAK_PERIODS_S, _STEEPEST = (8.0, 15.0), (1.0 / 15.0, 1.0 / 25.0)


def zero_crossing_period_s(spectrum: WaveSpectrum) -> float:
    """Return the mean zero-crossing period, Tz = √(m0/m2)."""
    return math.sqrt(spectrum.moment(0) / spectrum.moment(2))


def usual_height_m(peak_period_s: float, gravity: float = STANDARD_GRAVITY) -> float:
    """Return the largest Hs of a sea state with this peak period by DNV-RP-C205."""
    (first, last), (steep, gentle) = _PEAK_PERIODS_S, _STEEPEST
    part = min(max((peak_period_s - first) / (last - first), 0.0), 1.0)
    return _length_m(peak_period_s, gravity) * (steep + part * (gentle - steep))


def breaking_fault(
    spectrum: WaveSpectrum, gravity: float = STANDARD_GRAVITY
) -> tuple[str, str] | None:
    """Return why the sea state is impossible, and the remedy; None if it is possible."""
    period, height = zero_crossing_period_s(spectrum), spectrum.significant_height_m
    most = BREAKING * _length_m(period, gravity)
    if gravity <= 0.0 or height <= most:
        return None
    what = (
        f"Hs {height:.3g} m at a mean period Tz of {period:.3g} s is a steepness of "
        f"{BREAKING * height / most:.2g}, and waves break at {BREAKING:g}"
    )
    usual = min(most, usual_height_m(spectrum.peak_period_s, gravity))
    return what, f"give at most Hs {usual:.2g} m, or a longer period"


def steepness_warning(where: str, spectrum: WaveSpectrum, gravity: float = STANDARD_GRAVITY) -> str:
    """Return a warning for a sea state that is steeper than usual, or ""."""
    height, period = spectrum.significant_height_m, spectrum.peak_period_s
    most = usual_height_m(period, gravity)
    if gravity <= 0.0 or height <= most * (1.0 + 5e-3):  # tolerance for the truncated spectrum
        return ""
    what = (
        f"Hs {height:.3g} m at Tp {period:.3g} s is steeper than sea states usually are "
        f"(at most {most:.1f} m by DNV-RP-C205)"
    )
    return phrase(where, what, f"give at most {most:.1f} m, or a longer period")


def _length_m(period_s: float, gravity: float) -> float:
    """Return the length of a deep-water wave."""
    return gravity * period_s**2 / (2.0 * math.pi)
