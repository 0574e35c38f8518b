"""Vibration beside a running twin: constant tension is a special case, and it follows the rope."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigs import Rig, march, sine

from rope_twin.errors import InputError
from rope_twin.scene.schema import RegularHeave, SeaState, Winch
from rope_twin.studies.viv.moving import run_moving
from rope_twin.twin.modal_vibration import ModalVibration, line_model_of_twin
from rope_twin.vortex.modal_response import ModalResponse
from rope_twin.vortex.modes import find_lateral_modes
from rope_twin.vortex.shedding import Shedding

CABLE = Rig(
    length=200.0, elements=40, mass=6.4, EA=6.5e7, diameter=0.04, load=3e3, density=1025.0,
    damping=1e5, current=((0.0, (0.3, 0.0)),), drag=(1.2, 0.02), added_mass=1.0, step=0.02,
)  # fmt: skip


def test_of_a_rope_that_rests_it_is_the_response_at_constant_tension() -> None:
    """Modes found again every second of the same rope change next to nothing."""
    twin = CABLE.twin()
    vibration = ModalVibration(twin, Shedding())
    alone = ModalResponse(vibration.response.span, Shedding())
    for _ in range(100):
        twin.advance(10)
        seen = vibration.follow()
        alone.advance(0.2)
    assert vibration.solves == 20
    assert seen.time_s == pytest.approx(20.0)
    assert not seen.slack
    assert seen.amplitude.max() > 0.2
    assert np.abs(seen.amplitude[::-1] - alone.amplitude).max() < 0.02
    assert seen.from_hang_off_m[0] == 0.0
    assert vibration.computing_s > 0.0


def test_its_span_is_the_twins_rope() -> None:
    """Tension, payload and length; frequencies of a hanging rope rise with its load."""
    twin = CABLE.twin()
    span = line_model_of_twin(twin)
    weight = CABLE.weight
    assert span.tension[-1] == pytest.approx(CABLE.top_weight - 2.5 * weight, rel=0.01)
    assert span.end_mass == pytest.approx(3e3)
    assert span.mass @ np.diff(span.s) == pytest.approx(200.0 * (6.4 + 1025.0 * 4e-4 * np.pi))
    light = find_lateral_modes(span, 0.5).frequency[1:]
    heavy = find_lateral_modes(line_model_of_twin(replace(CABLE, load=6e3).twin()), 0.5).frequency[
        1:
    ]
    assert (heavy[: len(light)] > light[: len(heavy)]).all()


def test_it_follows_payout_and_says_what_is_slack() -> None:
    """Under payout the rope grows; hove hard it goes slack, and keeps the modes that it had."""
    winch = Winch(
        speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=2.0, least_line_out_m=5.0,
        most_line_out_m=400.0,
    )  # fmt: skip
    twin = replace(CABLE, winch=winch).twin()
    vibration = ModalVibration(twin, Shedding(), 0.5)
    slack = []
    for shot in march(twin, sine(4.0, 4.0), 16.0, 5, [(1.0, 2.0)]):
        seen = vibration.follow()
        slack.append(seen.slack)
        line_out = shot.line_out_m
        assert np.isfinite(seen.amplitude).all()
    assert line_out > 225.0
    assert seen.from_hang_off_m[-1] > 220.0
    assert any(slack)
    assert not all(slack)
    with pytest.raises(InputError, match="give more than 0"):
        ModalVibration(twin, Shedding(), 0.0)


def test_heave_against_constant_tension() -> None:
    """A rope in heave: the same without heave is the constant case; with it, it differs."""
    scene = CABLE.scene()
    calm = run_moving(scene, Shedding(), 20.0, 1.0)
    assert np.abs(calm.rms - calm.rms_constant).max() < 0.02
    hove = replace(scene, sea_state=SeaState(heave=RegularHeave(amplitude_m=0.7, period_s=5.0)))
    moving = run_moving(hove, Shedding(), 20.0, 0.5)
    assert moving.solves == 40
    assert np.ptp(moving.tension_top_n) > 5e3
    assert np.abs(moving.rms - moving.rms_constant).max() > 0.02
    assert moving.amplitude.shape == (len(moving.time_s), len(moving.share))
    with pytest.raises(InputError, match="not a regular heave"):
        run_moving(replace(scene, sea_state=SeaState(bag="sea_2p5m")), Shedding(), 1.0, 1.0)
