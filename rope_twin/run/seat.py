"""Command authority of a winch ("seat"): one node commands it at a time, others are rejected.

The sender of a command is identified by the name of its node (`senders.Senders`); a
parameter lists names by priority. The first node that sends a command takes a free seat. A node of
higher priority takes it at any time, one of equal priority only after the seat was requested or
released by a service call. Any node may trigger an emergency stop; only the commander may reset it.

A commander that leaves the network, or stops sending after a stream of commands, is lost: the seat
becomes free and the winch does what its scene specifies (`when_commander_lost`). A command that the
winch cannot execute, such as NaN or one by a clock that is wrong, neither takes nor keeps a seat: a
controller that sends nothing else is lost as if it were silent. A commander that stops sending
while a node of higher priority is present has yielded to it, and its last command remains in force.
A simulation that resumes from a saved state does not know who commanded a winch that runs: the
commander is lost unless a command comes within AWAITED_NS.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rope_twin.errors import phrase
from rope_twin.messages import Level, Status
from rope_twin.scene.rigging import winches_by_name
from rope_twin.scene.schema import Scene
from rope_twin.scene.winch import FOLLOWS_COMMANDS, SWITCHES
from rope_twin.topics import RELEASE, TAKE, service_name
from rope_twin.twin.snapshot import CONTROL_MODES, SPEED, WinchSnapshot
from rope_twin.twin.winch.commands import (
    COMMANDER_LOST,
    EMERGENCY_STOP,
    NEW_COMMANDER,
    WinchCommand,
)

ANY = "*"  # in a priority list: every node that the list does not name
PRIORITY = "local_panel console * winch_schedule"
RESERVED_S = 5.0  # how long a requested seat waits for its new commander
SILENT_NS = 2_000_000_000  # simulation time without a command after which a stream has ended
AWAITED_NS = 5_000_000_000  # after a restart, for the commander to find the simulation again
STREAM_GAP_NS = 500_000_000  # commands at shorter intervals are a stream ...
STREAM_COMMANDS = 10  # ... once there are so many
AHEAD_NS = 1_000_000_000  # a stamp further ahead is reported, except from the planning node
GONE_S = 1.0  # how long a node is missing from the graph before it is lost
QUIET_S = 1.0  # a commander that has sent a command since cannot be released by others
WARNED_S = 60.0  # how long a rejection is reported as a warning


class CommandDecision(NamedTuple):
    """Decision on a command."""

    refusal: str = ""  # why it is rejected, in one sentence; "": accepted
    is_new: bool = False  # whether the commander changes with this command


class CommandSeat:
    """Seat of one winch; times are steady-clock times [s] and simulation times [ns]."""

    def __init__(self, winch: str, priority: str, when_lost: str) -> None:
        """Make a free seat.

        `priority`: names of nodes, highest priority first; `when_lost`: the scene's setting.
        """
        self.winch, self._when_lost = winch, when_lost
        self._names = priority.split()
        if ANY not in self._names:
            self._names.append(ANY)
        self.holder = ""  # name of the commanding node; "": the seat is free
        self._former = ""  # its last holder
        self._process: object = None  # of the holder's last command; None: not known
        self.refused = 0
        self._refusal, self._refused_s = "", -WARNED_S
        self._reserved_until_s = 0.0
        self._lost = ""  # how the last commander was lost, until another one commands
        self._yielded = ""
        self._awaited_ns: int | None = None  # since when the one of before a restart is awaited
        self._commanded_s = 0.0  # arrival time of the last command
        self._newest_ns = 0  # simulation time up to which the winch was commanded
        self._streak = 0  # consecutive commands of a stream
        self._stands = True  # whether the last command was zero speed
        self._gap_ns, self._gap_s = 0, -WARNED_S  # last gap in a stream, and when it ended
        self._planner = planner_of(priority)
        self._ahead_ns = 0  # how far ahead the last command was stamped, if not by the planner
        self._unseen_s: float | None = None  # since when the holder is missing from the graph
        self._silent = False  # silent at the last check too: queued messages are read in between

    def rank(self, name: str) -> int:
        """Return the position of a node in the priority list, 0 being the highest."""
        short_name = name.rpartition("/")[2]
        for candidate in (name, short_name, ANY):
            if candidate in self._names:
                return self._names.index(candidate)
        return len(self._names)

    def judge(
        self,
        sender: str,
        order: WinchCommand,
        now_s: float,
        executable: bool = True,
        process: object = None,
    ) -> CommandDecision:
        """Accept or reject a command; an accepted one may take the seat if it is executable.

        process: that of the node; a second one with a node of the same name is another commander
        while the first one commands.
        """
        is_second = (
            sender == self.holder
            and process != self._process
            and now_s - self._commanded_s < QUIET_S
        )
        if order.kind == EMERGENCY_STOP or (sender == self.holder and not is_second):
            if sender == self.holder and executable and not is_second:
                self._process = process
            return CommandDecision()
        is_reserved = now_s < self._reserved_until_s and self.rank(sender) <= self.rank(self.holder)
        if self.holder and not is_reserved and self.rank(sender) >= self.rank(self.holder):
            remedy = f"request the seat with the service {service_name(self.winch, TAKE)}"
            which = "a second node" if is_second else "node"
            return CommandDecision(
                self._refuse(f"'{order.kind}' from {which} {sender}", remedy, now_s)
            )
        if not executable:
            return CommandDecision()
        is_new = is_second or self._former not in ("", sender)
        self.holder = self._former = sender
        self._process = process
        self._reserved_until_s = 0.0
        self._lost = self._yielded = ""
        self._awaited_ns = None
        self._streak, self._unseen_s, self._silent = 0, None, False
        return CommandDecision(is_new=is_new)

    def permit(self, kind: str, now_s: float) -> str:
        """Accept ("") or reject (why) a switch that comes by a service, which has no sender."""
        if kind == EMERGENCY_STOP or not self.holder:
            return ""
        release = service_name(self.winch, RELEASE)
        remedy = f"command it from there, or stop it there and release the seat by {release}"
        return self._refuse(f"'{kind}' by service", remedy, now_s)

    def _refuse(self, command: str, remedy: str, now_s: float) -> str:
        problem = f"{command} rejected: {self.holder} has the seat"
        self._refusal = phrase(f"winch {self.winch}", problem, remedy)
        self.refused, self._refused_s = self.refused + 1, now_s
        return self._refusal

    def note(self, order: WinchCommand, stamp_ns: int | None, now_ns: int, now_s: float) -> None:
        """Register a command of the holder.

        `stamp_ns`: simulation time of its stamp, None: apply immediately; `now_ns`, `now_s`: now.
        """
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
        """Set the holder's name once the graph knows it."""
        self.holder = self._former = name

    def resume(self, now_ns: int) -> None:
        """Continue after a pause, in which no command was due."""
        self._newest_ns = max(self._newest_ns, now_ns)

    def ask(self, now_s: float) -> tuple[bool, str]:
        """Reserve the seat for the next node of the holder's priority that commands."""
        if not self.holder:
            return True, f"seat of {self.winch} free: the first command takes it"
        self._reserved_until_s = now_s + RESERVED_S
        return True, (
            f"{self.holder} has the seat of {self.winch}; the next command within {RESERVED_S:g} s "
            "from another node of its priority takes it"
        )

    def release(self, now_s: float) -> tuple[bool, str, tuple[str, ...]]:
        """Free the seat of an idle commander; return success, text and commands to the winch."""
        if not self.holder:
            return False, f"seat of {self.winch} already free", ()
        ago_s = now_s - self._commanded_s
        if ago_s < QUIET_S:
            words = f"{self.holder} commanded {self.winch} {ago_s:.1f} s ago: it must be idle"
            return False, f"{words} for {QUIET_S:g} s", ()
        words = f"{self.holder} has released the seat of {self.winch}"
        self.holder = ""
        return True, words, (NEW_COMMANDER,) if self._stands else (COMMANDER_LOST,)

    def check(self, present: set[str], now_ns: int, now_s: float) -> tuple[str, ...]:
        """Check whether the holder is still present; return the resulting commands to the winch.

        present: names of the nodes that currently publish on its command topics.
        """
        if not self.holder:
            return self._find_former(now_ns)
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
        # a publisher whose node is not known yet, by a name with a space, may be any node's
        known_nodes = (node for node in present if " " not in node)
        higher = sorted(node for node in known_nodes if self.rank(node) < self.rank(self.holder))
        if higher:
            self._yielded = higher[0]
            return ()
        return self._lose("stopped sending valid commands", now_ns)

    def await_former(self, now_ns: int) -> None:
        """Await the commander of a winch that runs at a commanded speed, unless one is known."""
        if not self.holder:
            self._awaited_ns, self._stands = now_ns, False

    @property
    def watched(self) -> bool:
        """Return whether its commander, known or awaited, may be lost."""
        return bool(self.holder) or self._awaited_ns is not None

    def _find_former(self, now_ns: int) -> tuple[str, ...]:
        if self._awaited_ns is None or now_ns - self._awaited_ns < AWAITED_NS:
            return ()
        self._awaited_ns = None
        self.holder = "the commander of before the restart"
        return self._lose("has not come back", now_ns)

    def _lose(self, reason: str, now_ns: int) -> tuple[str, ...]:
        at_s = now_ns * 1e-9
        self._lost = f"{self.holder} {reason} at {at_s:.1f} s: {self._when_lost.replace('_', ' ')}"
        self.holder = ""
        return () if self._stands else (COMMANDER_LOST,)

    def words(self) -> str:
        """Return the text for the topic winch/seat, such as `winch: console`."""
        if self.holder:
            return f"{self.winch}: {self.holder}"
        return f"{self.winch}: free" + (f" ({self._lost})" if self._lost else "")

    def row(self, now_s: float) -> Status:
        """Return the diagnostics row on the commander and on rejected commands."""
        name = f"simulation: seat {self.winch}"
        values = {
            "commander": self.holder or "none",
            "refused": str(self.refused),
            "last rejection": self._refusal,
            "priority": " ".join(self._names),
            "when the commander is lost": self._when_lost,
        }
        level, message = Level.OK, f"{self.holder} in command"
        if not self.holder:
            message = "seat free: the first command takes it"
        if self._lost:
            level, message = Level.ERROR, f"{self._lost}; seat free"
        elif self._ahead_ns > AHEAD_NS:
            level = Level.WARN
            message += f"; its commands are stamped {self._ahead_ns * 1e-9:.1f} s ahead and are "
            message += "held until then: check its clock"
        elif self._yielded:
            level = Level.WARN
            message = f"{self.holder} has yielded to {self._yielded}: its last command remains in "
            message += f"force until {self._yielded} commands"
        if now_s - self._gap_s < WARNED_S:
            level = max(level, Level.WARN)
            message += f"; command stream interrupted for {self._gap_ns * 1e-9:.1f} s"
        if now_s - self._refused_s < WARNED_S:
            level = max(level, Level.WARN)
            message += f"; {self.refused} rejected since the start, last: {self._refusal}"
        return Status(name, level, message, values)


