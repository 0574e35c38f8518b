"""Heave compensator at the hook, against closed forms and an independent integration."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from compensator_rigs import (
    AREA,
    EXPONENT,
    GRAVITY,
    LOAD_N,
    PASSIVE,
    RIG,
    STOP_N,
    STROKE,
    UNIT_KG_PER_M,
    UNIT_M,
    VOLUME,
    compensated,
)
from rigs import Bench, frequency, march, march_to_end, sine, still

from rope_twin import Twin
from rope_twin.effects.compensator import ActiveCylinder, CompensatorParams, forces, of
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.scene.schema import Scene, Winch
from rope_twin.twin.monitors import ENERGY

STOP = STOP_N / UNIT_M
MASS = RIG.load + 0.5 * UNIT_M * UNIT_KG_PER_M  # that moves with the payload
SPRING = EXPONENT * LOAD_N * AREA / VOLUME  # at mid stroke [N/m]
ROPE = RIG.EA / (RIG.length - UNIT_M)  # its stiffness above the unit [N/m]


def stroke(bench: Bench) -> float:
    """Return the extension of the unit beyond its length retracted [m]."""
    return float(np.linalg.norm(bench.position[:, 1] - bench.position[:, 0])) - UNIT_M


def static_stroke(load_n: float, unit: CompensatorParams = PASSIVE) -> float:
    """Return the stroke at which p_0·A·(V_0/V)^n is a load, in closed form [m]."""
    volume = unit.gas_volume_m3
    ratio = (unit.gas_pressure_pa * unit.piston_area_m2 / load_n) ** (1.0 / unit.exponent)
    return 0.5 * unit.stroke_m + volume * (1.0 - ratio) / unit.piston_area_m2


@pytest.mark.parametrize("share", [0.9, 1.0, 1.2])
@pytest.mark.parametrize("exponent", [1.0, 1.4])
def test_the_static_stroke(share: float, exponent: float) -> None:
    """Stroke by p·V^n = const for loads below and above that of mid stroke; 1e-6.

    An isothermal and an adiabatic spring share the code.
    """
    unit = replace(PASSIVE, exponent=exponent)
    load = share * RIG.load
    bench = Bench(compensated(unit, replace(RIG, load=load)))
    held = (load + 0.5 * UNIT_M * UNIT_KG_PER_M) * GRAVITY
    assert stroke(bench) == pytest.approx(static_stroke(held, unit), abs=1e-6)


def test_water_pressure_retracts_a_unit_without_depth_compensation() -> None:
    """ρ·g·depth·A_rod adds to the gas pressure; a depth-compensated unit is unaffected."""
    deep = replace(RIG, density=1025.0, hang_off=(0.0, 0.0, -964.0))
    results = {}
    for rod in (None, 0.005):
        bench = Bench(compensated(replace(PASSIVE, rod_area_m2=rod), deep))
        z = -bench.position[2, :2].mean()
        assert 990.0 < z < 1000.0
        volume = 0.25 * pi * 0.5**2 * UNIT_M
        held = LOAD_N - 0.5 * 1025.0 * volume * GRAVITY
        pushed = 1025.0 * GRAVITY * z * (rod or 0.0)
        assert stroke(bench) == pytest.approx(static_stroke(held - pushed), abs=1e-6)
        results[rod] = stroke(bench)
    assert results[None] - results[0.005] > 1.0


def released(scene: Scene, lift_m: float, seconds: float) -> np.ndarray:
    """Return the strokes after the payload is let go from `lift_m` above its rest."""
    bench = Bench(scene)
    bench.position[2, 0] += lift_m
    bench.find_acceleration()
    step, found = bench.rope.model.step, []
    for _ in range(round(seconds / step)):
        bench.hold(1)
        found.append(stroke(bench))
    return np.array(found)


def test_natural_period_of_small_strokes() -> None:
    """ω² = k/M with k = n·p_0·A²/V_0, in series with the rope's own stiffness."""
    computed = frequency(released(compensated(), 0.01, 60.0), RIG.step)
    k = 1.0 / (1.0 / SPRING + 1.0 / ROPE)
    assert computed == pytest.approx(sqrt(k / MASS) / (2.0 * pi), rel=5e-4)


