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
import sys
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeGuard

from rope_twin.alerts.alert_list import MAX_SHELVED_NS, SECOND
from rope_twin.console.pages import Page, Pages
from rope_twin.console.readings import TENSION, of_winch, stale_limits_s
from rope_twin.errors import RopeTwinError, did_you_mean, phrase
from rope_twin.scene.winch import SWITCHES
from rope_twin.twin.snapshot import CONTROL_MODES, LENGTH, SPEED
from rope_twin.twin.winch.commands import (
    COMPENSATE,
    EMERGENCY_STOP,
    MAX_SPEED_M_PER_S,
    WinchCommand,
)
from rope_twin.twin.winch.winch import input_of

LOST_S = 3.0  # after the page with the seat has disconnected until the seat is given up
ALIVE_S = 2.0  # without a message of the page with the seat until it counts as disconnected
_SLACK_S = 0.01  # of the server's clock
REPEAT_S = 0.1  # a set-point is repeated so often, as the twin expects of a commander
FEEDBACK_S = 2.5  # how long the twin's answer to a command is awaited
ENTRIES, ENTRIES_WITHIN_S = 20, 10.0  # markers and casts that all pages may add
ALERT_ACTIONS = "acknowledge", "silence", "transfer", "shelve", "unshelve"
MAX_SHELVED_S = MAX_SHELVED_NS / SECOND
TRIES, TRIES_IN_ALL, TRIES_WITHIN_S = 5, 20, 60.0  # wrong tokens of an address, and of all


_NO_CONTROL = phrase("console", "this page has no control", "give the token first")
_ENTRIES = "mark", "new_cast"
_STOP = WinchCommand(SPEED, 0.0)


class Commander(Protocol):
    """Way of commands to a winch."""

    name: str  # of its node

    def prepare(self, winches: Sequence[str]) -> None:
        """Prepare for the winches known by now; called regularly."""

    def take(self, winch: str) -> None:
        """Prepare to command; a seat that another node of the same priority has is requested."""

    def send(self, winch: str, command: WinchCommand) -> None:
        """Send a command that applies immediately."""

    def release(self) -> None:
        """Give up all seats."""

    def command_alerts(self, words: str) -> None:
        """Send words such as `acknowledge 10001.1` to the alert list."""

    def call(self, service: str) -> Callable[[], Outcome | None]:
        """Call a service of the suite; the result returns its answer, None while there is none."""


class Token:
    """Secret that allows control; only its hash is kept, and wrong ones are counted."""

    def __init__(self, secret: str, clock: Callable[[], float]) -> None:
        self._hash = _digest(secret)
        self._clock = clock
        self._wrong: deque[tuple[float, str]] = deque(maxlen=1000)

    def check(self, token: object, address: str) -> str:
        """Return "" for the right token, else the reason for a refusal in one sentence."""
        now_s = self._clock()
        while self._wrong and self._wrong[0][0] < now_s - TRIES_WITHIN_S:
            self._wrong.popleft()
        wrong_here = sum(wrong_address == address for _, wrong_address in self._wrong)
        if wrong_here >= TRIES or len(self._wrong) >= TRIES_IN_ALL:
            wait_s = math.ceil(self._wrong[0][0] + TRIES_WITHIN_S - now_s)
            return phrase("token", "too many wrong ones", f"try again in {wait_s} s")
        if hmac.compare_digest(self._hash, _digest(token if isinstance(token, str) else "")):
            return ""
        self._wrong.append((now_s, address))
        return phrase("token", "not the right one", "it was printed where the console was started")


def new_token() -> str:
    """Return a new secret that can be typed."""
    return secrets.token_hex(6)


def _digest(secret: str) -> bytes:
    return hashlib.sha256(secret.strip().encode()).digest()


class Refusal(RopeTwinError):
    """A request of a page is refused; the text is the answer."""


Outcome = tuple[bool, str]  # whether a request was done, and words


@dataclass(frozen=True)
class PendingRequest:
    """A request that was sent, whose outcome is awaited."""

    outcome: Callable[[], Outcome | None]  # None while it is not seen
    why_not: Callable[[], str]  # words if none is seen in time
    words: str = "sent"


Act = Callable[[Page, Mapping[str, Any]], str | PendingRequest]  # the words are what was done


@dataclass
class _SetPoint:
    """Newest set-point of a winch, repeated."""

    command: WinchCommand
    given_s: float
    confirmed: bool = False  # whether the twin has given the console the winch's seat
    in_force: WinchCommand | None = None  # newest one that the twin has reported
    seen_s: float = 0.0  # when the twin last reported the command ...
    refused: int = 0  # ... and how many the seat had refused by then

    def stop(self) -> None:
        """Repeat speed 0, as after an emergency stop."""
        self.command = self.in_force = _STOP


