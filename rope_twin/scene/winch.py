"""Winch of a scene: limits, components, and a schedule used without a commander."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians

from rope_twin.effects.compensator import GasSpringParams
from rope_twin.quantity import SparingRepr, quantity, text
from rope_twin.vortex.fatigue import BendPlace

Triple = tuple[float, float, float]
WIRE_PA = 1.96e11  # Young's modulus of a rope's steel wires
LAYER_RISE = 0.9  # radial spacing of layers in rope diameters (nested in grooves)


@dataclass(frozen=True, kw_only=True)
class Drum:
    """Layers of rope on a drum: layer k has the radius r_k = r_0 + (k - 1/2)·0.9·d."""

    core_radius_m: float = quantity("radius of the bare drum, r_0", "m", 0.05, 10.0)
    turns_per_layer: float = quantity("turns per layer", "", 1.0, 1e3)
    inboard_m: float = quantity(
        "distance inboard of the hang-off", "m", 0.0, 1e3,
        default=0.0, only_judges=True,
    )  # fmt: skip

    def radius_m(self, layer: int, diameter_m: float) -> float:
        """Return the radius from the axis to the middle of the rope in layer 1, 2, ... [m]."""
        return self.core_radius_m + (layer - 0.5) * LAYER_RISE * diameter_m

    def length_m(self, layers: int, diameter_m: float) -> float:
        """Return the rope in this number of full layers: 2π·N·(k·r_0 + 0.45·d·k²) [m]."""
        rise = 0.5 * LAYER_RISE * diameter_m * layers * layers
        return 2.0 * pi * self.turns_per_layer * (layers * self.core_radius_m + rise)

    def layer_of(self, stored_m: float, diameter_m: float) -> int:
        """Return the layer from which rope leaves at a stored length; at least 1."""
        layer = 1
        while self.length_m(layer, diameter_m) < stored_m:
            layer += 1
        return layer

    def turns(self, stored_m: float, diameter_m: float) -> float:
        """Return the turns on the drum at a stored length; negative: rope that is not there."""
        layer = self.layer_of(stored_m, diameter_m)
        beyond_m = stored_m - self.length_m(layer - 1, diameter_m)
        turn_m = 2.0 * pi * self.radius_m(layer, diameter_m)
        return (layer - 1) * self.turns_per_layer + beyond_m / turn_m


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Torque-limited drive: the winch renders above its limit. Needs a drum."""

    inertia_kg_m2: float = quantity(
        "moment of inertia of drum, rope, gear and motor, at the drum axis", "kg·m²", 1e-6, 1e9
    )
    torque_limit_n_m: float = quantity(
        "maximum torque in both directions, at the axis", "N·m", 1.0, 1e9
    )


@dataclass(frozen=True, kw_only=True)
class Brake:
    """Brake on the drum, released at the start. Needs a drive, on whose inertia it acts."""

    holding_torque_n_m: float = quantity("brake holding capacity, at the axis", "N·m", 1.0, 1e9)
    delay_s: float = quantity("delay from command to effect, setting and releasing", "s", 0.0, 10.0)


@dataclass(frozen=True, kw_only=True)
class EmergencyStop:
    """Stop beyond the ordinary limits, which also sets the brake if there is one."""

    deceleration_m_per_s2: float = quantity("deceleration of the line", "m/s²", 0.01, 50.0)


@dataclass(frozen=True, kw_only=True)
class HeaveCompensation:
    """Active heave compensation (AHC): pay-out efficiency·e^(-iω·delay)/(1 + iω·lag) of the heave
    rate.

    On at the start; added to the other motion of the winch, within its own limits.
    """

    efficiency: float = quantity("compensated fraction of the heave velocity", "", 0.0, 1.2)
    lag_s: float = quantity("first-order lag of measurement and drive", "s", 0.0, 10.0)
    delay_s: float = quantity("dead time before the lag", "s", 0.0, 5.0, default=0.0)
    stroke_m: float = quantity("maximum stroke in both directions", "m", 0.01, 100.0)
    speed_limit_m_per_s: float = quantity("maximum speed in both directions", "m/s", 0.01, 10.0)
    acceleration_limit_m_per_s2: float = quantity("maximum acceleration", "m/s²", 0.01, 50.0)


@dataclass(frozen=True, kw_only=True, repr=False)
class PassiveCompensation(GasSpringParams):
    """Passive heave compensator between ship and rope: a flying sheave on a gas spring.

    The rope's tension times `falls` loads the spring; it gives `falls` times its stroke of line.
    """

    falls: int = quantity("number of falls: line per stroke", "", 1, 8, default=2)
    sheave_mass_kg: float = quantity(
        "moving mass: sheave, rod and piston", "kg", 1.0, 1e6, default=1000.0
    )
    stop_stiffness_n_per_m: float = quantity(
        "stiffness of the end stops", "N/m", 1e4, 1e10, default=1e7
    )


