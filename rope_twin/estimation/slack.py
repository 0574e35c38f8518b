"""Mean tension of a rope that goes slack: its momentum tells the weight, whatever it did meanwhile.

Samples in a slack and after it are not compared one by one: when the rope is taut again follows
from the model's mesh as much as from the figures. Their mean is another matter. With the momentum p
of rope and payload, positive upwards, their weight W and the drag F on them the top tension is

    T = W + F + dp/dt,

slack, snap and ringing included. So a residual averaged with weights w of sum 1 is

    Σw·r = δ(W + Σw·F) + Σw·d(δp)/dt,

where δp, the measured momentum less the predicted one, stays bounded: the payload does not run away
from the ship. If both move independently, each as much as the ship, its derivative has the spectrum
2·(M·ω²)²·S_z, with the mass M of all that hangs and the spectrum S_z of the heave. With that noise,
of autocovariance S, and the covariance R that the residual of a taut rope has too, the unbiased
estimate of a constant with the least variance (Aitken 1936) has

    w = C⁻¹·1/(1ᵀ·C⁻¹·1),   C = R + S,   variance 1/(1ᵀ·C⁻¹·1).

These weights fall off at both ends of a slack by themselves, so that momenta at the period of the
waves cancel: an equal mean over D keeps √2·M·v/D of velocities v.

Where several ropes carry the load, T is the sum over their load pins.

The mean is one more row of a block. It tells of the figures that are in the tension by themselves,
with the row w·J. The others change it by mean drag and by what is left of the momentum, which is
not linear. So they are considered (Schmidt 1966): by w·J and by what is known of them they add to
the variance, and nothing is learned of them. The use of the law here is this project's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, toeplitz

from rope_twin.core.state import Floats
from rope_twin.estimation.figures import BIAS, CURRENT_SHAPE, FRICTION, GAIN, NAMES, Gaussian
from rope_twin.estimation.measured_lift import MEAN_S, Bools
from rope_twin.estimation.noise import FREQUENCY_HZ, tension_error_autocovariance

LEARNED = "submerged_weight", "current", CURRENT_SHAPE, BIAS, GAIN, FRICTION


@dataclass(frozen=True)
class SlackMean:
    """Weighted mean of a block's residual over the samples that are left out for slack."""

    weights: Floats  # (k,) of sum 1 for each load pin; 0: compared one by one, or not measured
    variance_n2: float  # if all figures are known

    def of(self, residual_n: Floats) -> float:
        """Return the mean of a residual with slack, (k,) [N]; NaN where not measured."""
        return float(self.weights @ np.where(self.weights == 0.0, 0.0, residual_n))

    def row(
        self, jacobian: Floats, prior: Gaussian, names: Sequence[str] = NAMES
    ) -> tuple[Floats, float]:
        """Return the row of a Jacobian (k, n) for this mean, (n,), and the mean's variance [N²].

        Its first columns are those of θ, by their names. prior: of all n, before the block.
        """
        row = self.weights @ jacobian
        considered = np.zeros(len(row))
        for k, name in enumerate(names):
            if name.rpartition("/")[2] not in LEARNED:
                considered[k] = row[k]
        variance = self.variance_n2 + considered @ prior.covariance @ considered
        return row - considered, float(variance)


def slack_mean(
    left_out: Bools, covariance: Floats, mass_kg: float, heave_psd: Floats, pins: int = 1
) -> SlackMean | None:
    """Return the mean over samples that are measured but left out for slack; None: there are none.

    left_out: (k,); covariance: R of the sum over the load pins, (k, k) [N²]; mass_kg: M, with added
    mass; heave_psd: S_z, at FREQUENCY_HZ [m²/Hz]; pins: whose residuals follow each other.
    """
    if not left_out.any():
        return None
    inertia = (mass_kg * (2.0 * np.pi * FREQUENCY_HZ) ** 2).astype(complex)
    octaves = tension_error_autocovariance(inertia, 2.0 * heave_psd, len(left_out), MEAN_S)
    samples = np.flatnonzero(left_out)
    total = (covariance + toeplitz(octaves.sum(axis=0)))[np.ix_(samples, samples)]
    solved = cho_solve(cho_factor(total, lower=True), np.ones(len(samples)))
    weights = np.zeros(len(left_out))
    weights[samples] = solved / solved.sum()
    return SlackMean(np.tile(weights, pins), float(1.0 / solved.sum()))
