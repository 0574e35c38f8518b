"""Scalar functions for kernels: flush-to-zero mode, elementary functions, fused multiply-add.

**Subnormals.** Lateral motion decays along a rope to numbers below 2.2e-308 while the sea builds
up, and each operation on a subnormal number takes about a hundred cycles. `flush()` sets the
flush-to-zero and denormals-are-zero modes of the calling thread (bits 15 and 6 of MXCSR: Intel,
Software Developer's Manual, vol. 1, 10.2.3); `restore(mode)` restores the caller's mode. Both do
nothing in plain Python and on processors without this register.

**Cosine.** A call of the C library would prevent vectorisation. Here x is reduced to r within ±π/2
by k·π, with π in two parts of which the first has 30 bits, so that its product with k is exact
(Cody and Waite 1980); cos r is its Taylor series to r²⁰, with a remainder below 2e-17. The error is
below 5e-16 for |x| < 1e6.

**Wide numbers** (core/jit/wide). `exp`, `log`, sine, arc cosine, tanh and powers are evaluated lane
by lane, so that each lane is bit-identical to the scalar call.

**Fused multiply-add.** Which products LLVM contracts with sums depends on the surrounding code: the
sign of a sum, the block of a negation, loop unrolling. Kernels that branch for a single rope and
use masks in lanes would then differ in the last bit. They are compiled without contraction
(`jit_exact`), and use `fused` for explicit multiply-adds.

**CPU reference benchmark** (`chain`): a chain of dependent multiply-adds. The solver's speed over
this figure is comparable between machines.
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
from rope_twin.core.jit.rows import struct_type
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
# the processor has a fused multiply-add instruction
FUSES = "+fma" in cpu_features() or platform.machine() in ("aarch64", "arm64")
FLUSHED = 1 << 15 | 1 << 6
_WORD = ir.IntType(32)


def _exchange(context: Any, builder: Any, name: str, address: Any) -> None:
    """Store MXCSR at an address, or load it from there; name: of the instruction."""
    if HAS_REGISTER:
        kind = ir.FunctionType(ir.VoidType(), [ir.IntType(8).as_pointer()])
        call = cgutils.get_or_insert_function(builder.module, kind, f"llvm.x86.sse.{name}")
        builder.call(call, [builder.bitcast(address, ir.IntType(8).as_pointer())])


@intrinsic
def _flush(context: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        old = cgutils.alloca_once(builder, _WORD)
        _exchange(context, builder, "stmxcsr", old)
        before = builder.load(old)
        new = cgutils.alloca_once(builder, _WORD)
        builder.store(builder.or_(before, ir.Constant(_WORD, FLUSHED)), new)
        _exchange(context, builder, "ldmxcsr", new)
        return before

    return types.uint32(), generate


@intrinsic
def _restore(context: Any, was: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        address = cgutils.alloca_once(builder, _WORD)
        builder.store(arguments[0], address)
        _exchange(context, builder, "ldmxcsr", address)
        return context.get_dummy_value()

    return types.void(types.uint32), generate


if config.DISABLE_JIT:

    def flush() -> int:
        """Return 0: plain Python leaves the processor's mode unchanged."""
        return 0

    def restore(was: int) -> None:
        """Do nothing: plain Python leaves the processor's mode unchanged."""

else:
    flush, restore = _flush, _restore


PI_HIGH, PI_LOW = 3.141592651605606, 1.984187159361080883e-09
A, B, C, D, E = (1.0 / factorial(k) for k in (20, 18, 16, 14, 12))
F, G, H, I = (1.0 / factorial(k) for k in (10, 8, 6, 4))


@jit_within
def cosine(x: Any) -> Any:
    """Return cos x, x in radian."""
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
    """Register a scalar function of `count` arguments for wide arguments, lane by lane."""

    def generate(context: Any, builder: Any, *values: Any) -> Any:
        scalar = signature(_DOUBLE, *([_DOUBLE] * count))
        called = context.get_function(function, scalar)
        result = values[0]
        for lane in range(LANES):
            at = ir.Constant(_INDEX, lane)
            lane_value = called(builder, [builder.extract_element(value, at) for value in values])
            result = builder.insert_element(result, lane_value, at)
        return result

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
    """Return a·b, rounded individually: never contracted with a sum."""
    return a * b