class Command(NamedTuple):
    """A command as received."""

    command: WinchCommand
    stamp_ns: int | None  # simulation time [ns]; None: apply immediately
    sender: str  # name of its node, or that of its publisher while the node is not known
    executable: bool = True  # False: the winch will reject it, whoever commands
    process: object = None  # any identifier of its process; None: not known


class Seats:
    """Seats of all winches of a scene; `command` receives their commands to the winches."""

    def __init__(
        self,
        scene: Scene,
        priority: str,
        order: Callable[[WinchCommand, str], object],
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now_s = now_s
        self._winches = winches_by_name(scene)
        self._by_winch = {
            name: CommandSeat(name, priority, winch.when_commander_lost)
            for name, winch in self._winches.items()
        }
        self._order = order
        self._planner = planner_of(priority)

    @property
    def winches(self) -> tuple[str, ...]:
        """Return the names of the winches."""
        return tuple(self._by_winch)

    @property
    def watched(self) -> bool:
        """Return whether any winch has a commander, or awaits that of before a restart."""
        return any(seat.watched for seat in self._by_winch.values())

    def admit(self, winch: str, command: Command, now_ns: int) -> Command | None:
        """Return the command to be passed on, or None if another node commands the winch.

        An emergency stop is executed immediately, whatever its stamp, unless the planner sent it.
        now_ns: simulation time.
        """
        seat, now_s = self._by_winch.get(winch), self._now_s()
        if seat is None:
            return command  # for no winch of this scene: the twin rejects it
        verdict = seat.judge(
            command.sender, command.command, now_s, command.executable, command.process
        )
        if verdict.refusal:
            return None
        if verdict.is_new:
            self._order(WinchCommand(NEW_COMMANDER), winch)
        if command.sender == seat.holder and command.executable:
            seat.note(command.command, command.stamp_ns, now_ns, now_s)
        is_stop = command.command.kind == EMERGENCY_STOP
        is_ahead = command.stamp_ns is not None and command.stamp_ns > now_ns
        if is_stop and is_ahead and not self.plans(command.sender):
            return command._replace(stamp_ns=None)
        return command

    def plans(self, sender: str) -> bool:
        """Return whether a node is the planning one."""
        return sender.rpartition("/")[2] == self._planner

    def name_holders(self, node_of: Callable[[str], str]) -> None:
        """Call holders that were known by a publisher by the name of its node, once that is known.

        The node's other publishers then command too. node_of: "" for any other name, and while the
        node is not known.
        """
        for seat in self._by_winch.values():
            if seat.holder and (name := node_of(seat.holder)):
                seat.rename(name)

    def permit(self, winch: str, kind: str) -> str:
        """Accept ("") or reject (why) a switch of a winch that comes by a service."""
        component = SWITCHES[kind]
        if getattr(self._winches[winch], component) is None:
            problem = f"'{kind}', but it has no {component.replace('_', ' ')}"
            return phrase(f"winch {winch}", problem, f"add `{component}` to it in the scene")
        return self._by_winch[winch].permit(kind, self._now_s())

    def resume(self, now_ns: int, winches: Sequence[WinchSnapshot] = ()) -> None:
        """Start, or continue after a pause; winches: as they run then."""
        for seat in self._by_winch.values():
            seat.resume(now_ns)
        for winch in winches:
            is_commanded = self._winches[winch.name].follows == FOLLOWS_COMMANDS
            if is_commanded and winch.mode == SPEED and winch.target != 0.0:
                self._by_winch[winch.name].await_former(now_ns)

    def check(self, present: set[str], now_ns: int) -> list[str]:
        """Check whether the commanders are still present; return a sentence for each lost one."""
        sentences = []
        for name, seat in self._by_winch.items():
            was_watched, now_s = seat.watched, self._now_s()
            for kind in seat.check(present, now_ns, now_s):
                self._order(WinchCommand(kind), name)
            if was_watched and not seat.watched:
                sentences.append(f"winch {name}: {seat.row(now_s).message}")
        return sentences

    def ask(self, winch: str) -> tuple[bool, str]:
        """Reserve a seat for the next commander; return success and text."""
        return self._by_winch[winch].ask(self._now_s())

    def release(self, winch: str) -> tuple[bool, str]:
        """Free a seat; return success and text."""
        done, words, kinds = self._by_winch[winch].release(self._now_s())
        for kind in kinds:
            self._order(WinchCommand(kind), winch)
        return done, words

    def words(self) -> str:
        """Return the commander of each winch, for the topic winch/seat."""
        return "; ".join(seat.words() for seat in self._by_winch.values())

    def doubt(self, winch: str) -> str:
        """Return the warning on the seat of a winch; "": there is none."""
        seat = self._by_winch.get(winch)
        row = None if seat is None else seat.row(self._now_s())
        return row.message if row is not None and row.level is Level.WARN else ""

    def rows(self) -> list[Status]:
        """Return a diagnostics row for each seat."""
        now_s = self._now_s()
        return [seat.row(now_s) for seat in self._by_winch.values()]


def planner_of(priority: str) -> str:
    """Return the planning node, which sends commands ahead of time: the last in the list."""
    last = priority.split()[-1:]
    return last[0] if last and last != [ANY] else ""
