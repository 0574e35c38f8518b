"""A rope cut above a rigid body: the body falls with its slings, a bare rope remains."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from body_rigs import LINE, Vector, between, body_in, scene_of
from cut_rigs import fallen
from effect_cases import data_of, loads, some_work

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.body.step import pose_of
from rope_twin.core.step import advance
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.effects.seabed import SeabedParams
from rope_twin.twin.monitors import ENERGY
from rope_twin.twin.rope_cut import without_load

G, RHO, HOOK = 9.80665, 1025.0, 150.0
CORNERS = [(x, y, 0.6) for x in (-1.5, 1.5) for y in (-1.0, 1.0)]
SLINGS = tuple(
    Sling(to_m=at, length_m=4.0, stiffness_n_per_m=2e6, damping_newton_seconds_per_m=4e3)
    for at in CORNERS
)
BODY = RigidBodyParams(
    size_m=(4.0, 3.0, 1.2), centre_of_gravity_m=(0.2, 0.1, -0.2), slings=SLINGS, hook_mass_kg=HOOK
)
DRY = replace(BODY, added_inertia_kg_m2=(0.0,) * 3, turning_drag_m5=(0.0,) * 3)
HEAVY = replace(LINE, mass=5.0, EA=5e7, damping=5e4, length=60.0, elements=12, load=5000.0)
WET = replace(
    HEAVY, density=RHO, load=9000.0, volume=4.0, added=(2e3, 3e3, 9e3), area=(4.0, 5.0, 12.0),
    diameter=0.02, mass=1.0, drag=(1.2, 0.05), step=0.01,
)  # fmt: skip


def falling(twin: Twin) -> Any:
    """Return the rigid body of the fallen part."""
    return next(
        effect for effect in fallen(twin).effects if type(effect).__name__.startswith("RigidBody")
    )


def momentum(twin: Twin, rig: Any) -> Vector:
    """Return the momentum of falling rope, hook and body [kg·m/s]."""
    rope = fallen(twin)
    n = int(rope.state.counts[rows.ELEMENTS])
    rest = np.diff(rope.state.s[: n + 1])
    mass = 0.5 * rig.mass * (np.append(0.0, rest) + np.append(rest, 0.0))
    mass[0] += HOOK
    moving: Vector = (mass * rope.state.nodes[3:6, : n + 1]).sum(axis=1)
    return moving + rig.load * pose_of(falling(twin)).velocity


def set_swinging(twin: Twin) -> None:
    """Set rope and body in motion."""
    twin.advance(1)
    n = int(twin.rope.state.counts[rows.ELEMENTS])
    twin.rope.state.nodes[3, 1:n] += np.sin(np.linspace(0.0, np.pi, n - 1))
    twin.advance(100)


@pytest.mark.parametrize("below", [20.0, 51.3, math.inf])
def test_a_cut_keeps_the_body_state_and_compiles_nothing(below: float) -> None:
    """Position, attitude, velocity, spin and water are bit-identical; no code is compiled."""
    twin = Twin(scene_of(WET, BODY))
    set_swinging(twin)
    body = body_in(twin)
    before = body.records[int(body.memory[0, 0])].copy()
    codes = len(getattr(advance, "overloads", ()))
    twin.split(1.0 if math.isinf(below) else 60.0 - below)
    after = falling(twin)
    assert (after.records[int(after.memory[0, 0])] == before).all()
    parked = body_in(twin)
    assert type(parked) is type(after)
    assert not any(np.shares_memory(parked.records, own.records) for own in (after, body))
    twin.advance(1)
    assert len(getattr(advance, "overloads", ())) == codes


def test_a_falling_body_is_independent_of_the_call_pattern() -> None:
    """Runs in pieces and restored runs are bit-identical."""
    snapshots = []
    for chunk in (1, 7, 64):
        twin = Twin(scene_of(WET, BODY))
        assert not twin.submit_cut(505_000_000, 30.0)
        for due in (48, 130, 300):
            while twin.steps < due:
                twin.advance(min(chunk, due - twin.steps))
            if chunk == 7:
                twin = Twin.restore(twin.capture(), twin.scene)
        snapshots.append(twin.snapshot())
    for other in snapshots[1:]:
        assert other.tension_top_n == snapshots[0].tension_top_n
        assert (other.payload_position_m == snapshots[0].payload_position_m).all()
        for own, one in zip(other.ropes, snapshots[0].ropes, strict=True):
            assert (own.node_position_m == one.node_position_m).all()


def test_hook_slings_and_body_fall_freely_in_vacuum() -> None:
    """Momentum grows by weight as the slings spring back, within the hook's solver tolerance."""
    twin = Twin(scene_of(replace(HEAVY, step=0.005), DRY))
    set_swinging(twin)
    assert not twin.submit_cut(None, 35.0)
    twin.advance(1)
    mass = HEAVY.load + HOOK + HEAVY.mass * (60.0 - 35.0)
    last, missed = momentum(twin, HEAVY), fallen(twin).model.tolerance * 0.005
    assert missed < 1e-6 * mass * G
    for _ in range(200):
        twin.advance(1)
        now = momentum(twin, HEAVY)
        np.testing.assert_allclose(now - last, [0.0, 0.0, -mass * G * 0.005], atol=missed)
        last = now


