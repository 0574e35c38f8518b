"""Mathematics of the estimator against closed forms: posterior, impedance, friction, noise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import toeplitz

from rope_twin.core.state import Floats
from rope_twin.estimation.figures import BIAS, COUNT, FRICTION, INDEX, NAMES, Gaussian, prior_of
from rope_twin.estimation.least_squares import (
    Whitening,
    gate,
    gauss_newton_step,
    huber_weights,
    inverse,
    misfit,
)
from rope_twin.estimation.lift_model import LoadPin, dahl_states
from rope_twin.estimation.noise import (
    BORGMAN,
    ERROR_BAND_HZ,
    FREQUENCY_HZ,
    FREQUENCY_STEP_HZ,
    Bar,
    ExpectedHeave,
    ResidualNoise,
    heave_error_spectrum,
    heave_spectra,
    heave_spectrum,
    linear_drag,
    tension_error_autocovariance,
    top_impedance,
)
from rope_twin.scene.instruments import Learning


def random_problem(seed: int, k: int = 40, n: int = 5) -> tuple[Any, ...]:
    """Return prior, Jacobian, covariance and data of a linear Gaussian problem."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((n, n))
    scale = 10.0 ** rng.uniform(-3, 3, n)
    P = (root @ root.T + 0.1 * np.eye(n)) * np.outer(scale, scale)
    J = rng.standard_normal((k, n)) / scale
    R = toeplitz(0.8 ** np.arange(k)) + 0.3 * np.eye(k)
    return Gaussian(scale * rng.standard_normal(n), P), J, R, 3.0 * rng.standard_normal(k)


@pytest.mark.parametrize("seed", range(6))
def test_one_step_is_the_posterior_of_a_linear_problem(seed: int) -> None:
    """Conditioning of the joint Gaussian of θ and y gives the same mean and covariance."""
    prior, J, R, y = random_problem(seed)
    start = prior.mean + 0.5 * prior.sd  # from anywhere
    step = gauss_newton_step(
        start,
        prior,
        y - J @ start,
        J,
        Whitening(R, np.ones(len(y), bool)),
        robust=False,
        temper=1.0,
    )
    S = J @ prior.covariance @ J.T + R
    gain = prior.covariance @ J.T @ np.linalg.inv(S)
    mean = prior.mean + gain @ (y - J @ prior.mean)
    covariance = prior.covariance - gain @ J @ prior.covariance
    scale = np.outer(prior.sd, prior.sd)
    assert np.allclose((step.theta - mean) / prior.sd, 0.0, atol=1e-9)
    assert np.allclose((step.posterior.covariance - covariance) / scale, 0.0, atol=1e-9)


def test_tempering_is_a_covariance_that_is_as_many_times_larger() -> None:
    """λ = 1/2 gives the posterior of 2·R."""
    prior, J, R, y = random_problem(9)
    used = np.ones(len(y), bool)
    r = y - J @ prior.mean
    half = gauss_newton_step(prior.mean, prior, r, J, Whitening(R, used), robust=False, temper=0.5)
    double = gauss_newton_step(
        prior.mean, prior, r, J, Whitening(2.0 * R, used), robust=False, temper=1.0
    )
    assert np.allclose(half.theta, double.theta, rtol=1e-10)


def test_a_share_of_the_information_is_a_covariance_that_is_as_many_times_larger() -> None:
    """The share 1/5 of a step leaves the posterior of 5·R."""
    prior, J, R, y = random_problem(9)
    used, r = np.ones(len(y), bool), y - J @ prior.mean
    step, fifth = (
        gauss_newton_step(prior.mean, prior, r, J, Whitening(size * R, used), robust=False)
        for size in (1.0, 5.0)
    )
    believed = step.posterior_of(0.2, prior)
    assert np.allclose(believed.mean, fifth.posterior.mean, rtol=1e-9)
    assert np.allclose(believed.covariance, fifth.posterior.covariance, rtol=1e-9)
    assert step.posterior_of(1.0, prior).mean.tolist() == step.posterior.mean.tolist()


