"""The winch: orders with a stamp become line out, within its limits and those of its parts.

Line out L is unstretched rope below the hang-off. An order (by speed, length, depth or tension)
becomes a wish, the pace follows it within the limits of acceleration and jerk, some parts add to
that motion and others hold it back (`rope_twin.twin.hoisting`). What holds it back moves the pace's
own line too: a winch that has rendered goes on from where it is.
"""

from __future__ import annotations

from dataclasses import replace

from rope_twin.errors import phrase
from rope_twin.scene.rigging import WINCH
from rope_twin.scene.rules.rigging import places, winch_of
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.scene.winch import HOLD_SPEED, RAMP_TO_ZERO, SET_THE_BRAKE, SWITCHES
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.hoisting.goals import goals_of
from rope_twin.twin.hoisting.line import UNKNOWN_ROPE, Felt, Hung, LineOut, Moment
from rope_twin.twin.hoisting.orders import (
    COMPENSATE,
    DEPTH,
    EMERGENCY_STOP,
    FEELING,
    LENGTH,
    MOTIONS,
    NEW_COMMANDER,
    RESET,
    SEAT_ORDERS,
    SET_BRAKE,
    SPEED,
    Order,
    find_fault,
)
from rope_twin.twin.hoisting.pace import AccelerationLimited, JerkLimited, Pace
from rope_twin.twin.hoisting.parts import Part, adding_parts, drum_parts
from rope_twin.twin.hoisting.queue import OrderQueue, SwitchQueue
from rope_twin.twin.hoisting.schedule import ScheduleWatch
from rope_twin.twin.snapshot import InputHealth, WinchShot

STALE_NS = 2_000_000_000
_WHEN_LOST = {
    HOLD_SPEED: "its last command stands",
    RAMP_TO_ZERO: "it ramps to zero speed",
    SET_THE_BRAKE: "it ramps to zero speed and sets its brake",
}
END_SHARE = 0.75  # of the least line out: a winch that could not stop before is stopped there


def command_input(name: str) -> str:
    """The name of the input that commands the winch of this name, in counts and diagnostics."""
    return "winch_command" if name == WINCH else f"winch_command {name}"


def switch_input(name: str) -> str:
    """The name of the input that switches parts of the winch of this name."""
    return "winch_switch" if name == WINCH else f"winch_switch {name}"


def input_of(order: Order, name: str) -> str:
    """The name of the input that takes an order to the winch of this name."""
    return switch_input(name) if order.kind in SWITCHES else command_input(name)


