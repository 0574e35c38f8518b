"""Instruments of a scene, and prior knowledge for learning a lift from them.

Standard uncertainty, known offset and resolution of what instruments measure judge the residuals
(measured minus computed) of a run; nothing that is computed depends on them, except the resolution
of a line-out counter that the winch follows.

Prior knowledge covers figures of rope and payload, load pin and motion sensor: standard deviations
of one standard uncertainty before anything was measured, or properties of the instruments. It
judges measurements; nothing that the rope's step computes depends on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from rope_twin.quantity import quantity, text

SHEAVE, MOTOR = "sheave", "motor"
RANGE_OVER_TENSION = 1.5  # full scale of a load pin over the static tension, if it is not given
PRIOR_SIGMAS = 3.0  # what is further off is not the lift, or the load pin, that the scene describes
TENSION_PLACES = (SHEAVE, MOTOR)


@dataclass(frozen=True, kw_only=True)
class MeasuredTension:
    """Load cell: its reading, less the offset, is compared with the computed top tension."""

    uncertainty_n: float | None = quantity(
        "standard uncertainty, constant part", "N", 0.0, 1e9, default=None
    )
    uncertainty_pct: float | None = quantity(
        "standard uncertainty, part proportional to the reading", "%", 0.0, 100.0, default=None
    )
    bias_n: float = quantity("known offset of the reading", "N", -1e9, 1e9, default=0.0)
    at: str = text(
        "reading that is compared with the top tension: `sheave` (winch/measured) or `motor` "
        "(winch/motor_tension)",
        SHEAVE,
    )

    def check(self) -> str | None:
        """Return a fault if the place is unknown, or None."""
        if self.at in TENSION_PLACES:
            return None
        return (
            f"'{self.at}' is no place of the measured tension; give {' or '.join(TENSION_PLACES)}"
        )

    def uncertainty(self, reading: float) -> float | None:
        """Return the standard uncertainty of a reading [N]; None: not given."""
        return _combined(self.uncertainty_n, self.uncertainty_pct, reading)

    @property
    def bias(self) -> float:
        """Known offset [N]."""
        return self.bias_n


@dataclass(frozen=True, kw_only=True)
class MeasuredLength:
    """Line-out counter or depth sensor: its reading, less the offset, is compared."""

    uncertainty_m: float | None = quantity(
        "standard uncertainty, constant part", "m", 0.0, 1e4, default=None
    )
    uncertainty_pct: float | None = quantity(
        "standard uncertainty, part proportional to the reading", "%", 0.0, 100.0, default=None
    )
    bias_m: float = quantity("known offset of the reading", "m", -1e4, 1e4, default=0.0)
    resolution_m: float = quantity(
        "resolution: smallest difference of two readings", "m", 0.0, 100.0, default=0.0
    )

    def uncertainty(self, reading: float) -> float | None:
        """Return the standard uncertainty of a reading [m]; None: not given.

        A resolution r adds r/√12, the standard deviation of rounding (GUM, JCGM 100:2008, F.2.2.1).
        """
        combined = _combined(self.uncertainty_m, self.uncertainty_pct, reading)
        return combined if combined is None else hypot(combined, self.resolution_m / 12.0**0.5)

    @property
    def bias(self) -> float:
        """Known offset [m]."""
        return self.bias_m


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Instruments of the winches and of the payload."""

    tension: MeasuredTension = text("load cell of each winch", MeasuredTension())
    line_out: MeasuredLength = text("line-out counter of each winch", MeasuredLength())
    payload_depth: MeasuredLength = text(
        "altimeter, USBL or CTD on the payload (the reading is its depth)", MeasuredLength()
    )


def _combined(constant: float | None, pct: float | None, reading: float) -> float | None:
    """Return the root of the sum of squares of both parts; None if neither is given."""
    if constant is None and pct is None:
        return None
    return hypot(constant or 0.0, 0.01 * (pct or 0.0) * reading)


