"""Orders on their way to a winch: judged by their stamps, kept until they are due."""

from __future__ import annotations

from collections import deque

from rope_twin.errors import phrase
from rope_twin.twin.health import AHEAD_NS, InputCounter, too_far_ahead, too_late
from rope_twin.twin.hoisting.orders import EMERGENCY_STOP, Order

DONE = 32  # orders that are remembered after they took effect
LATE_NS = 1_000_000_000  # an order that comes later after its stamp than this is refused
MAX_AT_ONCE = 100  # orders without a stamp that may wait for the next step
MAX_PLANNED = 1000  # orders that may wait for their stamps

Stamped = tuple[int | None, str, float]  # twin time [ns] (None: at once), kind and value


class OrderQueue:
    """Orders of one sort; `offer` takes them in, `due` gives them out."""

    def __init__(self, name: str) -> None:
        """`name`: of the input, in counts and diagnostics."""
        self.counter = InputCounter(name)
        self.waiting: deque[Stamped] = deque()
        self._newest_ns: int | None = None
        self._at_once_ns: int | None = None  # when the newest order without a stamp came
        self._done: deque[Stamped] = deque(maxlen=DONE)
        self._in_doubt = False  # whether what waits is from before a pause

    def doubt(self) -> None:
        """Who commands was away: from its first new stamp on, its new plan replaces the old.

        What it repeats of the time before is known and no fault.
        """
        self._in_doubt = True

    def offer(self, stamp_ns: int | None, order: Order, now_ns: int) -> str:
        """Take an order (None: at once) whose value is sound; "" or the sentence of its refusal.

        One that comes less than LATE_NS after its stamp is executed at once and reported as late.
        An emergency stop is never refused for its stamp, nor because too many wait.
        """
        urgent = order.kind == EMERGENCY_STOP
        if stamp_ns is not None:
            if self._in_doubt and (stamp_ns, *order) in self._done:
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
                what = f"'{order.kind}' came {late_ms:.0f} ms after its stamp"
                right = "it is executed at once; raise the input delay by more than that"
                self._warn_late(phrase("winch command", what, right), now_ns)
        one = (stamp_ns, order.kind, float(order.value))
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
        """How a stamp is counted for which an order is refused, and the sentence."""
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
        """Why no more orders like this one can wait, in one sentence; or ""."""
        if one[1] == EMERGENCY_STOP:
            return ""
        most = MAX_AT_ONCE if one[0] is None else MAX_PLANNED
        if len(self.waiting) < most:
            return ""
        what = f"{len(self.waiting)} of them wait already"
        return phrase("winch command", what, "send commands when they change, or ten a second")

    def forget_plan(self) -> None:
        """Drop what waits for its stamp, but for stops: another commander has a plan of its own."""
        kept = (one for one in self.waiting if one[0] is None or one[1] == EMERGENCY_STOP)
        self.waiting = deque(kept)
        self._newest_ns = None

    def put_at_once(self, order: Order, now_ns: int) -> None:
        """Execute an order at once that nobody has sent."""
        self._at_once_ns = now_ns
        self._queue((None, order.kind, float(order.value)))

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
