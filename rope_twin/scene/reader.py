"""Reader from an item tree to a frozen dataclass: type hints give types, metadata ranges.

Nothing is converted implicitly: a string is not a number, true is not a number, 3.0 is not an
integer. A dataclass may check itself: `check() -> str | None` returns 'fault; remedy'.
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Callable, Mapping
from typing import Any, Union, get_args, get_origin, get_type_hints

from rope_twin.errors import SceneErrors, did_you_mean
from rope_twin.quantity import Quantity
from rope_twin.scene.document import Item, Place, kind, shown

Reader = Callable[[Item, Place], Any]
Readers = Mapping[str, Reader]  # by 'Class.field': for types that hints cannot express


def read_object(
    cls: type, item: Item, place: Place, readers: Readers = types.MappingProxyType({}), **given: Any
) -> Any:
    """Return an object of a dataclass from a mapping; `given` are fields without a key.

    Raises:
        SceneError: for every key that is unknown, missing or has an invalid value.
    """
    fields = {key_of(field): field for field in dataclasses.fields(cls) if field.name not in given}
    mapping, errors = _mapping(item, place, fields), SceneErrors()
    unknown = _refuse_unknown(mapping, place, fields, errors)
    missing = [field for name, field in fields.items() if _needed(field) and name not in mapping]
    missing = [field for field in missing if f"did you mean '{key_of(field)}'?" not in unknown]
    if missing:
        names = ", ".join(field.name for field in missing)
        right = f"add {missing[0].name} ({_meaning(missing[0])})"
        errors.add(place.refuse(f"{names} missing", right))
    hints = get_type_hints(cls)
    values = dict(given)
    for name, child in mapping.items():
        if name not in fields:
            continue
        at = place.key(name, child.line)
        own = readers.get(f"{cls.__name__}.{name}")
        field = fields[name]
        with errors:
            values[field.name] = (
                own(child, at) if own else _read(hints[field.name], child, at, field, readers)
            )
    errors.raise_any()
    made = cls(**values)
    complaint = made.check() if hasattr(made, "check") else None
    if complaint:
        what, _, right = complaint.partition("; ")
        raise place.refuse(what, right.rstrip(".") or "see the scenes in config/scenes")
    return made


def _mapping(item: Item, place: Place, known: Mapping[str, Any]) -> dict[str, Item]:
    """Return the pairs of a mapping."""
    if not isinstance(item.value, dict):
        right = f"give a mapping with {', '.join(known)}" if known else "give an empty mapping {}"
        raise place.refuse(f"{kind(item)} instead of a mapping", right)
    return item.value


def _refuse_unknown(
    mapping: Mapping[str, Item], place: Place, known: Mapping[str, Any], errors: SceneErrors
) -> set[str]:
    """Collect an error for each unknown key; return the remedies suggested."""
    said = set()
    for name, child in mapping.items():
        if name not in known:
            right = did_you_mean(name, known) if known else "remove it, no keys are allowed here"
            errors.add(place.key(name, child.line).refuse("unknown key", right))
            said.add(right)
    return said


def read_choice(item: Item, place: Place, choices: Mapping[str, Any]) -> tuple[str, Item, Place]:
    """Return the one key of a mapping such as `box: {...}` (in `choices`), its item and place."""
    names = ", ".join(choices)
    mapping = item.value
    if isinstance(mapping, str) and mapping in choices:
        raise place.refuse(f"{shown(mapping)} alone", f"write it as `{mapping}: {{}}`")
    if not isinstance(mapping, dict) or len(mapping) != 1:
        what = f"{len(mapping)} keys" if isinstance(mapping, dict) else kind(item)
        raise place.refuse(f"{what} instead of one key", f"give one of {names}, as `name: {{...}}`")
    (name, child), *_ = mapping.items()
    at = place.key(name, child.line)
    if name not in choices:
        raise at.refuse("unknown", did_you_mean(name, choices))
    return name, child, at


def key_of(field: dataclasses.Field[Any]) -> str:
    """Return the key of a field: its name without the underscore that avoids a Python keyword."""
    return field.name.rstrip("_")


def _needed(field: dataclasses.Field[Any]) -> bool:
    return (
        field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    ) and field.init


def _meaning(field: dataclasses.Field[Any]) -> str:
    """Return a field's description, with its range if it has one."""
    quantity: Quantity | None = field.metadata.get("quantity")
    if quantity:
        return f"{quantity.about}, {quantity.range_text()}"
    return str(field.metadata.get("about", "required"))


