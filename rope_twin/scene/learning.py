"""Prior knowledge for learning a lift: figures of rope and payload, load pin and motion sensor.

All values are standard deviations of one standard uncertainty before anything was measured, or the
properties of the instruments. They judge measurements; nothing that the rope's step computes
depends on them.
"""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.quantity import quantity


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