def test_a_missing_sample_is_no_sample() -> None:
    """Rows of missing samples leave the posterior of the others, whatever they hold."""
    prior, J, R, y = random_problem(3)
    used = np.ones(len(y), bool)
    used[7:15] = False
    r = y - J @ prior.mean
    broken = np.where(used, r, np.nan)
    got = gauss_newton_step(prior.mean, prior, broken, J, Whitening(R, used))
    fewer = gauss_newton_step(
        prior.mean, prior, r[used], J[used],
        Whitening(R[np.ix_(used, used)], np.ones(used.sum(), bool)),
    )  # fmt: skip
    assert np.allclose(got.theta, fewer.theta, rtol=1e-12)
    assert np.isfinite(got.precision).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_figure_at_its_limit_leaves_the_best_others(seed: int) -> None:
    """The step then is that of the problem without this figure, whose value is known."""
    prior, J, R, y = random_problem(seed)
    used, free = np.ones(len(y), bool), np.arange(len(prior.mean)) != 2
    r = y - J @ prior.mean
    whiten = Whitening(R, used)
    open_step = gauss_newton_step(prior.mean, prior, r, J, whiten, robust=False)
    most = np.full_like(prior.mean, np.inf)
    least = -most
    moved = 0.5 * (open_step.theta[2] - prior.mean[2])  # half as far as it would go
    (most if moved > 0.0 else least)[2] = prior.mean[2] + moved
    step = gauss_newton_step(
        prior.mean, prior, r, J, whiten, robust=False, least=least, most=most
    )  # fmt: skip
    precision = open_step.precision
    pull = precision @ (open_step.theta - prior.mean)
    others = np.linalg.solve(
        precision[np.ix_(free, free)], pull[free] - precision[free, 2] * moved
    )  # fmt: skip
    assert step.theta[2] == pytest.approx(prior.mean[2] + moved)
    assert np.allclose((step.theta - prior.mean)[free], others, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_several_figures_at_their_limits_are_the_best_ones(seed: int) -> None:
    """Karush-Kuhn-Tucker: the density falls towards each limit, and is level in the others."""
    prior, J, R, y = random_problem(seed)
    near = 0.05 * prior.sd  # nearly all would go further
    r, whiten = y - J @ prior.mean, Whitening(R, np.ones(len(y), bool))
    open_step = gauss_newton_step(prior.mean, prior, r, J, whiten, robust=False)
    least, most = prior.mean - near, prior.mean + near
    step = gauss_newton_step(
        prior.mean, prior, r, J, whiten, robust=False, least=least, most=most
    )  # fmt: skip
    rises = open_step.precision @ (open_step.theta - step.theta) * prior.sd
    slack = 1e-6 * np.abs(open_step.precision @ (open_step.theta - prior.mean) * prior.sd).max()
    at_least, at_most = step.theta <= least + 1e-9 * near, step.theta >= most - 1e-9 * near
    assert np.abs(rises[~at_least & ~at_most]).max(initial=0.0) < slack
    assert rises[at_least].max(initial=0.0) < slack
    assert rises[at_most].min(initial=0.0) > -slack


def test_the_gain_of_a_step_is_that_of_the_misfit() -> None:
    """In a linear problem -ln of the density falls by as much as the step promised."""
    prior, J, R, y = random_problem(5)
    whiten = Whitening(R, np.ones(len(y), bool))
    step = gauss_newton_step(prior.mean, prior, y - J @ prior.mean, J, whiten, robust=False)
    scale = 1e-3  # of the data, so that no residual is an outlier
    small = gauss_newton_step(
        prior.mean, prior, scale * (y - J @ prior.mean), J, whiten, robust=False
    )  # fmt: skip
    before = misfit(prior.mean, prior, whiten(scale * (y - J @ prior.mean)))
    after = misfit(
        small.theta, prior, whiten(scale * (y - J @ prior.mean) - J @ (small.theta - prior.mean))
    )
    assert small.gain == pytest.approx(before - after, rel=1e-6)
    assert step.gain == pytest.approx(small.gain / scale**2, rel=1e-6)


def test_huber_bounds_what_one_sample_does() -> None:
    """A residual of 1000 sd moves θ no further than one of 3 sd with its full weight."""
    prior = Gaussian(np.zeros(1), np.eye(1))
    J, R = np.ones((5, 1)), np.eye(5)
    moved = []
    for size in (3.0, 30.0, 1000.0):
        r = np.array([0.0, 0.0, 0.0, 0.0, size])
        moved.append(
            gauss_newton_step(np.zeros(1), prior, r, J, Whitening(R, np.ones(5, bool))).theta[0]
        )
    # w·r = 3 in each case; the precision loses the sample's own 1/2
    assert moved[0] == pytest.approx(0.5 * 3.0 / 3.5)
    assert moved[2] == pytest.approx(0.5 * 3.0 / (3.0 + 0.5 * 0.003))
    assert np.array_equal(huber_weights(np.array([0.0, -3.0, 6.0])), [1.0, 1.0, 0.5])


def test_gate_drops_what_figures_and_noise_do_not_explain() -> None:
    """The limit is 4.5·√(R + J·P·Jᵀ); what is not finite is missing."""
    prior = Gaussian(np.zeros(1), np.array([[16.0]]))
    J, R = np.array([[0.0], [0.0], [1.0], [1.0], [1.0]]), 9.0 * np.eye(5)
    r = np.array([13.4, 13.6, 22.4, 22.6, np.nan])
    assert np.array_equal(gate(r, R, J, prior), [True, False, True, False, False])


@given(st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_inverse_of_badly_scaled_covariances(seed: int) -> None:
    """The product is the identity, with scales of newtons beside logarithms."""
    P = random_problem(seed)[0].covariance
    scale = np.sqrt(np.diag(P))
    product = (inverse(P) @ P) / np.outer(1.0 / scale, scale)
    assert np.allclose(product, np.eye(len(P)), atol=1e-6)


def uniform(**changes: Any) -> Bar:
    """Return the bar of 3,000 m of 40 mm wire with 48.6 t."""
    values: dict[str, Any] = {
        "length_m": np.array([3000.0]), "EA_n": np.array([64.64e6]),
        "damping_newton_seconds": np.array([3.1e6]), "mass_kg_per_m": np.array([6.384]),
        "drag_kg_per_m2": np.array([0.0]), "end_mass_kg": 48648.0, "end_drag_kg_per_m": 0.0,
    }  # fmt: skip
    return Bar(**(values | changes))


def test_impedance_of_a_uniform_bar() -> None:
    """Closed form: Z = -E*k·(Γ·cos kL + E*k·sin kL)/(E*k·cos kL - Γ·sin kL), Γ = ω²M."""
    bar, f = uniform(), np.linspace(0.02, 1.0, 60)
    w = 2.0 * np.pi * f
    E = 64.64e6 + 1j * w * 3.1e6
    k = w * np.sqrt(6.384 / E)
    G = w**2 * 48648.0
    kL = 3000.0 * k
    Z = -E * k * (G * np.cos(kL) + E * k * np.sin(kL)) / (E * k * np.cos(kL) - G * np.sin(kL))
    assert np.allclose(top_impedance(bar, f), Z, rtol=1e-10)


def test_impedance_of_limits() -> None:
    """A rope without mass is a spring on a mass; at low frequency all mass is lifted."""
    f = np.array([0.001, 0.002, 0.05, 0.2])
    w = 2.0 * np.pi * f
    light = uniform(mass_kg_per_m=np.array([1e-9]), damping_newton_seconds=np.array([0.0]))
    spring, M = 64.64e6 / 3000.0, 48648.0
    assert np.allclose(top_impedance(light, f), -spring * M * w**2 / (spring - M * w**2), rtol=1e-6)
    whole = -(w**2) * (48648.0 + 3000.0 * 6.384)
    assert top_impedance(uniform(), f)[0].real == pytest.approx(whole[0], rel=1e-3)


def test_impedance_of_two_bars_is_that_of_one_cut_in_two() -> None:
    """Sections of the same rope are one rope; drag of a piece is that of its own motion."""
    two = uniform(
        length_m=np.array([1000.0, 2000.0]), EA_n=np.full(2, 64.64e6),
        damping_newton_seconds=np.full(2, 3.1e6), mass_kg_per_m=np.full(2, 6.384),
        drag_kg_per_m2=np.zeros(2),
    )  # fmt: skip
    f = np.linspace(0.03, 0.5, 40)
    assert np.allclose(top_impedance(two, f), top_impedance(uniform(), f), rtol=1e-9)
    assert np.allclose(two.at_length(2500.0).length_m, [1000.0, 1500.0])
    assert np.allclose(two.at_length(900.0).length_m, [900.0, 0.0])
    assert np.allclose(two.at_length(3300.0).length_m, [1000.0, 2300.0])


def test_linearised_drag_dissipates_what_quadratic_drag_does() -> None:
    """Borgman: d·σ² of a Gaussian velocity equals the mean power β·E|v|³ of quadratic drag.

    A stiff rope moves its end as the ship moves, so σ is that of the heave.
    """
    bar = uniform(
        EA_n=np.array([1e12]), damping_newton_seconds=np.array([0.0]), end_drag_kg_per_m=7000.0
    )
    f = FREQUENCY_HZ
    psd = np.exp(-(((f - 0.1) / 0.02) ** 2))
    w = 2.0 * np.pi * f
    sigma = np.sqrt((w**2 * psd).sum() * FREQUENCY_STEP_HZ)
    at = np.argmin(abs(f - 0.1))
    resistance = (top_impedance(bar, f, psd) / (1j * w))[at].real  # force per velocity
    draws = sigma * np.random.default_rng(0).standard_normal(2_000_000)
    assert resistance == pytest.approx(7000.0 * (abs(draws) ** 3).mean() / sigma**2, rel=0.02)
    assert pytest.approx(1.5958, rel=1e-4) == BORGMAN


def test_linearised_drag_about_the_speed_of_the_line() -> None:
    """Price: the best slope of |v + U|·(v + U) is the mean of its derivative, 2·E|v + U|."""
    v = np.random.default_rng(1).standard_normal(2_000_000)
    for U in (0.0, 0.5, -2.0):
        slope = (v * abs(v + U) * (v + U)).mean()
        assert linear_drag(np.ones(1), np.array([U]))[0] == pytest.approx(slope, rel=0.01)
    speeds = np.array([0.0, 0.5])
    alone = [linear_drag(np.ones(2), speeds[k : k + 1]) for k in range(2)]
    assert linear_drag(np.ones(2), speeds) == pytest.approx(np.mean(alone, axis=0))


def test_error_spectrum_has_its_variance_and_its_band() -> None:
    """Its variance lies in the band, above it falls as 1/f⁴; a rigid rope's error is M·ω² of it."""
    S = heave_error_spectrum(0.025)
    low, high = ERROR_BAND_HZ
    band = (low <= FREQUENCY_HZ) & (high >= FREQUENCY_HZ)
    assert S[band].sum() * FREQUENCY_STEP_HZ == pytest.approx(0.025**2)
    at = [S[np.argmin(np.abs(FREQUENCY_HZ - f))] for f in (0.45, 0.9)]
    assert at[0] / at[1] == pytest.approx(16.0, rel=0.05)
    bar = uniform(EA_n=np.array([1e15]), damping_newton_seconds=np.array([0.0]))
    octaves = tension_error_autocovariance(top_impedance(bar, FREQUENCY_HZ), S, 40, 0.25)
    r = octaves.sum(axis=0)
    w = 2.0 * np.pi * FREQUENCY_HZ
    force = (48648.0 + 3000.0 * 6.384) ** 2 * (w**4 * S).sum() * FREQUENCY_STEP_HZ
    assert r[0] == pytest.approx(force, rel=1e-3)
    assert all(np.linalg.eigvalsh(toeplitz(one)).min() > -1e-9 * r[0] for one in octaves)
    beyond = FREQUENCY_HZ >= 0.1
    share = (w**4 * S)[beyond].sum() / (w**4 * S).sum()
    assert octaves[-1, 0] / r[0] == pytest.approx(share, rel=1e-3)


def drawn(psd: Floats, seed: int, seconds: float = 1200.0) -> tuple[Floats, Floats]:
    """Return times and a Gaussian process with a spectrum at FREQUENCY_HZ."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 0.5)
    a, b = rng.standard_normal((2, len(FREQUENCY_HZ))) * np.sqrt(psd * FREQUENCY_STEP_HZ)
    phase = 2.0 * np.pi * np.outer(t, FREQUENCY_HZ + rng.uniform(-1, 1, len(a)) * 1e-3)
    return t, np.cos(phase) @ a + np.sin(phase) @ b


SEA = 0.4 * np.exp(-0.5 * ((FREQUENCY_HZ - 0.09) / 0.012) ** 2) + 1e-9


def test_expected_heave_leaves_the_error_that_it_says() -> None:
    """Less error is left of heave and error with the specified spectra, about as much as `left`."""
    error = heave_error_spectrum(0.05)
    raw, after, said = [], [], []
    for seed in range(6):
        t, z = drawn(SEA, seed, 200.0)
        _, e = drawn(error, 100 + seed, 200.0)
        expected = ExpectedHeave(t, z + e, 20.0, 180.0, SEA + error, 0.05)
        inside = (t > 40.0) & (t < 160.0)
        raw.append(e[inside].var())
        after.append((expected.at((0.0, 0.0))(t[inside]) - z[inside]).var())
        left = heave_spectra(SEA + error, 0.05, np.zeros(2)).left
        said.append(left.sum() * FREQUENCY_STEP_HZ)
    assert np.mean(after) < 0.6 * np.mean(raw)
    assert np.mean(after) == pytest.approx(np.mean(said), rel=0.35)


def test_heave_without_an_error_is_kept_and_more_error_keeps_less() -> None:
    """With an error of nothing the heave comes back; in a high octave only its level counts."""
    t, z = drawn(SEA, 3, 200.0)
    kept = ExpectedHeave(t, z, 20.0, 180.0, SEA, 1e-6).at((0.0, 0.0))
    inside = (t > 25.0) & (t < 175.0)
    assert np.abs(kept(t[inside]) - z[inside]).max() < 0.02 * z.std()
    spectra = [heave_spectra(SEA + 1e-2, 0.02, np.array(own)) for own in ((0, 0), (0.5, 0))]
    more = spectra[1].error - spectra[0].error
    octave = (FREQUENCY_HZ >= 0.1) & (FREQUENCY_HZ < 0.2)
    assert (more[octave] > 0.0).all()
    assert not more[~octave].any()
    for one in spectra:
        assert (one.error <= one.measured).all()
        assert (one.left >= 0.0).all()


def test_expected_heave_goes_through_a_hole() -> None:
    """Where samples are missing the heave is predicted from those around, without a jump."""
    t, z = drawn(SEA, 5, 200.0)
    there = (t < 100.0) | (t > 104.0)
    expected = ExpectedHeave(t[there], z[there], 20.0, 180.0, SEA + 1e-6, 1e-3).at((0.0, 0.0))
    hole = (t > 99.0) & (t < 105.0)
    assert np.abs(expected(t[hole]) - z[hole]).max() < 0.3 * z.std()
    assert np.isfinite(expected(np.array([20.0, 180.0]))).all()


def test_heave_spectrum_has_the_variance_of_a_sine() -> None:
    """The integral of the spectrum of a sine of amplitude 2 is 2, at its frequency."""
    t = np.arange(0.0, 600.0, 0.05)
    psd = heave_spectrum(2.0 * np.sin(2.0 * np.pi * 0.1 * t), 0.05)
    assert psd.sum() * FREQUENCY_STEP_HZ == pytest.approx(2.0, rel=0.05)
    assert FREQUENCY_HZ[psd.argmax()] == pytest.approx(0.1, abs=0.005)


@pytest.mark.parametrize(
    ("levels", "white"),
    [
        ((0.5, 2.0), 1.0),
        *(
            pytest.param(*own, marks=pytest.mark.long)
            for own in (((0.5, 0.5), 1.0), ((2.0, 0.5), 1.0), ((1.0, 1.0), 2.5))
        ),
    ],
)
def test_noise_levels_follow_the_residuals(levels: tuple[float, float], white: float) -> None:
    """Residuals drawn with levels are given these back, to the neighbouring grid value."""
    rng = np.random.default_rng(4)
    lag = np.arange(240)
    r = np.array([4e6 * 0.9**lag * np.cos(w * lag) for w in (0.2, 1.2)])
    noise = ResidualNoise(1000.0, 2)
    R = toeplitz(np.square(levels) @ r) + (1000.0 * white) ** 2 * np.eye(240)
    factor = np.linalg.cholesky(R)
    for _ in range(5):
        noise.learn(factor @ rng.standard_normal(240), np.ones(240, bool), r)
    assert (noise.levels / levels < 1.5).all()
    assert (noise.levels / levels > 1.0 / 1.5).all()
    assert white / 1.35 < noise.white_n / 1000.0 < white * 1.35
    assert noise.covariance(r)[0, 0] == pytest.approx(noise.levels**2 @ r[:, 0] + noise.white_n**2)


def test_dahl_friction_of_a_monotone_travel() -> None:
    """ξ = 1 - exp(-s/δ) from rest, whatever the division; a reversal comes back from there."""
    forth = dahl_states(np.full(50, 0.001), 0.005)
    assert np.allclose(forth, 1.0 - np.exp(-0.001 * np.arange(1, 51) / 0.005))
    assert dahl_states(np.array([0.05]), 0.005)[0] == pytest.approx(forth[-1])
    back = dahl_states(np.array([0.05, 0.0, -0.01]), 0.005)
    assert back[1] == pytest.approx(forth[-1])
    assert back[2] == pytest.approx(-1.0 + (forth[-1] + 1.0) * np.exp(-2.0))


@given(st.lists(st.floats(-0.02, 0.02), min_size=1, max_size=60))
@settings(max_examples=60, deadline=None)
def test_dahl_friction_is_the_recursion(travel: list[float]) -> None:
    """The closed form over runs equals the recursion over increments, and stays within ±1."""
    x, states = 0.0, []
    for ds in travel:
        kept = np.exp(-abs(ds) / 0.005)
        x = x * kept + np.sign(ds) * (1.0 - kept)
        states.append(x)
    got = dahl_states(np.array(travel), 0.005)
    assert np.allclose(got, states, atol=1e-12)
    assert (abs(got) <= 1.0).all()


def test_load_pin_reads_less_while_paying_out() -> None:
    """Friction of 2 % and a bias of 1 kN on 100 kN: 99 kN paying out, 103 kN hauling."""
    pin = LoadPin(Learning(friction_slip_m=0.001), 64.64e6)
    theta = np.zeros(COUNT)
    theta[INDEX["sheave_friction"]], theta[INDEX[BIAS]] = 0.02, 1000.0
    T = np.full(100, 100e3)
    for way, reading in ((1.0, 99e3), (-1.0, 103e3)):
        state = pin.friction_state(T, 50.0 + way * 0.01 * np.arange(100))
        assert pin.measured(T, state, theta)[-1] == pytest.approx(reading, rel=1e-9)
    rest = pin.friction_state(T, np.full(100, 50.0))
    assert np.array_equal(rest, np.zeros(100))


def test_prior_of_a_scene() -> None:
    """Percentages become standard deviations; a tare leaves the zero within 0.06 % of the range."""
    prior = prior_of(Learning(pin_range_n=500e3), 319e3)
    assert prior.sd[INDEX["submerged_weight"]] == pytest.approx(0.06)
    assert prior.sd[INDEX[BIAS]] == pytest.approx(3000.0)
    assert prior.pin_noise_n == pytest.approx(3750.0)
    assert prior.tared().sd[INDEX[BIAS]] == pytest.approx(300.0)
    assert prior_of(Learning(), 200e3).pin_noise_n == pytest.approx(0.0075 * 300e3)
    far = prior.mean + 5.0 * prior.sd
    assert prior.at_limit(prior.within(far)) == NAMES
    assert prior.at_limit(prior.within(prior.mean)) == ()


def test_friction_goes_on_over_a_cut_of_its_history() -> None:
    """In two pieces ξ is what it is in one, to rounding."""
    t = 0.05 * np.arange(800)
    tension, line = 3e5 + 4e4 * np.sin(0.6 * t), 200.0 + 0.02 * np.sin(0.1 * t)
    pin = LoadPin(Learning(), 5e7)
    whole = pin.friction_state(tension, line)
    first = slice(None, 333)
    before = np.array([whole[332], pin.position(tension[first], line[first])[-1]])
    rest = pin.friction_state(tension[333:], line[333:], before)
    assert np.ptp(whole) > 0.1
    np.testing.assert_allclose(rest, whole[333:], atol=1e-12)
    both = pin.friction_state(np.column_stack([tension, 0.9 * tension]), line)
    np.testing.assert_allclose(both[:, 0], whole, atol=1e-12)
    np.testing.assert_allclose(both[:, 1], pin.friction_state(0.9 * tension, line), atol=1e-12)


def test_friction_at_zero_is_reported_as_held() -> None:
    """The limit of what is possible lies within the standard deviations of the prior."""
    prior = prior_of(Learning(friction_pct=2.0, friction_uncertainty_pct=1.0), 3e5)
    theta = prior.mean.copy()
    assert prior.at_limit(theta) == ()
    theta[INDEX[FRICTION]] = -0.001
    assert prior.at_limit(prior.within(theta)) == (FRICTION,)


def test_samples_that_are_not_used_do_not_lower_the_noise() -> None:
    """White noise of 1.6 times the nominal one is found with a third of the samples missing."""
    rng = np.random.default_rng(4)
    noise = ResidualNoise(1000.0, 1)
    for _ in range(5):
        left, used = 1600.0 * rng.standard_normal(240), np.ones(240, dtype=bool)
        used[80:160] = False
        left[80:160] = np.nan
        noise.learn(left, used, 1.0 * (np.arange(240) == 0)[None])
    assert noise.white_n == 1600.0
