"""Tables of prescribed motion and RAOs, and poses: invalid ones, and RAOs beyond the table."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.errors import InputError, SceneError
from rope_twin.files import share_dir
from rope_twin.messages import encode_pose
from rope_twin.messages.inputs import read_pose
from rope_twin.recording.motion_source import open_sea
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import Ship
from rope_twin.sea.rao_files import COLUMNS, read_responses
from rope_twin.sea.raos import Responses
from rope_twin.sea.ship_motion import read_time_history
from rope_twin.sea.spectrum import DEEP, irregular_waves, jonswap
from rope_twin.twin.motion.hang_off import HangOffTrack
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.twin import Twin

HEAD = "t_s,x_m,y_m,z_m\n"
WAYS = {
    "missing column": ("t_s,x_m,y_m\n0,0,0\n", "no column z_m; the header must name t_s, x_m"),
    "no rows": (HEAD, "it has a header and no rows"),
    "not a number": (HEAD + "0,0,0,0\n1,a,0,0\n", "line 3: 'a'; give a finite"),
    "not finite": (HEAD + "0,0,0,0\n1,nan,0,0\n", "line 3: 'nan'; give a finite"),
    "too few values": (HEAD + "0,0,0,0\n1,0,0\n", "line 3: 3 values; the header names 4"),
    "later start": (HEAD + "1,0,0,0\n2,0,0,0\n", "it begins at t = 1 s"),
    "one row": (HEAD + "0,0,0,0\n", "it has one row"),
    "times that fall": (HEAD + "0,0,0,0\n2,0,0,0\n1,0,0,0\n", "1 s follows 2 s; t_s must ascend"),
    "a jump": (HEAD + "0,0,0,0\n1,0,0,0\n2,40,0,0\n", "jumps by 40.0 m from 1 s to 2 s"),
    "a wild spline": (HEAD + "0,0,0,0\n1,14,0,0\n2,0,0,0\n3,14,0,0\n", "spline through it reaches"),
}


@pytest.mark.parametrize("fault", WAYS)
def test_invalid_motion_tables_are_rejected(tmp_path: Path, fault: str) -> None:
    """One sentence, with the file and what would be right."""
    text, words = WAYS[fault]
    path = tmp_path / "way.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_time_history(str(path))
    assert words in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_table_fault_is_reported_at_the_scene_key(tmp_path: Path) -> None:
    """The fault of a table beside the scene is reported at the key that names it."""
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
        (lambda head, lines: (head, lines[:-1]), "3 rows of 2 heading_deg and 2 frequency_hz"),
        (lambda head, lines: (head, [*lines[:-1], lines[0]]), "4 rows of 2 heading_deg"),
        (lambda head, lines: (head, lines[:2]), "one value of heading_deg"),
        (lambda head, lines: (head, [lines[0].replace("0.5", "-0.5", 1), *lines[1:]]),
         "surge_m_per_m is negative"),
    ],
    ids=["missing column", "missing row", "row twice", "one heading", "negative"],
)  # fmt: skip
def test_invalid_rao_tables_are_rejected(tmp_path: Path, spoil, words: str) -> None:  # type: ignore[no-untyped-def]
    """One sentence each; a sound table is read."""
    path = tmp_path / "ship.csv"
    path.write_text("\n".join([",".join(COLUMNS), *rows()]))
    read_responses(str(path))
    head, lines = spoil(",".join(COLUMNS), rows())
    path.write_text("\n".join([head, *lines]))
    with pytest.raises(InputError) as caught:
        read_responses(str(path))
    assert words in str(caught.value)


def heaving(folder: Path, lowest_hz: float, max_hz: float) -> Responses:
    """A ship whose heave is that of the water, a quarter late, between two frequencies."""
    one = ",".join("1" if name == "heave_m_per_m" else "0" for name in COLUMNS[2:8])
    late = ",".join("-90" if name == "heave_phase_deg" else "0" for name in COLUMNS[8:])
    lines = [f"{heading},{f},{one},{late}" for heading in (0, 180) for f in (lowest_hz, max_hz)]
    path = folder / "heaving.csv"
    path.write_text("\n".join([",".join(COLUMNS), *lines]))
    return read_responses(str(path))


def test_raos_beyond_the_table_hold_below_and_fade_above(tmp_path: Path) -> None:
    """Such a table is accepted, although it does not reach as far as the waves."""
    table = heaving(tmp_path, 0.05, 0.2)
    f = np.array([0.001, 0.05, 0.1, 0.2, 0.21, 0.22, 0.23, 0.24, 0.4])
    heave = table.at(f, np.zeros(len(f)))[2]
    left = [1.0, 1.0, 1.0, 1.0, 0.5 + 0.5**1.5, 0.5, 0.5 - 0.5**1.5, 0.0, 0.0]
    assert heave == pytest.approx(-1j * np.array(left), abs=1e-12)
    fine = np.linspace(0.19, 0.25, 601)
    faded = np.abs(table.at(fine, np.zeros(601))[2])
    assert (np.diff(faded) <= 0.0).all()
    assert np.abs(np.diff(faded, 2)).max() < 1e-4  # no corner


@pytest.mark.parametrize("cut_hz", [0.08, 0.1, 0.15, 0.25, 0.45])
def test_neglected_variance_is_the_integral_of_the_spectrum(tmp_path: Path, cut_hz: float) -> None:
    """∫ (1 - fade²)·S df / ∫ S df of Pierson and Moskowitz's S = A·f⁻⁵·exp(-1.25·(fp/f)⁴)."""
    fp = 0.1
    table = heaving(tmp_path, 0.001, cut_hz)
    waves = irregular_waves(jonswap(2.0, 1.0 / fp, 1.0), 4000, 7, DEEP, 9.80665)

    def density(f: float) -> float:
        return f**-5.0 * math.exp(-1.25 * (fp / f) ** 4)

    def lost(f: float) -> float:
        fade = 0.5 * (1.0 + math.cos(math.pi * min((f / cut_hz - 1.0) / 0.2, 1.0)))
        return (1.0 - fade**2) * density(f)

    end = 5.0 * fp  # of the spectrum
    integral = quad(lost, cut_hz, min(1.2 * cut_hz, end))[0]
    integral += quad(lost, 1.2 * cut_hz, end)[0] if 1.2 * cut_hz < end else 0.0
    expected = integral / quad(density, 0.4 * fp, end)[0]
    share = table.share_left_out(waves, 0.0, (0.0, 0.0, 0.0))
    # the outermost 0.1 % of the variance goes to the last component
    assert share == pytest.approx(expected, rel=0.01, abs=1e-3)
    moved = table.at(waves.omega / (2.0 * math.pi), waves.heading)[2] * waves.amplitude_m
    kept = float((np.abs(moved) ** 2).sum() / (waves.amplitude_m**2).sum())
    assert share == pytest.approx(1.0 - kept, abs=1e-12)