class RequestHandler:
    """Takes the messages of pages; call `update` regularly."""

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
        self._awaited: list[tuple[Page, object, PendingRequest, float]] = []
        # page, number of its request, and when it was sent
        self._set_points: dict[str, _SetPoint] = {}
        self._repeated_s = 0.0
        self._entries: deque[float] = deque(maxlen=ENTRIES)  # times of markers and casts
        self.further: dict[str, Callable[[Page, Mapping[str, Any]], str]] = {}
        # further requests of the page with the seat, which answer by themselves
        self.staged: dict[str, Act] = {}
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
        action, number = content.get("do"), content.get("id")
        page.heard_s = self._clock()
        if action == "alive":
            if page is self._holder:
                self._left_s = None
            return
        if isinstance(action, str) and action in self.further:
            reason = self._entry_fault(page, action) or self.further[action](page, content)
            self._answer(page, number, not reason, reason)
            return
        try:
            result = self._act(page, action, content)
        except Refusal as refusal:
            self._answer(page, number, False, str(refusal))
            return
        if isinstance(result, PendingRequest):
            self._awaited.append((page, number, result, self._clock()))
            self._answer(page, number, True, result.words, stage="sent")
        else:
            self._answer(page, number, True, result)

    def _act(self, page: Page, action: object, content: Mapping[str, Any]) -> str | PendingRequest:
        acts: dict[str, Act] = {
            "sign_in": self._sign_in,
            "take_seat": self._take_seat,
            "release_seat": self._release_seat,
            "command": self._command,
            "alert": self._alert,
            **self.staged,
        }
        act = acts.get(action) if isinstance(action, str) else None
        if act is None:
            raise Refusal("console", f"'{action}'", did_you_mean(str(action), acts))
        if self._commander is None:
            remedy = "start it with --control to command the winch"
            raise Refusal("console", "it is read-only", remedy)
        if action != "sign_in" and not page.authorised:
            raise Refusal(_NO_CONTROL)
        if action in self.staged:
            self._check_seat(page, str(action))
        if action in (*self.staged, "alert"):
            self._check_twin(str(action))
        return act(page, content)

    def leave(self, page: Page) -> None:
        """Take note that a page has disconnected."""
        if page is self._holder:
            self._left_s = self._clock()

    def update(self) -> None:
        """Answer the commands whose effect is seen or overdue; give up the seat of a lost page."""
        now_s = self._clock()
        if self._commander is not None:
            self._commander.prepare(self._winches())
        if self._holder and self._left_s is None and now_s - self._holder.heard_s > ALIVE_S:
            self.leave(self._holder)
        if self._left_s is not None and now_s - self._left_s >= LOST_S:
            self._give_up()
        self._watch_seat(now_s)
        self._repeat(now_s)
        waiting = []
        for entry in self._awaited:
            page, number, sent, sent_s = entry
            outcome = sent.outcome()
            if outcome is None and now_s - sent_s < FEEDBACK_S:
                waiting.append(entry)
            else:
                self._answer(page, number, *(outcome or (False, sent.why_not())))
        self._awaited = waiting

    # -- messages of pages -----------------------------------------------------------------------

    def _sign_in(self, page: Page, content: Mapping[str, Any]) -> str:
        assert self._token is not None
        if refusal := self._token.check(content.get("token"), page.address):
            raise Refusal(refusal)
        page.authorised = True
        return "control allowed"

    def _take_seat(self, page: Page, content: Mapping[str, Any]) -> str:
        assert self._commander is not None
        holder = self._holder
        if holder is not None and holder is not page and self._left_s is None:
            self._pages.send(holder, {"type": "seat_wanted", "by": page.name})
            raise Refusal("seat", f"{holder.name} has it", "it was asked to release it")
        if holder is not page:  # the set-points are those of the page before
            self._set_points.clear()
        self._holder, self._left_s = page, None
        for winch in self._winches():
            self._commander.take(winch)
        return "this page commands; the first command takes the winch's seat"

    def _release_seat(self, page: Page, content: Mapping[str, Any]) -> str:
        if page is not self._holder:
            raise Refusal("seat", "this page does not have it", "take it first")
        self._give_up()
        return "seat released"

    def _command(self, page: Page, content: Mapping[str, Any]) -> PendingRequest:
        assert self._commander is not None
        winch, command = self._read_command(page, content)
        if command.kind in CONTROL_MODES:
            now_s = self._clock()
            set_point = self._set_points.setdefault(winch, _SetPoint(command, now_s))
            set_point.command, set_point.given_s = command, now_s
            set_point.seen_s, set_point.refused = now_s, _refused_in(self._seat_row(winch))
        elif command.kind == EMERGENCY_STOP and winch in self._set_points:
            self._set_points[winch].stop()
        refused = self._refused(winch, command)
        self._commander.send(winch, command)
        return PendingRequest(
            lambda: self._effect(winch, command),
            lambda: self._why_not(winch, command, refused),
            f"sent: {_words(command)}",
        )

    def _alert(self, page: Page, content: Mapping[str, Any]) -> str:
        assert self._commander is not None
        action, name = content.get("action"), content.get("alert")
        if action not in ALERT_ACTIONS:
            raise Refusal("alert", f"'{action}'", did_you_mean(str(action), ALERT_ACTIONS))
        listed = [row["id"] for row in self._pages.readings.values.get("alerts", ())]
        if name != "all" and name not in listed:
            raise Refusal("alert", f"'{name}' is not in the list", "it may have ended")
        seconds = content.get("seconds")
        if action == "shelve":
            if name == "all" or not is_finite(seconds) or not 0.0 < seconds <= MAX_SHELVED_S:
                remedy = f"give one alert and 1 to {MAX_SHELVED_S:g} s"
                raise Refusal("shelve", f"{name} {seconds!r}", remedy)
            name = f"{name} {seconds:g}"
        self._commander.command_alerts(f"{action} {name}")
        return f"{action} {name}: sent"

    def _read_command(self, page: Page, content: Mapping[str, Any]) -> tuple[str, WinchCommand]:
        """Return the winch and the command of a page; raise `Refusal`."""
        kind, winch, value = content.get("kind"), content.get("winch"), content.get("value")
        winches = self._winches()
        if not isinstance(winch, str) or winch not in winches:
            raise Refusal("command", f"winch '{winch}'", did_you_mean(str(winch), winches))
        if not isinstance(kind, str) or (kind not in CONTROL_MODES and kind not in SWITCHES):
            known = (*CONTROL_MODES, *SWITCHES)
            raise Refusal("command", f"'{kind}'", did_you_mean(str(kind), known))
        if kind != EMERGENCY_STOP:
            self._check_seat(page, "command")
        if kind == "reset" and (mode := self._mode(winch)) and not self._is_stopped(winch):
            # it would end the stop of another page that is on its way
            raise Refusal("command", f"reset, but no emergency stop is in force ({mode})",
                          "reset once the page shows the stop")  # fmt: skip
        if kind not in CONTROL_MODES:
            if kind != EMERGENCY_STOP:
                self._check_twin("command")
            return winch, WinchCommand(kind, 0.0)
        if not is_finite(value):
            raise Refusal("command", f"{kind} {value!r}", "it must be a finite number")
        command = WinchCommand(kind, float(value))
        if command != _STOP:
            self._check_twin("command")
        self._check_reach(winch, command)
        return winch, command

    def _check_reach(self, winch: str, command: WinchCommand) -> None:
        """Refuse what the twin would refuse: its repeats would take the place of those in force."""
        figures = (self._pages.facts.get("winches") or {}).get(winch, {})
        if command.kind not in figures.get("modes", CONTROL_MODES):
            remedy = f"this winch has {', '.join(figures['modes'])}"
            raise Refusal("command", _words(command), remedy)
        shortest_m, longest_m = figures.get("min_line_out_m"), figures.get("max_line_out_m")
        if command.kind == SPEED and abs(command.value) > MAX_SPEED_M_PER_S:
            remedy = f"no winch runs faster than {MAX_SPEED_M_PER_S:g} m/s"
            raise Refusal("command", _words(command), remedy)
        if command.kind == LENGTH and figures and not shortest_m <= command.value <= longest_m:
            remedy = f"this winch has {shortest_m:g} to {longest_m:g} m out"
            raise Refusal("command", _words(command), remedy)

    def _check_twin(self, action: str) -> None:
        """Refuse what a lost twin might do once it is back."""
        if lost := self._lost():
            raise Refusal(action, lost, "wait until it is back; a stop can be sent")

    def _lost(self) -> str:
        """Return that the twin is lost, in words; "": it is not, or has not been found yet."""
        age_s = self._pages.readings.ages(self._clock()).get(TENSION, 0.0)
        is_lost = age_s > stale_limits_s()[TENSION]
        return f"the twin has sent nothing for {age_s:.1f} s" if is_lost else ""

    def _check_seat(self, page: Page, action: str) -> None:
        if page is not self._holder:
            holder = f"{self._holder.name} has the seat" if self._holder else "no page has the seat"
            raise Refusal(action, holder, "take the seat first")

    def _give_up(self) -> None:
        assert self._commander is not None
        self._holder, self._left_s = None, None
        self._set_points.clear()
        self._commander.release()

    def _watch_seat(self, now_s: float) -> None:
        """Drop the set-point of a winch whose seat was lost, or was not given in time.

        Repeated further, it would start the winch once the seat is free again.
        """
        for winch, set_point in list(self._set_points.items()):
            if self._commands(winch):
                set_point.confirmed = True
                if not self._overridden(winch, set_point, now_s):
                    continue
            if not set_point.confirmed and now_s - set_point.given_s <= FEEDBACK_S + REPEAT_S:
                continue
            del self._set_points[winch]
            if self._holder is not None:
                lost = set_point.confirmed
                problem = "another commander has it" if lost else "it was not given to the console"
                remedy = "the set-point is no longer repeated; send it again to command"
                notice = phrase(f"seat of {winch}", problem, remedy)
                self._pages.send(self._holder, {"type": "notice", "words": notice})

    def _overridden(self, winch: str, set_point: _SetPoint, now_s: float) -> bool:
        """Return whether a second node of this name commands: the twin has reported another
        command for FEEDBACK_S, and the seat has refused some since.
        """
        refused = _refused_in(self._seat_row(winch))
        if self._effect(winch, set_point.command) is not None:
            set_point.seen_s, set_point.refused = now_s, refused
        return refused > set_point.refused and now_s - set_point.seen_s > FEEDBACK_S

    def _entry_fault(self, page: Page, action: str) -> str:
        """Return why an entry of the log is refused, or ""."""
        if self._token is not None and not page.authorised:
            return _NO_CONTROL
        if action in _ENTRIES:
            now_s = self._clock()
            at_capacity = len(self._entries) == ENTRIES
            if at_capacity and now_s - self._entries[0] < ENTRIES_WITHIN_S:
                wait_s = math.ceil(self._entries[0] + ENTRIES_WITHIN_S - now_s)
                return phrase("log", "too many entries at once", f"try again in {wait_s} s")
            self._entries.append(now_s)
        return ""

    def _repeat(self, now_s: float) -> None:
        """Repeat the set-points; after an emergency stop, whoever gave it, only speed 0.

        To a lost twin only what is in force, and stops.
        """
        if (
            self._commander is None
            or not self._set_points
            or now_s < self._repeated_s + REPEAT_S - _SLACK_S
        ):
            return
        self._repeated_s, lost = now_s, self._lost()
        for winch, set_point in self._set_points.items():
            if self._is_stopped(winch):
                set_point.stop()
            if set_point.command in (set_point.in_force, _STOP) or not lost:
                self._commander.send(winch, set_point.command)

    def _commands(self, winch: str) -> bool:
        """Return whether the twin has this console in command of a winch."""
        return f"{winch}: {self._node}" in str(self._pages.readings.values.get("seat", ""))

    def _mode(self, winch: str) -> str:
        """Return the twin's words on the mode of a winch; "": not known."""
        return of_winch(str(self._pages.readings.values.get("winch_mode", "")), winch)

    def _is_stopped(self, winch: str) -> bool:
        """Return whether the twin reports an emergency stop of a winch."""
        return self._mode(winch).startswith(f"{winch}: emergency stop")

    # -- feedback --------------------------------------------------------------------------------

    def _winches(self) -> tuple[str, ...]:
        """Return the names of the winches: of the scene, or as they publish their state."""
        values = self._pages.readings.values
        named = (row["name"] for row in values.get("winches", ()))
        return tuple(self._pages.facts.get("winches") or named)

    def _effect(self, winch: str, command: WinchCommand) -> Outcome | None:
        """Return the twin's words on what a command has done, or None while it is not seen."""
        values = self._pages.readings.values
        mode = self._mode(winch)
        row: Mapping[str, Any] = next(
            (row for row in values.get("winches", ()) if row["name"] == winch), {}
        )
        if command.kind in CONTROL_MODES:
            unit = CONTROL_MODES[command.kind]
            order_text = f"{winch}: {command.kind} {command.value:g} {unit}"
            in_effect = mode == order_text or mode.startswith(f"{order_text} (")
            set_point = self._set_points.get(winch)
            if in_effect and set_point is not None and set_point.command == command:
                set_point.in_force = command
        elif command.kind == EMERGENCY_STOP:
            in_effect = self._is_stopped(winch)
        elif command.kind == "reset":
            in_effect = bool(mode) and not self._is_stopped(winch)
        elif command.kind in ("set_brake", "release_brake"):
            holds = row.get("brake_holds")
            in_effect = holds is not None and bool(holds) == (command.kind == "set_brake")
            mode = f"{winch}: brake {'set' if holds else 'released'}"
        else:
            compensated = row.get("compensation_on")
            wanted = command.kind == COMPENSATE
            in_effect = compensated is not None and bool(compensated) == wanted
            mode = f"{winch}: compensation {'on' if compensated else 'off'}"
        return (True, f"the twin reports {mode or _words(command)}") if in_effect else None

    @property
    def _node(self) -> str:
        return self._commander.name if self._commander else ""

    def _input_row(self, winch: str, command: WinchCommand) -> Mapping[str, Any]:
        """Return the diagnostics row of the input that takes a command; empty: not known."""
        name = input_of(command, winch).replace("_", " ")
        row: Mapping[str, Any] = self._pages.readings.values.get(
            f"diagnostics simulation: input {name}", {}
        )
        return row

    def _refused(self, winch: str, command: WinchCommand) -> int:
        """Return how many commands the twin has refused at the input that takes a command, and at
        the winch's seat.
        """
        rows = self._input_row(winch, command), self._seat_row(winch)
        return sum(_refused_in(row) for row in rows)

    def _seat_row(self, winch: str) -> Mapping[str, Any]:
        """Return the diagnostics row of the seat of a winch; empty: not known."""
        row: Mapping[str, Any] = self._pages.readings.values.get(
            f"diagnostics simulation: seat {winch}", {}
        )
        return row

    def _return_from(self, winch: str, command: WinchCommand) -> None:
        """Repeat the set-point in force in place of one that the twin refuses, or none."""
        set_point = self._set_points.get(winch)
        if set_point is None or set_point.command != command:
            return
        if set_point.in_force is None:
            del self._set_points[winch]
        else:
            set_point.command = set_point.in_force

    def _why_not(self, winch: str, command: WinchCommand, refused: int) -> str:
        """Return what is known of a command without effect.

        It is repeated no more if another one commands, if the twin is lost, or if it has refused
        more than `refused` commands, as many as before it.
        """
        values = self._pages.readings.values
        seat_refusal = self._seat_row(winch).get("values", {}).get("last rejection", "")
        holder = str(values.get("seat", ""))
        commands = self._commands(winch)
        if not commands:
            self._set_points.pop(winch, None)
        if not commands and command.kind != EMERGENCY_STOP:
            problem = f"the seat is not the console's ({holder})"
            return seat_refusal or phrase(
                _words(command), problem, "take the seat and send it again"
            )
        lost = self._lost()
        is_refused = self._refused(winch, command) > refused
        if command.kind in CONTROL_MODES and command != _STOP and (is_refused or lost):
            self._return_from(winch, command)
        row = self._input_row(winch, command)
        reason = lost or (row.get("message", "") if row.get("level") else "")
        reason = (reason or (seat_refusal if is_refused else "")).removesuffix(".")
        problem = f"no effect seen within {FEEDBACK_S:g} s"
        return phrase(_words(command), problem, reason or "look at the winch's state")

    def _answer(
        self, page: Page, number: object, done: bool, text: str, stage: str = "done"
    ) -> None:
        """Answer a request of a page; after the stage `sent` another answer follows."""
        content = {"type": "reply", "id": number, "ok": done, "words": text, "stage": stage}
        self._pages.send(page, content)


def _refused_in(row: Mapping[str, Any]) -> int:
    """Return how many commands were refused by a row of the diagnostics."""
    return int(row.get("values", {}).get("refused", 0))


def is_finite(value: object) -> TypeGuard[float]:
    """Return whether what a page sent is a finite number.

    JSON has whole numbers of any length: those above the largest float are not finite either.
    """
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and abs(value) <= sys.float_info.max  # type: ignore[arg-type]


def _words(command: WinchCommand) -> str:
    unit = CONTROL_MODES.get(command.kind)
    if unit is None:
        return command.kind.replace("_", " ")
    sign = "+" if command.kind == SPEED else ""
    return f"{command.kind} {command.value:{sign}g} {unit}"
