"""Figures that are learned, their units, and what is known of them before the lift.

The vector θ has the natural logarithm of a factor on each figure of the scene (0: the scene's
value), then the parameters of the instruments:

    y = (1 + g)·T·(1 - μ·ξ) + b,   heave(t) = exp(-h)·measured(t + δ),

with the load pin's gain error g, bias b [N] and sheave friction μ (ξ of Dahl 1968, -1 to 1), and
the motion sensor's gain error h (logarithm) and delay δ [s].

A load on several ropes from the ship has a load pin on each, with errors of its own, and line
counters whose zero and slip decide how the ropes share it: those of each further winch follow in θ,
as "winch/figure". Lines are counted against the main winch's.

It also says which scenes can be learned yet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.errors import InputError
from rope_twin.scene.instruments import Learning
from rope_twin.scene.rigging import is_joined, places, winches_by_name
from rope_twin.scene.schema import Scene
from rope_twin.twin.multi_line import MultiLineRopes
from rope_twin.twin.ropes import ropes_of


def check_learnable(scene: Scene) -> None:
    """Check that a scene's figures can be learned.

    Raises:
        InputError: one sentence, if they cannot be learned yet.
    """
    right = "payloads that hang free on ropes from winches can be learned"
    if is_joined(scene):
        problem = _why_not_joined(scene)
        if problem:
            raise InputError(f"learn {scene.name}", problem, right)
    body = scene.listed(RigidBodyParams)
    if body is not None and body.deck is not None:
        problem = "its payload begins on a deck, which carries a part of it that no sensor measures"
        raise InputError(f"learn {scene.name}", problem, right)
    if scene.ropes[0].fixed_at_m or not scene.payloads:
        raise InputError(f"learn {scene.name}", "its rope carries no payload", right)


def _why_not_joined(scene: Scene) -> str:
    """Return why what hangs together cannot be learned yet, or ""."""
    dead = [winch for winch in suspending_winches(scene) if winch not in winches_by_name(scene)]
    if dead:
        return f"a rope from '{dead[0]}' has no winch, so nothing measures its length and its share"
    if scene.sheaves:
        return "a rope of it runs over a sheave below the winch"
    if any(line.fixed_at_m for line in scene.ropes[1:]):
        return "a rope holds it to a fixed point, so that no tension is the load's alone"
    if suspending_winches(scene) and scene.listed(RigidBodyParams) is not None:
        return "its rigid body hangs on several ropes, and its rocking moves the load between them"
    return ""


def suspended_ropes(scene: Scene) -> tuple[int, ...]:
    """Return the numbers of the ropes from the ship, the main winch's first."""
    hang_offs = places(scene)
    return (0, *(r for r, line in enumerate(scene.ropes) if r and line.from_ in hang_offs))


def suspending_winches(scene: Scene) -> tuple[str, ...]:
    """Return the winches of the further ropes from the ship, by the names of their hang-offs."""
    return tuple(scene.ropes[r].from_ for r in suspended_ropes(scene)[1:])


def static_tops_n(scene: Scene) -> tuple[float, ...]:
    """Return the static tension at each hang-off [N], the main winch's first.

    Raises:
        SceneError: the scene has no static equilibrium.
    """
    model = ropes_of(scene, 1)
    first_n = float(model.solve_statics()[rows.PULL])
    if not isinstance(model, MultiLineRopes):
        return (first_n,)
    return tuple(float(model.pulls[r, 0, rows.PULL]) for r in suspended_ropes(scene))


def scene_prior(scene: Scene, tared: bool = False) -> Prior:
    """Return the prior of a scene by its section `learning` and its static top tensions.

    tared: the load pin was tared with an empty hook.

    Raises:
        SceneError: the scene has no static equilibrium.
    """
    first_n, *others_n = static_tops_n(scene)
    further_n = dict(zip(suspending_winches(scene), others_n, strict=True))
    prior = prior_of(scene.learning, first_n, further_n)
    return prior.tared() if tared else prior


ROPE_FIGURES = (
    "submerged_weight", "oscillating_mass", "payload_drag", "axial_stiffness", "axial_damping",
    "tangential_drag", "current",
)  # fmt: skip
BIAS, GAIN, HEAVE_GAIN, HEAVE_DELAY, FRICTION = (
    "tension_bias", "tension_gain", "heave_gain", "heave_delay", "sheave_friction",
)  # fmt: skip
LINE_OFFSET, LINE_SLIP = "line_offset", "line_slip"
WINCH_FIGURES = BIAS, GAIN, FRICTION, LINE_OFFSET, LINE_SLIP  # of each further winch
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
    LINE_OFFSET: "m", **dict.fromkeys((FRICTION, *HEAVE_ERRORS, CURRENT_SHAPE, LINE_SLIP), "-"),
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
LINE_STEPS: Mapping[str, float] = {LINE_OFFSET: 0.02, LINE_SLIP: 0.0005}  # lanes of a winch
# Levels of the sensor's error act on the expected heave only. Where the measured one drives the
# members, their lanes have a sensor that is later by so much [s], which a tangent of the delay does
# not describe for short waves.
HEAVE_SHIFTS: Mapping[str, float] = dict(zip(HEAVE_ERRORS, (0.4, -0.4), strict=True))
HEAVE_ERROR_SD = 0.5  # of those logarithms
MAX_SDS = 4.0  # a figure stays within so many prior standard deviations


