"""Contact between payloads, against two-body collisions and leaning pendulums."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log1p, pi, sqrt
from typing import Any

import numpy as np
import pytest
from joint_rigs import JointBench, Line, rest
from numpy.typing import NDArray
from rigs import Rig
from scipy.optimize import brentq

from benchmarks.effect_speed import traces
from rope_twin.core import state as rows
from rope_twin.core.energy import SystemStepEnergy, measure_system
from rope_twin.core.jit.decorators import assembly, jit_entry
from rope_twin.core.joined.joints import Joined
from rope_twin.core.joined.payload_contact import PayloadContact, payload_contact_of
from rope_twin.core.joined.stage import gather_connections
from rope_twin.effects.payload_contact import ContactSphere, PayloadContactParams, placed
from rope_twin.twin.contact import system_contacts

Vector = NDArray[np.float64]
Point = tuple[float, float, float]
RADII = 0.9, 0.6  # m
REACH = sum(RADII)
MASSES = np.array([1e4, 4e3])  # kg
REDUCED = float(MASSES.prod() / MASSES.sum())
K = 1e6  # N/m
CONTACT = PayloadContactParams(
    bodies=tuple(ContactSphere(name=str(k), radius_m=radius) for k, radius in enumerate(RADII)),
    stiffness_n_per_m=K, damping_s_per_m=0.0, friction=0.0,
)  # fmt: skip
# Payloads that fly: no weight, and ropes that weigh and hold next to nothing.
FLYING = Rig(
    length=1000.0, elements=4, mass=1e-4, EA=1.0, load=0.0, gravity=1e-9, step=0.001, tolerance=1e-3
)
SPEED = 5.0  # m/s


@dataclass(frozen=True, kw_only=True)
class Touching(Line):
    """A rope with a payload at its lower end that touches others; the connection is its number."""

    contact: PayloadContactParams

    def rope(self) -> rows.Rope:
        rope = replace(self, more=(self.contact,)).bare()
        joint_of = {body.name: int(body.name) for body in self.contact.bodies}
        effects = tuple(
            placed(effect, self.contact, joint_of) if isinstance(effect, PayloadContact) else effect
            for effect in rope.effects
        )
        return rope._replace(effects=effects)

    def bare(self) -> rows.Rope:
        return Line.rope(self)


def flying(
    contact: PayloadContactParams, *, aside: float = 0.0, gap: float = 0.01, step: float = 0.001,
    velocity: Point = (SPEED, 0.0, 0.0),
) -> JointBench:  # fmt: skip
    """Payload 0 flies at payload 1, whose centre is offset sideways."""
    start = ((0.0, 0.0, -1000.0), (sqrt(REACH**2 - aside**2) + gap, aside, -1000.0))
    bench = JointBench(
        [
            Touching(
                rig=replace(FLYING, load=float(mass), step=step), low=low,
                high=(low[0], low[1], 0.0), lower=k, contact=contact,
            )
            for k, (mass, low) in enumerate(zip(MASSES, start, strict=True))
        ]
    )  # fmt: skip
    bench.nodes(0, rows.VELOCITY)[:, 0] = speeds(bench)[:, 0] = velocity
    return bench


def speeds(bench: JointBench) -> Vector:
    """Velocities of the payloads, (3, payloads)."""
    return bench.system.joints.nodes[rows.VELOCITY : rows.VELOCITY + 3]


def border(bench: JointBench) -> SystemStepEnergy:
    count = len(bench.lines)
    return measure_system(bench.system, np.zeros((count, 5)), np.zeros(count), bench.time)


def meet(bench: JointBench, seconds: float) -> tuple[float, int, float]:
    """Step on; return the deepest penetration [m], steps in contact and energy dissipated [J]."""
    deepest, inside, rubbed = 0.0, 0, [border(bench).rubbed]
    for _ in range(round(seconds / bench.step)):
        bench.hold(1)
        touch = payload_contact_of(bench.system)
        assert touch is not None
        deepest, inside = max(deepest, touch.deepest), inside + touch.contacts
        rubbed.append(border(bench).rubbed)
    assert bench.health[rows.SUBSTEPS_UNCONVERGED] == 0
    return deepest, inside, bench.step * (sum(rubbed) - 0.5 * (rubbed[0] + rubbed[-1]))


def test_elastic_collision_of_two_payloads() -> None:
    """Speeds by momentum and energy; depth v·√(m/k) and duration π·√(m/k), m the reduced mass."""
    bench, (one, other) = flying(CONTACT), MASSES
    start = border(bench).store.total
    deepest, inside, _ = meet(bench, 0.3)
    slow = sqrt(REDUCED / K)
    after = speeds(bench)[0]
    assert after == pytest.approx(
        [SPEED * (one - other) / MASSES.sum(), 2.0 * one * SPEED / MASSES.sum()], rel=1e-3
    )
    assert deepest == pytest.approx(SPEED * slow, rel=1e-3)
    assert inside == pytest.approx(pi * slow / bench.step, abs=1.5)
    assert border(bench).store.total == pytest.approx(start, rel=1e-3)
    assert MASSES @ after == pytest.approx(one * SPEED, rel=1e-5)  # ropes weigh as much


@pytest.mark.parametrize("chi", [0.05, 0.5])
def test_contact_damping_in_closed_form(chi: float) -> None:
    """∫v·dv/(1 + χ·v) over the contact is 0 (derived from Hunt and Crossley 1975, n = 1)."""
    bench = flying(replace(CONTACT, damping_s_per_m=chi))
    start = border(bench).store.total
    _, _, lost = meet(bench, 0.5)
    chi_v = chi * SPEED

    def balance(e: float) -> float:
        return chi_v * (1.0 + e) - log1p(chi_v) + log1p(-chi_v * e)

    e = float(brentq(balance, 0.0, min(1.0, (1.0 - 1e-9) / chi_v)))
    after = speeds(bench)[0]
    assert (after[1] - after[0]) / SPEED == pytest.approx(e, rel=2e-3)
    assert lost == pytest.approx(0.5 * REDUCED * SPEED**2 * (1.0 - e**2), rel=2e-3)
    assert start - border(bench).store.total == pytest.approx(lost, abs=1e-3 * start)


def test_friction_impulse_of_a_sliding_contact() -> None:
    """Tangential impulse is μ times the normal one."""
    mu = 0.1
    stiff = replace(CONTACT, friction=mu, stiffness_n_per_m=1e10)
    bench = flying(stiff, aside=0.5, gap=1e-4, step=1e-5)  # so short that n hardly turns
    start = border(bench).store.total
    before = MASSES[0] * speeds(bench)[:, 0]
    middle = bench.joints.copy()
    _, _, lost = meet(bench, 0.003)
    impulse = MASSES[0] * speeds(bench)[:, 0] - before
    n = (middle[:, 1] - middle[:, 0]) / np.linalg.norm(middle[:, 1] - middle[:, 0])
    along = float(impulse @ n)
    across = float(np.linalg.norm(impulse - along * n))
    assert along < 0.0
    assert across == pytest.approx(-mu * along, rel=0.01)
    assert (MASSES * speeds(bench)).sum(axis=1) == pytest.approx(before, rel=1e-5, abs=1.0)
    assert start - border(bench).store.total == pytest.approx(lost, abs=1e-3 * start)


def test_oblique_frictionless_collision_conserves_energy_and_spin() -> None:
    """Kinetic energy and angular momentum after the contact equal those before."""
    bench = flying(CONTACT, aside=0.7)
    centre = bench.joints[:, 1].copy()

    def spin() -> Vector:
        x = bench.joints - centre[:, None]
        return np.asarray((MASSES * np.cross(x, speeds(bench), axis=0)).sum(axis=1))

    start, turned = border(bench).store.kinetic, spin()
    meet(bench, 0.3)
    assert border(bench).store.kinetic == pytest.approx(start, rel=1e-3)
    assert spin() == pytest.approx(turned, rel=1e-4, abs=1e-4 * abs(turned[2]))


def test_bodies_do_not_pass_through_each_other_in_a_large_step() -> None:
    """At 100 m/s and 20 ms: more than both radii per step."""
    bench = flying(
        replace(CONTACT, damping_s_per_m=0.5), step=0.02, gap=0.2, velocity=(100.0, 0.0, 0.0)
    )
    start = border(bench).store.total
    meet(bench, 0.4)
    assert bench.joints[0, 0] < bench.joints[0, 1]
    assert border(bench).store.total <= start * (1.0 + 1e-3)


KERNELS = "rope_twin.core.joined.payload_contact"


@jit_entry
def gather(system: Any, stage: Any) -> None:
    """Gather the forces between ropes and connections."""
    gather_connections(system, stage)


def test_systems_without_contact_compile_no_contact_code() -> None:
    """No symbol of the effect's kernels in the step's part between ropes."""
    system, stage = flying(CONTACT).system, rows.Stage(0.0, 1.0, 1.0, 0.0)
    stack = system.stack
    rest_of_it = tuple(own for own in stack.effects if not isinstance(own, PayloadContact))
    assert len(rest_of_it) == len(stack.effects) - 1
    whole, without = (
        assembly(gather, (Joined(stack._replace(effects=own), system.joints, None), stage))
        for own in (stack.effects, rest_of_it)
    )
    assert traces(whole, KERNELS)
    assert not traces(without, KERNELS)
    assert "add_ties" in without


LEANING = Rig(
    length=20.0, elements=10, mass=1e-3, EA=1e9, damping=1e4, load=4e3, step=0.01, tolerance=1e-2
)


@pytest.mark.parametrize("elements", [4, 10])
def test_static_equilibrium_of_two_touching_pendulums(elements: int) -> None:
    """Equal and 1 m apart above: N = W·tan a, distance of the centres REACH - N/K."""
    rig, half = replace(LEANING, elements=elements), 0.5
    bench = JointBench(
        [
            Touching(
                rig=rig, low=(side * 0.8, 0.0, -20.0), high=(side * half, 0.0, 0.0), lower=k,
                contact=replace(CONTACT, friction=0.3),
            )
            for k, side in enumerate((-1.0, 1.0))
        ]
    )  # fmt: skip
    rest(bench)
    W, L = rig.load * rig.gravity, rig.length

    def off(a: float) -> float:
        return 2.0 * (half + L * np.sin(a)) - (REACH - W * np.tan(a) / K)

    a = float(brentq(off, 0.0, 0.1))
    (position,) = system_contacts(bench.system)
    assert position.name == "payloads"
    assert position.normal_n == pytest.approx(W * np.tan(a), rel=1e-3)
    assert bench.joints[0, 1] == pytest.approx(half + L * np.sin(a), abs=1e-5)
    assert position.position_m[0] == pytest.approx(0.5 * (RADII[0] - RADII[1]), abs=1e-5)
    bench.hold(200)
    (later,) = system_contacts(bench.system)
    assert later.normal_n == pytest.approx(position.normal_n, rel=1e-3)


def test_bodies_out_of_reach_are_unaffected() -> None:
    """Bit-identical to a scene that does not list the contact's bodies."""
    far = flying(CONTACT, gap=5.0)
    off = flying(replace(CONTACT, stiffness_n_per_m=1e2), gap=5.0)
    for bench in (far, off):
        bench.hold(100)
    assert (far.system.joints.nodes == off.system.joints.nodes).all()
    (position,) = system_contacts(far.system)
    assert position.normal_n == 0.0
    assert np.isnan(position.position_m).all()
