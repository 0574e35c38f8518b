"""CDR bytes of standard messages, and templates of them whose numbers can be written in place.

Turning Python objects into bytes costs milliseconds for a thousand points. A `Template` does it
once; afterwards only the numbers are written over the old ones.

CDR (OMG formal/02-06-51, section 9.3; plain CDR version 1 of DDS-XTypes 1.3, section 7.4.1): every
primitive is aligned to its own size, counted from the end of the 4-byte encapsulation header.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from rope_twin.errors import InputError, did_you_mean
from rope_twin.topics import BY_NAME

Table = NDArray[np.float64]

HEADER_BYTES = 4
_AXES = {"x": 0, "y": 1, "z": 2, "w": 3}  # of points, vectors and quaternions
_LITTLE = {
    "bool": "?", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "<i2",
    "uint16": "<u2", "int32": "<i4", "uint32": "<u4", "int64": "<i8", "uint64": "<u8",
    "float32": "<f4", "float64": "<f8",
}  # fmt: skip


@cache
def typestore() -> Any:
    """Return the message definitions of ROS 2 Kilted (loaded once, 0.2 s)."""
    return get_typestore(Stores.ROS2_KILTED)


def new(type_name: str, **fields: Any) -> Any:
    """Return a message object of the given type; fields that are not given are zero or empty.

    An orientation is the identity, as ROS defines it.
    """
    if type_name == "geometry_msgs/msg/Quaternion":
        fields.setdefault("w", 1.0)
    for name, description in typestore().fielddefs[type_name][1]:
        if name not in fields:
            fields[name] = _zero(description)
    return typestore().types[type_name](**fields)


def _zero(description: Any) -> Any:
    """Return the value of a field that is not given."""
    kind, detail = description
    if kind == Nodetype.NAME:
        return new(detail)
    if kind == Nodetype.BASE:
        return "" if detail[0] == "string" else np.dtype(_LITTLE[detail[0]]).type().item()
    (inner, inner_detail), count = detail[0], detail[1] if kind == Nodetype.ARRAY else 0
    if inner == Nodetype.BASE and inner_detail[0] in _LITTLE:
        return np.zeros(count, _LITTLE[inner_detail[0]])
    return [_zero(detail[0]) for _ in range(count)]


def serialise(message: Any) -> bytes:
    """Return the CDR bytes, little-endian, of a message object."""
    data: memoryview = typestore().serialize_cdr(message, message.__msgtype__, little_endian=True)
    return bytes(data)


def encode_text(words: str) -> bytes:
    """Return a message of a topic of text (std_msgs/String)."""
    return serialise(new("std_msgs/msg/String", data=words))


def deserialise(type_name: str, data: bytes | memoryview) -> Any:
    """Return the message object in CDR bytes.

    Raises:
        SerdeError: (of rosbags) the bytes are not such a message.
    """
    return typestore().deserialize_cdr(data, type_name)


def decode(topic_name: str, data: bytes | memoryview) -> Any:
    """Return the message in the bytes of one of the suite's topics (a leading slash is allowed).

    Raises:
        InputError: if the topic is not in the table, or the bytes are no message of its type.
    """
    name = topic_name.removeprefix("/")
    topic = BY_NAME.get(name)
    if topic is None:
        raise InputError("decode", f"unknown topic '{name}'", did_you_mean(name, BY_NAME))
    try:
        return deserialise(topic.type_name, data)
    except SerdeError as error:
        problem = f"{len(data)} bytes that do not decode ({error})"
        remedy = f"it must be a {topic.type_name} in CDR"
        raise InputError(f"topic {name}", problem, remedy) from error


@dataclass(frozen=True)
class Slot:
    """Location of a number, or of a block of numbers of one type, in the bytes."""

    offset: int  # [bytes] from the first byte of the encapsulation header
    dtype: np.dtype[Any]
    shape: tuple[int, ...]  # () a number, (k,) a vector or list, (n, k) a list of vectors
    length_offset: int | None = None  # of a list: where the number of its entries lies [bytes]

    @property
    def entry_bytes(self) -> int:
        """Return the size of an entry of a list [bytes]."""
        return int(np.prod(self.shape[1:], dtype=np.int64)) * self.dtype.itemsize

    def moved(self, new_offset: Callable[[int], int]) -> Slot:
        """Return the slot with its offsets mapped by `new_offset`."""
        length = None if self.length_offset is None else new_offset(self.length_offset)
        return replace(self, offset=new_offset(self.offset), length_offset=length)


class Template:
    """A serialised message and the location of every number in it.

    Slots are named by their path, `header.stamp.sec` or `markers.0.points`. A part of one kind of
    number (Point, Vector3, Quaternion, ColorRGBA) is one slot of shape (k,), a list of such parts
    one of shape (n, k).
    """

    def __init__(self, message: Any) -> None:
        self.data = serialise(message)
        walk = _NumberLocator()
        walk.part(message, message.__msgtype__, "")
        if walk.position != len(self.data):
            sizes = f"{len(self.data)} bytes, but its fields end at {walk.position}"
            raise ValueError(f"{message.__msgtype__}: {sizes}")
        self.slots = walk.slots

    def stretched(self, counts: Mapping[str, int]) -> Template:
        """Return a template with other numbers of entries in some lists, all copies of the first
        entry.

        In microseconds, where making the parts of a long list and a template of them takes tenths
        of a second. The list must have an entry already, and keep one.

        Raises:
            KeyError: if a slot does not exist.
            ValueError: if it is no list, or one whose entries are no whole number of 8 bytes: what
                follows would lose its alignment.
        """
        paths = sorted(counts, key=lambda path: self.slots[path].offset)
        pieces, read_to = [], 0
        for path in paths:
            slot, count = self.slots[path], counts[path]
            if slot.length_offset is None or slot.entry_bytes % 8 or count < 1:
                raise ValueError(f"{path}: it cannot have {count} entries in this way")
            first = self.data[slot.offset : slot.offset + slot.entry_bytes]
            pieces += [self.data[read_to : slot.offset], count * first]
            read_to = slot.offset + slot.shape[0] * slot.entry_bytes
        data = bytearray(b"".join([*pieces, self.data[read_to:]]))

        def moved(offset: int) -> int:
            before = [path for path in paths if self.slots[path].offset < offset]
            slots = self.slots
            grown = ((counts[p] - slots[p].shape[0]) * slots[p].entry_bytes for p in before)
            return offset + sum(grown)

        template = copy(self)
        template.slots = {path: slot.moved(moved) for path, slot in self.slots.items()}
        for path in paths:
            slot = template.slots[path]
            assert slot.length_offset is not None
            template.slots[path] = replace(slot, shape=(counts[path], *slot.shape[1:]))
            struct.pack_into("<I", data, slot.length_offset, counts[path])
        template.data = bytes(data)
        return template

    def place(self, path: str) -> tuple[int, np.dtype[Any]]:
        """Return offset [bytes] and type of a single number, also of one inside a vector's slot.

        Raises:
            KeyError: there is no such number.
        """
        if path in self.slots:
            return self.slots[path].offset, self.slots[path].dtype
        vector, _, axis = path.rpartition(".")
        slot = self.slots[vector]
        return slot.offset + _AXES[axis] * slot.dtype.itemsize, slot.dtype

    def fill(self, values: Mapping[str, Any]) -> bytes:
        """Return the bytes with these values in the named slots; the template itself is unchanged.

        Raises:
            KeyError: if a slot does not exist.
            ValueError: if a value does not have the shape of its slot.
        """
        data = bytearray(self.data)
        for path, value in values.items():
            slot = self.slots[path]
            if slot.shape:
                if np.shape(value) != slot.shape:
                    raise ValueError(f"{path}: shape {np.shape(value)}, must be {slot.shape}")
                np.ndarray(slot.shape, slot.dtype, data, slot.offset)[...] = value
            else:
                struct.pack_into(f"<{slot.dtype.char}", data, slot.offset, value)
        return bytes(data)


def table(type_name: str, messages: Sequence[bytes], paths: Sequence[str]) -> Table | None:
    """Return fields of messages (n, len(paths)) if all have one layout and equal texts, else None.

    The fields of all messages, at least one, are read at once, where decoding each takes 20 µs.
    paths: dotted names of numbers, like `pose.pose.position.z`.

    Raises:
        SerdeError: (of rosbags) the first message is not of this type.
    """
    template = Template(deserialise(type_name, messages[0]))
    message_bytes = len(template.data)
    if any(len(data) != message_bytes for data in messages):
        return None
    joined = np.frombuffer(b"".join(messages), np.uint8).reshape(len(messages), message_bytes)
    is_constant = np.ones(message_bytes, np.bool_)  # bytes of texts, lengths, padding
    for slot in template.slots.values():
        span = int(np.prod(slot.shape, dtype=np.int64)) * slot.dtype.itemsize
        is_constant[slot.offset : slot.offset + span] = False
    if (joined[:, is_constant] != np.frombuffer(template.data, np.uint8)[is_constant]).any():
        return None
    values = np.empty((len(messages), len(paths)))
    for column, path in enumerate(paths):
        offset, dtype = template.place(path)
        bytes_of = np.ascontiguousarray(joined[:, offset : offset + dtype.itemsize])
        values[:, column] = bytes_of.view(dtype)[:, 0]
    return values


class Templates:
    """Templates of topics whose messages change in size or names; each is rebuilt on a change."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[object, Template]] = {}

    def get(self, topic: str, key: object, make: Callable[[], Any]) -> Template:
        """Return the template of a topic, rebuilt by `make()` if `key` has changed."""
        cached = self._known.get(topic)
        if cached is None or cached[0] != key:
            cached = self._known[topic] = (key, Template(make()))
        return cached[1]


