"""Commands of a winch (kinds, queues, the schedule of a scene), payout and tension feedback.

A command is validated by its value and its stamp, and stored until it is due. Every runner takes
the commands of the schedule from here, so that their stamps are equal.

Tension feedback is the expected response of the rope to a change of pay-out speed within one step.
The tension is that of the last step. Over the next one the node below the hang-off continues with
its velocity, and responds to the change like the uppermost node of an endless chain of masses m·l
and springs k in one step h of the implicit Euler rule. Such a chain has at its end the stiffness

    D = (√(μ² + 4·k·μ) - μ)/2,   μ = m·l/h²,

which is k for long elements and √(EA·m)/h, the impedance over the step, for short ones. A drum that
uses F - h·D·(V' - parting) as the next tension is stable as long as the rope's true response is
less than twice that, and the step is shorter than half the time L/c that a wave takes along the
rope (otherwise its lower end responds within a step, unlike that of an endless chain). The reported
tension also includes the acceleration of the half element at the hang-off, which follows the payout
at once: for the drum that half element is inertia. V is of unstretched rope, so that it covers V
times the stretch of the separation.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.errors import did_you_mean, phrase
from rope_twin.scene.schema import RopeLine, ScheduleRow, Winch
from rope_twin.scene.winch import FOLLOWS_MEASURED, SWITCHES
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.health import AHEAD_NS, InputCounter, too_far_ahead, too_late
from rope_twin.twin.snapshot import CONTROL_MODES, DEPTH, LENGTH, SPEED, TENSION

MAX_SPEED_M_PER_S = 10.0
MAX_DEPTH_M = 12_000.0
MAX_TENSION_N = 1e9
FEEDBACK_MODES = (DEPTH, TENSION)  # control modes that need tension feedback
EMERGENCY_STOP, RESET = "emergency_stop", "reset"
SET_BRAKE, RELEASE_BRAKE = "set_brake", "release_brake"
# Sent by the monitor of the commanders, never by a commander:
NEW_COMMANDER, COMMANDER_LOST = "new_commander", "commander_lost"
COMMANDER_EVENTS = (NEW_COMMANDER, COMMANDER_LOST)
COMPENSATE, STOP_COMPENSATING = "compensate", "stop_compensating"


class WinchCommand(NamedTuple):
    """Winch command: a control mode and its set-point in the unit of CONTROL_MODES, or a switch."""

    kind: str  # of CONTROL_MODES, SWITCHES or COMMANDER_EVENTS
    value: float = 0.0


class Fault(NamedTuple):
    """Reason of a rejection: the kind under which it is counted, and the message."""

    kind: str
    sentence: str


def find_fault(command: WinchCommand, winch: WinchScene | None, rope: SpooledRope) -> Fault | None:
    """Return why a winch of this scene with this rope can never execute a command; None: it can."""
    if winch is None:
        return _impossible("this scene has no winch", "add a winch to the scene")
    kind, value = command
    if kind in COMMANDER_EVENTS:
        return None
    if kind in SWITCHES:
        key = SWITCHES[kind]
        if getattr(winch, key) is None:
            problem = f"'{kind}' but this winch has no {key.replace('_', ' ')}"
            return _impossible(problem, f"add `{key}` to it in the scene")
        return None
    if kind not in CONTROL_MODES:
        return _impossible(f"'{kind}'", did_you_mean(kind, (*CONTROL_MODES, *SWITCHES)))
    if not math.isfinite(value):
        problem = f"{kind} {value} {CONTROL_MODES[kind]}"
        return Fault("non_finite", phrase("winch command", problem, "it must be a finite number"))
    return _range_fault(command, winch, rope)


def _range_fault(command: WinchCommand, winch: WinchScene, rope: SpooledRope) -> Fault | None:
    kind, value = command
    min_m, max_m = winch.min_line_out_m, winch.max_line_out_m
    if kind == SPEED and abs(value) > MAX_SPEED_M_PER_S:
        remedy = f"no winch runs faster than {MAX_SPEED_M_PER_S:g} m/s"
        return _impossible(f"speed {value:g} m/s", remedy)
    if kind == LENGTH and not min_m <= value <= max_m:
        remedy = f"this winch has {min_m:g} to {max_m:g} m out"
        return _impossible(f"length {value:g} m", remedy)
    if kind == DEPTH and not 0.0 <= value <= MAX_DEPTH_M:
        remedy = f"depth counts from the mean water level down, 0 to {MAX_DEPTH_M:g} m"
        return _impossible(f"depth {value:g} m", remedy)
    if kind == DEPTH and value > (max_depth_m := max_m * rope.stretch - rope.hang_off_m):
        remedy = (
            f"this winch's {max_m:g} m of rope reach {max_depth_m:.1f} m, stretched until it breaks"
        )
        return _impossible(f"depth {value:g} m", remedy)
    if kind == TENSION and winch.constant_tension is None:
        problem = "'tension' but this winch has no constant tension"
        return _impossible(problem, "add `constant_tension` to it in the scene")
    if kind == TENSION and not 0.0 <= value <= MAX_TENSION_N:
        remedy = f"a rope pulls with 0 to {MAX_TENSION_N:g} N"
        return _impossible(f"tension {value:g} N", remedy)
    return None


def _impossible(problem: str, remedy: str) -> Fault:
    return Fault("impossible", phrase("winch command", problem, remedy))


REMEMBERED_COMMANDS = 32  # number of executed commands that are remembered
LATE_NS = 1_000_000_000  # a command that arrives later after its stamp is rejected
MAX_AT_ONCE = 100  # commands without a stamp that may wait for the next step
MAX_PLANNED = 1000  # commands that may wait for their stamps
Stamped = tuple[int | None, str, float]  # twin time [ns] (None: at once), kind and value


class CommandQueue:
    """Queue of one kind of commands; `submit` takes them, `due` returns them."""

    def __init__(self, name: str) -> None:
        """Create a queue for the input of this name in counts and diagnostics."""
        self.counter = InputCounter(name)
        self.waiting: deque[Stamped] = deque()
        self._newest_ns: int | None = None
        self._at_once_ns: int | None = None  # arrival of the newest command without a stamp
        self._done: deque[Stamped] = deque(maxlen=REMEMBERED_COMMANDS)
        self._in_doubt = False  # whether waiting commands are from before a pause

    def invalidate(self) -> None:
        """Make the commander's first new stamp replace the waiting commands, after a pause.

        Commands repeated from before the pause are ignored.
        """
        self._in_doubt = True

    def submit(self, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> str:
        """Queue a command with a valid value (stamp None: at once); return "" or the rejection.

        A command that arrives less than LATE_NS after its stamp is executed at once and reported as
        late. An emergency stop is never rejected for its stamp, nor for a full queue.
        """
        is_stop = command.kind == EMERGENCY_STOP
        if stamp_ns is not None:
            if self._in_doubt and (stamp_ns, *command) in self._done:
                return ""
            if self._in_doubt and now_ns <= stamp_ns <= now_ns + AHEAD_NS:
                self._drop_from(stamp_ns)
            fault = self._stamp_fault(stamp_ns, now_ns)
            if fault is not None and not is_stop:
                return self.counter.refuse(*fault)
            if fault is not None:
                self._warn_late(
                    f"{fault[1].removesuffix('.')}; executed at once all the same", now_ns
                )
                stamp_ns = None
            elif stamp_ns < now_ns:
                late_ms = (now_ns - stamp_ns) * 1e-6
                problem = f"'{command.kind}' came {late_ms:.0f} ms after its stamp"
                remedy = "it is executed at once; raise the input delay by more than that"
                self._warn_late(phrase("winch command", problem, remedy), now_ns)
        stamped = (stamp_ns, command.kind, float(command.value))
        if full := self._full_fault(stamped):
            return self.counter.refuse("impossible", full)
        self.counter.accept(now_ns if stamp_ns is None else stamp_ns)
        if stamp_ns is None:
            self._at_once_ns = now_ns
        else:
            self._newest_ns = stamp_ns
        if not (is_stop and stamped in self.waiting):
            self._queue(stamped)
        return ""

    def _stamp_fault(self, stamp_ns: int, now_ns: int) -> tuple[str, str] | None:
        """Return the kind and message of a rejection for its stamp, or None if it is valid."""
        newest_ns, at_once_ns = self._newest_ns, self._at_once_ns
        stamp_s = f"stamp {stamp_ns * 1e-9:.3f} s"
        if stamp_ns == newest_ns:
            remedy = "each command needs a stamp of its own, or none"
            return "repeated", phrase("winch command", f"{stamp_s} came twice", remedy)
        if newest_ns is not None and stamp_ns < newest_ns:
            problem = f"{stamp_s} follows {newest_ns * 1e-9:.3f} s"
            remedy = "commands must come in the order of their stamps"
            return "late", phrase("winch command", problem, remedy)
        if stamp_ns <= now_ns - LATE_NS:
            problem, remedy = too_late(stamp_ns, now_ns)
            return "late", phrase("winch command", problem, f"{remedy}, or leave the stamp 0")
        if stamp_ns < now_ns and at_once_ns is not None and stamp_ns < at_once_ns:
            problem = f"{stamp_s} lies before a command that was executed at once"
            return "late", phrase("winch command", problem, "give a stamp that is still to come")
        if stamp_ns > now_ns + AHEAD_NS:
            return "impossible", phrase("winch command", *too_far_ahead(stamp_ns, now_ns))
        return None

    def _warn_late(self, sentence: str, now_ns: int) -> None:
        self.counter.executed_late += 1
        self.counter.warn(sentence, now_ns)

    def _full_fault(self, stamped: Stamped) -> str:
        """Return why the queue is full for a command like this one; "" if it is not."""
        if stamped[1] == EMERGENCY_STOP:
            return ""
        limit = MAX_AT_ONCE if stamped[0] is None else MAX_PLANNED
        if len(self.waiting) < limit:
            return ""
        problem = f"{len(self.waiting)} of them wait already"
        return phrase("winch command", problem, "send commands when they change, or ten a second")

    def forget_plan(self) -> None:
        """Drop commands that wait for their stamps, except stops, as the commander has changed."""
        remaining = (
            stamped
            for stamped in self.waiting
            if stamped[0] is None or stamped[1] == EMERGENCY_STOP
        )
        self.waiting = deque(remaining)
        self._newest_ns = None

    def put_at_once(self, command: WinchCommand, now_ns: int) -> None:
        """Execute a command of the twin itself at once."""
        self._at_once_ns = now_ns
        self._queue((None, command.kind, float(command.value)))

    def _queue(self, stamped: Stamped) -> None:
        """Append a command; one without a stamp replaces the planned ones."""
        if stamped[0] is None:
            self.waiting.clear()
            self._newest_ns = None
        self.waiting.append(stamped)

    def due(self, time_ns: int) -> list[WinchCommand]:
        """Return the commands with stamps up to `time_ns`, in order, and remove them."""
        commands: list[WinchCommand] = []
        while self.waiting and _is_due(self.waiting[0], time_ns):
            self._done.append(self.waiting.popleft())
            commands.append(WinchCommand(*self._done[-1][1:]))
        return commands

    def last_due(self, time_ns: int) -> WinchCommand | None:
        """Return the last of the commands that `due` would return; None: none is due."""
        last = None
        for stamped in self.waiting:
            if not _is_due(stamped, time_ns):
                break
            last = stamped
        return None if last is None else WinchCommand(*last[1:])

    def _drop_from(self, stamp_ns: int) -> None:
        """Drop commands that wait for this time or later; earlier ones stay."""
        self.waiting = deque(
            stamped for stamped in self.waiting if stamped[0] is None or stamped[0] < stamp_ns
        )
        self._newest_ns = self.waiting[-1][0] if self.waiting else None
        self._in_doubt = False


class SwitchQueue(CommandQueue):
    """Queue of switches: one without a stamp precedes planned ones, which stay."""

    def _queue(self, stamped: Stamped) -> None:
        """Insert a switch without a stamp after the others without one; append a planned one."""
        if stamped[0] is not None:
            self.waiting.append(stamped)
            return
        position = sum(waiting[0] is None for waiting in self.waiting)
        self.waiting.insert(position, stamped)


def _is_due(stamped: Stamped, time_ns: int) -> bool:
    return stamped[0] is None or stamped[0] <= time_ns


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
        self._observed_ns = 0
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

    def observe(self, time_ns: int, obeyed: WinchCommand, stopped: bool) -> None:
        """Check for a missing command; obeyed: motion in force when this step began."""
        if self.differs_s is not None or time_ns - self._observed_ns < COMMAND_PERIOD_NS:
            return
        self._observed_ns = time_ns
        due_ns = time_ns - MISSING_NS
        late = not stopped and self._motion_ns < due_ns
        if (late and self._scheduled(time_ns) != obeyed) or (
            self._switches < self._switches_until(due_ns)
        ):
            self.differs_s = time_ns * 1e-9

    def _scheduled(self, time_ns: int) -> WinchCommand:
        standstill = WinchCommand(SPEED, 0.0)
        return standstill if self._winch is None else scheduled_motion(self._winch, time_ns)

    def _switches_after(self, after_ns: int, time_ns: int) -> list[str]:
        """Return the switches of the schedule with after_ns < instant <= time_ns, in order."""
        if self._winch is None or not self._winch.schedule:
            return []
        instants = sorted(set(_row_instants(self._winch, after_ns + 1, time_ns + 1)))
        return [switch for at_ns in instants for switch in _switches_at(self._winch, at_ns)]

    def _switches_until(self, time_ns: int) -> int:
        """Return the number of switches in the schedule up to a twin time."""
        if self._winch is None or time_ns < 0:
            return 0
        rows = [_at_ns(row) for row in self._winch.schedule if row.switch]
        repeat_ns = _repeat_ns(self._winch)
        if not rows or not repeat_ns:
            return sum(at_ns <= time_ns for at_ns in rows)
        repetitions, within_ns = divmod(time_ns, repeat_ns)
        rows = [at_ns for at_ns in rows if at_ns < repeat_ns]
        return repetitions * len(rows) + sum(at_ns <= within_ns for at_ns in rows)


def schedule_samples(winch: Winch | None, from_ns: int, to_ns: int) -> list[CommandSample]:
    """Return the commands with `from_ns <= stamp_ns < to_ns` (twin time), in order.

    Motion commands come on the 10 Hz grid and, without delay of a change, at each row's own
    instant; switches only at the latter. Before the first motion the speed is zero. Without a
    schedule there are none.
    """
    if winch is None or not winch.schedule or winch.follows == FOLLOWS_MEASURED:
        return []
    from_ns = max(0, from_ns)
    first = -(-from_ns // COMMAND_PERIOD_NS) * COMMAND_PERIOD_NS
    stamps = set(range(first, to_ns, COMMAND_PERIOD_NS))
    stamps.update(_row_instants(winch, from_ns, to_ns))
    samples: list[CommandSample] = []
    for stamp in sorted(stamps):
        samples += [
            CommandSample(stamp, WinchCommand(switch)) for switch in _switches_at(winch, stamp)
        ]
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
    repetitions = range(from_ns // repeat_ns, max(0, to_ns) // repeat_ns + 1)
    instants = [
        repetition * repeat_ns + row
        for repetition in repetitions
        for row in rows
        if row < repeat_ns
    ]
    # the repetition itself is a change too: the schedule restarts
    instants += [repetition * repeat_ns for repetition in repetitions if repetition > 0]
    return [instant for instant in instants if from_ns <= instant < to_ns]


class Payout(NamedTuple):
    """Payout and its rate at one instant."""

    length_m: float
    speed_m_per_s: float  # + pays out


class LineTarget(NamedTuple):
    """Target speed of the line, and the lengths within which it must be able to stop."""

    speed_m_per_s: float
    low_m: float
    high_m: float


class TensionFeedback(NamedTuple):
    """Tension feedback: the rope at the end of the last step and its expected response.

    Its tension at the next step's end is free - hold·(V' - parting) - brace·(V' - V), with V and V'
    the pay-out speeds before and after that step.
    """

    pull_n: float  # tension at the hang-off
    free_n: float  # the same at a constant pay-out speed
    depth_m: float  # of its lower end below mean water level, less the heave of the hang-off
    separation_m_per_s: float  # separation rate of hang-off and the node below it, over the step
    hold: float  # response of the elastic rope [N·s/m]
    brace: float  # response of its damping and of the half element at the hang-off [N·s/m]

    def at_speed(self, V: float) -> float:
        """Return the tension at a zero pay-out speed after this one [N]."""
        return self.free_n + self.hold * self.separation_m_per_s + self.brace * V


class SpooledRope(NamedTuple):
    """Properties of the rope on a winch that its commands and its drum depend on."""

    diameter_m: float  # on the drum
    stretch: float  # maximum stretched over unstretched length, at break
    hang_off_m: float  # mean height of the hang-off above the mean water level


UNKNOWN_ROPE = SpooledRope(0.0, math.inf, 0.0)


class WinchStep(NamedTuple):
    """One time step of a winch."""

    begin_ns: int
    step_s: float
    heave_m_per_s: float  # velocity of the hang-off, up, at the step's end
    feedback: TensionFeedback | None  # tension feedback, if a component or command needs it


def tension_feedback(
    rope: Rope, line: RopeLine, pull_n: float, boundary: Floats, motion: tuple[float, float]
) -> TensionFeedback:
    """Return the tension feedback of a rope to its winch.

    Args:
        rope: with the state at the end of the last step.
        line: its definition in the scene.
        pull_n: its tension at the hang-off then [N].
        boundary: hang-off at the beginning and end of the next step, (2, rows.MOTIONS) [m].
        motion: at its beginning heave of the hang-off [m], and acceleration of the payout [m/s²].
    """
    state, h, (heave_m, payout_m_per_s2) = rope.state, rope.model.step, motion
    n = int(state.counts[rows.ELEMENTS])
    positions = state.nodes[rows.POSITION : rows.POSITION + 3]
    depth_m = heave_m - float(positions[2, 0])
    axis = positions[:, n] - positions[:, n - 1]
    length = float(np.linalg.norm(axis))
    hang_off_velocity = (boundary[1, : rows.LINE] - boundary[0, : rows.LINE]) / h
    velocity = state.nodes[rows.VELOCITY : rows.VELOCITY + 3, n - 1]
    rest = float(state.s[n] - state.s[n - 1])
    stretch = length / rest
    separation = float(axis @ (hang_off_velocity - velocity)) / (length * stretch)
    section = int(np.searchsorted(rope.sections[rows.END], 0.5 * (state.s[n] + state.s[n - 1])))
    mass = float(rope.sections[rows.PER_METRE, section]) * rest
    free_n = pull_n + 0.5 * mass * stretch * payout_m_per_s2
    if pull_n <= 0.0:
        return TensionFeedback(pull_n, free_n, depth_m, separation, 0.0, 0.5 * mass * stretch / h)
    stiffness = line.made_of[section].rope.dynamic_n(pull_n) / rest
    damping = float(rope.sections[rows.C, section]) / rest
    combined, mu = stiffness + damping / h, mass / (h * h)
    factor = 0.5 * stretch * (sqrt(mu * mu + 4.0 * combined * mu) - mu) / combined
    brace = factor * damping + 0.5 * mass * stretch / h
    return TensionFeedback(pull_n, free_n, depth_m, separation, factor * stiffness * h, brace)
