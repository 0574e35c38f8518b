"""Alert monitor: one alert list for a whole suite, its crews' commands, and how often alerts come.

The rates are held against what a crew can deal with (EEMUA 191, ISA-18.2). An alert comes when an
alarm or warning becomes active, or becomes active again; cautions call for nobody and are counted
beside. The guide's figures for one operator: about one alert in 10 min in steady operation, a flood
above 10 in 10 min, and hardly any that stand for a day. An alert that comes 3 times within a minute
chatters.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rope_twin.alerts.alert_list import ACTIONS, EVERY, SECOND, Alert, AlertList, Priority
from rope_twin.alerts.situations import SituationMonitor
from rope_twin.errors import InputError, did_you_mean
from rope_twin.messages.reports import Status
from rope_twin.scene.schema import Scene
from rope_twin.twin.snapshot import Snapshot

WINDOW_NS = 600 * SECOND
FLOOD = 10  # more than so many in a window
STEADY = 1.0  # at most so many in a window, in a normal lift
CHATTER, CHATTER_NS = 3, 60 * SECOND


@dataclass(frozen=True)
class Activation:
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
    comings: tuple[Activation, ...]  # alarms and warnings, in their order
    cautions: int
    max_in_window: int  # largest number within any 10 min
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
        return self.max_in_window > FLOOD


def rates(lists: Iterable[tuple[int, tuple[Alert, ...]]], end_ns: int) -> AlertRates:
    """Count the activations in a series of published lists.

    lists: twin time [ns] and alerts of each message, in their order; end_ns: twin time of the end
    of the recording, which began at 0.
    """
    begun: dict[tuple[str, int], Activation] = {}  # by key and time of activation
    cautions: set[tuple[str, int]] = set()
    standing: dict[str, None] = {}
    for now_ns, alerts in lists:
        for alert in alerts:
            at = alert.key, alert.since_ns
            if alert.standing(now_ns):
                standing[alert.key] = None
            if alert.priority is Priority.CAUTION:
                cautions.add(at)
                continue
            recorded = begun.get(at)
            if recorded is None:
                recorded = Activation(
                    alert.key, alert.name, alert.priority, alert.since_ns, alert.text
                )
            after = recorded.acknowledged_after_s
            if after is None and not alert.waits:
                after = (alert.changed_ns - alert.since_ns) / SECOND
            highest = max(recorded.priority, alert.priority)
            begun[at] = Activation(
                alert.key, alert.name, highest, alert.since_ns, recorded.text, after
            )
    comings = tuple(sorted(begun.values(), key=lambda one: (one.at_ns, one.key)))
    times: dict[str, list[int]] = {}
    for coming in comings:
        times.setdefault(coming.key, []).append(coming.at_ns)
    return AlertRates(
        duration_s=end_ns / SECOND,
        comings=comings,
        cautions=len(cautions),
        max_in_window=_most([coming.at_ns for coming in comings], WINDOW_NS),
        standing=tuple(standing),
        chattering=tuple(key for key, ns in times.items() if _most(ns, CHATTER_NS) >= CHATTER),
        by_name=dict(Counter(coming.name for coming in comings).most_common()),
    )


def _most(times_ns: list[int], window_ns: int) -> int:
    """Return the largest number of times within a window; they are in order."""
    first = largest = 0
    for last, time_ns in enumerate(times_ns):
        while times_ns[first] <= time_ns - window_ns:
            first += 1
        largest = max(largest, last - first + 1)
    return largest


SHELVE, UNSHELVE, LIMIT = "shelve", "unshelve", "limit"
COMMANDS = (*ACTIONS, SHELVE, UNSHELVE, LIMIT)
_EXAMPLES = {
    SHELVE: "shelve 10008.1 600",
    LIMIT: "limit tension_n 400000, or limit tension_n scene",
}
LONGEST = 200  # characters of a command: a mistake is quoted in full
REFRESH_NS = 1_000_000_000  # texts have figures that change; they are refreshed at this interval


class AlertMonitor:
    """Owns the alert list; snapshots and commands may come from different threads."""

    def __init__(self, scene: Scene) -> None:
        self._watch, self._list = SituationMonitor(scene), AlertList()
        self._lock = threading.Lock()
        self._refreshed_ns = -REFRESH_NS
        self._commanded = False
        self._begun = False  # a first list replaces that of a run before, which is latched

    def take_rows(self, rows: Sequence[Status]) -> None:
        """Take the newest rows of the diagnostics."""
        with self._lock:
            self._watch.take_rows(list(rows))

    def take_risks(self, rows: Sequence[Mapping[str, float]]) -> None:
        """Take the risks of the newest forecast, as forecast/risk has them."""
        with self._lock:
            self._watch.take_risks(rows)

    def memory(self) -> dict[str, Any]:
        """Return list, limits of the crew, delays and holds as JSON types."""
        with self._lock:
            crew, situations = self._watch.crew.memory(), self._watch.memory()
            return {"limits": crew, "situations": situations, **self._list.memory()}

    def restore(self, memory: Mapping[str, Any]) -> list[str]:
        """Continue with what `memory` returned; return why limits are left out, in sentences."""
        dropped = []
        with self._lock:
            self._list.restore(memory)
            self._watch.restore(memory["situations"])
            for name, value in memory["limits"].items():
                try:
                    self._watch.crew.set(name, repr(value))
                except InputError as error:  # the scene has a stricter one by now
                    dropped.append(str(error))
        return dropped

    def observe(self, snapshot: Snapshot) -> bool:
        """Judge a snapshot; return whether the list is to be published."""
        with self._lock:
            changed = bool(self._list.update(self._watch.observe(snapshot), snapshot.stamp_ns))
            changed = changed or self._commanded or not self._begun
            self._commanded, self._begun = False, True
            due = snapshot.stamp_ns - self._refreshed_ns >= REFRESH_NS
            if changed or (due and self._list.listed()):
                self._refreshed_ns = snapshot.stamp_ns
                return True
            return False

    def listed(self) -> tuple[int, list[Alert]]:
        """Return the time [ns], and the alerts in their order, shelved ones at the end."""
        with self._lock:
            return self._list.now_ns, [*self._list.listed(), *self._list.shelved()]

    def command(self, words: str) -> str:
        """Execute a command such as `acknowledge 10001.1`, `shelve 10008.2 600` or
        `limit tension_n 400000`.

        Returns the answer in words.

        Raises:
            InputError: there is no such command, alert or limit, or it is not possible now.
        """
        if len(words) > LONGEST:
            remedy = f"give {LONGEST} at most"
            raise InputError("alerts/command", f"a text of {len(words)} characters", remedy)
        verb, *arguments = words.split() or [""]
        if verb not in COMMANDS:
            remedy = did_you_mean(verb, COMMANDS)
            raise InputError("alerts/command", f"there is no '{verb}'", remedy)
        expected = 2 if verb in _EXAMPLES else 1
        if len(arguments) != expected:
            example = _EXAMPLES.get(verb, f"{verb} 10001.1, or {EVERY}")
            raise InputError("alerts/command", f"'{words}'", f"write {example}")
        with self._lock:
            answer = self._execute(verb, arguments)
            self._commanded = True
        return answer

    def row(self) -> Status:
        """Return the row of the diagnostics on the limits that the crew has set."""
        with self._lock:
            return self._watch.crew.row()

    def _execute(self, verb: str, arguments: list[str]) -> str:
        if verb == LIMIT:
            return self._watch.crew.set(*arguments)
        if verb == SHELVE:
            try:
                seconds = float(arguments[1])
            except ValueError:
                problem = f"'{arguments[1]}' is no time"
                raise InputError("alerts/command", problem, "give seconds") from None
            return self._list.shelve(arguments[0], seconds)
        if verb == UNSHELVE:
            return self._list.shelve(arguments[0], 0.0)
        return self._list.act(verb, arguments[0])
