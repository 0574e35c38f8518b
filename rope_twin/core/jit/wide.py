"""Wide numbers: LANES doubles, one of each rope of a group, in one SIMD register.

The kernels of one rope run on them unchanged: `+ - * /`, sqrt, abs, min and max work lane by lane,
comparisons give a mask, a bit for each lane, and `choose(mask, a, b)` picks by it. A mask is
neither true nor false: a kernel that branches on a wide number does not compile. Only compiled code
can use them.
"""

from __future__ import annotations

import math
import operator
from typing import Any

from llvmlite import ir
from llvmlite.binding import get_host_cpu_features
from numba import config, types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import (
    intrinsic,
    lower_builtin,
    lower_cast,
    models,
    overload,
    register_model,
)

from rope_twin.core.jit.decorators import LINKED


def register_doubles() -> int:
    """Return how many doubles the widest SIMD register of the compiler's target holds.

    Wider numbers would be split in two, and LLVM then fuses other multiplications and additions
    than in a single rope's code, so that a member would differ from its lone twin in the last bit.
    """
    features = config.CPU_FEATURES  # NUMBA_CPU_FEATURES: compile for another processor
    if features is None:
        features = get_host_cpu_features().flatten()
    return 8 if "+avx512f" in features.split(",") else 4


LANES = register_doubles()
ALL = (1 << LANES) - 1  # mask of all lanes
ALIGNMENT = 8 * LANES  # bytes; arrays of wide numbers begin at a multiple of it
_INLINED = {**LINKED, "forceinline": True}
_DOUBLE, _INDEX = ir.DoubleType(), ir.IntType(32)
REGISTER = ir.VectorType(_DOUBLE, LANES)
_BITS = ir.VectorType(ir.IntType(1), LANES)


class WideType(types.Type):  # type: ignore[misc]
    """numba's type of a wide number."""

    def __init__(self) -> None:
        super().__init__(name="Wide")


class MaskType(types.Type):  # type: ignore[misc]
    """numba's type of a bit for each lane; it is neither true nor false."""

    def __init__(self) -> None:
        super().__init__(name="Mask")


WIDE, MASK = WideType(), MaskType()


@register_model(WideType)
class _WideModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, REGISTER)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.IntType(LANES))


def spread(builder: Any, value: Any) -> Any:
    """A double in all lanes; what is wide stays as it is."""
    if value.type == REGISTER:
        return value
    one = builder.insert_element(ir.Constant(REGISTER, ir.Undefined), value, ir.Constant(_INDEX, 0))
    first = ir.Constant(ir.VectorType(_INDEX, LANES), [0] * LANES)
    return builder.shuffle_vector(one, ir.Constant(REGISTER, ir.Undefined), first)


def _register_pairwise(function: Any, result: Any, generate: Any) -> None:
    """Typing and code of an operator on two numbers of which one is wide at least."""

    class Template(AbstractTemplate):  # type: ignore[misc]
        def generic(self, arguments: Any, keywords: Any) -> Any:
            if len(arguments) != 2:
                return None
            if not any(isinstance(kind, WideType) for kind in arguments):
                return None
            if not all(isinstance(kind, WideType | types.Float) for kind in arguments):
                return None
            return signature(result, *arguments)

    infer_global(function)(Template)

    def code(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        a, b = (spread(builder, value) for value in arguments)
        return generate(builder, a, b)

    for kinds in ((WideType, WideType), (WideType, types.Float), (types.Float, WideType)):
        lower_builtin(function, *kinds)(code)


def _as_mask(builder: Any, bits: Any) -> Any:
    return builder.bitcast(bits, ir.IntType(LANES))


def _arithmetic(instruction: str) -> Any:
    def generate(builder: Any, a: Any, b: Any) -> Any:
        return getattr(builder, instruction)(a, b)

    return generate


def _comparison(sign: str) -> Any:
    def generate(builder: Any, a: Any, b: Any) -> Any:
        return _as_mask(builder, builder.fcmp_ordered(sign, a, b))

    return generate


def _extreme(sign: str) -> Any:
    """As numba does it for two doubles."""

    def generate(builder: Any, a: Any, b: Any) -> Any:
        return builder.select(builder.fcmp_ordered(sign, b, a), b, a)

    return generate


for _function, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
    (operator.iadd, "fadd"),
    (operator.isub, "fsub"),
    (operator.imul, "fmul"),
    (operator.itruediv, "fdiv"),
):
    _register_pairwise(_function, WIDE, _arithmetic(_instruction))
