"""Waves against Airy's closed forms, written out here in numpy, and their loads on a rope."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_cases import apply
from hypothesis import given
from hypothesis import strategies as st
from rigs import Rig, Vector, march, still
from scipy.optimize import brentq

from rope_twin.core import state as rows
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.waves import cos_sin, decay
from rope_twin.effects import Surroundings
from rope_twin.effects.waves import (
    Jonswap,
    Measured,
    RegularWave,
    WavesParams,
    WaveSystem,
    build,
    components_of,
)
from rope_twin.sea.spectrum import Waves, wave_numbers
from rope_twin.twin.twin import Twin

G = 9.80665
WATER = Surroundings(1025.0, G, 1.0)
DRY = WavesParams(regular=RegularWave(height_m=3.0, period_s=8.0), ramp_s=0.0)
SEA = WavesParams(
    jonswap=Jonswap(significant_height_m=2.5, peak_period_s=8.0),
    components=200, seed=4, heading_deg=20.0, spreading=6.0, ramp_s=0.0,
)  # fmt: skip


def airy(
    sea: Waves, place: Vector, time: float, stretching: str = "wheeler"
) -> tuple[Vector, Vector, Vector]:
    """Surface (n,), velocity and acceleration (3, n) at places (3, n), all components, no cuts."""
    h, k = sea.depth_m, sea.wave_number[:, None]
    cos_b, sin_b = np.cos(sea.heading)[:, None], np.sin(sea.heading)[:, None]
    omega, a = sea.omega[:, None], sea.amplitude_m[:, None]
    angle = k * (place[0] * cos_b + place[1] * sin_b) - omega * time + sea.phase[:, None]
    eta = (a * np.cos(angle)).sum(axis=0)
    z = np.minimum((place[2] - eta) / (1.0 + eta / h), 0.0)
    if stretching != "wheeler":
        z = np.minimum(place[2], 0.0)
    level = np.exp(k * z) * (1.0 + np.exp(-2.0 * k * (z + h))) / (1.0 - np.exp(-2.0 * k * h))
    rise = np.exp(k * z) * (1.0 - np.exp(-2.0 * k * (z + h))) / (1.0 - np.exp(-2.0 * k * h))
    if stretching == "linear":  # d/dz of cosh and sinh over sinh(kh) at z = 0 is k·sinh and k·cosh
        above = np.maximum(np.minimum(place[2], eta), 0.0)
        level, rise = level + k * above, rise + k * above / np.tanh(k * h)
    across, up = a * omega * level * np.cos(angle), a * omega * rise * np.sin(angle)
    across_rate, up_rate = (
        a * omega**2 * level * np.sin(angle),
        -a * omega**2 * rise * np.cos(angle),
    )
    u = np.stack([(across * cos_b).sum(0), (across * sin_b).sum(0), up.sum(0)])
    w = np.stack([(across_rate * cos_b).sum(0), (across_rate * sin_b).sum(0), up_rate.sum(0)])
    return eta, u, w


def kernel_at(params: WavesParams, place: Vector, time: float) -> tuple[Vector, Vector]:
    """Velocity and acceleration that the effect's kernel gives, (3, n) each."""
    work = rows.new_work(place.shape[1])
    work[:3] = place
    apply((build(params, None, WATER),), work, rows.Stage(time, 0.0, 0.0, 0.0), 1, place.shape[1])
    return work[rows.FLOW : rows.FLOW + 3], work[rows.FLOW_RATE : rows.FLOW_RATE + 3]


@given(
    period=st.floats(2.0, 25.0),
    depth=st.floats(5.0, 5000.0),
)
def test_dispersion_relation(period: float, depth: float) -> None:
    """ω² = g·k·tanh(k·h), against a bracketing solver."""
    omega = 2.0 * math.pi / period
    exact = brentq(lambda k: G * k * math.tanh(k * depth) - omega**2, 1e-9, 1e2, xtol=1e-15)
    assert wave_numbers(np.array([omega]), depth, G)[0] == pytest.approx(exact, rel=1e-9)


@jit_entry
def _functions(x: Vector, out: Vector) -> None:
    for i in range(x.shape[0]):
        out[0, i], out[1, i] = cos_sin(x[i])
        out[2, i] = decay(-abs(x[i]) % 60.0 - 60.0)


