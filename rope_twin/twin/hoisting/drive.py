"""Motor and brake of a drum whose inertia the rope's tension turns.

Motor or brake bring the line to the wished speed with as much pull as that takes, up to what their
torque gives on the drum's present radius r; what it cannot hold is rendered:

    (J/r²)·(V' - V)/h = F' - P,   F' = F - hold·(V' - parting) - brace·(V' - V)

with F the tension of the last step, V and V' the payout speed before and after the step and P the
pull. F' is how the rope will answer (`rope_twin.twin.hoisting.feel`): the drum is integrated
implicitly in the rope's stiffness and stays stable however light it is. With F in its place J/r²
would have to be more than half the impedance over the step, h·√(EA·m)/2.
"""

from __future__ import annotations

from rope_twin.scene import winch_parts
from rope_twin.twin.hoisting.line import LineOut, Moment
from rope_twin.twin.hoisting.orders import EMERGENCY_STOP, RELEASE_BRAKE, SET_BRAKE

SLIPS_M_PER_S = 1e-6  # a drum slower than this under a set brake stands


class Machine:
    """The drum with the rope that is on it."""

    def __init__(self, drum: winch_parts.Drum, diameter_m: float, most_line_out_m: float) -> None:
        """`most_line_out_m`: all the rope there is; what is not out is on the drum."""
        self._drum, self._diameter, self.whole_m = drum, diameter_m, most_line_out_m

    def layer(self, line_out_m: float) -> tuple[int, float]:
        """The layer from which rope leaves the drum, and its radius [m]."""
        layer = self._drum.layer_of(self.whole_m - line_out_m, self._diameter)
        return layer, self._drum.radius_m(layer, self._diameter)


class Drive:
    """The motor."""

    def __init__(self, params: winch_parts.Drive, machine: Machine) -> None:
        self._params, self._machine = params, machine
        self._torque = 0.0  # + hauls in [N·m]
        self._at_limit = ""

    def hold(self, before: LineOut, wanted: LineOut, moment: Moment) -> LineOut:
        """The line as it was asked for, or as far as the torque brings it."""
        after, self._torque, whole = self.pull(
            before, wanted, moment, self._params.torque_limit_n_m
        )
        self._at_limit = "" if whole else self._limit_words(before, wanted, after, moment)
        return after

    def pull(
        self, before: LineOut, wanted: LineOut, moment: Moment, torque_n_m: float
    ) -> tuple[LineOut, float, bool]:
        """The line after a step with so much torque at most, the torque, and if it was enough."""
        felt, h = moment.felt, moment.step_s
        assert felt is not None, "the winch said that it asks for it"
        _, radius = self._machine.layer(before.length_m)
        inertia = self._params.inertia_kg_m2 / (radius * radius * h)
        stiff, V = inertia + felt.hold + felt.brace, before.speed_m_per_s
        driving = inertia * V + felt.at_speed(V)
        needed, limit = driving - stiff * wanted.speed_m_per_s, torque_n_m / radius
        if abs(needed) <= limit:
            return wanted, needed * radius, True
        given = min(max(needed, -limit), limit)
        speed = (driving - given) / stiff
        length = before.length_m + 0.5 * h * (V + speed)
        return LineOut(length, speed), given * radius, False

    @property
    def has_line(self) -> bool:
        """Never: it is the motor."""
        return False

    def rest(self) -> None:
        """The motor is off: the brake has the drum."""
        self._torque, self._at_limit = 0.0, ""

    def _limit_words(self, before: LineOut, wanted: LineOut, after: LineOut, moment: Moment) -> str:
        """A drum that runs away renders under little pull too: its inertia is held back."""
        assert moment.felt is not None
        layer, radius = self._machine.layer(before.length_m)
        limit = self._params.torque_limit_n_m / radius
        return (
            f"renders: {moment.felt.pull_n * 1e-3:.0f} kN on the rope, the drive gives "
            f"{limit * 1e-3:.0f} kN on layer {layer}, line {after.speed_m_per_s:+.2f} m/s where "
            f"{wanted.speed_m_per_s:+.2f} is wanted"
        )

    def words(self) -> str:
        """Whether it renders."""
        return self._at_limit

    def figures(self, line: LineOut) -> dict[str, float]:
        """Its torque, + hauls in."""
        return {"motor_torque_n_m": self._torque}

    def obey(self, switch: str, time_ns: int) -> None:
        """It has no switch of its own."""

    def know_rope(self, whole_m: float) -> None:
        """What is not out is on the drum."""
        self._machine.whole_m = whole_m


class Brake:
    """Friction on the drum: holds it, or slips at its capacity."""

    def __init__(self, params: winch_parts.Brake, drive: Drive) -> None:
        self._params, self._drive = params, drive
        self._set = False  # as it was told
        self._holds = False  # as it does
        self._due_ns: int | None = None  # when the two are to agree
        self._torque = 0.0
        self._at_limit = ""

    def hold(self, before: LineOut, wanted: LineOut, moment: Moment) -> LineOut:
        """The line as it was asked for if the brake is off, else at rest or slipping."""
        if self._due_ns is not None and self._due_ns <= moment.begin_ns:
            self._holds, self._due_ns = self._set, None
        self._at_limit = ""
        if not self._holds:
            self._torque = 0.0
            return wanted
        self._drive.rest()
        V = before.speed_m_per_s
        rest = LineOut(before.length_m + 0.5 * moment.step_s * V, 0.0)
        capacity = self._params.holding_torque_n_m
        after, self._torque, whole = self._drive.pull(before, rest, moment, capacity)
        if not whole and abs(after.speed_m_per_s) > SLIPS_M_PER_S:
            speed = after.speed_m_per_s
            self._at_limit = f"the brake slips at {capacity * 1e-3:g} kN·m, {speed:+.2f} m/s"
        return after

    @property
    def has_line(self) -> bool:
        """While it holds."""
        return self._holds

    def know_rope(self, whole_m: float) -> None:
        """Its drum is the drive's."""

    def obey(self, switch: str, time_ns: int) -> None:
        """Set or release it; it follows after its delay. An emergency stop sets it."""
        if switch in (SET_BRAKE, EMERGENCY_STOP, RELEASE_BRAKE):
            wanted = switch != RELEASE_BRAKE
            if wanted != self._set:
                self._set = wanted
                self._due_ns = time_ns + round(self._params.delay_s * 1e9)

    def words(self) -> str:
        """Whether it holds or slips."""
        return self._at_limit

    def figures(self, line: LineOut) -> dict[str, float]:
        """Whether it holds, and its torque, + against paying out."""
        return {"brake_holds": float(self._holds), "brake_torque_n_m": self._torque}
