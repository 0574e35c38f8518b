"""A surface-piercing rope: dry part in air, wind, waves."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from effect_cases import apply
from rigs import CALM, Rig, march_to_end, sine, with_nothing_below
from scipy.optimize import brentq

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.effects import Surroundings
from rope_twin.effects.rope_in_air import WettingParams, WindParams, build_wetting
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.effects.waves import build as build_waves
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.schema import Scene
from rope_twin.studies.viv_frequency_domain import span_of
from rope_twin.twin.monitors import Monitors
from rope_twin.vortex.line_model import line_model

WIRE = Rig(
    length=200.0, elements=97, mass=20.0, EA=2e8, diameter=0.08, load=2000.0, volume=0.25,
    density=1025.0, drag=(1.2, 0.01), added_mass=1.0, step=0.01,
)  # fmt: skip
AREA = 0.25 * pi * 0.08**2
NO_AIR = WindParams(velocity_m_per_s=(0.0, 0.0), normal=0.0)


def scene_of(rig: Rig, *more: object) -> Scene:
    """A rig's scene with further effects.

    A rope through the surface always has waves, be they of no height, a wind, be it without a
    force, and a payload, be it of no mass: so all these scenes are compiled once.
    """
    scene = rig.scene()
    if not more:
        return scene
    given = {type(own): own for own in (CALM, *more)}
    waves, air = given[WavesParams], (given[WettingParams], given.get(WindParams, NO_AIR))
    current, *others = scene.effects
    scene = replace(scene, effects=(current, waves, *air, *others))
    return scene if rig.fixed_at is None else with_nothing_below(scene)


def nodes_of(twin: Twin) -> tuple[np.ndarray, np.ndarray]:
    """Material coordinates from the lower end, and positions, of the nodes."""
    n = int(twin.rope.state.counts[rows.ELEMENTS])
    return twin.rope.state.s[: n + 1], twin.rope.state.nodes[:3, : n + 1]


@pytest.mark.parametrize("above_m", [1.7, 30.0, 80.0, 151.3])
def test_static_tension_of_a_surface_piercing_rope(above_m: float) -> None:
    """T = W + w·(wet length) + m·g·(dry length), with the wet length read off the shape."""
    scene = scene_of(replace(WIRE, hang_off=(0.0, 0.0, above_m)), WettingParams())
    twin = Twin(scene)
    twin.advance(1)
    s, position = nodes_of(twin)
    wet = np.interp(0.0, position[2], s)
    wet_weight = (WIRE.mass - 1025.0 * AREA) * WIRE.gravity
    expected = WIRE.load_weight + wet_weight * wet + WIRE.mass * WIRE.gravity * (200.0 - wet)
    assert twin.top_tension_n == pytest.approx(expected, rel=1e-6)
    by_hand_n = lift_figures(scene).top_tension_n(200.0)  # without stretch, of 5e-5 here
    assert by_hand_n == pytest.approx(twin.top_tension_n, rel=1e-4)


def test_wetting_leaves_a_submerged_rope_unchanged() -> None:
    """To the bit, in motion."""
    deep = replace(WIRE, hang_off=(0.0, 0.0, -20.0))
    twins = [Twin(scene_of(deep, *more)) for more in ((), (WettingParams(),))]
    positions = []
    for twin in twins:
        march_to_end(twin, sine(1.0, 5.0), 3.0)
        positions.append(nodes_of(twin)[1].copy())
    assert np.array_equal(*positions)


def test_a_dry_rope_equals_one_in_zero_density() -> None:
    """A rope between two points in the air moves as one in a water of no density."""
    high = replace(WIRE, hang_off=(0.0, 0.0, 300.0), fixed_at=(60.0, 0.0, 120.0), load=0.0)
    dry = Twin(scene_of(high, WettingParams()))
    empty = Twin(scene_of(replace(high, density=0.0)))
    for twin in (dry, empty):
        march_to_end(twin, sine(1.0, 5.0), 3.0)
    assert np.abs(nodes_of(dry)[1] - nodes_of(empty)[1]).max() < 1e-9


def two_part_period(tension: float, dry: float, wet: float, half_m: float) -> float:
    """Period of a taut string of which half has another mass per metre.

    With k = ω·√(m/T) the shapes sin(k·s) from both ends meet where tan(k1·a)/k1 + tan(k2·a)/k2 = 0.
    """

    def miss(omega: float) -> float:
        k1, k2 = (omega * np.sqrt(mass / tension) for mass in (dry, wet))
        return float(
            k2 * np.sin(k1 * half_m) * np.cos(k2 * half_m)
            + k1 * np.cos(k1 * half_m) * np.sin(k2 * half_m)
        )

    guess = 0.5 * pi / half_m * np.sqrt(tension / (0.5 * (dry + wet)))
    return 2.0 * pi / float(brentq(miss, 0.8 * guess, 1.2 * guess))


def test_lateral_period_of_a_half_submerged_string() -> None:
    """The first period of a taut upright rope through the surface, within 0.1 %."""
    length, tension = 100.0, 4e6
    EA = 2e9
    rig = replace(
        WIRE, length=length / (1.0 + tension / EA), elements=80, EA=EA, gravity=1e-9, load=0.0,
        diameter=0.2, mass=40.0, hang_off=(0.0, 0.0, 50.0), fixed_at=(0.0, 0.0, -50.0),
        drag=(0.0, 0.0), step=0.002,
    )  # fmt: skip
    twin = Twin(scene_of(rig, WettingParams()))
    s, position = nodes_of(twin)
    shape = np.sin(pi * (position[2] + 50.0) / length)
    twin.rope.state.nodes[rows.VELOCITY, : len(s)] = 0.05 * shape
    middle = []
    for _ in range(2000):
        twin.advance(1)
        middle.append(nodes_of(twin)[1][0, 40])
    x = np.array(middle)
    up = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    crossings = up + x[up] / (x[up] - x[up + 1])
    computed = float(np.diff(crossings).mean()) * rig.step
    stretch = 1.0 + tension / EA
    dry, added = 40.0 / stretch, 1025.0 * 0.25 * pi * 0.2**2 / stretch
    assert computed == pytest.approx(two_part_period(tension, dry, dry + added, 50.0), rel=1e-3)
    assert computed < 0.9 * two_part_period(tension, dry + added, dry + added, 50.0)


def test_vortices_and_added_mass_only_below_the_surface() -> None:
    """50 m of 200 m in the air: `viv` and the line model have m·L + Ca·ρ·A·(wet length) and no
    flow there; half an element for a node at the surface.
    """
    flow = replace(WIRE, hang_off=(0.0, 0.0, 50.0), current=((0.0, (0.4, 0.0)), (-9e2, (0.4, 0.0))))
    scene = scene_of(flow, WettingParams())
    twin = Twin(scene)
    twin.advance(1)
    for span, z in (
        (line_model(twin.rope), nodes_of(twin)[1][2]),
        ((still := span_of(scene)).span, still.place[2]),
    ):
        mass = 200.0 * 20.0 + 1025.0 * AREA * 150.0
        assert span.mass @ np.diff(span.s) == pytest.approx(mass, rel=1e-3)
        assert span.speed[z > 1.1].max() < 1e-9
        assert span.speed[z < -1.1] == pytest.approx(0.4, rel=0.02)


def test_wind_sag_of_a_taut_rope() -> None:
    """Sag q·L²/(8·T) of an upright rope without weight, q = ½·ρ·d·C_d·U²; the water has none."""
    length, tension, EA = 60.0, 2e5, 2e9
    rig = replace(
        WIRE, length=length / (1.0 + tension / EA), elements=40, EA=EA, load=0.0,
        hang_off=(0.0, 0.0, 70.0), fixed_at=(0.0, 0.0, 10.0), gravity=1e-9,
    )  # fmt: skip
    wind = WindParams(velocity_m_per_s=(0.0, 25.0), exponent=0.0)
    twin = Twin(scene_of(rig, WettingParams(), wind))
    q = 0.5 * 1.226 * 0.08 * 1.2 * 25.0**2
    _, position = nodes_of(twin)
    stretched = twin.rope.work[rows.TENSION, 20]
    assert position[1].max() == pytest.approx(q * length**2 / (8.0 * stretched), rel=1e-3)
    below = replace(rig, hang_off=(0.0, 0.0, -10.0), fixed_at=(0.0, 0.0, -70.0))
    assert np.abs(nodes_of(Twin(scene_of(below, WettingParams(), wind)))[1][1]).max() == 0.0


def test_wind_profile_power_law() -> None:
    """(z/10)^α: a rope 20 times as high feels 20^0.24 of the force."""
    sags = []
    for base in (5.0, 100.0):
        rig = replace(
            WIRE, length=9.99, elements=10, EA=2e9, load=0.0, gravity=1e-9,
            hang_off=(0.0, 0.0, base + 10.0), fixed_at=(0.0, 0.0, base),
        )  # fmt: skip
        twin = Twin(scene_of(rig, WettingParams(), WindParams(velocity_m_per_s=(20.0, 0.0))))
        sags.append(nodes_of(twin)[1][0].max())
    assert sags[1] / sags[0] == pytest.approx((105.0 / 10.0) ** 0.24, rel=5e-3)


def test_wave_kinematics_above_the_surface_reach_only_the_payload() -> None:
    """Lower end 1 m above a crest, nodes 20 m and more: the wave meets only the payload."""
    waves = WavesParams(regular=RegularWave(height_m=4.0, period_s=8.0), ramp_s=0.0)
    around = Surroundings(1025.0, 9.80665, 1.0)
    effects = (build_waves(waves, None, around), build_wetting(WettingParams(), None, around))
    results = []
    for own in (effects[:1], effects):
        work = rows.new_work(3)
        work[2, :3], work[rows.LENGTH], work[rows.VOLUME] = (3.0, 22.0, 42.0), 1.0, 0.01
        work[rows.TANGENT + 2] = 1.0
        apply(own, work, rows.Stage(0.0, 0.0, 0.0, 0.0), 0, 3)
        results.append(work[rows.FLOW, :3].copy())
    assert results[0].min() > 1.0
    assert results[1].tolist() == [results[0][0], 0.0, 0.0]


@pytest.mark.parametrize("wind", [pytest.param(False, marks=pytest.mark.long), True])
def test_energy_balance_of_a_surface_piercing_rope(wind: bool) -> None:
    """The balance closes to 1e-6 of what is exchanged."""
    rig = replace(
        WIRE, hang_off=(0.0, 0.0, 25.0), length=60.0, elements=60, EA=4e7, damping=4e6, step=0.005,
        ramp=4.0,
    )  # fmt: skip
    waves = WavesParams(regular=RegularWave(height_m=6.0, period_s=7.0), ramp_s=4.0)
    more = (WindParams(velocity_m_per_s=(20.0, 10.0)),) if wind else ()
    scene = scene_of(rig, waves, WettingParams(), *more)
    twin = Twin(scene, Monitors(energy=True))
    snapshot = march_to_end(twin, sine(1.5, 6.0), 12.0)
    energy = snapshot.energy
    assert energy is not None
    assert abs(energy.residual_j) < 1e-6 * energy.exchanged_j
