"""Winch schedule of a scene as stamped commands, the same for every runner."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.scene.schema import ScheduleRow, Winch
from rope_twin.twin.winch.commands import DEPTH, LENGTH, SPEED, TENSION, WinchCommand

COMMAND_PERIOD_NS = 100_000_000  # commands repeat at 10 Hz, so that their absence is detected
MISSING_NS = 250_000_000  # delay after which a command of the schedule counts as missing
_MOTION_OF = {  # control mode of each key of a row
    "speed_m_per_s": SPEED,
    "line_out_m": LENGTH,
    "payload_depth_m": DEPTH,
    "tension_n": TENSION,
}


@dataclass(frozen=True)
class CommandSample:
    """Winch command that takes effect at this twin time."""

    stamp_ns: int
    command: WinchCommand


class ScheduleMonitor:
    """Monitor of deviations of a winch's commands from the scene's schedule."""

    def __init__(self, winch: Winch | None) -> None:
        self._winch = winch
        self.differs_s: float | None = None  # twin time of the first difference
        self._motion_ns = 0  # time of the last motion command
        self._looked_ns = 0
        self._switches = 0  # number of switches executed

    def motion(self, command: WinchCommand, time_ns: int) -> None:
        """Compare a motion command executed at a twin time with the schedule."""
        self._motion_ns = time_ns
        if self.differs_s is None and self._scheduled(time_ns) != command:
            self.differs_s = time_ns * 1e-9

    def switches(self, kinds: list[str], after_ns: int, time_ns: int) -> None:
        """Compare switches executed at a twin time with those scheduled since `after_ns`."""
        if self.differs_s is None and kinds != self._switches_after(after_ns, time_ns):
            self.differs_s = time_ns * 1e-9
        self._switches += len(kinds)

    def look(self, time_ns: int, obeyed: WinchCommand, stopped: bool) -> None:
        """Check for a missing command; obeyed: motion in force when this step began."""
        if self.differs_s is not None or time_ns - self._looked_ns < COMMAND_PERIOD_NS:
            return
        self._looked_ns = time_ns
        due_ns = time_ns - MISSING_NS
        late = not stopped and self._motion_ns < due_ns
        if (late and self._scheduled(time_ns) != obeyed) or (
            self._switches < self._switches_until(due_ns)
        ):
            self.differs_s = time_ns * 1e-9

    def _scheduled(self, time_ns: int) -> WinchCommand:
        rest = WinchCommand(SPEED, 0.0)
        return rest if self._winch is None else scheduled_motion(self._winch, time_ns)

    def _switches_after(self, after_ns: int, time_ns: int) -> list[str]:
        """Return the switches of the schedule with after_ns < instant <= time_ns, in order."""
        if self._winch is None or not self._winch.schedule:
            return []
        instants = sorted(set(_row_instants(self._winch, after_ns + 1, time_ns + 1)))
        return [word for at_ns in instants for word in _switches_at(self._winch, at_ns)]

    def _switches_until(self, time_ns: int) -> int:
        """Return the number of switches in the schedule up to a twin time."""
        if self._winch is None or time_ns < 0:
            return 0
        rows = [_at_ns(row) for row in self._winch.schedule if row.switch]
        repeat_ns = _repeat_ns(self._winch)
        if not rows or not repeat_ns:
            return sum(at_ns <= time_ns for at_ns in rows)
        rounds, within_ns = divmod(time_ns, repeat_ns)
        rows = [at_ns for at_ns in rows if at_ns < repeat_ns]
        return rounds * len(rows) + sum(at_ns <= within_ns for at_ns in rows)


def schedule_samples(winch: Winch | None, from_ns: int, to_ns: int) -> list[CommandSample]:
    """Return the commands with `from_ns <= stamp_ns < to_ns` (twin time), in order.

    Motion commands come on the 10 Hz grid and, without delay of a change, at each row's own
    instant; switches only at the latter. Before the first motion the speed is zero. Without a
    schedule there are none.
    """
    if winch is None or not winch.schedule:
        return []
    from_ns = max(0, from_ns)
    first = -(-from_ns // COMMAND_PERIOD_NS) * COMMAND_PERIOD_NS
    stamps = set(range(first, to_ns, COMMAND_PERIOD_NS))
    stamps.update(_row_instants(winch, from_ns, to_ns))
    samples: list[CommandSample] = []
    for stamp in sorted(stamps):
        samples += [CommandSample(stamp, WinchCommand(word)) for word in _switches_at(winch, stamp)]
        samples.append(CommandSample(stamp, scheduled_motion(winch, stamp)))
    return samples


def scheduled_motion(winch: Winch, stamp_ns: int) -> WinchCommand:
    """Return the motion command of the schedule at a twin time."""
    repeat_ns = _repeat_ns(winch)
    within_ns = stamp_ns % repeat_ns if repeat_ns else stamp_ns
    motion = WinchCommand(SPEED, 0.0)
    for row in winch.schedule:
        if _at_ns(row) > within_ns:
            break
        motion = motion_of(row) or motion
    return motion


def motion_of(row: ScheduleRow) -> WinchCommand | None:
    """Return the motion command of a row; None if it is a switch."""
    for key, kind in _MOTION_OF.items():
        if (value := getattr(row, key)) is not None:
            return WinchCommand(kind, value)
    return None


def _switches_at(winch: Winch, stamp_ns: int) -> list[str]:
    """Return the switches of the rows at this instant."""
    repeat_ns = _repeat_ns(winch)
    within_ns = stamp_ns % repeat_ns if repeat_ns else stamp_ns
    return [row.switch for row in winch.schedule if row.switch and _at_ns(row) == within_ns]


def _at_ns(row: ScheduleRow) -> int:
    return round(row.at_s * 1e9)


def _repeat_ns(winch: Winch) -> int:
    return round((winch.schedule_repeats_every_s or 0.0) * 1e9)


def _row_instants(winch: Winch, from_ns: int, to_ns: int) -> list[int]:
    """Return the instants of rows within [from_ns, to_ns), over all repetitions [ns]."""
    repeat_ns = _repeat_ns(winch)
    rows = [_at_ns(row) for row in winch.schedule]
    if not repeat_ns:
        return [row for row in rows if from_ns <= row < to_ns]
    rounds = range(from_ns // repeat_ns, max(0, to_ns) // repeat_ns + 1)
    instants = [again * repeat_ns + row for again in rounds for row in rows if row < repeat_ns]
    # the repetition itself is a change too: the schedule restarts
    instants += [again * repeat_ns for again in rounds if again > 0]
    return [instant for instant in instants if from_ns <= instant < to_ns]
