"""Tension forecasts: the smoother's closed form, and a rope whose future is known."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from small_scene import small_scene

from rope_twin.errors import InputError, SceneError
from rope_twin.forecast.heave_process import SAMPLE_S, MotionError
from rope_twin.forecast.orders import LinePath, read_order
from rope_twin.forecast.recorded_lift import nominal_states, scene_at_line
from rope_twin.forecast.risk import compare
from rope_twin.forecast.tension_forecast import (
    DEPTH,
    LEARNED_SPREAD,
    MARGIN,
    TENSION,
    ForecastSettings,
    Observations,
    TensionForecast,
    TensionForecaster,
    line_state,
    smoother_gain,
    unlearned_spread,
)
from rope_twin.scene.instruments import Learning
from rope_twin.scene.schema import WINCH, Scene
from rope_twin.scene.winch import HeaveCompensation
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs, FleetRecord

STILL_FIGURES = {"axial_damping": 0.0}
SETTINGS = ForecastSettings(
    members=19, burn_in_s=30.0, motion_error=MotionError(coloured_m=0.0), spread=STILL_FIGURES,
    load_pin_deviation_n=50.0,
)  # fmt: skip
AHC = HeaveCompensation(
    efficiency=0.95, lag_s=0.1, stroke_m=3.0, speed_limit_m_per_s=2.0,
    acceleration_limit_m_per_s2=2.0,
)  # fmt: skip
ORIGIN = 1300  # sample


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A 200 m lift."""
    return small_scene(tmp_path_factory.mktemp("scene"))


def heave_at(time: np.ndarray) -> np.ndarray:
    """Two swells, which ten minutes reveal entirely."""
    return 0.6 * np.sin(0.55 * time) + 0.3 * np.sin(0.8 * time + 1.0)


def test_smoother_is_the_kalman_update() -> None:
    """A normal variable with one reading has mean K·y, variance (1 - K)·P with K = P/(P + R)."""
    random = np.random.default_rng(1)
    members, P, R, y = 4000, 4.0, 1.0, 3.0
    x = 2.0 * random.standard_normal((1, members))
    noise = random.standard_normal((1, members))
    weights = smoother_gain(x, np.array([y]), 1.0, noise)
    updated = (x + (x - x.mean()) @ weights)[0]
    gain = P / (P + R)
    assert updated.mean() == pytest.approx(gain * y, abs=0.1)
    assert np.var(updated) == pytest.approx((1.0 - gain) * P, rel=0.1)
    unrelated = random.standard_normal((1, members))
    shifted = unrelated + (unrelated - unrelated.mean()) @ weights
    assert shifted == pytest.approx(unrelated, abs=0.35)


def truth_of(scene: Scene, line: np.ndarray) -> np.ndarray:
    """The rope's own top tension from 480 s on, at each sample."""
    fleet = Fleet(scene, 4, elements=20, step_s=0.05)
    at = 480.0 + 0.05 * np.arange(round((ORIGIN * SAMPLE_S + 60.0 - 480.0) / 0.05) + 1)
    share = np.clip((at - 480.0) / 10.0, 0.0, 1.0)
    rate = np.where(share < 1.0, 0.1, 0.0)
    z = heave_at(at)
    v = np.gradient(z, 0.05)
    inputs = FleetInputs(share * z, share * v + rate * z, np.interp(at, line[0], line[1]), 0.0 * at)
    tops = fleet.advance(inputs).top_tension_n[:, 0]
    return tops.reshape(-1, 10)


def known_of(scene: Scene) -> Observations:
    """Ten minutes of it as the sensors see them, without error but for a millimetre."""
    at = SAMPLE_S * np.arange(ORIGIN - 1199, ORIGIN + 1)
    seen = heave_at(at) + 1e-3 * np.random.default_rng(3).standard_normal(1200)
    return Observations(ORIGIN * SAMPLE_S, seen, np.full(1200, scene.ropes[0].length_m))