@pytest.mark.parametrize("ratio", [0.5, 1.0, 3.0])
def test_heave_transmissibility_of_spring_and_damper(ratio: float) -> None:
    """A payload on a spring and a damper below a heaving rope, at three frequencies.

    |X/Y|² = (k² + (c·ω)²)/((k - M·ω²)² + (c·ω)²); within 0.5 % for a heave of a centimetre.
    """
    omega_0 = sqrt(SPRING / MASS)
    c, omega = 2.0 * 0.2 * sqrt(SPRING * MASS), ratio * omega_0
    unit = replace(PASSIVE, damping_newton_seconds_per_m=c)
    twin, period = Twin(compensated(unit, replace(RIG, step=0.02))), 2.0 * pi / omega
    seen = [
        (snapshot.stamp_ns * 1e-9, snapshot.payload_position_m[2], snapshot.heave_m)
        for snapshot in march(twin, sine(0.01, period), 6.0 / 0.2 / omega_0 + 4.0 * period)
    ]
    t, z, heave = np.array(seen)[-round(2.0 * period / 0.02) :].T
    base = np.stack([np.cos(omega * t), np.sin(omega * t), np.ones_like(t)], axis=1)
    moved, lifted = (np.linalg.lstsq(base, own, rcond=None)[0][:2] for own in (z, heave))
    actual = float(np.hypot(*moved) / np.hypot(*lifted))
    expected = sqrt(
        (SPRING**2 + (c * omega) ** 2) / ((SPRING - MASS * omega**2) ** 2 + (c * omega) ** 2)
    )
    assert actual == pytest.approx(expected, rel=5e-3)


def test_seal_friction_sticks_in_small_heave_and_slides_in_large() -> None:
    """The unit is rigid below the seals' friction and works above it."""
    rubbing = replace(PASSIVE, friction_n=20e3, friction_slip_m=0.001)
    for amplitude, period, works in ((0.2, 12.0, False), (1.5, 8.0, True)):
        twin = Twin(compensated(rubbing, replace(RIG, ramp=10.0)))
        strokes = []
        for snapshot in march(twin, sine(amplitude, period), 40.0):
            x = snapshot.node_position_m[-2:, 2]
            strokes.append(x[0] - x[1] - UNIT_M)
        assert (np.ptp(strokes) > 0.5) == works
        assert works or np.ptp(strokes) < 0.003


def test_static_seal_friction_does_not_decay() -> None:
    """A unit set down between the seals' two limits stays there for minutes."""
    rubbing = replace(PASSIVE, friction_n=20e3, damping_newton_seconds_per_m=2e4)
    strokes = released(compensated(rubbing), 0.8, 300.0)
    late = strokes[-round(200.0 / RIG.step) :]
    assert np.ptp(late) < 1e-4
    unit = of(rubbing)
    gas = forces(unit, float(late[-1]), 0.0, STOP, 0.0).gas
    assert 100.0 < abs(gas - LOAD_N) < 20e3


def test_energy_balance_of_the_compensator() -> None:
    """Gas, oil, seals, rod and both stops: residual below 1e-3 of what is dissipated."""
    unit = replace(
        PASSIVE, throttling_kg_per_m=2e4, damping_newton_seconds_per_m=3e3, friction_n=5e3,
        rod_area_m2=0.002,
    )  # fmt: skip
    rig = replace(RIG, step=0.0025, density=1025.0, hang_off=(0.0, 0.0, -100.0))
    twin = Twin(compensated(unit, rig), ENERGY)
    snapshots = list(march(twin, sine(3.0, 6.0), 30.0, 5))
    strokes = [
        snapshot.node_position_m[-2, 2] - snapshot.node_position_m[-1, 2] - UNIT_M
        for snapshot in snapshots
    ]
    assert min(strokes) < 0.0
    assert max(strokes) > STROKE
    energy = snapshots[-1].energy
    assert energy is not None
    assert energy.damped_j > 1e6
    assert abs(energy.residual_j) < 1e-3 * energy.damped_j
    assert abs(energy.residual_pct) < 0.1


def test_a_cut_at_the_payload_leaves_the_unit_on_the_rope() -> None:
    """The gas drives the unloaded piston to its stop; half of the unit's mass stays on the rope."""
    unit = replace(PASSIVE, damping_newton_seconds_per_m=2e4)
    twin = Twin(compensated(unit))
    assert not twin.submit_cut(None, float("inf"))
    snapshot = march_to_end(twin, still, 20.0)
    assert snapshot.cut is not None
    length = snapshot.node_position_m[-2, 2] - snapshot.node_position_m[-1, 2]
    preload = unit.tension_n(0.0)
    half = 0.5 * UNIT_M * UNIT_KG_PER_M * GRAVITY
    assert length - UNIT_M == pytest.approx((half - preload) / STOP, abs=1e-4)
    weight = RIG.mass * (RIG.length - UNIT_M) * GRAVITY + 2.0 * half
    assert snapshot.tension_top_n == pytest.approx(weight, rel=1e-3)


@pytest.mark.parametrize("below_m", [20.0, 31.0])
def test_unit_and_payload_fall_freely_after_a_cut_above(below_m: float) -> None:
    """The upper part of the rope stays."""
    twin = Twin(compensated())
    assert not twin.submit_cut(None, below_m)
    snapshot = march_to_end(twin, still, 2.0)
    assert snapshot.cut is not None
    below = max(RIG.length - below_m, UNIT_M)
    assert snapshot.cut.lost_m == pytest.approx(below)
    assert snapshot.tension_top_n < 0.05 * LOAD_N
    assert snapshot.payload_velocity_m_per_s[2] == pytest.approx(-2.0 * GRAVITY, rel=0.1)
    assert snapshot.compensator is not None
    assert snapshot.compensator.at_stop == "retracted"