def test_kernel_cosine_and_exponential() -> None:
    """1e-13 of numpy's within a turn; 1e-10 over a day of angles, which are rounded themselves."""
    near, far = np.linspace(-math.pi, math.pi, 2001), np.linspace(-1e5, 1e5, 20001)
    out = np.zeros((3, len(near)))
    _functions(near, out)
    assert np.abs(out[0] - np.cos(near)).max() < 1e-13
    assert np.abs(out[1] - np.sin(near)).max() < 1e-13
    x = far
    out = np.zeros((3, len(x)))
    _functions(x, out)
    assert np.abs(out[0] - np.cos(x)).max() < 1e-10
    assert np.abs(out[1] - np.sin(x)).max() < 1e-10
    y = -np.abs(x) % 60.0 - 60.0
    assert np.abs(out[2] / np.exp(y) - 1.0).max() < 1e-12


@pytest.mark.parametrize("depth", [None, 40.0])
def test_a_single_wave_equals_airy_theory(depth: float | None) -> None:
    """At and below the surface, crest to trough, deep water and 40 m: 1e-12 of a·ω.

    After hours an angle of 4,000 rad is rounded by 5e-13 itself.
    """
    params = replace(DRY, depth_m=depth, heading_deg=30.0, neglected_m_per_s=0.0)
    z = np.linspace(-39.0, 1.0, 30)
    position = np.stack([np.linspace(-50.0, 50.0, 30), np.linspace(30.0, -10.0, 30), z])
    sea = components_of(params, G)
    for time in (0.0, 1.3, 5000.7):
        _, u, w = airy(sea, position, time)
        found, found_rate = kernel_at(params, position, time)
        assert np.abs(found - u)[:, 1:].max() < 1e-12 * 1.5 * sea.omega[0]
        assert np.abs(found_rate - w)[:, 1:].max() < 1e-12 * 1.5 * sea.omega[0] ** 2


def test_published_form_of_a_deep_wave() -> None:
    """[LCD] eqs 21 and 22: u = π·H·f·e^{kz}·cos 2πft with k = 4π²f²/g."""
    params = replace(DRY, neglected_m_per_s=0.0)
    f = 1.0 / 8.0
    k = 4.0 * math.pi**2 * f**2 / G
    for time in (0.0, 1.0, 3.5):
        eta = 1.5 * math.cos(2.0 * math.pi * f * time)
        position = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, eta - 20.0]])
        u, _ = kernel_at(params, position, time)
        expected = math.pi * 3.0 * f * math.exp(-20.0 * k) * math.cos(2.0 * math.pi * f * time)
        assert u[0, 1] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("spacing", "slope"),
    [(2.0, (0.05, -0.02)), (0.2, (0.0, 0.0)), (2.0, (0.8, 0.6)), (3.0, (0.02, 0.0))],
)
def test_error_of_neglected_components_is_bounded(
    spacing: float, slope: tuple[float, float]
) -> None:
    """200 components: under `neglected_m_per_s` off the full sum, which itself is far larger.

    On a steep rope, an upright one of fine elements, where most nodes take what a cubic gives, one
    at 45°, and one whose nodes all turn angles; the water's acceleration by as much.
    """
    z = np.arange(-400.0, 0.0, spacing)
    position = np.stack([slope[0] * z, slope[1] * z, z])
    sea = components_of(SEA, G)
    for neglected in (1e-2, 1e-4):
        _, u, du = airy(sea, position, 77.7)
        found, rate = kernel_at(replace(SEA, neglected_m_per_s=neglected), position, 77.7)
        off = np.sqrt(((found - u) ** 2).sum(axis=0))[1:]
        assert off.max() <= neglected
        assert off.max() > 0.0
        assert np.sqrt(((rate - du) ** 2).sum(axis=0))[1:].max() <= neglected
        assert np.abs(u).max() > 0.3


@pytest.mark.parametrize("neglected", [1e-2, 3e-4, 1e-7])
@pytest.mark.parametrize("depth", [12.0, 45.0, 300.0])
def test_error_of_neglected_components_is_bounded_in_finite_depth(
    depth: float, neglected: float
) -> None:
    """From the bed through the surface, on an upright and an inclined rope of fine elements."""
    for slope, time in ((0.0, 70.0), (0.02, 77.7), (0.3, 70.0), (0.7, 90.1)):
        z = np.linspace(-depth, 3.0, 80)
        position = np.stack([slope * z, -0.4 * slope * z, z])
        params = replace(SEA, depth_m=depth, neglected_m_per_s=neglected)
        _, u, du = airy(components_of(params, G), position, time)
        found, rate = kernel_at(params, position, time)
        assert np.sqrt(((found - u) ** 2).sum(axis=0))[1:].max() <= neglected
        assert np.sqrt(((rate - du) ** 2).sum(axis=0))[1:].max() <= neglected
        assert np.abs(u).max() > 0.3


