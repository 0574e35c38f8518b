"""Output of commands: one JSON object, tables in columns, and the progress of a list of cases."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

from rope_twin.run.progress import columns


def print_json(content: Mapping[str, Any]) -> None:
    """Print the one object of `--json`; numbers that JSON does not have are null."""
    print(json.dumps(_plain(content), ensure_ascii=False, allow_nan=False))


def _plain(value: Any) -> Any:
    """Return a value in the types of JSON."""
    match value:
        case Mapping():
            return {str(key): _plain(one) for key, one in value.items()}
        case list() | tuple():
            return [_plain(one) for one in value]
        case float():
            return value if math.isfinite(value) else None
        case Path():
            return str(value)
        case _:
            return value


def print_table(rows: Sequence[Sequence[str]], words_last: bool = False) -> None:
    """Print columns as wide as their widest cell, the first left-, the others right-aligned.

    A last column of words is left-aligned too.
    """
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    for line in _aligned(rows, widths, words_last):
        print(line)


def _aligned(rows: Sequence[Sequence[str]], widths: list[int], words_last: bool) -> Iterator[str]:
    for row in rows:
        cells = [row[0].ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        if words_last:
            cells[-1] = row[-1]
        yield "  ".join(cells).rstrip()


class CaseProgress:
    """One changing line on a terminal, a line per case elsewhere; on standard error."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr

    def show(self, done: int, total: int, what: str) -> None:
        """Show that `done` of `total` cases are done and `what` is next."""
        bar = "#" * round(20 * done / total)
        line = f"[{bar:<20}] {done}/{total} {what}"
        if self._stream.isatty():
            end = "\n" if done == total else ""
            room = columns(self._stream) - 1
            self._stream.write(f"\r{line[:room]:<{room}}{end}")
        else:
            self._stream.write(f"{line}\n")
        self._stream.flush()
