"""Live forecasts: what is heard, the worker, and the tables that are published."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from small_scene import small_scene

from rope_twin import load_scene
from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.errors import InputError
from rope_twin.forecast.heave_process import SAMPLE_S
from rope_twin.forecast.live import (
    ForecastWorker,
    LiveForecast,
    LiveForecaster,
    LiveInputs,
    Series,
    _resampled,
    forecast_rows,
    hang_off_response,
    order_rows,
    read_limits,
)
from rope_twin.forecast.orders import read_orders
from rope_twin.forecast.risk import Limits
from rope_twin.forecast.tension_forecast import TENSION, ForecastSettings
from rope_twin.messages import decode, read_cloud
from rope_twin.messages.reports import (
    FORECAST_COLUMNS,
    FORECAST_TOPICS,
    band_columns,
    encode_forecast,
)
from rope_twin.recording.motion_source import open_sea
from rope_twin.scene.schema import Scene
from rope_twin.sea.spectrum import wave_at
from rope_twin.topics import BY_NAME

SETTINGS = ForecastSettings(members=19, burn_in_s=30.0)
LIMITS = Limits(90e3, quiet_s=5.0)
BEGIN_S = 1.7e9  # a ROS time


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A 200 m lift."""
    return small_scene(tmp_path_factory.mktemp("scene"))


def feed(heard: LiveInputs, first_s: float, last_s: float) -> None:
    """Append 10 Hz of a swell, a standing line and a tension that follows it."""
    for k in range(round(10.0 * first_s), round(10.0 * last_s)):
        at = 0.1 * k
        z = 0.5 * math.sin(0.6 * at) + 0.2 * math.sin(0.9 * at)
        heard.heave_m.add(BEGIN_S + at, z)
        heard.line_out_m.add(BEGIN_S + at, 200.0)
        heard.tension_n.add(BEGIN_S + at, 76e3 + 4e3 * z)


def test_series() -> None:
    """In order, finite, without what lies before a gap; another run begins again."""
    own = Series()
    for at, value in ((0.0, 1.0), (0.1, 2.0), (0.1, 3.0), (0.05, 4.0), (0.2, math.nan), (0.3, 5.0)):
        own.add(at, value)
    assert own.table()[:, 1].tolist() == [1.0, 2.0, 5.0]
    own.add(5.0, 6.0)
    assert own.table()[:, 0].tolist() == [5.0]
    own.add(-100.0, 7.0)
    assert own.table()[:, 1].tolist() == [7.0]
    own.add(1000.0, 8.0)
    assert len(own.table()) == 1


def test_it_says_what_it_waits_for(scene: Scene) -> None:
    """Too little heard is no forecast."""
    forecaster, heard = LiveForecaster(scene, LIMITS, SETTINGS), LiveInputs()
    assert forecaster.missing_inputs(heard) == "heave, line out and tension"
    feed(heard, 0.0, 50.0)
    assert forecaster.missing_inputs(heard) == "70 s more of heave"
    with pytest.raises(InputError, match="waits"):
        forecaster.forecast(heard, lambda: BEGIN_S)


def test_forecasts_follow_each_other(scene: Scene) -> None:
    """The second begins where the first has left its nominal rope; waves up-sea enter both."""
    forecaster, heard = LiveForecaster(scene, LIMITS, SETTINGS), LiveInputs()
    feed(heard, 0.0, 130.0)
    for k in range(4 * 130):
        heard.waves.append((BEGIN_S + 0.25 * k, 300.0, 0.3 * math.sin(0.6 * 0.25 * k)))
    first = forecaster.forecast(heard, lambda: BEGIN_S + 131.0)
    assert first.forecast.origin_s == BEGIN_S + 129.5
    assert first.age_s == pytest.approx(1.5)
    assert math.isnan(first.coverage)
    feed(heard, 130.0, 131.0)
    second = forecaster.forecast(heard, lambda: BEGIN_S + 131.2)
    assert second.forecast.origin_s == BEGIN_S + 130.5
    # the same rope, a second later: its median 2 s ahead is the first one's 3 s ahead
    at = round(2.0 / SAMPLE_S) - 1
    apart = second.forecast.band()[1, at] - first.forecast.band()[1, at + 2]
    assert abs(apart) < 0.2 * np.std(first.forecast.values[TENSION][-1]) + 500.0
    assert forecaster.verification is not None
    assert len(forecaster.verification) == 1
    feed(heard, 140.0, 150.0)  # after a gap everything begins again
    assert "more of heave" in forecaster.missing_inputs(heard)


