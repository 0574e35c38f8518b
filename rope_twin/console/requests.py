"""Requests of the page with the seat beyond winch commands: limits of the crew, and learning.

Each is answered at once, and again with what the twin did, or with why nothing was seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from rope_twin.alerts.crew_limits import CREW_LIMITS, SCENE
from rope_twin.console.control import FEEDBACK_S, Desk
from rope_twin.console.pages import Page, Pages
from rope_twin.console.readings import crew_limit
from rope_twin.errors import did_you_mean, phrase
from rope_twin.topics import ACKNOWLEDGE_ALARM, APPLY_ESTIMATE, TARE_ESTIMATE

LEARNING = {"tare": TARE_ESTIMATE, "apply": APPLY_ESTIMATE, "acknowledge": ACKNOWLEDGE_ALARM}
Outcome = tuple[bool, str]  # whether it was done, and words


class Caller(Protocol):
    """Way to the alert list and to the services of the suite."""

    def command_alerts(self, words: str) -> None:
        """Send a command to the alert list."""

    def call(self, service: str) -> Callable[[], Outcome | None]:
        """Call a service; the result returns its answer, None while there is none."""


@dataclass
class _Awaited:
    """Request whose outcome is awaited."""

    page: Page
    number: object  # of the page's request
    outcome: Callable[[], Outcome | None]
    why_not: str  # words if there is none in time
    sent_s: float


class Requests:
    """Takes limits and requests to learning; `look` is called with every row."""

    def __init__(
        self, pages: Pages, desk: Desk, caller: Caller, clock: Callable[[], float]
    ) -> None:
        """Add the requests to those of a desk that commands."""
        self._pages, self._desk, self._caller, self._clock = pages, desk, caller, clock
        self._awaited: list[_Awaited] = []
        desk.staged |= {"limit": self._limit, "learning": self._learning}
        pages.before_tick.append(self.look)

    def look(self) -> None:
        """Answer the requests whose outcome is known or overdue."""
        now_s, left = self._clock(), []
        for one in self._awaited:
            found = one.outcome()
            if found is None and now_s - one.sent_s < FEEDBACK_S:
                left.append(one)
                continue
            done, words = found or (False, one.why_not)
            self._desk.answer(one.page, one.number, done, words)
        self._awaited = left

    def _limit(self, page: Page, content: Mapping[str, Any]) -> None:
        """Set a limit, or end it if the value is None."""
        number, name, value = content.get("id"), content.get("name"), content.get("value")
        fault = self._limit_fault(name, value)
        if fault:
            self._desk.answer(page, number, False, fault)
            return
        words = SCENE if value is None else repr(float(value))
        self._caller.command_alerts(f"limit {name} {words}")

        def outcome() -> Outcome | None:
            in_force = crew_limit(self._pages.readings.values, str(name))
            return (True, "the twin has taken it") if in_force == value else None

        why_not = phrase(f"limit {name}", "the twin does not report it", "it must be stricter than "
                         "the scene's")  # fmt: skip
        self._await(page, number, outcome, why_not)

    def _learning(self, page: Page, content: Mapping[str, Any]) -> None:
        number, what = content.get("id"), content.get("what")
        service = LEARNING.get(what) if isinstance(what, str) else None
        if service is None:
            words = phrase("learning", f"'{what}'", did_you_mean(str(what), LEARNING))
            self._desk.answer(page, number, False, words)
            return
        why_not = phrase(f"service {service}", "no answer", "learning needs a run with --learn")
        self._await(page, number, self._caller.call(service), why_not)

    def _await(
        self, page: Page, number: object, outcome: Callable[[], Outcome | None], why_not: str
    ) -> None:
        self._awaited.append(_Awaited(page, number, outcome, why_not, self._clock()))
        self._desk.answer(page, number, True, "sent", stage="sent")

    def _limit_fault(self, name: object, value: object) -> str:
        """Return why a limit is refused, in one sentence, or ""."""
        if not isinstance(name, str) or name not in CREW_LIMITS:
            return phrase("limit", f"'{name}'", did_you_mean(str(name), CREW_LIMITS))
        if value is None:
            return ""
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and math.isfinite(value) and value > 0.0):  # type: ignore[arg-type,operator]
            right = f"give a positive number in {CREW_LIMITS[name]}"
            return phrase(f"limit {name}", f"{value!r}", right)
        return ""
