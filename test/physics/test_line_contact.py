"""Contact between ropes, against colliding strings: impedance, friction, energy, symmetry."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from joint_rigs import JointBench, Line
from numpy.typing import NDArray
from rigs import Rig

from rope_twin.core import state as rows
from rope_twin.core.energy import measure_system
from rope_twin.core.joined.line_contact import RopeContact, rope_contact_of
from rope_twin.effects.line_contact import LineContactParams
from rope_twin.twin.contact import system_contacts

Vector = NDArray[np.float64]
SPAN, REACH = 40.0, 0.1
RIG = Rig(
    length=39.9, elements=80, mass=10.0, EA=2e6, diameter=REACH, damping=1e3, load=0.0,
    gravity=1e-9, step=0.005, tolerance=1.0,
)  # fmt: skip
TENSION = RIG.EA * (SPAN / RIG.length - 1.0)
PLATEAU = sqrt(TENSION * RIG.mass)  # N·s/m: half the impedance 2·√(T·m) of a string
CONTACT = LineContactParams(distance_m=REACH, friction=0.0, damping_s_per_m=0.0)


def crossed(
    velocity: tuple[float, float, float], contact: LineContactParams = CONTACT, rig: Rig = RIG,
    gap: float = 0.01, swap: bool = False, x: float = 0.04,
) -> JointBench:  # fmt: skip
    """Two taut strings, one along x that moves, above one along y at x, crossing at its middle."""
    high, half = REACH + gap, 0.5 * SPAN
    upper = Line(
        rig=rig, low=(-half, 0.03, high), high=(half, 0.03, high), held=True, more=(contact,)
    )
    lower = Line(rig=rig, low=(x, -half, 0.0), high=(x, half, 0.0), held=True, more=(contact,))
    bench = JointBench([lower, upper] if swap else [upper, lower])
    moving = bench.nodes(1 if swap else 0, rows.VELOCITY)
    moving[:, 1:-1] = np.array(velocity)[:, None]
    return bench


def touch(bench: JointBench) -> RopeContact:
    computed = rope_contact_of(bench.system)
    assert computed is not None
    return computed


def pressed(bench: JointBench, seconds: float) -> Vector:
    """The normal force after each step [N]."""
    pushes = []
    for _ in range(round(seconds / bench.step)):
        bench.hold(1)
        pushes.append(touch(bench).push)
    return np.array(pushes)


def gap_of(bench: JointBench) -> float:
    """Height of the upper string over the lower one where they cross."""
    above, below = bench.nodes(0), bench.nodes(1)
    return float(np.interp(0.04, above[0], above[2]) - np.interp(0.03, below[1], below[2]))


def test_contact_force_of_colliding_strings() -> None:
    """F·(1/Z + 1/Z') = V with Z = 2·√(T·m), until the waves are back from the ends."""
    speed = 0.2
    bench = crossed((0.0, 0.0, -speed))
    pushes = pressed(bench, 0.8)
    assert pushes[60:].mean() == pytest.approx(speed * PLATEAU, rel=0.02)
    assert bench.health[rows.SUBSTEPS_UNCONVERGED] == 0
    (position,) = system_contacts(bench.system)
    assert (position.name, position.normal_n) == ("ropes", pushes[-1])
    assert position.position_m[:2] == pytest.approx((0.04, 0.03), abs=0.01)


@pytest.mark.parametrize("x", [-17.2, -12.02, 3.9, 17.3])
def test_contact_is_found_along_the_whole_rope(x: float) -> None:
    """F = V·√(T·m) accelerates the lower string wherever they cross, in any group of elements."""
    speed, gap = 0.2, 0.001
    contact = replace(CONTACT, damping_s_per_m=10.0)
    bench = crossed((0.0, 0.0, -speed), contact, gap=gap, x=x)
    bench.hold(20)
    moved = RIG.mass * RIG.length / RIG.elements * bench.nodes(1, rows.VELOCITY)[2].sum()
    expected = -speed * PLATEAU * (20 * bench.step - gap / speed)
    assert moved == pytest.approx(expected, rel=0.05)


def test_friction_decelerates_a_sliding_string() -> None:
    """A string that slides across the other at U loses μ·N/Z there: U - μ·V/2."""
    mu, U = 0.4, 0.2
    bench = crossed((0.0, U, -U), replace(CONTACT, friction=mu))
    pressed(bench, 0.7)
    x, v = bench.nodes(0)[0], bench.nodes(0, rows.VELOCITY)[1]
    assert float(np.interp(0.04, x, v)) == pytest.approx(U - 0.5 * mu * U, rel=0.02)


def met(step: float, damping: float) -> tuple[float, float]:
    """Least height of the upper string and energy gained over kinetic energy, at 5 m/s."""
    rig, speed = replace(RIG, elements=10, step=step, damping=0.0), 5.0
    contact = replace(CONTACT, damping_s_per_m=damping)
    bench = crossed((0.0, 0.0, -speed), contact, rig=rig)
    still = np.zeros((2, 5)), np.zeros(2), 0.0
    start, least = measure_system(bench.system, *still).store.total, np.inf
    for _ in range(round(0.5 / step)):
        bench.hold(1)
        least = min(least, gap_of(bench))
    end = measure_system(bench.system, *still).store.total
    return least, (end - start) / (0.5 * rig.mass * SPAN * speed**2)


def test_rope_contact_at_5_m_per_s_conserves_energy() -> None:
    """Within 1e-3, at a step that resolves the contact of 20 ms."""
    least, gained = met(0.002, 0.0)
    assert 0.03 < least < 0.07
    assert abs(gained) < 1e-3


def test_ropes_do_not_pass_through_each_other_in_a_large_step() -> None:
    """5 m/s at 40 ms: twice the diameter per step."""
    least, gained = met(0.04, 0.5)
    assert least > 0.0
    assert gained < 1e-3


def test_energy_balance_of_rope_contact() -> None:
    """Stored energy falls by the dissipation of damping and friction, within 1e-3."""
    rig = replace(RIG, elements=10, step=0.0005, damping=0.0)
    bench = crossed((0.0, 1.0, -1.0), replace(CONTACT, friction=0.5, damping_s_per_m=2.0), rig=rig)
    still = np.zeros((2, 5)), np.zeros(2)
    borders = [measure_system(bench.system, *still, 0.0)]
    for k in range(800):
        bench.hold(1)
        borders.append(measure_system(bench.system, *still, 0.0005 * (k + 1)))
    rubbed = np.array([border.rubbed for border in borders])
    lost = 0.0005 * (rubbed[:-1] + rubbed[1:]).sum() / 2.0
    start, end = borders[0].store.total, borders[-1].store.total
    motion = 0.5 * rig.mass * SPAN * 2.0
    assert lost > 0.05 * motion
    assert start - end == pytest.approx(lost, abs=1e-3 * motion)


def test_rope_contact_is_independent_of_rope_order() -> None:
    """Two strings that cross, listed in either order, press and move alike."""
    one, other = (crossed((0.0, 0.5, -1.0), swap=swap) for swap in (False, True))
    for bench in (one, other):
        bench.hold(60)
    assert touch(one).push == pytest.approx(touch(other).push, rel=1e-6)
    assert np.abs(one.nodes(0) - other.nodes(1)).max() < 1e-8
