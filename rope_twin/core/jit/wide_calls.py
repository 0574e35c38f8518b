"""Functions of wide numbers that have no SIMD instruction.

`exp`, `log` and powers are called for each lane in turn, so that a lane has the bits of the same
call with one number.
"""

from __future__ import annotations

import math
import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.imputils import impl_ret_untracked
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, overload

from rope_twin.core.jit.decorators import LINKED, jit_within
from rope_twin.core.jit.wide import LANES, WIDE, TableType, WideType, choose, mask_of, spread

_INDEX = ir.IntType(32)
_DOUBLE = types.float64


def _each_lane(function: Any, count: int) -> None:
    """Register a function of `count` numbers, one of which is wide at least."""

    class Template(AbstractTemplate):  # type: ignore[misc]
        def generic(self, arguments: Any, keywords: Any) -> Any:
            if len(arguments) != count:
                return None
            if not any(isinstance(kind, WideType) for kind in arguments):
                return None
            if not all(isinstance(kind, WideType | types.Float) for kind in arguments):
                return None
            return signature(WIDE, *arguments)

    infer_global(function)(Template)

    def code(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        one = signature(_DOUBLE, *([_DOUBLE] * count))
        called = context.get_function(function, one)
        values = [spread(builder, value) for value in arguments]
        made = values[0]
        for lane in range(LANES):
            at = ir.Constant(_INDEX, lane)
            found = called(builder, [builder.extract_element(value, at) for value in values])
            made = builder.insert_element(made, found, at)
        return impl_ret_untracked(context, builder, sig.return_type, made)

    if count == 1:
        lower_builtin(function, WideType)(code)
        return
    for kinds in ((WideType, WideType), (WideType, types.Float), (types.Float, WideType)):
        lower_builtin(function, *kinds)(code)


_each_lane(math.exp, 1)
_each_lane(math.log, 1)
_each_lane(operator.pow, 2)


@jit_within
def _interpolate(known: Any, values: Any, at: Any) -> Any:
    last = known.shape[0] - 1
    i = 0
    while i < last - 1 and known[i + 1] < at:
        i += 1
    if last == 0:
        return values[0]
    share = (at - known[i]) / (known[i + 1] - known[i])
    return values[i] + min(max(share, 0.0), 1.0) * (values[i + 1] - values[i])


@jit_within
def _interpolate_lanes(known: Any, values: Any, at: Any) -> Any:
    last = known.shape[0] - 1
    if last == 0:
        return values[0]
    low, high, here, then = known[0], known[1], values[0], values[1]
    for i in range(1, last):
        beyond = known[i] < at
        low, high = choose(beyond, known[i], low), choose(beyond, known[i + 1], high)
        here, then = choose(beyond, values[i], here), choose(beyond, values[i + 1], then)
    share = (at - low) / (high - low)
    return here + min(max(share, 0.0), 1.0) * (then - here)


def interpolate(known: Any, values: Any, at: Any) -> Any:
    """Return the value at a place of a table whose places ascend; constant beyond its ends."""
    return _interpolate(known, values, at)


@overload(interpolate, jit_options={**LINKED, "forceinline": True}, strict=False)
def _compose_interpolation(known: Any, values: Any, at: Any) -> Any:
    chosen = _interpolate_lanes if isinstance(known, TableType) else _interpolate
    return lambda known, values, at: chosen(known, values, at)


def renewed(stage: Any, new: Any, old: Any) -> Any:
    """Return the new value; of lanes that the stage does not evaluate (LaneStage), the old one."""
    return new


@overload(renewed, jit_options={**LINKED, "forceinline": True}, strict=False)
def _compose_renewed(stage: Any, new: Any, old: Any) -> Any:
    if "lanes" in getattr(stage, "fields", ()):
        return lambda stage, new, old: choose(mask_of(stage.lanes), new, old)
    return lambda stage, new, old: new