def test_waves_up_sea_move_the_ship_of_the_scene(tmp_path: Path) -> None:
    """Elevations at the hang-off times the response are the heave of the twin's own ship, for a
    bow and a sea from other quarters; the seas are low, as turns are added as small angles.
    """
    text = load_scene("ship_6dof").path.read_text()
    for old, new in (
        ("heading_deg: 0.0", "heading_deg: 30.0"),
        ("significant_height_m: 2.5", "significant_height_m: 0.05"),
        ("      spreading: 6.0\n", ""),
    ):
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "scene.yaml"
    file.write_text(text)
    scene = load_scene(str(file))
    params = scene.listed(WavesParams)
    assert params is not None
    waves = components_of(params, scene.environment.gravity_m_per_s2)
    frequency, heading = waves.omega / (2.0 * np.pi), float(waves.heading[0])
    assert (waves.heading == heading).all()
    x, y, _ = scene.ship.hang_off_m
    answer = hang_off_response(scene, heading, frequency) * wave_at(waves, x, y)
    sea = open_sea(scene)
    assert sea is not None
    samples = sea.between(0, 60_000_000_000)
    times = np.array([1e-9 * one.stamp_ns for one in samples])
    expected = (answer * np.exp(1j * np.outer(times, waves.omega))).sum(axis=1).real
    found = np.array([one.position_m for one in samples])
    assert np.abs(found - expected).max() < 2e-3 * np.abs(expected).max()


def test_worker_publishes_and_ends(scene: Scene) -> None:
    """Each origin once; a stop is heeded; its CPU time is counted."""
    heard, made = LiveInputs(), list[LiveForecast]()
    forecaster = LiveForecaster(scene, LIMITS, SETTINGS)
    worker = ForecastWorker(forecaster, heard, made.append, lambda: BEGIN_S + 126.0, 0.05)
    worker.start()
    until = time.monotonic() + 60.0
    while not worker.waits and time.monotonic() < until:
        time.sleep(0.01)
    assert worker.waits == "heave, line out and tension"
    assert worker.state(1e9) == (True, "waits for heave, line out and tension")
    feed(heard, 0.0, 125.0)
    while not made and time.monotonic() < until:
        time.sleep(0.05)
    now_s = time.monotonic()  # closing may take a while on a busy machine
    worker.close()
    assert not worker.trouble
    assert worker.made == len(made) == len({one.forecast.origin_s for one in made}) == 1
    assert worker.processor_s > 0.0
    assert worker.state(now_s) == (True, "a forecast every second")
    assert worker.state(now_s + 60.0) == (False, "no forecast for 60 s: nothing new was heard")
    heard.heave_m.add(BEGIN_S + 137.0, 0.0)
    assert worker.state(now_s + 60.0) == (False, "no forecast for 60 s: no line out for 12 s")
    heard.doubt = "the ship's heave is lost"
    assert worker.state(now_s) == (False, "the ship's heave is lost")
    for topic, rows in forecast_rows(made[0], LIMITS).items():
        message = decode(topic, encode_forecast(topic, 1_234_567_890_123, "map", rows))
        table = read_cloud(message)
        assert table.dtype.names == FORECAST_COLUMNS[topic]
        assert (
            len(table) == {"forecast/tension": 120, "forecast/risk": 4, "forecast/quiet": 4}[topic]
        )
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1234, 567_890_123)
    tension = read_cloud(
        decode("forecast/tension", encode_forecast(
            "forecast/tension", 0, "map", forecast_rows(made[0], LIMITS)["forecast/tension"]))
    )  # fmt: skip
    assert tension["top_tension_50_n"] == pytest.approx(made[0].forecast.band()[1])
    assert (tension["top_tension_5_n"] <= tension["top_tension_95_n"]).all()


