"""Components of a winch: active and passive heave compensation, drum, motor and brake.

Active heave compensation (AHC) pays out as the hang-off rises. Its speed follows
efficiency·e^(-iω·delay)/(1 + iω·lag) of the hang-off's velocity, so that a steady heave of
amplitude A leaves the payload's end of a stiff line |1 - that factor|·A. Active limits of stroke,
speed and acceleration are reported.

Motor or brake bring the line to the commanded speed with the line pull that this takes, up to their
torque over the drum's present radius r; beyond that the winch renders:

    (J/r²)·(V' - V)/h = F' - P,   F' = F - hold·(V' - parting) - brace·(V' - V)

with F the tension of the last step, V and V' the pay-out speed before and after the step and P the
line pull. F' is the expected response of the rope (`payout`): the drum is integrated implicitly in
the rope's stiffness and stays stable at any inertia. With F instead, J/r² would have to exceed half
the impedance over the step, h·√(EA·m)/2.

At a passive heave compensator the rope runs over a flying sheave on a gas spring. The sheave, of
mass m, hangs in f falls of the rope and is held by the spring, whose tension is that of
`effects.compensator` at its stroke x; line out is that of the winch and f·x in addition:

    m·d²x/dt² = f·F - (G(s) + N(x) + c_1·v + c_2·|v|·v + F_f).

F is the expected tension at the step's end, as for a drum: F' = F - hold·(V' -
parting) - brace·(V' - V) with the pay-out speed V' = V_winch + f·v', at least 0. The step is that
of the implicit Euler rule in v and of the trapezoidal rule in x, so that it stays stable with a
stop of any stiffness; it is of first order. At the start the stroke is that of the static tension.
As for a drum the line paid out is unstretched: the rope moves by its stretch in addition.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from rope_twin.effects.compensator import SEALS, CompensatorForces, forces, of
from rope_twin.quantity import kilonewtons
from rope_twin.scene import winch as winch_parts
from rope_twin.scene.winch import HeaveCompensation, PassiveCompensation
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.winch.commands import (
    COMPENSATE,
    EMERGENCY_STOP,
    RELEASE_BRAKE,
    SET_BRAKE,
    STOP_COMPENSATING,
    Payout,
    WinchStep,
)
from rope_twin.twin.winch.control_modes import braking_speed

States = dict[str, float]
MAX_ITERATIONS, RELATIVE_TOL = 80, 1e-13


class Component:
    """Component of a winch; the defaults are those without states, limit, switch or rope."""

    _at_limit = ""

    def figures(self, line: Payout) -> States:
        """Return the states for operators, the unit in the name."""
        return {}

    def words(self) -> str:
        """Return the active limit; "" if none."""
        return self._at_limit

    @property
    def controls_line(self) -> bool:
        """Whether it alone controls the line, as a brake that holds."""
        return False

    def switch(self, switch: str, time_ns: int) -> None:
        """Execute a switch command, which may be for another component."""

    def set_total_length(self, whole_m: float) -> None:
        """Set the total length of rope, paid out or on the drum [m]."""


class Layers(Component):
    """Drum layer, radius and speed."""

    def __init__(self, machine: WinchDrum) -> None:
        self._machine = machine

    def figures(self, line: Payout) -> States:
        """Return layer, radius and speed, + pays out."""
        layer, radius = self._machine.layer(line.length_m)
        return {
            "layer": float(layer),
            "drum_radius_m": radius,
            "drum_speed_rad_per_s": line.speed_m_per_s / radius,
        }

    def set_total_length(self, whole_m: float) -> None:
        """Set the total length; the length not paid out is on the drum."""
        self._machine.whole_m = whole_m


def adding_components(scene: WinchScene) -> tuple[Compensation | FlyingSheave, ...]:
    """Return the components that add to the motion, in their order."""
    active, passive = scene.heave_compensation, scene.passive_compensation
    components = () if active is None else (Compensation(active),)
    return components if passive is None else (*components, FlyingSheave(passive))


def drum_components(
    scene: WinchScene, diameter_m: float
) -> tuple[tuple[Component, ...], tuple[Drive | Brake, ...]]:
    """Return the components that report the motion, and those that limit it, in their order."""
    if scene.drum is None:
        return (), ()
    machine = WinchDrum(scene.drum, diameter_m, scene.max_line_out_m)
    reporting = (Layers(machine),)
    if scene.drive is None:
        return reporting, ()
    drive = Drive(scene.drive, machine)
    if scene.brake is None:
        return reporting, (drive,)
    return reporting, (drive, Brake(scene.brake, drive))


class Compensation(Component):
    """Heave compensation of a winch; `add` is called once a step."""

    def __init__(self, params: HeaveCompensation) -> None:
        self._params = params
        self._on = True
        self._stroke = self._rate = 0.0  # payout added to the command [m], and its rate [m/s]
        self._seen: deque[tuple[int, float]] = deque()  # time [ns], velocity of the hang-off [m/s]
        self._delayed = self._lagged = 0.0  # the velocity after the dead time, and after the lag
        self._at_limit = ""

    def add(self, wanted: Payout, step: WinchStep) -> Payout:
        """Return the line at the end of the step, including the stroke."""
        params, h = self._params, step.step_s
        self._measure(step)
        target = params.efficiency * self._lagged if self._on else 0.0
        limit = params.speed_limit_m_per_s
        speed = min(max(target, -limit), limit)
        max_change = params.acceleration_limit_m_per_s2 * h
        rate = self._rate + min(max(speed - self._rate, -max_change), max_change)
        rate = self._within_stroke(rate, h)
        self._at_limit = self._limit_words(target, rate)
        stroke = self._stroke + 0.5 * h * (self._rate + rate)
        if abs(stroke) > params.stroke_m:  # in the last step of braking, by less than a·h²/8
            stroke, rate = math.copysign(params.stroke_m, stroke), 0.0
        self._stroke, self._rate = stroke, rate
        return Payout(wanted.length_m + self._stroke, wanted.speed_m_per_s + rate)

    def _measure(self, step: WinchStep) -> None:
        """Apply dead time and lag to the hang-off's velocity at the end of the step."""
        end_ns, h, lag = (
            step.begin_ns + round(step.step_s * 1e9),
            step.step_s,
            self._params.lag_s,
        )
        self._seen.append((end_ns, step.heave_m_per_s))
        at_ns = end_ns - round(self._params.delay_s * 1e9)
        while len(self._seen) > 2 and self._seen[1][0] <= at_ns:
            self._seen.popleft()
        before, self._delayed = self._delayed, _velocity_at(self._seen, at_ns)
        if lag > 0.0:  # exact for a velocity that is linear over the step
            slope, keep = (self._delayed - before) / h, math.exp(-h / lag)
            self._lagged = (
                self._delayed - lag * slope + (self._lagged - before + lag * slope) * keep
            )
        else:
            self._lagged = self._delayed

    def _within_stroke(self, rate: float, step_s: float) -> float:
        """Return a rate from which it can still stop within its stroke."""
        sign = math.copysign(1.0, rate)
        remaining = self._params.stroke_m - sign * self._stroke
        outward_rate = max(sign * self._rate, 0.0)
        acceleration = self._params.acceleration_limit_m_per_s2
        return sign * min(
            abs(rate), braking_speed(remaining - 0.5 * step_s * outward_rate, acceleration, step_s)
        )

    def _limit_words(self, target: float, rate: float) -> str:
        params = self._params
        if abs(target) > params.speed_limit_m_per_s:
            return f"heave compensation at its speed limit, {params.speed_limit_m_per_s:g} m/s"
        if params.stroke_m - abs(self._stroke) < 1e-2 * params.stroke_m and abs(rate) < abs(target):
            return f"heave compensation at the end of its stroke, {params.stroke_m:g} m"
        return ""

    def switch(self, switch: str, time_ns: int) -> None:
        """Switch on or off; an emergency stop stops it too."""
        if switch in (COMPENSATE, STOP_COMPENSATING, EMERGENCY_STOP):
            self._on = switch == COMPENSATE
        if switch == COMPENSATE:
            self._stroke = 0.0  # mid-stroke is the present line

    def figures(self, line: Payout) -> dict[str, float]:
        """Return stroke and its rate, + paid out, and whether it is on."""
        return {
            "compensation_m": self._stroke,
            "compensation_m_per_s": self._rate,
            "compensation_on": float(self._on),
        }


