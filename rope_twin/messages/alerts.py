"""Alert list as a message: one DiagnosticStatus for each alert, in the order to be shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rope_twin.alerts.alert_list import Alert, Priority, State
from rope_twin.errors import InputError, phrase
from rope_twin.messages.cdr import decode, new, serialise
from rope_twin.messages.status import Level, Status, encode_diagnostics
from rope_twin.topics import ALERT_COMMAND, ALERTS

_LEVELS = {
    Priority.CAUTION: Level.WARN, Priority.WARNING: Level.WARN,
    Priority.ALARM: Level.ERROR, Priority.EMERGENCY: Level.ERROR,
}  # fmt: skip


CREW_LIMITS_ROW = "simulation: crew limits"


class PublishedAlerts(NamedTuple):
    """Alerts of one message."""

    stamp_ns: int  # ROS time
    now_ns: int  # twin time
    alerts: tuple[Alert, ...]


def encode_alerts(stamp_ns: int, now_ns: int, alerts: Sequence[Alert]) -> bytes:
    """Return an `alerts` message.

    Args:
        stamp_ns: ROS time.
        now_ns: twin time, to which the times of the alerts refer.
        alerts: in the order to be shown; shelved ones at the end.
    """
    rows = [_row(one, now_ns) for one in alerts]
    return encode_diagnostics(stamp_ns, rows)


def _row(alert: Alert, now_ns: int) -> Status:
    """Return the row of an alert."""
    quiet = alert.state in (State.RECTIFIED, State.NORMAL)
    values = {
        "identifier": str(alert.identifier),
        "instance": str(alert.instance),
        "priority": alert.priority.name.lower(),
        "category": alert.category,
        "state": alert.state.name.lower(),
        "now [ns]": str(now_ns),
        "since [ns]": str(alert.since_ns),
        "changed [ns]": str(alert.changed_ns),
        "revision": str(alert.revision),
        "escalation": str(alert.escalation),
        "shelved until [ns]": str(alert.shelved_until_ns),
        "first out": str(alert.first_out).lower(),
        "sounds": str(alert.sounds(now_ns)).lower(),
        "standing": str(alert.standing(now_ns)).lower(),
    }
    level = Level.OK if quiet else _LEVELS[alert.priority]
    return Status(f"{alert.key} {alert.name}", level, alert.text, values)


def crew_limits_row(limits: Mapping[str, float], words: str) -> Status:
    """Return the row of the diagnostics on the limits of a crew: SI values by name, and words."""
    values = {name: repr(value) for name, value in limits.items()}
    return Status(CREW_LIMITS_ROW, Level.OK, words, values)


def decode_alerts(data: bytes) -> PublishedAlerts:
    """Return the alerts of a message.

    Raises:
        InputError: the bytes are not such a message.
    """
    message = decode(ALERTS, data)
    found, now_ns = [], 0
    for one in message.status:
        values = {pair.key: pair.value for pair in one.values}
        try:
            now_ns = int(values["now [ns]"])
            found.append(
                Alert(
                    identifier=int(values["identifier"]),
                    instance=int(values["instance"]),
                    name=one.name.partition(" ")[2],
                    priority=Priority[values["priority"].upper()],
                    category=values["category"],
                    state=State[values["state"].upper()],
                    text=one.message,
                    since_ns=int(values["since [ns]"]),
                    changed_ns=int(values["changed [ns]"]),
                    revision=int(values["revision"]),
                    escalation=int(values["escalation"]),
                    shelved_until_ns=int(values["shelved until [ns]"]),
                    first_out=values["first out"] == "true",
                )
            )
        except (KeyError, ValueError) as error:
            what = f"row '{one.name}' is no alert ({error})"
            right = "only the simulation publishes here"
            raise InputError(phrase(ALERTS, what, right)) from None
    stamp = message.header.stamp
    return PublishedAlerts(stamp.sec * 1_000_000_000 + stamp.nanosec, now_ns, tuple(found))


def encode_command(words: str) -> bytes:
    """Return an `alerts/command` message."""
    return serialise(new("std_msgs/msg/String", data=words))


def read_command(data: bytes) -> str:
    """Return the words of an `alerts/command` message.

    Raises:
        InputError: the bytes are not such a message.
    """
    return str(decode(ALERT_COMMAND, data).data)
