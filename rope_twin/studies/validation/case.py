"""What a validation case is, and what it finds: figures beside the published ones, and pictures.

A file of cases knows neither tables nor matplotlib: it returns Findings and Panels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Finding:
    """One quantity: ours, what is published, and between which limits ours must lie."""

    quantity: str
    ours: float
    published: str  # the number as its source prints it, or where it comes from
    tolerance: str
    unit: str = ""
    low: float = -inf
    high: float = inf
    judged: bool = True  # False: shown beside the other number, held to nothing

    @property
    def ok(self) -> bool:
        """Whether ours lies within; what is only shown always does."""
        return not self.judged or (isfinite(self.ours) and bool(self.low <= self.ours <= self.high))


def within_pct(quantity: str, ours: float, published: float, pct: float, unit: str = "") -> Finding:
    """Ours must be within `pct` per cent of the published number."""
    margin = abs(published) * pct / 100.0
    low, high = published - margin, published + margin
    return Finding(quantity, float(ours), f"{published:.6g}", f"{pct:g} %", unit, low, high)


def within(quantity: str, ours: float, published: float, margin: float, unit: str = "") -> Finding:
    """Ours must be within `margin` of the published number."""
    low, high = published - margin, published + margin
    words = f"± {margin:g} {unit}".strip()
    return Finding(quantity, float(ours), f"{published:.6g}", words, unit, low, high)


def between(
    quantity: str, ours: float, limits: tuple[float, float], published: str, unit: str = ""
) -> Finding:
    """Ours must lie between limits."""
    low, high = limits
    if low == -inf:
        words = f"at most {high:g}"
    else:
        words = f"at least {low:g}" if high == inf else f"{low:g} to {high:g}"
    return Finding(quantity, float(ours), published, words, unit, low, high)


def shown(quantity: str, ours: float, published: str, unit: str = "") -> Finding:
    """Ours beside another number, held to nothing."""
    return Finding(quantity, float(ours), published, "shown", unit, judged=False)


@dataclass(frozen=True)
class Line:
    """A curve, or points if its style is a marker."""

    x: Sequence[float] | Vector
    y: Sequence[float] | Vector
    label: str = ""
    style: str = "-"


@dataclass(frozen=True)
class Field:
    """Values over a plane: (rows along y, columns along x), between the ends given."""

    values: Vector
    x: tuple[float, float]
    y: tuple[float, float]
    label: str  # of the colours; empty: no bar of them
    most: float | None = None  # value of the strongest colour, ±; None: the largest


@dataclass(frozen=True)
class Panel:
    """One set of axes."""

    title: str
    x: str
    y: str
    lines: tuple[Line, ...] = ()
    field: Field | None = None
    log: bool = False  # both axes logarithmic


@dataclass(frozen=True)
class Found:
    """What a case found."""

    findings: tuple[Finding, ...]
    panels: tuple[Panel, ...] = ()
    notes: tuple[str, ...] = ()  # what must be said beside the numbers: variants, why it is not met


@dataclass(frozen=True)
class Case:
    """One case of the physics that must be met."""

    id: str
    about: str
    source: str
    run: Callable[[], Found]
    seconds: float  # what it takes, roughly
    short: Callable[[], Found] | None = None  # a smaller form for the daily tests; None: itself


@dataclass(frozen=True)
class Row:
    """What became of a case; `refusal`: why it could not be run through."""

    case: Case
    found: Found
    refusal: str = ""
    seconds: float = 0.0

    @property
    def ok(self) -> bool:
        """Whether all of its figures are met."""
        return not self.refusal and all(finding.ok for finding in self.found.findings)
