"""A serial cable between two pseudo-terminals, for tests of what speaks over a serial line."""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager


class Cable:
    """A serial cable between two pseudo-terminals that can be unplugged."""

    def __init__(self) -> None:
        ends = [pty.openpty() for _ in range(2)]
        for end in (one for pair in ends for one in pair):
            tty.setraw(end)
        (self._out, out), (self._back, back) = ends
        self._ends = [self._out, out, self._back, back]
        self.out, self.back = os.ttyname(out), os.ttyname(back)
        self.plugged = True
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        other = {self._out: self._back, self._back: self._out}
        while not self._stop.is_set():
            for end in select.select([*other], [], [], 0.1)[0]:
                data = os.read(end, 4096)
                if self.plugged:
                    os.write(other[end], data)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        for end in self._ends:
            os.close(end)


@contextmanager
def cable() -> Iterator[Cable]:
    """A cable, closed at the end."""
    made = Cable()
    try:
        yield made
    finally:
        made.close()
