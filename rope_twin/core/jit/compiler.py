"""The short way through numba, for kernels that are linked into the entry that Python calls.

A step is a hundred kernels. By numba's own way each is linked with all that it calls, optimised,
and made machine code of, again and again on the way up; its syntax tree is walked anew after each
of thirty passes; and what `a + b` is of two numbers is asked of all templates at each of a thousand
places. Here a kernel is typed and translated to LLVM's language, and no more: the entry links all
of them once and has them optimised together.

Measured in manifold_lift's first start: by numba's own way it takes 4.2 times as long on the
processor and 2.5 times the memory; with the libraries below alone 1.8 times as long; with the short
passes too, 1.3 times without `lowering`, and 1.2 times where only its whole records are left.

**Lowering.** From numba's typed statements to LLVM's language, with less around each.

numba makes ready for counted references, debuggers and arrays of any layout: most of what it writes
for a kernel is about values that nobody counts, and for one number of a table it writes forty
lines. LLVM drops all that again, but it has to be written, read and dropped. What is left is the
same: the same loads, the same arithmetic, the same order.
"""

from __future__ import annotations

import gc
import operator
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from weakref import WeakKeyDictionary

import llvmlite.binding as llvm
from llvmlite.ir import IRBuilder
from numba.core import (
    compiler_machinery,
    ir_utils,
    lowering,
    ssa,
    typed_passes,
    types,
    untyped_passes,
)
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import register_pass
from numba.core.datamodel import default_manager
from numba.core.datamodel.models import TupleModel, UniTupleModel
from numba.core.registry import cpu_target
from numba.core.targetconfig import TargetConfig
from numba.core.types import containers

_PACKAGE = "rope_twin"
_UNIFORM = (containers.UniTuple, containers.NamedUniTuple)
_TUPLES = (containers.Tuple, containers.NamedTuple, *_UNIFORM)
# What numba writes for two numbers of double precision, and for two whole ones.
_ARITHMETIC = {
    operator.add: (IRBuilder.fadd, IRBuilder.add),
    operator.iadd: (IRBuilder.fadd, IRBuilder.add),
    operator.sub: (IRBuilder.fsub, IRBuilder.sub),
    operator.isub: (IRBuilder.fsub, IRBuilder.sub),
    operator.mul: (IRBuilder.fmul, IRBuilder.mul),
    operator.imul: (IRBuilder.fmul, IRBuilder.mul),
}
_DOUBLES = (types.float64, types.float64)
_WHOLES = (types.int64, types.int64)
_ORDERS = {operator.lt: "<", operator.le: "<=", operator.gt: ">", operator.ge: ">="}
_EQUALS = {operator.eq: "==", operator.ne: "!="}  # whole numbers only: NaN differs from itself


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

    def setup_function(self, fndesc: Any) -> None:
        """Begin; a sum in any order stays apart: among other code LLVM could choose another."""
        super().setup_function(fndesc)
        if "reassoc" in self.flags.fastmath.flags:
            self.function.attributes.add("noinline")

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
        kinds = tuple(asked.args)
        whole = kinds == _WHOLES
        sign = _ORDERS.get(op) or (_EQUALS.get(op) if whole else None)
        if not (whole or kinds == _DOUBLES) or not (sign or op in _ARITHMETIC):
            return super().lower_binop(resty, expr, op)
        builder, names = self.builder, (expr.lhs.name, expr.rhs.name)
        values = [self.loadvar(name) for name in names]
        values = [
            self.context.cast(builder, value, self.typeof(name), kind)
            for name, value, kind in zip(names, values, kinds, strict=True)
        ]
        if sign:
            found = (builder.icmp_signed if whole else builder.fcmp_ordered)(sign, *values)
        else:
            flags = ["nsw"] if whole else ()
            found = _ARITHMETIC[op][whole](builder, *values, flags=flags)
        return self.context.cast(builder, found, asked.return_type, resty)

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


# Options of a kernel are compared at each call that it makes: numba lists all forty of them, twice.
_equal_options = TargetConfig.__eq__
_HASHES: dict[Any, int] = {}


def _have_equal_options(one: Any, other: Any) -> Any:
    alike = isinstance(other, TargetConfig) and one._values == other._values
    return alike or _equal_options(one, other)


def _hash_of_options(one: Any) -> int:
    """numba's: that of the options' names."""
    kind = type(one)
    if kind not in _HASHES:
        _HASHES[kind] = hash(tuple(sorted(one.options)))
    return _HASHES[kind]


TargetConfig.__eq__ = _have_equal_options
TargetConfig.__hash__ = _hash_of_options


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


_PASSES = (
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    untyped_passes.IRProcessing,
    untyped_passes.RewriteSemanticConstants,
    untyped_passes.DeadBranchPrune,  # where a part of a struct is None
    untyped_passes.GenericRewrites,  # a tuple's item by its number
    OneAssignment,
)
_TYPED_PASSES = (
    NoPhis,
    Lowering,
    typed_passes.NoPythonBackend,
)


# The signatures of calls that were found, and what implements them: by typing context and options.
_KNOWN: WeakKeyDictionary[Any, dict[str, dict[Any, Any]]] = WeakKeyDictionary()


