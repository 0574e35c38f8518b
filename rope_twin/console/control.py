"""Requests of a page: the token, the seat among pages, winch commands, and their feedback.

The console is one node to the twin, whatever number of pages it serves, so one page at a time has
its seat. The node's publishers exist only while a page has it: when that page disappears they are
removed, and the twin does what its scene specifies for a lost commander.
"""

from __future__ import annotations

import hashlib
import hmac
import math
import secrets
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeGuard

from rope_twin.alerts.alert_list import SECOND, SHELVED_MOST_NS
from rope_twin.console.pages import Page, Pages
from rope_twin.console.readings import of_winch
from rope_twin.errors import did_you_mean, phrase
from rope_twin.scene.winch import SWITCHES
from rope_twin.twin.snapshot import CONTROL_MODES, SPEED
from rope_twin.twin.winch.commands import COMPENSATE, EMERGENCY_STOP, WinchCommand

LOST_S = 3.0  # after the page with the seat has disconnected until the seat is given up
ALIVE_S = 2.0  # without a message of the page with the seat until it counts as disconnected
_SLACK_S = 0.01  # of the server's clock
REPEAT_S = 0.1  # a set-point is repeated so often, as the twin expects of a commander
FEEDBACK_S = 2.5  # how long the twin's answer to a command is awaited
ENTRIES, ENTRIES_WITHIN_S = 20, 10.0  # markers and casts that all pages may add
ALERT_ACTIONS = "acknowledge", "silence", "transfer", "shelve", "unshelve"
SHELVED_MOST_S = SHELVED_MOST_NS / SECOND
TRIES, TRIES_IN_ALL, TRIES_WITHIN_S = 5, 20, 60.0  # wrong tokens of an address, and of all


_ENTRIES = "mark", "new_cast"
_STOP = WinchCommand(SPEED, 0.0)


class Commander(Protocol):
    """Way of commands to a winch."""

    name: str  # of its node

    def look(self, winches: Sequence[str]) -> None:
        """Prepare for the winches known by now; called regularly."""

    def take(self, winch: str) -> None:
        """Prepare to command; a seat that another node of the same priority has is requested."""

    def send(self, winch: str, command: WinchCommand) -> None:
        """Send a command that applies immediately."""

    def release(self) -> None:
        """Give up all seats."""

    def command_alerts(self, words: str) -> None:
        """Send words such as `acknowledge 10001.1` to the alert list."""


class Token:
    """Secret that allows control; only its hash is kept, and wrong ones are counted."""

    def __init__(self, secret: str, clock: Callable[[], float]) -> None:
        self._hash = _digest(secret)
        self._clock = clock
        self._wrong: deque[tuple[float, str]] = deque(maxlen=1000)

    def check(self, given: object, address: str) -> str:
        """Return "" for the right token, else the reason for a refusal in one sentence."""
        now_s = self._clock()
        while self._wrong and self._wrong[0][0] < now_s - TRIES_WITHIN_S:
            self._wrong.popleft()
        own = sum(one == address for _, one in self._wrong)
        if own >= TRIES or len(self._wrong) >= TRIES_IN_ALL:
            wait_s = math.ceil(self._wrong[0][0] + TRIES_WITHIN_S - now_s)
            return phrase("token", "too many wrong ones", f"try again in {wait_s} s")
        if hmac.compare_digest(self._hash, _digest(given if isinstance(given, str) else "")):
            return ""
        self._wrong.append((now_s, address))
        return phrase("token", "not the right one", "it was printed where the console was started")


def new_token() -> str:
    """Return a new secret that can be typed."""
    return secrets.token_hex(6)


def _digest(secret: str) -> bytes:
    return hashlib.sha256(secret.strip().encode()).digest()


@dataclass
class _Awaited:
    """Command whose effect is awaited."""

    page: Page
    number: object  # of the page's request
    winch: str
    command: WinchCommand
    sent_s: float


