"""Kernels are linked once into the entry that reaches them, whoever of them is called at last."""

from __future__ import annotations

from typing import Any

import numba

from rope_twin.core.jit.decorators import OPTIONS, jit, jit_noinline, jit_ordered, jit_within


@jit
def _shared(x: float) -> float:
    return max(x, 2.0) + 1.0


@jit
def _never_called(x: float) -> float:
    return _shared(x) - 1.0


@jit
def _called(x: float) -> float:
    return 2.0 * _shared(x)


def _entry(x: float) -> float:
    most = 0
    most += 1
    if most > 1:  # LLVM drops the call while it looks at this function alone
        x = _never_called(x)
    return _called(x)


@jit
def _loosely(a: Any, b: Any) -> Any:
    return min(a * b + 1.0, 9.0)


@jit_ordered
def _strictly(a: Any, b: Any) -> Any:
    return min(a * b + 1.0, 9.0)


def _both(a: float, n: int) -> float:
    return float(_loosely(a, n) + _strictly(a, n) + _loosely(n, n) + _strictly(n, a))


def test_kernels_shared_with_a_dropped_call_are_linked() -> None:
    """LLVM links what was asked for so far: those who ask come first."""
    assert numba.njit(**OPTIONS)(_entry)(5.0) == 12.0


def test_cached_types_are_distinguished() -> None:
    """Compile these operators for other types, in kernels of other options."""
    assert numba.njit(**OPTIONS)(_both)(1.5, 2) == 4.0 + 4.0 + 5.0 + 4.0


@jit
def _called_below(x: float) -> float:
    return x + 3.0


@jit_noinline
def _apart(x: float) -> float:
    return 2.0 * _called_below(x)


@jit_within
def _within(x: float) -> float:
    return 2.0 * _apart(x)


def _asks_within(x: float) -> float:
    return float(_within(x) - _called_below(x))


def _is_forced(kernel: Any) -> bool:
    """Return whether LLVM has to put the kernel into all its callers."""
    (made,) = kernel.overloads.values()
    functions = [one for one in made.library._final_module.functions if not one.is_declaration]
    return any(b"alwaysinline" in attribute for f in functions for attribute in f.attributes)


def test_a_separate_kernel_is_not_inlined_into_an_inlined_one() -> None:
    """Callees are not inlined either: numba passes the order to inline to all of them."""
    assert numba.njit(**OPTIONS)(_asks_within)(5.0) == 24.0
    assert _is_forced(_within)
    assert not _is_forced(_apart)
    assert not _is_forced(_called_below)
