"""The winch: speed commands with a stamp become line out, within its limits.

Line out L is unstretched rope below the hang-off. The speed follows the command with the
acceleration limit; ahead of the least and the most line out it brakes at that same limit, so that
it stops there.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from rope_twin.errors import phrase
from rope_twin.scene.rigging import WINCH
from rope_twin.scene.schema import Winch as WinchScene
from rope_twin.twin.health import InputCounter

IMPOSSIBLE_M_PER_S = 10.0
STALE_NS = 2_000_000_000
AHEAD_NS = 10_000_000_000  # a stamp farther in the future is a clock that is wrong
DONE = 32  # commands that are remembered after they took effect
CREEP_M_PER_S = 1e-6  # slower than this beside a limit is standstill


def command_input(name: str) -> str:
    """The name of the input that commands the winch of this name, in counts and diagnostics."""
    return "winch_command" if name == WINCH else f"winch_command {name}"


class LineOut(NamedTuple):
    """Line out and its rate at one instant."""

    length_m: float
    speed_m_per_s: float  # + pays out


class Winch:
    """One winch; `offer` takes commands, `step` moves on by one time step."""

    def __init__(self, scene: WinchScene | None, length_m: float, name: str = WINCH) -> None:
        """`name`: of the hang-off that it stands at."""
        self.counter = InputCounter(command_input(name))
        self.at_limit = ""
        self._scene = scene
        self._line = LineOut(length_m, 0.0)
        self._queue: deque[tuple[int | None, float]] = deque()
        self._newest_ns: int | None = None
        self._target = 0.0
        self._done: deque[tuple[int | None, float]] = deque(maxlen=DONE)
        self._in_doubt = False  # whether the queue is from before a pause

    def doubt(self) -> None:
        """Who commands was away: from its first new stamp on, its new plan replaces the old.

        What it repeats of the time before is known and no fault.
        """
        self._in_doubt = True

    @property
    def line(self) -> LineOut:
        """Line out and speed now."""
        return self._line

    def offer(self, stamp_ns: int | None, speed_m_per_s: float, now_ns: int) -> str:
        """Take a command (None: at once); returns "" or the sentence of its refusal."""
        refuse = self.counter.refuse
        if self._scene is None:
            return refuse("impossible", phrase("winch command", "this scene has no winch",
                                               "add a winch to the scene"))  # fmt: skip
        if not math.isfinite(speed_m_per_s):
            return refuse("non_finite", phrase("winch command", f"speed {speed_m_per_s} m/s",
                                               "it must be a finite number"))  # fmt: skip
        if abs(speed_m_per_s) > IMPOSSIBLE_M_PER_S:
            return refuse("impossible", phrase(
                "winch command", f"speed {speed_m_per_s:g} m/s",
                f"no winch runs faster than {IMPOSSIBLE_M_PER_S:g} m/s"))  # fmt: skip
        if stamp_ns is not None:
            if self._in_doubt and (stamp_ns, speed_m_per_s) in self._done:
                return ""
            if self._in_doubt and now_ns <= stamp_ns <= now_ns + AHEAD_NS:
                self._drop_from(stamp_ns)
            if stamp_ns == self._newest_ns:
                return refuse("repeated", phrase(
                    "winch command", f"stamp {stamp_ns * 1e-9:.3f} s came twice",
                    "each command needs a stamp of its own, or none"))  # fmt: skip
            if self._newest_ns is not None and stamp_ns < self._newest_ns:
                return refuse("late", phrase(
                    "winch command",
                    f"stamp {stamp_ns * 1e-9:.3f} s follows {self._newest_ns * 1e-9:.3f} s",
                    "commands must come in the order of their stamps"))  # fmt: skip
            if stamp_ns < now_ns:
                return refuse("late", phrase(
                    "winch command",
                    f"it came {(now_ns - stamp_ns) * 1e-6:.0f} ms after it was due",
                    "raise the input delay by more than that, or leave the stamp 0"))  # fmt: skip
            if stamp_ns > now_ns + AHEAD_NS:
                return refuse("impossible", phrase(
                    "winch command", f"stamp {stamp_ns * 1e-9:.1f} s lies more than 10 s ahead",
                    "sender and twin must share one clock"))  # fmt: skip
            self._newest_ns = stamp_ns
        else:
            self._queue.clear()  # what an operator wants at once does not wait for a plan
            self._newest_ns = None
        self.counter.accept(now_ns if stamp_ns is None else stamp_ns)
        self._queue.append((stamp_ns, float(speed_m_per_s)))
        return ""

    def _drop_from(self, stamp_ns: int) -> None:
        """Drop commands that wait for this time or later ones; what comes first stands."""
        self._queue = deque(c for c in self._queue if c[0] is None or c[0] < stamp_ns)
        self._newest_ns = self._queue[-1][0] if self._queue else None
        self._in_doubt = False

    def stale(self, now_ns: int) -> bool:
        """Whether it runs on a command that has not been repeated for STALE_NS."""
        newest = self.counter.newest_ns
        return self._target != 0.0 and newest is not None and now_ns - newest > STALE_NS

    def step(self, time_ns: int, step_s: float) -> LineOut:
        """Move on from `time_ns` by one step; returns line out and speed at its end.

        Commands whose stamp is not after `time_ns` take effect now, in order.
        """
        while self._queue and (self._queue[0][0] is None or self._queue[0][0] <= time_ns):
            self._done.append(self._queue.popleft())
            self._target = self._done[-1][1]
        if self._scene is None:
            return self._line
        target = self._limited_target(step_s)
        self._line = _follow(self._line, target, self._scene.acceleration_limit_m_per_s2, step_s)
        if self.stale(time_ns):
            self.counter.say("the command is no longer repeated; its last speed is kept")
        else:
            self.counter.say("")
        return self._line

    def _limited_target(self, step_s: float) -> float:
        """The commanded speed within the winch's limits; says in `at_limit` which one holds."""
        scene = self._scene
        assert scene is not None
        self.at_limit = ""
        target = self._target
        if abs(target) > scene.speed_limit_m_per_s:
            target = math.copysign(scene.speed_limit_m_per_s, target)
            self.at_limit = (
                f"{self._target:+.2f} m/s commanded; the winch does "
                f"{scene.speed_limit_m_per_s:g} m/s at most"
            )
        outward = target > 0.0
        room = (
            scene.most_line_out_m - self._line.length_m
            if outward
            else self._line.length_m - scene.least_line_out_m
        )
        outgoing = max(math.copysign(1.0, target) * self._line.speed_m_per_s, 0.0)
        braking = _braking_speed(
            room - 0.5 * step_s * outgoing, scene.acceleration_limit_m_per_s2, step_s
        )
        if abs(target) > braking:
            target = math.copysign(braking, target) if braking > CREEP_M_PER_S else 0.0
            limit = scene.most_line_out_m if outward else scene.least_line_out_m
            kind = "most" if outward else "least"
            self.at_limit = f"held at the {kind} line out, {limit:g} m"
        return target


def _braking_speed(room_m: float, acceleration: float, step_s: float) -> float:
    """Largest speed v at the end of a step after which the winch still stops in time.

    v²/(2·a) + v·h/2 = room: braking from v, and v's share of the step itself (its other half, of
    the speed at the step's start, is taken off the room by the caller).
    """
    lag = 0.5 * acceleration * step_s
    return math.sqrt(2.0 * acceleration * max(room_m, 0.0) + lag * lag) - lag


def _follow(line: LineOut, target: float, acceleration: float, step_s: float) -> LineOut:
    """Speed goes to the target with the acceleration limit; line out is its exact integral."""
    change = target - line.speed_m_per_s
    reached = abs(change) / acceleration
    if reached >= step_s:
        rate = math.copysign(acceleration, change)
        speed = line.speed_m_per_s + rate * step_s
        return LineOut(line.length_m + step_s * 0.5 * (line.speed_m_per_s + speed), speed)
    mean = 0.5 * (line.speed_m_per_s + target)
    return LineOut(line.length_m + reached * mean + (step_s - reached) * target, target)