@pytest.fixture(scope="module")
def made(scene: Scene) -> tuple[TensionForecaster, list[TensionForecast], Observations]:
    """Three orders on the same heave."""
    forecaster = TensionForecaster(scene, SETTINGS)
    at = SAMPLE_S * np.arange(ORIGIN + 1)
    start = nominal_states(scene, heave_at(at), np.full(ORIGIN + 1, 200.0), [ORIGIN - 60], SETTINGS)
    known = known_of(scene)
    orders = [read_order(word) for word in ("continue", "hold", "haul:1")]
    return forecaster, forecaster.forecast(known, start[0][0], orders), known


def test_known_heave_gives_the_rope_s_own_tension(
    scene: Scene, made: tuple[TensionForecaster, list[TensionForecast], Observations]
) -> None:
    """Swell that ten minutes reveal: 10 s ahead a skill of 0.98.

    Windows of 200 s spread a line over 5 mHz, which is what keeps it from 1.
    """
    first = made[1][0]
    span = np.array([0.0, 2000.0]), np.array([200.0, 200.0])
    truth = truth_of(scene, span)
    ahead = truth[round((ORIGIN * SAMPLE_S - 480.0) / SAMPLE_S) :]
    middle = first.band()[1]
    error = middle - ahead[:, -1]
    assert np.mean(error[:20] ** 2) < 0.02 * np.var(truth[200:])
    peaks = first.peak_n[:20].mean(axis=1) - ahead[:20].max(axis=1)
    assert np.mean(peaks**2) < 0.02 * np.var(truth[200:])
    assert first.horizon_s > 20.0
    assert (np.diff(first.band(), axis=0) >= 0.0).all()


def test_orders_on_the_same_paths(
    made: tuple[TensionForecaster, list[TensionForecast], Observations],
) -> None:
    """A standing winch that goes on is one that holds; hauling shortens the rope by its line."""
    going, holding, hauling = made[1]
    assert holding.values[TENSION] == pytest.approx(going.values[TENSION], rel=1e-6)
    gone = (hauling.values[DEPTH] - holding.values[DEPTH])[59]
    assert gone == pytest.approx(-(30.0 - 0.5 * 1.0 / 0.3), abs=1.0)
    assert compare(hauling, holding, 10.0).lower < 0.5
    assert (holding.values[MARGIN] > 0.0).all()


def test_load_pin_shifts_the_first_seconds(
    scene: Scene, made: tuple[TensionForecaster, list[TensionForecast], Observations]
) -> None:
    """Members of different weight follow the readings; far ahead they do not."""
    _, forecasts, known = made
    spread = dataclasses.replace(SETTINGS, spread={"submerged_weight": 0.05}, members=40)
    forecaster = TensionForecaster(scene, spread)
    at = SAMPLE_S * np.arange(ORIGIN + 1)
    start = nominal_states(scene, heave_at(at), np.full(ORIGIN + 1, 200.0), [ORIGIN - 60], spread)
    (free,) = forecaster.forecast(known, start[0][0])
    span = np.array([0.0, 2000.0]), np.array([200.0, 200.0])
    past = truth_of(scene, span)[: round((ORIGIN * SAMPLE_S - 480.0) / SAMPLE_S)].mean(axis=1)
    read = (
        dataclasses.replace(known, tension_n=past[-len(known.heave_m) :])
        if len(past) >= len(known.heave_m)
        else dataclasses.replace(
            known,
            tension_n=np.concatenate([np.full(len(known.heave_m) - len(past), np.nan), past]),
        )
    )
    (held,) = forecaster.forecast(read, start[0][0])
    width = [np.subtract(*one.band()[[2, 0]]) for one in (free, held)]
    assert width[1][1] < 0.4 * width[0][1]
    assert width[1][-1] > 0.7 * width[0][-1]
    assert np.abs(held.band()[1, 1] - forecasts[0].band()[1, 1]) < 0.3 * width[0][1]


def test_factor_widens_the_band(
    scene: Scene, made: tuple[TensionForecaster, list[TensionForecast], Observations]
) -> None:
    """Twice the factor, twice the band about the same median."""
    forecasts = []
    at = SAMPLE_S * np.arange(ORIGIN + 1)
    start = nominal_states(scene, heave_at(at), np.full(ORIGIN + 1, 200.0), [ORIGIN - 60], SETTINGS)
    for factor in (1.0, 2.0):
        forecaster = TensionForecaster(scene, SETTINGS)  # the same random numbers
        forecasts += forecaster.forecast(made[2], start[0][0], factor=np.full(120, factor))
    narrow, wide = (one.band() for one in forecasts)
    assert wide[1] == pytest.approx(narrow[1])
    assert wide[2] - wide[1] == pytest.approx(2.0 * (narrow[2] - narrow[1]), rel=1e-9)


