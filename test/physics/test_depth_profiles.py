"""Density and drag over depth, and added mass along the rope, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rigs import STILL_WATER, Rig, march_to_end, sine, with_nothing_below
from scipy.optimize import brentq

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.effects.depth_profiles import DepthProfilesParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.fluid_ramp import FluidRampParams, LoadCurve
from rope_twin.effects.rope_in_air import WettingParams
from rope_twin.effects.rope_mass import AddedMassParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.scene.grid import section_damping
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Damping, Rising, Scene
from rope_twin.scene.shapes import payload_figures
from rope_twin.studies.modes import find_modes
from rope_twin.twin.monitors import Monitors

RHO, G = 1025.0, 9.80665
FIBRE = Rig(
    length=2000.0, elements=100, mass=2.9, EA=2e11, diameter=0.06, load=500.0, volume=0.3,
    density=RHO, hang_off=(0.0, 0.0, 0.0),
)  # fmt: skip
AREA = 0.25 * math.pi * 0.06**2
# What the scenes in still water have besides, so that they are compiled once: added mass along the
# rope, which does not move, and a bed far below it.
ALONG = AddedMassParams(normal=0.0, tangential=0.2)
DEEP = SeabedParams(depth_m=9000.0)
STRATIFIED = ((0.0, 1022.0), (-2000.0, 1037.0))
PYCNOCLINE = ((-40.0, 1004.0), (-60.0, 1026.0), (-1500.0, 1034.0))


def scene_of(rig: Rig, *more: object) -> Scene:
    """A rig's scene with further effects, each in the place of the rig's own of its kind."""
    scene = rig.scene()
    kinds = {type(own) for own in more}
    kept = tuple(own for own in scene.effects if type(own) not in kinds)
    return replace(scene, effects=(*kept, *more))


def density(*points: tuple[float, float]) -> DepthProfilesParams:
    return DepthProfilesParams(density_kg_per_m3=points)


@pytest.mark.parametrize("profile", [STRATIFIED, PYCNOCLINE])
def test_static_tension_in_stratified_water(profile: tuple[tuple[float, float], ...]) -> None:
    """T = (M - ρ(-L)·V)·g + m·g·L - g·A·∫ρ dz, nearly inextensible, at the top and half-way.

    The rope is a little lighter than the deep water. Between two nodes a bend of the profile is
    seen at the nodes only.
    """
    twin = Twin(scene_of(FIBRE, density(*profile), ALONG, DEEP))
    z, rho = np.array(profile[::-1]).T
    fine = np.linspace(-2000.0, 0.0, 400_001)
    water = np.interp(fine, z, rho)
    mass = np.concatenate([[0.0], np.cumsum(0.5 * (water[1:] + water[:-1]) * np.diff(fine))])
    load = (FIBRE.load - np.interp(-2000.0, z, rho) * FIBRE.volume) * G
    for depth, actual in (
        (0.0, twin.snapshot().tension_top_n),
        (1010.0, float(twin.rope.work[rows.TENSION, 49])),
    ):
        below = 2000.0 - depth
        expected = load + FIBRE.mass * G * below - G * AREA * np.interp(-depth, fine, mass)
        assert actual == pytest.approx(expected, abs=0.02 if profile is STRATIFIED else 3.0)
    plain = Twin(scene_of(FIBRE)).snapshot().tension_top_n
    assert abs(twin.snapshot().tension_top_n - plain) > 100.0


TOWED = Rig(
    length=60.0, elements=24, mass=2.9, EA=4e7, diameter=0.06, damping=4e4, load=900.0, volume=0.3,
    added=(150.0, 150.0, 400.0), area=(1.0, 1.0, 2.0), density=RHO, drag=(1.2, 0.02), step=0.02,
    added_mass=1.0, hang_off=(0.0, 0.0, 6.0), current=((0.0, (0.6, 0.2)), (-60.0, (0.2, 0.0))),
    ramp=2.0,
)  # fmt: skip
HEAVIER = 1060.0
RAMPED = FluidRampParams(water=LoadCurve(over_time=((0.0, 1.0),)))
SEA = WavesParams(regular=RegularWave(height_m=3.0, period_s=7.0), ramp_s=2.0)


def two_way(rig: Rig, *more: object, rising: float) -> Scene:
    """Return a rope in waves, optionally through the surface, with a two-way payload."""
    scene = scene_of(rig, SEA, WettingParams(), *more)
    payload = replace(scene.payloads[0], rising=Rising(drag_area_m2=1.0, added_mass_kg=rising))
    return replace(scene, payloads=(payload,))


def moved(rig: Rig, *more: object, rising: float) -> tuple[np.ndarray, float]:
    """Return the last positions and top tension of a rope through the surface."""
    added = AddedMassParams(normal=1.0, tangential=0.2)
    twin = Twin(two_way(rig, added, *more, rising=rising))
    snapshot = march_to_end(twin, sine(1.0, 5.0), 8.0)
    return snapshot.node_position_m.copy(), snapshot.tension_top_n


@pytest.mark.long
def test_a_constant_density_profile_equals_the_scene_density() -> None:
    """A profile of 1060 kg/m³ in a scene of 1025, and the scene of 1060, move alike.

    Buoyancy, drag, added mass across and along, waves, payload up and down, wetted rope. A
    payload's added mass is given in kg, of the scene's water.
    """
    more = HEAVIER / RHO
    other = replace(TOWED, density=HEAVIER, added=tuple(more * a for a in TOWED.added))
    actual = moved(TOWED, density((-1.0, HEAVIER), (-9.0, HEAVIER)), rising=250.0)
    expected = moved(other, rising=250.0 * more)
    plain = moved(TOWED, rising=250.0)
    assert np.abs(actual[0] - expected[0]).max() < 1e-6
    assert actual[1] == pytest.approx(expected[1], rel=1e-6)
    assert np.abs(plain[0] - expected[0]).max() > 0.01


@pytest.mark.long
def test_a_constant_density_profile_in_a_multi_line_system() -> None:
    """A bridle below the surface: payloads by shape, joints and bars of steel.

    The shapes' added mass is that of the scene's water. Damping is given as a number: a fraction of
    critical would be of the scene's water too. The one step with a profile that is compiled where
    ropes meet is that of test_fluid_ramp, hence the ramp, which is over.
    """
    scene = load_scene("bridle_lift")
    damped = Damping(newton_seconds=5e5)
    scene = replace(scene, ropes=tuple(replace(line, damping=damped) for line in scene.ropes))
    kept = tuple(effect for effect in scene.effects if not isinstance(effect, WavesParams))
    pulls, positions = [], []
    for rho, profile in ((RHO, ()), (RHO, (density((0.0, HEAVIER)), RAMPED)), (HEAVIER, ())):
        water = replace(scene.environment, water_density_kg_per_m3=rho)
        twin = Twin(replace(scene, environment=water, effects=(*kept, *profile)))
        snapshot = march_to_end(twin, sine(1.0, 5.0), 3.0)
        pulls.append(np.array([rope.tension_top_n for rope in snapshot.ropes]))
        positions.append(np.concatenate([rope.node_position_m for rope in snapshot.ropes]))
    assert pulls[1] == pytest.approx(pulls[2], rel=1e-6)
    assert np.abs(positions[1] - positions[2]).max() < 1e-5
    assert np.abs(pulls[0] / pulls[2] - 1.0).max() > 1e-3


def test_weight_in_stratified_water_after_a_cut() -> None:
    """(m·l - A·∫ρ dz)·g of the upper 100 m, without the payload."""
    rig = replace(
        TOWED, length=300.0, elements=60, mass=9.0, load=3000.0, hang_off=(0.0, 0.0, 0.0),
        current=STILL_WATER,
    )  # fmt: skip
    added = AddedMassParams(normal=1.0, tangential=0.4)
    twin = Twin(scene_of(rig, added, density((0.0, 1025.0), (-3000.0, 1225.0)), DEEP))
    march_to_end(twin, sine(0.5, 5.0), 5.0)
    twin.submit_cut(None, 100.0)
    twin.advance(2000)
    water = 100.0 * (1025.0 + 0.5 * 100.0 * 200.0 / 3000.0)
    expected = (9.0 * 100.0 - AREA * water) * G
    assert twin.snapshot().tension_top_n == pytest.approx(expected, rel=2e-4)
    alike = (9.0 * 100.0 - AREA * 100.0 * 1025.0) * G
    assert abs(expected - alike) > 5.0 * 2e-4 * expected


def test_drag_factor_over_depth_by_its_integral() -> None:
    """Horizontal pull of a taut upright rope: ½·ρ·d·C_d·U²·∫f dz, f from 0 to 2.6 at the bottom.

    Its inclination of 0.7 mrad and its stretch of 1.5e-6 count for less than is asked.
    """
    rig = replace(
        FIBRE, length=200.0, EA=2e13, load=3e6, volume=0.0, drag=(1.2, 0.01),
        current=((0.0, (0.0, 1.5)),),
    )  # fmt: skip
    profile = DepthProfilesParams(drag_factor=((0.0, 0.0), (-200.0, 2.6)))
    snapshot = Twin(scene_of(rig, profile, ALONG, DEEP)).snapshot()
    expected = 0.5 * RHO * 0.06 * 1.2 * 1.5**2 * 1.3 * 200.0
    assert snapshot.hang_off_force_n[1] == pytest.approx(expected, rel=1e-4)
    both = replace(profile, density_kg_per_m3=((0.0, 1.04 * RHO),))
    snapshot = Twin(scene_of(rig, both, ALONG, DEEP)).snapshot()
    assert snapshot.hang_off_force_n[1] == pytest.approx(1.04 * expected, rel=1e-4)


def test_tangential_drag_factor_over_depth() -> None:
    """Power of a rope in a uniform vertical motion: ½·ρ·π·d·C_t·w³·∫f dz."""
    profile = DepthProfilesParams(drag_factor=((0.0, 3.0), (-2000.0, 1.0)))
    rig = replace(FIBRE, load=3e3, drag=(1.2, 0.02))
    twins = [Twin(scene_of(rig, *own)) for own in ((), (profile, ALONG, DEEP))]
    pulls = []
    for twin in twins:
        snapshot = march_to_end(twin, lambda t: (-1.0 * t, -1.0), 12.0)
        pulls.append(snapshot.tension_top_n)
    own = 0.5 * RHO * math.pi * 0.06 * 0.02 * 2000.0
    rest = Twin(scene_of(rig)).snapshot().tension_top_n
    assert rest - pulls[0] == pytest.approx(own, rel=2e-3)
    # the rope has gone down by 12 m, where the factor is smaller
    assert rest - pulls[1] == pytest.approx(own * (2.0 - 12.0 / 1000.0), rel=2e-3)


def test_seabed_penetration_in_stratified_water() -> None:
    """A rope at rest on the seabed sinks by w/(k·d), with w in the local density."""
    rig = replace(
        FIBRE, length=100.0, elements=50, mass=20.0, hang_off=(99.999, 0.0, -49.99),
        fixed_at=(0.0, 0.0, -49.99), EA=4e7, load=0.0,
    )  # fmt: skip
    bed = SeabedParams(depth_m=50.0, stiffness_n_per_m3=1e5, friction=0.0)
    twin = Twin(with_nothing_below(scene_of(rig, bed, density((0.0, 1150.0)), ALONG)))
    n = int(twin.rope.state.counts[rows.ELEMENTS])
    sunk = -50.0 - twin.rope.state.nodes[2, n // 2]
    assert sunk == pytest.approx((20.0 - 1150.0 * AREA) * G / (1e5 * 0.06), rel=1e-4)


CHAIN = Rig(
    length=1500.0, elements=150, mass=45.0, EA=2.2e8, diameter=0.11, density=RHO, load=20e3,
    volume=2.0, added=(0.0, 0.0, 10e3), added_mass=1.0, step=0.01,
)  # fmt: skip


@pytest.mark.parametrize("along", [0.0, 0.5, 2.0])
def test_axial_period_with_axial_added_mass(along: float) -> None:
    """x·tan x = (m + C·ρ·A)·L/M', as modes, and as the running twin rings.

    Its velocity is projected on the mode, with the masses.
    """
    per_metre = CHAIN.mass + along * RHO * 0.25 * math.pi * 0.11**2
    ratio = per_metre * CHAIN.length / 30e3
    x = brentq(lambda x: x * math.tan(x) - ratio, 1e-9, 0.5 * math.pi - 1e-9)
    omega = x * math.sqrt(CHAIN.EA / per_metre) / CHAIN.length
    added = AddedMassParams(normal=1.0, tangential=along)
    scene = scene_of(CHAIN, added, *((density((0.0, RHO)), DEEP) if along else ()))
    modes = find_modes(scene, 1).axial
    assert modes[0].frequency_hz == pytest.approx(omega / (2.0 * math.pi), rel=1e-5)
    twin = Twin(scene)
    n = int(twin.rope.state.counts[rows.ELEMENTS])
    shape = np.sin(x * (1.0 - twin.rope.state.s[: n + 1] / CHAIN.length))
    twin.rope.state.nodes[rows.VELOCITY + 2, : n + 1] = 0.05 * shape
    lump = np.full(n + 1, per_metre * CHAIN.length / n)
    lump[0] = 0.5 * lump[1] + 30e3
    swing = []
    for _ in range(round(5.5 * 2.0 * math.pi / omega / CHAIN.step)):
        twin.advance(1)
        swing.append(twin.rope.state.nodes[rows.VELOCITY + 2, : n + 1] @ (lump * shape))
    swing = np.array(swing)
    up = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
    crossings = up + swing[up] / (swing[up] - swing[up + 1])
    computed = float(np.diff(crossings).mean()) * CHAIN.step
    assert computed == pytest.approx(2.0 * math.pi / omega, rel=1e-4)


def test_fractional_damping_includes_axial_added_mass() -> None:
    """c = 2·ζ·EA/ω, with ω lowered by the axial added mass."""
    results = []
    for along in (0.0, 2.0):
        scene = scene_of(CHAIN, AddedMassParams(normal=1.0, tangential=along))
        line = replace(scene.ropes[0], damping=Damping(fraction_of_first_axial_mode=0.02))
        scene = replace(scene, ropes=(line,))
        figures = payload_figures(scene.payloads[0], RHO)
        per_metre = CHAIN.mass + along * RHO * 0.25 * math.pi * 0.11**2
        ratio = per_metre * CHAIN.length / 30e3
        x = brentq(lambda x, r=ratio: x * math.tan(x) - r, 1e-9, 0.5 * math.pi - 1e-9)
        omega = x * math.sqrt(CHAIN.EA / per_metre) / CHAIN.length
        (c,) = section_damping(scene, line, figures)
        results.append(c)
        assert c == pytest.approx(2.0 * 0.02 * CHAIN.EA / omega, rel=1e-6)
    assert results[1] > 1.05 * results[0]


@pytest.mark.long
@pytest.mark.parametrize("wet", [False, True])
def test_energy_balance_in_stratified_water(wet: bool) -> None:
    """The balance closes to 1e-6 of what is exchanged, through a pycnocline in waves.

    wet: whether the rope is wetted in part, or all of it stays below the waves.
    """
    rig = replace(
        TOWED, hang_off=(0.0, 0.0, 12.0 if wet else -4.0), EA=4e7, damping=4e6, step=0.005,
        ramp=4.0,
    )  # fmt: skip
    profile = DepthProfilesParams(
        density_kg_per_m3=((-10.0, 1004.0), (-30.0, 1026.0), (-60.0, 1040.0)),
        drag_factor=((0.0, 1.6), (-40.0, 0.8)),
    )
    added = AddedMassParams(normal=1.0, tangential=0.3)
    drag = DragParams(normal=1.2, tangential=0.02)
    twin = Twin(two_way(rig, profile, added, drag, rising=250.0), Monitors(energy=True))
    snapshot = march_to_end(twin, sine(1.5, 6.0), 12.0)
    energy = snapshot.energy
    assert energy is not None
    assert abs(energy.residual_j) < 1e-6 * energy.exchanged_j