@cache
def _uniform(type_name: str) -> tuple[np.dtype[Any], int] | None:
    """Return type and count of numbers of a message type that has only equal numbers, or None."""
    kinds = [
        description[1][0] if description[0] == Nodetype.BASE else None
        for _, description in typestore().fielddefs[type_name][1]
    ]
    if len(kinds) < 2 or len(set(kinds)) > 1 or kinds[0] not in _LITTLE:
        return None
    return np.dtype(_LITTLE[kinds[0]]), len(kinds)


class _NumberLocator:
    """Walks a message in the order of serialisation and records the location of its numbers."""

    def __init__(self) -> None:
        self.position = HEADER_BYTES
        self.slots: dict[str, Slot] = {}

    def part(self, message: Any, type_name: str, path: str) -> None:
        """Walk a message or a part of one; `path` ends with a dot unless empty."""
        uniform = _uniform(type_name)
        if uniform and path:
            self._numbers(uniform[0], (uniform[1],), path[:-1])
            return
        for name, description in typestore().fielddefs[type_name][1]:
            self._field(getattr(message, name), description, path + name)

    def _field(self, value: Any, description: Any, path: str) -> None:
        kind, detail = description
        if kind == Nodetype.NAME:
            self.part(value, detail, path + ".")
        elif kind == Nodetype.BASE:
            self._base(value, detail[0], path)
        else:
            length_at = None
            if kind == Nodetype.SEQUENCE:
                self._skip(4, 4)
                length_at = self.position - 4
            self._list(value, detail[0], path, length_at)

    def _list(self, values: Any, description: Any, path: str, length_at: int | None) -> None:
        kind, detail = description
        count = len(values)
        if count == 0:  # nothing follows, not even padding
            return
        if kind == Nodetype.BASE and detail[0] in _LITTLE:
            self._numbers(np.dtype(_LITTLE[detail[0]]), (count,), path, length_at)
        elif kind == Nodetype.NAME and (uniform := _uniform(detail)):
            self._numbers(uniform[0], (count, uniform[1]), path, length_at)
        else:
            for index, value in enumerate(values):
                self._field(value, description, f"{path}.{index}")

    def _base(self, value: Any, kind: str, path: str) -> None:
        if kind == "string":
            self._skip(4, 4)
            self._skip(1, len(value.encode()) + 1)
        else:
            self._numbers(np.dtype(_LITTLE[kind]), (), path)

    def _numbers(
        self, dtype: np.dtype[Any], shape: tuple[int, ...], path: str, length_at: int | None = None
    ) -> None:
        size = int(np.prod(shape, dtype=np.int64)) * dtype.itemsize
        self._skip(dtype.itemsize, 0)
        self.slots[path] = Slot(self.position, dtype, shape, length_at)
        self.position += size

    def _skip(self, alignment: int, size: int) -> None:
        """Pad to the alignment, then advance by `size` bytes."""
        inside = self.position - HEADER_BYTES
        self.position += -inside % alignment + size
