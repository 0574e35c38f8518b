"""Health of an input: counts of its samples, a stuck sender, and the sender's clock."""

from __future__ import annotations

import math
from collections import Counter, deque
from typing import NamedTuple

from rope_twin.errors import phrase
from rope_twin.twin.snapshot import InputHealth

AHEAD_NS = 10_000_000_000  # a stamp farther in the future is a clock that is wrong
RECENT_NS = 60_000_000_000  # refusals and warnings of so long ago still make the status a warning
STUCK_NS = 1_000_000_000  # equal values for this long are a fault of the sender
STUCK_SAMPLES = 3  # fewest equal samples that are one, however slowly they come
CLOCK_SAMPLES = 100  # offsets that are kept ...
CLOCK_SAMPLES_MIN = 10  # ... and fewest from which an offset is reported
CLOCK_QUANTILE = 0.1  # of the offsets: transport delays only ever add to the clocks' difference
CLOCK_WARN_S, CLOCK_ERROR_S = 0.2, 1.0
SENDER_LEAD_S = 0.2  # a replay publishes its samples this long before their time


def too_far_ahead(what: str, stamp_ns: int, now_ns: int) -> str:
    """The refusal of a sample from so far in the future."""
    ahead = f"stamp {stamp_ns * 1e-9:.1f} s lies {(stamp_ns - now_ns) * 1e-9:.1f} s ahead"
    return phrase(what, ahead, "sender and twin must share one clock")


def too_late(stamp_ns: int, now_ns: int, due: str = "due") -> tuple[str, str]:
    """What is wrong with a sample whose time has passed, and what would be right.

    What is later than a delay could make it has its stamp by another clock.
    """
    late_ns = now_ns - stamp_ns
    if late_ns > AHEAD_NS:
        behind = f"stamp {stamp_ns * 1e-9:.1f} s lies {late_ns * 1e-9:.1f} s back"
        return behind, "sender and twin must share one clock"
    late = f"it came {late_ns * 1e-6:.0f} ms after it was {due}"
    return late, "raise the input delay by more than that"


class Judgement(NamedTuple):
    """Faults and warnings of an input, beyond what its counts say."""

    fault: str = ""
    warning: str = ""
    clock_offset_s: float | None = None
    interval_s: float | None = None


UNJUDGED = Judgement()
NOTHING_CAME = InputHealth()
_KINDS = ("accepted", "late", "repeated", "non_finite", "impossible", "stuck", "unconfirmed")


class InputCounter:
    """Counts of one input; `refuse` returns its sentence so that callers can pass it on."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._counts = Counter(dict.fromkeys(_KINDS, 0))
        self._newest_ns: int | None = None
        self._refusal = ""
        self._remark = ""
        self._refused = 0
        self._warning, self._warned_ns = "", 0
        self.executed_late = 0  # accepted commands that came after their stamp
        self._dated = 0  # refusals that have a time in `_recent`
        self._recent: deque[tuple[int, int]] = deque()  # second, refusals in it

    @property
    def accepted(self) -> int:
        """Samples so far that were good."""
        return self._counts["accepted"]

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest accepted sample [ns]."""
        return self._newest_ns

    def accept(self, stamp_ns: int) -> None:
        """Count a good sample."""
        self._counts["accepted"] += 1
        self._newest_ns = stamp_ns

    def refuse(self, kind: str, sentence: str) -> str:
        """Count a refused sample: late, repeated, non_finite, impossible, stuck or unconfirmed."""
        self._counts[kind] += 1
        self._refused += 1
        self._refusal = sentence
        return sentence

    def warn(self, sentence: str, now_ns: int) -> None:
        """Report a sample that was accepted but is suspicious, for RECENT_NS."""
        self._warning, self._warned_ns = sentence, now_ns

    def say(self, remark: str) -> None:
        """What is being done about the input at the moment; "" if nothing."""
        self._remark = remark

    @property
    def refused(self) -> int:
        """Samples so far that were refused."""
        return self._refused

    def health(self, now_ns: int, stale: bool, judged: Judgement = UNJUDGED) -> InputHealth:
        """Return a frozen copy; the age is that of the newest accepted sample.

        A refusal counts as recent from the first call after it, for RECENT_NS of twin time.
        """
        if self._newest_ns is None and judged is UNJUDGED and self._is_untouched():
            return NOTHING_CAME
        age = float("inf") if self._newest_ns is None else (now_ns - self._newest_ns) * 1e-9
        counts = self._counts
        return InputHealth(
            accepted=counts["accepted"],
            late=counts["late"],
            repeated=counts["repeated"],
            non_finite=counts["non_finite"],
            impossible=counts["impossible"],
            stuck=counts["stuck"],
            unconfirmed=counts["unconfirmed"],
            recently_refused=self._refused_recently(now_ns) if self._refused else 0,
            age_s=age,
            stale=stale,
            fault=judged.fault,
            clock_offset_s=judged.clock_offset_s,
            interval_s=judged.interval_s,
            note=self._remark or self._refusal,
            refusal=self._refusal,
            executed_late=self.executed_late,
            warning=judged.warning or self._warned(now_ns),
        )

    def _is_untouched(self) -> bool:
        return not (self._refused or self._remark or self._warning)

    def _warned(self, now_ns: int) -> str:
        return self._warning if now_ns - self._warned_ns < RECENT_NS else ""

    def _refused_recently(self, now_ns: int) -> int:
        second, new = now_ns // 1_000_000_000, self._refused - self._dated
        self._dated += new
        if new and self._recent and self._recent[-1][0] == second:
            new += self._recent.pop()[1]
        if new:
            self._recent.append((second, new))
        while self._recent and self._recent[0][0] * 1_000_000_000 < now_ns - RECENT_NS:
            self._recent.popleft()
        return sum(count for _, count in self._recent)


