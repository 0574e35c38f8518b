"""What an object remembers, as plain values and arrays, and back: nothing is listed by hand.

`remember` walks whatever it is given: numbers, words, arrays, containers, NamedTuples, dataclasses
and this package's own objects with all their attributes. A kind of value that it does not know is
an error, so that nothing new is ever left out of a saved state without a word. `recall` puts the
values back into an object of the same make. Parts of the scene are constant and not walked.

The plain form is JSON. Lists, numbers and words stand for themselves; anything else is an object
with one key that says what it is: {"array": name}, {"fields": {...}}, {"tuple": [...]}, ...
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
# a current may have gained rows, a rope elements, and what is beside it goes with them
_OF_ANY_LENGTH = {"effects", "tension", "watch", "shaking"}


def remember(value: Any, arrays: Arrays, at: str) -> Any:
    """The plain form of a value; copies of its arrays go to `arrays`, named by their path `at`.

    Raises:
        TypeError: a value of a kind that cannot be saved.
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
            name: remember(part, arrays, f"{at}/{name.lstrip('_')}")
            for name, part in _fields(value).items()
        }
        return {"fields": fields}
    if isinstance(value, list | tuple | deque):
        parts = [remember(part, arrays, f"{at}/{number}") for number, part in enumerate(value)]
        return parts if isinstance(value, list) else {type(value).__name__: parts}
    raise TypeError(f"{at}: a {type(value).__name__} cannot be saved")


def recall(plain: Any, like: Any, arrays: Arrays, at: str) -> Any:
    """The value of a plain form; `like` is an object of the same make, which it may change.

    Raises:
        StateError: the plain form is of an object of another make.
    """
    if isinstance(plain, list):
        return [recall(part, None, arrays, f"{at}/{i}") for i, part in enumerate(plain)]
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
        recall(part, other, arrays, f"{at}/{number}")
        for number, (part, other) in enumerate(zip(content, likes, strict=True))
    ]
    if kind == "tuple":
        return tuple(parts)
    return deque(parts, like.maxlen if isinstance(like, deque) else None)


def _plain_float(value: float, at: str) -> Any:
    """Finite ones as they are (JSON keeps every bit of them), infinite ones as words."""
    if math.isnan(value):
        raise StateError(f"{at} is not a number")
    return value if math.isfinite(value) else {"float": str(value)}


def _is_object(value: Any) -> bool:
    """Whether it has named parts: a NamedTuple, or an object of this package."""
    named = isinstance(value, tuple) and hasattr(value, "_fields")
    return named or (type(value).__module__.startswith("rope_twin.") and hasattr(value, "__dict__"))


def _fields(value: Any) -> dict[str, Any]:
    if isinstance(value, tuple):
        return dict(zip(value._fields, value, strict=True))  # type: ignore[attr-defined]
    return dict(vars(value))


def _refilled(content: dict[str, Any], like: Any, arrays: Arrays, at: str) -> Any:
    """An object like `like` with these fields."""
    present = _fields(like) if _is_object(like) else {}
    if present.keys() != content.keys():
        odd = sorted(present.keys() ^ content.keys())
        raise StateError(f"{at} does not have the same parts ({', '.join(odd)})")
    values = {
        name: recall(part, present[name], arrays, f"{at}/{name.lstrip('_')}")
        for name, part in content.items()
    }
    if isinstance(like, tuple):
        return type(like)(**values)
    if dataclasses.is_dataclass(like) and not isinstance(like, type):
        return dataclasses.replace(like, **values)
    vars(like).update(values)
    return like


def _fitting(array: NDArray[Any], like: Any, at: str) -> NDArray[Any]:
    """A copy of the array, if it is of the type (and in most places the shape) of `like`."""
    if isinstance(like, np.ndarray):
        free = not _OF_ANY_LENGTH.isdisjoint(at.split("/"))
        fits = array.ndim == like.ndim if free else array.shape == like.shape
        if array.dtype != like.dtype or not fits:
            raise StateError(
                f"{at} is {array.dtype} {array.shape} there and {like.dtype} {like.shape} here"
            )
    return array.copy()
