"""Data of the effects and laws of a batch: of all lanes in SIMD vectors, and of each lane alone.

An effect is a NamedTuple of numbers, arrays and further tuples. For a batch each of them gets an
axis of lanes: the last one for SIMD vectors and their tables, the first one for kernels that are
called for each lane in turn (core/lanes/by_lane), which then see the arrays of a single rope.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import prod
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from rope_twin.core.jit.decorators import LINKED
from rope_twin.core.jit.wide import ALIGNMENT, LANES, table, wide
from rope_twin.core.state import Floats

_WITHIN = {**LINKED, "forceinline": True}


def aligned(*shape: int) -> Floats:
    """Return zeros of this shape, aligned so that each SIMD vector lies in one cache line."""
    size = prod(shape)
    raw = np.zeros(size + ALIGNMENT // 8)
    first = -raw.ctypes.data % ALIGNMENT // 8
    return raw[first : first + size].reshape(shape)


def layout_of(value: Any) -> Any:
    """Return types and shapes of a NamedTuple's parts, in tuples that can be compared."""
    if isinstance(value, tuple):
        return (type(value), *(layout_of(part) for part in value))
    found = np.asarray(value)
    return found.dtype.str, found.shape


def make_wide(layout: Any) -> Any:
    """Return zeros in the layout with the lanes on the last axis."""
    return _make(layout, lambda kind, shape: aligned(*shape, LANES))


def make_each(layout: Any) -> Any:
    """Return zeros in the layout with the lanes on the first axis."""
    return _make(layout, lambda kind, shape: np.zeros((LANES, *shape), kind))


def _make(layout: Any, zeros: Callable[[str, tuple[int, ...]], Any]) -> Any:
    kind, *parts = layout
    if isinstance(kind, str):
        return zeros(kind, parts[0])
    made = [_make(part, zeros) for part in parts]
    return tuple(made) if kind is tuple else kind(*made)


def put_wide(own: Any, theirs: Any, lane: int) -> None:
    """Copy the parts of one rope's data to its lane on the last axis."""
    for part, value in zip(own, theirs, strict=True):
        if isinstance(part, tuple):
            put_wide(part, value, lane)
        else:
            part[..., lane] = value


def put_each(own: Any, theirs: Any, lane: int) -> None:
    """Copy the parts of one rope's data to its lane on the first axis."""
    for part, value in zip(own, theirs, strict=True):
        if isinstance(part, tuple):
            put_each(part, value, lane)
        else:
            part[lane] = value


def _text(kind: Any, path: str, scope: dict[str, Any], leaf: Callable[[Any, str], str]) -> str:
    """Return the source text of a copy of a struct whose arrays are replaced by `leaf`."""
    if not isinstance(kind, types.BaseTuple):
        return leaf(kind, path)
    if isinstance(kind, types.BaseNamedTuple):
        name = f"Kind_{len(scope)}"
        scope[name] = kind.instance_class
        parts = zip(kind.fields, kind.types, strict=True)
        texts = [_text(part, f"{path}.{field}", scope, leaf) for field, part in parts]
        return f"{name}({', '.join(texts)})"
    texts = [_text(part, f"{path}[{k}]", scope, leaf) for k, part in enumerate(kind)]
    return f"({''.join(text + ', ' for text in texts)})"


def _widened(kind: Any, path: str) -> str:
    if kind.ndim > 3:
        return path  # no kernel of lanes reads it
    return f"{'wide' if kind.ndim == 1 else 'table'}({path})"


def wide_data(data: Any) -> Any:
    """Return a struct of arrays (last axis LANES), or several, as SIMD vectors and tables."""
    raise TypeError("SIMD vectors exist in compiled code only; plain Python steps ropes one by one")


@overload(wide_data, jit_options=LINKED, strict=False)
def _compose_wide(data: Any) -> Any:
    if isinstance(data, types.NoneType):
        return lambda data: None
    scope: dict[str, Any] = {"wide": wide, "table": table}
    text = _text(data, "data", scope, _widened)
    exec(f"def written_out(data):\n    return {text}", scope)
    return scope["written_out"]


def lane_data(data: Any, lane: Any) -> Any:
    """Return the data of one lane of a struct of arrays (first axis LANES), or of several."""
    raise TypeError("lanes exist in compiled code only; plain Python steps ropes one by one")


@overload(lane_data, jit_options=_WITHIN, strict=False)
def _compose_lane(data: Any, lane: Any) -> Any:
    scope: dict[str, Any] = {}
    text = _text(data, "data", scope, lambda kind, path: f"{path}[lane]")
    exec(f"def written_out(data, lane):\n    return {text}", scope)
    return scope["written_out"]


def place_of(kind: type, effects: Iterable[Any]) -> int:
    """Return the index of an effect's type among numba types of effects."""
    return [effect.instance_class for effect in effects].index(kind)
