"""Bayesian least squares with correlated residuals: a step of Gauss-Newton, outliers, limits.

A step of Gauss-Newton is that of a Bayesian least-squares problem with correlated residuals. With a
Gaussian prior N(m, P) of θ, a residual r = y - ŷ(θ), J = ∂ŷ/∂θ and its covariance R,

    Λ = P⁻¹ + λ·JᵀWR⁻¹J,   θ ← θ + Λ⁻¹·[P⁻¹(m - θ) + λ·JᵀWR⁻¹r],

where W has Huber's weights of the whitened residual (Huber 1964). For linear ŷ, W = I and λ = 1 one
step gives the exact posterior N(θ, Λ⁻¹) (Tarantola 2005, eq. 3.37). λ < 1 tempers the likelihood
for what the model leaves out (Bissiri, Holmes and Walker 2016).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import lsq_linear

from rope_twin.core.state import Floats
from rope_twin.estimation.figures import Gaussian

HUBER_SDS = 3.0  # whitened residuals beyond are weighted down (Huber 1964)
GATE_SDS = 4.5  # residuals beyond so many standard deviations of R + J·P·Jᵀ are dropped
TEMPER = 0.5  # share of the information that is believed


class Whitening:
    """Cholesky factor of the covariance of the samples that are in use."""

    def __init__(self, covariance: Floats, used: Floats) -> None:
        """Factor R, (k, k), without the rows and columns of samples that are not used, (k,) bool.

        Raises:
            numpy.linalg.LinAlgError: R is not positive definite.
        """
        self.used = used.astype(bool)
        self._factor = np.linalg.cholesky(covariance[np.ix_(self.used, self.used)])

    def __call__(self, values: Floats) -> Floats:
        """Return the used rows of (k,) or (k, n) with unit covariance."""
        whitened = solve_triangular(self._factor, values[self.used], lower=True)
        return np.asarray(whitened)


def inverse(covariance: Floats) -> Floats:
    """Return the inverse of a covariance, scaled to unit diagonal first."""
    scale = 1.0 / np.sqrt(np.diag(covariance))
    unit = covariance * np.outer(scale, scale)
    scaled = cho_solve(cho_factor(unit, lower=True), np.eye(len(unit)))
    return np.asarray(0.5 * (scaled + scaled.T) * np.outer(scale, scale))


def huber_weights(whitened: Floats) -> Floats:
    """Return the weights of whitened residuals, 1 within HUBER_SDS, falling as 1/|r| beyond."""
    return np.minimum(1.0, HUBER_SDS / np.maximum(np.abs(whitened), 1e-12))


@dataclass(frozen=True)
class Step:
    """Result of one Gauss-Newton step."""

    theta: Floats  # (n,)
    precision: Floats  # Λ, (n, n)
    gain: float  # that a linear ŷ would have in -ln of the posterior density

    @property
    def posterior(self) -> Gaussian:
        """Return the Gaussian approximation of the posterior."""
        return Gaussian(self.theta, inverse(self.precision))

    def posterior_of(self, share: float, prior: Gaussian) -> Gaussian:
        """Return the posterior if only a share of the data's information is believed.

        With the information D = Λ - P⁻¹ of the data and their own optimum d, Λ·θ = P⁻¹·m + D·d.
        """
        if share == 1.0:
            return self.posterior
        P_inverse = inverse(prior.covariance)
        of_prior = P_inverse @ prior.mean
        covariance = inverse(P_inverse + share * (self.precision - P_inverse))
        mean = covariance @ (of_prior + share * (self.precision @ self.theta - of_prior))
        return Gaussian(mean, covariance)


def gauss_newton_step(
    theta: Floats,
    prior: Gaussian,
    residual: Floats,
    jacobian: Floats,
    whiten: Whitening,
    *,
    robust: bool = True,
    temper: float = TEMPER,
    least: Floats | None = None,
    most: Floats | None = None,
) -> Step:
    """Return θ after one step, and its precision.

    theta: (n,), where residual (k,) and jacobian (k, n) were evaluated. robust: with Huber's
    weights. least, most: of each figure after the step, (n,); None: no limit. Where one is at its
    limit the others are the best ones for that.
    """
    r, J = whiten(residual), whiten(jacobian)
    w = huber_weights(r) if robust else np.ones_like(r)
    P_inverse = inverse(prior.covariance)
    precision = P_inverse + temper * (J * w[:, None]).T @ J
    pull = P_inverse @ (prior.mean - theta) + temper * J.T @ (w * r)
    low = np.full_like(theta, -np.inf) if least is None else least - theta
    high = np.full_like(theta, np.inf) if most is None else most - theta
    change = _solve_within(precision, pull, low, high)
    return Step(theta + change, precision, 0.5 * float(change @ pull))


def _solve_within(precision: Floats, right: Floats, low: Floats, high: Floats) -> Floats:
    """Return the x within limits that minimises ½·xᵀΛx - xᵀ·right.

    Several limits at once are met by bounded least squares (Stark and Parker 1995).
    """
    scale = 1.0 / np.sqrt(np.diag(precision))
    factor = np.linalg.cholesky(precision * np.outer(scale, scale))
    target = solve_triangular(factor, scale * right, lower=True)
    x = np.asarray(scale * solve_triangular(factor.T, target))
    if ((low <= x) & (x <= high)).all():
        return x
    bounded = lsq_linear(factor.T, target, (low / scale, high / scale), method="bvls")
    return np.asarray(np.clip(scale * bounded.x, low, high))


def misfit(theta: Floats, prior: Gaussian, whitened: Floats) -> float:
    """Return -ln of the posterior density of θ, but for a constant, by whitened residuals (k,)."""
    size = np.abs(whitened)
    squares = np.where(size < HUBER_SDS, size**2, HUBER_SDS * (2.0 * size - HUBER_SDS))
    deviation = theta - prior.mean
    return 0.5 * float(TEMPER * squares.sum() + deviation @ inverse(prior.covariance) @ deviation)


def gate(residual: Floats, covariance: Floats, jacobian: Floats, prior: Gaussian) -> Floats:
    """Return which samples are used, (k,) bool: finite, and within GATE_SDS of R + J·P·Jᵀ."""
    open_variance = ((jacobian @ prior.covariance) * jacobian).sum(axis=1)
    limit = GATE_SDS * np.sqrt(np.diag(covariance) + open_variance)
    finite = np.isfinite(residual)
    return np.asarray(finite & (np.abs(np.where(finite, residual, 0.0)) < limit))