def test_neglected_variance_refers_to_the_hang_off(tmp_path: Path) -> None:
    """Roll moves what is far from the reference point, as seen from the turned bow."""
    zeros = ",".join(["0"] * 8)
    rolls = [(0.05, 0.0), (0.1, 0.0), (0.11, 2.0)]  # a ship that rolls at the table's end alone
    lines = [f"{heading},{f},0,0,0,{roll},{zeros}" for heading in (0, 180) for f, roll in rolls]
    path = tmp_path / "rolling.csv"
    path.write_text("\n".join([",".join(COLUMNS), *lines]))
    table = read_responses(str(path))
    waves = irregular_waves(jonswap(2.0, 10.0, 1.0), 200, 7, DEEP, 9.80665)
    assert table.share_left_out(waves, 0.0, (0.0, 0.0, 0.0)) == 0.0
    assert table.share_left_out(waves, 0.0, (30.0, 0.0, 0.0)) == 0.0
    share = table.share_left_out(waves, 0.0, (0.0, -18.0, 0.0))
    assert 0.5 < share < 1.0
    turned = table.share_left_out(replace(waves, heading=waves.heading + 0.5 * math.pi),
                                  0.5 * math.pi, (18.0, 0.0, 0.0))  # fmt: skip
    assert turned == pytest.approx(share)


def cut_table(folder: Path, lowest_hz: float, max_hz: float) -> Path:
    """ship_6dof with its vessel's table cut at both ends."""
    config = share_dir() / "config"
    kept = []
    for line in (config / "responses" / "vessel_120m.csv").read_text().splitlines():
        numbers = line.split(",")
        if line[0].isdigit() and not lowest_hz <= float(numbers[1]) <= max_hz:
            continue
        kept.append(line)
    (folder / "cut.csv").write_text("\n".join(kept))
    text = (config / "scenes" / "ship_6dof.yaml").read_text()
    assert "responses: vessel_120m" in text
    path = folder / "cut.yaml"
    path.write_text(text.replace("responses: vessel_120m", "responses: ./cut.csv"))
    return path


