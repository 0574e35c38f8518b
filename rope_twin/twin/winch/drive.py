"""Motor and brake of a winch drum with inertia.

Motor or brake bring the line to the commanded speed with the line pull that this takes, up to their
torque over the drum's present radius r; beyond that the winch renders:

    (J/r²)·(V' - V)/h = F' - P,   F' = F - hold·(V' - parting) - brace·(V' - V)

with F the tension of the last step, V and V' the pay-out speed before and after the step and P the
line pull. F' is the expected response of the rope (`tension_feedback.py`): the drum is
integrated implicitly in the rope's stiffness and stays stable at any inertia. With F instead, J/r²
would have to exceed half the impedance over the step, h·√(EA·m)/2.
"""

from __future__ import annotations

from rope_twin.scene import winch as winch_parts
from rope_twin.twin.winch.commands import EMERGENCY_STOP, RELEASE_BRAKE, SET_BRAKE
from rope_twin.twin.winch.payout import Payout, WinchStep

SLIPS_M_PER_S = 1e-6  # a slower drum under a set brake counts as standing


class WinchDrum:
    """Drum with its layers of rope."""

    def __init__(self, drum: winch_parts.Drum, diameter_m: float, most_line_out_m: float) -> None:
        """Take the total length of the rope; the length not paid out is on the drum."""
        self._drum, self._diameter, self.whole_m = drum, diameter_m, most_line_out_m

    def layer(self, line_out_m: float) -> tuple[int, float]:
        """Return the layer from which rope leaves the drum, and its radius [m]."""
        layer = self._drum.layer_of(self.whole_m - line_out_m, self._diameter)
        return layer, self._drum.radius_m(layer, self._diameter)


class Drive:
    """Motor of the winch."""

    def __init__(self, params: winch_parts.Drive, machine: WinchDrum) -> None:
        self._params, self._machine = params, machine
        self._torque = 0.0  # + hauls in [N·m]
        self._at_limit = ""

    def hold(self, before: Payout, wanted: Payout, moment: WinchStep) -> Payout:
        """Return the commanded line, or as far as the torque moves it."""
        after, self._torque, whole = self.pull(
            before, wanted, moment, self._params.torque_limit_n_m
        )
        self._at_limit = "" if whole else self._limit_words(before, wanted, after, moment)
        return after

    def pull(
        self, before: Payout, wanted: Payout, moment: WinchStep, torque_n_m: float
    ) -> tuple[Payout, float, bool]:
        """Return the line after a step with at most this torque, the torque, and if it sufficed."""
        feedback, h = moment.feedback, moment.step_s
        assert feedback is not None, "tension feedback is missing"
        _, radius = self._machine.layer(before.length_m)
        inertia = self._params.inertia_kg_m2 / (radius * radius * h)
        stiff, V = inertia + feedback.hold + feedback.brace, before.speed_m_per_s
        driving = inertia * V + feedback.at_speed(V)
        needed, limit = driving - stiff * wanted.speed_m_per_s, torque_n_m / radius
        if abs(needed) <= limit:
            return wanted, needed * radius, True
        given = min(max(needed, -limit), limit)
        speed = (driving - given) / stiff
        length = before.length_m + 0.5 * h * (V + speed)
        return Payout(length, speed), given * radius, False

    @property
    def controls_line(self) -> bool:
        """Whether the motor alone controls the line: never."""
        return False

    def rest(self) -> None:
        """Switch the motor off, as the brake holds the drum."""
        self._torque, self._at_limit = 0.0, ""

    def _limit_words(self, before: Payout, wanted: Payout, after: Payout, moment: WinchStep) -> str:
        """Return the message on rendering; a runaway drum renders at low tension by its inertia."""
        assert moment.feedback is not None
        layer, radius = self._machine.layer(before.length_m)
        limit = self._params.torque_limit_n_m / radius
        return (
            f"renders: {moment.feedback.pull_n * 1e-3:.0f} kN on the rope, the drive gives "
            f"{limit * 1e-3:.0f} kN on layer {layer}, line {after.speed_m_per_s:+.2f} m/s where "
            f"{wanted.speed_m_per_s:+.2f} is wanted"
        )

    def words(self) -> str:
        """Return the message on rendering; "" if it does not render."""
        return self._at_limit

    def figures(self, line: Payout) -> dict[str, float]:
        """Return the motor torque, + hauls in."""
        return {"motor_torque_n_m": self._torque}

    def switch(self, switch: str, time_ns: int) -> None:
        """Do nothing, as the drive has no switch."""

    def set_total_length(self, whole_m: float) -> None:
        """Set the total length; the length not paid out is on the drum."""
        self._machine.whole_m = whole_m


class Brake:
    """Brake of the drum: holds, or slips at its holding capacity."""

    def __init__(self, params: winch_parts.Brake, drive: Drive) -> None:
        self._params, self._drive = params, drive
        self._set = False  # as commanded
        self._holds = False  # in effect
        self._due_ns: int | None = None  # when the command takes effect
        self._torque = 0.0
        self._at_limit = ""

    def hold(self, before: Payout, wanted: Payout, moment: WinchStep) -> Payout:
        """Return the commanded line if the brake is off, else the line standing or slipping."""
        if self._due_ns is not None and self._due_ns <= moment.begin_ns:
            self._holds, self._due_ns = self._set, None
        self._at_limit = ""
        if not self._holds:
            self._torque = 0.0
            return wanted
        self._drive.rest()
        V = before.speed_m_per_s
        rest = Payout(before.length_m + 0.5 * moment.step_s * V, 0.0)
        capacity = self._params.holding_torque_n_m
        after, self._torque, whole = self._drive.pull(before, rest, moment, capacity)
        if not whole and abs(after.speed_m_per_s) > SLIPS_M_PER_S:
            speed = after.speed_m_per_s
            self._at_limit = f"the brake slips at {capacity * 1e-3:g} kN·m, {speed:+.2f} m/s"
        return after

    @property
    def controls_line(self) -> bool:
        """Whether the brake holds."""
        return self._holds

    def set_total_length(self, whole_m: float) -> None:
        """Do nothing, as the drum is the drive's."""

    def switch(self, switch: str, time_ns: int) -> None:
        """Set or release the brake with its delay; an emergency stop sets it."""
        if switch in (SET_BRAKE, EMERGENCY_STOP, RELEASE_BRAKE):
            wanted = switch != RELEASE_BRAKE
            if wanted != self._set:
                self._set = wanted
                self._due_ns = time_ns + round(self._params.delay_s * 1e9)

    def words(self) -> str:
        """Return the message on slipping; "" if it does not slip."""
        return self._at_limit

    def figures(self, line: Payout) -> dict[str, float]:
        """Return whether the brake holds, and its torque, + against paying out."""
        return {"brake_holds": float(self._holds), "brake_torque_n_m": self._torque}
