"""Array access in kernels: rows without aliasing, structs by reference, SIMD pairs.

**Rows** of a matrix, for loops over nodes or elements. `rows(work, POSITION, low)` returns the x, y
and z rows from column `low` on, `row(work, MASS, low)` one row, `span` several, and
`node_rows(nodes, POSITION, low)` rows of the state. The row number is part of its compiled type, so
that LLVM gets scoped no-alias metadata. Without it LLVM guards a vectorised loop by run-time
overlap checks of all rows, about 300 comparisons for the loads of the effects, which is more work
than the 64 nodes of a chunk.

Rows are not bounds-checked and accept no negative index. In plain Python they are numpy views.

**Structs by reference.** In machine code a struct is passed between kernels as one word per scalar
and ten per array: a hundred words for a rope, two hundred for a system, which every call copies.
`by_reference(struct)` stores it on the stack and passes one pointer; a field is loaded where it is
used. It is valid within the kernel that made it, and its fields are read-only (the contents of its
arrays are not). Loops over nodes take arrays and not such structs, since the compiler must assume
that memory behind a pointer may change.

**Pairs**: two doubles in a SIMD register, for loops that LLVM cannot vectorise. `pair(a, b)` makes
one, `+ - *` and `scalar / pair` work lane by lane, `lane(p, 0)` extracts one, `gather(row, i, j)`
loads two entries, `load(row, i)` and `store(row, i, p)` two adjacent ones. In plain Python a pair
is an array of two.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)
from numba.extending import intrinsic, lower_builtin, lower_getattr_generic, models, register_model

from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.scopes import set_alias_scope
from rope_twin.core.state import NODE_ROWS, Rope

_DOUBLE = ir.DoubleType()


class RowType(types.Type):  # type: ignore[misc]
    """numba type of one row of a matrix."""

    def __init__(self, scope: str) -> None:
        super().__init__(name=f"Row({scope})")
        self.scope = scope


@register_model(RowType)
class _RowModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _DOUBLE.as_pointer())


@infer_global(operator.getitem)
class _Get(AbstractTemplate):  # type: ignore[misc]
    def generic(self, arguments: Any, keywords: Any) -> Any:
        row, index = arguments
        if isinstance(row, RowType) and isinstance(index, types.Integer):
            return signature(types.float64, row, types.intp)
        return None


@infer_global(operator.setitem)
class _Set(AbstractTemplate):  # type: ignore[misc]
    def generic(self, arguments: Any, keywords: Any) -> Any:
        row, index, _ = arguments
        if isinstance(row, RowType) and isinstance(index, types.Integer):
            return signature(types.none, row, types.intp, types.float64)
        return None


@lower_builtin(operator.getitem, RowType, types.Integer)
def _get(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    pointer, index = arguments
    value = builder.load(builder.gep(pointer, [index]))
    set_alias_scope(builder.module, value, sig.args[0])
    return value


@lower_builtin(operator.setitem, RowType, types.Integer, types.Float)
def _set(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    pointer, index, value = arguments
    set_alias_scope(
        builder.module, builder.store(value, builder.gep(pointer, [index])), sig.args[0]
    )
    return context.get_dummy_value()


def _pointers(name: str, table: Any, first: Any, count: int, low: Any) -> Any:
    """Return typing and code generator of `count` rows from the literal `first` on."""
    number = first.literal_value
    if not isinstance(table, types.Array):  # a table of wide numbers
        result, code = table.pointers(name, number, count)
        return result(table, first, types.intp), code
    kinds = [RowType(f"{name} {number + k}") for k in range(count)]
    result = kinds[0] if count == 1 else types.BaseTuple.from_types(kinds)

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        array = context.make_array(sig.args[0])(context, builder, arguments[0])
        columns = builder.extract_value(array.shape, 1)
        pointers = []
        for k in range(count):
            at = builder.mul(columns, ir.Constant(columns.type, number + k))
            pointers.append(builder.gep(array.data, [builder.add(at, arguments[-1])]))
        return pointers[0] if count == 1 else context.make_tuple(builder, result, pointers)

    return result(*(kind for kind in (table, first, types.intp))), generate


@intrinsic(prefer_literal=True)
def _row(context: Any, work: Any, first: Any, low: Any) -> Any:
    return _pointers("work", work, first, 1, low)


@intrinsic(prefer_literal=True)
def _rows(context: Any, work: Any, first: Any, low: Any) -> Any:
    return _pointers("work", work, first, 3, low)


@intrinsic(prefer_literal=True)
def _span(context: Any, work: Any, first: Any, count: Any, low: Any) -> Any:
    kind, generate = _pointers("work", work, first, count.literal_value, low)
    return kind.return_type(work, first, count, types.intp), generate


@intrinsic(prefer_literal=True)
def _node_rows(context: Any, nodes: Any, first: Any, low: Any) -> Any:
    return _pointers("nodes", nodes, first, 3, low)


@intrinsic
def _offset_row(context: Any, offset: Any, low: Any) -> Any:
    if not isinstance(offset, types.Array):
        row_of, code = offset.row("offset")
        return row_of(offset, types.intp), code
    kind = RowType("offset")

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        array = context.make_array(sig.args[0])(context, builder, arguments[0])
        return builder.gep(array.data, [arguments[1]])

    return kind(offset, types.intp), generate


def _views(table: Any, first: int, low: int, count: int) -> Any:
    views = tuple(table[first + k, low:] for k in range(count))
    return views[0] if count == 1 else views


if config.DISABLE_JIT:

    def row(work: Any, first: int, low: int) -> Any:
        """Return row `first` of work from column `low` on."""
        return _views(work, first, low, 1)

    def rows(work: Any, first: int, low: int) -> Any:
        """Return three rows of work, x, y, z."""
        return _views(work, first, low, 3)

    def span(work: Any, first: int, count: int, low: int) -> Any:
        """Return `count` rows of work."""
        return _views(work, first, low, count)

    def node_rows(nodes: Any, first: int, low: int) -> Any:
        """Return three rows of state.nodes, x, y, z."""
        return _views(nodes, first, low, 3)

    def offset_row(offset: Any, low: int) -> Any:
        """Return State.offset from column `low` on."""
        return offset[low:]

    def end_to_end(work: Any) -> Any:
        """Return a view of a work array whose rows extend over the rows (or ropes) that follow."""
        count = work.shape[0]
        return np.lib.stride_tricks.as_strided(work, (count, 2**40), work.strides)

else:
    row, rows, span, node_rows = _row, _rows, _span, _node_rows
    offset_row = _offset_row

    @jit_within
    def end_to_end(work: Any) -> Any:
        """Return the work array itself: its rows are not bounds-checked."""
        return work


def table_rows(scope: str, count: int) -> Any:
    """Return the kernel f(table) that returns all rows of a table (count, n); one alias scope."""
    result = types.UniTuple(RowType(scope), count)

    @intrinsic
    def rows_of(context: Any, table: Any) -> Any:
        def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
            array = context.make_array(sig.args[0])(context, builder, arguments[0])
            columns = builder.extract_value(array.shape, 1)
            offsets = [builder.mul(columns, ir.Constant(columns.type, k)) for k in range(count)]
            pointers = [builder.gep(array.data, [offset]) for offset in offsets]
            return context.make_tuple(builder, result, pointers)

        return result(table), generate

    return tuple if config.DISABLE_JIT else rows_of


def stack_rows(scope: str, sizes: tuple[int, ...]) -> Any:
    """Return the kernel f() that allocates rows of these sizes on the stack of its caller.

    Row k has the alias scope `{scope} {k}` and is uninitialised.
    """
    result = types.Tuple([RowType(f"{scope} {k}") for k in range(len(sizes))])

    @intrinsic
    def rows_on_stack(context: Any) -> Any:
        def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
            pointers = [cgutils.alloca_once(builder, _DOUBLE, size) for size in sizes]
            return context.make_tuple(builder, result, pointers)

        return result(), generate

    def arrays() -> Any:
        return tuple(np.empty(size) for size in sizes)

    return arrays if config.DISABLE_JIT else rows_on_stack


@jit
def copy(source: Any, first: int, target: Any, first_target: int, n: int) -> None:
    """Copy position, velocity and acceleration of the nodes 0 <= i < n."""
    for k in range(min(NODE_ROWS, source.shape[0])):  # min(): not unrolled, for compile time
        a, b = source[first + k], target[first_target + k]
        for i in range(n):
            b[i] = a[i]


@jit_within
def column(work: Any, first: int, i: int) -> Any:
    """Return column i of three rows."""
    return work[first, i], work[first + 1, i], work[first + 2, i]


_NAMED = (types.NamedTuple, types.NamedUniTuple)


class ReferenceType(types.Type):  # type: ignore[misc]
    """numba type of a struct that is passed by reference."""

    def __init__(self, inner: Any) -> None:
        super().__init__(name=f"Reference({inner})")
        self.inner = inner

    def field(self, name: str) -> tuple[int, Any]:
        """Return number and type of a field; nested structs are references too."""
        number = self.inner.fields.index(name)
        kind = list(self.inner)[number]
        return number, ReferenceType(kind) if isinstance(kind, _NAMED) else kind


def struct_type(kind: Any) -> Any:
    """Return the numba type of a struct, also of a reference to one."""
    return kind.inner if isinstance(kind, ReferenceType) else kind


def field_type(kind: Any, name: str) -> Any:
    """Return the numba type of a struct's field."""
    inner = struct_type(kind)
    return inner.types[inner.fields.index(name)]


