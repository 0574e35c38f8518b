"""One implicit stage of ropes in lanes: Newton as in `core/solve/stage`.

A lane that has converged is held while others go on, and keeps the factors of its last elimination,
which its BDF2 stage begins with (core/solve/again). What is rare does not happen here: a lane that
wants the line search, or whose factors do not serve, is given up, and its rope takes the step by
itself.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit
from rope_twin.core.jit.wide import ALL, choose, mask_of
from rope_twin.core.lanes.elimination import eliminate_wide, push_wide, substitute_wide
from rope_twin.core.rope.elastic import growth_of, stretch, stretch_all, stretch_corrected
from rope_twin.core.solve.again import count_left
from rope_twin.core.solve.assembly import load_lowest, load_nodes, set_flow
from rope_twin.core.solve.prediction import correct, predict_bdf2, predict_trapezoid
from rope_twin.core.solve.search import SEARCH_FROM
from rope_twin.core.solve.stage import CHUNK, TRAPEZOID
from rope_twin.core.state import ELEMENTS

SPAN = 4


@jit
def solve_stage(rope: Any, stage: Any, kind: int, wanted: int, again: int) -> Any:
    """Find the acceleration; motion and tension then belong to the stage's time.

    wanted: lanes that matter, as bits; again: those that begin with the factors that there are.
    Returns those that did not converge, and the corrections of each lane.
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
    """a += delta by the factors of before in these lanes, with motion; those left with a force."""
    work, first, n = rope.work, rope.model.first_free, rope.state.counts[ELEMENTS]
    push_wide(work, first, n)
    substitute_wide(work, first, n, 0, (n - first - 1) // 2)
    left = again & count_left(rope, stage, CHUNK)
    going = choose(mask_of(again & (ALL - left)), 1.0, 0.0)
    correct(work, stage.p, stage.q, going, first, n)
    return int(left)


@jit
def _evaluate(rope: Any, stage: Any, kind: int) -> None:
    """Motion, tension, residual and blocks of the prediction; spans of nodes as for one rope."""
    state, work, p, q = rope.state, rope.work, stage.p, stage.q
    n, first = state.counts[ELEMENTS], rope.model.first_free
    for chunk in range(0, n, CHUNK):
        end = min(chunk + CHUNK, n)
        for start in range(chunk, end, SPAN):
            low, high = max(start, first), min(start + SPAN, end)
            if kind == TRAPEZOID:
                predict_trapezoid(state.nodes, work, p, q, low, high)
            else:
                predict_bdf2(state.nodes, work, p, q, low, high)
            stretch(rope.law, work, state.offset, p, q, 0.0, max(start - 1, 0), high - 1)
        done, last = max(chunk - 1, 0), end - 1
        if end == n:
            last = n
            stretch(rope.law, work, state.offset, p, q, growth_of(rope, stage), n - 1, n)
        set_flow(rope.effects, work, stage, done, last)
        load_nodes(rope.effects, work, stage, max(done, 1), last)
    load_lowest(rope.effects, work, stage)


@jit
def _reload(rope: Any, stage: Any) -> None:
    """Residual and blocks where motion and tension are up to date."""
    load_nodes(rope.effects, rope.work, stage, 1, rope.state.counts[ELEMENTS])
    load_lowest(rope.effects, rope.work, stage)


@jit
def _correct_span(rope: Any, stage: Any, going: Any, low: int, high: int, done: int) -> int:
    """a += delta of the nodes low <= i < high, with the elements from `done` to high - 2."""
    correct(rope.work, stage.p, stage.q, going, low, high)
    return int(stretch_corrected(rope, stage, 0.0, done, high - 1))


@jit
def _correct(rope: Any, stage: Any, going: Any) -> int:
    """a += delta where `going` is 1, with motion and tension; lanes whose tensions all agree.

    From the middle outward, as the substitution finds delta.
    """
    work, first, n = rope.work, rope.model.first_free, rope.state.counts[ELEMENTS]
    pairs = (n - first - 1) // 2
    unexpected = _correct_span(rope, stage, going, first + pairs, n - pairs, first + pairs)
    for high in range(pairs, 0, -SPAN):
        low = max(high - SPAN, 0)
        substitute_wide(work, first, n, low, high)
        correct(work, stage.p, stage.q, going, first + low, first + high)
        unexpected |= stretch_corrected(rope, stage, 0.0, first + low, first + high)
        unexpected |= _correct_span(rope, stage, going, n - high, n - low, n - high - 1)
    unexpected |= stretch_corrected(rope, stage, 0.0, 0, first)
    unexpected |= stretch_corrected(rope, stage, growth_of(rope, stage), n - 1, n)
    return int(ALL - unexpected)
