"""What a user reads who gives a wrong table, or a pose that no ship has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from rope_twin.errors import InputError, SceneError
from rope_twin.messages import encode_pose
from rope_twin.ros.inputs import read_pose
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Ship
from rope_twin.sea.responses import COLUMNS, read_responses
from rope_twin.sea.way import read_way
from rope_twin.share import share_dir
from rope_twin.twin.motion.hang_off import HangOffTrack
from rope_twin.twin.motion.ship_pose import ShipPose

HEAD = "t_s,x_m,y_m,z_m\n"
WAYS = {
    "missing column": ("t_s,x_m,y_m\n0,0,0\n", "no column z_m; the head must name t_s, x_m"),
    "no rows": (HEAD, "it has a head and no rows"),
    "not a number": (HEAD + "0,0,0,0\n1,a,0,0\n", "line 3: could not convert string to float: 'a'"),
    "not finite": (HEAD + "0,0,0,0\n1,nan,0,0\n", "line 3: a value that is not finite"),
    "too few values": (HEAD + "0,0,0,0\n1,0,0\n", "line 3: 3 values; the head names 4"),
    "later start": (HEAD + "1,0,0,0\n2,0,0,0\n", "it begins at t = 1 s"),
    "one row": (HEAD + "0,0,0,0\n", "it has one row"),
    "times that fall": (HEAD + "0,0,0,0\n2,0,0,0\n1,0,0,0\n", "1 s follows 2 s; t_s must rise"),
    "a jump": (HEAD + "0,0,0,0\n1,0,0,0\n2,40,0,0\n", "jumps by 40.0 m from 1 s to 2 s"),
    "a wild spline": (HEAD + "0,0,0,0\n1,14,0,0\n2,0,0,0\n3,14,0,0\n", "spline through it reaches"),
}


@pytest.mark.parametrize("fault", WAYS)
def test_a_wrong_way_is_refused(tmp_path: Path, fault: str) -> None:
    """One sentence, with the file and what would be right."""
    text, words = WAYS[fault]
    path = tmp_path / "way.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_way(str(path))
    assert words in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_scene_tells_where_its_table_is_wrong(tmp_path: Path) -> None:
    """The fault of a table beside the scene is told at the key that names it."""
    text = (share_dir() / "config" / "scenes" / "deep_tow_turn.yaml").read_text()
    scene = tmp_path / "tow.yaml"
    scene.write_text(text.replace("{path: deep_tow_turn}", "{path: ./way.csv}"))
    with pytest.raises(SceneError, match=r"sea_state\.path: .*there is no such file"):
        load_scene(scene)
    (tmp_path / "way.csv").write_text(HEAD + "0,0,0,0\n9,1,0,0\n")
    assert load_scene(scene).sea_state.path == str(tmp_path / "way.csv")


def rows() -> list[str]:
    """A table of responses: two headings, two frequencies."""
    numbers = ",".join(["0.5"] * 12)
    return [f"{heading},{f},{numbers}" for heading in (0, 180) for f in (0.05, 0.5)]


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda head, lines: (head.replace("pitch_phase_deg", "pitch"), lines),
         "there is no column pitch_phase_deg"),
        (lambda head, lines: (head, lines[:-1]), "3 rows of 2 headings and 2 frequencies"),
        (lambda head, lines: (head, [*lines[:-1], lines[0]]), "4 rows of 2 headings"),
        (lambda head, lines: (head, lines[:2]), "headings from 0° to 0°"),
        (lambda head, lines: (head, [lines[0].replace("0.5", "-0.5", 1), *lines[1:]]),
         "surge_m_per_m is negative"),
    ],
    ids=["missing column", "missing row", "row twice", "one heading", "negative"],
)  # fmt: skip
def test_wrong_responses_are_refused(tmp_path: Path, spoil, words: str) -> None:  # type: ignore[no-untyped-def]
    """One sentence each; a sound table is read."""
    path = tmp_path / "ship.csv"
    path.write_text("\n".join([",".join(COLUMNS), *rows()]))
    read_responses(str(path))
    head, lines = spoil(",".join(COLUMNS), rows())
    path.write_text("\n".join([head, *lines]))
    with pytest.raises(InputError) as caught:
        read_responses(str(path))
    assert words in str(caught.value)


STILL = (0.0, 0.0, 0.0)
GOOD = ShipPose(50_000_000, (0.1, 0.2, 0.3), STILL, (0.0, 0.0, 0.0, 1.0), (0.0, 0.1, 0.0))
POSES = {
    "not finite": (replace(GOOD, position_m=(float("nan"), 0.0, 0.0)), "must be finite"),
    "no unit quaternion": (replace(GOOD, orientation=(0.0, 0.0, 0.0, 0.0)), "length 0"),
    "capsized": (replace(GOOD, orientation=(1.0, 0.0, 0.0, 0.0)), "heels by 180°"),
    "spinning": (replace(GOOD, rate_rad_per_s=(0.0, 0.0, 9.0)), "turns at 9.00 rad/s"),
    "flying": (replace(GOOD, position_m=(0.0, 0.0, 99.0)), "stays within ±30 m"),
    "jumping": (replace(GOOD, position_m=(50.0, 0.0, 0.0)), "jumps by 50.00 m"),
    "the same again": (replace(GOOD, stamp_ns=0), "came twice"),
}


@pytest.mark.parametrize("fault", POSES)
def test_a_pose_of_no_ship_is_refused_and_counted(fault: str) -> None:
    """As of heave: one sentence, counted; the next good one is taken."""
    track = HangOffTrack(load_scene("still_water"))
    assert track.offer_pose(replace(GOOD, stamp_ns=0, position_m=STILL)) == ""
    pose, words = POSES[fault]
    assert words in track.offer_pose(pose)
    health = track.counter.health(0, False)
    assert (health.accepted, health.refused) == (1, 1)
    assert health.non_finite == (1 if fault == "not finite" else 0)
    assert track.offer_pose(GOOD) == ""


def test_heave_and_pose_do_not_mix() -> None:
    """Whichever comes first moves the hang-off."""
    scene = load_scene("still_water")
    posed, heaving = HangOffTrack(scene), HangOffTrack(scene)
    assert posed.offer_pose(GOOD) == ""
    assert "only one of ship/heave and ship/odometry" in posed.offer(100_000_000, 0.0, 0.0)
    assert heaving.offer(0, 0.0, 0.0) == ""
    assert "heave moves the hang-off already" in heaving.offer_pose(GOOD)


def test_a_pose_comes_back_from_its_message() -> None:
    """Every number to the bit, the stamp apart; and the arm is the scene's."""
    pose = replace(GOOD, stamp_ns=0, velocity_m_per_s=(0.4, 0.5, 0.6))
    assert read_pose(encode_pose(1_700_000_000_123_456_789, pose)) == (
        1_700_000_000_123_456_789,
        pose,
    )
    scene = replace(load_scene("still_water"), ship=Ship(reference_m=(0.0, -18.0, 0.0)))
    track = HangOffTrack(scene)
    heeled = replace(GOOD, position_m=STILL, orientation=(0.6, 0.0, 0.0, 0.8), rate_rad_per_s=STILL)
    heeled = replace(heeled, orientation=(0.28, 0.0, 0.0, 0.96))  # sin of the angle 0.5376
    assert track.offer_pose(heeled) == ""
    assert track.at(50_000_000)[0] == pytest.approx(18.0 * 0.5376, abs=1e-9)
