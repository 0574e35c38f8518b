"""The error of a convergence study is claimed only for the run that the study describes."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from study_samples import sample_study, studied_scene, write_study

from rope_twin.cli import main
from rope_twin.messages import Encoder, decode, read_cloud, statuses
from rope_twin.recording.motion_source import FIRST_NS, open_sea, submit
from rope_twin.recording.session import expect_own_sea
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.scene.winch import ScheduleRow, Winch
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import (
    EMERGENCY_STOP,
    RESET,
    ScheduleMonitor,
    WinchCommand,
    schedule_samples,
)
from rope_twin.twin.winch.winch import Winch as WinchModel

SECOND_NS = 1_000_000_000
SEA = "sea_state: {heave: {amplitude_m: 1.0, period_s: 8.0}}\n"


def variant_scene(folder: Path, old: str, new: str) -> Scene:
    """The sample scene with other words in its file, and a study of its own."""
    scene = studied_scene(folder)
    scene.path.write_text(scene.path.read_text("utf-8").replace(old, new), encoding="utf-8")
    scene = load_scene(scene.path)
    write_study(scene, sample_study(scene))
    return scene


def reason(twin: Twin) -> str:
    """Return the words on a snapshot's error, "unknown" first where it is NaN."""
    error = twin.snapshot().study_error
    assert math.isnan(error.rms_pct) == error.words.startswith("unknown")
    return error.words if math.isnan(error.rms_pct) else ""


def feed(twin: Twin, seconds: float) -> None:
    """Give the twin the scene's own sea and schedule, as a runner does."""
    until_ns = round(seconds * SECOND_NS)
    sea = open_sea(twin.scene)
    for sample in sea.between(FIRST_NS, until_ns) if sea else ():
        assert submit(twin, sample) == ""
    for command in schedule_samples(twin.scene.winch, 0, until_ns):
        assert twin.submit_command(command.stamp_ns, command.command) == ""


def test_a_speed_that_is_not_in_the_schedule_ends_the_claim() -> None:
    """The shipped scene, driven by hand as in the issue; diagnostics and topic say so too."""
    twin = Twin(load_scene("still_water"))
    twin.advance(100)
    assert reason(twin) == ""
    twin.submit_speed(None, 0.5)
    twin.advance(2)
    assert reason(twin) == (
        "unknown: winch commands differ from the scene's schedule from 1.00 s on"
    )
    twin.submit_speed(None, 0.0)
    twin.advance(500)
    taken = twin.snapshot()
    assert math.isnan(taken.study_error.rms_pct), "the state is another one from then on"
    topic = "ropes/tension_top_error"
    (error,) = read_cloud(decode(topic, Encoder(0).encode(topic, taken)))
    assert math.isnan(error["rms_pct"])
    row = next(one for one in statuses(taken, None) if one.name == "simulation: accuracy")
    assert "winch commands differ" in row.message


def test_an_order_that_the_schedule_has_changes_nothing() -> None:
    twin = Twin(load_scene("still_water"))
    twin.submit_speed(None, 0.0)
    twin.advance(100)
    assert reason(twin) == ""


