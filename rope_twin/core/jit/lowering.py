"""From numba's typed statements to LLVM's language, with less around each.

numba makes ready for counted references, debuggers and arrays of any layout: most of what it writes
for a kernel is about values that nobody counts, and for one number of a table it writes forty
lines. LLVM drops all that again, but it has to be written, read and dropped. What is left is the
same: the same loads, the same arithmetic, the same order.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite.ir import IRBuilder
from numba.core import ir_utils, lowering, ssa, typed_passes, types, untyped_passes
from numba.core.compiler_machinery import register_pass
from numba.core.datamodel import default_manager
from numba.core.datamodel.models import TupleModel, UniTupleModel
from numba.core.types import containers

_PACKAGE = "rope_twin"
_UNIFORM = (containers.UniTuple, containers.NamedUniTuple)
_TUPLES = (containers.Tuple, containers.NamedTuple, *_UNIFORM)
# What numba writes for two numbers of double precision.
_ARITHMETIC = {
    operator.add: IRBuilder.fadd,
    operator.iadd: IRBuilder.fadd,
    operator.sub: IRBuilder.fsub,
    operator.isub: IRBuilder.fsub,
    operator.mul: IRBuilder.fmul,
    operator.imul: IRBuilder.fmul,
}
_DOUBLES = (types.float64, types.float64)
_COMPARED = {operator.lt: "<", operator.le: "<=", operator.gt: ">", operator.ge: ">="}


def _is_ours(kind: Any) -> bool:
    """Whether a tuple is one of this package's records, or has one in it."""
    if not isinstance(kind, containers.BaseTuple):
        return False
    record = getattr(kind, "instance_class", None)
    return getattr(record, "__module__", "").startswith(_PACKAGE) or any(map(_is_ours, kind))


def _is_signed(kind: Any) -> bool:
    return bool(kind.signed)


class _Whole:
    """A record is handed from kernel to kernel as it is.

    numba takes it apart into its numbers and pointers, some three hundred for a rope, and puts it
    together again, at every call.
    """

    def get_argument_type(self) -> Any:
        return self.get_value_type()  # type: ignore[attr-defined]

    def as_argument(self, builder: Any, value: Any) -> Any:
        return value

    def from_argument(self, builder: Any, value: Any) -> Any:
        return value


class _WholeTuple(_Whole, TupleModel):  # type: ignore[misc]
    """Of fields of any types."""


class _WholeUniTuple(_Whole, UniTupleModel):  # type: ignore[misc]
    """Of fields of one type."""


def _model_of(manager: Any, kind: Any) -> Any:
    """How values of a tuple's type are kept and handed on; others' tuples as numba does it."""
    uniform = isinstance(kind, _UNIFORM)
    if _is_ours(kind):
        return (_WholeUniTuple if uniform else _WholeTuple)(manager, kind)
    return (UniTupleModel if uniform else TupleModel)(manager, kind)


for _kind in _TUPLES:
    default_manager.register(_kind, _model_of)