@dataclass(frozen=True, kw_only=True)
class BendingSheave:
    """A sheave, for the bends of the rope that passes it; it does not influence the motion."""

    diameter_m: float = quantity("groove diameter", "m", 0.01, 20.0)
    outer_wire_m: float | None = quantity(
        "diameter of a wire rope's outer wires: their bending stress counts by a stress curve",
        "m", 1e-4, 0.05, default=None,
    )  # fmt: skip
    wrap_deg: float = quantity(
        "angle of wrap, which gives the arc of contact", "°", 1.0, 360.0, default=90.0,
        only_judges=True,
    )  # fmt: skip
    bends: float = quantity(
        "cycles of bending that a passage counts as; more than 1 for a reverse bend", "",
        0.1, 100.0, default=1.0, only_judges=True,
    )  # fmt: skip

    @property
    def arc_m(self) -> float:
        """Return the length of the arc of contact [m]."""
        return 0.5 * radians(self.wrap_deg) * self.diameter_m

    def places(self, inboard_m: float) -> tuple[BendPlace, BendPlace]:
        """Return where the arc of contact begins and ends, from this distance inboard on [m]."""
        first = BendPlace(inboard_m, self.diameter_m, self.bends)
        return first, first._replace(inboard_m=inboard_m + self.arc_m)

    def bending_stress_pa(self, rope_diameter_m: float) -> float:
        """Return E·δ/(D + d) of an outer wire (Reuleaux 1861; E as in Feyrer 2015, Wire Ropes).

        0 if no wire is given.
        """
        return WIRE_PA * (self.outer_wire_m or 0.0) / (self.diameter_m + rope_diameter_m)


@dataclass(frozen=True, kw_only=True)
class TopSheave(BendingSheave):
    """Overboarding sheave at the crane tip; the rope leaves it at the hang-off."""


@dataclass(frozen=True, kw_only=True)
class InboardSheave(BendingSheave):
    """A sheave between the hang-off and the drum."""

    inboard_m: float = quantity(
        "distance along the rope from the hang-off to the sheave", "m", 0.0, 1e3
    )


@dataclass(frozen=True, kw_only=True)
class ConstantTension:
    """Constant-tension control: speed = gain·(e + ∫e/T dt), e = tension less its set-point."""

    gain_m_per_s_per_kn: float = quantity(
        "proportional gain per kN of tension error", "m/s/kN", 1e-5, 10.0
    )
    integral_time_s: float | None = quantity(
        "integral time T; default: proportional control, with a steady-state error",
        "s", 0.1, 1e4, default=None,
    )  # fmt: skip


SWITCHES = {  # commands, and the component that each requires
    "emergency_stop": "emergency_stop",
    "reset": "emergency_stop",
    "set_brake": "brake",
    "release_brake": "brake",
    "compensate": "heave_compensation",
    "stop_compensating": "heave_compensation",
}


FOLLOWS_COMMANDS, FOLLOWS_MEASURED = "commands", "measured"
FOLLOWS = FOLLOWS_COMMANDS, FOLLOWS_MEASURED
HOLD_SPEED, RAMP_TO_ZERO, SET_THE_BRAKE = "hold_speed", "ramp_to_zero", "brake"
WHEN_COMMANDER_LOST = (HOLD_SPEED, RAMP_TO_ZERO, SET_THE_BRAKE)


@dataclass(frozen=True, kw_only=True, repr=False)
class ScheduleRow(SparingRepr):
    """Command to the winch at `at_s`; exactly one of the others. A motion persists."""

    _spared = frozenset(("line_out_m", "payload_depth_m", "tension_n", "switch"))

    at_s: float = quantity("time of the command", "s", 0.0, 1e6)
    speed_m_per_s: float | None = quantity(
        "speed, positive = pay-out", "m/s", -5.0, 5.0, default=None
    )
    line_out_m: float | None = quantity("target paid-out length", "m", 1.0, 2e4, default=None)
    payload_depth_m: float | None = quantity(
        "target payload depth below the mean water level", "m", 0.0, 1.2e4, default=None
    )
    tension_n: float | None = quantity(
        "tension set-point (constant tension)", "N", 0.0, 1e9, default=None
    )
    switch: str | None = text(f"one of {', '.join(SWITCHES)}", None)

    def check(self) -> str | None:
        """Return a fault unless exactly one command is given, or None."""
        commands = [name for name in ("speed_m_per_s", *sorted(self._spared))
                if getattr(self, name) is not None]  # fmt: skip
        if len(commands) == 1:
            return None
        problem = "no command is given" if not commands else f"{' and '.join(commands)} at once"
        names = "speed_m_per_s, line_out_m, payload_depth_m, tension_n, switch"
        return f"{problem}; give exactly one of {names}"


