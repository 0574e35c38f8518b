"""What commands show on a console: a table in columns, and how far a long run has come."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TextIO, TypeVar

WIDTH = 80  # of a terminal that does not tell


class Timed(Protocol):
    """A case that knows its name and what it takes."""

    @property
    def id(self) -> str:
        """Its name on the command line."""

    @property
    def seconds(self) -> float:
        """What it takes, roughly."""


C = TypeVar("C", bound=Timed)
R = TypeVar("R")


def run_each(cases: Sequence[C], run_case: Callable[[C], R]) -> Iterator[R]:
    """What becomes of each case, as it ends; on a terminal a line tells which one is running."""
    live = sys.stderr.isatty()
    for number, case in enumerate(cases, 1):
        if live:
            words = f"{number} of {len(cases)}: {case.id}, about {case.seconds:.0f} s"
            words = words[: _columns(sys.stderr) - 1]
            print(f"\r\033[K{words}", end="", file=sys.stderr, flush=True)
        row = run_case(case)
        if live:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
        yield row


def print_table(rows: Sequence[Sequence[str]], words_last: bool = False) -> None:
    """Columns as wide as their widest cell, the first to the left, the others to the right.

    A last column of words goes to the left too.
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


def _columns(stream: TextIO) -> int:
    """Of the terminal that the stream is."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or WIDTH
    except (OSError, ValueError):
        return WIDTH


class CaseProgress:
    """One changing line on a terminal, a line per case elsewhere; on standard error."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr

    def show(self, done: int, total: int, what: str) -> None:
        """So many of so many cases are done; `what` is next."""
        bar = "#" * round(20 * done / total)
        line = f"[{bar:<20}] {done}/{total} {what}"
        if self._stream.isatty():
            end = "\n" if done == total else ""
            room = _columns(self._stream) - 1
            self._stream.write(f"\r{line[:room]:<{room}}{end}")
        else:
            self._stream.write(f"{line}\n")
        self._stream.flush()


class Shown(Protocol):
    """What has a line for people."""

    def as_progress(self) -> str:
        """The line."""


class FigureProgress:
    """One changing line on a terminal, a line every ten seconds elsewhere; on standard error."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._live = self._stream.isatty()
        self._period_s = 0.5 if self._live else 10.0
        self._next_s = 0.0
        self._width = 0

    @property
    def due(self) -> bool:
        """Whether it is time for the next line."""
        return time.monotonic() >= self._next_s

    def show(self, figures: Shown) -> None:
        """Their line, now."""
        self._next_s = time.monotonic() + self._period_s
        line = figures.as_progress()
        if self._live:
            line = line[: _columns(self._stream) - 1]  # a wrapped line cannot be written over
            self._stream.write("\r" + line.ljust(self._width))
            self._width = len(line)
        else:
            self._stream.write(line + "\n")
        self._stream.flush()

    def say(self, sentence: str) -> None:
        """A line of its own."""
        self.finish()
        self._stream.write(sentence + "\n")
        self._stream.flush()

    def finish(self) -> None:
        """Leave the changing line."""
        if self._width:
            self._stream.write("\n")
            self._width = 0
