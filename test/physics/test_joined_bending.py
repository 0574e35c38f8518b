"""Bending in multi-line systems, with joints as hinges: closed forms and a dense solve."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from joint_rigs import JointBench, Line, Vector, rest
from rigs import Rig, frequency
from scipy.optimize import brentq  # type: ignore[import-untyped]
from test_bending import HELD_CABLE, hanging_cantilever
from test_coupled_elimination import bent_chain, matrix
from test_joined_energy import balance, fine

from rope_twin.core import state as rows
from rope_twin.core.jit.decorators import assembly, jit_entry
from rope_twin.core.joined import chains as coupled_chains
from rope_twin.core.joined.joints import Joined
from rope_twin.core.joined.linear_solver import solve_system
from rope_twin.core.joined.stack import stacked_effects
from rope_twin.core.state import COUPLED_CHAIN_ROWS
from rope_twin.effects.bending import Bending, BendingParams
from rope_twin.effects.rope_mass import Weight
from rope_twin.scene.joined_model import build_joined

BENT = (Bending(1.0, 0.0, 0.0, 0.0, 0.0),)
ENDS = slice(rows.CORRECTION, rows.CORRECTION + 3)


@jit_entry
def condense(work: Any, first: int, n: int, left: Any) -> None:
    """Eliminate in all three ways, each in its own scratch; return the reduced ends by rows."""
    Z, f = coupled_chains.eliminate_coupled_upward(work[0], first, n)
    D, g = coupled_chains.eliminate_coupled_downward(work[1], n)
    upper, force, lower, pushed, P = coupled_chains.eliminate_coupled_between(work[2], n)
    for k in range(6):
        left[0, k], left[1, k], left[2, k], left[3, k] = Z[k], D[k], upper[k], lower[k]
    for k in range(3):
        left[0, 6 + k], left[1, 6 + k], left[2, 6 + k], left[3, 6 + k] = (
            f[k], g[k], force[k], pushed[k],
        )  # fmt: skip
        left[4 + k, 0], left[4 + k, 1], left[4 + k, 2] = P[0][k], P[1][k], P[2][k]


@jit_entry
def substitute(work: Any, first: int, n: int) -> None:
    """Back-substitute all three eliminations."""
    coupled_chains.substitute_coupled_upward(work[0], first, n)
    coupled_chains.substitute_coupled_downward(work[1], n)
    coupled_chains.substitute_coupled_between(work[2], n)


@jit_entry
def solve(system: Any) -> None:
    """Solve for the corrections of a system."""
    solve_system(system)


def full(six: Vector) -> Vector:
    """Return a symmetric block from its six numbers."""
    block = np.zeros((3, 3))
    block[np.triu_indices(3)] = six
    return block + np.triu(block, 1).T


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("n", [2, 3, 5, 40])
@pytest.mark.parametrize("stiffness", [1e-2, 1e3, 1e6])
def test_bent_rope_condensation_equals_the_dense_solve(
    first: int, n: int, stiffness: float
) -> None:
    """Onto the upper end, the lower one and both; stiffness over mass up to 1e6, slack elements."""
    chain = np.zeros((COUPLED_CHAIN_ROWS, n + 3))
    chain[: rows.COUPLED_ROWS, : n + 1] = bent_chain(n, stiffness, 3)[:, : n + 1]
    chain[[rows.AXIAL, rows.GEOMETRIC, rows.LINK], n:] = 0.0
    chain[[rows.BLOCK, rows.BLOCK + 3, rows.BLOCK + 5], n] += 1.0
    whole, right = matrix(chain, n + 1), chain[rows.RESIDUAL : rows.RESIDUAL + 3, : n + 1]
    work, left = np.array([chain] * 3), np.zeros((7, 9))
    condense(work, first, n, left)
    own = [full(chain[rows.BLOCK : rows.BLOCK + 6, i]) for i in (0, n)]
    work[0, ENDS, n] = np.linalg.solve(full(left[0, :6]) + own[1], right[:, n] + left[0, 6:])
    work[1, ENDS, 0] = np.linalg.solve(full(left[1, :6]) + own[0], right[:, 0] + left[1, 6:])
    P = left[4:, :3]
    both = np.block([[full(left[3, :6]) + own[0], -P.T], [-P, full(left[2, :6]) + own[1]]])
    ends = np.linalg.solve(
        both, np.concatenate([right[:, 0] + left[3, 6:], right[:, n] + left[2, 6:]])
    )
    work[2, ENDS, 0], work[2, ENDS, n] = ends[:3], ends[3:]
    substitute(work, first, n)
    for actual, low, high in ((work[0], first, n + 1), (work[1], 0, n), (work[2], 0, n + 1)):
        free = slice(3 * low, 3 * high)
        expected = np.linalg.solve(whole[free, free], right[:, low:high].T.ravel())
        expected = expected.reshape(-1, 3).T
        assert np.abs(actual[ENDS, low:high] - expected).max() < 1e-9 * np.abs(expected).max()


def test_ropes_without_bending_compile_no_coupled_solve() -> None:
    """Coupled eliminations are compiled only where an effect couples nodes."""
    bench = JointBench([Line(rig=HALF, low=(0.0, 0.0, -10.0), high=(0.0, 0.0, 0.0), lower=0)])
    stack, joints = bench.system.stack, bench.system.joints
    plain = assembly(solve, (Joined(stack._replace(effects=(Weight(1.0, 0.0),)), joints, None),))
    assert "eliminate_trees" in plain
    assert "coupled" not in plain
    bent = stacked_effects([bench.system.ropes[0]._replace(effects=BENT)], stack.s.shape[1])
    assert "coupled" in assembly(solve, (Joined(stack._replace(effects=bent), joints, None),))


HALF = Rig(
    length=10.0, elements=20, mass=5.0, EA=1e8, gravity=0.0, EI=2e4, tolerance=1e-3, load=0.0
)
PULLED = 5e3  # N


def hinged_frequency() -> float:
    """Return the lowest mode [Hz] of two beams under tension, hinged at both ends and between.

    y = A·sin(ax) + B·sinh(bx) in each, b² - a² = T/EI, a·b = ω·√(m/EI): no moment and no force on
    the hinge in the middle, b³·tanh(bL) = a³·tan(aL). T as in `test_bending`.
    """
    assert HALF.EI is not None
    L, T = HALF.length, PULLED / (1.0 + PULLED / HALF.EA)

    def left(a: float) -> float:
        b = math.sqrt(a * a + T / HALF.EI)
        return a**3 * math.sin(a * L) - b**3 * math.tanh(b * L) * math.cos(a * L)

    a = brentq(left, 1e-6, 0.5 * math.pi / L)
    return a * math.sqrt(a * a + T / HALF.EI) * math.sqrt(HALF.EI / HALF.mass) / (2.0 * math.pi)


def swung(elements: int, exact: float) -> float:
    """Return the measured frequency of that mode [Hz], over four periods."""
    assert HALF.EI is not None
    rig = replace(HALF, elements=elements, step=1.0 / (1000.0 * exact))
    L, T = rig.length, PULLED / (1.0 + PULLED / rig.EA)
    end = L * (1.0 + PULLED / rig.EA)
    bench = JointBench(
        [
            Line(rig=rig, low=(0.0, 0.0, 0.0), high=(-end, 0.0, 0.0), lower=0),
            Line(rig=rig, low=(end, 0.0, 0.0), high=(0.0, 0.0, 0.0), upper=0, held=True),
        ]
    )
    root = math.sqrt(rig.mass / rig.EI) * 2.0 * math.pi * exact
    a = math.sqrt(math.sqrt(0.25 * (T / rig.EI) ** 2 + root**2) - 0.5 * T / rig.EI)
    b = root / a
    x = np.linspace(0.0, L, elements + 1)
    # sinh(bx)/sinh(bL), so that a² sin(aL) balances the moment at the hinge
    shape = np.sin(a * x) + (a / b) ** 2 * math.sin(a * L) * np.sinh(b * x) / math.sinh(b * L)
    for table, scale in (
        (rows.POSITION, 1e-4),
        (rows.ACCELERATION, -1e-4 * (2 * math.pi * exact) ** 2),
    ):
        bench.nodes(0, table)[2] = scale * shape[::-1]
        bench.nodes(1, table)[2] = scale * shape
        bench.system.joints.nodes[table + 2, 0] = scale * shape[-1]
    swing = []
    for _ in range(800):
        bench.hold(5)
        swing.append(float(bench.nodes(0)[2] @ shape[::-1]))
    return frequency(np.array(swing), 5.0 * rig.step)


def test_lowest_mode_of_two_hinged_beams() -> None:
    """Characteristic equation b³·tanh(bL) = a³·tan(aL) of a kink at the joint; second order.

    Without the hinge it would be a quarter of a sine, 2 % faster.
    """
    exact = hinged_frequency()
    errors = [1.0 - swung(elements, exact) / exact for elements in (20, 40)]
    assert errors[0] == pytest.approx(4.0 * errors[1], rel=0.05, abs=1e-5)
    assert abs(errors[1]) < 2e-4


def test_a_cable_above_a_ring_bends_like_the_elastica() -> None:
    """Clamped at 45° above; the cable and load below the ring hang straight.

    Above it the elastica with all of that as its load, 1e-3 of the deflection at 50 elements; the
    pulls on hang-off and ring are what hangs there.
    """
    below = replace(HELD_CABLE, clamp=None)
    ring, top, load = (2.0, 0.0, -9.0), (0.0, 0.0, 0.0), (2.0, 0.0, -19.0)
    bench = JointBench(
        [
            Line(rig=replace(HELD_CABLE, load=0.0), low=ring, high=top, lower=0),
            Line(rig=below, low=load, high=ring, upper=0),
        ]
    )
    rest(bench)
    hung = replace(HELD_CABLE, load=below.load + below.mass * below.length)
    exact = np.array(hanging_cantilever(hung))
    assert np.abs(bench.joints[[0, 2], 0] - exact).max() < 1e-3 * exact[0]
    assert np.abs(bench.nodes(1)[0] - bench.joints[0, 0]).max() < 1e-6
    pulls, weight = bench.hold(2)[:, -1], hung.load_weight
    assert pulls[0, rows.PULL] == pytest.approx(weight + below.weight * below.length, rel=1e-8)
    assert pulls[1, rows.PULL_X :] == pytest.approx([0.0, 0.0, -weight], abs=1e-6 * weight)


def test_the_joint_force_includes_shear() -> None:
    """The momentum of what hangs on the ring grows by its weight less that force."""
    lower = replace(HELD_CABLE, clamp=None, load=5.0, step=2e-3)
    upper = replace(lower, load=0.0)
    bench = JointBench(
        [
            Line(rig=upper, low=(0.0, 0.0, -10.0), high=(0.0, 0.0, 0.0), lower=0),
            Line(rig=lower, low=(0.0, 0.0, -20.0), high=(0.0, 0.0, -10.0), upper=0),
        ]
    )
    rest(bench)
    bench.nodes(1, rows.VELOCITY)[0] = 3.0 * np.linspace(1.0, 0.0, lower.elements + 1) ** 2
    pull = bench.hold(40)[1, -1, rows.PULL_X :]
    x, size = bench.nodes(1), lower.length / lower.elements
    assert lower.EI is not None
    shear = lower.EI / size**3 * float(x[0, -1] - 2.0 * x[0, -2] + x[0, -3])
    assert shear > 1.0, "it must bend there"
    mass = np.full(lower.elements + 1, lower.mass * size)
    mass[[0, -1]] *= 0.5
    mass[0] += lower.load
    needed = bench.nodes(1, rows.ACCELERATION) @ mass
    needed[2] += mass.sum() * lower.gravity
    assert pull == pytest.approx(-needed, abs=2e-3), "the solver's tolerance"


def test_energy_balance_of_bent_ropes_in_a_bridle() -> None:
    """In heave, with slings stiffer than the hoist, which pays out."""
    scene = fine("bridle_lift")
    own = BendingParams(stiffness_n_m2=2e4)
    all_of_them = BendingParams(stiffness_n_m2=700.0, clamped_along=(0.0, 0.1, -1.0))
    hoist, *legs = scene.ropes
    scene = replace(
        scene,
        ropes=(hoist, *(replace(leg, bending=own) for leg in legs)),
        effects=(*scene.effects, all_of_them),
    )
    given = [next(one for one in rope.effects if isinstance(one, Bending))
             for rope in build_joined(scene).system.ropes]  # fmt: skip
    assert [one.EI for one in given] == [700.0, *[2e4] * 4]
    assert [one.clamp for one in given] == [1400.0, *[0.0] * 4]
    energy = balance(scene, 6.0, {"winch": 0.5})
    assert energy.exchanged_j > 1e5
    assert abs(energy.residual_j) < 5e-6 * energy.exchanged_j