@dataclass(frozen=True, kw_only=True, repr=False)
class Winch(SparingRepr):
    """Limits of the winch, its components, and its schedule without a commander."""

    _spared = frozenset(
        ("jerk_limit_m_per_s3", "drum", "drive", "brake", "emergency_stop", "heave_compensation",
         "passive_compensation", "constant_tension", "sheave")
    )  # fmt: skip
    _no_figures = frozenset(("when_commander_lost", "inboard_sheaves"))  # no effect on results
    _later = frozenset(("follows",))

    speed_limit_m_per_s: float = quantity("maximum speed in both directions", "m/s", 0.0, 5.0)
    acceleration_limit_m_per_s2: float = quantity("maximum acceleration", "m/s²", 1e-3, 10.0)
    min_line_out_m: float = quantity("minimum paid-out length", "m", 1.0, 2e4)
    max_line_out_m: float = quantity("maximum paid-out length", "m", 1.0, 2e4)
    schedule: tuple[ScheduleRow, ...] = text("commands over time", ())
    schedule_repeats_every_s: float | None = quantity(
        "repetition period of the schedule", "s", 1.0, 1e6, default=None
    )
    jerk_limit_m_per_s3: float | None = quantity(
        "maximum jerk; default: unlimited", "m/s³", 1e-3, 1e3, default=None
    )
    drum: Drum | None = text("drum with layers of rope; default: none", None)
    drive: Drive | None = text("torque-limited drive; default: unlimited holding", None)
    brake: Brake | None = text("brake on the drum", None)
    emergency_stop: EmergencyStop | None = text("emergency stop with its own deceleration", None)
    heave_compensation: HeaveCompensation | None = text("active heave compensation (AHC)", None)
    passive_compensation: PassiveCompensation | None = text(
        "passive heave compensator: a flying sheave on a gas spring", None
    )
    constant_tension: ConstantTension | None = text("constant-tension (CT) mode", None)
    sheave: TopSheave | None = text(
        "overboarding sheave at the crane tip (bending fatigue only)", None
    )
    inboard_sheaves: tuple[InboardSheave, ...] = text(
        "sheaves between hang-off and drum (bending fatigue only)", ()
    )
    when_commander_lost: str = text(
        "action of the winch when its commanding node disappears: "
        + ", ".join(WHEN_COMMANDER_LOST),
        RAMP_TO_ZERO,
    )
    follows: str = text(
        "what the line follows: `commands`, or the `measured` line out on winch/measured",
        FOLLOWS_COMMANDS,
    )

    def bend_path(self) -> tuple[BendPlace, ...]:
        """Return the places inboard of the hang-off where the rope is bent or straightened."""
        path = list(self.sheave.places(0.0)) if self.sheave else []
        for sheave in self.inboard_sheaves:
            path += sheave.places(sheave.inboard_m)
        if self.drum is not None:
            bare_m = 2.0 * self.drum.core_radius_m
            path.append(BendPlace(self.drum.inboard_m, bare_m, 1.0, self.drum))
        return tuple(path)


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A ring, shackle or hook block: a connection of ropes without a payload."""

    name: str = text("its name")
    mass_kg: float = quantity("mass in air, of steel", "kg", 0.0, 1e6, default=0.0)


@dataclass(frozen=True, kw_only=True)
class Tether:
    """A constant-tension link or spring-damper that holds a sheave to a fixed point.

    Its tension along the line to `at_m` is force + stiffness·(l - length) + damping·dl/dt, at least
    0.
    """

    at_m: Triple = quantity("fixed point: x, y, z", "m", -1e4, 1e4)
    force_n: float = quantity("tension at its length", "N", 0.0, 1e8)
    length_m: float = quantity("length at this tension", "m", 0.0, 1e4, default=0.0)
    stiffness_n_per_m: float = quantity("spring stiffness", "N/m", 0.0, 1e8, default=0.0)
    damping_newton_seconds_per_m: float = quantity(
        "damping coefficient c", "N·s/m", 0.0, 1e8, default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class Sheave:
    """A sheave over which rope runs between the two ropes that end at it.

    It is a point: the wheel's radius is negligible relative to the ropes' lengths. In the static
    solution rope runs until the tension is equal on both sides, so that only the sum of their
    `length_m` stays as given.
    """

    name: str = text("its name")
    mass_kg: float = quantity("mass of block and wheel in air, of steel", "kg", 0.0, 1e6,
                              default=0.0)  # fmt: skip
    wheel_inertia_kg: float = quantity(
        "moment of inertia of the wheel over its radius squared", "kg", 0.0, 1e6, default=0.0
    )
    friction: float = quantity(
        "friction coefficient: tension ratio exp(friction·angle of wrap), running", "", 0.0, 1.0,
        default=0.0,
    )  # fmt: skip
    tether: Tether | None = text("tether that holds it", None)
    groove: BendingSheave | None = text(
        "its groove, for bends of the rope (`--fatigue` alone)", None, only_judges=True
    )


@dataclass(frozen=True, kw_only=True)
class Strut:
    """A spreader bar, hinged at both ends, in tension and compression.

    Half its mass is at either end; it has no drag.
    """

    name: str = text("its name")
    between: tuple[str, str] = text("payloads or joints at its ends")
    length_m: float = quantity("length", "m", 0.1, 500.0)
    mass_kg: float = quantity("mass in air, of steel", "kg", 0.0, 1e6, default=0.0)
    stiffness_n_per_m: float = quantity("axial stiffness EA/L", "N/m", 1e5, 1e11, default=1e8)
    damping_newton_seconds_per_m: float = quantity(
        "damping coefficient c", "N·s/m", 0.0, 1e9, default=1e5
    )
