"""Winch: it converts stamped commands into payout within its limits and those of its components.

Payout L is the unstretched length of rope below the hang-off. A command (speed, length, depth or
tension) sets the control mode, whose target the motion profile follows within the limits of
acceleration and jerk; some components add to that motion and others limit it
(`rope_twin.twin.winch`). A limit moves the profile's own line too: a winch that has rendered
continues from its actual payout.
"""

from __future__ import annotations

from dataclasses import replace

from rope_twin.core.state import Floats, Rope, Z
from rope_twin.errors import phrase
from rope_twin.scene.rigging import places, winch_of
from rope_twin.scene.schema import WINCH, RopeLine, Scene
from rope_twin.scene.winch import (
    FOLLOWS_MEASURED,
    HOLD_SPEED,
    RAMP_TO_ZERO,
    SET_THE_BRAKE,
    SWITCHES,
)
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.health import AHEAD_NS
from rope_twin.twin.snapshot import CONTROL_MODES, DEPTH, LENGTH, SPEED, InputHealth, WinchSnapshot
from rope_twin.twin.winch.commands import (
    COMMANDER_EVENTS,
    COMPENSATE,
    EMERGENCY_STOP,
    FEEDBACK_MODES,
    LATE_NS,
    NEW_COMMANDER,
    RELEASE_BRAKE,
    RESET,
    SET_BRAKE,
    UNKNOWN_ROPE,
    CommandQueue,
    Payout,
    ScheduleMonitor,
    SpooledRope,
    SwitchQueue,
    TensionFeedback,
    WinchCommand,
    WinchStep,
    find_fault,
    tension_feedback,
)
from rope_twin.twin.winch.components import Component, adding_components, drum_components
from rope_twin.twin.winch.control_modes import (
    AccelerationLimited,
    JerkLimited,
    MotionProfile,
    control_modes,
)

STALE_NS = 2_000_000_000
_WHEN_LOST = {
    HOLD_SPEED: "its last command stands",
    RAMP_TO_ZERO: "it ramps to zero speed",
    SET_THE_BRAKE: "it ramps to zero speed and sets its brake",
}
END_FRACTION = 0.75  # of the minimum payout: hard stop of a winch that could not stop before


def command_input(name: str) -> str:
    """Return the name of the command input of a winch, in counts and diagnostics."""
    return "winch_command" if name == WINCH else f"winch_command {name}"


def switch_input(name: str) -> str:
    """Return the name of the switch input of a winch."""
    return "winch_switch" if name == WINCH else f"winch_switch {name}"


def input_of(command: WinchCommand, name: str) -> str:
    """Return the name of the input that takes a command to the winch of this name."""
    return switch_input(name) if command.kind in SWITCHES else command_input(name)


