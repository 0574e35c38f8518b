"""Contact with the hull against closed forms: equilibrium, friction, rebound, and its balances."""

from __future__ import annotations

from dataclasses import replace
from math import log, log1p, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cut_rigs import fallen
from effect_cases import loads, some_stage
from rigs import Rig, Vector, march, march_to_end, sine, still
from scipy.optimize import brentq

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.effects.hull_contact import (
    FRICTION,
    KNOWN,
    PLACE,
    HullBox,
    HullContact,
    HullContactParams,
    build,
    contact_forces,
)
from rope_twin.effects.rope_in_air import WettingParams
from rope_twin.scene.schema import Scene, Winch
from rope_twin.twin.monitors import Monitors

WINCH = Winch(
    speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=2.0, min_line_out_m=50.0,
    max_line_out_m=200.0,
)  # fmt: skip
RIG = Rig(
    length=100.0, elements=20, mass=10.0, EA=5e7, diameter=0.05, damping=1e6, load=5000.0,
    step=0.02, winch=WINCH,
)  # fmt: skip
LIGHT = replace(RIG, mass=1e-3)
SIDE = HullBox(centre_m=(-4.5, 0.0, -24.0), size_m=(10.0, 20.0, 8.0))  # its side at x = 0.5 m
MU, SLIP = 0.3, 0.01


def scene_of(rig: Rig, *boxes: HullBox, **params: Any) -> Scene:
    """A rig's scene with a hull. All of the rope is below the surface, where wetting does nothing:
    with it the step is that of the shipped moonpool_lift.
    """
    scene = rig.scene()
    hull = HullContactParams(boxes=boxes, **params)
    return replace(scene, effects=(*scene.effects, WettingParams(), hull))


def hull_of(twin: Twin) -> HullContact:
    (hull,) = (effect for effect in twin.rope.effects if isinstance(effect, HullContact))
    return hull


def nodes_of(twin: Twin) -> tuple[Vector, Vector, Vector]:
    state = twin.rope.state
    n = int(state.counts[rows.ELEMENTS]) + 1
    return state.nodes[:3, :n], state.nodes[3:6, :n], state.s[:n]


def forces_of(twin: Twin) -> Vector:
    return contact_forces(hull_of(twin), *nodes_of(twin))


def test_static_equilibrium_of_a_rope_over_an_edge() -> None:
    """Horizontal force W·a/z at the hang-off of a light rope displaced by a at depth z.

    The hang-off carries what weighs and presses.
    """
    twin = Twin(scene_of(replace(LIGHT, elements=100), SIDE, friction=0.0, stiffness_n_per_m2=1e6))
    pushed, position = forces_of(twin), nodes_of(twin)[0]
    weight = LIGHT.load * LIGHT.gravity
    offset = position[0, 0]
    assert 0.49 < offset < 0.52
    assert pushed[0].sum() == pytest.approx(weight * offset / 20.0, rel=0.03)
    snapshot = march_to_end(twin, still, 0.1)
    held = snapshot.hang_off_force_n
    assert held[0] == pytest.approx(pushed[0].sum(), rel=1e-6)
    total = weight + LIGHT.weight * LIGHT.length - pushed[2].sum()
    assert held[2] == pytest.approx(-total, rel=1e-6)


EDGE_M = 40.0  # depth of a keel below the hang-off
KEEL = HullBox(centre_m=(-99.5, 0.0, -EDGE_M - 2.0), size_m=(200.0, 200.0, 4.0))


