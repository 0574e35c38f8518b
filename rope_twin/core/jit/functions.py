"""Functions of numbers in kernels: subnormal numbers as zero, cosine, exp, log, powers, fused sums.

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

**Wide numbers** (core/jit/wide). `exp`, `log`, sine, arc cosine, tanh and powers are called for
each lane in turn, so that a lane has the bits of the same call with one number.

**Fused sums.** LLVM, where it may, fuses a product with a sum; which ones depends on the code
around them: on the sign of a sum, on the block that negates, on a loop being unrolled. Kernels that
branch for one rope and have masks in lanes then differ in the last bit. They are compiled to round
after each operation (`jit_exact`), and say with `fused` where a product and a sum are one.

**CPU reference benchmark** (`chain`): multiply-adds, each of which depends on the one before. The
solver's speed divided by this figure is comparable between machines.
"""

from __future__ import annotations

import math
import operator
import platform
from collections.abc import Callable
from functools import wraps
from math import factorial, pi
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.core.typing.templates import signature
from numba.extending import intrinsic, overload

from rope_twin.core.jit.decorators import INLINED, LINKED, jit_entry, jit_exact_within, jit_within
from rope_twin.core.jit.rows import unheld
from rope_twin.core.jit.wide import (
    LANES,
    REGISTER,
    WIDE,
    MaskType,
    TableType,
    WideType,
    bits,
    choose,
    cpu_features,
    mask_of,
    register,
    spread,
)

HAS_REGISTER = platform.machine() in ("x86_64", "AMD64")
# the processor multiplies and adds in one instruction
FUSES = "+fma" in cpu_features() or platform.machine() in ("aarch64", "arm64")
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
        """Return no mode: plain Python keeps the processor's."""
        return 0

    def restore(was: int) -> None:
        """Keep the processor's mode."""

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


_INDEX = ir.IntType(32)
_DOUBLE = types.float64


def _each_lane(function: Any, count: int) -> None:
    """Register a function of `count` numbers, one of which is wide at least."""

    def generate(context: Any, builder: Any, *values: Any) -> Any:
        one = signature(_DOUBLE, *([_DOUBLE] * count))
        called = context.get_function(function, one)
        made = values[0]
        for lane in range(LANES):
            at = ir.Constant(_INDEX, lane)
            found = called(builder, [builder.extract_element(value, at) for value in values])
            made = builder.insert_element(made, found, at)
        return made

    register(function, count, WIDE, generate)


_each_lane(math.exp, 1)
_each_lane(math.sin, 1)
_each_lane(math.cos, 1)
_each_lane(math.log, 1)
_each_lane(math.acos, 1)
_each_lane(math.tanh, 1)
_each_lane(operator.pow, 2)


@jit_exact_within
def rounded(a: Any, b: Any) -> Any:
    """Return a·b, rounded by itself: never one with a sum, whatever stands around it."""
    return a * b


def fused(a: Any, b: Any, c: Any) -> Any:
    """Return a·b + c, rounded once if the processor has an instruction for it (Python: twice)."""
    return a * b + c


def _fused(context: Any, builder: Any, a: Any, b: Any, c: Any) -> Any:
    if not FUSES:
        return builder.fadd(builder.fmul(a, b), c)
    name = f"llvm.fma.v{LANES}f64" if a.type == REGISTER else "llvm.fma.f64"
    kind = ir.FunctionType(a.type, [a.type] * 3)
    called = cgutils.get_or_insert_function(builder.module, kind, name)
    return builder.call(called, [a, b, c], fastmath=("nsz",))


@intrinsic
def _fused_one(context: Any, a: Any, b: Any, c: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return _fused(context, builder, *arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


@intrinsic
def _fused_lanes(context: Any, a: Any, b: Any, c: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return _fused(context, builder, *(spread(builder, value) for value in arguments))

    return WIDE(a, b, c), generate


@overload(fused, jit_options={**INLINED, "fastmath": False}, strict=False)
def _compose_fused(a: Any, b: Any, c: Any) -> Any:
    if any(isinstance(kind, WideType) for kind in (a, b, c)):
        return lambda a, b, c: _fused_lanes(a, b, c)
    return lambda a, b, c: _fused_one(a, b, c)


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


def renewed(stage: Any, new: Any, old: Any) -> Any:
    """Return the new value; of lanes that the stage does not evaluate (LaneStage), the old one."""
    return new


@overload(renewed, jit_options=INLINED, strict=False)
def _compose_renewed(stage: Any, new: Any, old: Any) -> Any:
    if "lanes" in getattr(stage, "fields", ()):
        return lambda stage, new, old: choose(mask_of(stage.lanes), new, old)
    return lambda stage, new, old: new


def anywhere(which: Any) -> Any:
    """Return whether a condition holds, for wide numbers in one lane at least."""
    return which


@overload(anywhere, jit_options=INLINED, strict=False)
def _compose_anywhere(which: Any) -> Any:
    if isinstance(which, MaskType):
        return lambda which: bits(which) != 0
    return lambda which: which


def by_width(lone: Any, lanes: Any) -> Any:
    """Return the function `lone(...)`, or `lanes(...)` where an argument is wide, or such a table.

    Both are kernels; plain Python calls the first.
    """

    def call(*given: Any) -> Any:
        return lone(*given)

    @overload(call, jit_options=INLINED, strict=False)
    def compose(*given: Any) -> Any:
        wide = any(isinstance(kind, TableType | WideType) for kind in given)
        chosen = lanes if wide else lone
        return lambda *given: chosen(*given)

    return call


# The value at a place of a table whose places ascend; constant beyond its ends.
interpolate = by_width(_interpolate, _interpolate_lanes)


def by_type(kind: type, yes: Any, no: Any, options: dict[str, Any] = LINKED) -> Any:
    """Return the function `yes(first, ...)` where `first` is of this type of struct, else `no`.

    Both are plain functions with the same names of arguments; numba compiles the one it calls, with
    these options.
    """

    def call(first: Any, *rest: Any) -> Any:
        return (yes if isinstance(first, kind) else no)(first, *rest)

    @overload(call, jit_options=options, strict=False)
    def choose(first: Any, *rest: Any) -> Any:
        return yes if getattr(unheld(first), "instance_class", None) is kind else no

    return call


def lanes_only(options: dict[str, Any]) -> Callable[[Any], Any]:
    """Decorate a function of numba types that gives the code for them, compiled with these options.

    Only kernels can call it: it is about lanes, which plain Python has none of.
    """

    def decorate(compose: Any) -> Any:
        @wraps(compose)
        def call(*given: Any) -> Any:
            raise TypeError(
                "lanes exist in compiled code only; plain Python steps ropes one by one"
            )

        overload(call, jit_options=options, strict=False)(compose)
        return call

    return decorate


@jit_entry
def chain(x: float, a: float, b: float, links: int) -> Any:
    """Return x after `links` repetitions of x ← a·x + b."""
    for _ in range(links):
        x = a * x + b
    return x
