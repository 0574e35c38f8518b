"""All validation cases, in the order of the page. A file of cases adds its CASES here."""

from __future__ import annotations

from collections.abc import Sequence

from validation import (
    convergence,
    curved_pipe,
    decomposed_riser,
    energy,
    modal_lines,
    snap,
    statics,
    stepping,
    swing,
    tow,
    two_line_loop,
    vibration,
    wake_cylinder,
)
from validation.case import Case, Found, Row, choose, run_through

FAMILIES = "PLQGUS"  # of ids, in the order of the page


def order_of_ids(name: str) -> tuple[int, int]:
    """Return a sort key for ids such as P10."""
    return FAMILIES.index(name[0]), int(name[1:])


CASES: tuple[Case, ...] = tuple(
    sorted(
        (
            *statics.CASES,
            *tow.CASES,
            *vibration.CASES,
            *swing.CASES,
            *convergence.CASES,
            *energy.CASES,
            *snap.CASES,
            *modal_lines.CASES,
            *curved_pipe.CASES,
            *wake_cylinder.CASES,
            *decomposed_riser.CASES,
            *two_line_loop.CASES,
            *stepping.CASES,
        ),
        key=lambda case: order_of_ids(case.id),
    )
)


def choose_cases(ids: Sequence[str]) -> tuple[Case, ...]:
    """Return the cases with these ids in the order of CASES; all if there are none.

    Raises:
        InputError: an id that no case has.
    """
    return choose("python -m validation", CASES, ids, lambda case: case.id)


def run_case(case: Case) -> Row:
    """Run one in full; a solver that gives up is a row that is not met."""
    return Row(case, *run_through(case.run, Found(())))