@register_model(ReferenceType)
class _ReferenceModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, manager.lookup(kind.inner).get_value_type().as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = ReferenceType

    def generic_resolve(self, held: Any, name: str) -> Any:
        return held.field(name)[1] if name in held.inner.fields else None


@lower_getattr_generic(ReferenceType)
def _read(context: Any, builder: Any, kind: Any, address: Any, name: str) -> Any:
    number, field = kind.field(name)
    index = [ir.Constant(ir.IntType(32), k) for k in (0, number)]
    place = builder.gep(address, index, inbounds=True)
    return place if isinstance(field, ReferenceType) else builder.load(place)


def _make_reference(struct: Any) -> Any:
    """Return typing and code generator of a struct stored on the stack."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return cgutils.alloca_once_value(builder, arguments[0])

    return ReferenceType(struct)(struct), generate


@intrinsic
def _reference(context: Any, struct: Any) -> Any:
    return _make_reference(struct)


@intrinsic
def system_by_reference(context: Any, system: Any) -> Any:
    """Return a reference to a system of ropes, but a single rope by value; for SIMD lanes."""
    if system.instance_class is Rope:
        return system(system), lambda context, builder, sig, arguments: arguments[0]
    return _make_reference(system)


if config.DISABLE_JIT:

    def by_reference(struct: Any) -> Any:
        """Return the struct itself."""
        return struct

else:
    by_reference = _reference


_FLAGS = ("contract", "nsz")
_INDEX = ir.IntType(32)
_REGISTER = ir.VectorType(_DOUBLE, 2)


class PairType(types.Type):  # type: ignore[misc]
    """numba type of a pair."""

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
    """Register typing and code of an operator on two pairs, and on scalar and pair."""

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
    """Return a pair of two numbers."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return _join(builder, *arguments)

    return PAIR(types.float64, types.float64), generate


