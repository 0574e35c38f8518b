"""Wide numbers: SIMD vectors of LANES doubles, one lane per rope of a batch.

The kernels of a single rope run on them unchanged: `+ - * /`, sqrt, floor, abs, min and max work
lane by lane, comparisons return a mask with one bit per lane, and `choose(mask, a, b)` selects by
it. A mask has no truth value: a kernel that branches on a wide number does not compile. Wide
numbers exist in compiled code only.

**Tables** of wide numbers are the counterpart of arrays and rows for a batch of ropes.
`tiles(array, rows)` is a matrix on an array (columns, rows, LANES): the rows of a node are adjacent
in memory, which saves TLB misses. `table(array)` is a matrix on an array (rows, columns, LANES) or
a row on one (columns, LANES), `wide(array)` the vector of an array (LANES,). Entries are indexed as
in an array; `rows` etc. (core/jit/rows) work on both. The arrays must be aligned to ALIGNMENT.
"""

from __future__ import annotations

import itertools
import math
import operator
from typing import Any

import numpy as np
from llvmlite import ir
from llvmlite.binding import get_host_cpu_features
from numba import config, types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)
from numba.extending import (
    intrinsic,
    lower_builtin,
    lower_cast,
    lower_getattr,
    models,
    overload,
    register_model,
)

from rope_twin.core.jit.decorators import INLINED
from rope_twin.core.jit.scopes import set_alias_scope


def cpu_features() -> list[str]:
    """Return the features of the compiler's target, as LLVM names them."""
    features = config.CPU_FEATURES  # NUMBA_CPU_FEATURES: compile for another processor
    if features is None:
        features = get_host_cpu_features().flatten()
    return str(features).split(",")


def register_doubles() -> int:
    """Return how many doubles the widest SIMD register of the compiler's target holds.

    LLVM would split wider numbers and contract other products and sums than in the code of a single
    rope, so that a member of a batch would not be bit-identical to a single rope.
    """
    return 8 if "+avx512f" in cpu_features() else 4


LANES = register_doubles()
ALL = (1 << LANES) - 1  # mask of all lanes
ALIGNMENT = 8 * LANES  # bytes; arrays of wide numbers begin at a multiple of it
_DOUBLE, _INDEX = ir.DoubleType(), ir.IntType(32)
REGISTER = ir.VectorType(_DOUBLE, LANES)
_BITS = ir.VectorType(ir.IntType(1), LANES)


class WideType(types.Type):  # type: ignore[misc]
    """numba type of a wide number."""

    def __init__(self) -> None:
        super().__init__(name="Wide")

    def can_convert_from(self, context: Any, other: Any) -> Any:
        """Return the conversion of a double to a wide number: safe."""
        return Conversion.promote if isinstance(other, types.Float) else None

    def unify(self, context: Any, other: Any) -> Any:
        """Return the common type of a double and a wide number."""
        return self if isinstance(other, types.Float) else None


class MaskType(types.Type):  # type: ignore[misc]
    """numba type of a mask with one bit per lane, without truth value."""

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
    """Broadcast a double to all lanes; return wide values unchanged."""
    if value.type == REGISTER:
        return value
    vector = builder.insert_element(
        ir.Constant(REGISTER, ir.Undefined), value, ir.Constant(ir.IntType(32), 0)
    )
    first = ir.Constant(ir.VectorType(_INDEX, LANES), [0] * LANES)
    return builder.shuffle_vector(vector, ir.Constant(REGISTER, ir.Undefined), first)


