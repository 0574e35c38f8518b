"""Replay of the ship's recorded poses: to the bit, from rest, around a seam; what is refused."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bag_samples import START_NS, STEP_NS, swell, write_heave
from scene_text import GOOD
from scipy.spatial.transform import Rotation

from rope_twin import Snapshot
from rope_twin.errors import BagError, InputError, SceneError
from rope_twin.messages import encode_elevation, encode_pose, templates
from rope_twin.messages.cdr import new, serialise
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.heave import PoseReplay, open_heave, open_poses
from rope_twin.recording.motion_source import FIRST_NS, open_sea
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import run_unpaced
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import RecordedPoses, Ship
from rope_twin.topics import BY_NAME, Qos, Topic
from rope_twin.twin.motion.ship_motion import ShipPose, hang_off_motion

ARM = (10.0, 18.0, 12.0)
SECOND = 1_000_000_000


def rolling(count: int = 1280, yaw_deg_per_s: float = 0.0) -> list[ShipPose]:
    """64 s of sway, heave, roll and pitch in 8 s, exact; and of a ship that turns evenly."""
    poses = []
    for k in range(count):
        t, omega = k * STEP_NS * 1e-9, math.tau / 8.0
        s, c = math.sin(omega * t), math.cos(omega * t)
        yaw, spin = math.radians(yaw_deg_per_s) * t, math.radians(yaw_deg_per_s)
        roll, rolls = 0.1 * s, 0.1 * omega * c
        pitch, pitches = 0.05 * c, -0.05 * omega * s
        turn = Rotation.from_euler("ZYX", [yaw, pitch, roll])
        rate = (
            rolls - math.sin(pitch) * spin,
            math.cos(roll) * pitches + math.cos(pitch) * math.sin(roll) * spin,
            math.cos(pitch) * math.cos(roll) * spin - math.sin(roll) * pitches,
        )
        velocity = turn.inv().apply([0.0, 0.5 * omega * c, -omega * s])
        place = (0.0, 0.5 * s, c)
        poses.append(ShipPose(k * STEP_NS, place, tuple(velocity), tuple(turn.as_quat()), rate))
    return poses


def write_poses(
    folder: Path, poses: Sequence[ShipPose], *, stamped: bool = False, name: str = "ship/odometry"
) -> Path:
    """A bag of the poses, as Odometry or as PoseStamped, with the water surface."""
    kind = "geometry_msgs/msg/PoseStamped" if stamped else "nav_msgs/msg/Odometry"
    topics = [Topic(name, kind, Qos.SENSOR, 20.0, "", ""), BY_NAME["sea/elevation"]]
    with BagWriter(folder, topics) as bag:
        for k, pose in enumerate(poses):
            at_ns = START_NS + pose.stamp_ns
            data = bare_pose(at_ns, pose) if stamped else encode_pose(at_ns, pose)
            bag.write(name, START_NS + k * STEP_NS, data)
            bag.write("sea/elevation", at_ns, encode_elevation(at_ns, math.sin(k)))
    return folder


def bare_pose(at_ns: int, pose: ShipPose) -> bytes:
    """A PoseStamped, which has no twist."""
    head = templates.header("sea")
    head.stamp = templates.time(at_ns)
    inner = new("geometry_msgs/msg/Pose")
    for field, values in (("position", pose.position_m), ("orientation", pose.orientation)):
        for axis, value in zip("xyzw", values, strict=False):
            setattr(getattr(inner, field), axis, value)
    return serialise(new("geometry_msgs/msg/PoseStamped", header=head, pose=inner))


def replay(folder: Path, recorded: RecordedPoses | None = None, **how: float) -> PoseReplay:
    """Return the motion of a bag for a hang-off at ARM."""
    scene = load_scene("still_water")
    ship = Ship(hang_off_m=ARM, reference_m=(0.0, 0.0, 0.0))
    recorded = recorded or RecordedPoses(bag=str(folder))
    return open_poses(replace(scene, ship=ship), recorded, **how)  # type: ignore[arg-type]


def test_poses_come_back_to_the_bit_lap_after_lap(tmp_path: Path) -> None:
    """Eight whole waves: no seam; the hang-off is where the arm says; the surface comes along."""
    poses = rolling()
    sea = replay(write_poses(tmp_path / "bag", poses))
    assert sea.note == ""
    assert sea.loop_ns == 64 * SECOND
    assert sea.topic == "ship/odometry"
    for lap in (0, 3):
        found = sea.between(lap * 64 * SECOND, (lap + 1) * 64 * SECOND)
        shifted = [replace(own, stamp_ns=own.stamp_ns + lap * 64 * SECOND) for own in poses]
        assert [one.pose for one in found] == shifted
        for one, pose in zip(found, shifted, strict=True):
            place, velocity = hang_off_motion(pose, ARM)
            assert (one.position_m, one.velocity_m_per_s) == (place[2], velocity[2])
            assert one.lateral == (*place[:2], *velocity[:2])
    assert found[5].elevation_m == pytest.approx(math.sin(5), abs=1e-9)
    assert not sea.is_over(10**15)


def scene_file(folder: Path, sea: str) -> str:
    """A small scene moved so."""
    path = folder / ("posed.yaml" if sea else "still.yaml")
    text = GOOD.replace("ship: {hang_off_m: [0.0, 0.0, 0.0],", "ship: {reference_m: [0, -18, -12],")
    text = text.replace("sea_state: {start_s: 10.0, loop: true}", sea)
    path.write_text(text.replace("  - weight: {}", "  - weight: {}\n  - added_mass: {normal: 1.0}"))
    return str(path)


def test_a_run_with_its_own_recorded_poses_is_the_same_run(tmp_path: Path) -> None:
    """A replay of a recorded run is bit-identical: tension, rope and payload."""
    bag, again = write_poses(tmp_path / "bag", rolling()), tmp_path / "again"
    scene = scene_file(tmp_path, "sea_state: {poses: {bag: ./bag}}")
    runs: list[list[Snapshot]] = []
    for options in (
        RunOptions(scene=scene, speed=0.0, end_s=5.0, record=again),
        RunOptions(
            scene=scene_file(tmp_path, ""), speed=0.0, end_s=3.0, poses=str(again),
            sea_offset_s=-FIRST_NS * 1e-9,
        ),
    ):  # fmt: skip
        snapshots: list[Snapshot] = []
        run_unpaced(options, lambda run, snapshots=snapshots: snapshots.append(run.last))  # type: ignore[misc]
        runs.append(snapshots)
    for one, two in zip(*runs, strict=False):  # the end of the record fades into its beginning
        assert one.tension_top_n == two.tension_top_n
        assert (one.node_position_m == two.node_position_m).all()
        assert one.inputs["heave"].refused == two.inputs["heave"].refused == 0
    assert one.stamp_ns == 3 * SECOND
    assert abs(one.node_position_m[0, 1]) > 0.1, "the roll moves it aside"
    with pytest.raises(BagError, match=r"the ship's pose .*and no heave; replay it by --poses"):
        open_heave(bag)


def test_rates_that_are_not_recorded_are_derived_and_reported(tmp_path: Path) -> None:
    """A PoseStamped has none; central differences are off by ω³·dt²/6 of the amplitude."""
    poses = rolling()
    sea = replay(write_poses(tmp_path / "bare", poses, stamped=True))
    assert "it has no twist, velocity and rate of turn are derived" in sea.note
    found = [one.pose for one in sea.between(SECOND, 60 * SECOND)]
    for part, most in (("velocity_m_per_s", 3e-4), ("rate_rad_per_s", 5e-5)):
        reported = [getattr(pose, part) for pose in poses[20 : 20 + len(found)]]
        assert np.abs(np.array([getattr(p, part) for p in found]) - reported).max() < most
    still = (0.0, 0.0, 0.0)
    half = [replace(own, rate_rad_per_s=still) for own in poses]
    sea = replay(write_poses(tmp_path / "half", half))
    assert "twist.angular is zero throughout, it is derived" in sea.note
    assert sea.between(0, 1)[0].pose.velocity_m_per_s == poses[0].velocity_m_per_s  # type: ignore[union-attr]


def test_a_record_in_a_map_is_taken_from_its_rest(tmp_path: Path) -> None:
    """Poses about another place and heading move the hang-off as those about rest do."""
    poses, heading, rest = rolling(), 115.0, np.array([4321.0, -765.0, 3.0])
    ahead = Rotation.from_euler("Z", heading, degrees=True)
    moved = [
        replace(
            own,
            position_m=tuple(rest + own.position_m),
            orientation=tuple((Rotation.from_quat(own.orientation) * ahead).as_quat()),
            velocity_m_per_s=tuple(ahead.inv().apply(own.velocity_m_per_s)),
            rate_rad_per_s=tuple(ahead.inv().apply(own.rate_rad_per_s)),
        )
        for own in poses
    ]
    bag = write_poses(tmp_path / "map", moved)
    recorded = RecordedPoses(bag=str(bag), rest_m=tuple(rest), heading_deg=heading)
    here, there = replay(write_poses(tmp_path / "rest", poses)), replay(bag, recorded)
    assert here.note == there.note == ""
    for one, two in zip(here.between(0, 9 * SECOND), there.between(0, 9 * SECOND), strict=True):
        assert two.position_m == pytest.approx(one.position_m, abs=1e-9)
        assert two.velocity_m_per_s == pytest.approx(one.velocity_m_per_s, abs=1e-9)
        assert two.lateral == pytest.approx(one.lateral, abs=1e-9)
    note = replay(bag).note
    assert "it begins 4388 m and 115° from rest; give where it rests" in note


@pytest.mark.parametrize("yaw_deg_per_s", [0.0, 7.0])
def test_a_seam_is_blended_and_reported(tmp_path: Path, yaw_deg_per_s: float) -> None:
    """61.3 s: place and turn go on smoothly, and their rates are theirs; also after a circle."""
    sea = replay(write_poses(tmp_path / "cut", rolling(1226, yaw_deg_per_s)))
    assert "its end does not join its beginning, the last 10 s of each pass fade" in sea.note
    poses = [one.pose for one in sea.between(45 * SECOND, 75 * SECOND) if one.pose]
    turns = Rotation.from_quat([own.orientation for own in poses])
    rate = np.array([own.rate_rad_per_s for own in poses])
    seen = (turns[:-2].inv() * turns[2:]).as_rotvec() / (2 * STEP_NS * 1e-9)
    assert np.abs(seen - rate[1:-1]).max() < 3e-4
    assert np.abs(np.diff(rate, axis=0)).max() < 0.02
    place = np.array([own.position_m for own in poses])
    velocity = turns.apply([own.velocity_m_per_s for own in poses])
    jump = np.diff(place, axis=0) - 0.025 * (velocity[1:] + velocity[:-1])
    assert np.abs(jump).max() < 1e-4
    assert np.linalg.norm([own.orientation for own in poses], axis=1) == pytest.approx(1.0)


def test_few_bad_poses_are_skipped_counted_and_reported(tmp_path: Path) -> None:
    """Not finite, no unit quaternion, on its side, a stamp again and one that goes back; a gap."""
    poses = rolling()
    poses[100] = replace(poses[100], orientation=(float("nan"), 0.0, 0.0, 1.0))
    poses[101] = replace(poses[101], position_m=(0.0, float("inf"), 0.0))
    poses[150] = replace(poses[150], orientation=(0.0, 0.0, 0.0, 0.5))
    poses[151] = replace(poses[151], orientation=(0.7071, 0.0, 0.0, 0.7071))
    poses[200] = replace(poses[200], stamp_ns=poses[199].stamp_ns)
    poses[300] = replace(poses[300], stamp_ns=poses[290].stamp_ns)
    poses[600] = replace(poses[600], orientation=tuple(-q for q in poses[600].orientation))
    del poses[400:460]
    sea = replay(write_poses(tmp_path / "few", poses))
    reported = (
        "2 not finite, 1 with an orientation that is no unit quaternion, 1 that heel by more than "
        "60°, 1 with a repeated stamp, 1 with a stamp that goes back"
    )
    assert f"skipped 6 of 1220 samples ({reported})" in sea.note
    assert "gaps in time: 1, the longest 3.05 s at 19.950 s" in sea.note
    assert len(sea.between(0, 64 * SECOND)) == 1214


def spoilt(poses: list[ShipPose], **parts: object) -> list[ShipPose]:
    """The poses with the same wrong parts all."""
    return [replace(own, **parts) for own in poses]  # type: ignore[arg-type]


def backward(poses: list[ShipPose]) -> list[ShipPose]:
    """A clock that is set back by an hour in the middle."""
    return [replace(p, stamp_ns=p.stamp_ns - 3600 * SECOND * (k > 50)) for k, p in enumerate(poses)]


def against(poses: list[ShipPose]) -> list[ShipPose]:
    """Turned round."""
    return [replace(p, rate_rad_per_s=tuple(-w for w in p.rate_rad_per_s)) for p in poses]


NO_TURN = (0.0, 0.0, 0.0, 0.0)
BAD = {
    "no orientation": (lambda p: spoilt(p, orientation=NO_TURN),
                       "200 of 200 samples cannot be used (200 with an orientation that is no unit "
                       "quaternion)"),
    "not finite": (lambda p: spoilt(p, velocity_m_per_s=(0.0, math.nan, 0.0)), "(200 not finite)"),
    "time backward": (backward, "(149 with a stamp that goes back)"),
    "a jump in time": (lambda p: [*p[:50], *(replace(q, stamp_ns=q.stamp_ns + 99 * SECOND)
                                             for q in p[50:])], "the longest 99.05 s at 2.450 s"),
    "down is positive": (against, "twist.angular runs against the pose (correlation -1.00)"),
    "high up": (lambda p: spoilt(p, position_m=(0.0, 0.0, 80.0)),
                "the ship lies 80.0 m above its rest; give where it rests in the record"),
    "nothing": (lambda p: [], "it holds no message; odometry needs at least 2"),
    "one": (lambda p: p[:1], "0 of 1 samples cannot be used (too few)"),
}  # fmt: skip


@pytest.mark.parametrize("fault", BAD)
def test_a_bag_without_usable_poses_gets_one_sentence(tmp_path: Path, fault: str) -> None:
    """With the bag, the topic, what is wrong, and what would be right."""
    spoil, words = BAD[fault]
    folder = write_poses(tmp_path / "bad", spoil(rolling(200)))
    with pytest.raises(BagError) as caught:
        replay(folder)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"bag {folder}, topic /ship/odometry: ")
    assert "\n" not in str(caught.value)


def test_a_wrong_topic_and_a_wrong_start_are_answered(tmp_path: Path) -> None:
    """Other topics are named; heave is no pose unless it is named."""
    bag = write_poses(tmp_path / "bag", rolling(200), name="mru/pose", stamped=True)
    assert replay(bag).duration_s == 10.0
    for topic, words in (
        ("mru/pos", "did you mean '/mru/pose'"),
        ("sea/elevation", "must be a nav_msgs/msg/Odometry or geometry_msgs/msg/PoseStamped"),
    ):
        with pytest.raises(BagError, match=words):
            replay(bag, RecordedPoses(bag=str(bag), topic=topic))
    with pytest.raises(BagError, match="right is 0 to less than 10 s"):
        replay(bag, start_s=10.0)
    lift = load_scene("still_water")
    with pytest.raises(InputError, match="give heave or poses of the ship, not both"):
        open_sea(lift, "sea_2p5m", poses=str(bag))
    heave = write_heave(tmp_path / "heave", swell(1280))
    assert open_sea(lift, str(heave)).source  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("sea", "words"),
    [
        ("{poses: {bag: sea_2p5}}", "sea_state.poses.bag: there is no bag 'sea_2p5' in bags/"),
        ("{poses: {bag: ./none}}", "sea_state.poses.bag: there is no bag at"),
        ("{poses: {bag: ''}}", "sea_state.poses.bag: it is empty; name a bag"),
        ("{poses: {bag: ./bag}, bag: sea_2p5m}", "recorded poses and another motion are given"),
        ("{poses: {bag: ./bag, rest_m: [0, 0]}}", "sea_state.poses.rest_m"),
        ("{poses: {bag: ./bag, heading_deg: 400}}", "-360 to 360 °"),
        ("{poses: ./bag}", "sea_state.poses"),
    ],
)
def test_a_scene_tells_what_is_wrong_with_its_poses(tmp_path: Path, sea: str, words: str) -> None:
    """At the key, in one sentence."""
    write_poses(tmp_path / "bag", rolling(20))
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file(tmp_path, f"sea_state: {sea}"))
    assert words in str(caught.value)
    assert str(caught.value).count("\n") == 0
