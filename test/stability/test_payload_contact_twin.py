"""Contact between payloads in a twin: at rest, in heave, after a cut, saved and restored."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rope_twin import load_scene
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.payload_contact import ContactSphere, PayloadContactParams
from rope_twin.scene.lift import point_figures
from rope_twin.scene.relations import faults
from rope_twin.scene.schema import Scene
from rope_twin.twin.monitors import ENERGY
from rope_twin.twin.twin import Twin

HALVES = "half_port", "half_starboard"  # on slings of 6 m from the ends of a bar of 8 m
RADIUS_M = 4.2


def touching(names: tuple[str, ...] = HALVES, name: str = "bridle_lift") -> Scene:
    """The two loads pressed apart, in still water."""
    scene = load_scene(name)
    bodies = tuple(ContactSphere(name=name, radius_m=RADIUS_M) for name in names)
    calm = CurrentParams(profile=((0.0, (0.0, 0.0)),))
    effects = [calm if isinstance(e, CurrentParams) else e for e in scene.effects]
    return replace(scene, effects=(*effects, PayloadContactParams(bodies=bodies)))


def heave(twin: Twin, seconds: int) -> None:
    """A heave of 1 m every 6.3 s, known for so many seconds."""
    for k in range(20 * seconds):
        t = 0.05 * k
        assert not twin.submit_heave(round(t * 1e9), math.sin(t), math.cos(t))


def test_static_contact_force_of_two_touching_loads() -> None:
    """Both lean out by half of the overlap: N = W·tan a."""
    scene = touching()
    snapshot = Twin(scene).snapshot()
    (position,) = snapshot.contacts
    water = scene.environment
    figures = point_figures(scene)[HALVES[0]]
    W = (figures.mass_kg - water.water_density_kg_per_m3 * figures.volume_m3) * 9.80665
    leaned = {payload.name: np.array(payload.position_m) for payload in snapshot.payloads}
    sling = next(rope for rope in snapshot.ropes if rope.name == "sling_port").node_position_m
    lowest = sling[-1] - sling[-2]
    tangent = math.hypot(*lowest[:2]) / abs(lowest[2])
    assert position.name == "payloads"
    assert position.normal_n == pytest.approx(W * tangent, rel=2e-3)
    apart = np.linalg.norm(leaned[HALVES[0]] - leaned[HALVES[1]])
    assert apart == pytest.approx(2.0 * RADIUS_M - position.normal_n / 1e6, abs=1e-6)
    assert tangent == pytest.approx(math.tan(math.asin(0.2 / 6.0)), rel=0.05)


def test_energy_balance_of_payload_contact_and_a_cut() -> None:
    """In heave; then a sling is cut, whose load falls past the other. A saved run is the run."""
    twin = Twin(touching(), ENERGY)
    heave(twin, 8)
    twin.advance(300)
    snapshot = twin.snapshot()
    assert snapshot.energy is not None
    assert abs(snapshot.energy.residual_j) < 1e-3 * snapshot.energy.exchanged_j
    assert not twin.submit_cut(3_500_000_000, 3.0, "sling_port")
    twin.advance(100)
    branch = Twin.restore(twin.capture(), touching(), ENERGY)
    for one in (twin, branch):
        one.advance(150)
    after, other = twin.snapshot(), branch.snapshot()
    assert after.payloads[0].position_m[2] < snapshot.payloads[0].position_m[2] - 1.0, "it falls"
    for one, same in zip(after.payloads, other.payloads, strict=True):
        assert (np.array(one.position_m) == np.array(same.position_m)).all()
    assert after.energy is not None
    assert abs(after.energy.residual_j) < 5e-3 * after.energy.exchanged_j
    assert not after.not_converged


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (lambda: touching(("half_port", "hok")), "there is no payload or joint 'hok'"),
        (lambda: touching(("manifold", "hook"), "load_transfer"), "'manifold' is a rigid body"),
    ],
)
def test_contact_bodies_must_be_point_payloads(scene: object, words: str) -> None:
    assert callable(scene)
    assert any(words in what for _, what, _ in faults(scene()))