for _function, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
):
    _register_pairwise(_function, MASK, _comparison(_sign))
_register_pairwise(min, WIDE, _extreme("<"))
_register_pairwise(max, WIDE, _extreme(">"))


def _register_single(function: Any, generate: Any) -> None:
    class Template(AbstractTemplate):  # type: ignore[misc]
        def generic(self, arguments: Any, keywords: Any) -> Any:
            if len(arguments) == 1 and isinstance(arguments[0], WideType):
                return signature(WIDE, WIDE)
            return None

    infer_global(function)(Template)

    def code(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return generate(builder, arguments[0])

    lower_builtin(function, WideType)(code)


def _call(name: str) -> Any:
    def generate(builder: Any, a: Any) -> Any:
        kind = ir.FunctionType(REGISTER, [REGISTER])
        called = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")
        return builder.call(called, [a])

    return generate


def _negative(builder: Any, a: Any) -> Any:
    """As numba does it, so that sums are ordered alike."""
    return builder.fsub(ir.Constant(REGISTER, [-0.0] * LANES), a)


_register_single(math.sqrt, _call("sqrt"))
_register_single(abs, _call("fabs"))
_register_single(operator.neg, _negative)


class _Both(AbstractTemplate):  # type: ignore[misc]
    def generic(self, arguments: Any, keywords: Any) -> Any:
        if len(arguments) == 2 and all(isinstance(kind, MaskType) for kind in arguments):
            return signature(MASK, MASK, MASK)
        return None


@lower_builtin(operator.and_, MaskType, MaskType)
def _both(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    return builder.and_(*arguments)


@lower_builtin(operator.or_, MaskType, MaskType)
def _either(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    return builder.or_(*arguments)


for _function in (operator.and_, operator.or_):
    infer_global(_function)(_Both)


@intrinsic
def bits(context: Any, mask: Any) -> Any:
    """A mask as an integer, lane 0 the lowest bit."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return builder.zext(arguments[0], ir.IntType(64))

    return types.int64(mask), generate


@intrinsic
def mask_of(context: Any, number: Any) -> Any:
    """The mask of an integer."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return builder.trunc(arguments[0], ir.IntType(LANES))

    return MASK(types.int64), generate


@lower_cast(types.Float, WideType)
def _widen(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return spread(builder, value)


@intrinsic
def _select(context: Any, mask: Any, a: Any, b: Any) -> Any:
    """a in the lanes of the mask, else b."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        mask, left, right = arguments
        bits = builder.bitcast(mask, _BITS)
        return builder.select(bits, spread(builder, left), spread(builder, right))

    return WIDE(mask, a, b), generate


def choose(which: Any, a: Any, b: Any) -> Any:
    """a where `which` holds, else b: of two numbers, or lane by lane of wide ones."""
    return a if which else b


@overload(choose, jit_options=_INLINED, strict=False)
def _compose_choice(which: Any, a: Any, b: Any) -> Any:
    if isinstance(which, MaskType):
        return lambda which, a, b: _select(which, a, b)
    return lambda which, a, b: a if which else b


def count_beyond(count: int, a: Any, b: Any, tolerance: Any) -> int:
    """One more if a differs from b by more than the tolerance, or is NaN.

    Of wide numbers: a bit for each lane where one ever did.
    """
    return count + (not abs(a - b) <= tolerance)


@overload(count_beyond, jit_options=_INLINED, strict=False)
def _compose_count(count: Any, a: Any, b: Any, tolerance: Any) -> Any:
    if isinstance(a, WideType):
        return lambda count, a, b, tolerance: count | (ALL - bits(abs(a - b) <= tolerance))
    return lambda count, a, b, tolerance: count + (not abs(a - b) <= tolerance)