def test_orders_are_compared_once(scene: Scene) -> None:
    """On the seas of the forecast, beside hold; one that the scene cannot follow says why."""
    forecaster, heard = LiveForecaster(scene, LIMITS, SETTINGS), LiveInputs()
    feed(heard, 0.0, 130.0)
    heard.asked = read_orders("lower:0.5 haul:0.5 land:0.2 hold")
    made = forecaster.forecast(heard, lambda: BEGIN_S + 130.0)
    assert [one.order for one in made.orders] == ["hold", "lower:0.5", "haul:0.5"]
    assert "no seabed" in made.refused[0]
    assert len(made.refused) == 1
    rows = order_rows(made, LIMITS, None)
    topic = "forecast/orders"
    table = read_cloud(decode(topic, encode_forecast(topic, 0, "map", rows)))
    assert table.dtype.names == FORECAST_COLUMNS[topic]
    names = [bytes(name).decode() for name in table["name"]]
    assert names == 4 * ["hold"] + 4 * ["lower:0.5"] + 4 * ["haul:0.5"]
    first = table[:4]
    assert (first["peak_change_5_n"] == 0.0).all()
    assert (first["lower"] == 0.0).all()
    assert table["span_s"][:4].tolist() == [10.0, 20.0, 30.0, 60.0]
    # hauling in begins with the payload's mass times the winch's acceleration, and its rebound
    jerk_n = scene.payloads[0].mass_kg * 0.3
    assert jerk_n < table["peak_change_50_n"][8] < 4.0 * jerk_n
    feed(heard, 130.0, 131.0)
    after = forecaster.forecast(heard, lambda: BEGIN_S + 131.0)
    assert not after.orders
    assert not after.refused


@pytest.mark.parametrize(
    "words", ["", "hold " * 7, "lower:fast", "swim", pytest.param("x" * 100_000, id="long")]
)
def test_orders_that_are_none(words: str) -> None:
    """One sentence says what is wrong and what would be right."""
    with pytest.raises(InputError, match=r"give|known: compensation") as refused:
        read_orders(words)
    assert len(str(refused.value)) < 300, "it quotes no text without end"


def test_topics_of_forecasts() -> None:
    """Each has a row in the table of topics; columns carry their unit."""
    for topic in FORECAST_TOPICS:
        assert BY_NAME[topic].publisher == "forecast"
    assert band_columns("payload_speed_m_per_s")[0] == "payload_speed_5_m_per_s"
    assert band_columns("top_tension_n")[2] == "top_tension_95_n"


def test_usual_limits(scene: Scene, tmp_path: Path) -> None:
    """The scene's own limit in place of 0."""
    own = read_limits(scene, (0.0, 0.5, 0.3, 10.0))
    assert own.tension_n == scene.limits.utilisation * scene.ropes[0].breaking_load_n
    assert read_limits(scene, (5e4, 0.5, 0.3, 10.0)).tension_n == 5e4
    with pytest.raises(InputError, match="quiet_s"):
        read_limits(scene, (0.0, 0.5, 0.3, 0.0))
    assert read_limits(scene, (0.0, 0.5, 0.3, 50.0)).quiet_s == 50.0
    with pytest.raises(InputError, match="at most 50 s"):
        read_limits(scene, (0.0, 0.5, 0.3, 55.0))


