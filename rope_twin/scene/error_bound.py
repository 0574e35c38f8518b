"""Error bounds of a scene's results by mesh and time step, as a convergence study states them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

RMS, PEAK = "tension_rms", "tension_peak"  # quantities of every study


class Setting(NamedTuple):
    """Mesh, time step and tolerance of a run."""

    elements: int  # of the first rope; the others' in proportion
    step_s: float
    tolerance_n: float | None = None  # None: the scene's own

    def __str__(self) -> str:
        tolerance = "" if self.tolerance_n is None else f", tolerance {self.tolerance_n:g} N"
        return f"{self.elements} elements at {1e3 * self.step_s:g} ms{tolerance}"


@dataclass(frozen=True)
class Figure:
    """Error of one quantity at one setting, in the quantity's unit."""

    error: float | None  # relative to the reference, signed, or None without a reference
    at_most: float | None  # magnitude plus the reference's uncertainty; None: not converged


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
    unconverged_substeps: int = 0
    values: dict[str, float | None] = field(default_factory=dict)  # of the run itself

    @property
    def setting(self) -> Setting:
        """Return mesh, step and tolerance."""
        return Setting(self.elements, self.step_s, self.newton_tolerance_n)

    def bound(self, name: str) -> float:
        """Return the upper bound of a quantity's error, in its unit; NaN where it is unknown."""
        at_most = self.figures[name].at_most if name in self.figures else None
        return math.nan if at_most is None else at_most


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