def test_the_claim_ends_with_the_seconds_of_the_study(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = studied_scene(tmp_path)
    write_study(scene, sample_study(scene) | {"seconds": 0.2})
    words = ["run", str(scene.path), "--speed", "0", "--no-record", "--json", "--duration"]
    assert main([*words, "0.2"]) == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported["tension_top_error_pct"] > 0.0
    assert reported["tension_top_error_reason"] == "at most, in the study's run of 0.2 s"
    assert main([*words, "0.22"]) == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported["tension_top_error_pct"] is reported["tension_top_peak_error_pct"] is None
    assert reported["tension_top_error_reason"] == "unknown: the study's run ended at 0.2 s"
    assert main([*(one for one in words if one != "--json"), "0.22"]) == 0
    text = capsys.readouterr().out
    assert "top-tension error unknown: the study's run ended at 0.2 s" in text


def test_a_shipped_scene_beyond_its_study(capsys: pytest.CaptureFixture[str]) -> None:
    """manifold_lift has a study of 30 s."""
    words = ["run", "manifold_lift", "--speed", "0", "--no-record", "--json", "--duration"]
    assert main([*words, "1"]) == 0
    assert json.loads(capsys.readouterr().out)["tension_top_error_pct"] > 0.0
    assert main([*words, "31"]) == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported["tension_top_error_pct"] is None
    assert reported["tension_top_error_reason"] == "unknown: the study's run ended at 30 s"


def test_a_schedule_must_be_heard(tmp_path: Path) -> None:
    row = "winch:\n  schedule: [{at_s: 0.1, speed_m_per_s: 0.2}]\n"
    scene = variant_scene(tmp_path, "winch:\n", row)
    fed = Twin(scene)
    feed(fed, 2.0)
    deaf = Twin(scene)
    for twin in (fed, deaf):
        for _ in range(25):
            twin.advance(2)
            twin.snapshot()
    assert reason(fed) == ""
    assert reason(deaf).startswith("unknown: winch commands differ from the scene's schedule")


def test_motion_is_compared_with_the_scenes_own_sea(tmp_path: Path) -> None:
    scene = variant_scene(tmp_path, "effects:", f"{SEA}effects:")
    fed, compared, other, deaf, unknown = (Twin(scene) for _ in range(5))
    fed.inputs.expect_motion(None)
    for twin in (compared, other, deaf):
        expect_own_sea(twin)
    sea = open_sea(scene)
    assert sea is not None
    for sample in sea.between(FIRST_NS, 3 * SECOND_NS):
        for twin in (fed, compared, unknown):
            assert submit(twin, sample) == ""
        taller = 1.01 if sample.stamp_ns > SECOND_NS else 1.0
        assert (
            other.submit_heave(sample.stamp_ns, taller * sample.position_m, sample.velocity_m_per_s)
            == ""
        )
    for twin in (fed, compared, other, deaf, unknown):
        twin.advance(98)
        twin.snapshot()
    assert reason(fed) == reason(compared) == reason(other) == ""
    assert reason(deaf) == "unknown: samples of the scene's sea are missing at 0.98 s"
    assert reason(unknown) == (
        "unknown: the ship's motion was not compared with the scene's own sea"
    )
    for twin in (fed, compared, other):
        twin.advance(50)
    assert reason(fed) == reason(compared) == ""
    assert reason(other) == ("unknown: the ship's motion is not the scene's own sea from 1.00 s on")


@pytest.mark.parametrize("posed", [False, True])
def test_a_ship_that_lies_still_may_say_so_and_no_more(tmp_path: Path, posed: bool) -> None:
    def tell(twin: Twin, stamp_ns: int, up: float) -> str:
        if posed:
            return twin.submit_pose(ShipPose(stamp_ns, (0.0, 0.0, up), (0.0, 0.0, 0.0)))
        return twin.submit_heave(stamp_ns, up, 0.0)

    twin = Twin(studied_scene(tmp_path))
    for number in range(10):
        assert tell(twin, number * 50_000_000, 0.0) == ""
    twin.advance(40)
    assert reason(twin) == ""
    assert tell(twin, 500_000_000, 0.02) == ""
    twin.advance(5)
    assert reason(twin) == "", "until 0.45 s the ship lay still"
    twin.advance(1)
    assert reason(twin) == "unknown: the ship's motion is not the scene's own sea from 0.45 s on"


def test_a_current_and_a_cut_end_the_claim(tmp_path: Path) -> None:
    listed = "effects:\n  - current: {profile: [[0.0, [0.1, 0.0]], [-100.0, [0.1, 0.0]]]}\n"
    scene = variant_scene(tmp_path, "effects:\n", listed)
    streamed, cut = Twin(scene), Twin(scene)
    assert reason(streamed) == ""
    assert streamed.submit_current([[0.0, 0.3, 0.0], [-50.0, 0.0, 0.0]]) == ""
    assert cut.submit_cut(None, math.inf) == ""
    for twin in (streamed, cut):
        twin.advance(2)
    assert reason(streamed) == "unknown: a current profile came from elsewhere at 0.00 s"
    assert reason(cut) == "unknown: the rope was cut"


def test_doubt_survives_a_restart(tmp_path: Path) -> None:
    """And a run that goes on undoubted is as before; another schedule makes another run."""
    scene = studied_scene(tmp_path)
    sound, driven = Twin(scene), Twin(scene)
    driven.submit_speed(None, 0.3)
    for twin in (sound, driven):
        twin.advance(20)
        twin.snapshot()
        twin.save(tmp_path / "state")
        back = Twin.restore(tmp_path / "state", scene)
        for one in (twin, back):
            one.advance(20)
        assert reason(back) == reason(twin)
    assert reason(sound) == ""
    sound.save(tmp_path / "state")
    row = "winch:\n  schedule: [{at_s: 5.0, speed_m_per_s: 0.2}]\n"
    other = Twin.restore(tmp_path / "state", variant_scene(tmp_path, "winch:\n", row))
    assert reason(other) == "unknown: it resumes from a run with another schedule or sea"


def winch_scene(*rows: tuple[float, float | str], repeat_s: float | None = None) -> Winch:
    """A winch with an emergency stop and these rows: a time and a speed, or a switch."""
    base = load_scene("emergency_stop").winch
    assert base is not None
    schedule = tuple(
        ScheduleRow(at_s=at_s, switch=what)
        if isinstance(what, str)
        else ScheduleRow(at_s=at_s, speed_m_per_s=what)
        for at_s, what in rows
    )
    parts = {"schedule": schedule, "schedule_repeats_every_s": repeat_s, "drive": None}
    reported = {name: getattr(base, name) for name in vars(base)}
    return Winch(**reported | parts | {"brake": None, "drum": None})


def differs_s(winch: Winch, kept: list[tuple[int, WinchCommand]], seconds: float) -> float | None:
    """When a winch that takes these orders first differs from its schedule."""
    model = WinchModel(winch, 500.0)
    waiting = sorted(kept, key=lambda one: one[0])
    for step in range(round(seconds * 100)):
        while waiting and waiting[0][0] <= step * 10_000_000 + SECOND_NS:
            model.take(*waiting.pop(0), step * 10_000_000)
        model.step(step * 10_000_000, 0.01)
        if step % 2:
            snapshot = model.snapshot()
            assert snapshot is not None
            if snapshot.off_schedule_s is not None:
                return snapshot.off_schedule_s
    return None


def test_switches_of_the_schedule_are_part_of_it() -> None:
    winch = winch_scene((0.0, 0.2), (1.003, EMERGENCY_STOP), (3.0, RESET), repeat_s=5.0)
    orders = [(one.stamp_ns, one.command) for one in schedule_samples(winch, 0, 13 * SECOND_NS)]
    assert differs_s(winch, orders, 12.0) is None
    for missing in (EMERGENCY_STOP, RESET):
        left = [one for one in orders if one[1].kind != missing]
        late = differs_s(winch, left, 12.0)
        assert late == pytest.approx({EMERGENCY_STOP: 1.25, RESET: 3.25}[missing], abs=0.15)
    more = [*orders, (2 * SECOND_NS, WinchCommand(RESET))]
    assert differs_s(winch, more, 12.0) == pytest.approx(2.0)
    faster = [*orders, (SECOND_NS // 2 + 10_000_000, WinchCommand(SPEED, 0.3))]
    assert differs_s(winch, faster, 12.0) == pytest.approx(0.51)


def test_the_scenes_own_schedule_never_differs() -> None:
    """Check every shipped winch, over two rounds."""
    watch = ScheduleMonitor(None)
    watch.observe(SECOND_NS, WinchCommand(SPEED, 0.0), False)
    assert watch.differs_s is None
    for name in ("deep_lift", "emergency_stop", "two_line_lift", "landing"):
        winch = load_scene(name).winch
        assert winch is not None
        orders = [(s.stamp_ns, s.command) for s in schedule_samples(winch, 0, 200 * SECOND_NS)]
        kinds = {one.kind for _, one in orders}
        if kinds <= {SPEED, EMERGENCY_STOP, RESET, "length"}:
            assert differs_s(winch, orders, 180.0) is None, name