def of_winch(winch: str, name: str) -> str:
    """Return the name in θ of a figure of a further winch; "": of the main one."""
    return f"{winch}/{name}" if winch else name


def unit_of(name: str) -> str:
    """Return the unit of a figure of θ, also of a further winch."""
    return UNITS[name.rpartition("/")[2]]


def names_of(winches: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the names of θ, with those of further winches."""
    return (*NAMES, *(of_winch(winch, name) for winch in winches for name in WINCH_FIGURES))


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

    def with_place(self, k: int, mean: float, sd: float) -> Self:
        """Return the Gaussian with number k of θ replaced by an independent one."""
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
    # full scale of the load pins of further winches [N] over the main one's, by winch
    ranges: Mapping[str, float] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of θ."""
        return names_of(tuple(self.ranges))

    @property
    def biases(self) -> tuple[tuple[int, float], ...]:
        """Return the number in θ of each pin's bias, and its uncertainty after a tare [N]."""
        ranges = {"": 1.0, **self.ranges}
        index_of = self.names.index
        return tuple(
            (index_of(of_winch(winch, BIAS)), size * self.pin_bias_tared_n)
            for winch, size in ranges.items()
        )

    @property
    def frictions(self) -> list[int]:
        """Return the numbers in θ of the sheaves' friction."""
        return [self.names.index(of_winch(winch, FRICTION)) for winch in ("", *self.ranges)]

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
        return replace(self, gaussian=self.with_tare(self.gaussian))

    def with_tare(self, belief: Gaussian) -> Gaussian:
        """Return a belief with the zeros of all load pins as tared."""
        for k, sd in self.biases:
            belief = belief.with_place(k, 0.0, sd)
        return belief

    def within(self, theta: Floats) -> Floats:
        """Return θ held within MAX_SDS of the prior and within what is possible.

        Friction is not negative. A figure at a limit is reported by `at_limit`.
        """
        reach = MAX_SDS * self.sd
        limited = np.clip(theta, self.mean - reach, self.mean + reach)
        limited[self.frictions] = np.maximum(limited[self.frictions], 0.0)
        return limited

    def at_limit(self, theta: Floats) -> tuple[str, ...]:
        """Return the names of figures at the limits of `within`."""
        reach = MAX_SDS * self.sd * (1.0 - 1e-9)
        far = np.abs(theta - self.mean) >= reach
        k = self.frictions
        far[k] |= (theta[k] <= 0.0) & (self.mean[k] > 0.0)
        return tuple(name for name, one in zip(self.names, far, strict=True) if one)


def prior_of(
    learning: Learning, static_tension_n: float, others: Mapping[str, float] | None = None
) -> Prior:
    """Return the prior of a scene's section `learning`.

    static_tension_n: at the hang-off [N]; others: at those of further winches, by name.
    """
    full_scale = learning.pin_full_scale_n(static_tension_n)
    ranges = {
        name: 1.0 if learning.pin_range_n else abs(own_n / static_tension_n)
        for name, own_n in (others or {}).items()
    }
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
        *([
            0.01 * learning.pin_bias_pct * full_scale * size,
            0.01 * learning.pin_gain_pct,
            0.01 * learning.friction_uncertainty_pct,
            learning.line_offset_m,
            0.01 * learning.line_slip_pct,
        ] for size in ranges.values()),
    ])  # fmt: skip
    names = names_of(tuple(ranges))
    mean = np.zeros(len(names))
    mean[INDEX[HEAVE_DELAY]] = learning.heave_delay_s
    for winch in ("", *ranges):
        mean[names.index(of_winch(winch, FRICTION))] = 0.01 * learning.friction_pct
    return Prior(
        Gaussian(mean, np.diag(sd**2)),
        pin_noise_n=0.01 * learning.pin_noise_pct * full_scale,
        pin_bias_tared_n=0.01 * learning.pin_bias_tared_pct * full_scale,
        learning=learning,
        ranges=ranges,
    )


def factors_of(theta: Floats) -> dict[str, Floats]:
    """Return the factors on the rope's figures of θ, (COUNT,) or (members, COUNT)."""
    return {name: np.exp(theta[..., k]) for k, name in enumerate(ROPE_FIGURES)}
