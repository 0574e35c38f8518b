"""Reference of all keys of a scene's file, generated from the classes that it is read into.

As a table, and as JSON Schema (2020-12): editors complete and check a scene by it. What relates
several keys to each other, such as a line that ends at a payload of the scene, only
`rope_twin scene check` can check.
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Iterator
from typing import Any, Union, get_args, get_origin, get_type_hints

from rope_twin.effects import EFFECTS
from rope_twin.quantity import Quantity
from rope_twin.scene.load import rope_presets, rope_sizes
from rope_twin.scene.reader import key_of
from rope_twin.scene.schema import Rope, Scene, Shape, Winch
from rope_twin.scene.shapes import SHAPES

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


def _keys_of(cls: type, path: str, places: dict[type, str]) -> Iterator[Key]:
    """Yield the keys of a class at a path that ends with a dot; places: of classes met before."""
    for field, hint in _fields_of(cls):
        yield from _keys_at(field, hint, path + key_of(field), places)


def _fields_of(cls: type) -> Iterator[tuple[dataclasses.Field[Any], Any]]:
    """Yield the fields of a class that have a key, with the type of the key's value."""
    hints = get_type_hints(cls)
    left_out = _NOT_IN_THE_FILE if cls is Scene else ()
    for field in dataclasses.fields(cls):
        if field.init and field.name not in left_out:
            hint = hints[field.name]
            if get_origin(hint) in (Union, types.UnionType):  # an optional key
                (hint,) = (argument for argument in get_args(hint) if argument is not type(None))
            yield field, hint


def _keys_at(
    field: dataclasses.Field[Any], hint: Any, path: str, places: dict[type, str]
) -> Iterator[Key]:
    """Yield a key, and those within it."""
    inner, place = _inner(hint, path)
    if places.get(inner, place) != place:
        yield _key(field, f"{_type_words(hint)} as {places[inner]}", path)
        return
    yield _key(field, _type_words(hint), path)
    if path == "effects":
        for effect in EFFECTS:
            yield from _named(effect.name, effect.params, f"{path}[]", places)
    elif inner is Shape:
        for name, shape in SHAPES.items():
            yield from _named(name, shape, path, places)
    elif isinstance(inner, type) and dataclasses.is_dataclass(inner):
        places[inner] = place
        yield from _keys_of(inner, f"{place}.", places)


def _named(name: str, cls: type, path: str, places: dict[type, str]) -> Iterator[Key]:
    """Yield one of several mappings by name."""
    yield Key(f"{path}.{name}", "mapping", _sentence(cls).rstrip("."), "", "absent")
    yield from _keys_of(cls, f"{path}.{name}.", places)


def _key(field: dataclasses.Field[Any], wants: str, path: str) -> Key:
    quantity: Quantity | None = field.metadata.get("quantity")
    meaning = quantity.about if quantity else str(field.metadata.get("about", ""))
    bounded = quantity is not None and math.isfinite(quantity.high - quantity.low)
    range_text = quantity.range_text() if quantity and (bounded or quantity.unit) else ""
    return Key(path, wants, meaning, range_text, _default(field))


def _default(field: dataclasses.Field[Any]) -> str | None:
    """Return the default in words, or None if the key is required."""
    value = field.default
    if value is dataclasses.MISSING:
        return None
    if value is None or value in ("", ()) or dataclasses.is_dataclass(value):
        return "absent"
    if isinstance(value, tuple):
        return f"[{', '.join(f'{number:g}' for number in value)}]"
    if isinstance(value, bool | str):
        return str(value).lower()
    return f"{value:g}"


def _inner(hint: Any, path: str) -> tuple[Any, str]:
    """Return the element type of a list or named mapping, and its path."""
    if get_origin(hint) is tuple:
        return get_args(hint)[0], f"{path}[]"
    if get_origin(hint) is dict:
        return get_args(hint)[1], f"{path}.NAME"
    return hint, path


def _type_words(hint: Any) -> str:
    """Return a value's type in words."""
    if get_origin(hint) is dict:
        return "mapping of names"
    if get_origin(hint) is not tuple:
        return _WORDS.get(hint, "mapping")
    arguments = get_args(hint)
    member = _type_words(arguments[0])
    if arguments[-1] is not Ellipsis:
        kinds = {_type_words(argument) for argument in arguments}
        return f"{len(arguments)} {member}s" if len(kinds) == 1 else f"{len(arguments)} values"
    if get_origin(arguments[0]) is not tuple:
        return f"list of {member}s"
    return f"rows of {member.removeprefix('list of ')}"