def _read(
    hint: Any, item: Item, place: Place, field: dataclasses.Field[Any], readers: Readers
) -> Any:
    """Return the value that a type hint requires."""
    meaning = _meaning(field)
    if get_origin(hint) in (Union, types.UnionType):
        (hint,) = (option for option in get_args(hint) if option is not type(None))
    if item.value is None:
        raise place.refuse("no value", f"give one ({meaning}) or remove the key")
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return read_object(hint, item, place, readers)
    if get_origin(hint) is tuple:
        return _read_list(get_args(hint), item, place, field, readers)
    if get_origin(hint) is dict:
        return _read_named(get_args(hint)[1], item, place, field, readers)
    if hint is bool:
        return _read_truth(item, place, meaning)
    if hint is str:
        return _read_text(item, place, meaning)
    if hint in (int, float):
        return _read_number(hint, item, place, field)
    raise TypeError(f"{field.name}: the reader does not support {hint}")  # a defect of the program


def _read_list(
    hints: tuple[Any, ...],
    item: Item,
    place: Place,
    field: dataclasses.Field[Any],
    readers: Readers,
) -> tuple[Any, ...]:
    """Return a tuple of a fixed length, or of any length where the hint ends with an ellipsis."""
    meaning = _meaning(field)
    if not isinstance(item.value, list):
        raise place.refuse(f"{kind(item)} instead of a list", f"give a list ({meaning})")
    if hints[-1] is Ellipsis:
        hints = hints[:1] * len(item.value)
    if len(item.value) != len(hints):
        what = f"{len(item.value)} values in the list"
        raise place.refuse(what, f"give {len(hints)} ({meaning})")
    errors, found = SceneErrors(), []
    for number, (hint, child) in enumerate(zip(hints, item.value, strict=True)):
        with errors:
            found.append(_read(hint, child, place.index(number, child.line), field, readers))
    errors.raise_any()
    return tuple(found)


def _read_named(
    hint: Any, item: Item, place: Place, field: dataclasses.Field[Any], readers: Readers
) -> dict[str, Any]:
    """Return a mapping from names chosen in the file."""
    if not isinstance(item.value, dict):
        raise place.refuse(f"{kind(item)} instead of a mapping", f"give names ({_meaning(field)})")
    errors, found = SceneErrors(), {}
    for name, child in item.value.items():
        with errors:
            found[name] = _read(hint, child, place.key(name, child.line), field, readers)
    errors.raise_any()
    return found


def _read_truth(item: Item, place: Place, meaning: str) -> bool:
    if not isinstance(item.value, bool):
        raise place.refuse(f"{kind(item)} is not true or false", f"write true or false ({meaning})")
    return item.value


def _read_text(item: Item, place: Place, meaning: str) -> str:
    if item.doubt:
        raise place.refuse(f"{shown(item.value)} {item.doubt}", "put it in quotes")
    if not isinstance(item.value, str):
        right = "put it in quotes" if not isinstance(item.value, dict | list) else "give words"
        raise place.refuse(f"{kind(item)} is not text", f"{right} ({meaning})")
    return " ".join(item.value.split())


def _read_number(
    hint: type, item: Item, place: Place, field: dataclasses.Field[Any]
) -> float | int:
    """Return a finite number inside its range; an integer where the hint is int."""
    number, meaning = item.value, _meaning(field)
    if isinstance(number, str) and item.doubt:
        raise place.refuse(f"{shown(number)} {item.doubt}", f"give a plain number ({meaning})")
    if isinstance(number, bool) or not isinstance(number, int | float):
        quoted = isinstance(number, str) and _numeric(number)
        right = "write it without quotes" if quoted else "give a number"
        raise place.refuse(f"{kind(item)} is not a number", f"{right} ({meaning})")
    if hint is int and not isinstance(number, int):
        raise place.refuse(f"{number!r} is not a whole number", f"give one ({meaning})")
    quantity = field.metadata.get("quantity") or Quantity("", "")
    if not quantity.admits(number):
        unit = f" {quantity.unit}" if quantity.unit else ""
        fault = "is out of range" if math.isfinite(number) else "is not finite"
        raise place.refuse(f"{number:g}{unit} {fault}", f"give {_range(quantity)}")
    return hint(number)  # type: ignore[no-any-return]


def _range(quantity: Quantity) -> str:
    return f"{quantity.range_text()} ({quantity.about})" if quantity.about else "a finite number"


def _numeric(words: str) -> bool:
    try:
        float(words)
    except ValueError:
        return False
    return True
