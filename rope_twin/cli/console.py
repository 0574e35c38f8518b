"""Exit codes and output of commands: one JSON object, tables, the progress of cases."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Any, TextIO

from rope_twin.run.progress import FigureProgress


class ExitCode(IntEnum):
    """Exit code of a command, by its meaning."""

    OK = 0
    ERROR = 1
    USAGE = 2
    NEGATIVE = 3
    LIMIT = 4
    INTERRUPTED = 130


MEANINGS = {
    ExitCode.OK: "success",
    ExitCode.ERROR: "error, reported in one sentence on stderr; no or incomplete output; a scene "
    "that is invalid or exceeds a limit in static equilibrium (scene check)",
    ExitCode.USAGE: "invalid command line, reported in one sentence on stderr",
    ExitCode.NEGATIVE: "completed with a negative result: messages lost (recover), a difference "
    "(replay --verify), runs that stopped early (ensemble, study), a cell without a sea state "
    "that meets the criteria (plan), a fault not flagged in time (faults), more alarms than EEMUA "
    "191 allows (alerts), an error target missed (accuracy --within), a convergence study missing "
    "or out of date (accuracy --status), a check with ERROR (doctor)",
    ExitCode.LIMIT: "a limit of the scene was exceeded (run, unless --allow-overload)",
    ExitCode.INTERRUPTED: "interrupted (Ctrl-C) before there was a result",
}


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
        self._line = FigureProgress(stream)

    def show(self, done: int, total: int, what: str) -> None:
        """Show that `done` of `total` cases are done and `what` is next."""
        bar = "#" * round(20 * done / total)
        self._line.show(f"[{bar:<20}] {done}/{total} {what}")
        if done == total:
            self._line.finish()
