"""How far a run has come, on standard error."""

from __future__ import annotations

import os
import sys
import time
from typing import Protocol, TextIO

WIDTH = 80  # of a terminal that does not tell


def columns(stream: TextIO) -> int:
    """Of the terminal that the stream is."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or WIDTH
    except (OSError, ValueError):
        return WIDTH


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
            line = line[: columns(self._stream) - 1]  # a wrapped line cannot be written over
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
