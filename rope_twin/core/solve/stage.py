"""One implicit stage: x = x_hat + p·a, v = v_hat + q·a, solved for a by semismooth Newton.

The tension-only energy is convex in a, so there is one minimum. A stage is accepted when every
tension agrees with its linearisation and, where an effect has an active set, every node is
balanced; from the fourth correction on a secant line search keeps Newton's method from overshooting
between slack and taut (full steps suffice before).

A stage may begin with the factors of the one before (core/solve/again).
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from numba.extending import overload

from rope_twin.core.acting import hooks, terms
from rope_twin.core.banded.pentadiagonal import eliminate_coupled, push_coupled, take_links
from rope_twin.core.banded.tridiagonal import eliminate, push
from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.jit.rows import rows
from rope_twin.core.rope.elastic import count_unexpected, stretch
from rope_twin.core.solve.again import count_left
from rope_twin.core.solve.assembly import load_lowest, load_nodes, set_flow, slope
from rope_twin.core.solve.prediction import correct, predict_on, predict_trapezoid
from rope_twin.core.solve.remembering import predict_memories
from rope_twin.core.solve.search import SEARCH_FROM, search
from rope_twin.core.state import ELEMENTS, RESIDUAL, SOLVES, SOLVES_MAX

MAX_CORRECTIONS = 12  # corrections before the step is divided into substeps
# A row of slack elements becomes taut one by one, one correction each: at the shortest substep more
# corrections are allowed (the energy is convex, so they converge).
MAX_CORRECTIONS_LAST = 200
NOT_FINITE, UNCONVERGED, CONVERGED, PENDING = -1, 0, 1, 2  # ordered from worst to best
# Kinds of evaluation, as numpy integers: numba compiles again for each Python literal.
TRAPEZOID, BDF2, SEARCH = np.int64(0), np.int64(1), np.int64(2)
CHUNK = 64  # nodes per chunk of all passes: their rows fit into the nearest cache


def _as_coupled(coupled: Any, plain: Any) -> Any:
    """Return a solver of the chain: `coupled` if an effect's type couples nodes, else `plain`."""

    def solve(effects: Any, work: Any, first: Any, n: Any) -> None:
        (coupled if hooks.couples(map(type, effects)) else plain)(work, first, n)

    @overload(solve, jit_options=LINKED, strict=False)
    def choose(effects: Any, work: Any, first: Any, n: Any) -> Any:
        chosen = coupled if hooks.couples(part.instance_class for part in effects) else plain

        def call(effects: Any, work: Any, first: Any, n: Any) -> None:
            chosen(work, first, n)

        return call

    return solve


@jit
def _is_balanced(rope: Any) -> bool:
    """Return whether the residual of every node is below the tolerance and not NaN."""
    Rx, Ry, Rz = rows(rope.work, RESIDUAL, 0)
    most, left = rope.model.tolerance * rope.model.tolerance, 0
    for i in range(rope.model.first_free, rope.state.counts[ELEMENTS]):
        left += not Rx[i] * Rx[i] + Ry[i] * Ry[i] + Rz[i] * Rz[i] <= most
    return bool(left == 0)


def _switches(effects: Any) -> Any:
    """Return whether effects have active sets, so that tensions alone do not show convergence."""
    return hooks.switches(map(type, effects))


@overload(_switches, jit_options=LINKED, strict=False)
def _choose_balance(effects: Any) -> Any:
    if hooks.switches(effect.instance_class for effect in effects):
        return lambda effects: True
    return lambda effects: False


@jit
def _push_links(work: Any, first: int, n: int) -> None:
    """Solve with the previous factors; subtract the effect of the couplings from the residual."""
    push_coupled(work, first, n)
    take_links(work, n)


_eliminate = _as_coupled(eliminate_coupled, eliminate)
_push = _as_coupled(_push_links, push)  # with the existing factors


