"""Serialisation of an object's attributes to plain values and arrays, and back.

`serialise` walks the object: numbers, strings, arrays, containers, NamedTuples, dataclasses and
this package's own objects with all their attributes. An unknown type is an error, so that nothing
new is silently left out of a saved state. `deserialise` puts the values back into an object of the
same structure. Parts of the scene are constant and are not walked.

The plain form is JSON. Lists, numbers and strings stand for themselves; anything else is an object
with one key that names its type: {"array": name}, {"fields": {...}}, {"tuple": [...]}, ...
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter, deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import StateError

Arrays = dict[str, NDArray[Any]]

_CONSTANT = tuple(
    f"rope_twin.scene.{part}" for part in ("schema", "sea_state", "winch", "winch_parts", "limits")
)
# a current may have gained rows and a rope elements, as have the monitors of that rope
_VARIABLE_LENGTH = {"effects", "tension", "watch", "viv_drag"}


def serialise(value: Any, arrays: Arrays, at: str) -> Any:
    """Return the plain form of a value; its arrays are copied to `arrays` under their path `at`.

    Raises:
        TypeError: a value of a type that cannot be saved.
        StateError: a number that is NaN.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return _plain_float(value, at)
    if isinstance(value, np.ndarray):
        arrays[at] = value.copy()
        return {"array": at}
    if isinstance(value, Counter):
        return {"counter": dict(value)}
    if _is_object(value):
        if type(value).__module__ in _CONSTANT:
            return {"scene": None}
        fields = {
            name: serialise(part, arrays, f"{at}/{name.lstrip('_')}")
            for name, part in _fields(value).items()
        }
        return {"fields": fields}
    if isinstance(value, list | tuple | deque):
        parts = [serialise(part, arrays, f"{at}/{number}") for number, part in enumerate(value)]
        return parts if isinstance(value, list) else {type(value).__name__: parts}
    raise TypeError(f"{at}: a {type(value).__name__} cannot be saved")


def deserialise(plain: Any, like: Any, arrays: Arrays, at: str) -> Any:
    """Return the value of a plain form; `like`, of the same structure, may be changed.

    Raises:
        StateError: the plain form has another structure.
    """
    if isinstance(plain, list):
        return [deserialise(part, None, arrays, f"{at}/{i}") for i, part in enumerate(plain)]
    if not isinstance(plain, dict):
        return plain
    ((kind, content),) = plain.items()
    if kind == "scene":
        return like
    if kind == "float":
        return float(content)
    if kind == "array":
        return _fitting(arrays[content], like, at)
    if kind == "counter":
        return Counter(content)
    if kind == "fields":
        return _refilled(content, like, arrays, at)
    likes = like if isinstance(like, tuple) and len(like) == len(content) else [None] * len(content)
    parts = [
        deserialise(part, other, arrays, f"{at}/{number}")
        for number, (part, other) in enumerate(zip(content, likes, strict=True))
    ]
    if kind == "tuple":
        return tuple(parts)
    return deque(parts, like.maxlen if isinstance(like, deque) else None)


def _plain_float(value: float, at: str) -> Any:
    """Return finite values unchanged (JSON keeps every bit of them), infinite ones as strings."""
    if math.isnan(value):
        raise StateError(f"{at} is not a number")
    return value if math.isfinite(value) else {"float": str(value)}


def _is_object(value: Any) -> bool:
    """Return whether a value has named fields: a NamedTuple, or an object of this package."""
    named = isinstance(value, tuple) and hasattr(value, "_fields")
    return named or (type(value).__module__.startswith("rope_twin.") and hasattr(value, "__dict__"))


def _fields(value: Any) -> dict[str, Any]:
    if isinstance(value, tuple):
        return dict(zip(value._fields, value, strict=True))  # type: ignore[attr-defined]
    return dict(vars(value))


def _refilled(content: dict[str, Any], like: Any, arrays: Arrays, at: str) -> Any:
    """Return an object like `like` with these fields.

    Raises:
        StateError: it has other fields.
    """
    present = _fields(like) if _is_object(like) else {}
    if present.keys() != content.keys():
        odd = sorted(present.keys() ^ content.keys())
        raise StateError(f"{at} does not have the same parts ({', '.join(odd)})")
    values = {
        name: deserialise(part, present[name], arrays, f"{at}/{name.lstrip('_')}")
        for name, part in content.items()
    }
    if isinstance(like, tuple):
        return type(like)(**values)
    if dataclasses.is_dataclass(like) and not isinstance(like, type):
        return dataclasses.replace(like, **values)
    vars(like).update(values)
    return like


def _fitting(array: NDArray[Any], like: Any, at: str) -> NDArray[Any]:
    """Return a copy of the array if its type (and mostly its shape) are those of `like`.

    Raises:
        StateError: they differ.
    """
    if isinstance(like, np.ndarray):
        free = not _VARIABLE_LENGTH.isdisjoint(at.split("/"))
        fits = array.ndim == like.ndim if free else array.shape == like.shape
        if array.dtype != like.dtype or not fits:
            raise StateError(
                f"{at} is {array.dtype} {array.shape} there and {like.dtype} {like.shape} here"
            )
    return array.copy()