class Winch:
    """One winch; `take` takes orders, `step` moves on by one time step."""

    def __init__(
        self,
        scene: WinchScene | None,
        length_m: float,
        name: str = WINCH,
        hung: Hung = UNKNOWN_ROPE,
    ) -> None:
        """`name`: of the hang-off that it stands at; `hung`: the rope on it."""
        self._orders = OrderQueue(command_input(name))
        self._switches = SwitchQueue(switch_input(name))
        self.counter, self._name = self._orders.counter, name
        self.at_limit = ""
        self._scene, self._hung = scene, hung
        self._has_switches = any(getattr(scene, key, None) for key in SWITCHES.values())
        self._line = self._nominal = LineOut(length_m, 0.0)
        self._kind, self._value = SPEED, 0.0
        self._goal = 0  # of the goals, the one that the kind of order names
        self._last = (self._line, 1.0)  # the line ahead of the last step, and its length [s]
        self._stopped = False  # in an emergency
        self._watch, self._begun_ns = ScheduleWatch(scene), -1  # begin of the last step
        self._end_m = 0.0  # line out at which the end of a rope that was cut is at the sheave
        self._goals = () if scene is None else goals_of(scene)
        self._pace = None if scene is None else _pace_of(scene)
        self._adding = () if scene is None else adding_parts(scene)
        self._looking, self._holding = (
            ((), ()) if scene is None else drum_parts(scene, hung.diameter_m)
        )

    def doubt(self) -> None:
        """Who commands was away: from its first new stamp on, its new plan replaces the old.

        What it repeats of the time before is known and no fault.
        """
        self._orders.doubt()
        self._switches.doubt()

    @property
    def line(self) -> LineOut:
        """Line out and speed now."""
        return self._line

    @property
    def payout_m_per_s2(self) -> float:
        """Acceleration of the line at the end of the last step, of the cubic that the rope sees."""
        before, step_s = self._last
        way = (self._line.length_m - before.length_m) / step_s
        return (4.0 * self._line.speed_m_per_s + 2.0 * before.speed_m_per_s - 6.0 * way) / step_s

    def feels(self, time_ns: int) -> bool:
        """Whether its step from this time on asks what the rope is like."""
        if self._holding:
            return True
        due = self._orders.last_due(time_ns) if self._orders.waiting else None
        return (self._kind if due is None else due.kind) in FEELING

    def take(self, stamp_ns: int | None, order: Order, now_ns: int) -> str:
        """Take an order (None: at once); returns "" or the sentence of its refusal."""
        fault = find_fault(order, self._scene, self._hung)
        if fault is not None:
            return self.refuse(order, fault.sentence, fault.kind)
        if order.kind in SEAT_ORDERS:
            self._change_commander(order.kind, now_ns)
            return ""
        queue = self._orders if order.kind in MOTIONS else self._switches
        refusal = queue.offer(stamp_ns, order, now_ns)
        if not refusal and order.kind == SPEED and self._scene is not None:
            limit = self._scene.speed_limit_m_per_s
            if abs(order.value) > limit:
                what, right = f"{order.value:+.2f} m/s commanded", f"it does {limit:g} m/s at most"
                queue.counter.warn(phrase("winch command", what, right), now_ns)
        return refusal

    def _change_commander(self, kind: str, now_ns: int) -> None:
        """Drop the former commander's plan; if that is lost, do what the scene says."""
        assert self._scene is not None, "orders to no winch are refused"
        self._orders.forget_plan()
        self._switches.forget_plan()
        if kind == NEW_COMMANDER:
            return
        wanted = self._scene.when_commander_lost
        what = f"its commander was lost at {now_ns * 1e-9:.2f} s"
        self.counter.warn(phrase("winch command", what, _WHEN_LOST[wanted]), now_ns)
        if wanted != HOLD_SPEED:
            self._orders.put_at_once(Order(SPEED, 0.0), now_ns)
        if wanted == SET_THE_BRAKE:
            self._switches.put_at_once(Order(SET_BRAKE), now_ns)

    def refuse(self, order: Order, sentence: str, kind: str = "impossible") -> str:
        """Count an order that is not for this winch; returns the sentence."""
        queue = self._orders if order.kind in MOTIONS else self._switches
        return queue.counter.refuse(kind, sentence)

    def newest_ns(self) -> dict[str, int]:
        """Stamp of the newest accepted order and switch, by the name of the input."""
        counters = (self._orders.counter, self._switches.counter)
        return {c.name: c.newest_ns for c in counters if c.newest_ns is not None}

    def health(self, now_ns: int) -> dict[str, InputHealth]:
        """What became of the commands, by the name of the input; of switches where it has any."""
        told = {self.counter.name: self.counter.health(now_ns, self.stale(now_ns))}
        own = self._switches.counter
        if self._has_switches or own.refused:
            told[own.name] = own.health(now_ns, False)
        return told

    def stale(self, now_ns: int) -> bool:
        """Whether it runs on a command that has not been repeated for STALE_NS.

        A length, depth or tension stands until another order comes.
        """
        newest = self.counter.newest_ns
        runs = self._kind == SPEED and self._value != 0.0
        return runs and newest is not None and now_ns - newest > STALE_NS

    def step(
        self,
        time_ns: int,
        step_s: float,
        heave_m_per_s: float = 0.0,
        felt: Felt | None = None,
    ) -> LineOut:
        """Move on from `time_ns` by one step; returns line out and speed at its end.

        Commands whose stamp is not after `time_ns` take effect now, in order. `heave_m_per_s`: of
        the hang-off at the step's end; `felt`: where it `feels`.
        """
        if self._orders.waiting or self._switches.waiting:
            self._obey(time_ns)
        if self._scene is None:
            return self._line
        self._last, self._begun_ns = (self._line, step_s), time_ns
        self.at_limit = self._follow(step_s, felt)
        if self._adding or self._holding:
            self._pass_parts(Moment(time_ns, step_s, heave_m_per_s, felt))
        else:
            self._line = self._nominal
        if self._line.length_m < self._end_m:
            self._line = self._nominal = LineOut(self._end_m, 0.0)
            self.at_limit = "the end of the rope that was cut is at the sheave"
        if self.stale(time_ns):
            self.counter.say("the command is no longer repeated; its last speed is kept")
        else:
            self.counter.say("")
        return self._line

    def continue_from(self, line: LineOut) -> None:
        """Go on from this line out and speed: the rope went back to it after a failed step.

        Orders, switches and parts stay as they are.
        """
        self._line = self._nominal = line
        self._last = (line, self._last[1])
        if self._pace is not None:
            self._pace.yield_to(line)

    def lose(self, lost_m: float, left_m: float) -> None:
        """The rope was cut, `left_m` of it hang on: so much less is out, and is there at all.

        An order by length or depth was of the whole rope and ends; the winch stops.
        """
        shift = left_m - self._line.length_m
        self._line, self._nominal = (
            one._replace(length_m=one.length_m + shift) for one in (self._line, self._nominal)
        )
        before, step_s = self._last
        self._last = before._replace(length_m=before.length_m + shift), step_s
        if self._scene is None:
            return
        scene = self._scene = replace(
            self._scene,
            least_line_out_m=min(self._scene.least_line_out_m, left_m),
            most_line_out_m=self._scene.most_line_out_m - lost_m,
        )
        self._goals, self._end_m = goals_of(scene), END_SHARE * scene.least_line_out_m
        for part in self._parts:
            part.know_rope(scene.most_line_out_m)
        stands = self._kind not in (LENGTH, DEPTH)
        self._take_up(Order(self._kind, self._value) if stands else Order(SPEED, 0.0))

    def shot(self) -> WinchShot | None:
        """What it does, for operators; None without a winch."""
        if self._scene is None:
            return None
        figures: dict[str, float] = {}
        for part in self._parts:
            figures |= part.figures(self._line)
        mode = EMERGENCY_STOP if self._stopped else self._kind
        self._watch.look(self._begun_ns, Order(self._kind, self._value), self._stopped)
        return WinchShot(
            self._name,
            mode,
            self._value,
            self.at_limit,
            tuple(figures.items()),
            self._watch.differs_s,
        )

    @property
    def _parts(self) -> tuple[Part, ...]:
        return (*self._adding, *self._looking, *self._holding)

    def _obey(self, time_ns: int) -> None:
        """Take up what is due. In an emergency stop no motion is."""
        switches, motions = self._switches.due(time_ns), self._orders.due(time_ns)
        if switches:
            self._watch.switches([one.kind for one in switches], self._begun_ns, time_ns)
        for order in switches:
            self._switch(order.kind, time_ns)
        if self._stopped:
            return
        for order in motions:
            self._take_up(order)
        if motions:
            self._watch.motion(motions[-1], time_ns)

    def _take_up(self, order: Order) -> None:
        self._kind, self._value = order
        for number, goal in enumerate(self._goals):
            if goal.kind == order.kind:
                self._goal = number
                goal.begin(order.value)

    def _switch(self, switch: str, time_ns: int) -> None:
        if switch == EMERGENCY_STOP or (switch == RESET and self._stopped):
            self._stopped = switch == EMERGENCY_STOP
            self._take_up(Order(SPEED, 0.0))
        if switch == COMPENSATE:  # it begins at the middle of its stroke, where the line is
            self._nominal = self._nominal._replace(length_m=self._line.length_m)
        for part in self._parts:
            part.obey(switch, time_ns)

    def _follow(self, step_s: float, felt: Felt | None) -> str:
        """Move the nominal line; says which limit holds it."""
        scene, pace = self._scene, self._pace
        assert scene is not None
        assert pace is not None
        goal = self._goals[self._goal]
        wish = goal.wish(self._nominal, felt, step_s)
        if self._stopped and scene.emergency_stop is not None:
            stop = AccelerationLimited(scene.emergency_stop.deceleration_m_per_s2)
            self._nominal, _ = stop.move(self._nominal, wish, step_s)
            pace.yield_to(self._nominal)
            return "emergency stop: no motion is obeyed until it is reset"
        outward = wish.speed_m_per_s > 0.0
        self._nominal, held = pace.move(self._nominal, wish, step_s)
        limit = scene.most_line_out_m if outward else scene.least_line_out_m
        if held and limit == (wish.high_m if outward else wish.low_m) and self._kind != LENGTH:
            return f"held at the {'most' if outward else 'least'} line out, {limit:g} m"
        return goal.words()

    def _pass_parts(self, moment: Moment) -> None:
        """From the nominal line to the one that the parts make of it."""
        wanted = self._nominal
        for adding in self._adding:
            wanted = adding.add(wanted, moment)
        line = wanted
        for holding in self._holding:
            line = holding.hold(self._line, line, moment)
        if line != wanted:
            line = self._at_rope_end(line)
            self._give_way(line, wanted)
        self._line = line
        limits = (self.at_limit, *(part.words() for part in self._parts))
        self.at_limit = "; ".join(words for words in limits if words)

    def _at_rope_end(self, line: LineOut) -> LineOut:
        """A drum that renders until it is empty is held by the rope's end on it."""
        assert self._scene is not None
        most = self._scene.most_line_out_m
        return LineOut(most, 0.0) if line.length_m > most else line

    def _give_way(self, line: LineOut, wanted: LineOut) -> None:
        """The line did not go where it was wanted: neither did the nominal one.

        A drive goes on asking for the same speed; behind a brake it begins anew from standstill.
        """
        length, speed = self._nominal
        length += line.length_m - wanted.length_m
        if any(part.has_line for part in self._holding):
            speed += line.speed_m_per_s - wanted.speed_m_per_s
            assert self._pace is not None
            self._pace.yield_to(self._nominal)
        self._nominal = LineOut(length, speed)


def winch_of_rope(scene: Scene, line: RopeLine) -> Winch:
    """The winch at the upper end of a rope of the scene; without one its line never changes."""
    winch = winch_of(scene, line)
    return Winch(
        winch, line.length_m, line.from_, UNKNOWN_ROPE if winch is None else _hung(scene, line)
    )


def _hung(scene: Scene, line: RopeLine) -> Hung:
    """Its rope."""
    ropes = [section.rope for section in line.made_of]
    stretch = 1.0 + max(rope.strain_at(rope.breaking_load_n) for rope in ropes)
    return Hung(ropes[-1].diameter_m, stretch, places(scene)[line.from_][2])


def _pace_of(scene: WinchScene) -> Pace:
    acceleration = scene.acceleration_limit_m_per_s2
    if scene.jerk_limit_m_per_s3 is None:
        return AccelerationLimited(acceleration)
    return JerkLimited(acceleration, scene.jerk_limit_m_per_s3)
