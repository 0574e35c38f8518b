"""All validation cases, in the order of the page, and all robustness tests.

A file of cases adds its CASES here.
"""

from __future__ import annotations

from validation import (
    bounces,
    convergence,
    curved_pipe,
    decomposed_riser,
    energy,
    modal_lines,
    moorpy_lines,
    nets,
    resonance,
    snap,
    statics,
    stepping,
    swing,
    tow,
    two_line_loop,
    vibration,
    wake_cylinder,
    waves_over_current,
)
from validation.case import Case
from validation.hard_cases import (
    borders,
    compensator,
    contact,
    cut,
    inputs,
    long,
    start,
    thrown,
    vortices,
    winch,
)
from validation.hard_cases import snap as hard_snap

FAMILIES = "PLQGUNS"  # of ids, in the order of the page


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
            *bounces.CASES,
            *resonance.CASES,
            *moorpy_lines.CASES,
            *modal_lines.CASES,
            *waves_over_current.CASES,
            *curved_pipe.CASES,
            *wake_cylinder.CASES,
            *decomposed_riser.CASES,
            *two_line_loop.CASES,
            *nets.CASES,
            *stepping.CASES,
        ),
        key=lambda case: order_of_ids(case.id),
    )
)


HARD_CASES: tuple[Case, ...] = (
    *hard_snap.CASES,
    *winch.CASES,
    *cut.CASES,
    *start.CASES,
    *thrown.CASES,
    *inputs.CASES,
    *long.CASES,
    *borders.CASES,
    *compensator.CASES,
    *contact.CASES,
    *vortices.CASES,
)