def test_a_sea_without_neglect_equals_airy_theory() -> None:
    """The full sum of 200 components to 1e-12 of what they are together, along a steep rope."""
    z = np.linspace(-60.0, 1.0, 62)
    position = np.stack([0.05 * z, -0.02 * z, z])
    sea = components_of(SEA, G)
    _, u, du = airy(sea, position, 77.7)
    found, rate = kernel_at(replace(SEA, neglected_m_per_s=0.0), position, 77.7)
    speed = sea.amplitude_m * sea.omega
    assert np.abs(found - u)[:, 1:].max() < 1e-12 * speed.sum()
    assert np.abs(rate - du)[:, 1:].max() < 1e-12 * (speed * sea.omega).sum()


@pytest.mark.parametrize("depth", [None, 25.0])
@pytest.mark.parametrize("stretching", ["none", "linear"])
def test_wave_kinematics_up_to_the_surface_by_stretching(
    stretching: str, depth: float | None
) -> None:
    """Sums written out agree below and above the mean level and above the surface."""
    params = replace(SEA, stretching=stretching, depth_m=depth, neglected_m_per_s=0.0)
    z = np.linspace(-24.0, 4.0, 57)
    position = np.stack([0.05 * z, -0.02 * z, z])
    sea = components_of(params, G)
    speed, highest = sea.amplitude_m * sea.omega, []
    for time in (70.0, 72.0, 74.0, 77.7):
        eta, u, du = airy(sea, position, time, stretching)
        highest.append(eta.max())
        found, rate = kernel_at(params, position, time)
        assert np.abs(found - u)[:, 1:].max() < 1e-12 * speed.sum()
        assert np.abs(rate - du)[:, 1:].max() < 1e-12 * (speed * sea.omega).sum()
    assert min(highest) < -0.3
    assert max(highest) > 0.5


@pytest.mark.parametrize("stretching", ["none", "linear"])
def test_error_of_neglected_components_is_bounded_with_other_stretching(stretching: str) -> None:
    """Under `neglected_m_per_s` off the full sum, as with Wheeler's."""
    z = np.arange(-60.0, 3.0, 0.5)
    position = np.stack([0.05 * z, -0.02 * z, z])
    params = replace(SEA, stretching=stretching)
    _, u, du = airy(components_of(params, G), position, 77.7, stretching)
    found, rate = kernel_at(replace(params, neglected_m_per_s=1e-3), position, 77.7)
    assert np.sqrt(((found - u) ** 2).sum(axis=0))[1:].max() <= 1e-3
    assert np.sqrt(((rate - du) ** 2).sum(axis=0))[1:].max() <= 1e-3


@pytest.mark.parametrize("stretching", ["wheeler", "linear"])
def test_with_wetting_the_water_is_left_out_at_dry_nodes_only(stretching: str) -> None:
    """Surface at every node, and all else at wet ones, is to the bit what it is without wetting."""
    params = replace(SEA, stretching=stretching)
    z = np.append(np.linspace(-4.0, 4.0, 41), -30.0)  # back under water after the dry ones
    water = []
    for surroundings in (WATER, WATER._replace(wets=True)):
        work = rows.new_work(len(z))
        work[:3] = 0.1 * z, 0.0 * z, z
        work[rows.LENGTH], work[rows.VOLUME] = 0.2, 0.2 * 0.25 * math.pi * 0.04**2
        kernel = build(params, None, surroundings)
        apply((kernel,), work, rows.Stage(12.0, 0.0, 0.0, 0.0), 1, len(z))
        motion = *range(rows.FLOW, rows.FLOW + 3), *range(rows.FLOW_RATE, rows.FLOW_RATE + 3)
        water.append(work[[*motion, rows.SURFACE], 1:])
    without, with_wetting = water
    surface = without[-1]
    dry = z[1:] - surface > 0.1 + 0.04
    assert 5 < dry.sum() < 30
    assert np.array_equal(with_wetting[-1], surface)
    assert np.array_equal(with_wetting[:, ~dry], without[:, ~dry])
    assert not with_wetting[:-1, dry].any()