def _velocity_at(samples: deque[tuple[int, float]], at_ns: int) -> float:
    """Return the velocity at a time, linear between samples; 0 before the first."""
    (t0, v0), (t1, v1) = samples[0], samples[min(1, len(samples) - 1)]
    if at_ns < t0:
        return 0.0
    return v0 + (v1 - v0) * min((at_ns - t0) / (t1 - t0), 1.0) if t1 > t0 else v0


SLIP_TOL_M_PER_S = 1e-6  # a slower drum under a set brake counts as standing


class WinchDrum:
    """Drum with its layers of rope."""

    def __init__(self, drum: winch_parts.Drum, diameter_m: float, max_line_out_m: float) -> None:
        """Take the total length of the rope; the length not paid out is on the drum."""
        self._drum, self._diameter, self.whole_m = drum, diameter_m, max_line_out_m

    def layer(self, line_out_m: float) -> tuple[int, float]:
        """Return the layer from which rope leaves the drum, and its radius [m]."""
        layer = self._drum.layer_of(self.whole_m - line_out_m, self._diameter)
        return layer, self._drum.radius_m(layer, self._diameter)


class Drive(Component):
    """Motor of the winch."""

    def __init__(self, params: winch_parts.Drive, machine: WinchDrum) -> None:
        self._params, self._machine = params, machine
        self._torque = 0.0  # + hauls in [N·m]
        self._at_limit = ""

    def hold(self, before: Payout, wanted: Payout, step: WinchStep) -> Payout:
        """Return the commanded line, or as far as the torque moves it."""
        after, self._torque, sufficient = self.pull(
            before, wanted, step, self._params.torque_limit_n_m
        )
        self._at_limit = "" if sufficient else self._limit_words(before, wanted, after, step)
        return after

    def pull(
        self, before: Payout, wanted: Payout, step: WinchStep, torque_n_m: float
    ) -> tuple[Payout, float, bool]:
        """Return the line after a step with at most this torque, the torque, and whether it was
        sufficient.
        """
        feedback, h = step.feedback, step.step_s
        assert feedback is not None, "tension feedback is missing"
        _, radius = self._machine.layer(before.length_m)
        inertia = self._params.inertia_kg_m2 / (radius * radius * h)
        response, V = inertia + feedback.hold + feedback.brace, before.speed_m_per_s
        stopping_n = inertia * V + feedback.at_speed(V)  # line pull that stops the drum in the step
        needed, limit = stopping_n - response * wanted.speed_m_per_s, torque_n_m / radius
        if abs(needed) <= limit:
            return wanted, needed * radius, True
        pull_n = min(max(needed, -limit), limit)
        speed = (stopping_n - pull_n) / response
        length = before.length_m + 0.5 * h * (V + speed)
        return Payout(length, speed), pull_n * radius, False

    def switch_off(self) -> None:
        """Switch the motor off, as the brake holds the drum."""
        self._torque, self._at_limit = 0.0, ""

    def _limit_words(self, before: Payout, wanted: Payout, after: Payout, step: WinchStep) -> str:
        """Return the message on rendering; a runaway drum renders at low tension by its inertia."""
        assert step.feedback is not None
        layer, radius = self._machine.layer(before.length_m)
        limit = self._params.torque_limit_n_m / radius
        return (
            f"renders: {kilonewtons(step.feedback.pull_n)} on the rope, the drive gives "
            f"{kilonewtons(limit)} on layer {layer}, line {after.speed_m_per_s:+.2f} m/s where "
            f"{wanted.speed_m_per_s:+.2f} m/s is wanted"
        )

    def figures(self, line: Payout) -> dict[str, float]:
        """Return the motor torque, + hauls in."""
        return {"motor_torque_n_m": self._torque}


