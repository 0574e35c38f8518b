"""Ropes of a system, one or several: the functions that the step (core/step, core/newton) is over.

A system is a `Rope` by itself, or a `Joined`: a stack of ropes with connections. Its type selects
the code while numba compiles (`by_kind`): for a rope by itself the loops over ropes and all code of
connections vanish.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from rope_twin.core.jit.decorators import LINKED
from rope_twin.core.jit.rows import HeldType
from rope_twin.core.joined.joints import LOOSE, STEP, TOLERANCE
from rope_twin.core.joined.stack import face_ropes, rope_of
from rope_twin.core.state import ELEMENTS, LINE, Boundary, Rope, Stage

_WITHIN = {**LINKED, "forceinline": True}  # inlined in the caller


def by_kind(one: Any, many: Any) -> Any:
    """Return the function that is `one(system, ...)` of a Rope and `many(system, ...)` of a Joined.

    Both are plain functions with the same names of arguments; numba compiles the one that is
    called.
    """

    def call(system: Any, *rest: Any) -> Any:
        return (one if isinstance(system, Rope) else many)(system, *rest)

    @overload(call, jit_options=_WITHIN, strict=False)
    def choose(system: Any, *rest: Any) -> Any:
        kind = system.inner if isinstance(system, HeldType) else system
        return one if kind.instance_class is Rope else many

    return call


def _same_rope(system: Any, r: Any) -> Any:
    return system


def _rope_at(system: Any, r: Any) -> Any:
    return rope_of(system.stack, r)


def _same_stage(system: Any, stage: Any, r: Any) -> Any:
    return stage


def _stage_of(system: Any, stage: Any, r: Any) -> Any:
    return Stage(stage.time, stage.p, stage.q, system.joints.speed[r])


def _same_boundary(system: Any, boundary: Any, r: Any) -> Any:
    return boundary


def _boundary_of(system: Any, boundary: Any, r: Any) -> Any:
    return Boundary(boundary.value[r], boundary.rate[r])


def _face_others(system: Any, rope: Any) -> Any:
    face_ropes(rope.effects, rope, system.stack)


def _free_nodes(system: Any, r: Any) -> Any:
    return system.state.counts[ELEMENTS]


def _loaded_nodes(system: Any, r: Any) -> Any:
    return system.stack.counts[r, ELEMENTS] + (system.joints.upper[r] != LOOSE)


def _line_of(system: Any, boundary: Any, row: Any, r: Any) -> Any:
    return boundary.value[row, LINE]


def _line_at(system: Any, boundary: Any, row: Any, r: Any) -> Any:
    if system.joints.upper[r] == LOOSE:
        return boundary.value[r, row, LINE]
    return system.stack.s[r, system.stack.counts[r, ELEMENTS]]


# Number of ropes of a system.
count_ropes = by_kind(lambda system: 1, lambda system: system.stack.counts.shape[0])
# Rope r, and the stage with its payout speed, and its prescribed motion.
rope_at = by_kind(_same_rope, _rope_at)
stage_of = by_kind(_same_stage, _stage_of)
boundary_of = by_kind(_same_boundary, _boundary_of)
# What the effects of rope r depend on of other ropes, once a step.
face_others = by_kind(lambda system, rope: None, _face_others)
# Number of its nodes that carry loads: all except a hang-off.
count_loaded = by_kind(_free_nodes, _loaded_nodes)
# Its unstretched length at a step boundary [m].
length_at = by_kind(_line_of, _line_at)
# Time step [s] and tolerance [N] of a system, and its counters: those of the first rope. Counters
# come in a tuple because a kernel without memory management returns no array.
step_of = by_kind(lambda system: system.model.step, lambda system: system.stack.model[0, STEP])
tolerance_of = by_kind(
    lambda system: system.model.tolerance, lambda system: system.stack.model[0, TOLERANCE]
)
health_of = by_kind(lambda system: (system.state.health,), lambda system: (system.stack.health[0],))