def test_crossing_seas_superpose() -> None:
    """A wind sea, a swell across it and a regular wave: the sum of each alone, none stretched."""
    swell = WaveSystem(
        jonswap=Jonswap(significant_height_m=1.5, peak_period_s=14.0), components=60, seed=9,
        heading_deg=110.0,
    )  # fmt: skip
    regular = WaveSystem(
        regular=RegularWave(height_m=1.0, period_s=5.0, phase_deg=70.0), heading_deg=-40.0
    )
    base = replace(SEA, stretching="none", neglected_m_per_s=0.0)
    z = np.linspace(-50.0, -0.5, 30)
    position = np.stack([0.3 * z, 0.1 * z, z])
    whole = kernel_at(replace(base, also=(swell, regular)), position, 33.0)
    parts = [base]
    for own in (swell, regular):
        figures = {f.name: getattr(own, f.name) for f in dataclasses.fields(own)}
        parts.append(WavesParams(**figures, ramp_s=0.0, stretching="none", neglected_m_per_s=0.0))
    alone = [kernel_at(part, position, 33.0) for part in parts]
    for k in range(2):
        assert np.abs(whole[k] - sum(own[k] for own in alone))[:, 1:].max() < 1e-11
    height = components_of(replace(base, also=(swell, regular)), G).significant_height_m
    heights = [components_of(part, G).significant_height_m for part in parts]
    assert height == pytest.approx(math.hypot(*heights), rel=1e-12)


def test_phase_of_a_regular_wave() -> None:
    """A quarter period ahead: the crest of 90° passed the origin a quarter of a period before."""
    later = replace(DRY, regular=RegularWave(height_m=3.0, period_s=8.0, phase_deg=-90.0))
    z = np.linspace(-30.0, 0.0, 12)
    position = np.stack([0.0 * z, 0.0 * z, z])
    found, expected = kernel_at(later, position, 4.5), kernel_at(DRY, position, 6.5)
    np.testing.assert_allclose(found[0][:, 1:], expected[0][:, 1:], atol=1e-12)
    trough = replace(DRY, regular=RegularWave(height_m=3.0, period_s=8.0, phase_deg=180.0))
    assert kernel_at(trough, position, 0.0)[0][0, -1] < 0.0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"stretching": "up"}, "unknown stretching 'up'"),
        ({"also": (WaveSystem(jonswap=SEA.jonswap, components=1900),)}, "2100 components in all"),
    ],
)
def test_invalid_waves_are_rejected(given: dict[str, Any], words: str) -> None:
    assert words in str(replace(SEA, **given).check())


def test_wave_kinematics_in_depth_below_the_sum_of_amplitudes() -> None:
    """200 components whose amplitudes sum up to more than the depth are there down to the bed."""
    params = replace(SEA, depth_m=8.0)
    sea = components_of(params, G)
    assert sea.amplitude_m.sum() > 8.0
    position = np.stack([np.zeros(16), np.zeros(16), np.linspace(-7.5, 0.5, 16)])
    _, u, _ = airy(sea, position, 77.7)
    found, _ = kernel_at(params, position, 77.7)
    assert np.abs(u).max() > 0.3
    off = np.sqrt(((found - u) ** 2).sum(axis=0))[1:]
    assert off.max() <= params.neglected_m_per_s


def test_spectral_components_keep_the_significant_height() -> None:
    """Hs of the components is the spectrum's, and the surface's over three hours within 3 %."""
    sea = components_of(SEA, G)
    assert sea.significant_height_m == pytest.approx(2.5, rel=2e-3)
    eta = sea.elevation_m(12.0, -7.0, np.arange(0.0, 10800.0, 0.5))
    assert 4.0 * eta.std() == pytest.approx(2.5, rel=0.03)
    assert np.all(np.diff(sea.wave_number) > 0.0)
    mean = math.atan2(np.sin(sea.heading).sum(), np.cos(sea.heading).sum())
    assert math.degrees(mean) == pytest.approx(20.0, abs=6.0)


