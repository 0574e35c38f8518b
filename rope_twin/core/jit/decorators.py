"""One compiler for all kernels, and a cache that edits can trust.

numba's own cache does not see edits in files that a kernel calls into, so the cache folder is
named by a digest of all kernel sources (whose folder it must be: `code_folder`). It has to be set
before numba compiles anything, and so has the vectoriser's option: with its default, LLVM gives up
on loops over many arrays because the run-time overlap checks exceed a limit (5 times slower node
loops in a prototype; a test reads the assembly of this version).
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rope_twin.core.jit.code_folder import open_folder

_PACKAGE = Path(__file__).resolve().parents[2]


def source_digest() -> str:
    """SHA-256 (first 16 digits) of every file that can change a compiled kernel."""
    digest = hashlib.sha256()
    for folder in ("core", "effects", "vortex"):
        for path in sorted((_PACKAGE / folder).rglob("*.py")):
            digest.update(path.name.encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


FOLDER = open_folder(source_digest())  # None: nothing is kept
if FOLDER is not None:
    os.environ["NUMBA_CACHE_DIR"] = str(FOLDER.path)

import llvmlite.binding  # noqa: E402

llvmlite.binding.set_option("numba", "-vectorize-memory-check-threshold=2000")

import numba  # noqa: E402
from numba.core import config  # noqa: E402
from numba.core.registry import cpu_target  # noqa: E402

from rope_twin.core.jit.compiler import EntryCompiler, LinkedCompiler  # noqa: E402
from rope_twin.core.jit.kept_code import KeptCode  # noqa: E402

if FOLDER is not None:
    config.CACHE_DIR = str(FOLDER.path)  # in case numba was imported before us

# No nnan and ninf: with them, tests for NaN and infinity are compiled away. No reassoc: LLVM orders
# a sum by what stands around it, and a rope in lanes (core/lanes) would get other bits than alone.
_FAST = {"contract", "nsz", "arcp", "afn"}
# The elimination keeps the order of its sums: it stays exact for stiffness over mass up to 1e6.
_ORDERED = {"contract", "nsz"}

# Without numba's run-time a kernel cannot allocate: an allocation in the loop does not compile.
# Passing arrays then costs no reference counts either (they were a third of a short step).
OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": _FAST,
    "_nrt": False,
    "no_cfunc_wrapper": True,
    "pipeline_class": EntryCompiler,
}


# Kernels are called by kernels, and need no wrapper for Python.
LINKED: dict[str, Any] = {
    **OPTIONS,
    "no_cpython_wrapper": True,
    "pipeline_class": LinkedCompiler,
}


def make_ready() -> None:
    """Load what numba loads when it is first asked for compiled code; that takes half a second."""
    cpu_target.target_context.refresh()


def jit(function: Any) -> Any:
    """Compile a kernel that other kernels call."""
    return numba.njit(**LINKED)(function)


def jit_sum(function: Any) -> Any:
    """Compile a kernel that adds many numbers up, in whatever order is fastest."""
    return numba.njit(**{**LINKED, "fastmath": _FAST | {"reassoc"}})(function)


def jit_ordered(function: Any) -> Any:
    """Compile a kernel whose sums must not be reordered."""
    return numba.njit(**{**LINKED, "fastmath": _ORDERED})(function)


def jit_entry(function: Any) -> Any:
    """Compile a kernel that Python calls, and keep its code on disk."""
    entry = numba.njit(**OPTIONS)(function)
    if entry is not function and FOLDER is not None:  # plain Python has nothing to keep
        entry._cache = KeptCode(function, FOLDER)
    return entry


def jit_apart(function: Any) -> Any:
    """Compile a large kernel that LLVM need not put into its callers, nor what it calls.

    numba inlines a kernel everywhere that was first compiled for an inlined one, unless it is said
    not to be; and so with all that this kernel calls.
    """
    return numba.njit(**{**LINKED, "forceinline": False})(function)


def jit_within(function: Any) -> Any:
    """Compile a small function of numbers that LLVM puts into its callers' loops."""
    return numba.njit(forceinline=True, **LINKED)(function)


def jit_ordered_within(function: Any) -> Any:
    """The same for one whose sums must not be reordered; of a kernel, another make of it."""
    plain = getattr(function, "py_func", function)
    return numba.njit(forceinline=True, **{**LINKED, "fastmath": _ORDERED})(plain)


def compiled(entry: Any, arguments: tuple[Any, ...]) -> Any:
    """The machine code of an entry for arguments of these types, called without numba's dispatch.

    The caller sees to it that the arguments are of these types. Plain Python: the entry itself.
    """
    if config.DISABLE_JIT:
        return entry
    signature = tuple(numba.typeof(argument) for argument in arguments)
    entry.compile(signature)
    return entry.overloads[signature].entry_point


def kind_of(values: Iterable[Any]) -> str:
    """Return what a step is compiled for: the types of these values; equal words, equal code."""
    return "; ".join(str(numba.typeof(value)) for value in values)


def assembly(entry: Any, arguments: tuple[Any, ...]) -> str:
    """The assembly of an entry for arguments of these types.

    It is compiled afresh, which takes some ten seconds for a step: cached code has none to read.
    """
    fresh = numba.njit(**OPTIONS)(entry.py_func)
    fresh.compile(tuple(numba.typeof(argument) for argument in arguments))
    (signature,) = fresh.signatures
    return str(fresh.inspect_asm(signature))
