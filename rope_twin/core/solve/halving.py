"""Substepping: a step is divided by two repeatedly where Newton's method does not converge."""

from __future__ import annotations

from typing import Any

import numpy as np

from rope_twin.core.jit.decorators import jit
from rope_twin.core.solve.stage import CONVERGED, NOT_FINITE, UNCONVERGED
from rope_twin.core.state import (
    REJECTED,
    STEPS,
    SUBSTEPS,
    SUBSTEPS_MAX,
    SUBSTEPS_UNCONVERGED,
    ZERO,
)

HALVINGS = 5  # down to h/32
OUT, BACK = np.int64(0), np.int64(1)  # directions of a copy: from the state to scratch, and back


@jit
def advance_substeps(
    rope: Any, health: Any, at: Any, substep: Any, copy_start: Any, accept: Any
) -> bool:
    """Advance one step of a rope or a multi-line system, with substeps if necessary; update health.

    at: boundary, row and time of the step. `substep(rope, at, level, done)` tries 1/2^level of the
    step from done/2^HALVINGS, and returns its outcome followed by the input of `accept(rope,
    found)`; `copy_start(rope, way)` saves the step's start (OUT) or restores it (BACK). Returns
    False if the result is not finite; the state is then unchanged.
    """
    full = 1 << HALVINGS
    done, level, substeps = ZERO, ZERO, 0
    while done < full:
        part = full >> level
        found = substep(rope, at, level, done)
        outcome = found[0]
        if outcome < CONVERGED and level < HALVINGS:
            level += 1
            health[REJECTED] += 1
            continue
        if outcome == NOT_FINITE:
            if done > 0:
                copy_start(rope, BACK)
            return False
        if outcome == UNCONVERGED:
            health[SUBSTEPS_UNCONVERGED] += 1
        if done == 0 and part < full:  # the step's start, in case a later part fails
            copy_start(rope, OUT)
        accept(rope, found)
        done += part
        substeps += 1
        while level > 0 and done % (full >> (level - 1)) == 0:
            level -= 1
    health[STEPS] += 1
    health[SUBSTEPS] += substeps
    health[SUBSTEPS_MAX] = max(health[SUBSTEPS_MAX], substeps)
    return True