def test_refusals(scene: Scene) -> None:
    """Settings and measurements that cannot be."""
    for change in ({"members": 5}, {"burn_in_s": 200.0}, {"spread": {"colour": 0.1}},
                   {"load_pin_deviation_n": 0.0}, {"spread": {"current": -1.0}}):  # fmt: skip
        with pytest.raises(InputError):
            dataclasses.replace(SETTINGS, **change)
    heave = np.zeros(300)
    with pytest.raises(InputError, match="as many of each"):
        Observations(0.0, heave, np.zeros(299))
    with pytest.raises(InputError, match="gaps"):
        Observations(0.0, heave, np.full(300, np.nan))
    with pytest.raises(InputError, match="ascending"):
        nominal_states(scene, heave, np.full(300, 200.0), [20, 10], SETTINGS)
    with pytest.raises(SceneError):
        scene_at_line(scene, -5.0)


def test_scene_at_another_line(tmp_path: Path) -> None:
    """The scene has its rope with more of it paid out."""
    own = small_scene(tmp_path)
    assert scene_at_line(own, 200.0) is own
    assert scene_at_line(own, 250.0).ropes[0].length_m == 250.0


def test_figures_have_the_mean_and_spread_that_were_learned() -> None:
    """Unknown names are left out; before anything is learned the scene's uncertainties hold."""
    own = SETTINGS.with_figures({"submerged_weight": 0.1, "tension_bias": 0.2},
                                {"submerged_weight": 0.01, "tension_bias": 0.4})  # fmt: skip
    assert (own.mean, own.spread) == ({"submerged_weight": 0.1}, {"submerged_weight": 0.01})
    spread = unlearned_spread(Learning(submerged_weight_pct=7.0))
    assert spread["submerged_weight"] == pytest.approx(0.07)
    assert set(spread) == set(LEARNED_SPREAD)
    with pytest.raises(InputError, match="mean logarithm of submerged_weight"):
        dataclasses.replace(SETTINGS, mean={"submerged_weight": np.nan})


def test_line_speed_is_not_a_step_of_the_counter(scene: Scene) -> None:
    """0.2 m/s read in centimetres: a sample off by one shifts the slope by less than 1 cm/s."""
    line = 200.0 + 0.2 * SAMPLE_S * np.arange(-299.0, 1.0)
    line[-2] += 0.01
    now = line_state(Observations(0.0, np.zeros(300), line), line, scene.winch)
    assert now.speed_m_per_s == pytest.approx(0.2, abs=0.01)


def test_a_recorded_line_has_the_compensation_in_it(
    lift_with_compensation: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every member follows the planned line as it is, and the compensated one besides an order."""
    forecaster = TensionForecaster(lift_with_compensation, SETTINGS)
    given, advance = list[FleetInputs](), forecaster.fleet.advance

    def spy(own: FleetInputs, interval_steps: int) -> FleetRecord:
        given.append(own)
        return advance(own, interval_steps)

    monkeypatch.setattr(forecaster.fleet, "advance", spy)
    heave = heave_at(SAMPLE_S * np.arange(300))
    known = Observations(0.0, heave, np.full(300, 200.0), compensated=True)
    start, line = forecaster.fleet.state(0), np.full(1201, 200.0)
    for is_whole in (True, False):
        plan = LinePath(line, 0.0 * line, is_whole=is_whole)
        forecaster.forecast(known, start, plans={WINCH: plan})
    _, whole, _, answered = given  # each after a burn-in
    assert np.array_equal(whole.line_out_m, line)
    assert np.ptp(answered.line_out_m) > 0.5


@pytest.fixture
def lift_with_compensation(scene: Scene) -> Scene:
    """The lift, with active heave compensation."""
    assert scene.winch is not None
    winch = dataclasses.replace(scene.winch, heave_compensation=AHC)
    return dataclasses.replace(scene, winch=winch)
