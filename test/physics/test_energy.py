"""Energy balance against closed forms, and its residual over the time step."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from payout_rigs import STEEL
from rigs import Heave, Rig, Speeds, lift, march, sine, still

from rope_twin.twin.monitors import ENERGY
from rope_twin.twin.snapshot import EnergyBalance
from rope_twin.twin.twin import Twin
from validation.snap import ROPE, SPRING

FREE = replace(STEEL, elements=50, tolerance=1e-2, ramp=4.0)


def balances(
    rig: Rig, heave: Heave, seconds: float, every: int = 10, speeds: Speeds = ()
) -> list[EnergyBalance]:
    """Return the energy balance after each `every` steps."""
    snapshots = march(Twin(rig.scene(), ENERGY), heave, seconds, every, speeds)
    computed = [snapshot.energy for snapshot in snapshots]
    return [balance for balance in computed if balance is not None]


def test_drag_power_at_terminal_velocity() -> None:
    """A payload under a slack rope falls at v = √(2·W/(ρ·CdA)); drag dissipates W·v."""
    rig = replace(SPRING, area=(0.0, 0.0, 76.0))
    snapshots = list(march(Twin(rig.scene(), ENERGY), lift(-8.0, 3.0), 2.8, every=20))
    at_2_s, end = snapshots[9], snapshots[13]
    assert end.element_tension_n.max() < 1e-2 * rig.load_weight
    speed = math.sqrt(2.0 * rig.load_weight / (rig.density * 76.0))
    assert end.payload_velocity_m_per_s[2] == pytest.approx(-speed, rel=1e-3)
    assert at_2_s.energy is not None
    assert end.energy is not None
    power = (end.energy.water_j - at_2_s.energy.water_j) / (end.time_s - at_2_s.time_s)
    assert power == pytest.approx(-rig.load_weight * speed, rel=1e-3)


@pytest.mark.parametrize(
    ("heave", "speeds"),
    [(sine(1.5, 8.0), ()), (still, [(0.5, 2.0)]), (sine(1.5, 8.0), [(0.5, 1.0), (6.0, -1.0)])],
    ids=["heave", "payout", "both"],
)
def test_the_energy_residual_is_of_second_order(heave: Heave, speeds: Speeds) -> None:
    """Without drag and damper, at 20, 10 and 5 ms; heave alone is of third order.

    The study of payout (generalised-alpha) had 1.6e-4, 7.8e-5 and 3.7e-5 of T·dL.
    """
    steps = np.array([0.02, 0.01, 0.005])
    ends = [balances(replace(FREE, step=h), heave, 12.0, round(4.0 / h), speeds)[-1] for h in steps]
    residual = np.array([end.residual_j for end in ends])
    exchanged = np.array([end.exchanged_j for end in ends])
    assert np.all(exchanged > 1e6)
    assert np.all(np.abs(residual) / exchanged < 5e-6 * (steps / 0.02) ** 1.5)
    orders = np.log2(np.abs(residual[:-1] / residual[1:]))
    assert np.all(orders > 1.8), (residual, exchanged)


def test_winch_power_at_constant_payout() -> None:
    """In vacuum the hang-off takes T·V(1 + T/EA), the rope brings m·w²/2 + T²/(2·EA).

    What it brings is that of the top element, whose middle is half of it further down.
    """
    rig = replace(FREE, length=200.0, elements=20, winch=STEEL.winch)
    snapshots = list(march(Twin(rig.scene(), ENERGY), still, 20.0, 1000, [(0.0, 1.0)]))
    a, b = (snapshot.energy for snapshot in snapshots)
    assert a is not None
    assert b is not None
    out = snapshots[1].line_out_m - snapshots[0].line_out_m
    T = rig.load_weight + rig.weight * 0.5 * (snapshots[0].line_out_m + snapshots[1].line_out_m)
    w = 1.0 + T / rig.EA
    assert (b.hang_off_j - a.hang_off_j) == pytest.approx(-T * w * out, rel=2e-3)
    brought = (0.5 * rig.mass * w**2 + 0.5 * T**2 / rig.EA) * out
    assert (b.passing_j - a.passing_j) == pytest.approx(brought, rel=5e-3)
    assert snapshots[1].solver.splits > 0


@pytest.mark.parametrize("damper", [0.0, 5e5])
@pytest.mark.parametrize("step", [0.02, 0.01])
def test_numerical_dissipation_of_a_snap_is_positive(damper: float, step: float) -> None:
    """Never more than a trace below zero, and small beside the exchanged energy."""
    computed = balances(replace(ROPE, damping=damper, step=step), lift(-3.0, 1.0), 5.0)
    exchanged = computed[-1].exchanged_j
    residual = np.array([balance.residual_j for balance in computed])
    assert computed[-1].residual_j > 2e-4 * exchanged
    assert residual.min() > -1e-4 * exchanged
    assert residual.max() < 1e-2 * exchanged
    assert (computed[-1].damped_j > 5e-3 * exchanged) == (damper > 0.0)


def test_axial_damper_dissipation() -> None:
    """Energy falls as exp(-c/EA·ω²·t), all of it in the damper's account."""
    rig = replace(SPRING, damping=2e5, step=0.005, tolerance=1e-3)
    omega = math.sqrt(rig.EA / rig.length / (rig.load + rig.added[2]))
    periods = 4.0 * math.pi / omega
    every = round(periods / 8 / rig.step)
    computed = balances(rig, lift(-0.02, 0.2), 2.0 * periods, every)
    one, other = computed[3], computed[11]  # two periods apart, the ship long at rest
    hanging = -0.02 * (rig.load_weight + rig.weight * rig.length)
    left = (other.change_j - hanging) / (one.change_j - hanging)
    assert left == pytest.approx(math.exp(-rig.damping / rig.EA * omega**2 * periods), rel=2e-2)
    taken = one.change_j - other.change_j
    assert other.damped_j - one.damped_j == pytest.approx(taken, rel=1e-3)