def test_a_hole_of_tension_does_not_begin_again(scene: Scene) -> None:
    """Heave and line out go on: the record stays as long, and no value is made up in the hole."""
    forecaster, heard = LiveForecaster(scene, LIMITS, SETTINGS), LiveInputs()
    feed(heard, 0.0, 50.0)
    for k in range(500, 600):
        heard.heave_m.add(BEGIN_S + 0.1 * k, 0.1)
        heard.line_out_m.add(BEGIN_S + 0.1 * k, 200.0)
    feed(heard, 60.0, 70.0)
    assert forecaster.missing_inputs(heard) == "50 s more of heave"
    own = _resampled(heard)
    assert own is not None
    hole = (own.time_s > BEGIN_S + 50.5) & (own.time_s < BEGIN_S + 60.0)
    assert np.isnan(own.mean_n[hole]).all()
    assert np.isfinite(own.mean_n[own.time_s > BEGIN_S + 60.0]).all()
    assert np.isnan(own.pin_n).all()  # nothing of it was measured


def test_forecasts_begin_again_when_the_clock_goes_back(scene: Scene) -> None:
    """Another run of earlier times is forecast, kept, and without the old one's waves."""
    forecaster, heard = LiveForecaster(scene, LIMITS, SETTINGS), LiveInputs()
    feed(heard, 1000.0, 1125.0)
    heard.waves.append((BEGIN_S + 1100.0, 300.0, 0.3))
    forecaster.forecast(heard, lambda: BEGIN_S)
    old = forecaster.verification
    feed(heard, 0.0, 125.0)
    made = forecaster.forecast(heard, lambda: BEGIN_S)
    assert made.forecast.origin_s == BEGIN_S + 124.5
    assert forecaster.verification is not None
    assert forecaster.verification is not old
    assert len(forecaster.verification) == 1
    assert not heard.waves


class _Surprised:
    """A forecaster that fails once by what nobody expects, then forecasts an earlier origin."""

    def __init__(self) -> None:
        self.calls = 0

    def missing_inputs(self, heard: LiveInputs) -> str:
        return ""

    def forecast(self, heard: LiveInputs, now_s: object) -> SimpleNamespace:
        self.calls += 1
        if self.calls == 2:
            raise IndexError("a surprise")
        forecast = SimpleNamespace(origin_s=100.0 - self.calls)
        return SimpleNamespace(forecast=forecast, pin_fault="its pin is stuck")


def test_worker_goes_on_after_a_surprise() -> None:
    """It says what happened, tries again, and publishes origins before the last one."""
    made, own = list[Any](), _Surprised()
    worker = ForecastWorker(cast("Any", own), LiveInputs(), made.append, lambda: 0.0, 0.01)
    worker.start()
    until = time.monotonic() + 20.0
    while len(made) < 2 and time.monotonic() < until:
        time.sleep(0.01)
    worker.close()
    assert [one.forecast.origin_s for one in made[:2]] == [99.0, 97.0]
    assert not worker.trouble
    assert worker.state(time.monotonic()) == (False, "its pin is stuck")


@pytest.mark.parametrize(
    ("pin", "words"),
    [(lambda n: 0.5 * n, "standard deviations off"), (lambda n: n / 4.448, "standard deviations"),
     (lambda n: 1e-3 * n, "standard deviations off"), (lambda n: 77e3, "it stands at 77 kN")],
    ids=["half", "pounds", "kilonewtons", "stuck"],
)  # fmt: skip
def test_a_load_pin_that_lies_does_not_move_the_forecast(
    scene: Scene, pin: Callable[[float], float], words: str
) -> None:
    """The next seconds are those without a load pin, and the forecast says so."""
    bands = []
    for reading in (lambda n: math.nan, pin):
        heard = LiveInputs()
        feed(heard, 0.0, 130.0)
        heard.tension_n, measured = Series(), heard.tension_n.rows()
        heard.tension_n.add(measured[0, 0], measured[0, 1])
        for at_s, tension_n in measured[1:]:
            heard.tension_n.add(at_s, reading(tension_n))
        forecasts = LiveForecaster(scene, LIMITS, SETTINGS).forecast(heard, lambda: BEGIN_S)
        bands.append(forecasts.forecast.band())
    assert words in forecasts.pin_fault
    assert forecasts.pin_fault in forecasts.forecast.note
    assert np.array_equal(*bands)
