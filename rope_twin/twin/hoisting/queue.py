"""Orders on their way to a winch: judged by their stamps, kept until they are due."""

from __future__ import annotations

from collections import deque

from rope_twin.errors import phrase
from rope_twin.twin.health import AHEAD_NS, InputCounter, too_far_ahead, too_late
from rope_twin.twin.hoisting.orders import Order

DONE = 32  # orders that are remembered after they took effect

Stamped = tuple[int | None, str, float]  # twin time [ns] (None: at once), kind and value


class OrderQueue:
    """Orders of one sort; `offer` takes them in, `due` gives them out."""

    def __init__(self, name: str) -> None:
        """`name`: of the input, in counts and diagnostics."""
        self.counter = InputCounter(name)
        self.waiting: deque[Stamped] = deque()
        self._newest_ns: int | None = None
        self._done: deque[Stamped] = deque(maxlen=DONE)
        self._in_doubt = False  # whether what waits is from before a pause

    def doubt(self) -> None:
        """Who commands was away: from its first new stamp on, its new plan replaces the old.

        What it repeats of the time before is known and no fault.
        """
        self._in_doubt = True

    def offer(self, stamp_ns: int | None, order: Order, now_ns: int) -> str:
        """Take an order (None: at once) whose value is sound; "" or the sentence of its refusal."""
        refuse = self.counter.refuse
        if stamp_ns is not None:
            if self._in_doubt and (stamp_ns, *order) in self._done:
                return ""
            if self._in_doubt and now_ns <= stamp_ns <= now_ns + AHEAD_NS:
                self._drop_from(stamp_ns)
            if stamp_ns == self._newest_ns:
                return refuse("repeated", phrase(
                    "winch command", f"stamp {stamp_ns * 1e-9:.3f} s came twice",
                    "each command needs a stamp of its own, or none"))  # fmt: skip
            if self._newest_ns is not None and stamp_ns < self._newest_ns:
                return refuse("late", phrase(
                    "winch command",
                    f"stamp {stamp_ns * 1e-9:.3f} s follows {self._newest_ns * 1e-9:.3f} s",
                    "commands must come in the order of their stamps"))  # fmt: skip
            if stamp_ns < now_ns:
                what, right = too_late(stamp_ns, now_ns)
                right += ", or leave the stamp 0"
                return refuse("late", phrase("winch command", what, right))
            if stamp_ns > now_ns + AHEAD_NS:
                return refuse("impossible", too_far_ahead("winch command", stamp_ns, now_ns))
            self._newest_ns = stamp_ns
        self.counter.accept(now_ns if stamp_ns is None else stamp_ns)
        self._queue((stamp_ns, order.kind, float(order.value)))
        return ""

    def _queue(self, one: Stamped) -> None:
        """What an operator wants at once does not wait for a plan: it replaces it."""
        if one[0] is None:
            self.waiting.clear()
            self._newest_ns = None
        self.waiting.append(one)

    def due(self, time_ns: int) -> list[Order]:
        """The orders whose stamp is not after `time_ns`, in order; they are given out once."""
        found: list[Order] = []
        while self.waiting and _is_due(self.waiting[0], time_ns):
            self._done.append(self.waiting.popleft())
            found.append(Order(*self._done[-1][1:]))
        return found

    def last_due(self, time_ns: int) -> Order | None:
        """The last of those that `due` would give."""
        last = None
        for one in self.waiting:
            if not _is_due(one, time_ns):
                break
            last = one
        return None if last is None else Order(*last[1:])

    def _drop_from(self, stamp_ns: int) -> None:
        """Drop orders that wait for this time or later ones; what comes first stands."""
        self.waiting = deque(one for one in self.waiting if one[0] is None or one[0] < stamp_ns)
        self._newest_ns = self.waiting[-1][0] if self.waiting else None
        self._in_doubt = False


class SwitchQueue(OrderQueue):
    """Switches: one that is wanted at once goes ahead of planned ones, and these stand."""

    def _queue(self, one: Stamped) -> None:
        """After those that are wanted at once too."""
        if one[0] is not None:
            self.waiting.append(one)
            return
        ahead = sum(waiting[0] is None for waiting in self.waiting)
        self.waiting.insert(ahead, one)


def _is_due(one: Stamped, time_ns: int) -> bool:
    return one[0] is None or one[0] <= time_ns