@jit
def _is_solved_again(rope: Any, stage: Any) -> bool:
    """Return whether one correction with the last elimination's factors solves the stage.

    If not, motion, tension and blocks are those of the prediction.
    """
    effects, work, n = rope.effects, rope.work, rope.state.counts[ELEMENTS]
    if not terms.is_calm(effects, work, stage, n, 0.0):
        return False
    _push(effects, work, rope.model.first_free, n)
    rope.state.health[SOLVES] += 1
    if count_left(rope, stage, CHUNK) == 0 and terms.is_calm(effects, work, stage, n, 1.0):
        return True
    _evaluate(rope, stage, SEARCH, 0.0, 0.0)
    return False


@jit
def solve_stage(rope: Any, stage: Any, kind: int, cap: int, pending: float, again: bool) -> int:
    """Solve for the acceleration; tension and motion are then the stage's.

    kind: TRAPEZOID or BDF2; cap: maximum number of corrections; pending: fraction of CORRECTION
    still to be added to the previous motion; again: begin with the existing factors. Returns
    PENDING if the last correction is still to be added to the motion, CONVERGED, UNCONVERGED, or
    NOT_FINITE if a force is not.
    """
    state, work = rope.state, rope.work
    n, first = state.counts[ELEMENTS], rope.model.first_free
    _evaluate(rope, stage, kind, 0.0, pending)
    if again and _is_solved_again(rope, stage):
        return PENDING
    for correction in range(1, cap + 1):
        _eliminate(rope.effects, work, first, n)
        state.health[SOLVES] += 1
        state.health[SOLVES_MAX] = max(state.health[SOLVES_MAX], correction)
        unexpected = _look_ahead(rope, stage)
        if unexpected == 0 and terms.is_calm(rope.effects, work, stage, n, 1.0):
            return PENDING
        before = _slope(rope)
        if not isfinite(before):
            return NOT_FINITE
        _evaluate(rope, stage, SEARCH, 1.0, 0.0)
        if unexpected == 0 and _switches(rope.effects) and _is_balanced(rope):
            return CONVERGED
        if correction >= SEARCH_FROM:
            search(rope, stage, before, _correct_by, _slope)
    return UNCONVERGED


@jit
def _evaluate(rope: Any, stage: Any, kind: int, factor: float, pending: float) -> None:
    """Evaluate motion, tension, residual and blocks: predicted, or (SEARCH) corrected.

    SEARCH applies a += factor·delta. Elements and loads follow one node behind, since an element
    needs both of its nodes.
    """
    state, work, p, q = rope.state, rope.work, stage.p, stage.q
    n = state.counts[ELEMENTS]
    for start in range(0, n, CHUNK):
        low, high = max(start, rope.model.first_free), min(start + CHUNK, n)
        if kind == TRAPEZOID:
            predict_trapezoid(state.nodes, work, p, q, low, high)
        elif kind == BDF2:
            predict_on(state.nodes, work, p, q, pending, low, high)
        else:
            correct(work, p, q, factor, low, high)
        done, last = max(start - 1, 0), n if high == n else high - 1
        stretch(rope.law, work, state.offset, p, q, done, last)
        if kind != SEARCH:
            set_flow(rope.effects, work, stage, done, last)
            predict_memories(rope.effects, rope, stage, kind, done, last)
        load_nodes(rope.effects, work, stage, max(done, 1), last)
    load_lowest(rope.effects, work, stage)
    terms.add_couplings(rope.effects, work, stage, n)


@jit
def _look_ahead(rope: Any, stage: Any) -> int:
    """Set direction and tension as if corrected; return the number of deviating tensions."""
    n = rope.state.counts[ELEMENTS]
    return int(count_unexpected(rope, stage, n - n, n))


@jit
def _correct_by(rope: Any, stage: Any, factor: float) -> None:
    """Apply a += factor·delta and evaluate the stage."""
    _evaluate(rope, stage, SEARCH, factor, 0.0)


@jit
def _slope(rope: Any) -> Any:
    """Return R·delta of the rope."""
    return slope(rope.work, rope.model.first_free, rope.state.counts[ELEMENTS])