class Brake(Component):
    """Brake of the drum: holds, or slips at its holding capacity."""

    def __init__(self, params: winch_parts.Brake, drive: Drive) -> None:
        self._params, self._drive = params, drive
        self._set = False  # as commanded
        self._holds = False  # in effect
        self._due_ns: int | None = None  # when the command takes effect
        self._torque = 0.0
        self._at_limit = ""

    def hold(self, before: Payout, wanted: Payout, step: WinchStep) -> Payout:
        """Return the commanded line if the brake is off, else the line standing or slipping."""
        if self._due_ns is not None and self._due_ns <= step.begin_ns:
            self._holds, self._due_ns = self._set, None
        self._at_limit = ""
        if not self._holds:
            self._torque = 0.0
            return wanted
        self._drive.switch_off()
        V = before.speed_m_per_s
        standstill = Payout(before.length_m + 0.5 * step.step_s * V, 0.0)
        capacity = self._params.holding_torque_n_m
        after, self._torque, sufficient = self._drive.pull(before, standstill, step, capacity)
        if not sufficient and abs(after.speed_m_per_s) > SLIP_TOL_M_PER_S:
            speed = after.speed_m_per_s
            self._at_limit = f"the brake slips at {capacity * 1e-3:g} kN·m, {speed:+.2f} m/s"
        return after

    @property
    def controls_line(self) -> bool:
        """Whether the brake holds."""
        return self._holds

    def switch(self, switch: str, time_ns: int) -> None:
        """Set or release the brake with its delay; an emergency stop sets it."""
        if switch in (SET_BRAKE, EMERGENCY_STOP, RELEASE_BRAKE):
            wanted = switch != RELEASE_BRAKE
            if wanted != self._set:
                self._set = wanted
                self._due_ns = time_ns + round(self._params.delay_s * 1e9)

    def figures(self, line: Payout) -> dict[str, float]:
        """Return whether the brake holds, and its torque, + against paying out."""
        return {"brake_holds": float(self._holds), "brake_torque_n_m": self._torque}


