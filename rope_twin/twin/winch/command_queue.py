"""Queue of winch commands: validated by their stamps, kept until they are due."""

from __future__ import annotations

from collections import deque

from rope_twin.errors import phrase
from rope_twin.twin.health import AHEAD_NS, InputCounter, too_far_ahead, too_late
from rope_twin.twin.winch.commands import EMERGENCY_STOP, WinchCommand

REMEMBERED_COMMANDS = 32  # number of executed commands that are remembered
LATE_NS = 1_000_000_000  # a command that arrives later after its stamp is rejected
MAX_AT_ONCE = 100  # commands without a stamp that may wait for the next step
MAX_PLANNED = 1000  # commands that may wait for their stamps

Stamped = tuple[int | None, str, float]  # twin time [ns] (None: at once), kind and value


class CommandQueue:
    """Queue of one kind of commands; `offer` takes them, `due` returns them."""

    def __init__(self, name: str) -> None:
        """Create a queue for the input of this name in counts and diagnostics."""
        self.counter = InputCounter(name)
        self.waiting: deque[Stamped] = deque()
        self._newest_ns: int | None = None
        self._at_once_ns: int | None = None  # arrival of the newest command without a stamp
        self._done: deque[Stamped] = deque(maxlen=REMEMBERED_COMMANDS)
        self._in_doubt = False  # whether waiting commands are from before a pause

    def invalidate(self) -> None:
        """Let the commander's first new stamp replace the waiting commands, after a pause.

        Commands that it repeats from before the pause are known and no fault.
        """
        self._in_doubt = True

    def offer(self, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> str:
        """Queue a command with a valid value (stamp None: at once); return "" or the rejection.

        A command that arrives less than LATE_NS after its stamp is executed at once and reported as
        late. An emergency stop is never rejected for its stamp, nor for a full queue.
        """
        urgent = command.kind == EMERGENCY_STOP
        if stamp_ns is not None:
            if self._in_doubt and (stamp_ns, *command) in self._done:
                return ""
            if self._in_doubt and now_ns <= stamp_ns <= now_ns + AHEAD_NS:
                self._drop_from(stamp_ns)
            fault = self._stamp_fault(stamp_ns, now_ns)
            if fault is not None and not urgent:
                return self.counter.refuse(*fault)
            if fault is not None:
                self._warn_late(
                    f"{fault[1].removesuffix('.')}; executed at once all the same", now_ns
                )
                stamp_ns = None
            elif stamp_ns < now_ns:
                late_ms = (now_ns - stamp_ns) * 1e-6
                what = f"'{command.kind}' came {late_ms:.0f} ms after its stamp"
                right = "it is executed at once; raise the input delay by more than that"
                self._warn_late(phrase("winch command", what, right), now_ns)
        one = (stamp_ns, command.kind, float(command.value))
        if full := self._is_full(one):
            return self.counter.refuse("impossible", full)
        self.counter.accept(now_ns if stamp_ns is None else stamp_ns)
        if stamp_ns is None:
            self._at_once_ns = now_ns
        else:
            self._newest_ns = stamp_ns
        if not (urgent and one in self.waiting):
            self._queue(one)
        return ""

    def _stamp_fault(self, stamp_ns: int, now_ns: int) -> tuple[str, str] | None:
        """Return the kind and message of a rejection for its stamp; None: it is valid."""
        newest_ns, at_once_ns = self._newest_ns, self._at_once_ns
        stamp_s = f"stamp {stamp_ns * 1e-9:.3f} s"
        if stamp_ns == newest_ns:
            right = "each command needs a stamp of its own, or none"
            return "repeated", phrase("winch command", f"{stamp_s} came twice", right)
        if newest_ns is not None and stamp_ns < newest_ns:
            what = f"{stamp_s} follows {newest_ns * 1e-9:.3f} s"
            right = "commands must come in the order of their stamps"
            return "late", phrase("winch command", what, right)
        if stamp_ns <= now_ns - LATE_NS:
            what, right = too_late(stamp_ns, now_ns)
            return "late", phrase("winch command", what, f"{right}, or leave the stamp 0")
        if stamp_ns < now_ns and at_once_ns is not None and stamp_ns < at_once_ns:
            what = f"{stamp_s} lies before a command that was executed at once"
            return "late", phrase("winch command", what, "give a stamp that is still to come")
        if stamp_ns > now_ns + AHEAD_NS:
            return "impossible", too_far_ahead("winch command", stamp_ns, now_ns)
        return None

    def _warn_late(self, sentence: str, now_ns: int) -> None:
        self.counter.executed_late += 1
        self.counter.warn(sentence, now_ns)

    def _is_full(self, one: Stamped) -> str:
        """Return why no more commands like this one can wait; "" if they can."""
        if one[1] == EMERGENCY_STOP:
            return ""
        most = MAX_AT_ONCE if one[0] is None else MAX_PLANNED
        if len(self.waiting) < most:
            return ""
        what = f"{len(self.waiting)} of them wait already"
        return phrase("winch command", what, "send commands when they change, or ten a second")

    def forget_plan(self) -> None:
        """Drop commands that wait for their stamps, except stops, as the commander has changed."""
        kept = (one for one in self.waiting if one[0] is None or one[1] == EMERGENCY_STOP)
        self.waiting = deque(kept)
        self._newest_ns = None

    def put_at_once(self, command: WinchCommand, now_ns: int) -> None:
        """Execute a command of the twin itself at once."""
        self._at_once_ns = now_ns
        self._queue((None, command.kind, float(command.value)))

    def _queue(self, one: Stamped) -> None:
        """Append a command; one without a stamp replaces the planned ones."""
        if one[0] is None:
            self.waiting.clear()
            self._newest_ns = None
        self.waiting.append(one)

    def due(self, time_ns: int) -> list[WinchCommand]:
        """Return the commands with stamps up to `time_ns`, in order, and remove them."""
        found: list[WinchCommand] = []
        while self.waiting and _is_due(self.waiting[0], time_ns):
            self._done.append(self.waiting.popleft())
            found.append(WinchCommand(*self._done[-1][1:]))
        return found

    def last_due(self, time_ns: int) -> WinchCommand | None:
        """Return the last of the commands that `due` would return; None: none is due."""
        last = None
        for one in self.waiting:
            if not _is_due(one, time_ns):
                break
            last = one
        return None if last is None else WinchCommand(*last[1:])

    def _drop_from(self, stamp_ns: int) -> None:
        """Drop commands that wait for this time or later; earlier ones stay."""
        self.waiting = deque(one for one in self.waiting if one[0] is None or one[0] < stamp_ns)
        self._newest_ns = self.waiting[-1][0] if self.waiting else None
        self._in_doubt = False


class SwitchQueue(CommandQueue):
    """Queue of switches: one for at once goes ahead of planned ones and keeps them."""

    def _queue(self, one: Stamped) -> None:
        """Insert a switch without a stamp after the others without one; append a planned one."""
        if one[0] is not None:
            self.waiting.append(one)
            return
        ahead = sum(waiting[0] is None for waiting in self.waiting)
        self.waiting.insert(ahead, one)


def _is_due(one: Stamped, time_ns: int) -> bool:
    return one[0] is None or one[0] <= time_ns