@intrinsic(prefer_literal=True)
def lane(context: Any, p: Any, index: Any) -> Any:
    """Return lane 0 or 1 of a pair; the index is a literal."""
    number = index.literal_value

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return builder.extract_element(arguments[0], ir.Constant(_INDEX, number))

    return types.float64(p, index), generate


@intrinsic
def gather(context: Any, row: Any, i: Any, j: Any) -> Any:
    """Return row[i] and row[j] as a pair."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        source, first, second = arguments
        values = [builder.load(builder.gep(source, [index])) for index in (first, second)]
        for value in values:
            set_alias_scope(builder.module, value, sig.args[0])
        return _join(builder, *values)

    return PAIR(row, types.intp, types.intp), generate


@intrinsic
def load(context: Any, row: Any, i: Any) -> Any:
    """Return row[i] and row[i + 1] as a pair."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        address = builder.gep(arguments[0], [arguments[1]])
        value = builder.load(builder.bitcast(address, _REGISTER.as_pointer()))
        value.align = 8
        set_alias_scope(builder.module, value, sig.args[0])
        return value

    return PAIR(row, types.intp), generate


@intrinsic
def store(context: Any, row: Any, i: Any, p: Any) -> Any:
    """Set row[i] and row[i + 1] to the lanes of p."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        target, index, value = arguments
        address = builder.bitcast(builder.gep(target, [index]), _REGISTER.as_pointer())
        access = builder.store(value, address)
        access.align = 8
        set_alias_scope(builder.module, access, sig.args[0])
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
