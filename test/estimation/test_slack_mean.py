"""Mean over slack: its weights and variance, and what an estimator learns of a slack rope by it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from learned_lift import NOISE_N, lift, recorded, scene

from rope_twin.core.state import Floats
from rope_twin.estimation import estimator as module
from rope_twin.estimation.estimator import MIN_USED, Estimator
from rope_twin.estimation.figures import COUNT, INDEX, NAMES, Gaussian, prior_of
from rope_twin.estimation.lift_model import LiftModel
from rope_twin.estimation.measured_lift import MEAN_S
from rope_twin.estimation.noise import FREQUENCY_HZ, FREQUENCY_STEP_HZ
from rope_twin.estimation.slack import LEARNED, SlackMean, slack_mean

COUNT_OF_MEANS = 240
MASS_KG, WHITE_N = 60e3, 500.0
PSD = 4.0 * np.exp(-0.5 * ((FREQUENCY_HZ - 0.09) / 0.015) ** 2)  # waves of 11 s
ROUGH = 5.0  # times as high waves, in which the small rope is slack all the time
WEIGHT = INDEX["submerged_weight"]


def made(left_out: Floats) -> SlackMean:
    """Return the mean over samples of a block with white noise."""
    found = slack_mean(left_out, WHITE_N**2 * np.eye(COUNT_OF_MEANS), MASS_KG, PSD)
    assert found is not None
    return found


def between(*stretches: tuple[float, float]) -> Floats:
    """Return which means are within stretches of time [s], (k,) bool."""
    middles = MEAN_S * (np.arange(COUNT_OF_MEANS) + 0.5)
    return np.any([(middles > a) & (middles < b) for a, b in stretches], axis=0)


def independent_motions(rng: np.random.Generator, number: int) -> Floats:
    """Return inertia of two masses in independent waves, and noise, (number, k) [N]."""
    t = MEAN_S * np.arange(COUNT_OF_MEANS)
    w = 2.0 * np.pi * FREQUENCY_HZ
    size = MASS_KG * w**2 * np.sqrt(PSD * FREQUENCY_STEP_HZ)
    whole = WHITE_N * rng.standard_normal((number, len(t)))
    for sign in (1.0, -1.0):
        a, b = rng.standard_normal((2, number, len(w)))
        whole += sign * ((a * size) @ np.cos(np.outer(w, t)) + (b * size) @ np.sin(np.outer(w, t)))
    return whole


@pytest.mark.parametrize(
    "stretches", [((0.0, 60.0),), ((10.0, 50.0),), ((0.0, 31.0), (40.0, 60.0))]
)
def test_error_of_the_mean_is_its_variance(stretches: tuple[tuple[float, float], ...]) -> None:
    """An offset is found without bias and with the variance said; an equal mean is far worse."""
    left_out, offset_n = between(*stretches), 700.0
    mean = made(left_out)
    residuals = offset_n + independent_motions(np.random.default_rng(1), 4000)
    found = np.array([mean.of(one) for one in residuals])
    sd = np.sqrt(mean.variance_n2)
    assert found.mean() == pytest.approx(offset_n, abs=4.0 * sd / np.sqrt(len(found)))
    assert found.std() == pytest.approx(sd, rel=0.05)
    assert residuals[:, left_out].mean(axis=1).std() > 2.0 * sd


def test_weights_fall_off_at_the_ends_of_a_slack() -> None:
    """They add up to 1, with none on other samples, and few where slack begins and ends."""
    left_out = between((10.0, 50.0))
    weights = made(left_out).weights
    assert weights.sum() == pytest.approx(1.0)
    assert not weights[~left_out].any()
    own = weights[left_out]
    tenth, quarter = len(own) // 10, len(own) // 4
    middle = own[quarter:-quarter].mean()
    assert max(own[:tenth].mean(), own[-tenth:].mean()) < 0.2 * middle


def test_what_is_not_in_the_mean_does_not_matter() -> None:
    """Samples that were not measured are missing numbers; without slack there is no mean."""
    left_out = between((0.0, 30.0))
    residual = np.where(left_out, 123.0, np.nan)
    assert made(left_out).of(residual) == pytest.approx(123.0)
    none = np.zeros(COUNT_OF_MEANS, bool)
    assert slack_mean(none, np.eye(COUNT_OF_MEANS), MASS_KG, PSD) is None


def test_other_figures_add_to_the_variance() -> None:
    """Figures that move the rope have no column, but the variance that they may cause.

    A hidden error beyond θ keeps its column.
    """
    mean = made(between((0.0, 60.0)))
    sizes = np.arange(1.0, COUNT + 2.0)
    jacobian = np.tile(1000.0 * sizes, (COUNT_OF_MEANS, 1))
    prior = Gaussian(np.zeros(COUNT + 1), np.diag(0.01 * sizes))
    row, variance = mean.row(jacobian, prior)
    learned = np.array([name in LEARNED for name in NAMES] + [True])
    assert row == pytest.approx(np.where(learned, 1000.0 * sizes, 0.0))
    more = (1000.0 * sizes[~learned]) ** 2 @ (0.01 * sizes[~learned])
    assert variance == pytest.approx(mean.variance_n2 + more)


@cache
def learned(waves: float, lost: tuple[float, float] = (0.0, 0.0)) -> Estimator:
    """Return an estimator that has learned from all data, with a pin that is nearly perfect."""
    prior = prior_of(scene().learning, 100e3).tared()
    gaussian = prior.gaussian.with_place(INDEX["tension_gain"], 0.0, 1e-4)
    own = type(prior)(gaussian, NOISE_N, prior.pin_bias_tared_n, prior.learning)
    model = LiftModel(scene(), lift(waves=waves, lost=lost))
    one = Estimator(model, own, model.begin_at_rest(0.0), 0.0)
    one.run()
    return one


@pytest.mark.parametrize("lost", [(0.0, 0.0), (80.0, 95.0)])
def test_weight_of_a_rope_that_is_slack_all_the_time(lost: tuple[float, float]) -> None:
    """No mean is compared, and the weight is found within its interval, with a hole as well.

    Of mass, drag and stiffness, which are off too, nothing is learned, nor of the noise.
    """
    theta, _, _ = recorded(ROUGH)
    one = learned(ROUGH, lost)
    prior_sd = one.prior.sd
    assert len(one.results) == 2
    for result, share in zip(one.results, (0.6, 0.2), strict=True):
        off, sd = (result.posterior.mean - theta)[WEIGHT], result.posterior.sd
        assert result.used < MIN_USED
        assert abs(off) < 2.0 * sd[WEIGHT]
        assert sd[WEIGHT] < share * prior_sd[WEIGHT]
        assert result.posterior.mean[1:4] == pytest.approx(np.zeros(3), abs=1e-9)
        assert sd[1:4] == pytest.approx(prior_sd[1:4], rel=0.001)
        assert np.isnan(result.nis)
    assert one.noise is not None
    assert one.noise.white_n == one.noise.nominal_white_n
    assert (one.noise.levels == 1.0).all()


@pytest.mark.parametrize("waves", [pytest.param(3.6, marks=pytest.mark.long), 4.2])
def test_differences_from_a_slack_member_are_not_used(waves: float) -> None:
    """Where only a perturbed member goes slack, no figure is wrongly believed to be known."""
    theta, _, _ = recorded(waves)
    for result in learned(waves).results:
        off = (result.posterior.mean - theta) / result.posterior.sd
        assert np.abs(off[:5]).max() < 2.5


def test_fault_tests_do_not_see_the_mean() -> None:
    """The innovation has the means of the block, and those in slack are missing."""
    innovation = learned(ROUGH).innovation
    assert innovation is not None
    assert innovation.residual_n.shape == (COUNT_OF_MEANS,)
    assert not np.isfinite(innovation.residual_n).any()


@pytest.mark.long
def test_a_taut_rope_is_learned_as_without_the_mean(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the bit."""
    with_it = learned(1.0).results
    learned.cache_clear()
    monkeypatch.setattr(module, "slack_mean", lambda *_: None)
    for one, other in zip(with_it, learned(1.0).results, strict=True):
        assert np.array_equal(one.posterior.mean, other.posterior.mean)
        assert np.array_equal(one.posterior.covariance, other.posterior.covariance)
        assert one.nis == other.nis
    learned.cache_clear()
