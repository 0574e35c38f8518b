"""What asks a run to end: Ctrl-C, SIGTERM, and a terminal that closed (SIGHUP)."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


def ending_signals() -> tuple[signal.Signals, ...]:
    """The signals that end a run in good order; under nohup a closed terminal is none of them."""
    if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
        return signal.SIGINT, signal.SIGTERM
    return signal.SIGINT, signal.SIGTERM, signal.SIGHUP


@contextmanager
def end_told() -> Iterator[threading.Event]:
    """Such a signal sets a flag, so that it never comes in the middle of a step.

    A second one does what it did before.
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