def register(function: Any, count: int, result: Any, generate: Any) -> None:
    """Register typing and code of a function of `count` numbers, at least one of which is wide.

    generate(context, builder, ...): code generator for wide numbers.
    """

    class Template(AbstractTemplate):  # type: ignore[misc]
        def generic(self, arguments: Any, keywords: Any) -> Any:
            wide = len(arguments) == count and any(isinstance(k, WideType) for k in arguments)
            if wide and all(isinstance(kind, WideType | types.Float) for kind in arguments):
                return signature(result, *arguments)
            return None

    infer_global(function)(Template)

    def code(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return generate(context, builder, *(spread(builder, value) for value in arguments))

    for kinds in itertools.product((WideType, types.Float), repeat=count):
        if WideType in kinds:
            lower_builtin(function, *kinds)(code)


def _as_mask(builder: Any, bits: Any) -> Any:
    return builder.bitcast(bits, ir.IntType(LANES))


def _arithmetic(instruction: str) -> Any:
    def generate(context: Any, builder: Any, a: Any, b: Any) -> Any:
        return getattr(builder, instruction)(a, b)

    return generate


def _comparison(sign: str) -> Any:
    def generate(context: Any, builder: Any, a: Any, b: Any) -> Any:
        return _as_mask(builder, builder.fcmp_ordered(sign, a, b))

    return generate


def _extreme(sign: str) -> Any:
    """Return the code generator of min or max, as numba's for two doubles."""

    def generate(context: Any, builder: Any, a: Any, b: Any) -> Any:
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
    register(_function, 2, WIDE, _arithmetic(_instruction))
for _function, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    register(_function, 2, MASK, _comparison(_sign))
register(min, 2, WIDE, _extreme("<"))
register(max, 2, WIDE, _extreme(">"))


def _call(name: str) -> Any:
    def generate(context: Any, builder: Any, a: Any) -> Any:
        kind = ir.FunctionType(REGISTER, [REGISTER])
        called = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")
        return builder.call(called, [a])

    return generate


def _negative(context: Any, builder: Any, a: Any) -> Any:
    """Negate as numba does for doubles, so that LLVM orders sums equally."""
    return builder.fsub(ir.Constant(REGISTER, [-0.0] * LANES), a)


register(math.sqrt, 1, WIDE, _call("sqrt"))
register(np.floor, 1, WIDE, _call("floor"))
register(abs, 1, WIDE, _call("fabs"))
register(operator.neg, 1, WIDE, _negative)


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


@lower_builtin(operator.xor, MaskType, MaskType)
def _one(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    return builder.xor(*arguments)


for _function in (operator.and_, operator.or_, operator.xor):
    infer_global(_function)(_Both)


@intrinsic
def bits(context: Any, mask: Any) -> Any:
    """Return a mask as an integer, with lane 0 as lowest bit."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return builder.zext(arguments[0], ir.IntType(64))

    return types.int64(mask), generate


@intrinsic
def mask_of(context: Any, number: Any) -> Any:
    """Return the mask of an integer."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return builder.trunc(arguments[0], ir.IntType(LANES))

    return MASK(types.int64), generate


@lower_cast(types.Float, WideType)
def _widen(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return spread(builder, value)


@intrinsic
def widened(context: Any, number: Any) -> Any:
    """Return a wide number with a double in all lanes."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return spread(builder, arguments[0])

    return WIDE(types.float64), generate


@intrinsic
def _select(context: Any, mask: Any, a: Any, b: Any) -> Any:
    """Return a in the lanes of the mask, else b."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        mask, left, right = arguments
        bits = builder.bitcast(mask, _BITS)
        return builder.select(bits, spread(builder, left), spread(builder, right))

    return WIDE(mask, a, b), generate


def choose(which: Any, a: Any, b: Any) -> Any:
    """Return a where the condition `which` holds, else b; lane by lane for wide numbers."""
    return a if which else b


@overload(choose, jit_options=INLINED, strict=False)
def _compose_choice(which: Any, a: Any, b: Any) -> Any:
    if isinstance(which, MaskType):
        return lambda which, a, b: _select(which, a, b)
    return lambda which, a, b: a if which else b


def count_beyond(count: int, a: Any, b: Any, tolerance: Any) -> int:
    """Return count + 1 if a differs from b by more than the tolerance, or is NaN, else count.

    For wide numbers count is a bit mask of the lanes with any such difference.
    """
    return count + (not abs(a - b) <= tolerance)


@overload(count_beyond, jit_options=INLINED, strict=False)
def _compose_count(count: Any, a: Any, b: Any, tolerance: Any) -> Any:
    if isinstance(a, WideType):
        return lambda count, a, b, tolerance: count | (ALL - bits(abs(a - b) <= tolerance))
    return lambda count, a, b, tolerance: count + (not abs(a - b) <= tolerance)


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
            offsets = [builder.add(at, ir.Constant(low.type, first + k)) for k in range(count)]
            addresses = [builder.gep(data, [offset]) for offset in offsets]
            return addresses[0] if count == 1 else context.make_tuple(builder, result, addresses)

        return result, generate

    def row(self, scope: str) -> Any:
        """Return the type of a one-row table from a column on, and the generator of its code."""

        def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
            return builder.gep(builder.extract_value(arguments[0], 0), [arguments[1]])

        return WideRowType(scope, 1), generate


@register_model(TableType)
class _TableModel(models.StructModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        members = [
            ("data", types.CPointer(WIDE)), ("columns", types.intp), ("height", types.intp),
        ]  # fmt: skip
        super().__init__(manager, kind, members)


class WideRowType(types.Type):  # type: ignore[misc]
    """numba type of one row of a matrix of SIMD vectors."""

    def __init__(self, scope: str, stride: int) -> None:
        super().__init__(name=f"WideRow({scope}, {stride})")
        self.scope, self.stride = scope, stride


_ROW = WideRowType("memory", 1)  # of an effect's table


@register_model(WideRowType)
class _WideRowModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, REGISTER.as_pointer())


def _aligned(access: Any) -> Any:
    access.align = ALIGNMENT
    return access


def _entry_address(context: Any, builder: Any, kind: TableType, table: Any, index: Any) -> Any:
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
        """Return the shape's type, for tables that are stored row by row."""
        return types.UniTuple(types.intp, kind.ndim) if not kind.rows else None


@lower_getattr(TableType, "shape")
def _shape(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    sizes = [builder.extract_value(value, k) for k in (2, 1)][2 - kind.ndim :]
    return context.make_tuple(builder, types.UniTuple(types.intp, kind.ndim), sizes)


def _index_kind(kind: TableType, index: Any) -> Any:
    """Return the type that an index is converted to, or None if it is not supported."""
    if kind.ndim == 1:
        return types.intp if isinstance(index, types.Integer) else None
    if isinstance(index, types.BaseTuple) and len(index) == 2:
        integers = all(isinstance(kind, types.Integer) for kind in index)
        return types.UniTuple(types.intp, 2) if integers else None
    return None


def _row_kind(kind: TableType, index: Any) -> Any:
    """Return the type that an index `k` or `k, low:` of a row is converted to, else None."""
    if kind.ndim == 1 or kind.rows:
        return None
    if isinstance(index, types.Integer):
        return types.intp
    pair = isinstance(index, types.BaseTuple) and len(index) == 2
    if pair and isinstance(index[0], types.Integer) and isinstance(index[1], types.SliceType):
        return types.Tuple([types.intp, index[1]])
    return None


@infer_global(operator.getitem)
class _Get(AbstractTemplate):  # type: ignore[misc]
    def generic(self, arguments: Any, keywords: Any) -> Any:
        source, index = arguments
        if isinstance(source, WideRowType) and isinstance(index, types.Integer):
            return signature(WIDE, source, types.intp)
        if isinstance(source, TableType) and _index_kind(source, index) is not None:
            return signature(WIDE, source, _index_kind(source, index))
        if isinstance(source, TableType) and _row_kind(source, index) is not None:
            return signature(_ROW, source, _row_kind(source, index))
        if isinstance(source, WideRowType) and isinstance(index, types.SliceType):
            return signature(source, source, index)
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
    set_alias_scope(builder.module, value, sig.args[0])
    return value


@lower_builtin(operator.getitem, WideRowType, types.SliceType)
def _rest_of_row(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    low = context.make_helper(builder, sig.args[1], arguments[1]).start
    return builder.gep(arguments[0], [builder.mul(low, ir.Constant(low.type, sig.args[0].stride))])


@lower_builtin(operator.setitem, WideRowType, types.Integer, types.Any)
def _set_of_row(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    pointer, index, value = arguments
    at = builder.mul(index, ir.Constant(index.type, sig.args[0].stride))
    access = _aligned(builder.store(spread(builder, value), builder.gep(pointer, [at])))
    set_alias_scope(builder.module, access, sig.args[0])
    return context.get_dummy_value()


@lower_builtin(operator.getitem, TableType, types.Any)
def _get_of_table(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    if isinstance(sig.return_type, WideRowType):
        table, row = arguments
        low = ir.Constant(ir.IntType(64), 0)
        if isinstance(sig.args[1], types.BaseTuple):
            columns = builder.extract_value(row, 1)
            low = context.make_helper(builder, sig.args[1][1], columns).start
            row = builder.extract_value(row, 0)
        at = builder.add(builder.mul(row, builder.extract_value(table, 1)), low)
        return builder.gep(builder.extract_value(table, 0), [at])
    return _aligned(builder.load(_entry_address(context, builder, sig.args[0], *arguments)))


@lower_builtin(operator.setitem, TableType, types.Any, types.Any)
def _set_of_table(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
    table, index, value = arguments
    address = _entry_address(context, builder, sig.args[0], table, index)
    _aligned(builder.store(spread(builder, value), address))
    return context.get_dummy_value()


def _table(array: Any, rows: int) -> Any:
    kind = TableType(array.ndim - 1, rows)

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        source = context.make_array(sig.args[0])(context, builder, arguments[0])
        data = builder.bitcast(source.data, REGISTER.as_pointer())
        columns = builder.extract_value(source.shape, max(array.ndim - 2, 0))
        table = cgutils.create_struct_proxy(kind)(context, builder)
        table.data, table.columns = data, columns
        table.height = builder.extract_value(source.shape, 0)
        return table._getvalue()

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
        address = builder.bitcast(source.data, REGISTER.as_pointer())
        value = builder.load(address)
        value.align = 8
        return value

    return WIDE(array), generate


@intrinsic
def pick(context: Any, table: Any, indices: Any) -> Any:
    """Return each lane's entry of a table; indices: tuple of wide numbers with integer values."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        source, int64, result = arguments[0], ir.IntType(64), ir.Constant(REGISTER, ir.Undefined)
        data = builder.bitcast(builder.extract_value(source, 0), _DOUBLE.as_pointer())
        for lane in range(LANES):
            number, offset = ir.Constant(_INDEX, lane), ir.Constant(int64, 0)
            for index in cgutils.unpack_tuple(builder, arguments[1]):
                position = builder.fptosi(builder.extract_element(index, number), int64)
                offset = builder.mul(offset, builder.extract_value(source, 1))
                offset = builder.add(offset, position)
            offset = builder.mul(offset, ir.Constant(int64, LANES))
            offset = builder.add(offset, ir.Constant(int64, lane))
            result = builder.insert_element(
                result, builder.load(builder.gep(data, [offset])), number
            )
        return result

    return WIDE(table, indices), generate


@intrinsic
def lane_of(context: Any, value: Any, lane: Any) -> Any:
    """Return a wide number's double in a lane."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return builder.extract_element(*arguments)

    return types.float64(value, types.int64), generate


@intrinsic
def _first_lane(context: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        first = builder.extract_element(arguments[0], ir.Constant(_INDEX, 0))
        return builder.fptosi(first, ir.IntType(64))

    return types.int64(value), generate


def whole(value: Any) -> int:
    """Convert a double to an integer; a wide number must have the same value in all lanes."""
    return int(value)


@overload(whole, jit_options=INLINED, strict=False)
def _compose_whole(value: Any) -> Any:
    if isinstance(value, WideType):
        return lambda value: _first_lane(value)
    return lambda value: int(value)
