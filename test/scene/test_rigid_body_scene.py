"""Scenes with a rigid payload: keys, faults and figures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sample_snapshot import hanging_rope
from scene_text import GOOD, assert_refused, spoilt, written
from scipy.spatial.transform import Rotation

from rope_twin import messages
from rope_twin.core.body.state import RigidBody
from rope_twin.effects.rigid_body import RigidBodyParams, build
from rope_twin.errors import InputError
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_model import build_effects
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.shapes import payload_figures
from rope_twin.twin.snapshot import BodySnapshot, Snapshot

SLING = "{to_m: [1.0, 0.0, 0.7], length_m: 4.0, stiffness_n_per_m: 5.0e+6}"
BODY = f"""\
  - rigid_body:
      size_m: [3.0, 2.0, 1.5]
      slings: [{SLING}]
"""


def with_body(old: str = "", new: str = "") -> str:
    """Return GOOD with a rigid body in place of the point, and a change in it."""
    assert BODY.count(old) == 1 or not old
    return spoilt("  - payload: {}\n", BODY.replace(old, new) if old else BODY)


def listing(effect: str) -> str:
    """Return the scene of the body with another effect in its list."""
    return with_body().replace("effects:\n", f"effects:\n  - {effect}\n")


BAD = [
    ("both a point and a body", listing("payload: {}"),
     "effects", ("`rigid_body` and `payload`", "remove `payload`")),
    ("a body and a net", listing("net: {width_m: 2, height_m: 2, solidity: 0.2}"),
     "effects", ("`rigid_body` and `net`", "treats the payload as a point")),
    ("a body and a fairing", listing("fairing: {face_m2: 2.0}"),
     "effects", ("`rigid_body` and `fairing`", "use `payload` for the body")),
    ("a splash zone of another height", listing("splash_zone: {height_m: 2.0}"),
     "effects.splash_zone.height_m", ("2 m is not the height of the body, 1.5 m", "size_m")),
    ("no size", with_body("      size_m: [3.0, 2.0, 1.5]\n", ""), "effects[0].rigid_body",
     ("size_m missing", "outer dimensions")),
    ("a side of nothing", with_body("[3.0, 2.0, 1.5]", "[3.0, 0.0, 1.5]"),
     "effects[0].rigid_body.size_m[1]", ("0 m is out of range", "0.05 to 200 m")),
    ("nothing holds it", with_body(f"      slings: [{SLING}]\n", ""), "effects[0].rigid_body",
     ("nothing that holds it", "give slings or pinned_at_m")),
    ("held twice", with_body("      slings", "      pinned_at_m: [0.0, 0.0, 1.0]\n      slings"),
     "effects[0].rigid_body", ("slings and a pin hold it", "give slings or pinned_at_m")),
    ("pinned below its weight", with_body(f"slings: [{SLING}]", "pinned_at_m: [0.0, 0.0, -1.0]"),
     "effects[0].rigid_body", ("pinned at -1 m, not above its centre of gravity", "capsizes")),
    ("a sling without a length", with_body("length_m: 4.0, ", ""),
     "effects[0].rigid_body.slings[0]", ("length_m missing", "unstretched length")),
    ("a misspelt sling", with_body("stiffness_n_per_m", "stifness_n_per_m"),
     "effects[0].rigid_body.slings[0].stifness_n_per_m", ("did you mean 'stiffness_n_per_m'",)),
    ("moments that no body has",
     with_body("      slings", "      inertia_kg_m2: [1.0, 1.0, 5.0]\n      slings"),
     "effects[0].rigid_body", ("moments of inertia 1, 1, 5", "sum of the other two")),
    ("a deck that moves in two ways",
     with_body("      slings", "      deck: {height_m: -3.0, with_ship: true, heave: "
               "{amplitude_m: 1.0, period_s: 7.0}}\n      slings"),
     "effects[0].rigid_body", ("ship and independently", "keep with_ship or heave")),
    ("no mass", with_body().replace("mass_kg: 20000.0", "mass_kg: 0.0"), "payloads[0].mass_kg",
     ("without mass cannot move",)),
    ("no payload", with_body().replace("to: tool", "fixed_at_m: [0.0, 0.0, -499.0]").replace(
        GOOD[GOOD.index("payloads:") : GOOD.index("winch:")], ""),
     "effects", ("`rigid_body` is listed but no payload is",)),
]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "place", "words"), [row[1:] for row in BAD], ids=[r[0] for r in BAD]
)
def test_invalid_rigid_bodies_are_rejected(
    text: str, place: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    assert_refused(text, place, words, tmp_path)


def test_a_valid_rigid_body_passes_the_checks(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, with_body()))
    assert sense_checks(scene) == []
    params = scene.listed(RigidBodyParams)
    assert params is not None
    assert params.slings[0].to_m == (1.0, 0.0, 0.7)


def four_slings(length_m: float, stiffness_n_per_m: float = 5e6) -> str:
    """Slings to the corners of 3 x 2 m, 1.80 m from the middle."""
    corners = [(x, y) for x in (1.5, -1.5) for y in (1.0, -1.0)]
    slings = ", ".join(
        f"{{to_m: [{x}, {y}, 0.7], length_m: {length_m}, stiffness_n_per_m: {stiffness_n_per_m}}}"
        for x, y in corners
    )
    return with_body(f"[{SLING}]", f"[{slings}]")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (with_body("[3.0, 2.0, 1.5]", "[4.0, 2.0, 1.5]"),
         "size_m: 4 × 2 × 1.5 m, and the payload's shape is a box of 3 × 2 × 1.5 m"),
        (four_slings(1.8), "slings[0, 1, 2, 3].length_m: 1.8 m does not reach the hook at a "
         "lateral offset of 1.80 m"),
        (four_slings(2.0), "slings[0, 1, 2, 3].length_m: 2 m is 64° from the vertical"),
        (four_slings(4.0, 2e4), "slings[0, 1, 2, 3].stiffness_n_per_m: its share of the load, 30 "
         "kN, stretches it by 1.5 m"),
    ],
)  # fmt: skip
def test_unusual_body_sizes_and_slings_are_warned_of(text: str, words: str, tmp_path: Path) -> None:
    """20 t that displace 9 m³ weigh 105.7 kN; a sling of 4 m carries 26.4 kN / cos 26.8°."""
    (warning,) = sense_checks(load_scene(written(tmp_path, text)))
    assert warning.startswith(f"effects.rigid_body.{words}")
    assert sense_checks(load_scene(written(tmp_path, four_slings(4.0)))) == []


def test_body_inertia_and_drag_follow_from_the_size(tmp_path: Path) -> None:
    """A box of a×b×c has m·(b² + c²)/12; strips of M_z along y and M_y along z; CdA·b³/32."""
    scene = load_scene(written(tmp_path, with_body()))
    figures = payload_figures(scene.payloads[0], 1025.0)
    (body,) = (own for own in build_effects(scene, figures) if isinstance(own, RigidBody))
    M, CdA = figures.added_mass_kg, figures.drag_area_m2
    assert body.inertia[0, 0] == pytest.approx(20e3 / 12.0 * (2.0**2 + 1.5**2))
    assert body.inertia[2, 2] == pytest.approx(20e3 / 12.0 * (3.0**2 + 2.0**2))
    assert body.added[:3] == pytest.approx(M)
    assert body.added[3] == pytest.approx((M[2] * 2.0**2 + M[1] * 1.5**2) / 12.0)
    assert body.added[5] == pytest.approx((M[1] * 3.0**2 + M[0] * 2.0**2) / 12.0)
    assert body.k[4] == pytest.approx(0.5 * 1025.0 * (CdA[0] * 1.5**3 + CdA[2] * 3.0**3) / 32.0)


def test_explicit_body_keys_override_the_size(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, with_body()))
    params = scene.listed(RigidBodyParams)
    assert params is not None
    own = RigidBodyParams(
        size_m=params.size_m, slings=params.slings, inertia_kg_m2=(4.0, 5.0, 6.0),
        added_inertia_kg_m2=(1.0, 2.0, 3.0), turning_drag_m5=(7.0, 8.0, 9.0),
        centre_of_gravity_m=(0.1, 0.2, 0.3),
    )  # fmt: skip
    from rope_twin.effects import Surroundings

    body = build(own, payload_figures(scene.payloads[0], 1025.0), Surroundings(1025.0, 9.8, 0.0, 9))
    assert np.diag(body.inertia) == pytest.approx((4.0, 5.0, 6.0))
    assert body.added[3:] == pytest.approx((1.0, 2.0, 3.0))
    assert body.k[3:] == pytest.approx(0.5 * 1025.0 * np.array((7.0, 8.0, 9.0)))
    assert body.legs[0, :3] == pytest.approx((0.9, -0.2, 0.4)), "places count from the gravity's"


def turned() -> Snapshot:
    """A body turned a third about a skew axis, on two slings, over a deck."""
    turn = Rotation.from_rotvec([0.7, -0.4, 1.1])
    snapshot = hanging_rope(length_m=200.0)
    body = BodySnapshot(
        quaternion=turn.as_quat(), angular_velocity_rad_per_s=np.array([0.1, -0.2, 0.3]),
        size_m=np.array([4.0, 3.0, 2.0]), leg_tension_n=np.array([5e4, 0.0]),
        leg_length_m=np.array([6.0, 5.9]), leg_end_m=np.array([[1.0, 2.0, -3.0], [4.0, 5.0, -6.0]]),
        hook_m=snapshot.node_position_m[-1],
        deck_reaction_n=1e3, deck_clearance_m=-0.002,
    )  # fmt: skip
    velocity = np.array([0.5, -0.1, 0.2])
    return replace(snapshot, body=body, payload_velocity_m_per_s=velocity)


def test_the_state_of_a_body_has_its_attitude_and_a_twist_in_its_own_axes() -> None:
    """Pose in the frame of the header, twist in that of the body."""
    snapshot = turned()
    reported = messages.decode(
        "payloads/state", messages.Encoder(0).encode("payloads/state", snapshot)
    )
    q, twist = reported.transforms[0].rotation, reported.twist[0]
    turn = Rotation.from_quat([q.x, q.y, q.z, q.w])
    linear = [twist.linear.x, twist.linear.y, twist.linear.z]
    assert turn.apply(linear) == pytest.approx(snapshot.payload_velocity_m_per_s)
    assert turn.magnitude() == pytest.approx(np.linalg.norm([0.7, -0.4, 1.1]))
    assert [twist.angular.x, twist.angular.y, twist.angular.z] == pytest.approx([0.1, -0.2, 0.3])
    assert snapshot.body is not None
    assert snapshot.body.turn == pytest.approx(turn.as_matrix())


def test_slings_and_deck_are_reported() -> None:
    encoder, snapshot = messages.Encoder(0), turned()

    def table(topic: str, snapshot: Snapshot) -> list[tuple[object, ...]]:
        computed = messages.read_cloud(messages.decode(topic, encoder.encode(topic, snapshot)))
        return [tuple(row) for row in computed.tolist()]

    assert table("slings/state", snapshot) == [
        (b"sling_1", 1.0, 2.0, -3.0, 6.0, 5e4),
        (b"sling_2", 4.0, 5.0, -6.0, 5.9, 0.0),
    ]
    assert table("payloads/body", snapshot) == [(b"payload", 4.0, 3.0, 2.0, -0.002, 1e3)]
    assert snapshot.body is not None
    ashore = replace(
        snapshot, body=replace(snapshot.body, deck_reaction_n=None, deck_clearance_m=None)
    )
    ((*_, clearance_m, reaction_n),) = table("payloads/body", ashore)
    assert np.isnan([clearance_m, reaction_n]).all()
    with pytest.raises(InputError, match="no rigid body; list the effect `rigid_body`"):
        encoder.encode("slings/state", hanging_rope())


def test_a_body_is_drawn_as_a_turned_box_on_its_slings() -> None:
    """No smaller than the symbol of a point, with the body's own proportions."""
    for length, longest in ((200.0, 4.0), (3000.0, 30.0)):
        snapshot = replace(turned(), line_out_m=length)
        reported = messages.decode(
            "ropes/markers", messages.Encoder(0).encode("ropes/markers", snapshot)
        )
        drawn = {marker.ns: marker for marker in reported.markers}
        box, slings = drawn["payload"], drawn["slings"]
        assert snapshot.body is not None
        q = box.pose.orientation
        assert [q.x, q.y, q.z, q.w] == pytest.approx(snapshot.body.quaternion)
        assert [box.scale.x, box.scale.y, box.scale.z] == pytest.approx(
            longest / 4.0 * np.array([4.0, 3.0, 2.0])
        )
        ends = np.array([[p.x, p.y, p.z] for p in slings.points])
        assert ends[::2] == pytest.approx(np.tile(snapshot.node_position_m[-1], (2, 1)))
        assert ends[1::2] == pytest.approx(snapshot.body.leg_end_m)
