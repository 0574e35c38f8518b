"""Which threads run ahead of other programs, where the system allows it (root, or rtprio).

The thread that steps needs the interpreter before and after its steps, and waits for whoever
has it. If that thread is put aside for another program, the steps are held up for as long. So
all threads that run Python beside the steps go ahead of other programs too, a place behind the
steps, as long as these are paced. What they start (processes, threads of libraries) stays ordinary.
"""

from __future__ import annotations

import os
import threading

# Real-time priorities, of 1 to 99: ahead of ordinary threads, behind those of the system.
STEPS, BESIDE = 10, 9


def step_ahead() -> bool:
    """Let this thread, which steps, run ahead; whether the system allows it."""
    return _set(0, STEPS)


def follow_ahead() -> None:
    """Let all threads of this interpreter that there are now run ahead, behind the steps."""
    for thread in threading.enumerate():
        _set(thread.native_id, BESIDE)


def fall_back() -> None:
    """Let all of them be ordinary threads again."""
    for thread in threading.enumerate():
        _set(thread.native_id, 0)


def _set(thread: int | None, priority: int) -> bool:
    """Set a thread's priority (its native number; 0: this one; None: it ended); 0: ordinary."""
    if thread is None:
        return False
    try:
        policy = os.SCHED_RR if priority else os.SCHED_OTHER
        own = os.sched_param(priority)
        os.sched_setscheduler(thread, policy | os.SCHED_RESET_ON_FORK, own)
    except (AttributeError, OSError):
        return False
    return True
