"""Error bounds of a scene's results by mesh and time step, as a convergence study states them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

RMS, PEAK = "tension_rms", "tension_peak"  # quantities of every study


class Setting(NamedTuple):
    """Mesh and time step of a run; in a multi-line system the elements of the first rope."""

    elements: int
    step_s: float

    def __str__(self) -> str:
        return f"{self.elements} elements at {1e3 * self.step_s:g} ms"


@dataclass(frozen=True)
class Figure:
    """Error of one quantity at one setting, in the quantity's unit."""

    error: float | None  # relative to the reference, signed; None: nothing to compare
    at_most: float | None  # magnitude plus the reference's uncertainty; None: not converged

    @property
    def known(self) -> float:
        """Return the bound; NaN where there is none."""
        return math.nan if self.at_most is None else self.at_most


@dataclass(frozen=True)
class StudyLevel:
    """One setting of the convergence study; errors are those of the study's run."""

    elements: int
    step_s: float
    newton_tolerance_n: float | None  # None: the scene's own
    real_time_factor: float  # solver only, on the study's machine
    solves_per_step: float
    memory_mb: float  # of the rope's arrays
    figures: dict[str, Figure]  # by quantity

    def place(self) -> tuple[int, float, float | None]:
        """Return elements, step [s] and tolerance [N] (None: the scene's own)."""
        return self.elements, self.step_s, self.newton_tolerance_n

    def bound(self, name: str) -> float:
        """Return the upper bound of a quantity's error, in its unit; NaN where it is unknown."""
        return self.figures[name].known if name in self.figures else math.nan

    @property
    def error_rms_pct(self) -> float:
        """Return the bound of the RMS error of the top tension [% of its standard deviation], or
        NaN.
        """
        return self.figures[RMS].known

    @property
    def error_peak_pct(self) -> float:
        """Return the bound of the error of the maximum tension [%]; NaN: unknown."""
        return self.figures[PEAK].known


@dataclass(frozen=True)
class KnownError:
    """Error bound of a scene's top tension at its own setting."""

    rms_pct: float = math.nan  # bound, % of the standard deviation; NaN: unknown
    peak_pct: float = math.nan  # bound of the error of the maximum [%]
    words: str = "unknown"  # validity, or why it is unknown
    seconds: float = math.inf  # simulated time covered by the study; unknown beyond


def format_bound(bound: float) -> str:
    """Format a bound with two digits, rounded up."""
    if not 0.0 < bound < math.inf:
        return "0" if bound == 0.0 else "unknown"
    place = 10.0 ** (math.floor(math.log10(bound)) - 1)
    shown = math.ceil(bound / place - 1e-9) * place
    return f"{shown:.0f}" if 100.0 <= shown < 1e6 else f"{shown:.2g}"


@dataclass(frozen=True)
class AccuracyLevel:
    """Time step and mesh coarseness of a twin."""

    step_ns: int
    halvings: int = 0  # number of times the scene's element count was halved

    @property
    def step_s(self) -> float:
        """Time step [s]."""
        return self.step_ns / 1e9