def test_the_remaining_rope_equals_a_bare_rope() -> None:
    """The parked body contributes nothing and rests for good."""
    effects = data_of("rigid_body")
    assert np.abs(loads(effects, some_work())[:, 0]).max() > 1e3
    assert (loads(without_load(effects), some_work()) == loads((), some_work())).all()
    twin = Twin(scene_of(WET, BODY))
    set_swinging(twin)
    twin.submit_cut(None, 30.0)
    twin.advance(1)
    parked = body_in(twin)
    there = pose_of(parked)
    twin.advance(2000)
    now = pose_of(body_in(twin))
    np.testing.assert_allclose(now.centre, there.centre, atol=1e-9)
    assert (now.velocity == 0.0).all()
    weight = 30.0 * (WET.mass - RHO * 0.25 * math.pi * WET.diameter**2) * G
    assert twin.snapshot().tension_top_n == pytest.approx(weight, rel=0.02), "a bare rope"


def test_terminal_velocity_of_body_hook_and_rope() -> None:
    """W + w·l = (½·ρ·CdA + ½·ρ·Ct·π·d·l)·v², a light rope trailing; the body lies level."""
    body = replace(BODY, centre_of_gravity_m=(0.0, 0.0, -0.2), hook_mass_kg=0.0)
    rig = replace(WET, mass=0.4)
    twin = Twin(scene_of(rig, body))
    twin.submit_cut(None, 30.0)
    twin.advance(3000)
    d, half_rho = rig.diameter, 0.5 * RHO
    k = half_rho * (rig.area[2] + rig.drag[1] * math.pi * d * 30.0)
    weight = (rig.load - RHO * rig.volume) * G
    weight += (rig.mass - RHO * 0.25 * math.pi * d**2) * G * 30.0
    snapshot = twin.snapshot()
    assert snapshot.body is not None
    assert -snapshot.payload_velocity_m_per_s[2] == pytest.approx(math.sqrt(weight / k), rel=1e-4)
    assert abs(snapshot.body.turn[2, 2]) == pytest.approx(1.0, abs=1e-6), "level"
    assert (snapshot.body.leg_tension_n > 0.0).all(), "the rope trails taut"


def test_a_cut_body_falls_through_the_surface_onto_the_bed() -> None:
    """Energy closes, a slam at 10 m/s included; the bed carries the body in the end."""
    bed = SeabedParams(depth_m=30.0, payload_penetration_m=0.05, friction=0.4)
    rig = replace(WET, length=30.0, elements=10, hang_off=(0.0, 0.0, 40.0), mass=5.0, step=0.0025)
    twin = Twin(between(rig, BODY, bed, bottom_m2=2.0), ENERGY)
    twin.advance(200)
    assert not twin.submit_cut(None, 20.0)
    twin.advance(1400)
    energy = twin.snapshot().energy
    assert energy is not None
    assert abs(energy.residual_pct) < 0.5
    assert energy.kinetic_j > 1e4
    later = Twin.restore(twin.capture(), twin.scene)
    later.advance(9000)
    snapshot = later.snapshot()
    assert snapshot.seabed is not None
    assert snapshot.seabed.payload_landed
    weight = (rig.load - RHO * rig.volume) * G
    assert snapshot.seabed.payload_reaction_n == pytest.approx(weight, rel=0.02)
    assert snapshot.payload_position_m[2] == pytest.approx(-30.0 + 0.6, abs=0.1)
    assert np.abs(snapshot.payload_velocity_m_per_s).max() < 1e-2