class FlyingSheave(Component):
    """Flying sheave on a gas spring; `add` is called once a step."""

    def __init__(self, params: PassiveCompensation) -> None:
        self._params, self._spring = params, of(params)
        self._stroke = self._rate = 0.0  # [m], [m/s]
        self._start: float | None = None  # stroke at the static tension, where it adds no line out
        self._speed = 0.0  # pay-out speed at the end of the last step

    def add(self, wanted: Payout, step: WinchStep) -> Payout:
        """Return the line at the end of the step, including the stroke."""
        feedback, h, falls = step.feedback, step.step_s, self._params.falls
        assert feedback is not None, "tension feedback is missing"
        if self._start is None:
            static_n = falls * feedback.pull_n
            self._start = self._stroke = root(
                lambda x: self._parts(x, 0.0).pull - static_n, -1.0, self._params.stroke_m + 1.0
            )
        free, response = feedback.at_speed(self._speed), feedback.hold + feedback.brace
        inertia = self._params.sheave_mass_kg / h

        def imbalance(rate: float) -> float:
            pull = max(free - response * (wanted.speed_m_per_s + falls * rate), 0.0)
            spring = self._parts(self._after(rate, h), rate)
            spring_n = spring.pull - spring.seal + self._seal(self._after(rate, h))
            return inertia * (rate - self._rate) + spring_n - falls * pull

        width = 1.0
        while imbalance(self._rate - width) > 0.0 or imbalance(self._rate + width) < 0.0:
            width *= 4.0
        rate = root(imbalance, self._rate - width, self._rate + width)
        stroke = self._after(rate, h)
        self._spring.memory[SEALS, 0] = self._seal(stroke) / max(self._spring.seal, 1.0)
        self._stroke, self._rate = stroke, rate
        self._speed = wanted.speed_m_per_s + falls * rate
        return Payout(wanted.length_m + falls * (stroke - self._start), self._speed)

    def _after(self, rate: float, h: float) -> float:
        return self._stroke + 0.5 * h * (self._rate + rate)

    def _parts(self, stroke: float, rate: float) -> CompensatorForces:
        k = self._params.stop_stiffness_n_per_m
        return forces(self._spring, stroke, rate, k, 0.0)

    def _seal(self, stroke: float) -> float:
        """Return the friction of the seals after a step to this stroke [N]."""
        spring, stroke_limit = self._spring, self._params.stroke_m
        change = min(max(stroke, 0.0), stroke_limit) - min(max(self._stroke, 0.0), stroke_limit)
        z = float(spring.memory[SEALS, 0]) + change
        return spring.seal * min(max(z, -spring.slip), spring.slip)

    def words(self) -> str:
        """Return the message at an end stop; "" between them."""
        if self._start is None or 0.0 < self._stroke < self._params.stroke_m:
            return ""
        side = "retracted" if self._stroke <= 0.0 else "extended"
        return f"passive heave compensator {side} to its end stop"

    def figures(self, line: Payout) -> dict[str, float]:
        """Return stroke and its rate, + gives line, gas pressure and gas force."""
        parts = self._parts(self._stroke, self._rate)
        return {
            "passive_stroke_m": self._stroke,
            "passive_stroke_m_per_s": self._rate,
            "passive_gas_pressure_pa": parts.pressure_pa,
            "passive_gas_force_n": parts.gas,
        }


def root(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of a rising function between these bounds, by regula falsi (Illinois)."""
    low_value, high_value, side = function(low), function(high), 0
    middle = low
    for _ in range(MAX_ITERATIONS):
        if (
            high - low <= RELATIVE_TOL * (abs(low) + abs(high))
            or low_value >= 0.0
            or high_value <= 0.0
        ):
            break
        middle = (low * high_value - high * low_value) / (high_value - low_value)
        value = function(middle)
        if value == 0.0:
            return middle
        if value < 0.0:
            high_value *= 0.5 if side < 0 else 1.0
            low, low_value, side = middle, value, -1
        else:
            low_value *= 0.5 if side > 0 else 1.0
            high, high_value, side = middle, value, 1
    return middle
