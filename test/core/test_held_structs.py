"""A struct passed by reference has the same fields and is one pointer to the compiler."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba.core.registry import cpu_target

from rope_twin.core.jit.decorators import OPTIONS, jit
from rope_twin.core.jit.rows import ReferenceType, by_reference
from rope_twin.core.state import Boundary, Floats


class Inner(NamedTuple):
    """Fields of several types."""

    rows: Floats
    number: int
    pair: tuple[float, float]


class Outer(NamedTuple):
    """Structs in a struct: one of mixed fields, one whose fields are alike."""

    inner: Inner
    boundary: Boundary


@jit
def _sum_up(held: Any) -> Any:
    """A change of each field shows, by powers of ten; an array's content changes."""
    inner, boundary = held.inner, held.boundary
    inner.rows[0, 0] += 1.0
    total = inner.rows[0, 0] + 10.0 * inner.rows[1, 2] + 100.0 * inner.number
    total += 1e3 * inner.pair[1] + 1e4 * boundary.value[0, 1] + 1e5 * boundary.rate[1, 0]
    return total


def _entry(outer: Any) -> Any:
    return _sum_up(by_reference(outer))


def test_fields_of_a_referenced_struct_equal_the_struct() -> None:
    """Numbers, arrays and structs within; what the kernel wrote is in the array afterwards."""
    border = np.arange(4.0).reshape(2, 2)
    outer = Outer(
        Inner(np.arange(6.0).reshape(2, 3), 3, (7.0, 8.0)), Boundary(border, 2.0 * border)
    )
    compiled = numba.njit(**OPTIONS)(_entry)
    expected = 1.0 + 10.0 * 5.0 + 100.0 * 3.0 + 1e3 * 8.0 + 1e4 * 1.0 + 1e5 * 4.0
    assert compiled(outer) == expected
    assert outer.inner.rows[0, 0] == 1.0
    outer.inner.rows[0, 0] = 0.0
    assert _sum_up.py_func(outer) == expected


def test_a_referenced_struct_is_one_pointer() -> None:
    """To the kernel that it is handed on to; as itself it would be all that is in it."""
    border = np.zeros((2, 2))
    outer = Outer(Inner(np.zeros((2, 3)), 3, (7.0, 8.0)), Boundary(border, border))
    (pointer,) = arguments_of(ReferenceType(numba.typeof(outer)))
    assert isinstance(pointer, ir.PointerType)
    (whole,) = arguments_of(numba.typeof(outer))
    assert whole == pointer.pointee


def arguments_of(kind: Any) -> list[Any]:
    """LLVM's types of what a kernel gets for an argument of this type."""
    convention = cpu_target.target_context.call_conv
    with_none = len(convention.get_function_type(numba.types.none, ()).args)
    return list(convention.get_function_type(numba.types.none, (kind,)).args[with_none:])
