"""File of a saved state: two lines of text, a JSON header, the arrays; periodic saving.

    rope_twin state 4
    sha256 <64 hex digits> header <bytes> total <bytes>
    { ... }                        JSON; `arrays` lists name, type and shape in the order below
    <arrays>                       C order, little-endian, nothing between them

The checksum covers all that follows the second line. A file is written whole or not at all
(`files.write_whole`) and contains nothing that could be executed.

`serialise` returns the plain form of a value: numbers, strings, arrays, containers, NamedTuples,
dataclasses and objects of this package with all their attributes. An unknown type is an error, so
that no attribute is silently left out. `deserialise` restores the values into an object of the same
structure. Parts of the scene are constant and are left out. In JSON, lists, numbers and strings are
plain; any other value is an object with one key that names its type: {"array": name},
{"fields": {...}}, {"tuple": [...]}, ...

`AutoSave` saves a running twin: the stepping thread copies the state, another writes it.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import logging
import math
import os
import re
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import SolverError, StateError
from rope_twin.files import write_whole

if TYPE_CHECKING:
    from rope_twin.twin.recovery import Recovery
    from rope_twin.twin.snapshot import Snapshot
    from rope_twin.twin.state import SavedState
    from rope_twin.twin.twin import Twin

FORMAT = 15  # of a saved state; raise it with every change of what a state holds
Arrays = dict[str, NDArray[Any]]
_CONSTANT = tuple(f"rope_twin.scene.{part}" for part in ("schema", "winch", "instruments"))
# a current may have gained rows and a rope elements, as have the monitors of that rope
_VARIABLE_LENGTH = {"effects", "tension", "vortex", "viv_drag"}
_log = logging.getLogger(__name__)


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
    templates = (
        like if isinstance(like, tuple) and len(like) == len(content) else [None] * len(content)
    )
    parts = [
        deserialise(part, template, arrays, f"{at}/{number}")
        for number, (part, template) in enumerate(zip(content, templates, strict=True))
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
        mismatched = sorted(present.keys() ^ content.keys())
        raise StateError(f"{at} does not have the same parts ({', '.join(mismatched)})")
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


_FIRST = re.compile(rb"rope_twin state (\d{1,9})\n")
_SECOND = re.compile(rb"sha256 ([0-9a-f]{64}) header (\d{1,12}) total (\d{1,15})\n")
_ANOTHER = "take another saved state, or start without one"


def check_place(path: Path, option: str) -> None:
    """Check that a file can be created at `path`, before a long run that ends with it.

    Raises:
        StateError: it cannot; `option` names the option at fault.
    """
    if path.is_dir() or not os.access(path.resolve().parent, os.W_OK):
        raise StateError(
            option, "it cannot be written", "name a file in a folder that can be written to"
        )


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
            str(path),
            f"the state cannot be written ({error.strerror or error})",
            "name a file in a folder that can be written to",
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


def _refusal(path: Path, problem: str, remedy: str) -> StateError:
    return StateError(f"saved state {path}", problem, remedy)


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


@dataclass(frozen=True)
class SavingStatus:
    """Status of saving."""

    path: Path
    saved_s: float | None = None  # twin time of the newest saved state; None: none in this run
    trouble: str = ""  # why the newest attempt failed; empty if it succeeded


class AutoSave:
    """A twin for the pacer that saves its state periodically while it is stepped.

    Saving costs the stepping thread a copy of the arrays; it never waits for the disk. A state from
    which a step failed does not replace the previous file.
    """

    def __init__(
        self,
        twin: Twin | Recovery,
        path: Path,
        every_s: float,
        beside: Callable[[], dict[str, Any]] = dict,
    ) -> None:
        """Save to `path` each time that `every_s` of twin time have passed.

        beside: returns what else is saved with the state, as JSON; called in the writing thread.

        Raises:
            StateError: the file cannot be created.
        """
        self._beside = beside
        check_place(path, f"saved state {path}")
        self._twin = twin
        self._every_ns = round(every_s * 1e9)
        self._due_ns = twin.time_ns + self._every_ns
        self._kept_step = twin.steps  # the newest step that is saved or needs no saving
        self._failed = False
        self._requested = False  # save at the end of the next cycle
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="twin-state")
        self._writer.submit(int)  # start its thread here, not within a cycle
        self._writing: Future[None] | None = None
        self._health = SavingStatus(path)

    @property
    def step_ns(self) -> int:
        """Length of a step [ns]."""
        return self._twin.step_ns

    def advance(self, steps: int) -> None:
        """Advance by this number of steps, and save the state if it is due.

        Raises:
            SolverError: a step failed.
        """
        try:
            self._twin.advance(steps)
        except SolverError:
            self._failed = True
            raise
        written = self._writing is None or self._writing.done()
        if written and (self._requested or self._twin.time_ns >= self._due_ns):
            self._requested = False
            self._due_ns = self._twin.time_ns + self._every_ns
            self._take()

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present."""
        return self._twin.snapshot()

    def request(self) -> None:
        """Save the state at the end of the next cycle; may be called from any thread."""
        self._requested = True

    def keep(self, twin: Twin) -> None:
        """Save a branch of the twin instead of the present; call it while no thread steps."""
        if not self._failed:
            self._store(twin)

    def health(self) -> SavingStatus:
        """Return the status of saving; may be called from any thread."""
        return self._health

    def finish(self) -> None:
        """Save the present and return when it is written; call it while no thread steps."""
        if not self._failed and self._twin.steps != self._kept_step:
            self._take()
        self.finish_writing()

    def finish_writing(self) -> None:
        """Wait until the last state is on the disk, or has failed to be written."""
        if self._writing is not None:
            self._writing.result()

    def _take(self) -> None:
        self._kept_step = self._twin.steps
        self._store(self._twin)

    def _store(self, twin: Twin | Recovery) -> None:
        try:
            state = twin.capture()
        except StateError as error:  # a run is worth more than its saved state
            self._report(f"{self._health.path}: {error}")
        else:
            self._writing = self._writer.submit(self._write, state)

    def _write(self, state: SavedState) -> None:
        try:
            dataclasses.replace(state, beside=self._beside()).write(self._health.path)
        except StateError as error:
            self._report(str(error))
        except Exception as error:
            # A defect must appear in the diagnostics, not be lost with the thread's result.
            _log.exception("the state was not saved")
            self._report(f"the state was not saved: {type(error).__name__}: {error}")
        else:
            if self._health.trouble:
                _log.warning("the state at %g s is saved again", state.about.time_s)
            self._health = SavingStatus(self._health.path, state.about.time_s)

    def _report(self, trouble: str) -> None:
        """Keep the reason of a failure, and log the first of a series."""
        if not self._health.trouble:
            _log.warning("%s", trouble)
        self._health = SavingStatus(self._health.path, self._health.saved_s, trouble)
