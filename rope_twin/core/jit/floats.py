"""Floating point in kernels: subnormal numbers as zero, and a cosine that LLVM can vectorise.

**Subnormals.** Numbers below 2.2e-308 count as zero while a kernel steps. What moves a rope
sideways fades along it to such numbers while a sea rises, and a processor takes a hundred cycles
for each. `flush()` has the processor take them as 0, and what comes out so small too (bits 6 and 15
of MXCSR: Intel, Software Developer's Manual, vol. 1, 10.2.3); `restore(was)` gives back what there
was, for the caller's own arithmetic. Both are of the thread that calls. Plain Python, and
processors that have no such register, keep them.

**Cosine.** The C library's is a call, which keeps its loop scalar. Here x is brought to r within
±π/2 by k·π, π in two parts of which the first has 30 bits, so that its product with k is exact
(Cody and Waite 1980); cos r is its series to r²⁰, whose rest is below 2e-17. The error is below
5e-16 for |x| < 1e6.
"""

from __future__ import annotations

import platform
from math import factorial, pi
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

from rope_twin.core.jit.decorators import jit_within

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


PI_HIGH, PI_LOW = 3.141592651605606, 1.984187159361080883e-09
A, B, C, D, E = (1.0 / factorial(k) for k in (20, 18, 16, 14, 12))
F, G, H, I = (1.0 / factorial(k) for k in (10, 8, 6, 4))


@jit_within
def cosine(x: Any) -> Any:
    """cos x, x in radian."""
    k = np.floor(x / pi + 0.5)
    r = (x - k * PI_HIGH) - k * PI_LOW
    z = r * r
    high = ((((A * z - B) * z + C) * z - D) * z + E) * z - F
    series = (((high * z + G) * z - H) * z + I) * z - 0.5
    odd = k - 2.0 * np.floor(0.5 * k)
    return (1.0 - 2.0 * odd) * (1.0 + series * z)
