"""Compiler pipeline for kernels that are linked into one entry point.

A step consists of about a hundred kernels. With numba's default pipeline each is linked with all
its callees, optimised and compiled to machine code, repeatedly along the call graph; its IR is
traversed after each of thirty passes; and overloads of scalar operators are resolved at a thousand
call sites. Here a kernel is only typed and lowered to LLVM IR; the entry links all kernels once and
optimises them together.

CPU time of the cold start of manifold_lift, relative to this pipeline: 4.2 with numba's default
pipeline (and 2.5 times the memory), 1.8 with the libraries below alone, 1.3 with the reduced list
of passes too, 1.2 with the data models of records in addition.

**Lowering.** numba's lowering emits reference counting, debug information and indexing of arrays of
any layout, about forty lines of IR for one array entry. LLVM removes most of it, but generating,
parsing and removing it takes time. The lowering here emits the same loads and the same arithmetic
in the same order.
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
# LLVM instructions for two doubles and for two integers.
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
_EQUALS = {operator.eq: "==", operator.ne: "!="}  # integers only: NaN differs from itself


def _is_record(kind: Any) -> bool:
    """Return whether a tuple type is a NamedTuple of this package, or contains one."""
    if not isinstance(kind, containers.BaseTuple):
        return False
    record = getattr(kind, "instance_class", None)
    return getattr(record, "__module__", "").startswith(_PACKAGE) or any(map(_is_record, kind))


def _is_signed(kind: Any) -> bool:
    return bool(kind.signed)


class _UnflattenedModel:
    """Data model that passes a record between kernels as one LLVM aggregate.

    numba flattens it into scalars and pointers, about 300 for a rope, and reassembles it, at every
    call.
    """

    def get_argument_type(self) -> Any:
        return self.get_value_type()  # type: ignore[attr-defined]

    def as_argument(self, builder: Any, value: Any) -> Any:
        return value

    def from_argument(self, builder: Any, value: Any) -> Any:
        return value


class _TupleRecordModel(_UnflattenedModel, TupleModel):  # type: ignore[misc]
    """Data model of a record with fields of different types."""


class _UniTupleRecordModel(_UnflattenedModel, UniTupleModel):  # type: ignore[misc]
    """Data model of a record with fields of one type."""


def _model_of(manager: Any, kind: Any) -> Any:
    """Return the data model of a tuple type, unflattened for this package's records."""
    uniform = isinstance(kind, _UNIFORM)
    if _is_record(kind):
        return (_UniTupleRecordModel if uniform else _TupleRecordModel)(manager, kind)
    return (UniTupleModel if uniform else TupleModel)(manager, kind)


for _kind in _TUPLES:
    default_manager.register(_kind, _model_of)


