"""One implicit stage of ropes in lanes: Newton as in `core/stage`, each lane until it converges.

A lane that has converged is held while others go on. What is rare does not happen here: a lane that
wants the line search is given up, and its rope takes the step by itself.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.assembly import load_lowest, load_nodes, set_flow
from rope_twin.core.elastic import growth_of, stretch, stretch_corrected
from rope_twin.core.jit import jit
from rope_twin.core.lanes.elimination import eliminate_wide
from rope_twin.core.lanes.wide import ALL, choose, mask_of
from rope_twin.core.prediction import correct, predict_bdf2, predict_trapezoid
from rope_twin.core.stage import CHUNK, SEARCH_FROM, TRAPEZOID
from rope_twin.core.state import ELEMENTS

SPAN = 4


@jit
def solve_stage(rope: Any, stage: Any, kind: int, wanted: int) -> Any:
    """Find the acceleration; motion and tension then belong to the stage's time.

    wanted: lanes that matter, as bits. Returns those that did not converge, and the corrections
    of each lane.
    """
    n, first = rope.state.counts[ELEMENTS], rope.model.first_free
    _evaluate(rope, stage, kind)
    active = wanted
    count = 0.0 * rope.model.tolerance
    for correction in range(1, SEARCH_FROM + 1):
        eliminate_wide(rope.work, first, n)
        going = choose(mask_of(active), 1.0, 0.0)
        count += going
        active &= ALL - _correct(rope, stage, going)
        if active == 0 or correction == SEARCH_FROM:
            break
        _reload(rope, stage)
    return active, count


@jit
def _evaluate(rope: Any, stage: Any, kind: int) -> None:
    """Motion, tension, residual and blocks of the prediction.

    The water's velocity is taken over the same spans of nodes as for one rope.
    """
    state, work, p, q = rope.state, rope.work, stage.p, stage.q
    n, first = state.counts[ELEMENTS], rope.model.first_free
    for start in range(0, n, SPAN):
        low, high = max(start, first), min(start + SPAN, n)
        if kind == TRAPEZOID:
            predict_trapezoid(state.nodes, work, p, q, low, high)
        else:
            predict_bdf2(state.nodes, work, p, q, low, high)
        stretch(rope.law, work, state.offset, p, q, 0.0, max(start - 1, 0), high - 1)
    stretch(rope.law, work, state.offset, p, q, growth_of(rope, stage), n - 1, n)
    for start in range(0, n, CHUNK):
        high = min(start + CHUNK, n)
        set_flow(rope.effects, work, stage, max(start - 1, 0), n if high == n else high - 1)
    _reload(rope, stage)


@jit
def _reload(rope: Any, stage: Any) -> None:
    """Residual and blocks where motion and tension are up to date."""
    load_nodes(rope.effects, rope.work, stage, 1, rope.state.counts[ELEMENTS])
    load_lowest(rope.effects, rope.work, stage)


@jit
def _correct(rope: Any, stage: Any, going: Any) -> int:
    """a += delta where `going` is 1, with motion and tension; lanes whose tensions all agree."""
    work, p, q = rope.work, stage.p, stage.q
    n, first = rope.state.counts[ELEMENTS], rope.model.first_free
    unexpected = 0
    for start in range(0, n, SPAN):
        low, high = max(start, first), min(start + SPAN, n)
        correct(work, p, q, going, low, high)
        unexpected |= stretch_corrected(rope, stage, 0.0, max(start - 1, 0), high - 1)
    unexpected |= stretch_corrected(rope, stage, growth_of(rope, stage), n - 1, n)
    return int(ALL - unexpected)
