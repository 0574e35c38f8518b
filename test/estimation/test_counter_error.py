"""Errors of a line counter as hidden figures: their response, and what repeats of them tell."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lsim

from rope_twin.estimation.counter_error import (
    KEPT_BLOCKS,
    KNOT_S,
    CounterErrors,
    ErrorMemory,
)
from rope_twin.estimation.figures import COUNT, Gaussian
from rope_twin.estimation.least_squares import Whitening, gauss_newton_step
from rope_twin.estimation.measured_lift import MEAN_S, SMOOTHING_LEAVES, UnsteadyStretch
from rope_twin.estimation.noise import FREQUENCY_HZ, Bar, top_impedance

RESOLUTION_M = 0.01


def passage(begin_s: float, counts: bytes) -> UnsteadyStretch:
    return UnsteadyStretch(begin_s, begin_s + 3.0, counts, RESOLUTION_M, ())


def test_columns_are_the_response_of_a_mass_on_a_spring() -> None:
    """A light rope with a mass: m·ẍ = k·(u - x) + c·(u' - x'), and the tension is m·ẍ.

    Paying out moves the top down, u = -e.
    """
    mass, EA, C, length = 30e3, 1e8, 4e6, 200.0
    bar = Bar(
        length_m=np.array([length]), EA_n=np.array([EA]), damping_newton_seconds=np.array([C]),
        mass_kg_per_m=np.array([1e-3]), drag_kg_per_m2=np.array([0.0]), end_mass_kg=mass,
        end_drag_kg_per_m=0.0,
    )  # fmt: skip
    errors = CounterErrors.of([passage(10.0, b"start"), passage(30.0, b"stop")])
    begin_s, count = 12.0, 160
    found = errors.columns(top_impedance(bar, FREQUENCY_HZ), begin_s, count)
    k, c = EA / length, C / length
    t = np.arange(5.0, begin_s + MEAN_S * count + 1e-9, 0.01)
    skipped, per_mean = round((begin_s - 5.0) / 0.01), round(MEAN_S / 0.01)
    for middle_s in (11.5, 31.5):  # before the means begin, and within them
        bump = np.exp(-(((errors.knots_s - middle_s) / 0.5) ** 2))
        path = np.interp(t, errors.knots_s, bump)
        speed = -np.gradient(path, t)
        _, tension, _ = lsim(([c * mass, k * mass, 0.0], [mass, c, k]), speed, t)
        tension = tension[skipped : skipped + per_mean * count]
        means = tension.reshape(count, per_mean).mean(axis=1)
        off = found @ bump - means
        assert np.linalg.norm(off) < 0.05 * np.linalg.norm(means)


def test_equal_counts_have_equal_figures() -> None:
    """A passage that comes again has the figures of before; another one has its own."""
    errors = CounterErrors.of([passage(0.0, b"a"), passage(20.0, b"b"), passage(40.0, b"a")])
    per_passage = 1 + round(3.0 / KNOT_S)
    assert len(errors.keys) == 3 * per_passage
    places = ErrorMemory().take(errors).reshape(3, per_passage)
    assert np.array_equal(places[0], places[2])
    assert not set(places[0]) & set(places[1])


def test_repeats_of_an_error_tell_no_more_than_their_batch() -> None:
    """Blocks one after the other have the posterior of all at once, with the error in common.

    With new counts in each block the errors are independent, and the mean over b blocks has
    1/b of their variance; with the same counts it keeps all of it.
    """
    rng = np.random.default_rng(1)
    rows, blocks, white = 30, 4, 0.1
    for repeats in (True, False):
        memory, covariance = ErrorMemory(), np.diag(rng.uniform(0.5, 2.0, COUNT))
        belief = Gaussian(np.zeros(COUNT), covariance)
        m = 1 + round(3.0 / KNOT_S)
        shared = rng.normal(size=(rows, m)) * 500.0
        whole_J, whole_A, whole_y = [], [], []
        for block in range(blocks):
            errors = CounterErrors.of([passage(0.0, b"a" if repeats else bytes([block]))])
            places = memory.take(errors)
            J, y = rng.normal(size=(rows, COUNT)), rng.normal(size=rows)
            A = np.zeros((rows, len(memory)))
            A[:, places] = shared
            joint = memory.with_errors(belief)
            whiten = Whitening(white**2 * np.eye(rows), np.ones(rows))
            residual = y - J @ joint.mean[:COUNT] - A @ joint.mean[COUNT:]
            step = gauss_newton_step(joint.mean, joint, residual, np.hstack([J, A]), whiten,
                                     robust=False, temper=1.0)  # fmt: skip
            memory.learn(step.posterior)
            mean, P = step.posterior.mean, step.posterior.covariance
            belief = Gaussian(mean[:COUNT], P[:COUNT, :COUNT])
            whole_J.append(J)
            whole_A.append(shared)
            whole_y.append(y)
        sd = errors.sd_m[0]
        J, y = np.vstack(whole_J), np.concatenate(whole_y)
        A = np.vstack(whole_A)
        of_errors = np.asarray(sd**2 * A @ A.T, float)
        if not repeats:
            of_errors = of_errors * np.kron(np.eye(blocks), np.ones((rows, rows)))
        R = of_errors + white**2 * np.eye(len(y))
        precision = np.linalg.inv(covariance) + J.T @ np.linalg.solve(R, J)
        P = np.linalg.inv(precision)
        assert np.allclose(belief.covariance, P, rtol=1e-4, atol=1e-9 * P.max())
        assert np.allclose(belief.mean, P @ J.T @ np.linalg.solve(R, y), rtol=1e-4, atol=1e-6)


def test_figures_of_counts_that_do_not_come_again_are_forgotten() -> None:
    """A figure is kept while its passage came within the last KEPT_BLOCKS blocks."""
    memory = ErrorMemory()
    memory.take(CounterErrors.of([passage(0.0, b"once")]))
    own = len(memory)
    for block in range(1, KEPT_BLOCKS):
        memory.take(CounterErrors.of([passage(60.0 * block, b"other")]))
        assert len(memory) == 2 * own
    memory.take(CounterErrors.of([passage(600.0, b"other")]))
    assert len(memory) == own
    joint = memory.with_errors(Gaussian(np.zeros(COUNT), np.eye(COUNT)))
    assert joint.covariance[-1, -1] == pytest.approx(SMOOTHING_LEAVES * RESOLUTION_M**2 / 12.0)
