"""Progress of a run on standard error, and the signals that end it."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from types import FrameType
from typing import Any, TextIO

WIDTH = 80  # columns of a terminal of unknown width


def columns(stream: TextIO) -> int:
    """Return the width in columns of the terminal behind a stream."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or WIDTH
    except (OSError, ValueError):
        return WIDTH


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

    def show(self, line: str) -> None:
        """Print the progress line now."""
        self._next_s = time.monotonic() + self._period_s
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


class StopSignal:
    """Stop request by a signal (Ctrl-C, SIGTERM, a closed terminal), as a flag.

    The main loop reads the flag: no exception interrupts a time step, a compilation or a callback
    from C. In other threads than the main one the flag is never set.
    """

    def __init__(self, second: signal.Handlers | None = None) -> None:
        """Listen for the signals; `second`: effect of a second one, None: that of before."""
        self.requested = False
        self.note = ""  # printed when a signal arrives: why the shutdown may take a while
        self._second = second
        self._before: dict[int, Any] = {}
        if threading.current_thread() is threading.main_thread():
            for number in ending_signals():
                self._before[number] = signal.signal(number, self._on_signal)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.requested = True
        if self.note:
            os.write(sys.stderr.fileno(), self.note.encode())
        for known, handler in self._before.items():
            signal.signal(known, handler if self._second is None else self._second)

    def restore(self) -> None:
        """Restore the previous signal handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
