"""Signals that end a run: Ctrl-C (SIGINT), SIGTERM, and a closed terminal (SIGHUP)."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


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