class Desk:
    """Takes the messages of pages; call `look` regularly."""

    def __init__(
        self,
        pages: Pages,
        clock: Callable[[], float],
        commander: Commander | None = None,
        token: Token | None = None,
    ) -> None:
        """Make a desk; without a commander and a token the console is read-only."""
        self._pages, self._clock = pages, clock
        self._commander = commander if token is not None else None
        self._token = token
        self._holder: Page | None = None
        self._left_s: float | None = None  # since when the holder's page is gone
        self._awaited: list[_Awaited] = []
        self._set_points: dict[str, WinchCommand] = {}  # newest of each winch, repeated
        self._set_s: dict[str, float] = {}  # when each of them was given
        self._confirmed: set[str] = (
            set()
        )  # winches of which the twin has given the console the seat
        self._repeated_s = 0.0
        self._entries: deque[float] = deque(maxlen=ENTRIES)  # times of markers and casts
        self.further: dict[str, Callable[[Page, Mapping[str, Any]], str]] = {}
        # further requests of the page with the seat, which answer by themselves
        self.staged: dict[str, Callable[[Page, Mapping[str, Any]], None]] = {}
        pages.extra["control"] = self.state

    def state(self) -> dict[str, Any]:
        """Return what every page knows about control."""
        holder = self._holder
        return {
            "allowed": self._commander is not None,
            "node": self._commander.name if self._commander else "",
            "holder": None if holder is None else holder.number,
            "holder_name": "" if holder is None else holder.name,
        }

    def take(self, page: Page, content: Mapping[str, Any]) -> None:
        """Act on a message of a page and send the answer; a faulty one is refused."""
        what, number = content.get("do"), content.get("id")
        page.heard_s = self._clock()
        if what == "alive":
            if page is self._holder:
                self._left_s = None
            return
        if isinstance(what, str) and what in self.further:
            words = self._entry_fault(page, what) or self.further[what](page, content)
            self.answer(page, number, not words, words)
            return
        acts = {
            "sign_in": self._sign_in,
            "take_seat": self._take_seat,
            "release_seat": self._release_seat,
            "command": self._command,
            "alert": self._alert,
            **self.staged,
        }
        act = acts.get(what) if isinstance(what, str) else None
        if act is None:
            words = phrase("console", f"'{what}'", did_you_mean(str(what), acts))
            self.answer(page, number, False, words)
        elif self._commander is None:
            right = "start it with --control to command the winch"
            self.answer(page, number, False, phrase("console", "it is read-only", right))
        elif what != "sign_in" and not page.authorised:
            words = phrase("console", "this page has no control", "give the token first")
            self.answer(page, number, False, words)
        elif what in self.staged and page is not self._holder:
            self.answer(page, number, False, self._seat_fault(str(what)))
        else:
            act(page, content)

    def leave(self, page: Page) -> None:
        """Take note that a page has disconnected."""
        if page is self._holder:
            self._left_s = self._clock()

    def look(self) -> None:
        """Answer the commands whose effect is seen or overdue; give up the seat of a lost page."""
        now_s = self._clock()
        if self._commander is not None:
            self._commander.look(self._winches())
        if self._holder and self._left_s is None and now_s - self._holder.heard_s > ALIVE_S:
            self.leave(self._holder)
        if self._left_s is not None and now_s - self._left_s >= LOST_S:
            self._give_up()
        self._watch_seat(now_s)
        self._repeat(now_s)
        left = []
        for one in self._awaited:
            if words := self._effect(one):
                self.answer(one.page, one.number, True, words, stage="done")
            elif now_s - one.sent_s >= FEEDBACK_S:
                if not self._commands(one.winch):
                    self._drop(one.winch)
                self.answer(one.page, one.number, False, self._why_not(one), stage="done")
            else:
                left.append(one)
        self._awaited = left

    # -- messages of pages -----------------------------------------------------------------------

    def _sign_in(self, page: Page, content: Mapping[str, Any]) -> None:
        assert self._token is not None
        refusal = self._token.check(content.get("token"), page.address)
        page.authorised = page.authorised or not refusal
        self.answer(page, content.get("id"), not refusal, refusal or "control allowed")

    def _take_seat(self, page: Page, content: Mapping[str, Any]) -> None:
        assert self._commander is not None
        holder, number = self._holder, content.get("id")
        if holder is not None and holder is not page and self._left_s is None:
            self._pages.send(holder, {"type": "seat_wanted", "by": page.name})
            words = phrase("seat", f"{holder.name} has it", "it was asked to release it")
            self.answer(page, number, False, words)
            return
        if holder is not page:  # the set-points are those of the page before
            self._drop_all()
        self._holder, self._left_s = page, None
        for winch in self._winches():
            self._commander.take(winch)
        words = "this page commands; the first command takes the winch's seat"
        self.answer(page, number, True, words)

    def _release_seat(self, page: Page, content: Mapping[str, Any]) -> None:
        number = content.get("id")
        if page is not self._holder:
            words = phrase("seat", "this page does not have it", "take it first")
            self.answer(page, number, False, words)
            return
        self._give_up()
        self.answer(page, number, True, "seat released")

    def _command(self, page: Page, content: Mapping[str, Any]) -> None:
        assert self._commander is not None
        number, kind, winch = content.get("id"), content.get("kind"), content.get("winch")
        fault = self._fault(page, content)
        if fault:
            self.answer(page, number, False, fault)
            return
        value = content.get("value")
        command = WinchCommand(str(kind), float(value) if kind in CONTROL_MODES else 0.0)  # type: ignore[arg-type]
        if command.kind in CONTROL_MODES:
            self._set_points[str(winch)] = command
            self._set_s[str(winch)] = self._clock()
        elif command.kind == EMERGENCY_STOP and str(winch) in self._set_points:
            self._set_points[str(winch)] = _STOP
        self._commander.send(str(winch), command)
        sent = _Awaited(page, number, str(winch), command, self._clock())
        self._awaited.append(sent)
        self.answer(page, number, True, f"sent: {_words(command)}", stage="sent")

    def _alert(self, page: Page, content: Mapping[str, Any]) -> None:
        assert self._commander is not None
        number, action, which = content.get("id"), content.get("action"), content.get("alert")
        if action not in ALERT_ACTIONS:
            right = did_you_mean(str(action), ALERT_ACTIONS)
            self.answer(page, number, False, phrase("alert", f"'{action}'", right))
            return
        listed = [row["id"] for row in self._pages.readings.values.get("alerts", ())]
        if which != "all" and which not in listed:
            what = f"'{which}' is not in the list"
            self.answer(page, number, False, phrase("alert", what, "it may have ended"))
            return
        seconds = content.get("seconds")
        if action == "shelve":
            if which == "all" or not _is_finite(seconds) or not 0.0 < seconds <= SHELVED_MOST_S:
                right = f"give one alert and 1 to {SHELVED_MOST_S:g} s"
                self.answer(page, number, False, phrase("shelve", f"{which} {seconds!r}", right))
                return
            which = f"{which} {seconds:g}"
        self._commander.command_alerts(f"{action} {which}")
        self.answer(page, number, True, f"{action} {which}: sent")

    def _fault(self, page: Page, content: Mapping[str, Any]) -> str:
        """Return why a command of a page is not passed on, in one sentence, or ""."""
        kind, winch, value = content.get("kind"), content.get("winch"), content.get("value")
        winches = self._winches()
        if not isinstance(winch, str) or winch not in winches:
            return phrase("command", f"winch '{winch}'", did_you_mean(str(winch), winches))
        if not isinstance(kind, str) or (kind not in CONTROL_MODES and kind not in SWITCHES):
            known = (*CONTROL_MODES, *SWITCHES)
            return phrase("command", f"'{kind}'", did_you_mean(str(kind), known))
        if kind == EMERGENCY_STOP:
            return ""
        if page is not self._holder:
            return self._seat_fault("command")
        if kind in CONTROL_MODES and not _is_finite(value):
            return phrase("command", f"{kind} {value!r}", "it must be a finite number")
        return ""

    def _seat_fault(self, what: str) -> str:
        has = f"{self._holder.name} has the seat" if self._holder else "no page has the seat"
        return phrase(what, has, "take the seat first")

    def _give_up(self) -> None:
        assert self._commander is not None
        self._holder, self._left_s = None, None
        self._drop_all()
        self._commander.release()

    def _watch_seat(self, now_s: float) -> None:
        """Drop the set-point of a winch whose seat was lost, or was not given in time.

        Repeated further, it would start the winch once the seat is free again.
        """
        for winch in list(self._set_points):
            if self._commands(winch):
                self._confirmed.add(winch)
                continue
            lost = winch in self._confirmed
            if not lost and now_s - self._set_s[winch] <= FEEDBACK_S + REPEAT_S:
                continue
            self._drop(winch)
            if self._holder is not None:
                what = "another commander has it" if lost else "it was not given to the console"
                right = "the set-point is no longer repeated; send it again to command"
                words = phrase(f"seat of {winch}", what, right)
                self._pages.send(self._holder, {"type": "notice", "words": words})

    def _drop(self, winch: str) -> None:
        self._set_points.pop(winch, None)
        self._set_s.pop(winch, None)
        self._confirmed.discard(winch)

    def _drop_all(self) -> None:
        self._set_points.clear()
        self._set_s.clear()
        self._confirmed.clear()

    def _entry_fault(self, page: Page, what: str) -> str:
        """Return why an entry of the log is refused, or ""."""
        if self._token is not None and not page.authorised:
            return phrase("console", "this page has no control", "give the token first")
        if what in _ENTRIES:
            now_s = self._clock()
            full = len(self._entries) == ENTRIES
            if full and now_s - self._entries[0] < ENTRIES_WITHIN_S:
                wait_s = math.ceil(self._entries[0] + ENTRIES_WITHIN_S - now_s)
                return phrase("log", "too many entries at once", f"try again in {wait_s} s")
            self._entries.append(now_s)
        return ""

    def _repeat(self, now_s: float) -> None:
        """Repeat the set-points; after an emergency stop, whoever gave it, only speed 0."""
        if (
            self._commander is None
            or not self._set_points
            or now_s < self._repeated_s + REPEAT_S - _SLACK_S
        ):
            return
        self._repeated_s = now_s
        for winch in self._set_points:
            if self._mode(winch).startswith(f"{winch}: emergency stop"):
                self._set_points[winch] = _STOP
            self._commander.send(winch, self._set_points[winch])

    def _commands(self, winch: str) -> bool:
        """Return whether the twin has this console in command of a winch."""
        return f"{winch}: {self._node}" in str(self._pages.readings.values.get("seat", ""))

    def _mode(self, winch: str) -> str:
        """Return the twin's words on the mode of a winch; "": not known."""
        return of_winch(str(self._pages.readings.values.get("winch_mode", "")), winch)

    # -- feedback --------------------------------------------------------------------------------

    def _winches(self) -> tuple[str, ...]:
        """Return the names of the winches: of the scene, or as they publish their state."""
        values = self._pages.readings.values
        named = (row["name"] for row in values.get("winches", ()))
        return tuple(self._pages.facts.get("winches") or named)

    def _effect(self, one: _Awaited) -> str:
        """Return the twin's words on what a command has done, or "" while it is not seen."""
        values = self._pages.readings.values
        own = self._mode(one.winch)
        row: Mapping[str, Any] = next(
            (row for row in values.get("winches", ()) if row["name"] == one.winch), {}
        )
        command, seen = one.command, False
        if command.kind in CONTROL_MODES:
            unit = CONTROL_MODES[command.kind]
            order_text = f"{one.winch}: {command.kind} {command.value:g} {unit}"
            seen = own == order_text or own.startswith(f"{order_text} (")
        elif command.kind == EMERGENCY_STOP:
            seen = own.startswith(f"{one.winch}: emergency stop")
        elif command.kind == "reset":
            seen = bool(own) and not own.startswith(f"{one.winch}: emergency stop")
        elif command.kind in ("set_brake", "release_brake"):
            holds = row.get("brake_holds")
            seen = holds is not None and bool(holds) == (command.kind == "set_brake")
            own = f"{one.winch}: brake {'set' if holds else 'released'}"
        else:
            on = row.get("compensation_on")
            seen = on is not None and bool(on) == (command.kind == COMPENSATE)
            own = f"{one.winch}: compensation {'on' if on else 'off'}"
        return f"the twin reports {own or _words(command)}" if seen else ""

    @property
    def _node(self) -> str:
        return self._commander.name if self._commander else ""

    def _why_not(self, one: _Awaited) -> str:
        """Return what is known of a command without effect."""
        values = self._pages.readings.values
        seat = values.get(f"diagnostics simulation: seat {one.winch}")
        holder = str(values.get("seat", ""))
        if not self._commands(one.winch) and one.command.kind != EMERGENCY_STOP:
            last = (seat or {}).get("values", {}).get("last rejection", "")
            return last or phrase(_words(one.command), f"the seat is not the console's ({holder})",
                                  "take the seat and send it again")  # fmt: skip
        row = values.get("diagnostics simulation: input winch command", {})
        reason = row.get("message", "") if row.get("level") else ""
        what = f"no effect seen within {FEEDBACK_S:g} s"
        return phrase(_words(one.command), what, reason or "look at the winch's state")

    def answer(
        self, page: Page, number: object, done: bool, words: str, stage: str = "done"
    ) -> None:
        """Answer a request of a page; after the stage `sent` another answer follows."""
        content = {"type": "reply", "id": number, "ok": done, "words": words, "stage": stage}
        self._pages.send(page, content)


def _is_finite(value: object) -> TypeGuard[float]:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and math.isfinite(value)  # type: ignore[arg-type]


def _words(command: WinchCommand) -> str:
    unit = CONTROL_MODES.get(command.kind)
    if unit is None:
        return command.kind.replace("_", " ")
    sign = "+" if command.kind == SPEED else ""
    return f"{command.kind} {command.value:{sign}g} {unit}"
