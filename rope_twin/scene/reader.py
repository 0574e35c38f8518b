"""Reader of a YAML file: a tree of items with line numbers, then frozen dataclasses.

YAML 1.1 and 1.2 read `1e5`, `010`, `1:30` or `no` differently. Such text is kept as text with a
note (`Item.doubt`), so that the reader can reject it where a number is expected. Duplicate keys,
aliases, tags and very deep nesting are rejected here.

Type hints of a dataclass give types, its metadata ranges. Nothing is converted implicitly: a string
is not a number, true is not a number, 3.0 is not an integer. A dataclass may check itself: `check()
-> str | None` returns 'fault; remedy'.
"""

from __future__ import annotations

import dataclasses
import math
import re
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import yaml

from rope_twin.errors import SceneError, SceneErrors, did_you_mean, phrase
from rope_twin.quantity import Quantity

LARGEST_FILE_BYTES = 1_000_000
DEEPEST_NESTING = 32
_TRUTH = {"true": True, "false": False}
_NUMBER = re.compile(r"[-+]?(0|[1-9][0-9]*)(\.[0-9]*([eE][-+][0-9]+)?)?|\.[0-9]+([eE][-+][0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_YAML = "tag:yaml.org,2002:"


def shown(value: object) -> str:
    """Return a value as displayed in an error: on one line and short."""
    words = repr(value)
    return words if len(words) <= 60 else f"{words[:45]}...{words[-8:]}"


@dataclass(frozen=True)
class Item:
    """A value of the file with the line of the value (or of its key)."""

    value: dict[str, Item] | list[Item] | str | float | int | bool | None
    line: int
    doubt: str = ""  # why the text is ambiguous in YAML; empty: it is not

    def find(self, path: str) -> Item:
        """Return the item at a path such as `winch.schedule[2].at_s`, or the nearest one above it.

        `effects.waves` is the item in that list with this one key.
        """
        item = self
        for name, index in re.findall(r"([^.\[\]]+)|\[(\d+)\]", path):
            if name and isinstance(item.value, dict) and name in item.value:
                item = item.value[name]
            elif index and isinstance(item.value, list) and int(index) < len(item.value):
                item = item.value[int(index)]
            elif name and isinstance(item.value, list):
                named = (entry.value for entry in item.value if isinstance(entry.value, dict))
                item = next((entry[name] for entry in named if name in entry), item)
            else:
                break
        return item


@dataclass(frozen=True)
class Place:
    """Location in a file: a path such as `ropes[0].length_m`, and a line."""

    file: Path
    path: str = ""
    line: int = 0

    def key(self, name: str, line: int) -> Place:
        """Return the place of a key of this mapping."""
        word = name if name.isidentifier() else shown(name)
        return Place(self.file, f"{self.path}.{word}" if self.path else word, line)

    def index(self, number: int, line: int) -> Place:
        """Return the place of an element of this list."""
        return Place(self.file, f"{self.path}[{number}]", line)

    def __str__(self) -> str:
        line = f", line {self.line}" if self.line else ""
        path = f", {self.path}" if self.path else ""
        return f"{self.file}{line}{path}"

    def refuse(self, problem: str, remedy: str) -> SceneError:
        """Return the error to raise: place, fault and remedy, always on one line."""
        sentence = phrase(str(self), problem, remedy).replace("?.", "?")
        return SceneError(" ".join(sentence.split()), line=self.line)


class _Loader(yaml.SafeLoader):
    """PyYAML's composer without aliases, tags and unlimited nesting, for the file of a place."""

    def __init__(self, text: str, place: Place) -> None:
        super().__init__(text)
        self.place, self.depth = place, 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        at = Place(self.place.file, "", _line(event))
        if isinstance(event, yaml.AliasEvent):
            raise at.refuse("an alias (*name) is not supported", "write the value out")
        if getattr(event, "tag", None) is not None:
            raise at.refuse(f"the tag {shown(event.tag)} is not supported", "remove it")
        if self.depth >= DEEPEST_NESTING:
            problem = f"more than {DEEPEST_NESTING} levels of nesting"
            raise at.refuse(problem, "follow the structure of the scenes in config/scenes")
        self.depth += 1
        node: yaml.Node | None = super().compose_node(parent, index)
        self.depth -= 1
        return node


def read_document(path: Path, errors: SceneErrors | None = None) -> tuple[Item, bytes]:
    """Return the tree of a YAML file and its bytes.

    errors: collects duplicate or invalid keys, which are skipped, or None to raise them.

    Raises:
        SceneError: if the file cannot be read, is not YAML, or its top is not a mapping.
    """
    place = Place(path)
    data = _read_bytes(place)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        problem = f"byte {error.start} is not UTF-8 text"
        raise place.refuse(problem, "give a YAML file, saved as UTF-8") from None
    node = _compose(text, place)
    if node is None:
        raise place.refuse("the file is empty", "give a mapping, as in config/scenes")
    all_errors = SceneErrors() if errors is None else errors
    tree = _convert(node, place, all_errors)
    if errors is None:
        all_errors.raise_any()
    if not isinstance(tree.value, dict):
        raise place.refuse(
            f"its top is {kind(tree)}, not a mapping", "start with keys such as `about: ...`"
        )
    return tree, data


def kind(item: Item) -> str:
    """Return a description of an item's type."""
    match item.value:
        case dict():
            return "a mapping"
        case list():
            return "a list"
        case None:
            return "nothing"
        case bool():
            return str(item.value).lower()
        case int() | float():
            return f"the number {item.value:g}"
        case _:
            return f"the text {shown(item.value)}"


def _read_bytes(place: Place) -> bytes:
    """Return the file's bytes; reject anything but an ordinary file of limited size."""
    if not place.file.is_file():
        problem = "it is a folder" if place.file.is_dir() else "there is no such file"
        raise place.refuse(problem, "give the path of a YAML file")
    try:
        with place.file.open("rb") as stream:
            data = stream.read(LARGEST_FILE_BYTES + 1)
    except OSError as error:
        raise place.refuse(
            f"it cannot be read ({error.strerror})", "check the file's permissions"
        ) from error
    if len(data) > LARGEST_FILE_BYTES:
        problem = f"it is larger than {LARGEST_FILE_BYTES // 1000} kB"
        raise place.refuse(problem, "give a scene, not a recording")
    return data


def _compose(text: str, place: Place) -> yaml.Node | None:
    """Return PyYAML's node tree; its errors become SceneErrors."""
    remedy = "check indentation, colons, quotes and brackets there"
    try:
        loader = _Loader(text, place)
        try:
            node: yaml.Node | None = loader.get_single_node()
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        at_mark = Place(place.file, "", mark.line + 1 if mark else 0)
        reason = ", ".join(words for words in (error.context, error.problem) if words)
        raise at_mark.refuse(f"it is not YAML ({reason})", remedy) from error
    except yaml.YAMLError as error:
        reason = getattr(error, "reason", "unreadable characters")
        raise place.refuse(f"it is not YAML ({reason})", "give a YAML text file") from error
    return node


def _convert(node: yaml.Node, place: Place, errors: SceneErrors, line: int = 0) -> Item:
    """Return the item of a node; `line` is that of its key, where it has one."""
    line = line or _line(node)
    if isinstance(node, yaml.MappingNode):
        return Item(dict(_pairs(node, place, errors)), line)
    if isinstance(node, yaml.SequenceNode):
        items = [
            _convert(child, place.index(number, line), errors)
            for number, child in enumerate(node.value)
        ]
        return Item(items, line)
    assert isinstance(node, yaml.ScalarNode)  # PyYAML has no fourth kind
    return _scalar(node, line)


def _line(part: yaml.Node | yaml.Event) -> int:
    return part.start_mark.line + 1 if part.start_mark else 0


def _pairs(node: yaml.MappingNode, place: Place, errors: SceneErrors) -> Iterator[tuple[str, Item]]:
    """Yield keys and items of a mapping; a key that is not a word or is a duplicate is rejected."""
    lines: dict[str, int] = {}
    for key_node, value_node in node.value:
        line = _line(key_node)
        if not isinstance(key_node, yaml.ScalarNode):
            below = Place(place.file, place.path, line)
            errors.add(below.refuse("a key is itself a list or mapping", "give a word as key"))
            continue
        name = key_node.value
        below = place.key(name, line)
        if name in lines:
            problem = f"the key {shown(name)} is given a second time (first in line {lines[name]})"
            errors.add(below.refuse(problem, "keep one of them"))
            continue
        lines[name] = line
        yield name, _convert(value_node, below, errors, line)


def _scalar(node: yaml.ScalarNode, line: int) -> Item:
    """Return text, number, truth value or nothing; ambiguous plain text carries a doubt."""
    written: str = node.value
    if node.style is not None:
        return Item(written, line)
    if written in ("", "~", "null", "Null", "NULL"):
        return Item(None, line)
    if written.lower() in _TRUTH and written in (written.lower(), written.title(), written.upper()):
        return Item(_TRUTH[written.lower()], line)
    if _NUMBER.fullmatch(written):
        # beyond 15 digits an integer is read as a float: int() rejects very long ones
        is_integer = written.lstrip("+-").isdigit() and len(written) <= 15
        return Item(int(written) if is_integer else float(written), line)
    if _NOT_FINITE.fullmatch(written):
        return Item(float(written.replace(".", "", 1)), line)
    return Item(written, line, _doubt(written, node.tag.removeprefix(_YAML)))


def _doubt(written: str, yaml11: str) -> str:
    """Return why a plain text is ambiguous, with an alternative; empty if it is not."""
    if yaml11 == "bool":
        return "is true or false in YAML 1.1 and text in YAML 1.2"
    if yaml11 == "timestamp":
        return "is a date in YAML 1.1"
    if yaml11 in ("int", "float"):
        return "is read as different numbers by YAML 1.1 and 1.2"
    try:
        number = float(written.replace("_", "x"))  # float() takes 1_000, YAML 1.2 does not
    except ValueError:
        return ""
    if not math.isfinite(number):
        return ""
    return f"is text, not a number, in YAML 1.1 (a number: {plain(number)})"


def plain(number: float) -> str:
    """Format a number so that every YAML reader agrees on it."""
    mantissa, e, exponent = repr(number).partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{e}{exponent}" if e else mantissa


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
    mapping, errors, hints = item.value, SceneErrors(), _hints_of(cls)
    if not isinstance(mapping, dict):
        remedy = (
            f"give a mapping with {', '.join(fields)}" if fields else "give an empty mapping {}"
        )
        raise place.refuse(f"{kind(item)} instead of a mapping", remedy)
    unknown = _refuse_unknown(mapping, place, fields, hints, errors)
    missing = [
        field
        for name, field in fields.items()
        if field.init
        and field.default is field.default_factory is dataclasses.MISSING
        and name not in mapping
        and f"did you mean '{name}'?" not in unknown
    ]
    if missing:
        names = ", ".join(field.name for field in missing)
        remedy = f"add {missing[0].name} ({_meaning(missing[0])})"
        errors.add(place.refuse(f"{names} missing", remedy))
    values = dict(given)
    for name, child in mapping.items():
        if name not in fields:
            continue
        below, field = place.key(name, child.line), fields[name]
        with errors:
            if reader := readers.get(f"{cls.__name__}.{name}"):
                values[field.name] = reader(child, below)
            else:
                values[field.name] = _read(hints[field.name], child, below, field, readers)
    errors.raise_any()
    result = cls(**values)
    complaint = result.check() if hasattr(result, "check") else None
    if complaint:
        problem, _, remedy = complaint.partition("; ")
        raise place.refuse(problem, remedy.rstrip(".") or "see the scenes in config/scenes")
    return result


_hints_of = cache(get_type_hints)  # evaluating annotations takes longer than reading their values


def _refuse_unknown(
    mapping: Mapping[str, Item],
    place: Place,
    known: Mapping[str, Any],
    hints: Mapping[str, Any],
    errors: SceneErrors,
) -> set[str]:
    """Collect an error for each unknown key; return the remedies suggested."""
    remedies = set()
    for name, child in mapping.items():
        if name not in known:
            remedy = did_you_mean(name, known) if known else "remove it, no keys are allowed here"
            homes = [key for key, field in known.items() if name in _keys_of(hints[field.name])]
            if homes:
                remedy = f"it belongs to `{homes[0]}`, as `{homes[0]}: {{{name}: ...}}`"
            errors.add(place.key(name, child.line).refuse("unknown key", remedy))
            remedies.add(remedy)
    return remedies


def _keys_of(hint: Any) -> set[str]:
    """Return the keys of a part that is one mapping; none of other types."""
    kinds = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    parts = (kind for kind in kinds if dataclasses.is_dataclass(kind))
    return {key_of(field) for part in parts for field in dataclasses.fields(part)}


def read_choice(item: Item, place: Place, choices: Mapping[str, Any]) -> tuple[str, Item, Place]:
    """Return the one key of a mapping such as `box: {...}` (in `choices`), its item and place."""
    names = ", ".join(choices)
    mapping = item.value
    if isinstance(mapping, str) and mapping in choices:
        raise place.refuse(f"{shown(mapping)} alone", f"write it as `{mapping}: {{}}`")
    if not isinstance(mapping, dict) or len(mapping) != 1:
        problem = f"{len(mapping)} keys" if isinstance(mapping, dict) else kind(item)
        raise place.refuse(
            f"{problem} instead of one key", f"give one of {names}, as `name: {{...}}`"
        )
    (name, child), *_ = mapping.items()
    below = place.key(name, child.line)
    if name not in choices:
        raise below.refuse("unknown", did_you_mean(name, choices))
    return name, child, below


def key_of(field: dataclasses.Field[Any]) -> str:
    """Return the key of a field: its name without the underscore that avoids a Python keyword."""
    return field.name.rstrip("_")


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
    if get_origin(hint) in (tuple, dict):
        return _read_entries(hint, item, place, field, readers)
    if hint is bool:
        if not isinstance(item.value, bool):
            remedy = f"write true or false ({meaning})"
            raise place.refuse(f"{kind(item)} is not true or false", remedy)
        return item.value
    if hint is str:
        if item.doubt:
            raise place.refuse(f"{shown(item.value)} {item.doubt}", "put it in quotes")
        if not isinstance(item.value, str):
            remedy = "give words" if isinstance(item.value, dict | list) else "put it in quotes"
            raise place.refuse(f"{kind(item)} is not text", f"{remedy} ({meaning})")
        return " ".join(item.value.split())
    if hint in (int, float):
        return _read_number(hint, item, place, field)
    raise TypeError(f"{field.name}: the reader does not support {hint}")  # a defect of the program


def _read_entries(
    hint: Any, item: Item, place: Place, field: dataclasses.Field[Any], readers: Readers
) -> Any:
    """Return a mapping from names chosen in the file, or a tuple.

    Its length is fixed, or any where the hint ends with an ellipsis.
    """
    meaning, hints, errors = _meaning(field), get_args(hint), SceneErrors()
    if get_origin(hint) is dict:
        if not isinstance(item.value, dict):
            raise place.refuse(f"{kind(item)} instead of a mapping", f"give names ({meaning})")
        named = {}
        for name, child in item.value.items():
            with errors:
                named[name] = _read(hints[1], child, place.key(name, child.line), field, readers)
        errors.raise_any()
        return named
    if not isinstance(item.value, list):
        raise place.refuse(f"{kind(item)} instead of a list", f"give a list ({meaning})")
    if hints[-1] is Ellipsis:
        hints = hints[:1] * len(item.value)
    if len(item.value) != len(hints):
        problem = f"{len(item.value)} values in the list"
        raise place.refuse(problem, f"give {len(hints)} ({meaning})")
    values = []
    for number, (one, child) in enumerate(zip(hints, item.value, strict=True)):
        with errors:
            values.append(_read(one, child, place.index(number, child.line), field, readers))
    errors.raise_any()
    return tuple(values)


def _read_number(
    hint: type, item: Item, place: Place, field: dataclasses.Field[Any]
) -> float | int:
    """Return a finite number inside its range; an integer where the hint is int."""
    number, meaning = item.value, _meaning(field)
    if isinstance(number, str) and item.doubt:
        raise place.refuse(f"{shown(number)} {item.doubt}", f"give a plain number ({meaning})")
    if isinstance(number, bool) or not isinstance(number, int | float):
        quoted = isinstance(number, str) and _numeric(number)
        remedy = "write it without quotes" if quoted else "give a number"
        raise place.refuse(f"{kind(item)} is not a number", f"{remedy} ({meaning})")
    if hint is int and not isinstance(number, int):
        raise place.refuse(f"{number!r} is not a whole number", f"give one ({meaning})")
    quantity = field.metadata.get("quantity") or Quantity("", "")
    if not quantity.admits(number):
        unit = f" {quantity.unit}" if quantity.unit else ""
        fault = "is out of range" if math.isfinite(number) else "is not finite"
        remedy = (
            f"{quantity.range_text()} ({quantity.about})" if quantity.about else "a finite number"
        )
        raise place.refuse(f"{number:g}{unit} {fault}", f"give {remedy}")
    return hint(number)  # type: ignore[no-any-return]


def _numeric(words: str) -> bool:
    try:
        float(words)
    except ValueError:
        return False
    return True
