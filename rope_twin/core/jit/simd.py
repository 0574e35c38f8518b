"""Two doubles in one SIMD register, for loops that a vectoriser cannot see through.

`pair(a, b)` makes one, `+ - *` and `scalar / pair` work lane by lane, `lane(p, 0)` takes one out,
`gather(row, i, j)` loads from two places, `load(row, i)` and `store(row, i, p)` two neighbours.
In plain Python a pair is an array of two.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from rope_twin.core.jit.rows import tell_apart

_FLAGS = ("contract", "nsz")
_DOUBLE, _INDEX = ir.DoubleType(), ir.IntType(32)
_REGISTER = ir.VectorType(_DOUBLE, 2)


class PairType(types.Type):  # type: ignore[misc]
    """numba's type of a pair."""

    def __init__(self) -> None:
        super().__init__(name="Pair")


PAIR = PairType()


@register_model(PairType)
class _PairModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _REGISTER)


def _join(builder: Any, first: Any, second: Any) -> Any:
    empty = ir.Constant(_REGISTER, ir.Undefined)
    half = builder.insert_element(empty, first, ir.Constant(_INDEX, 0))
    return builder.insert_element(half, second, ir.Constant(_INDEX, 1))


def _register_operator(function: Any, instruction: str) -> None:
    """Typing and code of one operator on pair and pair, and on scalar and pair."""

    class Template(AbstractTemplate):  # type: ignore[misc]
        def generic(self, arguments: Any, keywords: Any) -> Any:
            a, b = arguments
            if isinstance(b, PairType) and isinstance(a, PairType | types.Float):
                return signature(PAIR, a, PAIR)
            return None

    infer_global(function)(Template)

    def both(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return getattr(builder, instruction)(*arguments, flags=_FLAGS)

    def scalar_first(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        a, b = arguments
        return getattr(builder, instruction)(_join(builder, a, a), b, flags=_FLAGS)

    lower_builtin(function, PairType, PairType)(both)
    lower_builtin(function, types.Float, PairType)(scalar_first)


for _function, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _register_operator(_function, _instruction)


@intrinsic
def pair(context: Any, a: Any, b: Any) -> Any:
    """A pair of two numbers."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return _join(builder, *arguments)

    return PAIR(types.float64, types.float64), generate


@intrinsic(prefer_literal=True)
def lane(context: Any, p: Any, index: Any) -> Any:
    """Lane 0 or 1 of a pair; the index is a literal."""
    number = index.literal_value

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return builder.extract_element(arguments[0], ir.Constant(_INDEX, number))

    return types.float64(p, index), generate


@intrinsic
def gather(context: Any, row: Any, i: Any, j: Any) -> Any:
    """row[i] and row[j]."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        source, first, second = arguments
        values = [builder.load(builder.gep(source, [index])) for index in (first, second)]
        for value in values:
            tell_apart(builder.module, value, sig.args[0])
        return _join(builder, *values)

    return PAIR(row, types.intp, types.intp), generate


@intrinsic
def load(context: Any, row: Any, i: Any) -> Any:
    """row[i] and row[i + 1]."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        address = builder.gep(arguments[0], [arguments[1]])
        value = builder.load(builder.bitcast(address, _REGISTER.as_pointer()))
        value.align = 8
        tell_apart(builder.module, value, sig.args[0])
        return value

    return PAIR(row, types.intp), generate


@intrinsic
def store(context: Any, row: Any, i: Any, p: Any) -> Any:
    """row[i], row[i + 1] = p."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        target, index, value = arguments
        address = builder.bitcast(builder.gep(target, [index]), _REGISTER.as_pointer())
        access = builder.store(value, address)
        access.align = 8
        tell_apart(builder.module, access, sig.args[0])
        return context.get_dummy_value()

    return types.void(row, types.intp, PAIR), generate


if config.DISABLE_JIT:

    def pair(a: Any, b: Any) -> Any:
        """Return an array of two numbers."""
        return np.array([a, b])

    def lane(p: Any, index: Any) -> Any:
        """Return one of the two."""
        return p[index]

    def gather(row: Any, i: Any, j: Any) -> Any:
        """Return row[i] and row[j]."""
        return np.array([row[i], row[j]])

    def load(row: Any, i: Any) -> Any:
        """Return row[i] and row[i + 1]."""
        return row[i : i + 2].copy()

    def store(row: Any, i: Any, p: Any) -> None:
        """Set row[i] and row[i + 1]."""
        row[i : i + 2] = p