@dataclass(frozen=True, kw_only=True)
class Learning:
    """Standard uncertainties of the scene's figures and of the instruments, before the lift."""

    submerged_weight_pct: float = quantity(
        "standard uncertainty of the payload's submerged weight", "%", 0.01, 100.0, default=6.0
    )
    oscillating_mass_pct: float = quantity(
        "standard uncertainty of its mass and vertical added mass together", "%", 0.01, 100.0,
        default=15.0,
    )  # fmt: skip
    payload_drag_pct: float = quantity(
        "standard uncertainty of its vertical drag area", "%", 0.01, 200.0, default=30.0
    )
    axial_stiffness_pct: float = quantity(
        "standard uncertainty of the rope's axial stiffness", "%", 0.01, 100.0, default=6.0
    )
    axial_damping_pct: float = quantity(
        "standard uncertainty of the rope's axial damping", "%", 0.01, 200.0, default=50.0
    )
    tangential_drag_pct: float = quantity(
        "standard uncertainty of the rope's tangential drag coefficient", "%", 0.01, 200.0,
        default=30.0,
    )  # fmt: skip
    current_pct: float = quantity(
        "standard uncertainty of the current's strength", "%", 0.01, 200.0, default=40.0
    )
    current_shape_pct: float = quantity(
        "standard uncertainty of its effect by profile and drag across the flow, as a strength",
        "%", 0.01, 200.0, default=20.0,
    )  # fmt: skip
    pin_range_n: float | None = quantity(
        "full scale of the load pin; default: 1.5 times the static top tension", "N", 1.0, 1e9,
        default=None,
    )  # fmt: skip
    pin_noise_pct: float = quantity(
        "standard deviation of one sample of the load pin", "% of full scale", 1e-4, 100.0,
        default=0.75,
    )  # fmt: skip
    pin_bias_pct: float = quantity(
        "standard uncertainty of its zero, before a tare", "% of full scale", 1e-4, 100.0,
        default=0.6,
    )  # fmt: skip
    pin_bias_tared_pct: float = quantity(
        "standard uncertainty of its zero after a tare with an empty hook", "% of full scale",
        1e-4, 100.0, default=0.06,
    )  # fmt: skip
    pin_gain_pct: float = quantity(
        "standard uncertainty of its gain", "%", 1e-4, 100.0, default=1.0
    )
    friction_pct: float = quantity(
        "friction of the sheave at the load pin, share of the tension", "%", 0.0, 50.0, default=0.8
    )
    friction_uncertainty_pct: float = quantity(
        "its standard uncertainty, share of the tension", "%", 1e-4, 50.0, default=0.8
    )
    friction_slip_m: float = quantity(
        "travel of the rope over which the friction reverses (Dahl)", "m", 1e-5, 1.0, default=0.005
    )
    friction_rope_m: float = quantity(
        "rope between sheave and drum, whose stretch moves it over the sheave", "m", 0.0, 1e3,
        default=30.0,
    )  # fmt: skip
    line_offset_m: float = quantity(
        "standard uncertainty of the line out of each further winch against the main one's, where "
        "ropes share a load", "m", 1e-4, 100.0, default=0.1,
    )  # fmt: skip
    line_slip_pct: float = quantity(
        "standard uncertainty of its changes, by slip of the counters", "%", 1e-5, 10.0,
        default=0.1,
    )  # fmt: skip
    heave_gain_pct: float = quantity(
        "standard uncertainty of the motion sensor's gain", "%", 1e-4, 100.0, default=3.0
    )
    heave_delay_s: float = quantity(
        "delay of the measured heave that its stamps do not contain", "s", -2.0, 2.0, default=0.15
    )
    heave_delay_uncertainty_s: float = quantity(
        "standard uncertainty of the delay", "s", 1e-4, 2.0, default=0.1
    )
    heave_error_m: float = quantity(
        "standard deviation of the measured heave's error between 5 and 40 s", "m", 1e-4, 5.0,
        default=0.025,
    )  # fmt: skip

    def pin_full_scale_n(self, static_tension_n: float) -> float:
        """Return the full scale of the load pin [N]."""
        return self.pin_range_n or RANGE_OVER_TENSION * abs(static_tension_n)

    def explained_tension_n(self, tension_n: float, static_tension_n: float) -> float:
        """Return the largest mean of measured less computed tension that is explained [N].

        PRIOR_SIGMAS standard uncertainties of weight, gain, zero and friction; the whole tension
        counts as weight of the payload.
        """
        pct = (self.submerged_weight_pct, self.pin_gain_pct, self.friction_uncertainty_pct)
        zero_n = self.pin_bias_pct * self.pin_full_scale_n(static_tension_n)
        return PRIOR_SIGMAS * 0.01 * hypot(zero_n, *(own * tension_n for own in pct))
