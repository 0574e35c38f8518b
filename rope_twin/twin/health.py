"""Health of an input: counts of its samples, detection of a stuck sender, the sender's clock."""

from __future__ import annotations

import math
from collections import Counter, deque
from itertools import islice
from typing import NamedTuple

from rope_twin.twin.snapshot import InputHealth

AHEAD_NS = 10_000_000_000  # a stamp further in the future means a wrong clock
RECENT_NS = 60_000_000_000  # rejections and warnings set the status to WARN for this long
STUCK_NS = 1_000_000_000  # equal values for this long indicate a fault of the sender
STUCK_SAMPLES = 3  # minimum number of equal samples, however slowly they arrive
CLOCK_SAMPLES = 100  # number of offsets kept
CLOCK_SAMPLES_MIN = 10  # minimum number of offsets to report one
CLOCK_QUANTILE = 0.1  # of the offsets: transport delays only add to the clocks' difference
MIN_AGREEING_SAMPLES = 3  # of a step of the clock, or an early clock: more than one wrong stamp
CLOCK_WARN_S, CLOCK_ERROR_S = 0.2, 1.0
CLOCK_WARN_NS = 200_000_000  # also the smallest step recognised, and the largest scatter for it
CLOCK_JITTER_NS = 50_000_000  # jitter of the offsets by the sender's link
SENDER_LEAD_S = 0.2  # a replay publishes its samples this long before their time


def too_far_ahead(stamp_ns: int, now_ns: int) -> tuple[str, str]:
    """Return problem and remedy of a sample from too far in the future."""
    problem = f"stamp {stamp_ns * 1e-9:.1f} s lies {(stamp_ns - now_ns) * 1e-9:.1f} s ahead"
    return problem, "sender and twin must share one clock, and the twin must not be behind"


def too_late(stamp_ns: int, now_ns: int, due: str = "due") -> tuple[str, str]:
    """Return problem and remedy of a sample whose time has passed.

    A sample later than any delay can explain is stamped by another clock.
    """
    late_ns = now_ns - stamp_ns
    if late_ns > AHEAD_NS:
        problem = f"stamp {stamp_ns * 1e-9:.1f} s lies {late_ns * 1e-9:.1f} s back"
        return problem, "sender and twin must share one clock, a replay the twin's epoch"
    problem = f"it came {late_ns * 1e-6:.0f} ms after it was {due}"
    return problem, "raise the input delay by more than that"


class InputAssessment(NamedTuple):
    """Faults and warnings of an input beyond its counts."""

    fault: str = ""
    warning: str = ""
    clock_offset_s: float | None = None
    interval_s: float | None = None


UNJUDGED = InputAssessment()
NOTHING_CAME = InputHealth()
_KINDS = ("accepted", "late", "repeated", "non_finite", "impossible", "stuck", "unconfirmed")


