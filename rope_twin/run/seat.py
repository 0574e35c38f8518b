"""The commander's seat of a winch: one node commands it at a time, the others are refused.

Who sends a command is known by the name of its node (`company.Senders`); a parameter lists names
by priority. The first that sends a command takes a free seat; a node of higher priority takes it
at any time, one of equal priority only after the seat was asked for or released on a service.
An emergency stop is everybody's, its reset only the commander's.

A commander that leaves the network, or falls silent after a stream of commands, is lost: the seat
is free and the winch does what its scene says (`when_commander_lost`). One that falls silent while
a node of higher priority is there has yielded to it, and its last command stands.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

from rope_twin.errors import phrase
from rope_twin.messages import Level, Status
from rope_twin.scene.rigging import WINCH
from rope_twin.scene.rules.rigging import winches_by_name
from rope_twin.scene.schema import Scene
from rope_twin.twin.winch.commands import (
    COMMANDER_LOST,
    CONTROL_MODES,
    EMERGENCY_STOP,
    NEW_COMMANDER,
    SPEED,
    WinchCommand,
)

ANY = "*"  # in a list of priorities: every node that is not in it
PRIORITY = "local_panel console * winch_schedule"
RESERVED_S = 5.0  # how long an asked-for seat waits for its new commander
SILENT_NS = 2_000_000_000  # twin time after which a stream of commands has ended
STREAM_GAP_NS = 500_000_000  # commands that follow each other faster are a stream ...
STREAM_COMMANDS = 10  # ... once there are so many
AHEAD_NS = 1_000_000_000  # a stamp further ahead is reported, but of the node that plans
GONE_S = 1.0  # how long a node is out of sight before it is lost
QUIET_S = 1.0  # a commander that has sent something since is not released by others
WARNED_S = 60.0  # how long a refusal is warned of


class Verdict(NamedTuple):
    """What becomes of a command."""

    refusal: str = ""  # why it is not for the twin, in one sentence
    is_new: bool = False  # whether another node commands from now on than the last one


class CommandSeat:
    """The seat of one winch; times are of the steady clock [s] and of the twin [ns]."""

    def __init__(self, winch: str, priority: str, when_lost: str) -> None:
        """`priority`: names of nodes from the highest down; `when_lost`: of the scene's winch."""
        self.winch, self._when_lost = winch, when_lost
        self._names = priority.split()
        if ANY not in self._names:
            self._names.append(ANY)
        self.holder = ""  # name of the node that commands; "": the seat is free
        self._former = ""  # the last one that had it
        self.refused = 0
        self._refusal, self._refused_s = "", -WARNED_S
        self._reserved_until_s = 0.0
        self._lost = ""  # how the last commander was lost, until another one commands
        self._yielded = ""
        self._commanded_s = 0.0  # when the newest command came
        self._newest_ns = 0  # twin time up to which it was commanded
        self._streak = 0  # commands that followed each other in a stream
        self._stands = True  # whether the last command is to stand still
        self._gap_ns, self._gap_s = 0, -WARNED_S  # the newest hole in a stream, and when it ended
        self._planner = planner_of(priority)
        self._ahead_ns = 0  # by how much the newest was stamped ahead, of one that does not plan
        self._unseen_s: float | None = None  # since when the holder is out of sight
        self._silent = False  # at the last look too: what waits in the middleware is taken first

    def rank(self, name: str) -> int:
        """Place of a node in the list of priorities, 0 the highest."""
        own = name.rpartition("/")[2]
        for one in (name, own, ANY):
            if one in self._names:
                return self._names.index(one)
        return len(self._names)

    def judge(self, sender: str, order: WinchCommand, now_s: float) -> Verdict:
        """Let a command through to the twin, or refuse it; it may take the seat."""
        if order.kind == EMERGENCY_STOP or sender == self.holder:
            return Verdict()
        is_reserved = now_s < self._reserved_until_s and self.rank(sender) <= self.rank(self.holder)
        if self.holder and not is_reserved and self.rank(sender) >= self.rank(self.holder):
            what = f"'{order.kind}' of node {sender} is refused: {self.holder} has the seat"
            right = f"ask for it on the service {service_name(self.winch, TAKE)}"
            self._refusal = phrase(f"winch {self.winch}", what, right)
            self.refused, self._refused_s = self.refused + 1, now_s
            return Verdict(self._refusal)
        is_new = self._former not in ("", sender)
        self.holder = self._former = sender
        self._reserved_until_s = 0.0
        self._lost = self._yielded = ""
        self._streak, self._unseen_s, self._silent = 0, None, False
        return Verdict(is_new=is_new)

    def note(self, order: WinchCommand, stamp_ns: int | None, now_ns: int, now_s: float) -> None:
        """Note a command of the holder: twin time of its stamp (None: at once) and now."""
        self._commanded_s = now_s
        if order.kind not in CONTROL_MODES:
            return
        until_ns = now_ns if stamp_ns is None else max(now_ns, stamp_ns)
        gap_ns = until_ns - self._newest_ns
        if self._streak >= STREAM_COMMANDS and gap_ns > STREAM_GAP_NS and not self._stands:
            self._gap_ns, self._gap_s = gap_ns, now_s
        self._streak = self._streak + 1 if gap_ns < STREAM_GAP_NS else 1
        self._newest_ns = max(self._newest_ns, until_ns)
        self._stands = order == WinchCommand(SPEED, 0.0)
        plans = self.holder.rpartition("/")[2] == self._planner
        self._ahead_ns = 0 if plans else until_ns - now_ns
        self._silent, self._yielded = False, ""

    def rename(self, name: str) -> None:
        """The holder's name has become known."""
        self.holder = self._former = name

    def resume(self, now_ns: int) -> None:
        """The twin goes on after a pause, in which no command was due."""
        self._newest_ns = max(self._newest_ns, now_ns)

    def ask(self, now_s: float) -> tuple[bool, str]:
        """Reserve the seat for the next node of the holder's priority that commands."""
        if not self.holder:
            return True, f"the seat of {self.winch} is free: the first command takes it"
        self._reserved_until_s = now_s + RESERVED_S
        return True, (
            f"{self.holder} has the seat of {self.winch}; the next other node of its priority that "
            f"commands within {RESERVED_S:g} s gets it"
        )

    def release(self, now_s: float) -> tuple[bool, str, tuple[str, ...]]:
        """Free the seat of a commander that is quiet; success, words, and orders to the winch."""
        if not self.holder:
            return False, f"the seat of {self.winch} is free already", ()
        ago_s = now_s - self._commanded_s
        if ago_s < QUIET_S:
            words = f"{self.holder} has commanded {self.winch} {ago_s:.1f} s ago: it must be quiet"
            return False, f"{words} for {QUIET_S:g} s", ()
        words = f"{self.holder} has released the seat of {self.winch}"
        self.holder = ""
        return True, words, (NEW_COMMANDER,) if self._stands else (COMMANDER_LOST,)

    def look(self, present: set[str], now_ns: int, now_s: float) -> tuple[str, ...]:
        """See whether the holder is still there; what to order the winch to do.

        present: names of the nodes that publish on its command topics now.
        """
        if not self.holder:
            return ()
        if self.holder not in present:
            self._unseen_s = now_s if self._unseen_s is None else self._unseen_s
            if now_s - self._unseen_s >= GONE_S:
                return self._lose("left the network", now_ns)
            return ()
        self._unseen_s = None
        streamed = self._streak >= STREAM_COMMANDS and not self._stands
        if not streamed or now_ns - self._newest_ns <= SILENT_NS:
            self._silent = False
            return ()
        if not self._silent:
            self._silent = True
            return ()
        above = sorted(one for one in present if self.rank(one) < self.rank(self.holder))
        if above:
            self._yielded = above[0]
            return ()
        return self._lose("fell silent", now_ns)

    def _lose(self, how: str, now_ns: int) -> tuple[str, ...]:
        at_s = now_ns * 1e-9
        self._lost = f"{self.holder} {how} at {at_s:.1f} s: {self._when_lost.replace('_', ' ')}"
        self.holder = ""
        return () if self._stands else (COMMANDER_LOST,)

    def words(self) -> str:
        """Like `winch: console`, for the topic winch/seat."""
        if self.holder:
            return f"{self.winch}: {self.holder}"
        return f"{self.winch}: free" + (f" ({self._lost})" if self._lost else "")

    def row(self, now_s: float) -> Status:
        """Diagnostics: who commands, and whom it was refused to."""
        name = f"simulation: seat {self.winch}"
        values = {
            "commander": self.holder or "none",
            "refused": str(self.refused),
            "newest refusal": self._refusal,
            "priority": " ".join(self._names),
            "when the commander is lost": self._when_lost,
        }
        level, message = Level.OK, f"{self.holder} commands"
        if not self.holder:
            message = "the seat is free: the first command takes it"
        if self._lost:
            level, message = Level.ERROR, f"{self._lost}; the seat is free"
        elif self._ahead_ns > AHEAD_NS:
            level = Level.WARN
            message += (
                f"; its commands are stamped {self._ahead_ns * 1e-9:.1f} s ahead and wait for "
            )
            message += "their time: its clock may be wrong"
        elif self._yielded:
            level = Level.WARN
            message = f"{self.holder} is silent, as {self._yielded} is there: its last command"
            message += f" stands until {self._yielded} commands"
        if now_s - self._gap_s < WARNED_S:
            level = max(level, Level.WARN)
            message += f"; its commands stopped for {self._gap_ns * 1e-9:.1f} s in between"
        if now_s - self._refused_s < WARNED_S:
            level = max(level, Level.WARN)
            message += f"; {self.refused} refused since the start, the newest: {self._refusal}"
        return Status(name, level, message, values)


