"""Winch of a scene: limits, components, and a schedule used without a commander."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from rope_twin.quantity import quantity, text
from rope_twin.scene.winch_parts import (
    Brake,
    ConstantTension,
    Drive,
    Drum,
    EmergencyStop,
    HeaveCompensation,
    TopSheave,
)

SWITCHES = {  # commands, and the component that each requires
    "emergency_stop": "emergency_stop",
    "reset": "emergency_stop",
    "set_brake": "brake",
    "release_brake": "brake",
    "compensate": "heave_compensation",
    "stop_compensating": "heave_compensation",
}


HOLD_SPEED, RAMP_TO_ZERO, SET_THE_BRAKE = "hold_speed", "ramp_to_zero", "brake"
WHEN_COMMANDER_LOST = (HOLD_SPEED, RAMP_TO_ZERO, SET_THE_BRAKE)


class _Sparing:
    """Base with a repr (used for digests) that omits the optional fields that are not given."""

    _spared: ClassVar[frozenset[str]]
    _no_figures: ClassVar[frozenset[str]] = frozenset()  # fields excluded from digests

    def __repr__(self) -> str:
        given = ((name, value) for name, value in vars(self).items()
                 if name not in self._no_figures
                 and (value is not None or name not in self._spared))  # fmt: skip
        return f"{type(self).__name__}({', '.join(f'{n}={v!r}' for n, v in given)})"


@dataclass(frozen=True, kw_only=True, repr=False)
class ScheduleRow(_Sparing):
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
        told = [name for name in ("speed_m_per_s", *sorted(self._spared))
                if getattr(self, name) is not None]  # fmt: skip
        if len(told) == 1:
            return None
        what = "no command is given" if not told else f"{' and '.join(told)} at once"
        names = "speed_m_per_s, line_out_m, payload_depth_m, tension_n, switch"
        return f"{what}; give exactly one of {names}"


@dataclass(frozen=True, kw_only=True, repr=False)
class Winch(_Sparing):
    """Limits of the winch, its components, and its schedule without a commander."""

    _spared = frozenset(
        ("jerk_limit_m_per_s3", "drum", "drive", "brake", "emergency_stop", "heave_compensation",
         "constant_tension", "sheave")
    )  # fmt: skip
    _no_figures = frozenset(("when_commander_lost",))  # no effect on results

    speed_limit_m_per_s: float = quantity("maximum speed in both directions", "m/s", 0.0, 5.0)
    acceleration_limit_m_per_s2: float = quantity("maximum acceleration", "m/s²", 1e-3, 10.0)
    least_line_out_m: float = quantity("minimum paid-out length", "m", 1.0, 2e4)
    most_line_out_m: float = quantity("maximum paid-out length", "m", 1.0, 2e4)
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
    constant_tension: ConstantTension | None = text("constant-tension (CT) mode", None)
    sheave: TopSheave | None = text(
        "overboarding sheave at the crane tip (bending fatigue only)", None
    )
    when_commander_lost: str = text(
        "action of the winch when its commanding node disappears: "
        + ", ".join(WHEN_COMMANDER_LOST),
        RAMP_TO_ZERO,
    )
