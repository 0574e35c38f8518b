"""The hard cases of the rope solver: all of them, and what each one found.

A case holds if every one of its figures is within its limit; the row shows the figure that comes
nearest to its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from validation.case import choose, run_through
from validation.hard_cases import (
    cut,
    inputs,
    long,
    snap,
    start,
    vortices,
    vortices_beside,
    winch,
)
from validation.hard_cases.check import Case, Check

CASES: tuple[Case, ...] = (
    *snap.CASES,
    *winch.CASES,
    *cut.CASES,
    *start.CASES,
    *inputs.CASES,
    *long.CASES,
    *vortices.CASES,
    *vortices_beside.CASES,
)


@dataclass(frozen=True)
class Row:
    """Outcome of a robustness test."""

    case: Case
    checks: tuple[Check, ...]
    refusal: str  # the solver's sentence if it could not go on; else empty
    seconds: float

    @property
    def ok(self) -> bool:
        """Return whether every value is within its limit."""
        return not self.refusal and all(check.ok for check in self.checks)

    @property
    def worst(self) -> Check:
        """Return the value closest to its limit, or farthest beyond it."""
        if self.refusal:
            return Check(self.refusal, float("nan"), 0.0, "")
        return max(self.checks, key=lambda check: check.strain)


def choose_cases(ids: Sequence[str]) -> tuple[Case, ...]:
    """Return the cases with these ids in the order of CASES; all if there are none.

    Raises:
        InputError: an id that no case has.
    """
    return choose("python -m validation --hard-cases", CASES, ids, lambda case: case.id)


def run_case(case: Case) -> Row:
    """Run one; a solver that gives up is a row that does not hold."""
    checks, refusal, seconds = run_through(case.run, list[Check]())
    return Row(case, tuple(checks), refusal, seconds)