def test_a_truncated_rao_table_is_warned_of_above_one_per_cent(tmp_path: Path) -> None:
    """The warning has the share of the variance of the hang-off's motion."""
    whole = load_scene("ship_6dof")
    assert sense_checks(whole) == []
    assert sense_checks(load_scene(cut_table(tmp_path, 0.0, 0.3))) == []  # the ship is still there
    scene = load_scene(cut_table(tmp_path, 0.0, 0.13))
    (warning,) = sense_checks(scene)
    waves = scene.listed(WavesParams)
    assert waves is not None
    arm = tuple(a - b for a, b in zip(scene.ship.hang_off_m, scene.ship.reference_m, strict=True))
    riding = scene.sea_state.on_waves
    assert riding is not None
    share = read_responses(riding.responses).share_left_out(
        components_of(waves, 9.80665), math.radians(riding.heading_deg), arm
    )
    assert share > 0.01
    assert warning.startswith("sea_state.on_waves.responses: the table ends at 0.13 Hz, and RAOs ")
    assert f"fade to zero by 0.156 Hz: up to {100.0 * share:.2g} % of the variance of" in warning
    (warning,) = sense_checks(load_scene(cut_table(tmp_path, 0.11, 0.3)))
    assert "the table begins at 0.11 Hz, and" in warning
    sea = open_sea(scene)
    assert sea is not None
    twin = Twin(scene)
    for sample in sea.between(-100_000_000, 2_000_000_000):
        assert sample.pose is not None
        assert twin.submit_pose(sample.pose) == ""
    twin.advance(100)
    assert math.isfinite(twin.snapshot().tension_top_n)


STILL = (0.0, 0.0, 0.0)
GOOD = ShipPose(50_000_000, (0.1, 0.2, 0.3), STILL, (0.0, 0.0, 0.0, 1.0), (0.0, 0.1, 0.0))
POSES = {
    "not finite": (replace(GOOD, position_m=(float("nan"), 0.0, 0.0)), "must be finite"),
    "no unit quaternion": (replace(GOOD, orientation=(0.0, 0.0, 0.0, 0.0)), "length 0"),
    "capsized": (replace(GOOD, orientation=(1.0, 0.0, 0.0, 0.0)), "heels by 180°"),
    "spinning": (replace(GOOD, rate_rad_per_s=(0.0, 0.0, 9.0)), "turns at 9.00 rad/s"),
    "flying": (replace(GOOD, position_m=(0.0, 0.0, 99.0)), "stays within ±15 m"),
    "jumping": (replace(GOOD, position_m=(50.0, 0.0, 0.0)), "jumps by 50.00 m"),
    "the same again": (replace(GOOD, stamp_ns=0), "came twice"),
}


@pytest.mark.parametrize("fault", POSES)
def test_an_implausible_pose_is_rejected_and_counted(fault: str) -> None:
    """A bad pose gives one sentence and is counted, like heave; the next good one is accepted."""
    track = HangOffTrack(load_scene("still_water"))
    assert track.submit_pose(replace(GOOD, stamp_ns=0, position_m=STILL)) == ""
    pose, words = POSES[fault]
    assert words in track.submit_pose(pose)
    health = track.counter.health(0, False)
    assert (health.accepted, health.refused) == (1, 1)
    assert health.non_finite == (1 if fault == "not finite" else 0)
    assert track.submit_pose(GOOD) == ""


def test_heave_and_pose_do_not_mix() -> None:
    """Whichever comes first moves the hang-off."""
    scene = load_scene("still_water")
    posed, heaving = HangOffTrack(scene), HangOffTrack(scene)
    assert posed.submit_pose(GOOD) == ""
    assert "only one of ship/heave and ship/odometry" in posed.submit(100_000_000, 0.0, 0.0)
    assert heaving.submit(0, 0.0, 0.0) == ""
    assert "heave moves the hang-off already" in heaving.submit_pose(GOOD)


def test_a_pose_message_round_trip() -> None:
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
    assert track.submit_pose(heeled) == ""
    assert track.at(50_000_000)[0] == pytest.approx(18.0 * 0.5376, abs=1e-9)
