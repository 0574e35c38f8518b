"""Risks, quiet windows, comparisons and kept forecasts, from members made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rope_twin.errors import InputError
from rope_twin.forecast.heave_process import SAMPLE_S
from rope_twin.forecast.risk import (
    KEEP_EVERY_S,
    MAX_FORECASTS,
    ForecastVerification,
    Limits,
    compare,
    first_contact,
    quiet_windows,
    risks,
)
from rope_twin.forecast.tension_forecast import (
    BOTTOM,
    DEPTH,
    MARGIN,
    SPEED,
    TENSION,
    TensionForecast,
)

LEADS = SAMPLE_S * np.arange(1, 121)
MEMBERS = 40


def forecast(
    origin_s: float = 0.0,
    tension: np.ndarray | float = 100e3,
    margin: np.ndarray | float = 1e3,
    depth: np.ndarray | float = 50.0,
    speed: np.ndarray | float = 0.0,
    skill: float = 0.0,
    depth_at_origin: np.ndarray | float = 50.0,
) -> TensionForecast:
    """A forecast with these members, (leads, members) or what broadcasts to it."""
    shape = (len(LEADS), MEMBERS)
    values = {
        name: np.broadcast_to(value, shape).astype(float)
        for name, value in (
            (TENSION, tension), (BOTTOM, 1.0), (DEPTH, depth), (SPEED, speed), (MARGIN, margin),
        )
    }  # fmt: skip
    at_origin = {DEPTH: np.broadcast_to(depth_at_origin, MEMBERS), SPEED: values[SPEED][0]}
    return TensionForecast(
        origin_s, "hold", LEADS, values, at_origin, values[TENSION], np.full(120, skill),
        np.ones(120),
    )  # fmt: skip


def test_risks_count_members() -> None:
    """A quarter exceeds after 15 s, a tenth is slack at 40 s."""
    tension = np.full((120, MEMBERS), 100e3)
    tension[30, :10] = 201e3
    margin = np.full((120, MEMBERS), 1.0)
    margin[79, :4] = 0.0
    found = risks(forecast(tension=tension, margin=margin), Limits(200e3))
    assert [one.tension for one in found] == [0.0, 0.25, 0.25, 0.25]
    assert [one.slack for one in found] == [0.0, 0.0, 0.0, 0.1]
    assert all(math.isnan(one.contact) for one in found)


def test_contact() -> None:
    """Members that pass 60 m at 1 m/s and 0.2 m/s; one rests on the seabed from the beginning."""
    depth = np.tile(50.0 + LEADS[:, None], (1, MEMBERS))
    speed = np.ones((120, MEMBERS))
    depth[:, 20:] = 58.0 + 0.2 * LEADS[:, None]
    speed[:, 20:] = 0.2
    depth[:, 39], speed[:, 39] = 60.5, 0.0
    own = forecast(
        depth=depth, speed=speed, depth_at_origin=np.where(np.arange(40) < 39, 50.0, 60.5)
    )
    fast, first = first_contact(own, 60.0)
    assert fast[0] == 1.0
    assert fast[20] == pytest.approx(0.2)
    assert math.isnan(fast[39])
    assert LEADS[first[0]] == 10.0
    assert LEADS[first[20]] == 10.0
    found = risks(own, Limits(1e6, contact_m_per_s=0.5), 60.0)
    assert [one.landing for one in found] == [39 / 40] * 4
    assert [one.contact for one in found] == [0.5] * 4


def test_contact_before_the_first_lead() -> None:
    """Half the members are above the seabed at the origin, and all on it half a second later."""
    at_origin = np.where(np.arange(MEMBERS) % 2, 59.8, 60.1)
    own = forecast(depth=60.1, speed=0.6, depth_at_origin=at_origin)
    _, first = first_contact(own, 60.0)
    assert set(first[1::2]) == {0}
    found = risks(own, Limits(1e6, contact_m_per_s=0.5), 60.0)
    assert [one.landing for one in found] == [0.5] * 4
    assert [one.contact for one in found] == [0.5] * 4


def test_quiet_windows() -> None:
    """Half the members are fast from 8 s on, so that windows before it are quiet for all."""
    speed = np.full((120, MEMBERS), 0.1)
    speed[16:, ::2] = -0.6
    own = forecast(speed=speed)
    found = quiet_windows(own, Limits(1e6, quiet_m_per_s=0.3, quiet_s=8.0), (0.0, 0.5, 10.0))
    assert [one.probability for one in found] == [1.0, 0.5, 0.5]
    with pytest.raises(InputError, match="begin it within 10 s"):
        quiet_windows(own, Limits(1e6), (20.0,))
    known = forecast(speed=speed, skill=0.9)  # with waves measured up-sea
    assert quiet_windows(known, Limits(1e6), (20.0,))[0].probability == 0.5
    with pytest.raises(InputError, match="end it"):
        quiet_windows(known, Limits(1e6), (55.0,))


def test_limits_are_checked() -> None:
    """Each is positive."""
    for name in ("tension_n", "contact_m_per_s", "quiet_m_per_s", "quiet_s"):
        for wrong in (0.0, -1.0, math.nan):
            with pytest.raises(InputError, match=name):
                Limits(**({"tension_n": 1.0} | {name: wrong}))


def test_orders_are_compared_member_by_member() -> None:
    """Bands that overlap almost wholly, and an order that is lower in every member."""
    spread = 20e3 * np.random.default_rng(1).standard_normal(MEMBERS)
    base = forecast(tension=100e3 + spread)
    lower = forecast(tension=99e3 + spread)
    found = compare(lower, base)
    assert found.peak_n == pytest.approx((-1e3, -1e3, -1e3))
    assert found.lower == 1.0
    with pytest.raises(InputError, match="of one call"):
        compare(forecast(origin_s=1.0), base)


@pytest.mark.parametrize(("spread", "expected"), [(1.0, 1.0), (0.5, 2.0), (2.0, 0.5)])
def test_spread_factor_follows_the_bands(spread: float, expected: float) -> None:
    """Bands half as wide as right are widened, by what a hundred forecasts prove."""
    random = np.random.default_rng(2)
    kept = ForecastVerification(LEADS)
    for number in range(MAX_FORECASTS + 20):
        origin = number * 70.0
        truth = random.standard_normal(120)
        # what is known of it: nothing but its distribution
        members = spread * random.standard_normal((120, MEMBERS))
        kept.add(forecast(origin, members))
        kept.observe(origin, 0.0)
        for lead, value in zip(LEADS, truth, strict=True):
            kept.observe(origin + lead, value)
    assert len(kept) == MAX_FORECASTS
    weight = MAX_FORECASTS / (MAX_FORECASTS + 40.0)
    assert np.exp(np.log(kept.factor()).mean()) == pytest.approx(expected**weight, rel=0.08)
    if spread == 1.0:
        assert kept.coverage() == pytest.approx(0.9, abs=0.02)
    else:
        assert abs(kept.coverage() - 0.9) > 0.05


def test_kept_forecasts_wait_for_their_time() -> None:
    """No forecast is judged earlier; one too near the last is not kept; gaps are not bridged."""
    kept = ForecastVerification(LEADS)
    assert (kept.factor() == 1.0).all()
    kept.add(forecast(0.0))
    kept.add(forecast(KEEP_EVERY_S - 1.0))
    assert len(kept) == 1
    kept.observe(0.0, 100e3)
    kept.observe(30.0, 100e3)  # half a minute without readings
    assert (kept.factor() == 1.0).all()
    assert math.isnan(kept.coverage())
