"""Numbers below 2.2e-308 count as zero while a kernel steps.

What moves a rope sideways fades along it to such numbers while a sea rises, and a processor takes
a hundred cycles for each. `flush()` has the processor take them as 0, and what comes out so small
too (bits 6 and 15 of MXCSR: Intel, Software Developer's Manual, vol. 1, 10.2.3); `restore(was)`
gives back what there was, for the caller's own arithmetic. Both are of the thread that calls.
Plain Python, and processors that have no such register, keep them.
"""

from __future__ import annotations

import platform
from typing import Any

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

HAS_REGISTER = platform.machine() in ("x86_64", "AMD64")
FLUSHED = 1 << 15 | 1 << 6
_WORD = ir.IntType(32)


def _exchange(context: Any, builder: Any, name: str, place: Any) -> None:
    """Read the register into a place, or the other way."""
    if HAS_REGISTER:
        kind = ir.FunctionType(ir.VoidType(), [ir.IntType(8).as_pointer()])
        call = cgutils.get_or_insert_function(builder.module, kind, f"llvm.x86.sse.{name}")
        builder.call(call, [builder.bitcast(place, ir.IntType(8).as_pointer())])


@intrinsic
def _flush(context: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        was = cgutils.alloca_once(builder, _WORD)
        _exchange(context, builder, "stmxcsr", was)
        before = builder.load(was)
        now = cgutils.alloca_once(builder, _WORD)
        builder.store(builder.or_(before, ir.Constant(_WORD, FLUSHED)), now)
        _exchange(context, builder, "ldmxcsr", now)
        return before

    return types.uint32(), generate


@intrinsic
def _restore(context: Any, was: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        place = cgutils.alloca_once(builder, _WORD)
        builder.store(arguments[0], place)
        _exchange(context, builder, "ldmxcsr", place)
        return context.get_dummy_value()

    return types.void(types.uint32), generate


if config.DISABLE_JIT:

    def flush() -> int:
        """Nothing."""
        return 0

    def restore(was: int) -> None:
        """Nothing."""

else:
    flush, restore = _flush, _restore
