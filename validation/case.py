"""Validation case and its results: values with their reference and tolerance, and pictures.

A file of cases knows neither tables nor matplotlib: it returns Findings and Panels.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, isnan, nan
from typing import Protocol, TypeVar

from rope_twin.errors import InputError, RopeTwinError, did_you_mean
from rope_twin.run.progress import columns
from rope_twin.studies.picture import Panel


class Named(Protocol):
    """Something with the id of a case."""

    @property
    def id(self) -> str:
        """Return the name on the command line."""


C = TypeVar("C", bound=Named)
T = TypeVar("T")
Listener = Callable[[int, int, str], None]  # done, of how many, what comes next


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
        """Return whether the value passes; a value without criterion always does."""
        return not self.judged or (isfinite(self.ours) and bool(self.low <= self.ours <= self.high))

    @property
    def strain(self) -> float:
        """Return value over upper limit; inf if a limit of 0 is exceeded, or for NaN."""
        if self.high > 0.0 and not isnan(self.ours):
            return self.ours / self.high
        return 0.0 if self.ok else inf


def within_pct(quantity: str, ours: float, published: float, pct: float, unit: str = "") -> Finding:
    """Require a value within `pct` per cent of the published one."""
    margin = abs(published) * pct / 100.0
    low, high = published - margin, published + margin
    return Finding(quantity, float(ours), f"{published:.6g}", f"{pct:g} %", unit, low, high)


def within(quantity: str, ours: float, published: float, margin: float, unit: str = "") -> Finding:
    """Require a value within `margin` of the published one."""
    low, high = published - margin, published + margin
    tolerance = f"± {margin:g} {unit}".strip()
    return Finding(quantity, float(ours), f"{published:.6g}", tolerance, unit, low, high)


def between(
    quantity: str, ours: float, limits: tuple[float, float], published: str, unit: str = ""
) -> Finding:
    """Require a value between limits."""
    low, high = limits
    if low == -inf:
        tolerance = f"at most {high:g}"
    else:
        tolerance = f"at least {low:g}" if high == inf else f"{low:g} to {high:g}"
    return Finding(quantity, float(ours), published, tolerance, unit, low, high)


def limited(quantity: str, ours: float, limit: float, unit: str = "%") -> Finding:
    """Require a value not above a limit."""
    return Finding(quantity, float(ours), "", f"at most {limit:g}", unit, high=limit)


def shown(quantity: str, ours: float, published: str, unit: str = "") -> Finding:
    """Show a value next to another one, without acceptance criterion."""
    return Finding(quantity, float(ours), published, "shown", unit, judged=False)


def derived(finding: Finding) -> Finding:
    """Mark the other number as derived from the source's equations: no paper prints it."""
    return replace(finding, published=f"{finding.published} (derived)")


@dataclass(frozen=True)
class Found:
    """Results of a case."""

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
    quick: bool = True  # part of the daily tests


@dataclass(frozen=True)
class Row:
    """Outcome of a case; `refusal`: why it could not be completed."""

    case: Case
    found: Found
    refusal: str = ""
    seconds: float = 0.0

    @property
    def ok(self) -> bool:
        """Return whether all values of the case pass."""
        return not self.refusal and all(finding.ok for finding in self.found.findings)

    @property
    def worst(self) -> Finding:
        """Return the judged value closest to its limit, or farthest beyond it."""
        if self.refusal:
            return limited(self.refusal, nan, 0.0, "")
        judged = [finding for finding in self.found.findings if finding.judged]
        return max(judged, key=lambda finding: finding.strain)


def announced(items: Sequence[T], listen: Listener, label: Callable[[T], str]) -> Iterator[T]:
    """Yield items; `listen` hears of each, as the number done, that of all, and its label."""
    for number, item in enumerate(items):
        listen(number, len(items), label(item))
        yield item
    listen(len(items), len(items), "done")


def choose(command: str, cases: Sequence[C], ids: Sequence[str]) -> tuple[C, ...]:
    """Return the cases with these ids in their own order; all if no id is given.

    Raises:
        InputError: an unknown id.
    """
    known = list(dict.fromkeys(case.id for case in cases))
    for name in ids:
        if name not in known:
            raise InputError(command, f"there is no case '{name}'", did_you_mean(name, known))
    return tuple(case for case in cases if not ids or case.id in ids)


def run_each(cases: Sequence[Case]) -> Iterator[Row]:
    """Run the cases in full, one after the other; a terminal shows which one is running."""
    live = sys.stderr.isatty()
    for number, case in enumerate(cases, 1):
        if live:
            line = f"{number} of {len(cases)}: {case.id}, about {case.seconds:.0f} s"
            line = line[: columns(sys.stderr) - 1]
            print(f"\r\033[K{line}", end="", file=sys.stderr, flush=True)
        row = run_case(case)
        if live:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
        yield row


def run_case(case: Case) -> Row:
    """Run one in full; a solver that gives up is a row that does not pass, with its sentence."""
    began = time.perf_counter()
    try:
        result, refusal = case.run(), ""
    except RopeTwinError as error:
        result, refusal = Found(()), str(error)
    return Row(case, result, refusal, time.perf_counter() - began)
