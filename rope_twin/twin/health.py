"""What becomes of an input's samples: counted, with the newest refusal in words."""

from __future__ import annotations

from collections import Counter

from rope_twin.errors import phrase
from rope_twin.twin.snapshot import InputHealth

AHEAD_NS = 10_000_000_000  # a stamp farther in the future is a clock that is wrong


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


class InputCounter:
    """Counts of one input; `refuse` returns its sentence so that callers can pass it on."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._counts: Counter[str] = Counter()
        self._newest_ns: int | None = None
        self._refusal = ""
        self._remark = ""

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
        """Count a refused sample: late, repeated, non_finite or impossible."""
        self._counts[kind] += 1
        self._refusal = sentence
        return sentence

    def say(self, remark: str) -> None:
        """What is being done about the input at the moment; "" if nothing."""
        self._remark = remark

    def health(self, now_ns: int, stale: bool) -> InputHealth:
        """A frozen copy; the age is that of the newest accepted sample."""
        age = float("inf") if self._newest_ns is None else (now_ns - self._newest_ns) * 1e-9
        counts = self._counts
        return InputHealth(
            accepted=counts["accepted"],
            late=counts["late"],
            repeated=counts["repeated"],
            non_finite=counts["non_finite"],
            impossible=counts["impossible"],
            age_s=max(age, 0.0),
            stale=stale,
            note=self._remark or self._refusal,
            refusal=self._refusal,
        )