def test_a_compensator_branch_is_bit_identical() -> None:
    """The force of stuck seals is part of the state."""
    twin = Twin(compensated(replace(PASSIVE, friction_n=20e3)))
    march_to_end(twin, sine(1.5, 8.0), 10.0)
    last = []
    for run in (twin.branch(), twin):
        run.advance(500)
        last.append(run.snapshot())
    first, second = (snapshot.compensator for snapshot in last)
    assert first is not None
    assert first == second
    assert first.friction_n != 0.0


def test_remeshing_keeps_the_compensator() -> None:
    """Half as many elements and back: the stroke continues and the unit stays one element."""
    twin = Twin(compensated(replace(PASSIVE, friction_n=5e3), replace(RIG, elements=12)))
    strokes = []
    for halvings in (0, 1, 0):
        before = twin.snapshot().compensator
        twin.set_level(AccuracyLevel(twin.step_ns, halvings))
        after = twin.snapshot().compensator
        assert before is not None
        assert after is not None
        assert after.stroke_m == before.stroke_m
        assert twin.rope.state.s[1] == UNIT_M
        for snapshot in march(twin, sine(1.0, 8.0), 10.0):
            assert snapshot.compensator is not None
            strokes.append(snapshot.compensator.stroke_m)
    assert np.abs(np.diff(strokes)).max() < 0.03


def active(**changes: float) -> ActiveCylinder:
    """Return an active cylinder strong enough for these loads, with changes."""
    usual = ActiveCylinder(
        efficiency=0.95, lag_s=0.1, washout_s=30.0, gain_newton_seconds_per_m=2e5,
        force_limit_n=1e6, speed_limit_m_per_s=3.0,
    )  # fmt: skip
    return replace(usual, **changes)


@pytest.mark.parametrize("period", [6.0, pytest.param(12.0, marks=pytest.mark.long)])
def test_residual_heave_of_an_active_cylinder(period: float) -> None:
    """The closed form of the module's docstring, within 1 % of the passive residual."""
    unit, omega, step = active(), 2.0 * pi / period, 0.01
    twin = Twin(compensated(replace(PASSIVE, active=unit), replace(RIG, step=step)))
    seen = [
        (snapshot.time_s, snapshot.payload_position_m[2], snapshot.heave_m)
        for snapshot in march(twin, sine(0.01, period), 15.0 * period)
    ]
    t, z, heave = np.array(seen)[-round(3.0 * period / step) :].T
    base = np.stack([np.cos(omega * t), np.sin(omega * t), np.ones_like(t), t], axis=1)
    moved, lifted = (complex(*np.linalg.lstsq(base, own, rcond=None)[0][:2]) for own in (z, heave))
    s, K = 1j * omega, unit.gain_newton_seconds_per_m
    H = s * unit.washout_s / ((1.0 + s * unit.washout_s) * (1.0 + s * unit.lag_s))
    expected = (SPRING + s * K * (1.0 - unit.efficiency * H)) / (SPRING + MASS * s * s + s * K)
    passive = SPRING / abs(SPRING - MASS * omega**2)
    actual = (moved / lifted).conjugate()
    assert abs(expected) < 0.5 * passive
    assert abs(actual - expected) < 0.01 * passive


def test_an_active_cylinder_respects_force_speed_and_stroke_limits() -> None:
    """A heave larger than the stroke: it brakes before the stops with bounded force."""
    unit = active(force_limit_n=3e4, speed_limit_m_per_s=0.8)
    twin = Twin(compensated(replace(PASSIVE, active=unit)), ENERGY)
    snapshots = list(march(twin, sine(1.5, 8.0), 60.0))
    forces_n = [
        snapshot.compensator.active_n for snapshot in snapshots if snapshot.compensator is not None
    ]
    assert np.abs(forces_n).max() == 3e4
    energy = snapshots[-1].energy
    assert energy is not None
    assert abs(energy.residual_pct) < 0.1


def test_steady_lowering_returns_the_unit_to_mid_stroke() -> None:
    """Minutes of steady payout are not taken for heave."""
    winch = Winch(
        speed_limit_m_per_s=1.0, acceleration_limit_m_per_s2=0.2, min_line_out_m=20.0,
        max_line_out_m=300.0,
    )  # fmt: skip
    unit = replace(PASSIVE, active=active(washout_s=10.0))
    twin = Twin(compensated(unit, replace(RIG, winch=winch)))
    snapshot = march_to_end(twin, still, 120.0, speeds=[(1.0, 0.5)])
    assert snapshot.compensator is not None
    assert snapshot.compensator.stroke_m == pytest.approx(0.5 * STROKE, abs=0.02)
    assert snapshot.payout_speed_m_per_s == 0.5
