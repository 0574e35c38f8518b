"""Figures that are learned, their units, and what is known of them before the lift.

The vector θ has the natural logarithm of a factor on each figure of the scene (0: the scene's
value), then the parameters of the instruments:

    y = (1 + g)·T·(1 - μ·ξ) + b,   heave(t) = exp(-h)·measured(t + δ),

with the load pin's gain error g, bias b [N] and sheave friction μ (ξ of Dahl 1968, -1 to 1), and
the motion sensor's gain error h (logarithm) and delay δ [s].

It also says which scenes can be learned yet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.errors import InputError, did_you_mean
from rope_twin.scene.instruments import Learning
from rope_twin.scene.rigging import is_joined, places
from rope_twin.scene.schema import Scene
from rope_twin.twin.ropes import ropes_of


def check_learnable(scene: Scene) -> None:
    """Check that a scene's figures can be learned.

    Raises:
        InputError: one sentence, if they cannot be learned yet.
    """
    right = "payloads on one rope from one hang-off can be learned"
    if is_joined(scene):
        what = _why_not_joined(scene)
        if what:
            raise InputError(f"learn {scene.name}", what, right)
    body = scene.listed(RigidBodyParams)
    if body is not None and body.deck is not None:
        what = "its payload begins on a deck, which carries a part of it that no sensor measures"
        raise InputError(f"learn {scene.name}", what, right)
    if scene.ropes[0].fixed_at_m or not scene.payloads:
        raise InputError(f"learn {scene.name}", "its rope carries no payload", right)


def _why_not_joined(scene: Scene) -> str:
    """Return why what hangs together cannot be learned yet, or ""."""
    hung = sum(line.from_ in places(scene) for line in scene.ropes)
    if hung > 1:
        return (
            f"its load hangs on {hung} ropes from the ship, and a load pin on each cannot tell a "
            "shift of the load between them from offsets of their line counters"
        )
    if scene.sheaves:
        return "a rope of it runs over a sheave below the winch"
    if any(line.fixed_at_m for line in scene.ropes[1:]):
        return "a rope holds it to a fixed point, so that no tension is the load's alone"
    return ""


def static_top_n(scene: Scene) -> float:
    """Return the static tension at the hang-off of the first rope [N].

    Raises:
        SceneError: the scene has no static equilibrium.
    """
    return float(ropes_of(scene, 1).solve_statics()[rows.PULL])


def scene_prior(scene: Scene, tared: bool = False) -> Prior:
    """Return the prior of a scene by its section `learning` and its static top tension.

    tared: the load pin was tared with an empty hook.

    Raises:
        SceneError: the scene has no static equilibrium.
    """
    prior = prior_of(scene.learning, static_top_n(scene))
    return prior.tared() if tared else prior


ROPE_FIGURES = (
    "submerged_weight", "oscillating_mass", "payload_drag", "axial_stiffness", "axial_damping",
    "tangential_drag", "current",
)  # fmt: skip
BIAS, GAIN, HEAVE_GAIN, HEAVE_DELAY, FRICTION = (
    "tension_bias", "tension_gain", "heave_gain", "heave_delay", "sheave_friction",
)  # fmt: skip
SENSOR_FIGURES = (BIAS, GAIN, HEAVE_GAIN, HEAVE_DELAY, FRICTION)
REPORTED = (*ROPE_FIGURES, *SENSOR_FIGURES)
# Logarithms of the size of the motion sensor's error over its specification, in two octaves: the
# share of the measured heave that is error follows from them (noise.HeaveSpectra).
HEAVE_ERRORS = "heave_error_middle", "heave_error_high"
# What profile and drag across the flow change of the current's effect, as its strength does: their
# columns are equal, and so the strength alone is never known better than this.
CURRENT_SHAPE = "current_shape"
NAMES = (*REPORTED, *HEAVE_ERRORS, CURRENT_SHAPE)  # the last three are not reported
COUNT = len(NAMES)
INDEX: Mapping[str, int] = {name: k for k, name in enumerate(NAMES)}
UNITS: Mapping[str, str] = {
    **dict.fromkeys(ROPE_FIGURES, "-"), BIAS: "N", GAIN: "-", HEAVE_GAIN: "-", HEAVE_DELAY: "s",
    FRICTION: "-", **dict.fromkeys((*HEAVE_ERRORS, CURRENT_SHAPE), "-"),
}  # fmt: skip
# Steps in θ that a lane carries, by the figure it is for. The tension answers to mass or stiffness
# alone, which change the natural period, in proportion for a small step only; mass has a lane with
# the stiffness, which leaves the period where it is.
LANE_STEPS: Mapping[str, Mapping[str, float]] = {
    **{name: {name: step} for name, step in (
        ("submerged_weight", 0.02), ("payload_drag", 0.08), ("axial_stiffness", 0.003),
        ("axial_damping", 0.05), ("tangential_drag", 0.10), ("current", 0.20), (HEAVE_GAIN, 0.02),
        (HEAVE_DELAY, 0.04), *((name, 0.2) for name in HEAVE_ERRORS),
    )},
    "oscillating_mass": {"oscillating_mass": 0.03, "axial_stiffness": 0.03},
}  # fmt: skip
# Levels of the sensor's error act on the expected heave only. Where the measured one drives the
# members, their lanes have a sensor that is later by so much [s], which a tangent of the delay does
# not describe for short waves.
HEAVE_SHIFTS: Mapping[str, float] = dict(zip(HEAVE_ERRORS, (0.4, -0.4), strict=True))
RANGE_OVER_TENSION = 1.5  # full scale of a load pin over the static tension, if it is not given
HEAVE_ERROR_SD = 0.5  # of those logarithms
MOST_SDS = 4.0  # a figure stays within so many prior standard deviations


@dataclass(frozen=True)
class Gaussian:
    """Mean and covariance of θ, in the order of NAMES."""

    mean: Floats  # (COUNT,)
    covariance: Floats  # (COUNT, COUNT)

    @property
    def sd(self) -> Floats:
        """Return the standard deviations, (COUNT,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Floats:
        """Return the correlations, (COUNT, COUNT)."""
        return np.asarray(self.covariance / np.outer(self.sd, self.sd))

    def with_figure(self, name: str, mean: float, sd: float) -> Self:
        """Return the Gaussian with one figure replaced by an independent one.

        Raises:
            InputError: there is no such figure, or a number is not finite or not positive.
        """
        if name not in INDEX:
            raise InputError(name, "there is no such figure", did_you_mean(name, NAMES))
        if not (np.isfinite(mean) and np.isfinite(sd) and sd > 0.0):
            what = f"a mean of {mean:g} with a standard deviation of {sd:g} is not possible"
            raise InputError(name, what, "give finite numbers, and a positive deviation")
        k = INDEX[name]
        new_mean, covariance = self.mean.copy(), self.covariance.copy()
        new_mean[k] = mean
        covariance[k, :] = covariance[:, k] = 0.0
        covariance[k, k] = sd * sd
        return replace(self, mean=new_mean, covariance=covariance)


@dataclass(frozen=True)
class Prior:
    """Knowledge before the lift, and the properties of the instruments."""

    gaussian: Gaussian
    pin_noise_n: float  # standard deviation of one sample
    pin_bias_tared_n: float  # standard uncertainty of the zero after a tare
    learning: Learning

    @property
    def mean(self) -> Floats:
        """Return the mean of θ, (COUNT,)."""
        return self.gaussian.mean

    @property
    def sd(self) -> Floats:
        """Return the standard deviation of θ, (COUNT,)."""
        return self.gaussian.sd

    def tared(self) -> Self:
        """Return the prior after a tare: no bias, within the uncertainty of a tared zero."""
        return replace(self, gaussian=self.gaussian.with_figure(BIAS, 0.0, self.pin_bias_tared_n))

    def within(self, theta: Floats) -> Floats:
        """Return θ held within MOST_SDS of the prior and within what is possible.

        Friction is not negative. A figure that is held is reported by `held`.
        """
        reach = MOST_SDS * self.sd
        kept = np.clip(theta, self.mean - reach, self.mean + reach)
        kept[INDEX[FRICTION]] = max(kept[INDEX[FRICTION]], 0.0)
        return kept

    def held(self, theta: Floats) -> tuple[str, ...]:
        """Return the names of figures at the limits of `within`."""
        reach = MOST_SDS * self.sd * (1.0 - 1e-9)
        far = np.abs(theta - self.mean) >= reach
        k = INDEX[FRICTION]
        far[k] |= theta[k] <= 0.0 < self.mean[k]
        return tuple(name for name, one in zip(NAMES, far, strict=True) if one)


def prior_of(learning: Learning, static_tension_n: float) -> Prior:
    """Return the prior of a scene's section `learning`; static_tension_n: at the hang-off [N]."""
    full_scale = learning.pin_range_n or RANGE_OVER_TENSION * abs(static_tension_n)
    pct = np.array([getattr(learning, f"{name}_pct") for name in ROPE_FIGURES])
    sd = np.concatenate([
        0.01 * pct,
        [
            0.01 * learning.pin_bias_pct * full_scale,
            0.01 * learning.pin_gain_pct,
            0.01 * learning.heave_gain_pct,
            learning.heave_delay_uncertainty_s,
            0.01 * learning.friction_uncertainty_pct,
            *(HEAVE_ERROR_SD for _ in HEAVE_ERRORS),
            0.01 * learning.current_shape_pct,
        ],
    ])  # fmt: skip
    mean = np.zeros(COUNT)
    mean[INDEX[HEAVE_DELAY]] = learning.heave_delay_s
    mean[INDEX[FRICTION]] = 0.01 * learning.friction_pct
    return Prior(
        Gaussian(mean, np.diag(sd**2)),
        pin_noise_n=0.01 * learning.pin_noise_pct * full_scale,
        pin_bias_tared_n=0.01 * learning.pin_bias_tared_pct * full_scale,
        learning=learning,
    )


def factors_of(theta: Floats) -> dict[str, Floats]:
    """Return the factors on the rope's figures of θ, (COUNT,) or (members, COUNT)."""
    return {name: np.exp(theta[..., k]) for k, name in enumerate(ROPE_FIGURES)}