class _Lower(lowering.Lower):  # type: ignore[misc]
    """Translation of one kernel, in which no references are counted."""

    def storevar(self, value: Any, name: str, argidx: Any = None) -> None:
        """Set a variable; numba reads the old value first, to count a reference less."""
        self._alloca_var(name, self.typeof(name))
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self.builder.store(value, self.getvar(name))

    def lower_binop(self, resty: Any, expr: Any, op: Any) -> Any:
        """Sum, product or order of two numbers; numba looks their code up among all operators'."""
        asked = self.fndesc.calltypes[expr]
        if tuple(asked.args) != _DOUBLES or not (op in _ARITHMETIC or op in _COMPARED):
            return super().lower_binop(resty, expr, op)
        names = expr.lhs.name, expr.rhs.name
        values = [self.loadvar(name) for name in names]
        values = [
            self.context.cast(self.builder, value, self.typeof(name), types.float64)
            for name, value in zip(names, values, strict=True)
        ]
        if op in _COMPARED:
            found = self.builder.fcmp_ordered(_COMPARED[op], *values)
        else:
            found = _ARITHMETIC[op](self.builder, *values)
        return self.context.cast(self.builder, found, asked.return_type, resty)

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        """A number of a table, or (numba) whatever else is asked for."""
        kind = self.typeof(value.name)
        place = self._place_of(value, index)
        if place is None:
            return super().lower_getitem(resty, expr, value, index, signature)
        found = self.context.unpack_value(self.builder, kind.dtype, place)
        return self.context.cast(self.builder, found, signature.return_type, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        """The same for setting one."""
        place = self._place_of(target_var, index_var)
        given = self.typeof(value_var.name)
        if place is None or not isinstance(given, types.Number | types.Boolean):
            return super().lower_setitem(target_var, index_var, value_var, signature)
        kind = self.typeof(target_var.name).dtype
        value = self.context.cast(self.builder, self.loadvar(value_var.name), given, kind)
        self.context.pack_value(self.builder, kind, value, place)
        return None

    def _place_of(self, table: Any, index: Any) -> Any:
        """Pointer to one number of a table that is contiguous in memory; None: it is not one."""
        kind, asked = self.typeof(table.name), self.typeof(index.name)
        kinds = tuple(asked) if isinstance(asked, containers.BaseTuple) else (asked,)
        plain = isinstance(kind, types.Array) and kind.layout == "C" and kind.aligned
        if not plain or len(kinds) != kind.ndim or not isinstance(kind.dtype, types.Number):
            return None
        if not all(isinstance(one, types.Integer) and _is_signed(one) for one in kinds):
            return None
        builder, model = self.builder, self.context.data_model_manager[kind]
        value, number = self.loadvar(table.name), self.loadvar(index.name)
        shape = model.get_field_position("shape")
        offset = None
        for axis, one in enumerate(kinds):
            size = builder.extract_value(value, [shape, axis])
            inner = number if kinds[0] is asked else builder.extract_value(number, axis)
            place = self._counted(inner, one, size)
            offset = place if offset is None else builder.add(builder.mul(offset, size), place)
        data = builder.extract_value(value, model.get_field_position("data"))
        return builder.gep(data, [offset])

    def _counted(self, number: Any, kind: Any, size: Any) -> Any:
        """An index from the start, of one that below 0 counts from the end."""
        builder, whole = self.builder, types.intp
        if isinstance(kind, types.IntegerLiteral):
            fixed = self.context.get_constant(whole, kind.literal_value)
            return fixed if kind.literal_value >= 0 else builder.add(fixed, size)
        place = self.context.cast(builder, number, kind, whole)
        below = builder.icmp_signed("<", place, place.type(0))
        return builder.select(below, builder.add(place, size), place)


@register_pass(mutates_CFG=True, analysis_only=False)
class Lowering(typed_passes.BaseNativeLowering):  # type: ignore[misc]
    """numba's pass, by the translation above."""

    _name = "rope_twin_lowering"

    @property
    def lowering_class(self) -> Any:
        return _Lower


@register_pass(mutates_CFG=True, analysis_only=False)
class OneAssignment(untyped_passes.ReconstructSSA):  # type: ignore[misc]
    """numba's pass, without the lives of variables."""

    _name = "rope_twin_ssa"

    def run_pass(self, state: Any) -> bool:
        state.func_ir = ssa.reconstruct_ssa(state.func_ir)
        state.func_ir._definitions = ir_utils.build_definitions(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class NoPhis(typed_passes.PreLowerStripPhis):  # type: ignore[misc]
    """numba's pass, without the lives of variables."""

    _name = "rope_twin_no_phis"

    def run_pass(self, state: Any) -> bool:
        state.func_ir = self._strip_phi_nodes(state.func_ir)
        state.func_ir._definitions = ir_utils.build_definitions(state.func_ir.blocks)
        return True
