"""Alert monitor: one alert list for a whole suite, and the commands of its crews."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence

from rope_twin.alerts.alert_list import EVERY, Alert, AlertList
from rope_twin.alerts.situations import Watch
from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.messages.status import Status
from rope_twin.scene.schema import Scene
from rope_twin.twin.snapshot import Snapshot

ACKNOWLEDGE, SILENCE, TRANSFER, SHELVE, UNSHELVE, LIMIT = COMMANDS = (
    "acknowledge", "silence", "transfer", "shelve", "unshelve", "limit",
)  # fmt: skip
_EXAMPLES = {
    SHELVE: "shelve 10008.1 600",
    LIMIT: "limit tension_n 400000, or limit tension_n scene",
}
REFRESH_NS = 1_000_000_000  # texts have figures that change; they are refreshed at this interval


class AlertMonitor:
    """Owns the alert list; snapshots and commands may come from different threads."""

    def __init__(self, scene: Scene) -> None:
        self._watch, self._list = Watch(scene), AlertList()
        self._lock = threading.Lock()
        self._refreshed_ns = -REFRESH_NS
        self._commanded = False

    def take_rows(self, rows: Sequence[Status]) -> None:
        """Take the newest rows of the diagnostics."""
        with self._lock:
            self._watch.take_rows(list(rows))

    def take_risks(self, rows: Sequence[Mapping[str, float]]) -> None:
        """Take the risks of the newest forecast, as forecast/risk has them."""
        with self._lock:
            self._watch.take_risks(rows)

    def look(self, shot: Snapshot) -> bool:
        """Judge a snapshot; return whether the list is to be published."""
        with self._lock:
            changed = bool(self._list.update(self._watch.look(shot), shot.stamp_ns))
            changed, self._commanded = changed or self._commanded, False
            due = shot.stamp_ns - self._refreshed_ns >= REFRESH_NS
            if changed or (due and self._list.listed()):
                self._refreshed_ns = shot.stamp_ns
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
        verb, *rest = words.split() or [""]
        if verb not in COMMANDS:
            right = did_you_mean(verb, COMMANDS)
            raise InputError(phrase("alerts/command", f"there is no '{verb}'", right))
        wanted = 2 if verb in _EXAMPLES else 1
        if len(rest) != wanted:
            example = _EXAMPLES.get(verb, f"{verb} 10001.1, or {EVERY}")
            raise InputError(phrase("alerts/command", f"'{words}'", f"write {example}"))
        with self._lock:
            answer = self._execute(verb, rest)
            self._commanded = True
        return answer

    def row(self) -> Status:
        """Return the row of the diagnostics on the limits that the crew has set."""
        with self._lock:
            return self._watch.crew.row()

    def _execute(self, verb: str, rest: list[str]) -> str:
        if verb == LIMIT:
            return self._watch.crew.set(*rest)
        if verb == SHELVE:
            try:
                seconds = float(rest[1])
            except ValueError:
                what = f"'{rest[1]}' is no time"
                raise InputError(phrase("alerts/command", what, "give seconds")) from None
            return self._list.shelve(rest[0], seconds)
        if verb == UNSHELVE:
            return self._list.shelve(rest[0], 0.0)
        act = {
            ACKNOWLEDGE: self._list.acknowledge,
            SILENCE: self._list.silence,
            TRANSFER: self._list.transfer,
        }[verb]
        return act(rest[0])
