"""JSON Schema (2020-12) of a scene file, from the classes that it is read into.

Editors complete and check a scene by it. What relates several keys to each other, such as a line
that ends at a payload of the scene, only `rope_twin scene check` can check.
"""

from __future__ import annotations

import dataclasses
import math
import sys
import types
from typing import Any, Union, get_args, get_origin, get_type_hints

from rope_twin.effects import EFFECTS
from rope_twin.quantity import Quantity
from rope_twin.scene.reader import key_of
from rope_twin.scene.ropes import rope_presets
from rope_twin.scene.schema import Rope, Scene
from rope_twin.scene.shapes.shapes import SHAPES

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_NOT_IN_THE_FILE = ("name", "path", "digest")  # of a Scene
_TYPES = {bool: "boolean", str: "string", int: "integer", float: "number"}
_EMPTY = Quantity("", "")

Schema = dict[str, Any]


def scene_schema() -> Schema:
    """Return the schema of a scene file; parts that occur in several places are in `$defs`."""
    definitions: Schema = {}
    root = _object(Scene, definitions)
    return {"$schema": DIALECT, "title": "rope_twin scene", **root, "$defs": definitions}


def _object(cls: type, definitions: Schema) -> Schema:
    """Return the schema of a mapping that is read into a dataclass."""
    hints = get_type_hints(cls)
    left_out = _NOT_IN_THE_FILE if cls is Scene else ()
    fields = [one for one in dataclasses.fields(cls) if one.init and one.name not in left_out]
    properties = {key_of(one): _key(cls, one, hints[one.name], definitions) for one in fields}
    required = [key_of(one) for one in fields if one.default is dataclasses.MISSING]
    schema: Schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return schema | ({"required": required} if required else {})


def _key(cls: type, field: dataclasses.Field[Any], hint: Any, definitions: Schema) -> Schema:
    """Return the schema of one key with its meaning, unit and default."""
    quantity: Quantity = field.metadata.get("quantity", _EMPTY)
    about = quantity.about or str(field.metadata.get("about", ""))
    unit = f" [{quantity.unit}]" if quantity.unit else ""
    schema: Schema = {"description": about + unit} if about else {}
    if isinstance(field.default, bool | int | float | str) and field.default != "":
        schema["default"] = field.default
    if cls is Scene and field.name == "effects":
        named = {one.name: one.params for one in EFFECTS}
        return schema | {"type": "array", "items": _choice(named, definitions)}
    if field.name == "shape":
        return schema | _choice(SHAPES, definitions)
    return schema | _value(hint, quantity, definitions)


def _value(hint: Any, quantity: Quantity, definitions: Schema) -> Schema:
    """Return the schema of a value that a type hint asks for."""
    if get_origin(hint) in (Union, types.UnionType):
        (hint,) = (one for one in get_args(hint) if one is not type(None))
    if hint is Rope:
        preset = {"type": "string", "enum": sorted(rope_presets())}
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
        "prefixItems": [_value(one, quantity, definitions) for one in hints],
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
        definitions[name].update(_object(cls, definitions))
    return {"$ref": f"#/$defs/{name}"}


def _sentence(cls: type) -> str:
    """Return the first sentence on a load model, which its module begins with, or on a shape."""
    own = cls in SHAPES.values()
    about = (cls.__doc__ if own else sys.modules[cls.__module__].__doc__) or ""
    return " ".join(about.split()).partition(". ")[0].rstrip(".") + "."