class StuckDetector:
    """Equal values with rising stamps: a sender that repeats its last measurement for ever.

    A sensor has noise in its last digit, so samples whose numbers are all equal for STUCK_NS are
    no measurements (PX4 counts equal values of its sensors likewise).
    """

    def __init__(self) -> None:
        self._values: tuple[float, ...] = ()
        self._since_ns = 0
        self._equal = 0
        self.varied = False  # whether the values have ever changed

    def is_stuck(self, stamp_ns: int, values: tuple[float, ...]) -> bool:
        """Take a sample; return whether its values have been equal for STUCK_NS."""
        if values != self._values:
            self.varied = bool(self._values)
            self._values, self._since_ns, self._equal = values, stamp_ns, 1
            return False
        self._equal += 1
        return stamp_ns - self._since_ns >= STUCK_NS and self._equal >= STUCK_SAMPLES


class SenderClock:
    """Offset of a sender's clock: arrival less stamp [ns], the lower quantile of the newest.

    A live sensor is late, by the transport delay, never early. A replay publishes each sample
    before its time: it may be early by `lead_s`. Whatever lies beyond is the sender's clock.
    """

    def __init__(self) -> None:
        self.lead_s = SENDER_LEAD_S
        self.correct = False  # whether stamps are corrected by the offset
        self._offsets: deque[int] = deque(maxlen=CLOCK_SAMPLES)
        self._shift_ns = 0  # what is added to the stamps at present

    def take(self, stamp_ns: int, received_ns: int) -> None:
        """Take the stamp and the arrival of a sample, both in twin time."""
        self._offsets.append(received_ns - stamp_ns)

    @property
    def offset_s(self) -> float:
        """Arrival less stamp [s]; NaN while too few samples came with their time of arrival."""
        return self._quantile_s(CLOCK_QUANTILE)

    @property
    def lateness_s(self) -> float:
        """Arrival less corrected stamp of the later samples [s]; 0 while it is not known."""
        late_s = self._quantile_s(1.0 - CLOCK_QUANTILE)
        return 0.0 if math.isnan(late_s) else max(0.0, late_s - self._shift_ns * 1e-9)

    @property
    def excess_s(self) -> float:
        """Offset beyond that of a sender with a right clock [s]: + late, - early; 0: none."""
        offset_s = self.offset_s
        if math.isnan(offset_s):
            return 0.0
        return offset_s if offset_s > 0.0 else min(0.0, offset_s + self.lead_s)

    def shift_ns(self) -> tuple[int, bool]:
        """Return what to add to stamps [ns], and whether that is another than for the last."""
        if not self.correct:
            return 0, False
        excess_s, before_ns = self.excess_s, self._shift_ns
        offset_s = self.offset_s
        if abs(excess_s) <= CLOCK_WARN_S:
            self._shift_ns = 0
        elif abs(offset_s - before_ns * 1e-9) > CLOCK_WARN_S:
            self._shift_ns = round(offset_s * 1e9)
        return self._shift_ns, self._shift_ns != before_ns

    def fault(self) -> tuple[str, bool]:
        """Return what is wrong with the sender's clock, or "", and whether that is an error."""
        excess_s = self.excess_s
        if abs(excess_s) <= CLOCK_WARN_S:
            return "", False
        if excess_s > 0.0:
            what = (
                f"samples arrive {self.offset_s:.2f} s after their stamps: the sender's clock is "
                "behind, or its link slow"
            )
        else:
            what = (
                f"stamps lie {-self.offset_s:.2f} s ahead of their arrival, {self.lead_s:g} s are "
                "allowed: the sender's clock is ahead"
            )
        if self._shift_ns:
            return f"{what}; its stamps are corrected by {self._shift_ns * 1e-9:+.2f} s", False
        right = "synchronise the clocks, or set correct_sender_clocks"
        return f"{what}; {right}", abs(excess_s) > CLOCK_ERROR_S

    def _quantile_s(self, share: float) -> float:
        if len(self._offsets) < CLOCK_SAMPLES_MIN:
            return math.nan
        return sorted(self._offsets)[int(share * (len(self._offsets) - 1))] * 1e-9
