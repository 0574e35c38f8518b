"""Private parts of numba that core/jit is built on exist in the installed version.

If one of these tests fails, this version of numba or llvmlite is not supported: the message names
it, and what it lacks. Each part is looked up by name and used in a kernel of a few lines, whose
result is known.
"""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
COMPILER = ROOT / "rope_twin" / "core" / "jit"
PIN = re.findall(r'"numba(.*?)"', (ROOT / "setup.py").read_text(encoding="utf-8"))[0]


def _private_names() -> list[str]:
    """Return what the compiler's files import of numba.core and llvmlite, as `module.name`."""
    names = set()
    for path in COMPILER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return sorted(name for name in names if name.startswith(("numba.core", "llvmlite")))


def test_every_version_of_the_pin_is_tested() -> None:
    """By `.ci/numba`, which tries the older ones, and by the tests as they are."""
    first, end = (int(minor) for minor in re.findall(r"[<=]0\.(\d+)", PIN))
    older = re.findall(r"^\[ .* set -- (.*)$", (ROOT / ".ci" / "numba").read_text(), re.MULTILINE)
    assert older[0].split() == [f"0.{minor}" for minor in range(first, end - 1)]
    assert first <= numba.version_info.minor < end


@contextmanager
def _supported(part: str) -> Iterator[None]:
    """Say which version is not supported, whatever goes wrong with a private part."""
    try:
        yield
    except Exception as error:
        pytest.fail(
            f"numba {numba.__version__} with llvmlite {llvmlite.__version__} is not supported "
            f"(supported: numba{PIN}): {part}: {type(error).__name__}: {error}"
        )


@pytest.mark.parametrize("name", _private_names())
def test_a_private_name_is_there(name: str) -> None:
    module, _, attribute = name.rpartition(".")
    with _supported(name):
        try:
            importlib.import_module(name)
        except ModuleNotFoundError:
            getattr(importlib.import_module(module), attribute)


def test_the_compiler_imports_private_names() -> None:
    """The test above must not pass by looking in the wrong folder."""
    assert {"numba.core.cgutils", "llvmlite.ir"} <= set(_private_names())


def _run(kernel: Any, *arguments: Any) -> Any:
    """Compile a kernel as an entry is compiled, and call it."""
    from rope_twin.core.jit.decorators import jit_entry

    return jit_entry(kernel)(*arguments)


def test_kernels_are_linked_into_their_entry() -> None:
    """The options of `jit`, the forced inlining, and the call of machine code without dispatch."""
    with _supported("the options of numba.njit"):
        from rope_twin.core.jit.decorators import assembly, compiled, jit, jit_entry, jit_within

        @jit_within
        def increment(x: float) -> float:
            return x + 1.0

        @jit
        def double(x: float) -> float:
            return 2.0 * increment(x)

        def entry(x: float) -> float:
            return double(x) - increment(x)

        made = jit_entry(entry)
        assert compiled(made, (3.0,))(3.0) == 4.0
        assert re.search(r"\bv?addsd\b|\bfadd\b", assembly(made, (3.0,)))


def test_a_kernel_that_allocates_does_not_compile() -> None:
    with _supported("option _nrt"):
        from rope_twin.core.jit.decorators import OPTIONS

        def allocating(n: int) -> float:
            return float(np.zeros(n).sum())

        assert numba.njit(allocating)(3) == 0.0
        with pytest.raises(numba.errors.NumbaError):
            numba.njit(**OPTIONS)(allocating)(3)


def test_rows_and_pairs() -> None:
    """Types, operators, intrinsics and alias metadata of the compiler's own."""
    with _supported("rows and pairs"):
        from rope_twin.core.jit.rows import (
            gather,
            lane,
            load,
            pair,
            row,
            stack_rows,
            store,
            table_rows,
        )

        both, spare = table_rows("sea", 2), stack_rows("scratch", (3, 3))

        def entry(work: Any) -> Any:
            source, target = row(work, 0, 0), row(work, 1, 0)
            low, high = both(work)
            kept, _ = spare()
            kept[0] = low[2] + high[2]
            store(target, 0, load(source, 0) * pair(2.0, 3.0) + gather(source, 2, 0))
            return kept[0], lane(load(target, 0), 1)

        work = np.array([[1.0, 2.0, 4.0], [0.0, 0.0, 8.0]])
        assert _run(entry, work) == (12.0, 7.0)
        assert work[1].tolist() == [6.0, 7.0, 8.0]


def test_wide_numbers() -> None:
    """Operators, casts, masks and overloads of wide numbers, and their tables."""
    with _supported("wide numbers"):
        from rope_twin.core.jit.rows import row
        from rope_twin.core.jit.wide import LANES, bits, choose, table, tiles, wide
        from rope_twin.core.lanes.group import aligned

        def entry(array: Any, tile: Any, number: Any) -> int:
            own, many, x = table(array), tiles(tile, 2), wide(number)
            target, above = row(many, 1, 0), own[1, 0] > x
            target[0] = choose(above, own[1, 0] / 2.0, -x)
            return int(bits(above))

        array, tile, number = aligned(2, 1, LANES), aligned(1, 2, LANES), aligned(LANES)
        middle = LANES / 2 - 1.0
        array[1, 0], number[:] = np.arange(LANES), middle
        assert _run(entry, array, tile, number) == (1 << LANES) - (
            1 << LANES // 2
        )  # the upper half
        expected = np.where(np.arange(LANES) > middle, np.arange(LANES) / 2.0, -middle)
        assert tile[0, 1].tolist() == expected.tolist()


def test_structs_by_reference_and_the_register_of_subnormals() -> None:
    with _supported("structs by reference"):
        from rope_twin.core.jit.functions import flush, restore
        from rope_twin.core.jit.rows import by_reference
        from rope_twin.core.state import Boundary

        def entry(boundary: Any) -> float:
            was = flush()
            found = by_reference(boundary).rate[0, 1]
            restore(was)
            return float(found)

        table = np.arange(4.0).reshape(2, 2)
        assert _run(entry, Boundary(table, 2.0 * table)) == 2.0


def test_compiled_code_is_kept() -> None:
    """numba's classes for caches on disk: what was kept is found by another dispatcher."""
    with _supported("the compile cache"):
        from rope_twin.core.jit.decorators import jit_entry
        from rope_twin.core.jit.functions import chain

        assert jit_entry(chain.py_func)(1.0, 0.5, 1.0, 3) == 1.875
        again = jit_entry(chain.py_func)
        assert again(1.0, 0.5, 1.0, 3) == 1.875
        assert sum(again.stats.cache_hits.values()) == 1
