"""Rigid bodies in multi-line systems: at the lower end of one rope, or where several meet."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_scene import not_finite

from rope_twin import Snapshot, Twin, load_scene, messages
from rope_twin.errors import SceneError
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.scene.lift import suspended_weights
from rope_twin.scene.schema import Damping, Joint, Scene
from rope_twin.studies.driven_twin import fed
from rope_twin.studies.modes import find_modes, find_system_modes
from rope_twin.twin.monitors import ENERGY, ERROR_INTERVAL, NO_MONITORS
from rope_twin.twin.twin import Twin as CoreTwin

G, RHO = 9.80665, 1025.0
MASS, VOLUME = 20e3, 4.0
DAMPED = "damping: {newton_seconds: 2.0e+5}"
HEAD = "about: a body on ropes\nsource: made up for a test\nlook_at: nothing\n"
BODY = f"""  - name: module
    mass_kg: {MASS}
    displaced_volume_m3: {VOLUME}
    added_mass_kg: [8.0e+3, 9.0e+3, 2.0e+4]
    drag_area_m2: [8.0, 12.0, 30.0]
"""
TOOL = """  - name: tool
    mass_kg: 4000.0
    displaced_volume_m3: 0.3
    added_mass_kg: [400.0, 400.0, 400.0]
    drag_area_m2: [2.0, 2.0, 2.0]
