"""Tables of SIMD vectors: the counterpart of arrays and their rows for a batch of ropes.

`tiles(array, rows)` makes a matrix of an array (columns, rows, LANES): the rows of a node are
adjacent in memory, a few pages at a time for any number of rows. `table(array)` makes a matrix of
an array (rows, columns, LANES) or a row of one (columns, LANES), `wide(array)` a vector of an array
(LANES,). Entries are indexed as in an array; `rows` and the like (core/jit/rows) work on both.
The arrays must be aligned to ALIGNMENT.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)
from numba.extending import intrinsic, lower_builtin, lower_getattr, models, register_model

from rope_twin.core.jit.rows import tell_apart
from rope_twin.core.jit.wide import ALIGNMENT, REGISTER, WIDE, WideType, spread


class TableType(types.Type):  # type: ignore[misc]
    """numba type of a matrix of SIMD vectors; `rows`: rows per column, 0: row by row."""

    def __init__(self, ndim: int, rows: int) -> None:
        super().__init__(name=f"WideTable({ndim}, {rows})")
        self.ndim, self.rows = ndim, rows

    def pointers(self, name: str, first: int, count: int) -> Any:
        """Return the type of `count` rows from `first` on, and their code generator."""
        stride = max(self.rows, 1)
        kinds = [WideRowType(f"{name} {first + k}", stride) for k in range(count)]
        result = kinds[0] if count == 1 else types.BaseTuple.from_types(kinds)

        def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
            data, low = builder.extract_value(arguments[0], 0), arguments[-1]
            at = builder.mul(low, ir.Constant(low.type, max(self.rows, 1)))
            places = [builder.add(at, ir.Constant(low.type, first + k)) for k in range(count)]
            made = [builder.gep(data, [place]) for place in places]
            return made[0] if count == 1 else context.make_tuple(builder, result, made)

        return result, generate

    def row(self, scope: str) -> Any:
        """Return the type of a one-row table from a column on, and the generator of its code."""

        def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
            return builder.gep(builder.extract_value(arguments[0], 0), [arguments[1]])

        return WideRowType(scope, 1), generate


@register_model(TableType)
class _TableModel(models.StructModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        members = [("data", types.CPointer(WIDE)), ("columns", types.intp)]
        super().__init__(manager, kind, members)


class WideRowType(types.Type):  # type: ignore[misc]
    """numba type of one row of a matrix of SIMD vectors."""

    def __init__(self, scope: str, stride: int) -> None:
        super().__init__(name=f"WideRow({scope}, {stride})")
        self.scope, self.stride = scope, stride


@register_model(WideRowType)
class _WideRowModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, REGISTER.as_pointer())


def _aligned(access: Any) -> Any:
    access.align = ALIGNMENT
    return access


def _place(context: Any, builder: Any, kind: TableType, table: Any, index: Any) -> Any:
    """Return the pointer to an entry of a table."""
    data = builder.extract_value(table, 0)
    if kind.ndim == 1:
        return builder.gep(data, [index])
    row, column = cgutils.unpack_tuple(builder, index)
    if kind.rows:
        row, column = column, row
        width = ir.Constant(row.type, kind.rows)
    else:
        width = builder.extract_value(table, 1)
    return builder.gep(data, [builder.add(builder.mul(row, width), column)])


@infer_getattr
class _TableAttributes(AttributeTemplate):  # type: ignore[misc]
    key = TableType

    def resolve_shape(self, kind: TableType) -> Any:
        """Return the shape's type, for a table of one row only."""
        return types.UniTuple(types.intp, 1) if kind.ndim == 1 else None


@lower_getattr(TableType, "shape")
def _shape(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    size = builder.extract_value(value, 1)
    return context.make_tuple(builder, types.UniTuple(types.intp, 1), [size])


def _index_kind(kind: TableType, index: Any) -> Any:
    """Return the type that an index is converted to; None if it does not fit."""
    if kind.ndim == 1:
        return types.intp if isinstance(index, types.Integer) else None
    if isinstance(index, types.BaseTuple) and len(index) == 2:
        return types.UniTuple(types.intp, 2)
    return None


@infer_global(operator.getitem)
class _Get(AbstractTemplate):  # type: ignore[misc]
    def generic(self, arguments: Any, keywords: Any) -> Any:
        source, index = arguments
        if isinstance(source, WideRowType) and isinstance(index, types.Integer):
            return signature(WIDE, source, types.intp)
        if isinstance(source, TableType) and _index_kind(source, index) is not None:
            return signature(WIDE, source, _index_kind(source, index))
        return None


@infer_global(operator.setitem)
class _Set(AbstractTemplate):  # type: ignore[misc]
    def generic(self, arguments: Any, keywords: Any) -> Any:
        target, index, value = arguments
        value = value if isinstance(value, WideType) else types.float64
        if isinstance(target, WideRowType) and isinstance(index, types.Integer):
            return signature(types.none, target, types.intp, value)
        if isinstance(target, TableType) and _index_kind(target, index) is not None:
            return signature(types.none, target, _index_kind(target, index), value)
        return None


@lower_builtin(operator.getitem, WideRowType, types.Integer)
def _get_of_row(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    pointer, index = arguments
    at = builder.mul(index, ir.Constant(index.type, sig.args[0].stride))
    value = _aligned(builder.load(builder.gep(pointer, [at])))
    tell_apart(builder.module, value, sig.args[0])
    return value


@lower_builtin(operator.setitem, WideRowType, types.Integer, types.Any)
def _set_of_row(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    pointer, index, value = arguments
    at = builder.mul(index, ir.Constant(index.type, sig.args[0].stride))
    access = _aligned(builder.store(spread(builder, value), builder.gep(pointer, [at])))
    tell_apart(builder.module, access, sig.args[0])
    return context.get_dummy_value()


@lower_builtin(operator.getitem, TableType, types.Any)
def _get_of_table(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    return _aligned(builder.load(_place(context, builder, sig.args[0], *arguments)))


@lower_builtin(operator.setitem, TableType, types.Any, types.Any)
def _set_of_table(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    table, index, value = arguments
    place = _place(context, builder, sig.args[0], table, index)
    _aligned(builder.store(spread(builder, value), place))
    return context.get_dummy_value()


def _table(array: Any, rows: int) -> Any:
    kind = TableType(array.ndim - 1, rows)

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        source = context.make_array(sig.args[0])(context, builder, arguments[0])
        data = builder.bitcast(source.data, REGISTER.as_pointer())
        columns = builder.extract_value(source.shape, max(array.ndim - 2, 0))
        made = cgutils.create_struct_proxy(kind)(context, builder)
        made.data, made.columns = data, columns
        return made._getvalue()

    return kind, generate


@intrinsic(prefer_literal=True)
def tiles(context: Any, array: Any, rows: Any) -> Any:
    """Return the matrix of an array (columns, rows, LANES), `rows` a literal."""
    kind, generate = _table(array, rows.literal_value)
    return kind(array, rows), generate


@intrinsic
def table(context: Any, array: Any) -> Any:
    """Return the table of an array (n, LANES) or (rows, columns, LANES)."""
    kind, generate = _table(array, 0)
    return kind(array), generate


@intrinsic
def wide(context: Any, array: Any) -> Any:
    """Return the SIMD vector of an array (LANES,)."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        source = context.make_array(sig.args[0])(context, builder, arguments[0])
        place = builder.bitcast(source.data, REGISTER.as_pointer())
        value = builder.load(place)
        value.align = 8
        return value

    return WIDE(array), generate
