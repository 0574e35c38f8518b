"""Bending stiffness: tangent, closed forms of beams, clamp, energy, slack, payout."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cut_rigs import VACUUM, parts, swinging
from effect_cases import some_stage
from payout_rigs import HMPE_SEA, KELVIN_VOIGT_S, SEA, STEEL
from rigs import Bench, Rig, Vector, frequency, march, sine, with_nothing_below
from scipy.integrate import solve_bvp  # type: ignore[import-untyped]
from test_payout_events import JUMP, assert_smooth

from rope_twin.core import state as rows
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.loads.balance import add_couplings
from rope_twin.effects.bending import Bending, BendingParams, build
from validation.state_bench import energy

NODES = 9
HELD = build(BendingParams(stiffness_n_m2=700.0, clamped_along=(1.0, -0.4, -2.0)), None, None)


@jit_entry
def bend(effects: Any, work: Any, stage: Any, n: int) -> None:
    """Add the forces and couplings of bending."""
    add_couplings(effects, work, stage, n)


def bent(place: Vector, effect: Bending = HELD) -> Vector:
    """Return scratch of nodes at `place` (3, NODES) with rest lengths 0.3 to 2 m, after bending."""
    work = rows.new_work(NODES, rows.COUPLED_ROWS)
    work[rows.POSITION : rows.POSITION + 3] = place
    work[rows.REST] = np.random.default_rng(5).uniform(0.3, 2.0, NODES)
    bend((effect,), work, some_stage(), NODES - 1)
    return work


def stiffness(work: Vector) -> Vector:
    """Return p times the stiffness matrix of the free nodes, from blocks and couplings."""
    n = NODES - 1
    full = np.zeros((3 * n, 3 * n))
    for i in range(n):
        block = np.zeros((3, 3))
        block[np.triu_indices(3)] = work[rows.BLOCK : rows.BLOCK + 6, i]
        full[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = block + np.triu(block, 1).T
        for reach in (1, 2):
            if i + reach < n:
                at, there = slice(3 * i, 3 * i + 3), slice(3 * (i + reach), 3 * (i + reach) + 3)
                full[at, there] = full[there, at] = work[rows.LINK + reach - 1, i] * np.eye(3)
    return full


def test_the_bending_tangent_is_the_derivative_of_its_forces() -> None:
    """Central differences in every coordinate: equal to 1e-9, symmetric, positive semi-definite."""
    position = np.random.default_rng(2).normal(0.0, 1.0, (3, NODES))
    full, p = stiffness(bent(position)), some_stage().p
    residual = slice(rows.RESIDUAL, rows.RESIDUAL + 3)
    for j in range(NODES - 1):
        for k in range(3):
            ends = []
            for sign in (1.0, -1.0):
                moved = position.copy()
                moved[k, j] += sign * 0.5
                ends.append(bent(moved)[residual, :-1].T.ravel())
            assert np.abs(full[3 * j + k] + p * (ends[0] - ends[1])).max() < 1e-9 * full.max()
    assert np.linalg.eigvalsh(full).min() > -1e-12 * full.max()


def test_bending_forces_vanish_on_a_straight_rope_and_in_sum() -> None:
    """A hinged rope of any shape has no resultant force; a straight one no force at all."""
    hinged = HELD._replace(clamp=0.0)
    random = np.random.default_rng(4)
    work = bent(np.zeros((3, NODES)))
    s = np.append(0.0, np.cumsum(work[rows.REST, :-1]))
    line = np.outer([0.3, -0.8, 1.2], s)
    residual = slice(rows.RESIDUAL, rows.RESIDUAL + 3)
    assert np.abs(bent(line, hinged)[residual]).max() < 1e-9
    position = random.normal(0.0, 1.0, (3, NODES))
    force = bent(position, hinged)[residual]
    assert np.abs(force).max() > 1e3
    assert np.abs(force.sum(axis=1)).max() < 1e-9
    assert (bent(np.zeros((3, NODES)))[residual] == 0.0).all(), "all nodes in one place"


BEAM = Rig(
    length=20.0, elements=40, mass=5.0, EA=1e8, gravity=0.0, EI=2e4, tolerance=1e-3,
)  # fmt: skip
PULLED = 5e3  # N


def beam_frequency(elements: int, mode: int) -> tuple[float, float]:
    """Return the frequency [Hz] of a hinged beam under tension: measured, and in closed form.

    f = n/(2L)·√(T/m + n²·pi²·EI/(m·L²)) (Timoshenko et al. 1974); with L and m of the unstretched
    rope the slope is on the stretched one, which takes 1 + strain off T.
    """
    L, strain = BEAM.length, PULLED / BEAM.EA
    assert BEAM.EI is not None
    square = PULLED / (1.0 + strain) + (mode * math.pi / L) ** 2 * BEAM.EI
    exact = 0.5 * mode / L * math.sqrt(square / BEAM.mass)
    stretched = L * (1.0 + strain)
    rig = replace(
        BEAM, elements=elements, fixed_at=(stretched, 0.0, 0.0), step=1.0 / (1000.0 * exact)
    )
    bench = Bench(with_nothing_below(rig.scene()))
    shape = np.sin(mode * math.pi * np.linspace(0.0, 1.0, elements + 1))
    bench.position[2] = 1e-4 * shape
    bench.acceleration[2] = -((2.0 * math.pi * exact) ** 2) * bench.position[2]
    swing = []
    for _ in range(1000):
        bench.hold(5)
        swing.append(float(bench.position[2] @ shape))
    assert max(swing[-300:]) < 1.001 * max(swing[:300]), "bending must not feed the oscillation"
    return frequency(np.array(swing), 5.0 * rig.step), exact


@pytest.mark.parametrize(("mode", "bending"), [(1, 0.05), (2, 0.18), (3, 0.37), (5, 0.86)])
def test_frequency_of_a_beam_under_tension(mode: int, bending: float) -> None:
    """Frequencies that bending raises by 5 to 86 % converge in second order in element length.

    From the expansion of sin the error of the discrete string is (n·pi/N)²/24, of the beam twice
    that; the step adds less than 1e-5.
    """
    string = 0.5 * mode / BEAM.length * math.sqrt(PULLED / BEAM.mass)
    errors = []
    for elements in (40, 80):
        measured, exact = beam_frequency(elements, mode)
        assert exact / string - 1.0 == pytest.approx(bending, abs=0.01)
        errors.append(1.0 - measured / exact)
    string_error = (mode * math.pi / 80.0) ** 2 / 24.0
    assert string_error < errors[1] < 2.0 * string_error + 1e-5
    assert errors[0] == pytest.approx(4.0 * errors[1], rel=0.02, abs=1e-5)


HELD_CABLE = Rig(
    length=10.0, elements=50, mass=0.1, EA=1e9, gravity=9.81, load=100.0, diameter=0.02, EI=5e3,
    clamp=(1.0, 0.0, -1.0), tolerance=1e-3,
)  # fmt: skip


def hanging_cantilever(rig: Rig) -> tuple[float, float]:
    """Return the load's position [m] by the elastica EI·θ'' = (W + w·(L - s))·sin θ.

    θ(0) = 45 degrees where it is held, θ'(L) = 0; solved as a boundary value problem.
    """
    W, w, L = rig.load_weight, rig.weight, rig.length

    def slope(s: Vector, y: Vector) -> Vector:
        return np.array([y[1], (W + w * (L - s)) * np.sin(y[0]) / rig.EI])

    def ends(top: Vector, low: Vector) -> Vector:
        return np.array([top[0] - 0.25 * math.pi, low[1]])

    computed = solve_bvp(slope, ends, np.linspace(0.0, L, 200), np.zeros((2, 200)), tol=1e-10)
    assert computed.success
    s = np.linspace(0.0, L, 20001)
    angle = computed.sol(s)[0]
    return float(np.trapezoid(np.sin(angle), s)), float(-np.trapezoid(np.cos(angle), s))


def test_a_clamped_cable_bends_like_the_elastica() -> None:
    """Clamped at 45° above a load: 1e-3 of the deflection at 50 elements, second order.

    The pull on the hang-off, shear included, is the weight.
    """
    exact = np.array(hanging_cantilever(HELD_CABLE))
    errors = []
    for elements in (50, 100):
        rig = replace(HELD_CABLE, elements=elements)
        bench = Bench(rig.scene())
        errors.append(bench.position[[0, 2], 0] - exact)
        assert bench.hold(2)[1] == pytest.approx(rig.load_weight + rig.weight * 10.0, rel=1e-9)
    assert np.abs(errors[0]).max() < 1e-3 * exact[0]
    assert errors[0] == pytest.approx(4.0 * errors[1], rel=0.1)


def bending_energy(bench: Bench, rig: Rig) -> float:
    """Return the bending energy ½·EI·∫κ² with half an element at a clamp [J]."""
    rest = np.diff(bench.rope.state.s[: bench.n + 1])
    q = np.diff(bench.position) / rest
    assert rig.EI is not None
    total = rig.EI * ((np.diff(q) ** 2).sum(axis=0) / (rest[1:] + rest[:-1])).sum()
    if rig.clamp is not None:
        d = -np.array(rig.clamp) / np.linalg.norm(rig.clamp)
        lack = d - q[:, -1]
        total += rig.EI / rest[-1] * ((lack - d * (d @ lack)) ** 2).sum()
    return float(total)


def test_energy_of_a_bending_swing_in_vacuum() -> None:
    """A clamped cable whose load is thrown sideways never gains energy and loses 1e-3 in 4 s."""
    rig = replace(HELD_CABLE, EA=1e6, step=0.002, elements=40)
    bench = Bench(rig.scene())
    rest = energy(bench, rig) + bending_energy(bench, rig)
    s = bench.rope.state.s[: bench.n + 1]
    bench.velocity[0] = 4.0 * (1.0 - s / rig.length) ** 2
    start, low = energy(bench, rig) + bending_energy(bench, rig), bending_energy(bench, rig)
    highest, bent_most = start, 0.0
    for _ in range(200):
        bench.hold(10)
        bent_most = max(bent_most, bending_energy(bench, rig))
        last = energy(bench, rig) + bending_energy(bench, rig)
        highest = max(highest, last)
    swing = start - rest
    assert bent_most - low > 0.2 * swing, "bending must take part"
    assert highest - start <= 1e-6 * swing
    assert start - last <= 1e-3 * swing


@pytest.mark.parametrize("EI", [238.0, 1e5])
def test_slack_elements_converge_with_bending_stiffness(EI: float) -> None:
    """A light payload in 4 m of heave folds the rope; every step converges.

    It takes no more solves than the same rope without bending (1.1 times: another motion).
    """
    rig = replace(
        SEA, length=200.0, elements=200, load=300.0, volume=0.25, added=(300.0,) * 3,
        area=(2.0,) * 3, damping=1e3,
    )  # fmt: skip
    solves = []
    for case in (rig, replace(rig, EI=EI)):
        snapshots = list(march(case.twin(), sine(4.0, 5.0), 30.0, every=5))
        assert min(snapshot.element_tension_n.min() for snapshot in snapshots) == 0.0
        assert max(np.abs(snapshot.node_position_m).max() for snapshot in snapshots) < 210.0
        assert snapshots[-1].solver.unconverged_substeps == 0
        solves.append(snapshots[-1].solver.solves)
    assert solves[1] < 1.1 * solves[0]


@pytest.mark.parametrize(
    ("rope", "heave"),
    [
        (SEA, 1.0),
        *(pytest.param(*own, marks=pytest.mark.long) for own in ((STEEL, 1.5), (HMPE_SEA, 1.0))),
    ],
)
def test_bending_adds_no_tension_jump_at_splits_and_merges(rope: Rig, heave: float) -> None:
    """Payout at ±1 m/s with stiff hinged elements of 10 m: at most 0.01 % of the mean tension."""
    assert JUMP == 1e-4
    rig = replace(
        rope, elements=round(rope.length / 10.0), damping=rope.EA * KELVIN_VOIGT_S, EI=1e5
    )
    assert_smooth(rig, heave, 5)


def test_the_fallen_part_of_a_stiff_rope_falls_freely() -> None:
    """In vacuum its momentum grows by its weight alone while it swings and straightens."""
    rig = replace(VACUUM, EI=2e5, length=100.0)
    twin = swinging(rig)
    twin.submit_cut(None, 33.0)
    twin.advance(1)
    last = parts(twin, rig)[1]
    for _ in range(50):
        twin.advance(1)
        now = parts(twin, rig)[1]
        gained = now.momentum - last.momentum
        np.testing.assert_allclose(gained, [0.0, 0.0, -now.mass * rig.gravity * 0.01], atol=1e-5)
        last = now


def test_the_hang_off_force_uses_the_accepted_positions() -> None:
    """Bending at the hang-off is computed from scratch positions, which must equal the state's."""
    twin = replace(SEA, elements=20, EI=1e5).twin()
    deferred = 0
    for snapshot in march(twin, sine(2.0, 5.0), 3.0, every=1):
        assert snapshot.solver.unconverged_substeps == 0
        rope = twin.inspect().rope
        n = rope.state.counts[rows.ELEMENTS]
        top = slice(n - 2, n + 1)
        accepted, scratch = rope.state.nodes[:3, top], rope.work[rows.POSITION :][:3, top]
        np.testing.assert_array_equal(scratch, accepted)
        deferred += bool(
            (rope.work[rows.POSITION :][:3, : n - 2] != rope.state.nodes[:3, : n - 2]).any()
        )
    assert deferred > 0, "no correction was deferred"