class InputCounter:
    """Counts of the samples of one input; `refuse` returns its message for the caller."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._counts = Counter(dict.fromkeys(_KINDS, 0))
        self._newest_ns: int | None = None
        self._refusal = ""
        self._remark = ""
        self._refused = 0
        self._warning, self._warned_ns = "", 0
        self.executed_late = 0  # accepted commands that arrived after their stamp
        self._dated = 0  # rejections that have a time in `_recent`
        self._recent: deque[tuple[int, int]] = deque()  # second, rejections in it

    @property
    def accepted(self) -> int:
        """Number of accepted samples since the start."""
        return self._counts["accepted"]

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest accepted sample [ns]."""
        return self._newest_ns

    def accept(self, stamp_ns: int) -> None:
        """Count an accepted sample."""
        self._counts["accepted"] += 1
        self._newest_ns = stamp_ns

    def refuse(self, kind: str, sentence: str) -> str:
        """Count a rejected sample; return the sentence.

        kind: late, repeated, non_finite, impossible, stuck or unconfirmed.
        """
        self._counts[kind] += 1
        self._refused += 1
        self._refusal = sentence
        return sentence

    def warn(self, sentence: str, now_ns: int) -> None:
        """Report for RECENT_NS an accepted sample that is suspicious."""
        self._warning, self._warned_ns = sentence, now_ns

    def set_note(self, remark: str) -> None:
        """Set the note on the present handling of the input; "" clears it."""
        self._remark = remark

    @property
    def refused(self) -> int:
        """Number of rejected samples since the start."""
        return self._refused

    def health(self, now_ns: int, stale: bool, judged: InputAssessment = UNJUDGED) -> InputHealth:
        """Return a frozen copy; its age is that of the newest accepted sample.

        A rejection counts as recent from the first call after it, for RECENT_NS of twin time.
        """
        touched = self._refused or self._remark or self._warning
        if self._newest_ns is None and judged is UNJUDGED and not touched:
            return NOTHING_CAME
        age = float("inf") if self._newest_ns is None else (now_ns - self._newest_ns) * 1e-9
        warning = self._warning if now_ns - self._warned_ns < RECENT_NS else ""
        return InputHealth(
            **self._counts,
            recently_refused=self._refused_recently(now_ns) if self._refused else 0,
            age_s=age,
            stale=stale,
            fault=judged.fault,
            clock_offset_s=judged.clock_offset_s,
            interval_s=judged.interval_s,
            note=self._remark or self._refusal,
            refusal=self._refusal,
            executed_late=self.executed_late,
            warning=judged.warning or warning,
        )

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
    """Detector of equal values with rising stamps: a sender that repeats its last measurement.

    A sensor has noise in its last digit, so samples whose numbers are all equal for STUCK_NS are
    not measurements (PX4 counts equal values of its sensors in the same way).
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
    """Offset of a sender's clock: arrival minus stamp [ns], a low quantile of the newest samples.

    A live sensor is late by the transport delay and never early, so three early samples decide,
    where it takes many late ones. A replay publishes each sample up to `lead_s` before its time.
    Any offset beyond these is an error of the sender's clock.

    A step of the clock changes the offset from one sample to the next: forward by more than a link
    can make good, or back, with stamps that run backwards, which no link causes. Samples are
    rejected until MIN_AGREEING_SAMPLES of them agree on the step. From then on their stamps are
    corrected by it, so that the motion continues without a gap, unless the step has corrected the
    clock.
    """

    def __init__(self) -> None:
        self.lead_s = SENDER_LEAD_S
        self.correct = False  # whether stamps are corrected by the offset
        self._offsets: deque[int] = deque(maxlen=CLOCK_SAMPLES)
        self._shift_ns = 0  # correction added to the stamps at present
        self._newest_ns = -(10**18)  # stamp of the newest sample, as sent
        self._apart: list[int] = []  # offsets of consecutive samples that differ by a step
        self._stepped_ns = 0  # twin time of the newest step
        self._is_broken = False  # whether its correction leaves a gap in the times of the motion
        self.mended = ""  # message on a step that has corrected the clock, until it is read

    def take(self, stamp_ns: int, received_ns: int) -> float:
        """Take the stamp and the arrival of a sample, both in twin time [ns].

        Returns:
            Unconfirmed step of its stamp [s] against earlier stamps: + ahead; 0: none.
        """
        offset_ns, backwards = received_ns - stamp_ns, stamp_ns < self._newest_ns
        self._newest_ns = stamp_ns
        newest = list(islice(reversed(self._offsets), CLOCK_SAMPLES_MIN))
        usual_ns = min(newest, default=0)
        later_ns = offset_ns - usual_ns
        is_steady = len(newest) == CLOCK_SAMPLES_MIN and max(newest) - usual_ns <= CLOCK_WARN_NS
        is_apart = later_ns < -CLOCK_WARN_NS or (
            later_ns > CLOCK_WARN_NS and (backwards or bool(self._apart))
        )
        if self.correct or not (is_steady and is_apart and abs(later_ns) <= AHEAD_NS):
            self._apart.clear()
            self._offsets.append(offset_ns)
            return 0.0
        if self._apart and abs(offset_ns - self._apart[0]) > CLOCK_WARN_NS:
            self._apart.clear()
        self._apart.append(offset_ns)
        if len(self._apart) < MIN_AGREEING_SAMPLES:
            return -later_ns * 1e-9
        self._step(usual_ns, received_ns)
        return 0.0

    def expect_repeats(self) -> None:
        """Expect stamps from before a pause again: as they run backwards its clock has not stepped.

        A correction of the stamps remains.
        """
        self._newest_ns = -(10**18)
        self._apart.clear()

    def _step(self, usual_ns: int, now_ns: int) -> None:
        """Correct the stamps by a step from the usual offset to that of the newest samples."""
        step_ns = min(self._apart) - usual_ns
        was_wrong = abs(self._excess_s(usual_ns * 1e-9)) > CLOCK_WARN_S
        is_right = abs(self._excess_s((usual_ns + step_ns) * 1e-9)) <= CLOCK_WARN_S
        continued_ns = self._shift_ns + step_ns
        self._shift_ns = 0 if was_wrong and is_right else continued_ns
        if abs(self._shift_ns) < CLOCK_JITTER_NS:
            self._shift_ns = 0
        self._is_broken = abs(self._shift_ns - continued_ns) > CLOCK_JITTER_NS
        self._stepped_ns = now_ns
        if not self._shift_ns:
            self.mended = (
                f"the sender's clock stepped by {-step_ns * 1e-9:+.2f} s at {now_ns * 1e-9:.1f} s, "
                "its stamps need no correction"
            )
        while len(self._apart) < CLOCK_SAMPLES_MIN:  # repeated in place of samples to come
            self._apart.append(self._apart[0])
        self._offsets.clear()
        self._offsets.extend(self._apart)
        self._apart.clear()

    @property
    def offset_s(self) -> float:
        """Arrival minus stamp [s]; NaN while too few samples came with their time of arrival."""
        if len(self._offsets) < CLOCK_SAMPLES_MIN:
            return math.nan
        low_ns = sorted(self._offsets)[int(CLOCK_QUANTILE * (len(self._offsets) - 1))]
        newest = sorted(islice(reversed(self._offsets), CLOCK_SAMPLES_MIN))
        return min(low_ns * 1e-9, newest[MIN_AGREEING_SAMPLES - 1] * 1e-9)

    @property
    def lateness_s(self) -> float:
        """Arrival minus corrected stamp of the later samples [s]; 0 while unknown.

        A stamp of another clock, such as 0, is no measure of a delay.
        """
        offsets = sorted(offset for offset in self._offsets if abs(offset) <= AHEAD_NS)
        if len(offsets) < CLOCK_SAMPLES_MIN:
            return 0.0
        late_ns = offsets[int((1.0 - CLOCK_QUANTILE) * (len(offsets) - 1))]
        return max(0.0, (late_ns - self._shift_ns) * 1e-9)

    @property
    def excess_s(self) -> float:
        """Offset beyond that of a sender with a correct clock [s]: + late, - early; 0: none."""
        offset_s = self.offset_s
        return 0.0 if math.isnan(offset_s) else self._excess_s(offset_s)

    def _excess_s(self, offset_s: float) -> float:
        return offset_s if offset_s > 0.0 else min(0.0, offset_s + self.lead_s)

    def shift_ns(self) -> tuple[int, bool]:
        """Return the correction of stamps [ns], and whether its change since the last call leaves a
        gap in the times of the motion.
        """
        if not self.correct:
            is_broken, self._is_broken = self._is_broken, False
            return self._shift_ns, is_broken
        excess_s, before_ns = self.excess_s, self._shift_ns
        offset_s = self.offset_s
        if abs(excess_s) <= CLOCK_WARN_S:
            self._shift_ns = 0
        elif abs(offset_s - before_ns * 1e-9) > CLOCK_WARN_S:
            self._shift_ns = round(offset_s * 1e9)
        return self._shift_ns, self._shift_ns != before_ns

    def fault(self) -> tuple[str, bool]:
        """Return the fault of the sender's clock, or "", and whether it is an error."""
        excess_s = self.excess_s
        stepped = not self.correct and self._shift_ns
        if abs(excess_s) <= CLOCK_WARN_S and not stepped:
            return "", False
        if abs(excess_s) <= CLOCK_WARN_S:
            problem = "the sender's clock has stepped"
        elif excess_s > 0.0:
            problem = (
                f"samples arrive {self.offset_s:.2f} s after their stamps: the sender's clock is "
                "behind, or its link slow"
            )
        else:
            problem = (
                f"stamps lie {-self.offset_s:.2f} s ahead of their arrival, {self.lead_s:g} s are "
                "allowed: the sender's clock is ahead"
            )
        if self._shift_ns:
            since = f" since its step at {self._stepped_ns * 1e-9:.1f} s" if stepped else ""
            shift = f"{self._shift_ns * 1e-9:+.2f} s{since}"
            return f"{problem}; its stamps are corrected by {shift}", False
        remedy = "synchronise the clocks, or set correct_sender_clocks"
        return f"{problem}; {remedy}", abs(excess_s) > CLOCK_ERROR_S
