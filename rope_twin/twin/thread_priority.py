"""Real-time priority of threads, where the system allows it (root, or rtprio).

The stepping thread needs the interpreter's lock before and after its steps and waits for the thread
that holds it. If that thread is preempted by another program, the steps are delayed as long. All
Python threads of a real-time run therefore get real-time priority, one below that of the stepping
thread. Processes and library threads that they start stay ordinary.
"""

from __future__ import annotations

import os
import threading

# Real-time priorities, 1 to 99: above ordinary threads, below those of the system.
STEPPING, OTHERS = 10, 9


def raise_stepping_thread() -> bool:
    """Raise the priority of this thread, which steps; return whether the system allows it."""
    return _set(0, STEPPING)


def raise_other_threads() -> None:
    """Raise the priority of all threads of this interpreter to just below the stepping one."""
    for thread in threading.enumerate():
        _set(thread.native_id, OTHERS)


def reset_threads() -> None:
    """Return all threads of this interpreter to ordinary priority."""
    for thread in threading.enumerate():
        _set(thread.native_id, 0)


def _set(thread: int | None, priority: int) -> bool:
    """Set a thread's priority (0: ordinary); return whether the system allowed it.

    thread: its native number; 0: this thread; None: it has ended.
    """
    if thread is None:
        return False
    try:
        policy = os.SCHED_RR if priority else os.SCHED_OTHER
        own = os.sched_param(priority)
        os.sched_setscheduler(thread, policy | os.SCHED_RESET_ON_FORK, own)
    except (AttributeError, OSError):
        return False
    return True