class Winch:
    """One winch; `take` takes commands, `step` advances by one time step."""

    def __init__(
        self,
        scene: WinchScene | None,
        length_m: float,
        name: str = WINCH,
        rope: SpooledRope = UNKNOWN_ROPE,
    ) -> None:
        """Create the winch of the hang-off `name`; rope: properties of its rope."""
        self._commands = CommandQueue(command_input(name))
        self._switches = SwitchQueue(switch_input(name))
        self.counter, self._name = self._commands.counter, name
        self.at_limit = ""
        self._scene, self._rope = scene, rope
        self._has_switches = any(getattr(scene, key, None) for key in SWITCHES.values())
        self._line = self._nominal = Payout(length_m, 0.0)
        self._kind, self._value = SPEED, 0.0
        self._mode = 0  # index of the active control mode
        self._last = (self._line, 1.0)  # line before the last step, and that step [s]
        self._stopped = False  # emergency stop is active
        self._monitor, self._begun_ns = ScheduleMonitor(scene), -1  # beginning of the last step
        self._end_m = 0.0  # payout at which the end of a cut rope is at the sheave
        self._modes = () if scene is None else control_modes(scene)
        self._profile = None if scene is None else _profile_of(scene)
        self._adding = () if scene is None else adding_components(scene)
        self._gives_way = scene is not None and scene.passive_compensation is not None
        self._reporting, self._limiting = (
            ((), ()) if scene is None else drum_components(scene, rope.diameter_m)
        )

    def invalidate(self) -> None:
        """Make the commander's first new stamp replace the waiting commands, after a pause.

        Commands repeated from before the pause are ignored.
        """
        self._commands.invalidate()
        self._switches.invalidate()

    @property
    def line(self) -> Payout:
        """Payout and speed now."""
        return self._line

    @property
    def payout_m_per_s2(self) -> float:
        """Acceleration of the payout at the end of the last step, of the core's cubic [m/s²]."""
        before, step_s = self._last
        mean_speed = (self._line.length_m - before.length_m) / step_s
        return (
            4.0 * self._line.speed_m_per_s + 2.0 * before.speed_m_per_s - 6.0 * mean_speed
        ) / step_s

    def needs_feedback(self, time_ns: int) -> bool:
        """Return whether its step from this time on needs tension feedback."""
        if self._limiting or self._gives_way:
            return True
        due = self._commands.last_due(time_ns) if self._commands.waiting else None
        return (self._kind if due is None else due.kind) in FEEDBACK_MODES

    def feedback(
        self, rope: Rope, line: RopeLine, pull_n: float, boundary: Floats, rest_z_m: float
    ) -> TensionFeedback:
        """Return the tension feedback of its rope; arguments as of `tension_feedback`.

        rest_z_m: mean height of the hang-off [m].
        """
        motion = float(boundary[0, Z]) - rest_z_m, self.payout_m_per_s2
        return tension_feedback(rope, line, pull_n, boundary, motion)

    def take(self, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> str:
        """Submit a command (stamp None: at once); return "" or the reason for its rejection."""
        fault = find_fault(command, self._scene, self._rope)
        if fault is not None:
            return self.refuse(command, fault.sentence, fault.kind)
        if command.kind in COMMANDER_EVENTS:
            self._change_commander(command.kind, now_ns)
            return ""
        queue = self._commands if command.kind in CONTROL_MODES else self._switches
        refusal = queue.submit(stamp_ns, command, now_ns)
        if not refusal and command.kind == SPEED and self._scene is not None:
            limit = self._scene.speed_limit_m_per_s
            if abs(command.value) > limit:
                problem, remedy = (
                    f"{command.value:+.2f} m/s commanded",
                    f"it does {limit:g} m/s at most",
                )
                queue.counter.warn(phrase("winch command", problem, remedy), now_ns)
        return refusal

    def may_execute(self, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> bool:
        """Return whether it would not reject a command for its value or another clock's stamp.

        Nothing is counted; any thread may ask.
        """
        if find_fault(command, self._scene, self._rope) is not None:
            return False
        if stamp_ns is None or command.kind == EMERGENCY_STOP:
            return True
        return now_ns - LATE_NS < stamp_ns <= now_ns + AHEAD_NS

    def forbids(self, switch: str) -> str:
        """Return why it would not execute this switch now; "": it would. Any thread may ask."""
        if self._stopped and switch in (RELEASE_BRAKE, COMPENSATE):
            return phrase("winch command", f"'{switch}' in an emergency stop", "reset it first")
        return ""

    def follow(self, stamp_ns: int, length_m: float, speed_m_per_s: float | None) -> None:
        """Take a measured line out that was checked; a winch with commands does not use it."""

    def _change_commander(self, kind: str, now_ns: int) -> None:
        """Drop the former commander's plan; if it was lost, act as the scene specifies."""
        assert self._scene is not None, "orders to no winch are refused"
        self._commands.forget_plan()
        self._switches.forget_plan()
        if kind == NEW_COMMANDER:
            return
        action = self._scene.when_commander_lost
        problem = f"its commander was lost at {now_ns * 1e-9:.2f} s"
        self.counter.warn(phrase("winch command", problem, _WHEN_LOST[action]), now_ns)
        if action != HOLD_SPEED:
            self._commands.put_at_once(WinchCommand(SPEED, 0.0), now_ns)
        if action == SET_THE_BRAKE:
            self._switches.put_at_once(WinchCommand(SET_BRAKE), now_ns)

    def refuse(self, command: WinchCommand, sentence: str, kind: str = "impossible") -> str:
        """Count a command that is not for this winch as rejected; return the sentence."""
        queue = self._commands if command.kind in CONTROL_MODES else self._switches
        return queue.counter.refuse(kind, sentence)

    def newest_ns(self) -> dict[str, int]:
        """Return the stamp of the newest accepted command and switch by input name [ns]."""
        counters = (self._commands.counter, self._switches.counter)
        return {
            counter.name: counter.newest_ns for counter in counters if counter.newest_ns is not None
        }

    def health(self, now_ns: int) -> dict[str, InputHealth]:
        """Return the health of the inputs by name; of switches if the winch has any."""
        by_name = {self.counter.name: self.counter.health(now_ns, self.stale(now_ns))}
        switches = self._switches.counter
        if self._has_switches or switches.refused:
            by_name[switches.name] = switches.health(now_ns, False)
        return by_name

    def stale(self, now_ns: int) -> bool:
        """Return whether it runs on a speed command that has not been repeated for STALE_NS.

        A length, depth or tension command holds until another one comes.
        """
        newest = self.counter.newest_ns
        runs = self._kind == SPEED and self._value != 0.0
        return runs and newest is not None and now_ns - newest > STALE_NS

    def step(
        self,
        time_ns: int,
        step_s: float,
        heave_m_per_s: float = 0.0,
        feedback: TensionFeedback | None = None,
    ) -> Payout:
        """Advance from `time_ns` by one step; return payout and speed at its end.

        Commands with stamps up to `time_ns` take effect now, in order. heave_m_per_s: velocity of
        the hang-off at the step's end; feedback: tension feedback, if it `needs_feedback`.
        """
        if self._commands.waiting or self._switches.waiting:
            self._execute_due(time_ns)
        if self._scene is None:
            return self._line
        self._last, self._begun_ns = (self._line, step_s), time_ns
        self.at_limit = self._follow(step_s, feedback)
        if self._adding or self._limiting:
            self._apply_components(WinchStep(time_ns, step_s, heave_m_per_s, feedback))
        else:
            self._line = self._nominal
        if self._line.length_m < self._end_m:
            self._line = self._nominal = Payout(self._end_m, 0.0)
            self.at_limit = "the end of the rope that was cut is at the sheave"
        stale = "the command is no longer repeated; its last speed is kept"
        self.counter.set_note(stale if self.stale(time_ns) else "")
        return self._line

    def continue_from(self, line: Payout) -> None:
        """Continue from this payout and speed, as the rope returned to them after a failed step.

        Commands, switches and components are unchanged.
        """
        self._line = self._nominal = line
        self._last = (line, self._last[1])
        if self._profile is not None:
            self._profile.follow_line(line)

    def adapt_to_cut(self, lost_m: float, left_m: float) -> None:
        """Adapt to a cut: `left_m` of rope are paid out, and `lost_m` less exist in total.

        A length or depth command was for the whole rope and ends; the winch stops.
        """
        shift = left_m - self._line.length_m
        self._line, self._nominal = (
            line._replace(length_m=line.length_m + shift) for line in (self._line, self._nominal)
        )
        before, step_s = self._last
        self._last = before._replace(length_m=before.length_m + shift), step_s
        if self._scene is None:
            return
        scene = self._scene = replace(
            self._scene,
            min_line_out_m=min(self._scene.min_line_out_m, left_m),
            max_line_out_m=self._scene.max_line_out_m - lost_m,
        )
        self._modes, self._end_m = control_modes(scene), END_FRACTION * scene.min_line_out_m
        for part in self._components:
            part.set_total_length(scene.max_line_out_m)
        continues = self._kind not in (LENGTH, DEPTH)
        self._set_mode(
            WinchCommand(self._kind, self._value) if continues else WinchCommand(SPEED, 0.0)
        )

    def snapshot(self) -> WinchSnapshot | None:
        """Return its state for operators; None without a winch."""
        if self._scene is None:
            return None
        figures: dict[str, float] = {}
        for part in self._components:
            figures |= part.figures(self._line)
        mode = EMERGENCY_STOP if self._stopped else self._kind
        self._monitor.observe(self._begun_ns, WinchCommand(self._kind, self._value), self._stopped)
        fields = self._name, mode, self._value, self.at_limit, tuple(figures.items())
        return WinchSnapshot(*fields, self._monitor.differs_s)

    @property
    def _components(self) -> tuple[Component, ...]:
        return (*self._adding, *self._reporting, *self._limiting)

    def _execute_due(self, time_ns: int) -> None:
        """Execute the commands that are due; no motion during an emergency stop."""
        switches, motions = self._switches.due(time_ns), self._commands.due(time_ns)
        if switches:
            self._monitor.switches([command.kind for command in switches], self._begun_ns, time_ns)
        for command in switches:
            if refusal := self.forbids(command.kind):
                self._switches.counter.refuse("impossible", refusal)
            else:
                self._switch(command.kind, time_ns)
        if self._stopped:
            for command in motions:
                if command != WinchCommand(SPEED, 0.0):  # it is at zero speed already
                    problem = f"'{command.kind}' in an emergency stop"
                    sentence = phrase("winch command", problem, "reset it first")
                    self._commands.counter.refuse("impossible", sentence)
            return
        for command in motions:
            self._set_mode(command)
        if motions:
            self._monitor.motion(motions[-1], time_ns)

    def _set_mode(self, command: WinchCommand) -> None:
        self._kind, self._value = command
        for number, mode in enumerate(self._modes):
            if mode.kind == command.kind:
                self._mode = number
                mode.begin(command.value)

    def _switch(self, switch: str, time_ns: int) -> None:
        if switch == EMERGENCY_STOP or (switch == RESET and self._stopped):
            self._stopped = switch == EMERGENCY_STOP
            self._set_mode(WinchCommand(SPEED, 0.0))
        if switch == COMPENSATE:  # compensation starts at mid-stroke from the present line
            self._nominal = self._nominal._replace(length_m=self._line.length_m)
        for part in self._components:
            part.switch(switch, time_ns)

    def _follow(self, step_s: float, feedback: TensionFeedback | None) -> str:
        """Move the nominal line; return the active limit."""
        scene, profile = self._scene, self._profile
        assert scene is not None
        assert profile is not None
        mode = self._modes[self._mode]
        target = mode.target(self._nominal, feedback, step_s)
        if self._stopped and scene.emergency_stop is not None:
            stop = AccelerationLimited(scene.emergency_stop.deceleration_m_per_s2)
            self._nominal, _ = stop.move(self._nominal, target, step_s)
            profile.follow_line(self._nominal)
            return "emergency stop: no motion is obeyed until it is reset"
        outward = target.speed_m_per_s > 0.0
        self._nominal, brakes = profile.move(self._nominal, target, step_s)
        limit = scene.max_line_out_m if outward else scene.min_line_out_m
        if (
            brakes
            and limit == (target.high_m if outward else target.low_m)
            and self._kind != LENGTH
        ):
            return f"held at the {'most' if outward else 'least'} line out, {limit:g} m"
        return mode.words()

    def _apply_components(self, step: WinchStep) -> None:
        """Apply the components to the nominal line."""
        wanted = self._nominal
        for adding in self._adding:
            wanted = adding.add(wanted, step)
        line = wanted
        for limiting in self._limiting:
            line = limiting.hold(self._line, line, step)
        if line != wanted:
            assert self._scene is not None
            max_m = self._scene.max_line_out_m
            if line.length_m > max_m:  # a drum that renders until it is empty
                line = Payout(max_m, 0.0)
            self._shift_nominal(line, wanted)
        self._line = line
        limits = (self.at_limit, *(part.words() for part in self._components))
        self.at_limit = "; ".join(text for text in limits if text)

    def _shift_nominal(self, line: Payout, wanted: Payout) -> None:
        """Move the nominal line by the difference of the actual line from its target.

        A drive keeps its target speed; behind a brake the line restarts from standstill.
        """
        length, speed = self._nominal
        length += line.length_m - wanted.length_m
        if any(part.controls_line for part in self._limiting):
            speed += line.speed_m_per_s - wanted.speed_m_per_s
            assert self._profile is not None
            self._profile.follow_line(self._nominal)
        self._nominal = Payout(length, speed)


def winch_of_rope(scene: Scene, line: RopeLine) -> Winch:
    """Return the winch at the upper end of a rope; without one its payout is constant."""
    winch = winch_of(scene, line)
    if winch is not None and winch.follows == FOLLOWS_MEASURED:
        from rope_twin.twin.winch.following import FollowingWinch  # which derives from Winch

        resolution_m = scene.measured.line_out.resolution_m
        spooled = spooled_rope(scene, line)
        return FollowingWinch(winch, line.length_m, line.from_, spooled, resolution_m)
    return Winch(
        winch,
        line.length_m,
        line.from_,
        UNKNOWN_ROPE if winch is None else spooled_rope(scene, line),
    )


def spooled_rope(scene: Scene, line: RopeLine) -> SpooledRope:
    """Return the properties of its rope."""
    ropes = [section.rope for section in line.made_of]
    stretch = 1.0 + max(rope.strain_at(rope.breaking_load_n) for rope in ropes)
    return SpooledRope(ropes[-1].diameter_m, stretch, places(scene)[line.from_][2])


def _profile_of(scene: WinchScene) -> MotionProfile:
    acceleration = scene.acceleration_limit_m_per_s2
    if scene.jerk_limit_m_per_s3 is None:
        return AccelerationLimited(acceleration)
    return JerkLimited(acceleration, scene.jerk_limit_m_per_s3)
