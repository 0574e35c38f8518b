"""Coverage of the intervals of P90 on synthetic seas, and on runs of the twin."""

from __future__ import annotations

import numpy as np
import pytest

from rope_twin.planning.judgement import characteristic_maximum
from rope_twin.planning.phases import legs_of
from rope_twin.planning.plan_reader import read_plan, tip_of
from rope_twin.planning.runs import run_seeds, sea_seed
from rope_twin.planning.seas import SeaState, Ship, tip_record
from rope_twin.scene.error_bound import Setting

LEAST, MOST = 0.85, 0.95  # of intervals of 90 %


def coverage(maxima: np.ndarray, seeds: int) -> float:
    """Return how often an interval from some seeds holds the empirical P90 of all."""
    true = float(np.quantile(maxima, 0.9))
    groups = maxima[: len(maxima) // seeds * seeds].reshape(-1, seeds)
    found = [characteristic_maximum(own, 90.0) for own in groups]
    return float(np.mean([one.low <= true <= one.high for one in found]))


def test_coverage_on_synthetic_seas() -> None:
    """Largest height of the crane tip in 2,400 records of 10 min, in groups of 8 and 16."""
    plan, scene = read_plan("deep_installation")
    tip, sea = tip_of(plan, scene), SeaState(2.5, 9.0, 150.0)
    records = (tip_record(Ship(tip, 0.0), sea, seed, 600.0) for seed in range(2400))
    maxima = np.array([record.position_m.max() for record in records])
    for seeds in (8, 16):
        assert LEAST <= coverage(maxima, seeds) <= MOST


@pytest.mark.long
@pytest.mark.parametrize("quantity", ["top_max_n", "payload_min_n"])
def test_coverage_on_runs_of_the_twin(quantity: str) -> None:
    """Hook load and least load of the payload in 1,600 runs of 10 min near resonance."""
    plan, scene = read_plan("deep_installation")
    ship = Ship(tip_of(plan, scene), 0.0)
    (leg,) = legs_of(plan, scene, plan.phases[1])
    short = type(leg)(**{**vars(leg), "seconds": leg.first_s + 600.0})
    own = short.at_setting(Setting(10, 0.1))
    numbers = [sea_seed(1, 1, 0, k) for k in range(1600)]
    rows = [row for k in range(0, 1600, 32)
            for row in run_seeds(own, ship, SeaState(2.5, 10.0, 135.0), numbers[k : k + 32])]  # fmt: skip # noqa: E501
    values = np.array([row[quantity] for row in rows])
    maxima = values if quantity == "top_max_n" else -values
    for seeds in (8, 16):
        assert LEAST <= coverage(maxima, seeds) <= MOST