def fused(a: Any, b: Any, c: Any) -> Any:
    """Return a·b + c, rounded once where the processor has an FMA instruction; twice in Python."""
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
def _interpolate(positions: Any, values: Any, at: Any) -> Any:
    last = positions.shape[0] - 1
    i = 0
    while i < last - 1 and positions[i + 1] < at:
        i += 1
    if last == 0:
        return values[0]
    fraction = (at - positions[i]) / (positions[i + 1] - positions[i])
    return values[i] + min(max(fraction, 0.0), 1.0) * (values[i + 1] - values[i])


@jit_within
def _interpolate_lanes(positions: Any, values: Any, at: Any) -> Any:
    last = positions.shape[0] - 1
    if last == 0:
        return values[0]
    low, high, lower, upper = positions[0], positions[1], values[0], values[1]
    for i in range(1, last):
        beyond = positions[i] < at
        low, high = choose(beyond, positions[i], low), choose(beyond, positions[i + 1], high)
        lower, upper = choose(beyond, values[i], lower), choose(beyond, values[i + 1], upper)
    fraction = (at - low) / (high - low)
    return lower + min(max(fraction, 0.0), 1.0) * (upper - lower)


def renewed(stage: Any, new: Any, old: Any) -> Any:
    """Return the new value, or the old one in lanes that the stage does not evaluate."""
    return new


@overload(renewed, jit_options=INLINED, strict=False)
def _compose_renewed(stage: Any, new: Any, old: Any) -> Any:
    if "lanes" in getattr(stage, "fields", ()):
        return lambda stage, new, old: choose(mask_of(stage.lanes), new, old)
    return lambda stage, new, old: new


def anywhere(which: Any) -> Any:
    """Return whether a condition holds, for wide numbers in any lane."""
    return which


@overload(anywhere, jit_options=INLINED, strict=False)
def _compose_anywhere(which: Any) -> Any:
    if isinstance(which, MaskType):
        return lambda which: bits(which) != 0
    return lambda which: which


def by_width(scalar: Any, lanes: Any) -> Any:
    """Return a function that calls `scalar(...)`, or `lanes(...)` if an argument is wide.

    Both are kernels; plain Python calls the first.
    """

    def call(*arguments: Any) -> Any:
        return scalar(*arguments)

    @overload(call, jit_options=INLINED, strict=False)
    def compose(*arguments: Any) -> Any:
        wide = any(isinstance(kind, TableType | WideType) for kind in arguments)
        chosen = lanes if wide else scalar
        return lambda *arguments: chosen(*arguments)

    return call


# Linear interpolation in a table with ascending positions; constant beyond its ends.
interpolate = by_width(_interpolate, _interpolate_lanes)


def by_type(kind: type, yes: Any, no: Any, options: dict[str, Any] = LINKED) -> Any:
    """Return a function that calls `yes(first, ...)` if `first` is of this struct type, else `no`.

    Both are plain functions with the same argument names; numba compiles the selected one with
    these options.
    """

    def call(first: Any, *rest: Any) -> Any:
        return (yes if isinstance(first, kind) else no)(first, *rest)

    @overload(call, jit_options=options, strict=False)
    def choose(first: Any, *rest: Any) -> Any:
        return yes if getattr(struct_type(first), "instance_class", None) is kind else no

    return call


def lanes_only(options: dict[str, Any]) -> Callable[[Any], Any]:
    """Decorator for an overload of numba types without a plain Python version.

    Only kernels can call it, since lanes exist in compiled code only.
    """

    def decorate(compose: Any) -> Any:
        @wraps(compose)
        def call(*arguments: Any) -> Any:
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
