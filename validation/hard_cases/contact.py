"""A hard case of contact at 5 m/s: payload and rope on the hull, two ropes, two payloads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import log1p, pi, sqrt

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from rope_twin.core import state as rows
from rope_twin.core.energy import measure_system
from rope_twin.core.joined.joints import LOOSE, System, new_system
from rope_twin.core.joined.line_contact import rope_contact_of
from rope_twin.core.joined.payload_contact import PayloadContact, payload_contact_of
from rope_twin.core.state import Boundary
from rope_twin.core.step import advance_joined
from rope_twin.effects.hull_contact import HullBox, HullContact, HullContactParams, contact_forces
from rope_twin.effects.line_contact import LineContactParams
from rope_twin.effects.payload_contact import ContactSphere, PayloadContactParams, placed
from rope_twin.scene.rope_model import build
from rope_twin.studies.driven_twin import march, still
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.twin import Twin
from validation.case import Finding, limited
from validation.hard_cases.limits import all_converged, hard_case, off, rms_off
from validation.rigs import Rig
from validation.state_bench import Vector

SPEED = 5.0  # m/s
K, K_PAYLOAD = 2e4, 1e6  # N/m², N/m
# A payload that flies: no weight, and a rope that weighs and holds nothing.
FLYING = Rig(
    length=1000.0, elements=4, mass=1e-4, EA=10.0, load=1e4, gravity=1e-9, step=0.002, tolerance=1.0
)
BESIDE = HullBox(centre_m=(151.0, 0.0, -1400.01), size_m=(200.0, 800.0, 800.0))  # not at the rope
# A wire with a payload beside a wall 1 m away, higher and deeper than all of it.
HANGING = Rig(
    length=100.0, elements=20, mass=10.0, EA=5e7, damping=1e6, load=5e3, step=0.001, tolerance=1.0
)
WALL_M = 1.0
WALL = HullBox(centre_m=(WALL_M + 150.0, 0.0, -100.0), size_m=(300.0, 600.0, 600.0))
SECONDS = 0.8
MASSES, CHI = (1e4, 4e3), 0.2  # kg; s/m
SPAN_M = 40.0  # of two strings
TAUT = Rig(length=39.9, mass=10.0, EA=2e6, diameter=0.1, load=0.0, gravity=1e-9, tolerance=1.0)


def _twin(rig: Rig, box: HullBox, radius: float) -> Twin:
    hull = HullContactParams(
        boxes=(box,), stiffness_n_per_m2=K, payload_stiffness_n_per_m=K_PAYLOAD, friction=0.0,
        damping_s_per_m=0.0, payload_radius_m=radius,
    )  # fmt: skip
    scene = rig.scene()
    return Twin(replace(scene, effects=(*scene.effects, hull)), Monitors(energy=True))


def _pushed(twin: Twin) -> float:
    """Return the force of the hull along x [N]."""
    state = twin.rope.state
    n = int(state.counts[rows.ELEMENTS]) + 1
    (hull,) = (effect for effect in twin.rope.effects if isinstance(effect, HullContact))
    nodes = state.nodes
    return float(contact_forces(hull, nodes[:3, :n], nodes[3:6, :n], state.s[:n])[0].sum())


def _payload() -> list[Finding]:
    """Limit the errors of a mass that a linear spring returns."""
    twin = _twin(FLYING, BESIDE, 50.0)
    nodes = twin.rope.state.nodes
    nodes[rows.VELOCITY, 0] = SPEED
    snapshots, x, v, force = [], [], [], []
    for snapshot in march(twin, still, SECONDS):
        snapshots.append(snapshot)
        x.append(float(nodes[0, 0]))
        v.append(float(nodes[rows.VELOCITY, 0]))
        force.append(_pushed(twin))
    energy = snapshots[-1].energy
    assert energy is not None
    slow, motion = sqrt(FLYING.load / K_PAYLOAD), 0.5 * FLYING.load * SPEED**2
    pushed = np.array(force)
    share = pushed[pushed < 0.0]
    inside = FLYING.step * len(share)
    impulse, gained = FLYING.step * float(pushed.sum()), FLYING.load * (v[-1] - SPEED)
    return [
        off("deepest penetration of 10 t against v·√(m/k)", max(x) - WALL_M, SPEED * slow, 0.1),
        off("speed after it", -v[-1], SPEED, 0.1),
        limited("time in contact against π·√(m/k), in steps",
                abs(inside - pi * slow) / FLYING.step, 2.0, ""),
        off("impulse of the hull against the momentum", impulse, gained, 0.1),
        limited("energy balance, of the energy of motion",
                100.0 * abs(energy.residual_j + motion) / motion, 0.1),
    ]  # fmt: skip


def _by_scipy(place: Vector, speed: Vector, times: Vector) -> Vector:
    """Return x of all free nodes at these times, (nodes, times), by DOP853.

    The same chain in the plane of x and z; the wall's force on an element is the integral of its
    piecewise linear penetration over the length, in closed form.
    """
    rig, n = HANGING, HANGING.elements
    segment_m = rig.length / n
    mass = np.full(n, rig.mass * segment_m)
    mass[0] = 0.5 * rig.mass * segment_m + rig.load
    hang_off = np.zeros((2, 1))

    def change(_: float, state: Vector) -> Vector:
        x, v = state.reshape(2, 2, n)
        x, v = np.hstack([x, hang_off]), np.hstack([v, hang_off])
        span, rate = np.diff(x), np.diff(v)
        length = np.hypot(*span)
        direction = span / length
        pull = rig.EA * (length / segment_m - 1.0) + rig.damping / segment_m * (
            direction * rate
        ).sum(axis=0)
        force = np.zeros((2, n + 1))
        force[:, :-1] += np.maximum(pull, 0.0) * direction
        force[:, 1:] -= np.maximum(pull, 0.0) * direction
        force[1, :n] -= mass * rig.gravity
        depth = x[0] - WALL_M
        low, upper = _shares(depth[:-1], depth[1:])
        force[0, :-1] -= K * segment_m * low
        force[0, 1:] -= K * segment_m * upper
        force[0, 0] -= K_PAYLOAD * max(depth[0], 0.0)
        return np.concatenate([v[:, :n].ravel(), (force[:, :n] / mass).ravel()])

    began = np.concatenate([place.ravel(), speed.ravel()])
    solution = solve_ivp(
        change, (0.0, times[-1]), began, "DOP853", times, rtol=1e-9, atol=1e-9, max_step=0.001
    )
    return np.asarray(solution.y[:n])


def _shares(a: Vector, b: Vector) -> tuple[Vector, Vector]:
    """Return ∫(1 - t)·d⁺ dt and ∫t·d⁺ dt over 0 <= t <= 1 of d = a + t·(b - a)."""
    cut = np.clip(a / np.where(a == b, 1.0, a - b), 0.0, 1.0)
    start, end = np.where(a > 0.0, 0.0, cut), np.where(b > 0.0, 1.0, cut)
    end = np.where((a <= 0.0) & (b <= 0.0), start, end)
    slope = b - a
    zeroth = a * (end - start) + slope * (end**2 - start**2) / 2.0
    first = a * (end**2 - start**2) / 2.0 + slope * (end**3 - start**3) / 3.0
    return zeroth - first, first


def _rope() -> list[Finding]:
    """Limit the errors of a rope with its payload that swings against a wall."""
    twin = _twin(HANGING, WALL, 0.0)
    nodes, n = twin.rope.state.nodes, HANGING.elements
    nodes[rows.VELOCITY, :n] = SPEED
    place, speed = nodes[[0, 2], :n].copy(), nodes[[3, 5], :n].copy()
    snapshots, x = [], []
    for snapshot in march(twin, still, SECONDS):
        snapshots.append(snapshot)
        x.append(nodes[0, :n].copy())
    energy, times = snapshots[-1].energy, [snapshot.time_s for snapshot in snapshots]
    assert energy is not None
    positions, exact = np.array(x).T, _by_scipy(place, speed, np.array(times))
    motion = 0.5 * SPEED**2 * (HANGING.load + HANGING.mass * HANGING.length)
    return [
        off("deepest penetration of the payload on a rope", positions[0].max() - WALL_M,
            exact[0].max() - WALL_M, 0.2),
        off("deepest penetration of the rope", positions[1:].max() - WALL_M,
            exact[1:].max() - WALL_M, 1.0),
        rms_off("place of all nodes over 0.8 s", positions, exact, 0.5),
        limited("energy from nowhere, of the energy of motion",
                100.0 * max(-energy.residual_j - motion, 0.0) / motion, 0.1),
        all_converged(snapshots[-1].solver.unconverged_substeps),
    ]  # fmt: skip


def _strings(speed: float, step: float, elements: int) -> tuple[System, Callable[[], float]]:
    """Return two taut strings across each other, of which the upper one comes down at `speed`.

    And the step that returns their normal force [N].
    """
    rig = replace(TAUT, step=step, elements=elements)
    half, contact = 0.5 * SPAN_M, LineContactParams(
        distance_m=TAUT.diameter, stiffness_n_per_m=5e5, friction=0.0, damping_s_per_m=0.0
    )  # fmt: skip
    ends = (((-half, 0.03, 0.11), (half, 0.03, 0.11)), ((0.04, -half, 0.0), (0.04, half, 0.0)))
    ropes, value = [], np.zeros((2, 2, rows.MOTIONS))
    for r, (low, high) in enumerate(np.array(ends)):
        scene = rig.scene()
        rope = build(replace(scene, effects=(*scene.effects, contact)))
        share = rope.state.s[: elements + 1] / rope.state.s[elements]
        rope.state.nodes[:3, : elements + 1] = low[:, None] + (high - low)[:, None] * share
        ropes.append(rope._replace(model=rope.model._replace(first_free=1)))
        value[r, :, :3], value[r, :, rows.LINE] = high, rig.length
    system = new_system(tuple(ropes), [LOOSE, LOOSE], [LOOSE, LOOSE])
    system.ropes[0].state.nodes[rows.VELOCITY + 2, 1:elements] = -speed
    boundary, pull, time = Boundary(value, np.zeros_like(value)), np.zeros((2, 1, 5)), [0.0]

    def advance() -> float:
        advance_joined(system, boundary, pull, time[0], 1)
        time[0] += step
        touch = rope_contact_of(system)
        assert touch is not None, "the scene lists it"
        return touch.push

    return system, advance


def _ropes() -> list[Finding]:
    """Limit the errors of two ropes that collide: force by impedance, energy, side."""
    boundary = np.zeros((2, 5)), np.zeros(2), 0.0
    _, advance = _strings(0.2, 0.005, 80)
    pushes = np.array([advance() for _ in range(160)])[60:]
    tension = TAUT.EA * (SPAN_M / TAUT.length - 1.0)
    system, advance = _strings(SPEED, 0.002, 10)
    start, motion = (
        measure_system(system, *boundary).store.total,
        0.5 * TAUT.mass * SPAN_M * SPEED**2,
    )
    for _ in range(250):
        advance()
    gained = measure_system(system, *boundary).store.total - start
    heights = [rope.state.nodes[2, 5] for rope in system.ropes]
    unconverged = int(system.ropes[0].state.health[rows.SUBSTEPS_UNCONVERGED])
    return [
        off("force of two strings against V·√(T·m)", float(pushes.mean()),
            0.2 * sqrt(tension * TAUT.mass), 2.0),
        limited("energy of two ropes after they met", 100.0 * abs(gained) / motion, 0.1),
        limited("height of the lower over the upper rope", heights[1] - heights[0], 0.0, "m"),
        all_converged(unconverged),
    ]  # fmt: skip


def _two_payloads(chi: float) -> tuple[System, Callable[[], None]]:
    """Return two payloads, of which one flies at the other, and the step."""
    bodies = tuple(ContactSphere(name=name, radius_m=1.0) for name in ("one", "other"))
    params = PayloadContactParams(
        bodies=bodies, stiffness_n_per_m=K_PAYLOAD, damping_s_per_m=chi, friction=0.0
    )
    ropes, value = [], np.zeros((2, 2, rows.MOTIONS))
    for r, mass in enumerate(MASSES):
        rig = replace(FLYING, load=mass, step=0.001, tolerance=1e-3)
        scene, n = rig.scene(), rig.elements
        rope = build(replace(scene, effects=(*scene.effects, params)))
        effects = tuple(
            placed(effect, params, {"one": 0, "other": 1})
            if isinstance(effect, PayloadContact)
            else effect
            for effect in rope.effects
        )
        rope.state.nodes[0, : n + 1] = value[r, :, 0] = 2.01 * r
        rope.state.nodes[2, : n + 1] = rope.state.s[: n + 1] - rig.length
        value[r, :, rows.LINE] = rig.length
        ropes.append(rope._replace(effects=effects))
    system = new_system(tuple(ropes), [0, 1], [LOOSE, LOOSE])
    system.ropes[0].state.nodes[rows.VELOCITY, 0] = SPEED
    system.joints.nodes[rows.VELOCITY, 0] = SPEED
    boundary, pull, time = Boundary(value, np.zeros_like(value)), np.zeros((2, 1, 5)), [0.0]

    def advance() -> None:
        advance_joined(system, boundary, pull, time[0], 1)
        time[0] += 0.001

    return system, advance


def _rebound(chi: float) -> float:
    """Return the speed of parting over that of meeting, by ∫v·dv/(1 + χ·v) = 0 (derived)."""
    v = chi * SPEED

    def balance(e: float) -> float:
        return v * (1.0 + e) - log1p(v) + log1p(-v * e)

    return float(brentq(balance, 0.0, min(1.0, (1.0 - 1e-9) / v)))


def _payloads() -> list[Finding]:
    """Limit the errors of two payloads that collide: speeds, depth, energy, restitution."""
    boundary, (first, second) = (np.zeros((2, 5)), np.zeros(2), 0.0), MASSES
    system, advance = _two_payloads(0.0)
    start, deepest = measure_system(system, *boundary).store.total, 0.0
    for _ in range(300):
        advance()
        touch = payload_contact_of(system)
        assert touch is not None, "the scene lists it"
        deepest = max(deepest, touch.deepest)
    after = system.joints.nodes[rows.VELOCITY].copy()
    gained = measure_system(system, *boundary).store.total - start
    damped, advance = _two_payloads(CHI)
    for _ in range(400):
        advance()
    parted = float(np.diff(damped.joints.nodes[rows.VELOCITY])[0]) / SPEED
    unconverged = sum(int(s.ropes[0].state.health[rows.SUBSTEPS_UNCONVERGED])
                      for s in (system, damped))  # fmt: skip
    reduced = first * second / (first + second)
    return [
        off("speed of the payload that was hit", after[1],
            2.0 * first * SPEED / (first + second), 0.1),
        off("speed of the one that hit it", after[0],
            SPEED * (first - second) / (first + second), 0.1),
        off("deepest penetration of two payloads against v·√(m/k)", deepest,
            SPEED * sqrt(reduced / K_PAYLOAD), 0.1),
        limited("energy of two payloads after they met", 100.0 * abs(gained) / start, 0.1),
        off("restitution of damping", parted, _rebound(CHI), 0.2),
        all_converged(unconverged),
    ]  # fmt: skip


def contact() -> list[Finding]:
    """Meet a wall at 5 m/s, a payload alone and a rope along its length; then both kinds alike."""
    return [*_payload(), *_rope(), *_ropes(), *_payloads()]


CASES = (
    hard_case("contact_5_m_per_s",
              "payload and rope that meet the hull, two ropes, two payloads, at 5 m/s",
              "v·√(m/k), π·√(m/k), momentum, energy; the chain of masses by scipy (DOP853); "
              "V·√(T·m)",
              contact, 40.0),
)  # fmt: skip