class _Lower(lowering.Lower):  # type: ignore[misc]
    """Lowering of one kernel to LLVM IR without reference counting."""

    def setup_function(self, fndesc: Any) -> None:
        """Start a function; one with reassociated sums is not inlined, which fixes their order."""
        super().setup_function(fndesc)
        if "reassoc" in self.flags.fastmath.flags:
            self.function.attributes.add("noinline")

    def storevar(self, value: Any, name: str, argidx: Any = None) -> None:
        """Store a variable, without numba's release of the reference to the old value."""
        self._alloca_var(name, self.typeof(name))
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self.builder.store(value, self.getvar(name))

    def lower_binop(self, resty: Any, expr: Any, op: Any) -> Any:
        """Lower arithmetic and comparisons of two doubles or integers, without overload lookup."""
        signature = self.fndesc.calltypes[expr]
        kinds = tuple(signature.args)
        integers = kinds == _WHOLES
        sign = _ORDERS.get(op) or (_EQUALS.get(op) if integers else None)
        if not (integers or kinds == _DOUBLES) or not (sign or op in _ARITHMETIC):
            return super().lower_binop(resty, expr, op)
        builder, names = self.builder, (expr.lhs.name, expr.rhs.name)
        values = [self.loadvar(name) for name in names]
        values = [
            self.context.cast(builder, value, self.typeof(name), kind)
            for name, value, kind in zip(names, values, kinds, strict=True)
        ]
        if sign:
            result = (builder.icmp_signed if integers else builder.fcmp_ordered)(sign, *values)
        else:
            flags = ["nsw"] if integers else ()
            result = _ARITHMETIC[op][integers](builder, *values, flags=flags)
        return self.context.cast(builder, result, signature.return_type, resty)

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        """Lower the load of one entry of a contiguous array; leave other indexing to numba."""
        kind = self.typeof(value.name)
        pointer = self._element_pointer(value, index)
        if pointer is None:
            return super().lower_getitem(resty, expr, value, index, signature)
        loaded = self.context.unpack_value(self.builder, kind.dtype, pointer)
        return self.context.cast(self.builder, loaded, signature.return_type, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        """Lower the store of one entry of a contiguous array; leave other indexing to numba."""
        pointer = self._element_pointer(target_var, index_var)
        value_type = self.typeof(value_var.name)
        if pointer is None or not isinstance(value_type, types.Number | types.Boolean):
            return super().lower_setitem(target_var, index_var, value_var, signature)
        kind = self.typeof(target_var.name).dtype
        value = self.context.cast(self.builder, self.loadvar(value_var.name), value_type, kind)
        self.context.pack_value(self.builder, kind, value, pointer)
        return None

    def _element_pointer(self, table: Any, index: Any) -> Any:
        """Return the pointer to one entry of a C-contiguous array, or None for other indexing."""
        kind, index_type = self.typeof(table.name), self.typeof(index.name)
        axis_types = (
            tuple(index_type) if isinstance(index_type, containers.BaseTuple) else (index_type,)
        )
        contiguous = isinstance(kind, types.Array) and kind.layout == "C" and kind.aligned
        if (
            not contiguous
            or len(axis_types) != kind.ndim
            or not isinstance(kind.dtype, types.Number)
        ):
            return None
        if not all(
            isinstance(axis_type, types.Integer) and _is_signed(axis_type)
            for axis_type in axis_types
        ):
            return None
        builder, model = self.builder, self.context.data_model_manager[kind]
        value, number = self.loadvar(table.name), self.loadvar(index.name)
        shape = model.get_field_position("shape")
        offset = None
        for axis, axis_type in enumerate(axis_types):
            size = builder.extract_value(value, [shape, axis])
            inner = number if axis_types[0] is index_type else builder.extract_value(number, axis)
            position = self._normalised_index(inner, axis_type, size)
            offset = (
                position if offset is None else builder.add(builder.mul(offset, size), position)
            )
        data = builder.extract_value(value, model.get_field_position("data"))
        return builder.gep(data, [offset])

    def _normalised_index(self, number: Any, kind: Any, size: Any) -> Any:
        """Return an index with negative values wrapped around, as in Python."""
        builder, intp = self.builder, types.intp
        if isinstance(kind, types.IntegerLiteral):
            constant = self.context.get_constant(intp, kind.literal_value)
            return constant if kind.literal_value >= 0 else builder.add(constant, size)
        position = self.context.cast(builder, number, kind, intp)
        negative = builder.icmp_signed("<", position, position.type(0))
        return builder.select(negative, builder.add(position, size), position)


# numba compares the compile options at each call of a kernel, by building lists of all of them.
_equal_options = TargetConfig.__eq__
_HASHES: dict[Any, int] = {}


def _have_equal_options(config: Any, other: Any) -> Any:
    equal = isinstance(other, TargetConfig) and config._values == other._values
    return equal or _equal_options(config, other)


def _hash_of_options(config: Any) -> int:
    """Return numba's hash of the option names, cached by type."""
    kind = type(config)
    if kind not in _HASHES:
        _HASHES[kind] = hash(tuple(sorted(config.options)))
    return _HASHES[kind]


TargetConfig.__eq__ = _have_equal_options
TargetConfig.__hash__ = _hash_of_options


@register_pass(mutates_CFG=True, analysis_only=False)
class Lowering(typed_passes.BaseNativeLowering):  # type: ignore[misc]
    """Lowering pass that uses `_Lower`."""

    _name = "rope_twin_lowering"

    @property
    def lowering_class(self) -> Any:
        return _Lower


@register_pass(mutates_CFG=True, analysis_only=False)
class OneAssignment(untyped_passes.ReconstructSSA):  # type: ignore[misc]
    """SSA reconstruction without liveness analysis."""

    _name = "rope_twin_ssa"

    def run_pass(self, state: Any) -> bool:
        state.func_ir = ssa.reconstruct_ssa(state.func_ir)
        state.func_ir._definitions = ir_utils.build_definitions(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class NoPhis(typed_passes.PreLowerStripPhis):  # type: ignore[misc]
    """Removal of phi nodes without liveness analysis."""

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
    untyped_passes.DeadBranchPrune,  # branches on fields that are None
    untyped_passes.GenericRewrites,  # static indexing of tuples
    OneAssignment,
)
_TYPED_PASSES = (
    NoPhis,
    Lowering,
    typed_passes.NoPythonBackend,
)


# Cache of resolved call signatures and their implementations, by typing context and options.
_KNOWN: WeakKeyDictionary[Any, dict[str, dict[Any, Any]]] = WeakKeyDictionary()


class _LinkedCodegen:
    """numba's code generator, for libraries that are never loaded into the execution engine."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, env: Any) -> None:
        """Do nothing: the code has no environment variable."""


class _LinkedLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code library whose LLVM IR is linked, optimised and compiled by the entry's library."""

    _shared_module: Any

    @property
    def codegen(self) -> Any:
        return _LinkedCodegen(self._codegen)

    def _optimize_functions(self, ll_module: Any) -> None:
        """Run numba's function passes on each definition, but not on declarations."""
        ll_module.data_layout = self._codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration:
                passes, builder = self._codegen._function_pass_manager()
                passes.run(function, builder)

    def finalize(self) -> None:
        """Finalise without linking and optimisation."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0

    def _get_module_for_linking(self) -> Any:
        """Return the module with linkonce linkage, so that unused functions are discarded."""
        self._ensure_finalized()
        if self._shared_module is None:
            for function in self._final_module.functions:
                if not function.is_declaration and function.linkage == llvm.Linkage.external:
                    function.linkage = "linkonce_odr"
            self._shared_module = self._final_module
        return self._shared_module


class _EntryLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code library of an entry point; all kernels that it calls are linked into it, once each."""

    def finalize(self) -> None:
        """Link, optimise and compile.

        Callers are linked before callees: LLVM discards linkonce functions without a reference.
        """
        ordered: dict[Any, None] = {}
        _visit(self, ordered)
        self._linking_libraries = [library for library in reversed(ordered) if library is not self]
        super().finalize()

    def _optimize_final_module(self) -> None:
        """Internalise the linked functions, so that LLVM can inline or remove them."""
        for function in self._final_module.functions:
            if function.linkage == llvm.Linkage.linkonce_odr and not function.is_declaration:
                function.linkage = "internal"
        super()._optimize_final_module()


def _visit(library: Any, visited: dict[Any, None]) -> None:
    """Collect libraries in post-order: callees before callers."""
    if isinstance(library, _EntryLibrary | _LinkedLibrary):
        for called in library._linking_libraries:
            if called not in visited:
                _visit(called, visited)
    visited[library] = None


class _Typing:
    """Typing context of numba with a cache of resolved calls.

    Type inference resolves a call again whenever another type of the kernel becomes known. The
    result may depend on the compile options of the kernel. For overloads, whose implementation
    numba stores per template, it is set again with each cached result.
    """

    def __init__(self, context: Any, options: str) -> None:
        self._context = context
        self._known = _KNOWN.setdefault(context, {}).setdefault(options, {})

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, function: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a call."""
        template = self._context._lookup_global(function) or function
        if kws or not isinstance(template, types.Function | types.Dispatcher):
            return self._context.resolve_function_type(function, args, kws)
        key, chosen = (template, tuple(args)), getattr(template, "_impl_keys", {})
        if key not in self._known:
            signature = self._context.resolve_function_type(function, args, kws)
            if signature is None:
                return None
            self._known[key] = signature, chosen.get(signature.args)
        signature, implementation = self._known[key]
        if implementation is not None:
            chosen[signature.args] = implementation
        return signature


@compiler_machinery.register_pass(mutates_CFG=True, analysis_only=False)
class _Inference(typed_passes.NopythonTypeInference):  # type: ignore[misc]
    """Type inference with cached call resolution."""

    _name = "rope_twin_inference"

    def run_pass(self, state: Any) -> bool:
        context = state.typingctx
        state.typingctx = _Typing(context, repr(state.flags))
        try:
            return bool(super().run_pass(state))
        finally:
            state.typingctx = context


class _Passes(compiler_machinery.PassManager):  # type: ignore[misc]
    """Pass manager without the analysis and timing of the function after each pass."""

    def _runPass(self, index: int, compiler_pass: Any, state: Any) -> None:
        compiler_pass.analysis = self._analysis
        compiler_pass.run_initialization(state)
        compiler_pass.run_pass(state)
        compiler_pass.run_finalizer(state)


class LinkedCompiler(Compiler):  # type: ignore[misc]
    """Pipeline of a kernel that is linked into an entry: typing and lowering to LLVM IR."""

    def define_pipelines(self) -> Any:
        state = self.state
        state["library"] = _LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        passes = _Passes("rope_twin")
        for compiler_pass in (*_PASSES, _Inference, *_TYPED_PASSES):
            passes.add_pass(compiler_pass)
        passes.finalize()
        return [passes]


def _install_new_registrations() -> None:
    """Install implementations registered since the last refresh, without importing modules."""
    target = cpu_target.target_context
    for registry in tuple(target._registries):
        target.install_registry(registry)


@contextmanager
def _faster_compilation() -> Iterator[None]:
    """Suspend garbage collection, LLVM lock callbacks and repeated imports during compilation.

    Together they take more than a tenth of the compile time. The collector traverses objects that
    live until the end of compilation; numba times each of 30 000 LLVM calls once per nested
    compilation; and before each new kernel it imports all modules that may register code.
    """
    collects, calls, target = gc.isenabled(), llvm.ffi.lib._lock, cpu_target.target_context
    target.refresh()
    callbacks, calls._cblist = calls._cblist, []
    gc.disable()
    target.load_additional_registries = _install_new_registrations
    try:
        yield
    finally:
        target.__dict__.pop("load_additional_registries", None)
        calls._cblist = callbacks
        if collects:
            gc.enable()


class EntryCompiler(Compiler):  # type: ignore[misc]
    """Compiler of an entry point that Python calls, with all kernels that it calls."""

    def compile_extra(self, func: Any) -> Any:
        with _faster_compilation():
            return super().compile_extra(func)

    def define_pipelines(self) -> Any:
        state = self.state
        library = _EntryLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        library.enable_object_caching()
        state["library"] = library
        return super().define_pipelines()
