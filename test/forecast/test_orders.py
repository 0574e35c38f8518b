"""Orders: their words, the line that they give, and compensation beside the winch's own."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rope_twin.errors import InputError
from rope_twin.forecast.orders import (
    KINDS,
    LineState,
    Order,
    compensation_path,
    line_path,
    read_order,
)
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Winch
from rope_twin.scene.winch import HeaveCompensation
from rope_twin.twin.winch.commands import Payout
from rope_twin.twin.winch.components import Compensation

WINCH = load_scene("deep_lift").winch
assert WINCH is not None
STEP_S = 0.05
STILL = LineState(3000.0, 0.0)


def test_words_of_orders() -> None:
    """Each order reads back what it is written as."""
    words = ["continue", "hold", "stop", "lower:0.5", "haul:1", "land:0.3", "compensation:on",
             "stop@aft", "lower:0.5@aft sheave", "compensation:off@winch"]  # fmt: skip
    assert [read_order(word).name for word in words] == words
    assert {read_order(word).kind for word in words} == set(KINDS)
    assert read_order("lower").speed_m_per_s == 0.5
    alone = read_order("lower:0.4@aft")
    assert (alone.winch, alone.speed_m_per_s) == ("aft", 0.4)
    assert alone.of("aft") is alone
    assert alone.of("winch") == read_order("continue")


@pytest.mark.parametrize(
    ("word", "fault"),
    [("lower_it", "there is no"), ("hall", "did you mean"), ("lower:fast", "speed"),
     ("haul:-1", "speed"),
     ("hold:2", "value"), ("hold:2@aft", "value"), ("@aft", "there is no"), ("stop@", "no 'stop@'"),
     ("lower:nan", "speed"), ("compensation:maybe", "neither"), ("", "no ''")],
)  # fmt: skip
def test_words_that_are_none(word: str, fault: str) -> None:
    """One sentence each."""
    with pytest.raises(InputError, match=fault):
        read_order(word)


@given(
    kind=st.sampled_from(["hold", "stop", "lower", "haul", "continue"]),
    speed=st.floats(0.05, 1.0),
    now=st.floats(-1.0, 1.0),
    out=st.floats(101.0, 3199.0),
)
def test_line_keeps_the_limits_of_the_winch(
    kind: str, speed: float, now: float, out: float
) -> None:
    """Acceleration, speed, and rate as the derivative of the line, in every case."""
    given_speed = speed if kind in ("lower", "haul") else 0.0
    path = line_path(Order(kind, given_speed), LineState(out, now), WINCH, 1200, STEP_S)
    rate, line = path.speed_m_per_s, path.out_m
    assert np.abs(np.diff(rate)).max() <= 0.3 * STEP_S + 1e-12
    assert np.abs(rate).max() <= max(abs(now), given_speed) + 1e-9
    assert line[1:] == pytest.approx(line[:-1] + 0.5 * STEP_S * (rate[1:] + rate[:-1]), rel=1e-12)


def test_lowering_takes_the_time_of_its_acceleration() -> None:
    """v²/2a on the way to v, then v·t; back to rest in v/a."""
    path = line_path(Order("lower", 0.6), STILL, WINCH, 200, STEP_S)
    assert path.out_m[-1] - 3000.0 == pytest.approx(0.6 * 10.0 - 0.6**2 / 0.6, abs=1e-9)
    braked = line_path(Order("hold"), LineState(3000.0, 0.6), WINCH, 200, STEP_S)
    assert braked.out_m[-1] - 3000.0 == pytest.approx(0.6**2 / 0.6, abs=0.6 * STEP_S)
    assert braked.speed_m_per_s[-1] == 0.0


def test_line_ends_at_the_limit() -> None:
    """It slows down before the most line out, reports it, and stays."""
    path = line_path(Order("lower", 1.0), LineState(3195.0, 1.0), WINCH, 1200, STEP_S)
    assert path.out_m[-1] == pytest.approx(3200.0, abs=0.06)
    assert "3200 m" in path.note
    landed = line_path(
        Order("land", 0.3), dataclasses.replace(STILL, to_contact_m=5.0), WINCH, 1200, STEP_S
    )
    assert landed.out_m[-1] == pytest.approx(3007.0, abs=0.06)


def test_orders_that_a_scene_cannot_follow() -> None:
    """Too fast, nowhere to land, no compensation, no winch."""
    for order, winch, fault in (
        (Order("lower", 1.5), WINCH, "too fast"),
        (Order("land", 0.3), WINCH, "no seabed"),
        (Order("compensation", compensation=True), WINCH, "no compensation"),
        (Order("lower", 0.5), None, "nothing pays out"),
    ):
        with pytest.raises(InputError, match=fault):
            line_path(order, STILL, winch, 10, STEP_S)
    assert line_path(Order("hold"), STILL, None, 10, STEP_S).out_m[-1] == 3000.0


@pytest.mark.parametrize(("lag_s", "delay_s"), [(0.3, 0.1), (0.0, 0.0), (0.5, 0.37)])
def test_compensation_is_that_of_the_winch(lag_s: float, delay_s: float) -> None:
    """Line and rate of each member as the winch's own component steps them."""
    params = HeaveCompensation(
        efficiency=0.95, lag_s=lag_s, delay_s=delay_s, stroke_m=3.0, speed_limit_m_per_s=1.0,
        acceleration_limit_m_per_s2=2.0,
    )  # fmt: skip
    time = STEP_S * np.arange(1200)
    rates = np.column_stack([a * np.cos(w * time) for a, w in ((0.4, 0.6), (1.4, 0.9))])
    rates *= np.minimum(time / 5.0, 1.0)[:, None]
    stroke, rate = compensation_path(params, rates, 0, len(time), STEP_S)
    for member in range(2):
        own = Compensation(params)
        for k in range(1, len(time)):
            moment = SimpleNamespace(
                step_s=STEP_S, begin_ns=round((k - 1) * STEP_S * 1e9),
                heave_m_per_s=rates[k, member],
            )  # fmt: skip
            line = own.add(Payout(0.0, 0.0), moment)  # type: ignore[arg-type]
            if k > 100:
                assert rate[k, member] == pytest.approx(line.speed_m_per_s, abs=0.02)
        assert stroke[-1, member] == pytest.approx(line.length_m, abs=0.05)


def test_compensation_slows_down_when_it_is_switched_off() -> None:
    """With its own acceleration, to rest."""
    params = HeaveCompensation(
        efficiency=1.0, lag_s=0.0, stroke_m=10.0, speed_limit_m_per_s=2.0,
        acceleration_limit_m_per_s2=0.5,
    )  # fmt: skip
    rates = np.full((200, 1), 0.4)
    stroke, rate = compensation_path(params, rates, 0, 100, STEP_S)
    assert rate[99, 0] == pytest.approx(0.4)
    assert rate[-1, 0] == 0.0
    assert math.isclose(stroke[-1, 0], 0.4 * 99 * STEP_S + 0.4**2 / 1.0, abs_tol=0.02)


def test_a_winch_is_a_scene_winch() -> None:
    """The rope's ordinary scene has the limits that the tests above count with."""
    assert isinstance(WINCH, Winch)
    assert (WINCH.speed_limit_m_per_s, WINCH.acceleration_limit_m_per_s2) == (1.0, 0.3)