DIALECT = "https://json-schema.org/draft/2020-12/schema"
_TYPES = {bool: "boolean", str: "string", int: "integer", float: "number"}
_EMPTY = Quantity("", "")

Schema = dict[str, Any]


def scene_schema() -> Schema:
    """Return the schema of a scene file; parts that occur in several places are in `$defs`."""
    definitions: Schema = {}
    root = _object_schema(Scene, definitions)
    return {"$schema": DIALECT, "title": "rope_twin scene", **root, "$defs": definitions}


def _object_schema(cls: type, definitions: Schema) -> Schema:
    """Return the schema of a mapping that is read into a dataclass."""
    fields = list(_fields_of(cls))
    properties = {
        key_of(field): _key_schema(cls, field, hint, definitions) for field, hint in fields
    }
    required = [key_of(field) for field, _ in fields if field.default is dataclasses.MISSING]
    schema: Schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return schema | ({"required": required} if required else {})


def _key_schema(cls: type, field: dataclasses.Field[Any], hint: Any, definitions: Schema) -> Schema:
    """Return the schema of one key with its meaning, unit and default."""
    quantity: Quantity = field.metadata.get("quantity", _EMPTY)
    about = quantity.about or str(field.metadata.get("about", ""))
    unit = f" [{quantity.unit}]" if quantity.unit else ""
    schema: Schema = {"description": about + unit} if about else {}
    if isinstance(field.default, bool | int | float | str) and field.default != "":
        schema["default"] = field.default
    if cls is Scene and field.name == "effects":
        named = {effect.name: effect.params for effect in EFFECTS}
        return schema | {"type": "array", "items": _choice(named, definitions)}
    if field.name == "shape":
        return schema | _choice(SHAPES, definitions)
    return schema | _value(hint, quantity, definitions)


def _value(hint: Any, quantity: Quantity, definitions: Schema) -> Schema:
    """Return the schema of a value that a type hint asks for."""
    if hint is Rope:
        sized = {"pattern": f"^{rope_sizes()}$"}
        preset = {"type": "string", "anyOf": [{"enum": sorted(rope_presets())}, sized]}
        return {"oneOf": [preset, _reference(Rope, definitions)]}
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return _reference(hint, definitions)
    if get_origin(hint) is dict:
        values = _value(get_args(hint)[1], quantity, definitions)
        return {"type": "object", "additionalProperties": values}
    if get_origin(hint) is tuple:
        return _array(get_args(hint), quantity, definitions)
    schema: Schema = {"type": _TYPES[hint]}
    if hint in (int, float):
        ends = {"minimum": quantity.low, "maximum": quantity.high}
        schema |= {name: end for name, end in ends.items() if math.isfinite(end)}
    return schema


def _array(hints: tuple[Any, ...], quantity: Quantity, definitions: Schema) -> Schema:
    """Return the schema of a list, of any length where the hints end with an ellipsis."""
    if hints[-1] is Ellipsis:
        return {"type": "array", "items": _value(hints[0], quantity, definitions)}
    return {
        "type": "array",
        "prefixItems": [_value(hint, quantity, definitions) for hint in hints],
        "minItems": len(hints),
        "maxItems": len(hints),
    }


def _choice(classes: dict[str, Any], definitions: Schema) -> Schema:
    """Return the schema of a mapping with one key, such as `drag: {...}`."""
    return {
        "oneOf": [
            {
                "type": "object",
                "description": _sentence(cls),
                "properties": {name: _reference(cls, definitions)},
                "required": [name],
                "additionalProperties": False,
            }
            for name, cls in classes.items()
        ]
    }


def _reference(cls: type, definitions: Schema) -> Schema:
    """Return a reference to the schema of a class, which is made when first needed."""
    name = cls.__name__
    if name not in definitions:
        definitions[name] = {}  # stands for it within itself
        definitions[name].update(_object_schema(cls, definitions))
    return {"$ref": f"#/$defs/{name}"}


def _sentence(cls: type) -> str:
    """Return the first sentence on a load model, which its module begins with, or on a shape."""
    models = {effect.params: effect.about for effect in EFFECTS}
    about = (cls.__doc__ if cls in SHAPES.values() else models[cls]) or ""
    return " ".join(about.split()).partition(". ")[0].rstrip(".") + "."
