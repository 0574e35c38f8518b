"""A winch as a scene writes it: limits, parts, and a schedule for when nobody commands it."""

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

SWITCHES = {  # what can be switched, and the part that it needs
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
    """Told (and known by its digest) without the fields named here that are left out."""

    _spared: ClassVar[frozenset[str]]
    _no_figures: ClassVar[frozenset[str]] = frozenset()  # fields that no digest depends on

    def __repr__(self) -> str:
        given = ((name, value) for name, value in vars(self).items()
                 if name not in self._no_figures
                 and (value is not None or name not in self._spared))  # fmt: skip
        return f"{type(self).__name__}({', '.join(f'{n}={v!r}' for n, v in given)})"


@dataclass(frozen=True, kw_only=True, repr=False)
class ScheduleRow(_Sparing):
    """What the winch is told at `at_s`; exactly one of the others. A motion holds from then on."""

    _spared = frozenset(("line_out_m", "payload_depth_m", "tension_n", "switch"))

    at_s: float = quantity("time since the start", "s", 0.0, 1e6)
    speed_m_per_s: float | None = quantity("speed, + pays out", "m/s", -5.0, 5.0, default=None)
    line_out_m: float | None = quantity("line out to stop at", "m", 1.0, 2e4, default=None)
    payload_depth_m: float | None = quantity(
        "depth of the payload to stop at, below the mean water level", "m", 0.0, 1.2e4, default=None
    )
    tension_n: float | None = quantity("top tension to keep", "N", 0.0, 1e9, default=None)
    switch: str | None = text(f"one of {', '.join(SWITCHES)}", None)

    def check(self) -> str | None:
        """Exactly one thing is told."""
        told = [name for name in ("speed_m_per_s", *sorted(self._spared))
                if getattr(self, name) is not None]  # fmt: skip
        if len(told) == 1:
            return None
        what = "nothing is told" if not told else f"{' and '.join(told)} at once"
        names = "speed_m_per_s, line_out_m, payload_depth_m, tension_n, switch"
        return f"{what}; give exactly one of {names}"


@dataclass(frozen=True, kw_only=True, repr=False)
class Winch(_Sparing):
    """Limits of the winch, its parts, and what it is told to do when nobody commands it."""

    _spared = frozenset(
        ("jerk_limit_m_per_s3", "drum", "drive", "brake", "emergency_stop", "heave_compensation",
         "constant_tension", "sheave")
    )  # fmt: skip
    _no_figures = frozenset(("when_commander_lost",))  # of a run whose commander stays

    speed_limit_m_per_s: float = quantity("largest speed either way", "m/s", 0.0, 5.0)
    acceleration_limit_m_per_s2: float = quantity("largest acceleration", "m/s²", 1e-3, 10.0)
    least_line_out_m: float = quantity("never hauls in beyond this", "m", 1.0, 2e4)
    most_line_out_m: float = quantity("rope there is", "m", 1.0, 2e4)
    schedule: tuple[ScheduleRow, ...] = text("what it is told, over time", ())
    schedule_repeats_every_s: float | None = quantity(
        "the schedule starts again after this", "s", 1.0, 1e6, default=None
    )
    jerk_limit_m_per_s3: float | None = quantity(
        "largest rate of the acceleration; absent: none", "m/s³", 1e-3, 1e3, default=None
    )
    drum: Drum | None = text("layers of rope; absent: the line out is all there is", None)
    drive: Drive | None = text("the motor; absent: it holds whatever pulls", None)
    brake: Brake | None = text("friction on the drum", None)
    emergency_stop: EmergencyStop | None = text("a stop beyond the ordinary limits", None)
    heave_compensation: HeaveCompensation | None = text("pays out as the hang-off rises", None)
    constant_tension: ConstantTension | None = text("keeps a named top tension", None)
    sheave: TopSheave | None = text("what the rope bends over at the hang-off, for fatigue", None)
    when_commander_lost: str = text(
        "what the winch does when the node that commands it disappears: "
        + ", ".join(WHEN_COMMANDER_LOST),
        RAMP_TO_ZERO,
    )
