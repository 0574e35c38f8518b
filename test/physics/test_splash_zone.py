"""The splash zone: wetted share, its buoyancy as a spring, slamming, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_cases import apply
from rigs import CALM, Rig, march, still

from rope_twin.core import state as rows
from rope_twin.effects import Surroundings
from rope_twin.effects.payload import PayloadParams, SplashZoneParams
from rope_twin.effects.payload import build as build_payload
from rope_twin.effects.payload import build_splash_zone as build
from rope_twin.effects.rope_in_air import WettingParams, WindParams
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.scene.schema import Winch
from rope_twin.scene.shapes import PayloadFigures
from rope_twin.twin.twin import Twin

G, RHO = 9.80665, 1025.0
WATER = Surroundings(RHO, G, 0.0)
BODY = PayloadFigures(
    mass_kg=20e3, volume_m3=6.0, added_mass_kg=(8e3, 9e3, 1e4), drag_area_m2=(10.0, 12.0, 14.0)
)
ZONE = SplashZoneParams(height_m=3.0, bottom_area_m2=8.0, slamming=5.0)


def end_force(z: float, velocity: float = 0.0, acceleration: float = 0.0) -> Any:
    """Force on the payload with its middle at z, R and the zz block."""
    work = rows.new_work(4)
    work[rows.POSITION + 2, 0] = z
    work[rows.VELOCITY + 2, 0] = velocity
    work[rows.ACCELERATION + 2, 0] = acceleration
    effects = (build_payload(PayloadParams(), BODY, WATER), build(ZONE, BODY, WATER))
    apply(effects, work, rows.Stage(0.0, 1e-4, 1e-2, 0.0), 0, 1)
    return work[rows.RESIDUAL + 2, 0], work[rows.BLOCK + 5, 0]


@pytest.mark.parametrize(
    ("z", "share"), [(9.0, 0.0), (1.51, 0.0), (0.75, 0.25), (0.0, 0.5), (-1.5, 1.0), (-40.0, 1.0)]
)
def test_weight_inertia_and_drag_scale_with_submergence(z: float, share: float) -> None:
    """-(m + βA)·a - β·k·|v|·v - (m - βρV)·g, moving up so that nothing slams; to round-off."""
    v, a = 0.7, 0.3
    found, block = end_force(z, v, a)
    k = 0.5 * RHO * 14.0
    expected = -(20e3 + share * 1e4) * a - share * k * v * v - (20e3 - share * RHO * 6.0) * G
    assert found == pytest.approx(expected, rel=1e-9)
    rise = 1e-4 / 3.0 if 0.0 < share < 1.0 else 0.0
    partly = rise * (RHO * 6.0 * G - 1e4 * a - k * v * v)
    assert block == pytest.approx(20e3 + share * (1e4 + 2e-2 * k * v) + partly, rel=1e-9)


def test_slamming_force_in_the_splash_zone() -> None:
    """½·ρ·C_s·A·v² while it enters, nothing above, below, or on the way out."""
    for z in (1.0, -1.0):
        share = 0.5 - z / 3.0
        slam = 0.5 * RHO * 5.0 * 8.0 * 2.0**2
        drag = share * 0.5 * RHO * 14.0 * 2.0**2
        weight = (20e3 - share * RHO * 6.0) * G
        assert end_force(z, -2.0)[0] == pytest.approx(slam + drag - weight, rel=1e-9)
    assert end_force(5.0, -2.0)[0] == pytest.approx(-20e3 * G, rel=1e-9)


def lowered(waves: WavesParams, slamming: float = 0.0) -> Any:
    """20 t lowered at 0.25 m/s from 5 m above the water: heights and tensions at the payload.

    The rope has a dry part, on which no wind acts: the step is that of the shipped splash_zone.
    """
    rig = Rig(
        length=10.0, elements=5, mass=6.4, EA=65e6, damping=4e5, load=20e3, volume=6.0,
        added=(8e3, 9e3, 1e4), area=(10.0, 12.0, 14.0), density=RHO, hang_off=(0.0, 0.0, 15.0),
        step=2e-3, ramp=4.0,
        winch=Winch(speed_limit_m_per_s=0.5, acceleration_limit_m_per_s2=0.3, min_line_out_m=5.0,
                    max_line_out_m=40.0),
    )  # fmt: skip
    scene = rig.scene()
    zone = replace(ZONE, slamming=slamming)
    current, *others = scene.effects
    air = WettingParams(), WindParams(velocity_m_per_s=(0.0, 0.0), normal=0.0)
    scene = replace(scene, effects=(current, waves, *air, *others, zone))
    snapshots = march(Twin(scene), still, 60.0, every=10, speeds=[(0.0, 0.25), (44.0, 0.0)])
    return np.array(
        [(snapshot.payload_position_m[2], snapshot.tension_payload_n) for snapshot in snapshots]
    ).T


def test_lowering_through_calm_water() -> None:
    """Tension falls along a line from m·g to (m - ρV)·g over the body's height, drag aside: 1 %."""
    z, tension = lowered(CALM)
    share = np.clip(0.5 - z / 3.0, 0.0, 1.0)
    drag = share * 0.5 * RHO * 14.0 * 0.25**2
    expected = (20e3 - share * RHO * 6.0) * G - drag
    settled = slice(300, 2100)
    off = np.abs(tension - expected)[settled]
    assert off.max() < 0.015 * 20e3 * G  # the start of the winch and the kinks ring a little
    assert off.mean() < 0.004 * 20e3 * G
    assert z[-1] < -4.0


def test_buoyancy_follows_the_wave_elevation() -> None:
    """At the height of the mean surface a wave of 1 m changes the buoyancy by its elevation."""
    sea = WavesParams(regular=RegularWave(height_m=1.0, period_s=9.0), ramp_s=4.0)
    calm_z, calm = lowered(CALM)
    z, tension = lowered(sea)
    partly = (np.abs(calm_z) < 0.8) & (np.abs(z - calm_z) < 0.2)
    assert partly.any()
    time = 0.02 * np.arange(1, len(z) + 1)
    eta = 0.5 * np.cos(2.0 * math.pi / 9.0 * time)
    change = (calm - tension)[partly]
    lift = RHO * 6.0 * G / 3.0 * eta[partly]
    assert np.corrcoef(change, lift)[0, 1] > 0.9
    slope = float(change @ lift / (lift @ lift))
    assert 0.8 < slope < 1.3  # the water's acceleration adds its part, a tenth at this period
