"""Progress of a run on standard error, and the signals that end it."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Protocol, TextIO

WIDTH = 80  # columns of a terminal of unknown width


def columns(stream: TextIO) -> int:
    """Return the width in columns of the terminal behind a stream."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or WIDTH
    except (OSError, ValueError):
        return WIDTH


class Shown(Protocol):
    """Anything that can be shown as a progress line."""

    def as_progress(self) -> str:
        """Return the progress line."""


class FigureProgress:
    """Prints one updated line on a terminal, elsewhere a line every 10 s; on standard error."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._live = self._stream.isatty()
        self._period_s = 0.5 if self._live else 10.0
        self._next_s = 0.0
        self._width = 0

    @property
    def due(self) -> bool:
        """Return whether it is time for the next line."""
        return time.monotonic() >= self._next_s

    def show(self, figures: Shown) -> None:
        """Print the progress line now."""
        self._next_s = time.monotonic() + self._period_s
        line = figures.as_progress()
        if self._live:
            line = line[: columns(self._stream) - 1]  # a wrapped line cannot be overwritten
            self._stream.write("\r" + line.ljust(self._width))
            self._width = len(line)
        else:
            self._stream.write(line + "\n")
        self._stream.flush()

    def say(self, sentence: str) -> None:
        """Print a sentence on a line of its own."""
        self.finish()
        self._stream.write(sentence + "\n")
        self._stream.flush()

    def finish(self) -> None:
        """End the updated line."""
        if self._width:
            self._stream.write("\n")
            self._width = 0


def ending_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end a run cleanly; under nohup SIGHUP is not among them."""
    if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
        return signal.SIGINT, signal.SIGTERM
    return signal.SIGINT, signal.SIGTERM, signal.SIGHUP


@contextmanager
def end_told() -> Iterator[threading.Event]:
    """Set an event on such a signal, so that no signal interrupts a time step.

    A second signal has its original effect.
    """
    told = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield told
        return
    before = {number: signal.getsignal(number) for number in ending_signals()}

    def give_back() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def tell(number: int, frame: FrameType | None) -> None:
        told.set()
        give_back()

    for number in before:
        signal.signal(number, tell)
    try:
        yield told
    finally:
        give_back()
