"""Likelihood-ratio tests: against batch formulas, χ² without a fault, and the power with one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.stats import chi2, kstest, ncx2

from rope_twin.errors import InputError
from rope_twin.estimation.fault_tests import FaultTests, Signature

NAMES = ("weight", "delay")
INTERVAL_S, WHITE_N = 0.25, 1500.0
P = np.array([[600.0**2, 5.0], [5.0, 0.03**2]])
SIGNATURES = (
    Signature("bias", {"weight": 1000.0}),
    Signature("delay", {"delay": 0.1}),
    Signature("drift", ramp_n_per_s=50.0),
)


def colour(count: int) -> np.ndarray:
    """Autocovariance of a damped oscillation of 12 s, 2 kN."""
    lag = INTERVAL_S * np.arange(count)
    return 2000.0**2 * np.exp(-lag / 6.0) * np.cos(2.0 * np.pi * lag / 12.0)


def columns(count: int) -> np.ndarray:
    """Columns of both figures: a constant, and a swell."""
    time = INTERVAL_S * np.arange(count)
    return np.column_stack([np.ones(count), 4e4 * np.cos(2.0 * np.pi * time / 9.0)])


def covariance(count: int) -> np.ndarray:
    """S = R + J·P·Jᵀ, typed out."""
    J = columns(count)
    return toeplitz(colour(count)) + WHITE_N**2 * np.eye(count) + J @ P @ J.T


def fresh(
    count: int, signatures: tuple[Signature, ...] = SIGNATURES, spread: float = 1.0
) -> FaultTests:
    """Tests without samples; spread: factor on the standard deviations of the figures."""
    return FaultTests(
        signatures, colour(count), WHITE_N, spread**2 * P, NAMES,
        begin_s=100.0, interval_s=INTERVAL_S,
    )  # fmt: skip


def draws(count: int, number: int, seed: int) -> np.ndarray:
    """Innovations without a fault, (number, count)."""
    factor = np.linalg.cholesky(covariance(count))
    return (factor @ np.random.default_rng(seed).standard_normal((count, number))).T


def in_steps(one: FaultTests, residual: np.ndarray, sizes: tuple[int, ...]) -> FaultTests:
    """Give residuals in pieces of these sizes, again and again."""
    J, at, k = columns(len(residual)), 0, 0
    while at < len(residual):
        end = at + sizes[k % len(sizes)]
        one.extend(residual[at:end], J[at:end])
        at, k = end, k + 1
    return one


def test_ratios_equal_those_of_the_whole_covariance() -> None:
    """Every cause at its best onset: (sᵀS⁻¹e)²/(sᵀS⁻¹s) by a dense inverse; some are missing."""
    count = 160
    (e,) = draws(count, 1, 3)
    e[100:] += 6000.0
    e[[5, 40, 41, 42, 120]] = np.nan
    good = np.isfinite(e)
    inverse = np.linalg.inv(covariance(count)[np.ix_(good, good)])
    found = {one.cause: one for one in in_steps(fresh(count), e, (4, 4, 7, 1)).suspicions()}
    assert set(found) == {"bias", "delay", "drift"}
    J, number = columns(count), np.arange(count)
    for cause, one in found.items():
        onset = round((one.onset_s - 100.0) / INTERVAL_S)
        since = number - onset
        shape = {
            "bias": 1000.0 * J[:, 0],
            "delay": 0.1 * J[:, 1],
            "drift": 50.0 * INTERVAL_S * (since + 0.5),
        }[cause]
        s = np.where(since >= 0, shape, 0.0)[good]
        product, power = s @ inverse @ e[good], s @ inverse @ s
        assert one.ratio == pytest.approx(product**2 / power, rel=1e-8)
        assert one.size == pytest.approx(product / power, rel=1e-8)
    assert found["bias"].onset_s == pytest.approx(125.0, abs=1.01)


def test_whitened_innovations_are_independent_and_normal() -> None:
    """4,000 of them by Kolmogorov and Smirnov; their NIS has mean 0 and standard deviation 1."""
    whitened, nis = [], []
    for e in draws(80, 50, 7):
        one = in_steps(fresh(80, ()), e, (30, 10))
        whitened.append(one.whitened)
        nis.append((np.sum(one.whitened**2) - 80) / np.sqrt(160))
    assert kstest(np.concatenate(whitened), "norm").pvalue > 0.01
    assert abs(np.mean(nis)) < 4.0 / np.sqrt(50)
    lags = np.mean([w[1:] * w[:-1] for w in whitened])
    assert abs(lags) < 4.0 / np.sqrt(50 * 79)


def one_onset(e: np.ndarray) -> float:
    """Ratio of the bias that begins 6 s before the end of 10 s."""
    one = in_steps(fresh(40, SIGNATURES[:1]), e, (40,))
    return float(one.ratios()[4, 0])


def test_ratio_without_a_fault_is_chi_square_of_one_degree() -> None:
    """400 draws by Kolmogorov and Smirnov."""
    values = [one_onset(e) for e in draws(40, 400, 11)]
    assert kstest(values, chi2(1).cdf).pvalue > 0.01


def test_power_is_that_of_the_noncentral_chi_square() -> None:
    """A bias found in the share of draws that its noncentrality sᵀS⁻¹s gives."""
    s = np.where(np.arange(40) >= 16, 5000.0, 0.0)
    noncentrality = float(s @ np.linalg.solve(covariance(40), s))
    threshold = noncentrality  # found in about half of the draws
    found = np.mean([one_onset(e + s) > threshold for e in draws(40, 400, 13)])
    expected = ncx2(1, noncentrality).sf(threshold)
    assert found == pytest.approx(expected, abs=4.0 * np.sqrt(expected * (1 - expected) / 400))


def test_a_cause_of_the_detectable_size_is_found_in_as_many_draws() -> None:
    """At a threshold of 20 a bias of that size passes in 0.9 of 400 draws; what is unseen never."""
    tests = in_steps(fresh(40, SIGNATURES[:1]), np.zeros(40), (40,))
    size = float(tests.detectable(104.0, 20.0, 0.9)[0])
    s = np.where(np.arange(40) >= 16, 1000.0 * size, 0.0)
    found = np.mean([one_onset(e + s) > 20.0 for e in draws(40, 400, 17)])
    assert found == pytest.approx(0.9, abs=4.0 * np.sqrt(0.9 * 0.1 / 400))
    assert np.isinf(fresh(40).detectable(104.0, 20.0, 0.9)).all()


def test_samples_before_the_onset_add_power() -> None:
    """An offset that the figures leave open is known from the time before a fault."""
    long, short = fresh(120, SIGNATURES[:1], 10.0), fresh(24, SIGNATURES[:1], 10.0)
    step = np.where(np.arange(120) >= 96, 2000.0, 0.0)
    in_steps(long, step, (4,))
    short.extend(step[96:], columns(120)[96:])
    assert long.ratios().max() > 1.5 * short.ratios().max()


def test_the_fit_of_any_change_equals_that_of_the_whole_covariance() -> None:
    """A load that rings: sᵀS⁻¹e and sᵀS⁻¹s by a dense inverse, with missing samples."""
    count = 120
    (e,) = draws(count, 1, 5)
    e[[7, 70, 71]] = np.nan
    good = np.isfinite(e)
    inverse = np.linalg.inv(covariance(count)[np.ix_(good, good)])
    since = np.arange(count) - 60
    s = np.where(since >= 0, -2000.0 * (1.0 - np.cos(since / 6.0) * np.exp(-since / 30.0)), 0.0)
    product, power = in_steps(fresh(count), e, (4, 3)).fit(np.column_stack([s, 2.0 * s]))
    expected = s[good] @ inverse @ e[good]
    np.testing.assert_allclose(product, [expected, 2.0 * expected], rtol=1e-8)
    noncentrality = s[good] @ inverse @ s[good]
    np.testing.assert_allclose(power, [noncentrality, 4.0 * noncentrality], rtol=1e-8)


def test_what_cannot_be_is_refused() -> None:
    """No signature, two of them, an unknown figure, too many samples."""
    for wrong in (
        Signature("nothing"),
        Signature("both", {"weight": 1.0}, 1.0),
        Signature("unknown", {"height": 1.0}),
    ):
        with pytest.raises(InputError, match=wrong.cause):
            fresh(40, (wrong,))
    full = in_steps(fresh(8), np.zeros(8), (4,))
    with pytest.raises(InputError, match="do not fit"):
        full.extend(np.zeros(1), columns(1))
