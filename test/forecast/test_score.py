"""Scores: closed forms, decompositions and the forecasts that they must punish."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from benchmarks.foresight.heave import crps_normal
from rope_twin.errors import InputError
from rope_twin.forecast.score import (
    brier,
    coverage,
    crps_members,
    score_lead,
    skill,
)

PROBABILITIES = st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans()), min_size=1, max_size=60)


def test_crps_of_a_normal_forecast() -> None:
    """At the mean σ·(√2 - 1)/√π; far away |y - μ| - σ/√π; by quadrature in between."""
    assert crps_normal(np.zeros(1), np.full(1, 2.0), np.zeros(1)) == pytest.approx(
        2.0 * (math.sqrt(2.0) - 1.0) / math.sqrt(math.pi)
    )
    assert crps_normal(np.zeros(1), np.ones(1), np.full(1, 50.0)) == pytest.approx(
        50.0 - 1.0 / math.sqrt(math.pi)
    )
    x = np.linspace(-12.0, 12.0, 200_001)
    by_definition = np.trapezoid((ndtr(x) - (x >= 0.7)) ** 2, x)
    assert crps_normal(np.zeros(1), np.ones(1), np.full(1, 0.7)) == pytest.approx(
        by_definition, rel=1e-4
    )


def test_crps_of_members_tends_to_that_of_their_distribution() -> None:
    """Evenly placed members of a normal distribution."""
    from scipy.stats import norm

    members = norm.ppf((np.arange(2000) + 0.5) / 2000)
    for truth in (-2.0, 0.0, 0.7):
        exact = float(crps_normal(np.zeros(1), np.ones(1), np.full(1, truth))[0])
        assert crps_members(members, np.asarray(truth)) == pytest.approx(exact, rel=2e-3)


@given(members=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=12), truth=st.floats(-1e3, 1e3))
def test_crps_of_members_by_its_definition(members: list[float], truth: float) -> None:
    """mean|X - y| - half the mean of all differences; of one member the absolute error."""
    x = np.array(members)
    pairs = 0.5 * np.abs(x[:, None] - x).mean()
    by_pairs = np.abs(x - truth).mean() - pairs
    assert crps_members(x, np.asarray(truth)) == pytest.approx(by_pairs, abs=1e-9)


@given(rows=PROBABILITIES)
def test_brier_parts_add_up(rows: list[tuple[float, bool]]) -> None:
    """Murphy (1973) with the term of Stephenson et al. (2008)."""
    p, o = (np.array(column) for column in zip(*rows, strict=True))
    found = brier(p, o)
    parts = found.reliability - found.resolution + found.uncertainty + found.within
    assert found.score == pytest.approx(parts, abs=1e-12)
    assert found.score == pytest.approx(float(np.mean((p - o) ** 2)))
    assert sum(one.count for one in found.classes) == len(rows)
    assert found.uncertainty == pytest.approx(float(np.var(o)))


def test_brier_gain() -> None:
    """1 for certainty that comes true, 0 for climatology, below for confident nonsense."""
    happened = np.array([True, False, True, True])
    assert brier(happened.astype(float), happened).gain == 1.0
    assert brier(np.full(4, 0.75), happened).gain == pytest.approx(0.0)
    assert brier(1.0 - happened, happened).gain < -4.0
    assert math.isnan(brier(np.ones(3), np.ones(3, bool)).gain)


def test_brier_refusals() -> None:
    """A number that is no probability, lengths that differ, nothing at all."""
    for p, o in (([1.2], [True]), ([math.nan], [True]), ([0.5], [True, False]), ([], [])):
        with pytest.raises(InputError):
            brier(np.array(p), np.array(o, bool))


def test_scores_of_a_calibrated_forecast() -> None:
    """Truth drawn as the members: coverage near 90 %, skill of half the variance explained."""
    random = np.random.default_rng(1)
    known = random.standard_normal((2000, 1))
    members = known[:, None] + random.standard_normal((2000, 90, 1))
    truth = known + random.standard_normal((2000, 1))
    found = score_lead(5.0, members, truth, truth.ravel())
    assert found.coverage == pytest.approx(0.9, abs=0.03)
    assert found.skill == pytest.approx(0.5, abs=0.05)
    assert found.crps_gain == pytest.approx(1.0 - 1.0 / math.sqrt(2.0), abs=0.03)
    assert found.width == pytest.approx(1.0 / math.sqrt(2.0), abs=0.03)


def test_a_narrow_band_is_seen() -> None:
    """Half the right spread covers 59 % of a normal distribution."""
    random = np.random.default_rng(2)
    truth = random.standard_normal((3000, 1))
    narrow = 0.5 * random.standard_normal((3000, 200, 1))
    assert score_lead(2.0, narrow, truth, truth.ravel()).coverage == pytest.approx(0.59, abs=0.03)


def test_coverage_and_skill() -> None:
    """Counted by hand."""
    truth = np.array([0.0, 1.0, 2.0, 3.0])
    assert coverage(np.zeros(4), np.full(4, 2.0), truth) == 0.75
    assert skill(truth, truth, 1.25) == 1.0
    assert skill(np.full(4, 1.5), truth, 1.25) == pytest.approx(0.0)
    with pytest.raises(InputError, match="varies"):
        score_lead(2.0, np.zeros((1, 2, 1)), np.zeros((1, 1)), np.zeros(3))