"""
SLINGS = "".join(
    f"        - {{to_m: [{x}, {y}, 1.0], length_m: 5.0, stiffness_n_per_m: 5.0e+6, "
    "damping_newton_seconds_per_m: 1.0e+4}\n"
    for x in (1.8, -1.8)
    for y in (1.3, -1.3)
)
EFFECTS = """effects:
  - current: {{profile: [[0.0, [0.4, 0.1]], [-300.0, [0.2, 0.1]]]}}
  - weight: {{}}
  - drag: {{normal: 1.2, tangential: 0.02}}
  - added_mass: {{normal: 1.0}}
{point}  - rigid_body:
      payload: module
      size_m: [4.0, 3.0, 2.0]
      centre_of_gravity_m: [0.2, 0.1, -0.3]
      hook_mass_kg: 300.0
      slings:
{slings}time: {{step_s: 0.01, newton_tolerance_n: {tolerance}}}
"""
POINT = "  - payload: {}\n"


def effects(point: str = "", tolerance: float = 0.01) -> str:
    return EFFECTS.format(point=point, slings=SLINGS, tolerance=tolerance)


def line(name: str, length: float, elements: int, more: str) -> str:
    return (
        f"  - {{name: {name}, rope: steel_wire_40mm, length_m: {length}, elements: {elements}, "
        f"{DAMPED}, {more}}}\n"
    )


WHOLE = HEAD + "ropes:\n" + line("hoist", 90.0, 18, "to: module") + "payloads:\n" + BODY
PARTS = (
    HEAD + "ropes:\n" + line("upper", 50.0, 10, "to: ring")
    + line("lower", 40.0, 8, "from: ring, to: module")
    + "joints: [{name: ring, mass_kg: 0.0}]\npayloads:\n" + BODY
)  # fmt: skip
STERN = "hang_offs: [{name: stern, at_m: [-40.0, 0.0, 0.0]}]\n"
BESIDE = (
    HEAD + "ropes:\n" + line("a", 60.0, 12, "to: tool")
    + line("b", 90.0, 18, "from: stern, to: module") + STERN + "payloads:\n" + TOOL + BODY
)  # fmt: skip
TWO_CRANES = (
    HEAD + "ropes:\n" + line("port", 70.0, 10, "to: module")
    + line("starboard", 75.0, 10, "from: stern, to: module") + STERN + "payloads:\n" + BODY
)  # fmt: skip


def scene_of(text: str, folder: Path) -> Scene:
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(str(path))


def heaved(twin: Twin, seconds: float, heave_m: float = 0.8) -> Snapshot:
    """Go on from rest in a heave of 6 s."""
    omega, sent = 2.0 * math.pi / 6.0, 0
    for half in range(round(2.0 * seconds)):
        while sent * 0.05 <= 0.5 * (half + 1):
            z = heave_m * math.sin(omega * 0.05 * sent)
            v = heave_m * omega * math.cos(omega * 0.05 * sent)
            twin.submit_heave(sent * 50_000_000, z, v)
            sent += 1
        twin.advance(round(0.5 / twin.step_s))
    return twin.snapshot()


def test_a_body_on_a_rope_in_two_parts_equals_one_on_a_single_rope(tmp_path: Path) -> None:
    """Tension, position, attitude and slings, at rest and in a heave that slackens a sling."""
    snapshots = []
    for text in (WHOLE, PARTS):
        twin = Twin(scene_of(text + effects(), tmp_path))
        snapshots.append((twin.snapshot(), heaved(twin, 20.0)))
    for one, other in zip(*snapshots, strict=True):
        assert one.body is not None
        assert other.body is not None
        assert other.tension_top_n == pytest.approx(one.tension_top_n, rel=1e-6)
        assert other.payload_position_m == pytest.approx(one.payload_position_m, abs=1e-6)
        assert other.body.quaternion == pytest.approx(one.body.quaternion, abs=1e-7)
        assert other.body.leg_tension_n == pytest.approx(one.body.leg_tension_n, abs=1.0)
    assert snapshots[0][0].body.leg_tension_n != pytest.approx(
        snapshots[0][1].body.leg_tension_n, rel=0.01
    )


@pytest.mark.long
@pytest.mark.parametrize(("name", "low_m"), [("lift_off", 8.4), ("manifold_lift", 11.0)])
def test_shipped_lifts_equal_lifts_on_a_rope_in_two_parts(name: str, low_m: float) -> None:
    """Off a heaving deck; through the surface in waves, above a seabed: 20 s.

    `pytest -n 0 -m long test/physics/test_joined_body.py`
    """
    scene = load_scene(name)
    line = replace(scene.ropes[0], damping=Damping(newton_seconds=2e5), elements=20)
    share = low_m / line.length_m
    below = replace(line, name="below", length_m=low_m, elements=round(20 * share), from_="ring")
    above = replace(line, length_m=line.length_m - low_m, elements=20 - below.elements, to="ring")
    assert scene.winch is not None
    winch = replace(scene.winch, min_line_out_m=2.0)
    winch = replace(winch, max_line_out_m=scene.winch.max_line_out_m - low_m)
    parts = replace(
        scene, ropes=(above, below), joints=(Joint(name="ring", mass_kg=0.0),), winch=winch
    )
    whole, other = CoreTwin(replace(scene, ropes=(line,))), CoreTwin(parts)
    for one, two in zip(fed(whole, 20.0), fed(other, 20.0), strict=True):
        assert one.body is not None
        assert two.body is not None
        assert two.tension_top_n == pytest.approx(one.tension_top_n, rel=1e-6)
        assert two.payload_position_m == pytest.approx(one.payload_position_m, abs=1e-6)
        assert two.body.leg_tension_n == pytest.approx(one.body.leg_tension_n, abs=1.0)
        assert two.body.deck_reaction_n == pytest.approx(one.body.deck_reaction_n, abs=1.0)


@pytest.mark.long
def test_separate_ropes_with_a_body_and_a_point_move_independently(tmp_path: Path) -> None:
    """A point on one rope, the body on the second."""
    snapshots = []
    for text, point in ((BESIDE, POINT), (WHOLE, "")):
        twin = Twin(scene_of(text + effects(point), tmp_path))
        snapshots.append(heaved(twin, 15.0))
    both, alone = snapshots
    assert both.body is not None
    assert alone.body is not None
    tool, module = both.payloads
    assert module.name == "module"
    moved = alone.payload_position_m + np.array([-40.0, 0.0, 0.0])
    assert module.position_m == pytest.approx(moved, abs=1e-5)
    assert (both.payload_position_m == module.position_m).all()
    assert both.body.quaternion == pytest.approx(alone.body.quaternion, abs=1e-6)
    assert both.ropes[1].tension_top_n == pytest.approx(alone.tension_top_n, rel=1e-5)
    assert (tool.position_m == both.ropes[0].node_position_m[-1]).all()
    reported = messages.decode("payloads/state", messages.Encoder(0).encode("payloads/state", both))
    q = reported.transforms[1].rotation
    assert [q.x, q.y, q.z, q.w] == both.body.quaternion.tolist()
    assert reported.transforms[0].rotation.w == 1.0


def test_static_balance_of_a_body_on_two_cranes(tmp_path: Path) -> None:
    """In still water the top tensions carry body, hook and ropes, and the balance closes."""
    text = effects().replace("[0.4, 0.1]", "[0.0, 0.0]").replace("[0.2, 0.1]", "[0.0, 0.0]")
    scene = scene_of(TWO_CRANES + text, tmp_path)
    twin = Twin(scene)
    twin.advance(1)
    snapshot = twin.snapshot()
    joined = twin.joined
    assert joined is not None
    pulls = joined.pull[:, 1:]
    wire = scene.ropes[0].made_of[0].rope
    wet = wire.mass_kg_per_m - RHO * 0.25 * math.pi * wire.hydrodynamic_diameter_m**2
    weight = (MASS - RHO * VOLUME) * G + 300.0 * (1.0 - RHO / 7850.0) * G + 145.0 * wet * G
    assert -pulls[:, 2].sum() == pytest.approx(weight, rel=1e-6)
    reported = suspended_weights(scene)
    assert reported is not None
    assert reported.weight_n == pytest.approx(weight, rel=1e-9)
    assert pulls[:, 0].sum() == pytest.approx(0.0, abs=1e-3 * weight)
    assert snapshot.body is not None
    hook = snapshot.ropes[0].node_position_m[-1]
    assert (snapshot.ropes[1].node_position_m[-1] == hook).all()
    assert (snapshot.body.hook_m == hook).all()


def test_energy_balance_of_a_body_on_two_cranes(tmp_path: Path) -> None:
    """One crane pays out; both ropes, hook, slings and body in flowing water."""
    winch = (
        "winch: {speed_limit_m_per_s: 1.0, acceleration_limit_m_per_s2: 0.3, "
        "min_line_out_m: 40.0, max_line_out_m: 120.0}\n"
    )
    twin = Twin(scene_of(TWO_CRANES + winch + effects(), tmp_path), ENERGY)
    twin.submit_speed(0, 0.5)
    energy = heaved(twin, 12.0).energy
    assert energy is not None
    assert energy.exchanged_j > 1e5
    assert abs(energy.residual_j) < 2e-5 * energy.exchanged_j


@pytest.mark.parametrize(
    ("text", "point"), [(TWO_CRANES, ""), pytest.param(BESIDE, POINT, marks=pytest.mark.long)]
)
def test_a_body_in_a_system_resumes_bit_identically(text: str, point: str, tmp_path: Path) -> None:
    """Saved states and branches, with the hook at a connection and on the second rope."""
    scene = scene_of(text + effects(point), tmp_path)
    twin = Twin(scene)
    heaved(twin, 3.0)
    twin.save(tmp_path / "run.state")
    others = twin.branch(), Twin.restore(tmp_path / "run.state", scene)
    snapshots = []
    for one in (twin, *others):
        one.advance(200)
        snapshots.append(one.snapshot())
    for snapshot in snapshots[1:]:
        assert (snapshot.body.quaternion == snapshots[0].body.quaternion).all()
        assert (snapshot.payload_position_m == snapshots[0].payload_position_m).all()
        for own, other in zip(snapshot.ropes, snapshots[0].ropes, strict=True):
            assert (own.node_position_m == other.node_position_m).all()


def test_coarser_mesh_and_step_keep_the_body_motion(tmp_path: Path) -> None:
    """Pose and tensions are continuous and stay close for two seconds."""
    twin = CoreTwin(scene_of(TWO_CRANES + effects(), tmp_path))
    twin.advance(100)
    same, other = twin.branch(), twin.branch()
    before = other.snapshot()
    other.set_level(AccuracyLevel(2 * twin.step_ns, 1))
    after = other.snapshot()
    assert before.body is not None
    assert after.body is not None
    assert (after.body.quaternion == before.body.quaternion).all()
    assert (after.payload_position_m == before.payload_position_m).all()
    same.advance(200)
    other.advance(100)
    one, two = same.snapshot(), other.snapshot()
    assert one.time_s == two.time_s
    assert two.tension_top_n == pytest.approx(one.tension_top_n, rel=2e-3)
    assert two.payload_position_m == pytest.approx(one.payload_position_m, abs=2e-3)


def test_the_error_interval_of_a_system_with_a_body_is_known(tmp_path: Path) -> None:
    """The coarse solution has its own body, also on ropes too short to be coarsened."""
    twin = Twin(scene_of(TWO_CRANES + effects(), tmp_path), ERROR_INTERVAL)
    snapshot = heaved(twin, 28.0)
    assert snapshot.error_interval is not None, snapshot.no_error_interval
    assert not not_finite(snapshot)
    few = scene_of(TWO_CRANES.replace("elements: 10", "elements: 3") + effects(), tmp_path)
    watched, alone = (heaved(Twin(few, one), 4.0) for one in (ERROR_INTERVAL, NO_MONITORS))
    assert watched.body is not None
    assert alone.body is not None
    assert (watched.body.quaternion == alone.body.quaternion).all()
    assert watched.tension_top_n == alone.tension_top_n


def test_modes_of_a_body_on_a_rope_in_two_parts(tmp_path: Path) -> None:
    """Rotation, pendulum and axial modes equal those of a single rope; two cranes are stiffer."""
    whole = find_modes(scene_of(WHOLE + effects(), tmp_path), 6)
    parts = find_system_modes(scene_of(PARTS + effects(), tmp_path), 6)
    for one, other in zip(whole.lowest, parts.lowest, strict=True):
        assert other.period_s == pytest.approx(one.period_s, rel=1e-5)
        assert other.turning_share == pytest.approx(one.turning_share, abs=1e-4)
    assert parts.stretching[0].period_s == pytest.approx(whole.axial[0].period_s, rel=1e-5)
    cranes = find_system_modes(scene_of(TWO_CRANES + effects(), tmp_path), 3)
    assert cranes.lowest[2].period_s < 0.5 * parts.lowest[2].period_s


def test_the_body_hangs_on_the_other_crane_after_a_cut(tmp_path: Path) -> None:
    """Position and attitude stay at the cut; it ends lower, on one rope with more tension."""
    scene = scene_of(TWO_CRANES + effects(), tmp_path)
    twin = Twin(scene)
    before = heaved(twin, 1.0, 0.1)
    twin.submit_cut(None, 20.0, "starboard")
    twin.advance(1)
    soon = twin.snapshot()
    assert soon.cut is not None
    assert soon.body is not None
    assert before.body is not None
    assert soon.payload_position_m == pytest.approx(before.payload_position_m, abs=0.01)
    assert soon.body.quaternion == pytest.approx(before.body.quaternion, abs=1e-3)
    twin.advance(6000)
    late = twin.snapshot()
    assert not not_finite(late)
    assert late.body is not None
    assert before.payload_position_m[0] < -8.0, "between the cranes"
    assert late.payload_position_m[0] == pytest.approx(0.0, abs=6.0)
    assert late.payload_position_m[2] < before.payload_position_m[2] - 0.5
    assert late.tension_top_n > 1.3 * before.tension_top_n


def test_a_body_falls_with_the_part_below_a_cut(tmp_path: Path) -> None:
    """The body and its slings belong to the fallen part."""
    scene = scene_of(PARTS + effects(), tmp_path)
    twin = Twin(scene)
    before = heaved(twin, 1.0, 0.1)
    twin.submit_cut(None, 10.0, "lower")
    twin.advance(400)
    snapshot = twin.snapshot()
    assert snapshot.body is not None
    assert not not_finite(snapshot)
    assert snapshot.payload_position_m[2] < before.payload_position_m[2] - 2.0
    assert snapshot.payloads[0].position_m == pytest.approx(snapshot.payload_position_m)
    assert snapshot.tension_top_n < 0.2 * before.tension_top_n


SENTENCES = {
    "which": (BESIDE, POINT, "payload: module", "payload: ''", "which of 2 payloads"),
    "name": (BESIDE, POINT, "payload: module", "payload: modul", "there is no payload 'modul'"),
    "point": (BESIDE, "", "", "", "`payload` is not listed: 'tool' has no weight"),
    "deck": (PARTS, "", "      slings:", "      deck: {height_m: -80.0, with_ship: true}\n"
             "      slings:", "'lower' does not come from there"),
    "zone": (BESIDE, POINT + "  - splash_zone: {height_m: 2.0}\n", "", "", "not 'tool'"),
}  # fmt: skip


@pytest.mark.parametrize("case", SENTENCES)
def test_invalid_bodies_in_systems_are_rejected(case: str, tmp_path: Path) -> None:
    text, point, old, new, words = SENTENCES[case]
    with pytest.raises(SceneError, match=words):
        scene_of((text + effects(point)).replace(old, new), tmp_path)
