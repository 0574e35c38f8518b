"""One implicit stage of a SIMD batch: Newton's method as in `core/newton`.

A lane that has converged is frozen while others iterate, and keeps the factors of its last
elimination, with which its BDF2 stage begins (core/newton). Rare cases are excluded: a lane
that needs the line search, or whose factors cannot be reused, is dropped, and its rope takes the
step in the single-rope solver.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.axial_law import law_of
from rope_twin.core.elements import stretch, stretch_all, stretch_corrected
from rope_twin.core.integrator import TRAPEZOID, correct, predict_bdf2, predict_trapezoid
from rope_twin.core.jit.decorators import jit
from rope_twin.core.jit.wide import ALL, choose, mask_of
from rope_twin.core.lanes.elimination import eliminate_wide, push_wide, substitute_wide
from rope_twin.core.loads.balance import load_lowest, load_nodes, set_flow
from rope_twin.core.newton import CHUNK, SEARCH_FROM, count_left
from rope_twin.core.state import ELEMENTS

SPAN = 4


@jit
def solve_stage(rope: Any, stage: Any, kind: int, wanted: int, again: int) -> Any:
    """Solve for the acceleration; motion and tension then belong to the stage's time.

    wanted: active lanes, as bits; again: lanes that begin with the existing factors. Returns the
    lanes that did not converge, and the number of corrections of each lane.
    """
    n, first = rope.state.counts[ELEMENTS], rope.model.first_free
    _evaluate(rope, stage, kind)
    again &= wanted
    active, given_up, count = wanted & (ALL - again), 0, 0.0 * rope.model.tolerance
    if again != 0:
        given_up = _correct_again(rope, stage, again)
        count += choose(mask_of(again), 1.0, 0.0)
        if active == 0:
            return given_up, count
        stretch_all(rope, stage)
    for correction in range(1, SEARCH_FROM + 1):
        eliminate_wide(rope.work, first, n, mask_of(active))
        going = choose(mask_of(active), 1.0, 0.0)
        count += going
        active &= ALL - _correct(rope, stage, going)
        if active == 0 or correction == SEARCH_FROM:
            break
        _reload(rope, stage)
    return active | given_up, count


@jit
def _correct_again(rope: Any, stage: Any, again: int) -> int:
    """Apply a correction with existing factors in lanes `again`; return those with residuals."""
    work, first, n = rope.work, rope.model.first_free, rope.state.counts[ELEMENTS]
    push_wide(work, first, n)
    substitute_wide(work, first, n, 0, (n - first - 1) // 2)
    left = again & count_left(rope, stage, CHUNK)
    going = choose(mask_of(again & (ALL - left)), 1.0, 0.0)
    correct(work, stage.p, stage.q, going, first, n)
    return int(left)


@jit
def _evaluate(rope: Any, stage: Any, kind: int) -> None:
    """Evaluate motion, tension, residual and blocks of the prediction, in spans of nodes."""
    state, work, p, q = rope.state, rope.work, stage.p, stage.q
    n, first = state.counts[ELEMENTS], rope.model.first_free
    for chunk in range(0, n, CHUNK):
        end = min(chunk + CHUNK, n)
        for start in range(chunk, end, SPAN):
            low, high = max(start, first), min(start + SPAN, end)
            if kind == TRAPEZOID:
                predict_trapezoid(state.nodes, work, p, q, low, high)
            else:
                predict_bdf2(state.nodes, work, p, q, 0.0, low, high)
            stretch(law_of(rope), work, state.offset, p, q, max(start - 1, 0), high - 1)
        done, last = max(chunk - 1, 0), end - 1
        if end == n:
            last = n
            stretch(law_of(rope), work, state.offset, p, q, n - 1, n)
        set_flow(rope.effects, work, stage, done, last)
        load_nodes(rope.effects, work, stage, max(done, 1), last)
    load_lowest(rope.effects, work, stage)


@jit
def _reload(rope: Any, stage: Any) -> None:
    """Evaluate residual and blocks where motion and tension are up to date."""
    load_nodes(rope.effects, rope.work, stage, 1, rope.state.counts[ELEMENTS])
    load_lowest(rope.effects, rope.work, stage)


@jit
def _correct_span(rope: Any, stage: Any, going: Any, low: int, high: int, done: int) -> int:
    """Apply delta to the nodes low <= i < high, and update the elements from `done` to high - 2."""
    correct(rope.work, stage.p, stage.q, going, low, high)
    return int(stretch_corrected(rope, stage, done, high - 1))


@jit
def _correct(rope: Any, stage: Any, going: Any) -> int:
    """Apply delta where `going` is 1, with motion and tension; return the converged lanes.

    It proceeds from the middle outward, in the order of the back-substitution.
    """
    work, first, n = rope.work, rope.model.first_free, rope.state.counts[ELEMENTS]
    pairs = (n - first - 1) // 2
    unexpected = _correct_span(rope, stage, going, first + pairs, n - pairs, first + pairs)
    for high in range(pairs, 0, -SPAN):
        low = max(high - SPAN, 0)
        substitute_wide(work, first, n, low, high)
        correct(work, stage.p, stage.q, going, first + low, first + high)
        unexpected |= stretch_corrected(rope, stage, first + low, first + high)
        unexpected |= _correct_span(rope, stage, going, n - high, n - low, n - high - 1)
    unexpected |= stretch_corrected(rope, stage, 0, first)
    unexpected |= stretch_corrected(rope, stage, n - 1, n)
    return int(ALL - unexpected)
