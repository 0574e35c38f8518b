"""Stick-slip friction of the seabed, against an elastic bar on a Coulomb bed."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt, tanh
from typing import Any

import numpy as np
import pytest
from rigs import Rig, march_to_end, still, with_nothing_below

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.effects.bed_friction import BedFrictionParams
from rope_twin.effects.seabed import SeabedParams, Soundings
from rope_twin.scene.schema import Scene, Winch
from rope_twin.twin.monitors import Monitors

MU, DEPTH, LENGTH = 0.6, 50.0, 200.0
SUNK = 0.0902  # m: under the chain's weight, so that the ends lie as deep as the rest
CHAIN = Rig(
    length=LENGTH, elements=200, mass=100.0, EA=2e6, diameter=0.1, damping=2e4, load=0.0,
    fixed_at=(0.0, 0.0, -DEPTH - SUNK), hang_off=(LENGTH, 0.0, -DEPTH - SUNK), density=1025.0,
    drag=(1.0, 0.1), step=0.02, winch=Winch(
        speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=2.0, min_line_out_m=190.0,
        max_line_out_m=210.0,
    ),
)  # fmt: skip
PULL_M, SPEED = 0.5, 0.01  # slow: at the end of a faster pull the chain springs back
FLAT = SeabedParams(depth_m=DEPTH, friction=MU)
GRID = SeabedParams(
    soundings=Soundings(
        x_m=(-500.0, 500.0), y_m=(-500.0, 500.0), depth_m=((DEPTH, DEPTH), (DEPTH, DEPTH))
    ),
    friction=MU,
)  # fmt: skip


def scene_of(bed: SeabedParams, *more: Any, rig: Rig = CHAIN) -> Scene:
    scene = rig.scene()
    return replace(scene, effects=(*scene.effects, bed, *more))


def pulled(scene: Scene, hold_s: float, monitors: Monitors | None = None) -> Twin:
    """Return the twin after the winch has slowly hauled in PULL_M and held it."""
    twin = Twin(scene, monitors) if monitors else Twin(scene)
    speeds = [(0.0, -SPEED), (PULL_M / SPEED, 0.0)]
    march_to_end(twin, still, PULL_M / SPEED + hold_s, speeds=speeds)
    return twin


def tensions(twin: Twin) -> np.ndarray:
    n = int(twin.rope.state.counts[rows.ELEMENTS])
    return twin.rope.work[rows.TENSION, :n].copy()


def expected(mu: float, pull_m: float) -> float:
    """Tension at the end of a long elastic bar that is pulled over a Coulomb bed, √(2·μ·w·EA·δ)."""
    return sqrt(2.0 * mu * CHAIN.weight * CHAIN.EA * pull_m)


@pytest.mark.parametrize("bed", [FLAT, pytest.param(GRID, marks=pytest.mark.long)])
def test_tension_of_a_chain_pulled_along_the_bed(bed: SeabedParams) -> None:
    """Tension √(2·μ·w·EA·δ) at the pulled end falls by μ·w per metre to zero; 1 %."""
    before = tensions(Twin(scene_of(bed, BedFrictionParams(slip_m=0.002))))
    twin = pulled(scene_of(bed, BedFrictionParams(slip_m=0.002)), 20.0)
    actual = tensions(twin) - before
    top = expected(MU, PULL_M)
    assert top / (MU * CHAIN.weight) < 0.7 * LENGTH
    assert actual[-1] == pytest.approx(top, rel=0.01)
    slope = np.polyfit(np.arange(20), actual[-30:-10], 1)[0]
    assert slope == pytest.approx(MU * CHAIN.weight, rel=0.01)
    assert np.abs(actual[:40]).max() < 1e-3 * top


def test_stick_friction_keeps_the_tension_where_viscous_friction_creeps() -> None:
    """Tension at the anchor and at the pulled end stays for 80 s; smoothed friction loses 10 %."""
    creeps = with_nothing_below(scene_of(FLAT))  # the step of the shipped landing
    results = []
    for scene in (scene_of(FLAT, BedFrictionParams()), creeps):
        twin = pulled(scene, 10.0)
        first = tensions(twin)
        twin.advance(round(80.0 / CHAIN.step))
        results.append((first, tensions(twin)))
    sticking, creeping = results
    for end in (0, -1):
        first, last = (seen[end] for seen in sticking)
        assert last == pytest.approx(first, abs=1e-3 * expected(MU, PULL_M))
    first, last = (seen[-1] for seen in creeping)
    assert last < 0.9 * first


def test_tension_below_the_slip_distance_is_that_of_a_bar_on_springs() -> None:
    """Springs κ = μ·w/s per metre, held at the end: T = δ·√(EA·κ)·coth(L·√(κ/EA)), δ < s; 1 %."""
    slip = 2.0
    twin = pulled(scene_of(FLAT, BedFrictionParams(slip_m=slip)), 20.0)
    before = tensions(Twin(scene_of(FLAT, BedFrictionParams(slip_m=slip))))
    computed = (tensions(twin) - before)[-1]
    spring = MU * CHAIN.weight / slip
    exact = PULL_M * sqrt(CHAIN.EA * spring) / tanh(LENGTH * sqrt(spring / CHAIN.EA))
    assert computed == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize(("axial", "lateral"), [(0.3, 0.9), (0.9, 0.3)])
def test_an_axial_pull_feels_the_axial_coefficient(axial: float, lateral: float) -> None:
    """Tension √(2·μ_axial·w·EA·δ), whatever the lateral coefficient; 1 %."""
    friction = BedFrictionParams(axial=axial, lateral=lateral, slip_m=0.002)
    before = tensions(Twin(scene_of(FLAT, friction)))[-1]
    actual = tensions(pulled(scene_of(FLAT, friction), 20.0))[-1] - before
    assert actual == pytest.approx(expected(axial, PULL_M), rel=0.01)


def test_a_cross_current_moves_a_rope_within_the_slip_distance() -> None:
    """Displacement s·drag/(μ_l·w) below the friction limit, with drag ½·ρ·d·C_d·U²; free above.

    It comes up in 10 s as a live input: a factor of time would be a step of its own.
    """
    speed, slip = 2.5, 0.1
    share = 0.5 * 1025.0 * 0.1 * speed**2 / CHAIN.weight
    moved = []
    for lateral in (2.0 * share, 0.5 * share):
        twin = Twin(scene_of(FLAT, BedFrictionParams(lateral=lateral, slip_m=slip)))
        for now in np.linspace(0.0, speed, 100):
            assert not twin.submit_current([[0.0, 0.0, now]])
            twin.advance(round(0.1 / CHAIN.step))
        twin.advance(round(30.0 / CHAIN.step))
        moved.append(float(twin.rope.state.nodes[1, 100]))
    assert moved[0] == pytest.approx(0.5 * slip, rel=0.03)
    assert moved[1] > 10.0 * slip


@pytest.mark.parametrize(
    ("step_s", "share"), [(0.01, 1e-4), pytest.param(0.005, 1e-5, marks=pytest.mark.long)]
)
def test_energy_balance_of_stick_and_slip(step_s: float, share: float) -> None:
    """The balance of a rope that is pulled, held and released closes with the work of friction."""
    scene = scene_of(FLAT, BedFrictionParams(slip_m=0.05), rig=replace(CHAIN, step=step_s))
    twin = Twin(scene, Monitors(energy=True))
    speeds = [(0.0, -0.1), (5.0, 0.0), (10.0, 0.1), (15.0, 0.0)]
    snapshot = march_to_end(twin, still, 20.0, speeds=speeds)
    assert snapshot.energy is not None
    assert snapshot.energy.water_j < -0.05 * snapshot.energy.exchanged_j
    assert abs(snapshot.energy.residual_j) < share * snapshot.energy.exchanged_j


def test_a_branch_keeps_the_friction_displacement() -> None:
    """A branch is bit-identical to the twin that goes on."""
    twin = pulled(scene_of(FLAT, BedFrictionParams()), 2.0)
    other = twin.branch()
    for run in (twin, other):
        run.advance(200)
    assert np.array_equal(tensions(twin), tensions(other))


@pytest.mark.long
def test_an_anchored_line_at_rest_keeps_its_tension_for_an_hour() -> None:
    """Tension stays within 0.1 % of the pull all along, in 180,000 steps of 50 elements."""
    rig = replace(CHAIN, elements=50)
    twin = pulled(scene_of(FLAT, BedFrictionParams(), rig=rig), 10.0)
    first = tensions(twin)
    for _ in range(12):
        twin.advance(round(300.0 / twin.step_s))
        assert np.abs(tensions(twin) - first).max() < 1e-3 * first[-1]