@pytest.mark.parametrize("seed", [None, 4], ids=["left out", "that of the first system"])
def test_crossing_seas_of_one_seed_add_by_their_variance(seed: int | None) -> None:
    """Equal spectra from two sides: Hs·√2 at a place, within 3 %, and the first one's own waves."""
    alone = components_of(SEA, G)
    other = WaveSystem(jonswap=SEA.jonswap, components=200, seed=seed, heading_deg=110.0)
    both = components_of(replace(SEA, also=(other,)), G)
    eta = both.elevation_m(0.0, 0.0, np.arange(0.0, 10800.0, 0.5))
    assert 4.0 * eta.std() == pytest.approx(2.5 * math.sqrt(2.0), rel=0.03)
    assert np.isin(alone.phase, both.phase).all()
    assert len(np.unique(both.phase)) == 400


def test_significant_height_of_a_measured_spectrum() -> None:
    """The buoy's spectrum: Hs of the components is the file's."""
    measured = Measured(file="ndbc_46042_1996", column="1996-10-16T00Z")
    sea = components_of(WavesParams(measured=measured), G)
    assert sea.significant_height_m == pytest.approx(
        measured.spectrum().significant_height_m, rel=5e-3
    )


def test_wave_inertia_force_on_an_upright_rope() -> None:
    """The sum over a deep upright rope is ρ·A·(1 + Ca)·a·g: ∫ a·ω²·e^{kz} dz = a·ω²/k.

    No drag, still rope; at the zero crossing, when the surface is at rest level and the
    acceleration at its greatest.
    """
    n, length, diameter = 4000, 400.0, 0.06
    dz = length / n
    z = np.linspace(-length + 0.5 * dz, -0.5 * dz, n)
    work = rows.new_work(n + 1)
    work[2, 1:] = z
    work[rows.TANGENT + 2] = 1.0
    work[rows.VOLUME] = 0.25 * math.pi * diameter**2 * dz
    params = replace(DRY, neglected_m_per_s=0.0)
    apply((build(params, None, WATER),), work, rows.Stage(2.0, 0.0, 0.0, 0.0), 1, n + 1)
    expected = -1025.0 * 0.25 * math.pi * diameter**2 * 2.0 * 1.5 * G
    assert work[rows.RESIDUAL, 1:].sum() == pytest.approx(expected, rel=1e-5)


def test_a_neutrally_buoyant_ball_follows_the_water_orbit() -> None:
    """(ρV + A)·a of the water over (m + A) with m = ρV is the water's own motion.

    A ball of the water's density on a rope that carries nothing (neutral, soft, slack), 15 m deep
    in waves of 0.6 m and 8 s: its orbit is that of the water, a·e^{kz} in radius, to 1 %. The mean
    of (u·∇)u, which the linear acceleration leaves out, makes it drift; that is fitted as well.
    """
    rig = Rig(
        length=60.0, elements=6, mass=1025.0 * 0.25 * math.pi * 0.02**2, EA=1e4, diameter=0.02,
        load=1025.0 * 30.0, volume=30.0, added=(15e3, 15e3, 15e3), density=1025.0, step=0.02,
        tolerance=1.0, added_mass=1.0, hang_off=(0.0, 0.0, 0.0),
    )  # fmt: skip
    scene = rig.scene()
    waves = replace(
        DRY, regular=RegularWave(height_m=0.6, period_s=8.0), ramp_s=24.0, neglected_m_per_s=0.0
    )
    scene = replace(scene, effects=(*scene.effects[:1], waves, *scene.effects[1:]))
    twin = Twin(scene)
    twin.rope.state.nodes[2, : rig.elements + 1] *= 0.25  # slack, its end 15 m deep
    seen = np.array(
        [snapshot.payload_position_m for snapshot in march(twin, still, 48.0, every=10)]
    )  # the last two periods
    last, time = seen[-80:], np.linspace(0.0, 16.0, 80, endpoint=False)
    angle = 2.0 * math.pi / 8.0 * time
    terms = np.stack([np.cos(angle), np.sin(angle), np.ones(80), time, time**2], axis=1)
    radius = 0.3 * math.exp((2.0 * math.pi / 8.0) ** 2 / G * last[:, 2].mean())
    fit = np.linalg.lstsq(terms, last[:, [0, 2]], rcond=None)[0]
    assert np.hypot(fit[0], fit[1]) == pytest.approx(radius, rel=0.01)
    assert np.abs(last[:, 1]).max() < 1e-9
