"""Alert list: the state of every alert, from its first activation until it is dealt with.

The states and transitions are those of bridge alert management: IMO MSC.302(87), modules A and D,
and A.1021(26) for the priorities. An alarm or warning is active and unacknowledged until somebody
acknowledges it; its sound may be silenced for SILENCE_NS; when its cause disappears unseen it stays
in the list as rectified until it is acknowledged. A caution neither sounds nor waits for anybody.

One situation has one alert, identified by number and instance. Where it becomes worse, the same
alert takes the higher priority, as a new revision that must be acknowledged again. Where it becomes
a caution, an alarm or warning that waits keeps its priority until it is acknowledged.

Times are those of the twin [ns]; the list is driven by `update` and holds no clock of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum, IntEnum
from typing import Any

from rope_twin.errors import InputError

SECOND = 1_000_000_000
SILENCE_NS = 30 * SECOND  # MSC.302(87), 7.3: then the sound starts again
REPEAT_NS = 60 * SECOND  # an unacknowledged warning is announced again; upper bound 5 min
MAX_SHELVED_NS = 8 * 3600 * SECOND  # a shift
STANDING_NS = 24 * 3600 * SECOND  # EEMUA 191: active for so long, it tells nothing any more
REVISIONS, ESCALATIONS = 99, 9  # largest numbers of these fields in an alert sentence
EVERY = "all"  # in place of an identifier


class Priority(IntEnum):
    """Priority of an alert (A.1021(26)); the higher, the more urgent."""

    CAUTION = 1  # attention out of the ordinary
    WARNING = 2  # immediate attention, but no immediate action
    ALARM = 3  # immediate attention and action
    EMERGENCY = 4  # immediate danger to life or ship

    @property
    def letter(self) -> str:
        """The letter of an alert sentence."""
        return " CWAE"[self]


class State(Enum):
    """State of an alert, with its letter in an alert sentence."""

    UNACKNOWLEDGED = "V"
    SILENCED = "S"
    ACKNOWLEDGED = "A"
    TRANSFERRED = "O"  # responsibility transferred: somebody else has taken it over
    RECTIFIED = "U"  # the cause is gone, but nobody has acknowledged it
    NORMAL = "N"


ACTIVE = State.UNACKNOWLEDGED, State.SILENCED, State.ACKNOWLEDGED, State.TRANSFERRED
WAITING = State.UNACKNOWLEDGED, State.SILENCED, State.RECTIFIED  # for an acknowledgement

# What a crew does with an alert: in the past tense, the states that it suits, and the next one.
ACTIONS = {
    "acknowledge": ("acknowledged", WAITING, State.ACKNOWLEDGED),
    "silence": ("silenced", (State.UNACKNOWLEDGED,), State.SILENCED),  # for SILENCE_NS
    # the responsibility has been taken over elsewhere
    "transfer": ("transferred", (State.UNACKNOWLEDGED, State.SILENCED), State.TRANSFERRED),
}


@dataclass(frozen=True)
class Alert:
    """One alert at one time."""

    identifier: int  # of the kind of situation, 10000 and above: a maker's own (IEC 62923-2)
    instance: int  # which one of that kind, from 1
    name: str  # the situation in a few words
    priority: Priority
    category: str  # A: acknowledged where its cause can be judged, B: anywhere
    state: State
    text: str  # what is wrong, with its figures
    since_ns: int  # beginning of the present activation
    changed_ns: int  # newest change of state, priority or escalation
    revision: int = 0  # counts changes of state and priority
    escalation: int = 0  # counts repeated announcements
    shelved_until_ns: int = 0
    first_out: bool = False  # the first of the alerts that are waiting

    @property
    def key(self) -> str:
        """Identifier and instance, such as 10001.1."""
        return f"{self.identifier}.{self.instance}"

    @property
    def active(self) -> bool:
        """Whether its cause is present."""
        return self.state in ACTIVE

    @property
    def waits(self) -> bool:
        """Whether it waits for an acknowledgement."""
        return self.priority > Priority.CAUTION and self.state in WAITING

    def shelved(self, now_ns: int) -> bool:
        """Return whether it is shelved: kept out of the list, for a limited time."""
        return now_ns < self.shelved_until_ns

    def sounds(self, now_ns: int) -> bool:
        """Return whether it calls for a sound."""
        loud = self.priority > Priority.CAUTION and self.state is State.UNACKNOWLEDGED
        return loud and not self.shelved(now_ns)

    def standing(self, now_ns: int) -> bool:
        """Return whether it has been active for a day."""
        return self.active and now_ns - self.since_ns >= STANDING_NS


@dataclass(frozen=True)
class Situation:
    """A situation that calls for an alert now."""

    identifier: int
    name: str
    category: str
    where: str  # which one of its kind: the name of a rope, an input or an element
    priority: Priority
    text: str


class AlertList:
    """All alerts of a run; the situations of `update` raise and rectify them."""

    def __init__(self) -> None:
        self._alerts: dict[tuple[int, str], Alert] = {}
        self._instances: dict[int, list[str]] = {}
        self._shelved_at: dict[tuple[int, str], Priority] = {}  # at the last shelving
        self.now_ns = 0

    def update(self, situations: Iterable[Situation], now_ns: int) -> list[Alert]:
        """Take the situations of this time; return the alerts that have changed but for figures."""
        self.now_ns = now_ns
        before = dict(self._alerts)
        present = {(situation.identifier, situation.where): situation for situation in situations}
        for key, one in present.items():
            alert = self._raised(key, one)
            if one.priority > self._shelved_at.get(key, one.priority):  # nobody has shelved that
                alert = replace(alert, shelved_until_ns=0)
            self._alerts[key] = alert
        for key, alert in self._alerts.items():
            if key not in present:
                self._alerts[key] = self._rectified(alert)
        for key, alert in self._alerts.items():
            self._alerts[key] = self._aged(alert)
        self._mark_first_out()
        return [
            one for key, one in self._alerts.items()
            if key not in before or replace(before[key], text=one.text) != one
        ]  # fmt: skip

    def memory(self) -> dict[str, Any]:
        """Return the list as JSON types."""
        shelved_at = [[*key, int(priority)] for key, priority in self._shelved_at.items()]
        alerts = [
            {**vars(alert), "priority": int(alert.priority), "state": alert.state.value}
            for alert in self._alerts.values()
        ]
        where = [[number, *names] for number, names in self._instances.items()]
        return {"alerts": alerts, "where": where, "shelved_at": shelved_at}

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Continue a list of which `memory` was saved."""
        self._instances = {number: names for number, *names in memory["where"]}
        for saved in memory["alerts"]:
            enums = {"priority": Priority(saved["priority"]), "state": State(saved["state"])}
            alert = Alert(**{**saved, **enums})
            where = self._instances[alert.identifier][alert.instance - 1]
            self._alerts[alert.identifier, where] = alert
        for number, where, priority in memory["shelved_at"]:
            self._shelved_at[number, where] = Priority(priority)

    def _raised(self, key: tuple[int, str], situation: Situation) -> Alert:
        """Return the alert of a present situation."""
        alert = self._alerts.get(key)
        calm = situation.priority is Priority.CAUTION
        first = State.ACKNOWLEDGED if calm else State.UNACKNOWLEDGED
        if alert is None:
            instances = self._instances.setdefault(situation.identifier, [])
            instances.append(situation.where)
            return Alert(
                situation.identifier, len(instances), situation.name, situation.priority,
                situation.category, first, situation.text, self.now_ns, self.now_ns, revision=1,
            )  # fmt: skip
        if not alert.active:
            priority = situation.priority
            if alert.waits and calm:  # as below
                first, priority = State.UNACKNOWLEDGED, alert.priority
            alert = _revised(alert, first, self.now_ns)
            return replace(
                alert, priority=priority, text=situation.text, since_ns=self.now_ns, escalation=0
            )
        if situation.priority > alert.priority:
            alert = replace(_revised(alert, first, self.now_ns), escalation=0)
        elif situation.priority is Priority.CAUTION < alert.priority:
            if alert.waits:  # a caution waits for nobody: nobody would see what has been
                return replace(alert, text=situation.text)
            alert = _revised(alert, first, self.now_ns)
        elif situation.priority < alert.priority:  # less urgent: an acknowledgement remains valid
            alert = _revised(alert, alert.state, self.now_ns)
        return replace(alert, priority=situation.priority, text=situation.text)

    def _rectified(self, alert: Alert) -> Alert:
        """Return an alert whose cause is gone."""
        if not alert.active:
            return alert
        waits = alert.waits and not alert.shelved(self.now_ns)
        return _revised(alert, State.RECTIFIED if waits else State.NORMAL, self.now_ns)

    def _aged(self, alert: Alert) -> Alert:
        """Return an alert whose silence may have ended, or that is announced again."""
        waited = self.now_ns - alert.changed_ns
        if alert.state is State.SILENCED and waited >= SILENCE_NS:
            return _revised(alert, State.UNACKNOWLEDGED, self.now_ns)
        is_announced_again = (
            alert.priority is Priority.WARNING and alert.state is State.UNACKNOWLEDGED
        )
        if is_announced_again and waited >= REPEAT_NS:
            count = min(alert.escalation + 1, ESCALATIONS)
            return replace(alert, escalation=count, changed_ns=self.now_ns)
        return alert

    def _mark_first_out(self) -> None:
        """Mark the alert that began first among those that wait and are active.

        The mark stays with it while others of the same cause follow, until nothing waits.
        """
        waiting = {key: alert for key, alert in self._alerts.items()
                   if alert.waits and not alert.shelved(self.now_ns)}  # fmt: skip
        marked = next((key for key, alert in waiting.items() if alert.first_out), None)
        if marked is None and waiting:
            marked = min(waiting, key=lambda key: waiting[key].since_ns)
        for key, alert in self._alerts.items():
            if alert.first_out is not (key == marked):
                self._alerts[key] = replace(alert, first_out=key == marked)

    def listed(self) -> list[Alert]:
        """Return the alerts to show, those that want attention first.

        In the order of bridge displays: unacknowledged alarms, unacknowledged warnings, rectified
        ones that nobody has acknowledged, acknowledged alarms, acknowledged warnings, cautions; in
        each group the newest first. Shelved ones are not among them.
        """
        shown = [
            alert for alert in self._alerts.values()
            if alert.state is not State.NORMAL and not alert.shelved(self.now_ns)
        ]  # fmt: skip
        return sorted(shown, key=lambda one: (_group(one), -one.since_ns, one.identifier))

    def shelved(self) -> list[Alert]:
        """Return the shelved alerts, by the end of their time."""
        shelved = (alert for alert in self._alerts.values() if alert.shelved(self.now_ns))
        return sorted(shelved, key=lambda shelved_alert: shelved_alert.shelved_until_ns)

    # -- what a crew does ------------------------------------------------------------------------

    def act(self, action: str, key: str) -> str:
        """Do one of ACTIONS with an alert, or with all that it suits; return the answer in words.

        Raises:
            InputError: there is no such alert, or it is not in a state that the action suits.
        """
        word, of, to = ACTIONS[action]
        every = [at for at, each in self._alerts.items() if each.waits and each.state in of]
        if key == EVERY:
            chosen = [at for at in every if not self._alerts[at].shelved(self.now_ns)]
        else:
            chosen = [self._find(key)]
            state = self._alerts[chosen[0]].state.name.lower()
            if chosen[0] not in every:
                remedy = f"only {', '.join(each.name.lower() for each in of)} alarms and warnings"
                raise InputError(f"alert {key}", f"it is {state}", f"{remedy} are {word}")
        for at in chosen:
            alert = self._alerts[at]
            is_rectified = alert.state is State.RECTIFIED
            self._alerts[at] = _revised(alert, State.NORMAL if is_rectified else to, self.now_ns)
        self._mark_first_out()
        subject = f"alert {key}" if key != EVERY else f"{len(chosen)} alerts"
        return f"{subject} {word}"

    def shelve(self, key: str, seconds: float) -> str:
        """Keep an alert out of the list for a time, or until it becomes worse; 0 s: list it again.

        Raises:
            InputError: there is no such alert, or the time is not possible.
        """
        max_s = MAX_SHELVED_NS // SECOND
        if not 0.0 <= seconds <= max_s:
            remedy = f"give 0 to {max_s} s; 0 lists it again"
            raise InputError(f"alert {key}", f"shelving for {seconds:g} s", remedy)
        at = self._find(key)
        until = self.now_ns + round(seconds * SECOND) if seconds else 0
        self._alerts[at] = replace(self._alerts[at], shelved_until_ns=until)
        self._shelved_at[at] = self._alerts[at].priority
        self._mark_first_out()
        return f"alert {key} shelved for {seconds:g} s" if seconds else f"alert {key} listed again"

    def _find(self, key: str) -> tuple[int, str]:
        for at, alert in self._alerts.items():
            if alert.key == key:
                return at
        listed = ", ".join(each.key for each in self.listed()) or "none is listed"
        raise InputError("alert", f"there is no '{key}'", f"listed: {listed}")


def _revised(alert: Alert, state: State, now_ns: int) -> Alert:
    """Return an alert with a new state, as its next revision."""
    revision = alert.revision % REVISIONS + 1
    return replace(alert, state=state, changed_ns=now_ns, revision=revision)


def _group(alert: Alert) -> int:
    """Return the place of an alert's group in the list."""
    if alert.priority is Priority.CAUTION:
        return 6
    if alert.state is State.RECTIFIED:
        return 3
    low = alert.priority is Priority.WARNING
    if alert.state in (State.UNACKNOWLEDGED, State.SILENCED):
        return 2 if low else 1
    return 5 if low else 4
