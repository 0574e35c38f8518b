"""How often alerts come, against what a crew can deal with (EEMUA 191, ISA-18.2).

An alert comes when an alarm or warning becomes active, or becomes active again; cautions call for
nobody and are counted beside. The guide's figures for one operator: about one alert in 10 min in
steady operation, a flood above 10 in 10 min, and hardly any that stand for a day. An alert that
comes 3 times within a minute chatters.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from rope_twin.alerts.alert_list import SECOND, Alert, Priority

WINDOW_NS = 600 * SECOND
FLOOD = 10  # more than so many in a window
STEADY = 1.0  # at most so many in a window, in a normal lift
CHATTER, CHATTER_NS = 3, 60 * SECOND


@dataclass(frozen=True)
class Coming:
    """Activation of one alert."""

    key: str
    name: str
    priority: Priority
    at_ns: int  # twin time
    text: str
    acknowledged_after_s: float | None = None  # None: not in the recording


@dataclass(frozen=True)
class AlertRates:
    """Rates of a recording."""

    duration_s: float
    comings: tuple[Coming, ...]  # alarms and warnings, in their order
    cautions: int
    most_in_window: int  # largest number within any 10 min
    standing: tuple[str, ...]  # keys of those active for a day
    chattering: tuple[str, ...]  # keys
    by_name: dict[str, int] = field(default_factory=dict)

    @property
    def per_window(self) -> float:
        """Alarms and warnings per 10 min, over the whole recording; of a shorter one, in all."""
        windows = max(1.0, self.duration_s * SECOND / WINDOW_NS)
        return len(self.comings) / windows

    @property
    def flood(self) -> bool:
        """Whether more came within 10 min than anybody can deal with."""
        return self.most_in_window > FLOOD


def rates(lists: Iterable[tuple[int, tuple[Alert, ...]]], end_ns: int) -> AlertRates:
    """Count the activations in a series of published lists.

    Args:
        lists: twin time [ns] and alerts of each message, in their order.
        end_ns: twin time of the end of the recording; it began at 0.
    """
    begun: dict[tuple[str, int], Coming] = {}  # by key and time of activation
    cautions: set[tuple[str, int]] = set()
    standing: dict[str, None] = {}
    for now_ns, alerts in lists:
        for one in alerts:
            at = one.key, one.since_ns
            if one.standing(now_ns):
                standing[one.key] = None
            if one.priority is Priority.CAUTION:
                cautions.add(at)
                continue
            known = begun.get(at)
            if known is None:
                known = Coming(one.key, one.name, one.priority, one.since_ns, one.text)
            after = known.acknowledged_after_s
            if after is None and not one.waits:
                after = (one.changed_ns - one.since_ns) / SECOND
            highest = max(known.priority, one.priority)
            begun[at] = Coming(one.key, one.name, highest, one.since_ns, known.text, after)
    comings = tuple(sorted(begun.values(), key=lambda one: (one.at_ns, one.key)))
    return AlertRates(
        duration_s=end_ns / SECOND,
        comings=comings,
        cautions=len(cautions),
        most_in_window=_most([one.at_ns for one in comings], WINDOW_NS),
        standing=tuple(standing),
        chattering=_chattering(comings),
        by_name=dict(Counter(one.name for one in comings).most_common()),
    )


def _most(times_ns: list[int], window_ns: int) -> int:
    """Return the largest number of times within a window; they are in order."""
    first = most = 0
    for last, time_ns in enumerate(times_ns):
        while times_ns[first] <= time_ns - window_ns:
            first += 1
        most = max(most, last - first + 1)
    return most


def _chattering(comings: tuple[Coming, ...]) -> tuple[str, ...]:
    """Return the keys of alerts that come again and again."""
    times: dict[str, list[int]] = {}
    for one in comings:
        times.setdefault(one.key, []).append(one.at_ns)
    return tuple(key for key, some in times.items() if _most(some, CHATTER_NS) >= CHATTER)
