"""Reference of all keys of a scene's file, generated from the classes that it is read into."""

from __future__ import annotations

import dataclasses
import math
import sys
import types
from collections.abc import Iterator
from typing import Any, Union, get_args, get_origin, get_type_hints

from rope_twin.effects import EFFECTS
from rope_twin.quantity import Quantity
from rope_twin.scene.reader import key_of
from rope_twin.scene.schema import Scene, Shape, Winch
from rope_twin.scene.shapes.shapes import SHAPES

_NOT_IN_THE_FILE = ("name", "path", "digest")  # of a Scene
_WORDS = {bool: "true or false", str: "text", int: "whole number", float: "number"}


@dataclasses.dataclass(frozen=True)
class Key:
    """One key: its path, type and meaning."""

    path: str  # like ropes[].damping.newton_seconds
    wants: str  # type: "number", "3 numbers", "mapping", "list of mappings" ...
    meaning: str
    range: str  # of numbers, with the unit; empty if there is none
    default: str | None  # None: required wherever its parent is given


def scene_keys() -> list[Key]:
    """Return all keys, each part's before those of the next; a part is described once."""
    return list(_keys_of(Scene, "", {Winch: "winch"}))


def _keys_of(cls: type, path: str, told: dict[type, str]) -> Iterator[Key]:
    """Yield the keys of a class at a path that ends with a dot; told: classes already described."""
    hints = get_type_hints(cls)
    left_out = _NOT_IN_THE_FILE if cls is Scene else ()
    for field in dataclasses.fields(cls):
        if field.init and field.name not in left_out:
            yield from _keys_at(field, hints[field.name], path + key_of(field), told)


def _keys_at(
    field: dataclasses.Field[Any], hint: Any, path: str, told: dict[type, str]
) -> Iterator[Key]:
    """Yield a key, and those within it."""
    hint = _given(hint)
    inner, place = _inner(hint, path)
    if told.get(inner, place) != place:
        yield _key(field, f"{_wanted(hint)} as {told[inner]}", path)
        return
    yield _key(field, _wanted(hint), path)
    if path == "effects":
        for effect in EFFECTS:
            about = sys.modules[effect.params.__module__].__doc__ or effect.name
            yield from _named(effect.name, effect.params, about, (f"{path}[]", told))
    elif inner is Shape:
        for name, shape in SHAPES.items():
            yield from _named(name, shape, shape.__doc__ or name, (path, told))
    elif isinstance(inner, type) and dataclasses.is_dataclass(inner):
        told[inner] = place
        yield from _keys_of(inner, f"{place}.", told)


def _named(name: str, cls: type, about: str, where: tuple[str, dict[type, str]]) -> Iterator[Key]:
    """Yield one of several mappings by name; about: text whose first sentence describes it."""
    path, told = where
    meaning = " ".join(about.split()).partition(". ")[0].rstrip(".")
    yield Key(f"{path}.{name}", "mapping", meaning, "", "absent")
    yield from _keys_of(cls, f"{path}.{name}.", told)


def _key(field: dataclasses.Field[Any], wants: str, path: str) -> Key:
    quantity: Quantity | None = field.metadata.get("quantity")
    meaning = quantity.about if quantity else str(field.metadata.get("about", ""))
    bounded = quantity is not None and math.isfinite(quantity.high - quantity.low)
    told = quantity.range_text() if quantity and (bounded or quantity.unit) else ""
    return Key(path, wants, meaning, told, _default(field))


def _default(field: dataclasses.Field[Any]) -> str | None:
    """Return the default in words; None: the key is required."""
    value = field.default
    if value is dataclasses.MISSING:
        return None
    if value is None or value in ("", ()) or dataclasses.is_dataclass(value):
        return "absent"
    if isinstance(value, tuple):
        return f"[{', '.join(f'{one:g}' for one in value)}]"
    if isinstance(value, bool | str):
        return str(value).lower()
    return f"{value:g}"


def _given(hint: Any) -> Any:
    """Return the type of an optional key's value."""
    if get_origin(hint) in (Union, types.UnionType):
        (hint,) = (one for one in get_args(hint) if one is not type(None))
    return hint


def _inner(hint: Any, path: str) -> tuple[Any, str]:
    """Return the element type of a list or named mapping, and its path."""
    if get_origin(hint) is tuple:
        return get_args(hint)[0], f"{path}[]"
    if get_origin(hint) is dict:
        return get_args(hint)[1], f"{path}.NAME"
    return hint, path


def _wanted(hint: Any) -> str:
    """Return a value's type in words."""
    if get_origin(hint) is dict:
        return "mapping of names"
    if get_origin(hint) is not tuple:
        return _WORDS.get(hint, "mapping")
    of = get_args(hint)
    each = _wanted(of[0])
    if of[-1] is not Ellipsis:
        kinds = {_wanted(one) for one in of}
        return f"{len(of)} {each}s" if len(kinds) == 1 else f"{len(of)} values"
    if get_origin(of[0]) is not tuple:
        return f"list of {each}s"
    return f"rows of {each.removeprefix('list of ')}"
