"""File format of a saved state: two lines of text, a JSON header, the arrays.

    rope_twin state 3
    sha256 <64 hex digits> header <bytes> total <bytes>
    { ... }                        JSON; `arrays` lists name, type and shape in the order below
    <arrays>                       C order, little-endian, nothing between them

The checksum covers all that follows the second line. A file is written whole or not at all
(`whole_file`) and contains nothing that could be executed.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.errors import StateError, phrase
from rope_twin.twin.saving.serialisation import Arrays
from rope_twin.twin.state import FORMAT
from rope_twin.whole_file import write_whole

_FIRST = re.compile(rb"rope_twin state (\d{1,9})\n")
_SECOND = re.compile(rb"sha256 ([0-9a-f]{64}) header (\d{1,12}) total (\d{1,15})\n")
_ANOTHER = "take another saved state, or start without one"


def check_place(path: Path, option: str) -> None:
    """Check that a file can be created at `path`, before a long run that ends with it.

    Raises:
        StateError: it cannot; `option` names the option at fault.
    """
    if path.is_dir() or not os.access(path.resolve().parent, os.W_OK):
        raise StateError(phrase(option, "it cannot be written",
                                "name a file in a folder that can be written to"))  # fmt: skip


def write_state(path: Path, header: dict[str, Any], arrays: Arrays) -> None:
    """Write a file, replacing any file at `path`.

    Raises:
        StateError: the disk rejects it; the previous file is kept.
    """
    data = encode(header, arrays)
    try:
        write_whole(path, data)
    except OSError as error:
        raise StateError(
            phrase(
                str(path),
                f"the state cannot be written ({error.strerror or error})",
                "name a file in a folder that can be written to",
            )
        ) from error


def read_state(path: Path) -> tuple[dict[str, Any], Arrays]:
    """Read header and arrays of a file.

    Raises:
        StateError: the file is missing, no saved state, of another version, truncated or damaged.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise _refusal(path, f"it cannot be read ({error.strerror or error})",
                       "name a file that a run has saved") from error  # fmt: skip
    return decode(data, path)


def decode(data: bytes, path: Path) -> tuple[dict[str, Any], Arrays]:
    """Return header and arrays of a file's bytes; path: for messages.

    Raises:
        StateError: they are no saved state, of another version, truncated or damaged.
    """
    first = _FIRST.match(data)
    if first is None:
        raise _refusal(path, "it is no saved state",
                       f"its first line must be 'rope_twin state {FORMAT}'")  # fmt: skip
    if int(first[1]) != FORMAT:
        raise _refusal(path, f"it has version {int(first[1])} of the format",
                       f"this program reads version {FORMAT}")  # fmt: skip
    second = _SECOND.match(data, first.end())
    if second is None:
        raise _refusal(path, "its second line is damaged", _ANOTHER)
    header_bytes, total = int(second[2]), int(second[3])
    body = memoryview(data)[second.end() :]
    if len(data) < total:
        raise _refusal(path, f"it is cut off after {len(data)} of {total} bytes", _ANOTHER)
    if len(data) > total or hashlib.sha256(body).hexdigest().encode() != second[1]:
        raise _refusal(path, "it is damaged (its check-sum is another)", _ANOTHER)
    try:
        header = json.loads(bytes(body[:header_bytes]))
        return header, _cut(header["arrays"], body[header_bytes:])
    except (ValueError, KeyError, TypeError) as error:
        raise _refusal(path, f"its header does not describe it ({error})", _ANOTHER) from error


def _refusal(path: Path, what: str, right: str) -> StateError:
    return StateError(phrase(f"saved state {path}", what, right))


def encode(header: dict[str, Any], arrays: Arrays) -> bytes:
    """Return the bytes of a whole file."""
    described = [
        {"name": name, "type": _little(array).str, "shape": array.shape}
        for name, array in arrays.items()
    ]
    text = json.dumps({**header, "arrays": described}, indent=1, allow_nan=False) + "\n"
    head = text.encode()
    body = b"".join(
        [head, *(array.astype(_little(array), order="C").tobytes() for array in arrays.values())]
    )
    first = f"rope_twin state {FORMAT}\n"
    digest = hashlib.sha256(body).hexdigest()
    total = 0
    while True:  # the second line holds the total length, which includes that line
        second = f"sha256 {digest} header {len(head)} total {total}\n"
        length = len(first) + len(second) + len(body)
        if length == total:
            return first.encode() + second.encode() + body
        total = length


def _little(array: Any) -> np.dtype[Any]:
    dtype: np.dtype[Any] = array.dtype
    return dtype.newbyteorder("<")


def _cut(described: list[dict[str, Any]], body: memoryview) -> Arrays:
    """Return the arrays that follow the header.

    Raises:
        ValueError: the header describes other arrays.
    """
    arrays: Arrays = {}
    at = 0
    for entry in described:
        kind, shape = np.dtype(entry["type"]), tuple(entry["shape"])
        if kind.kind not in "fiub":
            raise ValueError(f"an array of {kind}")
        end = at + kind.itemsize * int(np.prod(shape, dtype=np.int64))
        arrays[entry["name"]] = (
            np.frombuffer(body[at:end], kind).reshape(shape).astype(kind.newbyteorder("="))
        )
        at = end
    if at != len(body):
        raise ValueError("the arrays are of another length")
    return arrays