class Command(NamedTuple):
    """A command as it came."""

    command: WinchCommand
    stamp_ns: int | None  # twin time [ns]; None: at once
    sender: str  # name of its node, or what `publisher` says while that is not known
    publisher: str = ""  # what the sender was called before its name was known


class Seats:
    """The seats of all winches of a scene; `command` takes what they order the winches to do."""

    def __init__(
        self,
        scene: Scene,
        priority: str,
        order: Callable[[WinchCommand, str], None],
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now_s = now_s
        self._by_winch = {
            name: CommandSeat(name, priority, winch.when_commander_lost)
            for name, winch in winches_by_name(scene).items()
        }
        self._order = order
        self._planner = planner_of(priority)

    @property
    def winches(self) -> tuple[str, ...]:
        """Names of the winches."""
        return tuple(self._by_winch)

    @property
    def taken(self) -> bool:
        """Whether any winch has a commander."""
        return any(seat.holder for seat in self._by_winch.values())

    def admit(self, winch: str, command: Command, now_ns: int) -> Command | None:
        """Judge a command; as it is for the twin, or None if another node commands the winch.

        A stop of a sender that does not plan is executed at once, by whatever clock it is stamped.
        now_ns: twin time.
        """
        seat, now_s = self._by_winch.get(winch), self._now_s()
        if seat is None:
            return command  # for no winch of this scene: the twin refuses it
        if command.publisher and seat.holder == command.publisher:
            seat.rename(command.sender)
        verdict = seat.judge(command.sender, command.command, now_s)
        if verdict.refusal:
            return None
        if verdict.is_new:
            self._order(WinchCommand(NEW_COMMANDER), winch)
        if command.sender == seat.holder:
            seat.note(command.command, command.stamp_ns, now_ns, now_s)
        is_stop = command.command.kind == EMERGENCY_STOP
        ahead = command.stamp_ns is not None and command.stamp_ns > now_ns
        if is_stop and ahead and command.sender.rpartition("/")[2] != self._planner:
            return command._replace(stamp_ns=None)
        return command

    def resume(self, now_ns: int) -> None:
        """The twin begins, or goes on after a pause."""
        for seat in self._by_winch.values():
            seat.resume(now_ns)

    def look(self, present: set[str], now_ns: int) -> list[str]:
        """See whether the commanders are still there; what was found, a sentence each."""
        found = []
        for name, seat in self._by_winch.items():
            held, now_s = seat.holder, self._now_s()
            for kind in seat.look(present, now_ns, now_s):
                self._order(WinchCommand(kind), name)
            if held and not seat.holder:
                found.append(f"winch {name}: {seat.row(now_s).message}")
        return found

    def ask(self, winch: str) -> tuple[bool, str]:
        """Reserve a seat for the next commander; success and words."""
        return self._by_winch[winch].ask(self._now_s())

    def release(self, winch: str) -> tuple[bool, str]:
        """Free a seat; success and words."""
        done, words, kinds = self._by_winch[winch].release(self._now_s())
        for kind in kinds:
            self._order(WinchCommand(kind), winch)
        return done, words

    def words(self) -> str:
        """Who commands each winch, for the topic winch/seat."""
        return "; ".join(seat.words() for seat in self._by_winch.values())

    def rows(self) -> list[Status]:
        """Diagnostics of each."""
        now_s = self._now_s()
        return [seat.row(now_s) for seat in self._by_winch.values()]


def planner_of(priority: str) -> str:
    """Return the node that sends its commands ahead of their time: the last one that is named."""
    last = priority.split()[-1:]
    return last[0] if last and last != [ANY] else ""


TAKE, RELEASE = "take_seat", "release_seat"


def service_name(winch: str, what: str) -> str:
    """The service for the seat of a winch: winch/take_seat, of another one winch/NAME/take_seat."""
    return f"winch/{what}" if winch == WINCH else f"winch/{winch}/{what}"