class _LinkedCodegen:
    """numba's code generator, for code that has no place in memory of its own."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, env: Any) -> None:
        """Nothing: there is no variable to set."""


class _LinkedLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code that the entry links, optimises and translates together with all other."""

    _shared_module: Any

    @property
    def codegen(self) -> Any:
        return _LinkedCodegen(self._codegen)

    def _optimize_functions(self, ll_module: Any) -> None:
        """numba's passes over each function, less those that are only called here."""
        ll_module.data_layout = self._codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration:
                passes, builder = self._codegen._function_pass_manager()
                passes.run(function, builder)

    def finalize(self) -> None:
        """Nothing to link or to optimise here."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0

    def _get_module_for_linking(self) -> Any:
        """The module, whose functions the entry may leave out where nobody calls them."""
        self._ensure_finalized()
        if self._shared_module is None:
            for function in self._final_module.functions:
                if not function.is_declaration and function.linkage == llvm.Linkage.external:
                    function.linkage = "linkonce_odr"
            self._shared_module = self._final_module
        return self._shared_module


class _EntryLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code that Python calls: all kernels that it reaches are linked into it, once each."""

    def finalize(self) -> None:
        """Link, optimise and translate.

        Who calls comes before what is called: LLVM leaves out what nobody has asked for so far.
        """
        called_first: dict[Any, None] = {}
        _visit(self, called_first)
        self._linking_libraries = [one for one in reversed(called_first) if one is not self]
        super().finalize()

    def _optimize_final_module(self) -> None:
        """Nobody else calls what was linked: what has one caller goes into it, the rest is gone."""
        for function in self._final_module.functions:
            if function.linkage == llvm.Linkage.linkonce_odr and not function.is_declaration:
                function.linkage = "internal"
        super()._optimize_final_module()


def _visit(library: Any, visited: dict[Any, None]) -> None:
    """Put a library after those that it calls."""
    if isinstance(library, _EntryLibrary | _LinkedLibrary):
        for called in library._linking_libraries:
            if called not in visited:
                _visit(called, visited)
    visited[library] = None


class _Typing:
    """numba's typing context, which remembers what was found of a call.

    A question comes back whenever another of the kernel's types is known. The answer may depend on
    the options that the kernel is compiled with; where the callee is compiled for it, its function
    is given to numba again, who keeps but the last one.
    """

    def __init__(self, context: Any, options: str) -> None:
        self._context = context
        self._known = _KNOWN.setdefault(context, {}).setdefault(options, {})

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, function: Any, args: Any, kws: Any) -> Any:
        """The signature of a call."""
        asked = self._context._lookup_global(function) or function
        if kws or not isinstance(asked, types.Function | types.Dispatcher):
            return self._context.resolve_function_type(function, args, kws)
        key, chosen = (asked, tuple(args)), getattr(asked, "_impl_keys", {})
        if key not in self._known:
            found = self._context.resolve_function_type(function, args, kws)
            if found is None:
                return None
            self._known[key] = found, chosen.get(found.args)
        found, implementation = self._known[key]
        if implementation is not None:
            chosen[found.args] = implementation
        return found


@compiler_machinery.register_pass(mutates_CFG=True, analysis_only=False)
class _Inference(typed_passes.NopythonTypeInference):  # type: ignore[misc]
    """numba's inference of types, which asks no question twice."""

    _name = "rope_twin_inference"

    def run_pass(self, state: Any) -> bool:
        context = state.typingctx
        state.typingctx = _Typing(context, repr(state.flags))
        try:
            return bool(super().run_pass(state))
        finally:
            state.typingctx = context


class _Passes(compiler_machinery.PassManager):  # type: ignore[misc]
    """Passes without a look at the whole function after each: those that need it take it."""

    def _runPass(self, index: int, one: Any, state: Any) -> None:
        one.analysis = self._analysis
        one.run_initialization(state)
        one.run_pass(state)
        one.run_finalizer(state)


class LinkedCompiler(Compiler):  # type: ignore[misc]
    """Compile a kernel as far as its entry needs it."""

    def define_pipelines(self) -> Any:
        state = self.state
        state["library"] = _LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        passes = _Passes("rope_twin")
        for one in (*_PASSES, _Inference, *_TYPED_PASSES):
            passes.add_pass(one)
        passes.finalize()
        return [passes]


def _take_in_news() -> None:
    """Install what was registered since, all modules that register being loaded."""
    target = cpu_target.target_context
    for registry in tuple(target._registries):
        target.install_registry(registry)


@contextmanager
def _in_one_go() -> Iterator[None]:
    """Without three things that take over a tenth of the time and serve nobody until the end.

    Garbage is collected afterwards: what is made of a kernel stays until then, and is looked
    through again and again. Of each of thirty thousand calls of LLVM numba tells a stopwatch of
    every kernel that waits for this one, a dozen. And for each kernel that it does not know yet it
    imports once more all modules that may have code for it.
    """
    collects, calls, target = gc.isenabled(), llvm.ffi.lib._lock, cpu_target.target_context
    target.refresh()
    callbacks, calls._cblist = calls._cblist, []
    gc.disable()
    target.load_additional_registries = _take_in_news
    try:
        yield
    finally:
        target.__dict__.pop("load_additional_registries", None)
        calls._cblist = callbacks
        if collects:
            gc.enable()


class EntryCompiler(Compiler):  # type: ignore[misc]
    """Compile a kernel that Python calls, and with it all that it reaches."""

    def compile_extra(self, func: Any) -> Any:
        with _in_one_go():
            return super().compile_extra(func)

    def define_pipelines(self) -> Any:
        state = self.state
        library = _EntryLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        library.enable_object_caching()
        state["library"] = library
        return super().define_pipelines()