@pytest.mark.parametrize("elements", [4, 7, 12, 28, 56, 112])
def test_an_edge_between_nodes_loads_its_element(elements: int) -> None:
    """W·a/(D + h·s²) at the fraction s of an element h below a node at D.

    The straight element hands 1 - s of the force to its upper node and s to the lower one. To
    W·a/z of a rope that bends at the edge that is first order: s·(1 - s)·h/z, at most h/(4·z).
    """
    rig, h = replace(LIGHT, elements=elements), LIGHT.length / elements
    twin = Twin(scene_of(rig, KEEL, stiffness_n_per_m2=1e6, friction=0.0))
    x = nodes_of(twin)[0]
    a = float(np.interp(-EDGE_M, x[2], x[0]))
    above, share = h * (EDGE_M // h), EDGE_M % h / h
    force, load = float(forces_of(twin)[0].sum()), rig.load * rig.gravity
    assert force == pytest.approx(load * a / (above + h * share**2), rel=5e-3)
    error = force * EDGE_M / (load * a) - 1.0
    assert error < h / (4.0 * (EDGE_M - 0.25 * h)) + 5e-3


WALL = HullBox(centre_m=(21.0, 0.0, -50.0), size_m=(40.0, 400.0, 80.0))  # its side at x = 1 m
STREAM = 1.2
PRESSED = replace(
    RIG, density=1025.0, drag=(1.2, 0.0), current=((0.0, (STREAM, 0.0)),), length=110.0, elements=44
)
DRAG = 0.5 * 1025.0 * RIG.diameter * 1.2 * STREAM**2  # N/m


def test_wall_penetration_under_a_current() -> None:
    """Drag over contact stiffness, ½·ρ·d·C_d·U²/k."""
    twin = Twin(scene_of(PRESSED, WALL, stiffness_n_per_m2=1e4))
    position = nodes_of(twin)[0]
    lies = (position[2] < -59.0) & (position[2] > -74.0)
    sunk = position[0, lies] - 1.0
    assert lies.sum() == 6
    assert sunk == pytest.approx(np.full(6, DRAG / 1e4), rel=0.01)
    assert forces_of(twin)[0].sum() < -40.0 * DRAG


def test_friction_of_hauling_over_a_wall() -> None:
    """Top tension is the weight plus μ·N while hauled in, less μ·N while paid out."""
    pulls, normal = [], []
    for speed in (-0.05, 0.05):
        scene = scene_of(PRESSED, WALL, friction=MU, slip_m=SLIP, stiffness_n_per_m2=1e4)
        twin = Twin(scene)
        snapshot = march_to_end(twin, still, 12.0, speeds=[(0.0, speed)])
        pulls.append(float(snapshot.hang_off_force_n[2]))
        normal.append(float(forces_of(twin)[3].sum()))
    paid = float(nodes_of(twin)[2][-1]) - PRESSED.length
    weight = 2.0 * paid * PRESSED.weight  # of the rope that differs
    rubbed = MU * sum(normal)
    assert pulls[1] - pulls[0] == pytest.approx(rubbed - weight, rel=0.02)
    assert rubbed > 2.0 * weight


def test_wall_friction_is_elastic_below_the_slip_distance() -> None:
    """Friction μ·N/2 at half the slip distance, μ·N from the slip distance on."""
    hull = build(
        HullContactParams(boxes=(WALL,), friction=MU, slip_m=SLIP, stiffness_n_per_m2=1e4),
        None,
        type("Around", (), {"room": 8}),
    )
    work = rows.new_work(4, rows.COUPLED_ROWS)
    work[rows.POSITION, :4] = 1.1
    work[rows.POSITION + 2, :4] = -40.0 + 2.0 * np.arange(4)
    work[rows.REST, :4] = 2.0
    hull.memory[KNOWN, -1], hull.memory[FRICTION, -1] = 3, 1.0
    for moved, share in ((0.5, 0.5), (1.0, 1.0), (4.0, 1.0)):
        position = work[rows.POSITION : rows.POSITION + 3, :4].copy()
        position[1] -= moved * SLIP
        hull.memory[PLACE : PLACE + 3, :4] = position
        force = loads((hull,), work, 1, 3)[3:6]
        assert force[0, 1] == pytest.approx(-1e4 * 0.1 * 2.0, rel=1e-3)
        assert force[1, 1] == pytest.approx(share * MU * force[0, 1], rel=1e-4)


# A payload that flies: no weight, a rope that weighs and resists nothing, and beside it the hull.
MASS, STIFFNESS, SPEED = 1e4, 1e6, 5.0
FLYING = replace(RIG, length=1000.0, elements=4, mass=1e-4, EA=10.0, damping=0.0, load=MASS,
                 gravity=1e-9, step=0.002)  # fmt: skip
ASIDE = HullBox(centre_m=(151.0, 0.0, -1400.01), size_m=(200.0, 800.0, 800.0))


def flown(damping: float, seconds: float, step: float = FLYING.step) -> tuple[Vector, Vector, Twin]:
    """Place and speed of a payload that meets a wall 1 m ahead at SPEED."""
    twin = Twin(
        scene_of(replace(FLYING, step=step), ASIDE, damping_s_per_m=damping, friction=0.0,
                 payload_radius_m=50.0, payload_stiffness_n_per_m=STIFFNESS)
    )  # fmt: skip
    nodes = twin.rope.state.nodes
    nodes[rows.VELOCITY, 0] = SPEED
    seen = [(nodes[0, 0], nodes[rows.VELOCITY, 0]) for _ in march(twin, still, seconds)]
    return *np.array(seen).T, twin  # type: ignore[return-value]


def test_rebound_of_a_payload_from_a_wall() -> None:
    """A mass on a spring: depth v·√(m/k), rebound after π·√(m/k) at the approach speed."""
    x, v, _ = flown(0.0, 0.8)
    rest = sqrt(MASS / STIFFNESS)
    assert x.max() - 1.0 == pytest.approx(SPEED * rest, rel=1e-3)
    assert v[-1] == pytest.approx(-SPEED, rel=1e-3)
    inside = FLYING.step * (x > 1.0).sum()
    assert inside == pytest.approx(pi * rest, abs=2.0 * FLYING.step)


def test_rebound_speed_is_of_second_order() -> None:
    """Errors at 8 and 2 ms (40 and 160 steps in contact) differ by a factor of 16 or more."""
    coarse, fine = (abs(flown(0.0, 0.8, step)[1][-1] / SPEED + 1.0) for step in (0.008, 0.002))
    assert coarse / fine > 16.0
    assert fine < 2e-5


def test_rebound_speed_with_contact_damping() -> None:
    """χ·v0 - ln(1 + χ·v0) = -χ·v1 - ln(1 - χ·v1) for N = k·d·(1 + χ·ḋ), by its own integral."""
    chi = 0.1
    _, v, _ = flown(chi, 0.8)
    left = chi * SPEED - log1p(chi * SPEED)
    leaves = brentq(lambda u: -chi * u - log(1.0 - chi * u) - left, 1e-6, 0.999 / chi)
    assert v[-1] == pytest.approx(-leaves, rel=1e-3)
    assert leaves < 0.8 * SPEED


MOONPOOL = HullBox(centre_m=(0.0, 0.0, -15.0), size_m=(4.0, 4.0, 8.0), opening=True)
LOWERED = replace(
    RIG, density=1025.0, drag=(1.2, 0.02), current=((0.0, (1.5, 0.3)), (-300.0, (1.0, 0.0))),
    volume=1.0, added=(2e3, 2e3, 2e3), area=(4.0, 4.0, 4.0), added_mass=1.0,
)  # fmt: skip


HELD = scene_of(LOWERED, MOONPOOL, friction=MU, slip_m=SLIP)


@pytest.fixture(scope="module")
def lowered() -> tuple[list[Any], Twin]:
    """A lift through a moonpool in a current: heave, payout, haul; snapshots and the twin."""
    twin = Twin(HELD, Monitors(energy=True))
    speeds = [(5.0, 1.0), (15.0, -1.0), (22.0, 0.0)]
    return list(march(twin, sine(1.5, 7.0), 25.0, speeds=speeds)), twin


def test_a_moonpool_confines_the_rope(lowered: tuple[list[Any], Twin]) -> None:
    """Inside the walls, within the penetration, however far the current carries the payload."""
    snapshots, twin = lowered
    assert snapshots[-1].solver.splits > 0
    assert snapshots[-1].solver.unconverged_substeps == 0
    for snapshot in snapshots[::50]:
        position, heave = snapshot.node_position_m, snapshot.node_position_m[-1, 2]
        depth = np.linspace(-11.5, -18.5, 15) + heave
        for axis in (0, 1):
            assert np.abs(np.interp(depth, position[:, 2], position[:, axis])).max() < 2.2
    assert snapshots[-1].payload_position_m[0] > 8.0
    normal = forces_of(twin)[3]
    assert normal.sum() > 5e3
    (position,) = snapshots[-1].contacts
    assert (position.name, position.normal_n) == ("hull", pytest.approx(normal.sum(), rel=1e-12))
    assert -25.0 < position.position_m[2] < -8.0


def test_energy_balance_of_hull_contact(lowered: tuple[list[Any], Twin]) -> None:
    snapshots, _ = lowered
    energy = snapshots[-1].energy
    assert abs(energy.residual_j) < 1e-3 * energy.exchanged_j


def test_hull_friction_resumes_bit_identically(
    lowered: tuple[list[Any], Twin], tmp_path: Path
) -> None:
    """Branch and saved state keep the friction displacement."""
    twin = lowered[1]
    assert np.abs(hull_of(twin).memory[:3]).max() > 0.1 * SLIP
    twin.save(tmp_path / "saved")
    others = (twin.branch(), Twin.restore(tmp_path / "saved", HELD))
    for run in (twin, *others):
        run.advance(100)
    for other in others:
        assert np.array_equal(twin.rope.state.nodes, other.rope.state.nodes)


def test_the_fallen_part_has_no_hull_contact(lowered: tuple[list[Any], Twin]) -> None:
    """The upper part rubs on; no hull falls with the lower one."""
    twin = lowered[1].branch()
    twin.submit_cut(None, 60.0)
    twin.advance(100)
    lower = fallen(twin)
    (left,) = (effect for effect in lower.effects if isinstance(effect, HullContact))
    n = int(lower.state.counts[rows.ELEMENTS]) + 1
    assert (contact_forces(left, lower.state.nodes[:3, :n], lower.state.nodes[3:6, :n],
                           lower.state.s[:n]) == 0.0).all()  # fmt: skip
    assert lower.state.nodes[rows.VELOCITY + 2, 0] < -0.5
    assert forces_of(twin)[3].sum() > 0.0


def test_wall_contact_blocks_bound_the_coupled_stiffness() -> None:
    """Row sums of the coupled stiffness; their difference is positive definite."""
    hull = build(
        HullContactParams(boxes=(WALL,), stiffness_n_per_m2=1e4, damping_s_per_m=0.2),
        None,
        type("Around", (), {"room": 8}),
    )
    hull.memory[KNOWN, -1] = 3
    work = rows.new_work(4, rows.COUPLED_ROWS)
    work[rows.POSITION, :4] = 0.9, 1.05, 1.02, 0.9
    work[rows.VELOCITY, :4] = 0.3, 0.1, -0.2, 0.0
    work[rows.POSITION + 2, :4] = -40.0 + 2.0 * np.arange(4)
    work[rows.REST, :4] = 2.0
    stage, step = some_stage(), 1e-3
    exact = np.zeros((2, 4))
    for k in range(4):
        ends = []
        for sign in (1.0, -1.0):
            moved = work.copy()
            moved[rows.POSITION, k] += sign * step * stage.p
            moved[rows.VELOCITY, k] += sign * step * stage.q
            ends.append(loads((hull,), moved, 1, 3)[3, 1:3])
        exact[:, k] = (ends[1] - ends[0]) / (2.0 * step)
    lumped = loads((hull,), work, 1, 3)[6, 1:3]
    assert np.linalg.eigvalsh(np.diag(lumped) - exact[:, 1:3]).min() > 0.0
    assert exact.sum(axis=1) == pytest.approx(lumped, rel=1e-3)


@pytest.mark.parametrize("slips", [0.5, 3.0])
def test_wall_friction_blocks_bound_the_coupled_stiffness(slips: float) -> None:
    """Blocks along the wall bound it where an element sticks and where it slides."""
    params = HullContactParams(boxes=(WALL,), stiffness_n_per_m2=1e4, damping_s_per_m=0.0)
    hull = build(params, None, type("Around", (), {"room": 8}))
    hull.memory[KNOWN, -1], hull.memory[FRICTION, -1] = 3, 1.0
    work = rows.new_work(4, rows.COUPLED_ROWS)
    work[rows.POSITION, :4] = 0.9, 1.05, 1.02, 0.9
    work[rows.POSITION + 2, :4] = -40.0 + 2.0 * np.arange(4)
    work[rows.REST, :4] = 2.0
    hull.memory[PLACE : PLACE + 3, :4] = work[rows.POSITION : rows.POSITION + 3, :4]
    hull.memory[PLACE + 1, :4] -= slips * params.slip_m
    stage, step = some_stage(), 1e-4
    exact = np.zeros((2, 4))
    for k in range(4):
        ends = []
        for sign in (1.0, -1.0):
            moved = work.copy()
            moved[rows.POSITION + 1, k] += sign * step * stage.p
            ends.append(loads((hull,), moved, 1, 3)[4, 1:3])
        exact[:, k] = (ends[1] - ends[0]) / (2.0 * step)
    at_rest = loads((hull,), work, 1, 3)
    assert np.abs(at_rest[4, 1:3]).min() > 0.0
    bounded = np.diag(at_rest[9, 1:3]) - exact[:, 1:3]
    assert np.linalg.eigvalsh(bounded).min() > -1e-6 * at_rest[9, 1:3].max()
    assert at_rest[9, 1:3].min() > 0.0
