"""Two lines side by side: distance and crossings against geometry, and a run of the small loop."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from sample_snapshot import hanging_rope

from rope_twin import Snapshot, load_scene, messages
from rope_twin.cli import main
from rope_twin.errors import InputError
from rope_twin.files import share_dir
from rope_twin.recording.bag import BagReader
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import run_unpaced
from rope_twin.scene.schema import Scene
from rope_twin.topics import due_topics
from rope_twin.twin.multi_line_snapshot import (
    ClearanceMonitor,
    ClearanceReport,
    lines_of,
    report_on,
)
from rope_twin.twin.snapshot import Crossing, LineEvent, LinesSnapshot, Nearest

DEPTH = 1000.0


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("two_line_loop")


def seen(time_s: float, lean: float, *, aside: float = 0.0, wave: float = 0.0) -> Snapshot:
    """Both lines in two straight parts each; the main one leans over by `lean` at mid-depth.

    Hang-offs at x = -8 and 8; aside: y of the main line at mid-depth; wave: x that both have more
    of there. The sheave is in the middle below them.
    """

    def part(*points: tuple[float, float, float]) -> Any:
        path = [np.linspace(a, b, 24) for a, b in pairwise(points)]
        return SimpleNamespace(node_position_m=np.concatenate(path))

    half, bottom = -0.5 * DEPTH, (0.0, 0.0, -DEPTH)
    main_mid, other_mid = (lean + wave, aside, half), (4.0 + wave, 0.0, half)
    ropes = [
        part((-8.0, 0.0, 0.0), main_mid), part(main_mid, bottom),
        part((8.0, 0.0, 0.0), other_mid), part(other_mid, bottom),
    ]  # fmt: skip
    sheave = SimpleNamespace(position_m=np.array(bottom))
    return cast(Snapshot, SimpleNamespace(ropes=ropes, sheaves=[sheave], time_s=time_s))


def test_each_line_goes_from_its_winch_to_the_sheave(scene: Scene) -> None:
    """By number, main first."""
    assert lines_of(scene) == ([0, 1], [2, 3])


def test_lines_that_cross_are_reported_where_and_at_which_angle(scene: Scene) -> None:
    """The upper halves meet where x = -8 + (lean + 8)·s and 8 - 4·s agree: s = 16/(lean + 12)."""
    watch = ClearanceMonitor(scene)
    near, happened = watch.observe(seen(0.0, -4.0))
    assert happened == []
    assert near.distance_m == pytest.approx(8.0 * 0.04, rel=0.1), "near the sheave"
    lean, half = 20.0, 0.5 * DEPTH
    _, (event,) = watch.observe(seen(1.0, lean, wave=0.0))
    share = 16.0 / (lean + 12.0)
    assert (event.what, event.time_s) == ("cross", 1.0)
    assert event.depth_m == pytest.approx(share * half, abs=1e-6)
    angle = math.atan((lean + 8.0) / half) + math.atan(4.0 / half)
    assert event.angle_deg == pytest.approx(math.degrees(angle), rel=1e-6)
    assert event.gap_m == 0.0
    (crossing,) = watch.crossings
    assert crossing.position_m == pytest.approx((8.0 - 4.0 * share, 0.0, -share * half), abs=1e-9)
    assert watch.observe(seen(2.0, lean + 0.5))[1] == [], "it has moved by less than 5 %"
    _, (gone,) = watch.observe(seen(3.0, -4.0))
    assert gone.what == "part"
    assert watch.crossings == ()


def test_lines_that_pass_each_other_at_a_distance_say_so(scene: Scene) -> None:
    """The main line is 6 m aside at mid-depth, so 6·s where they cross."""
    watch = ClearanceMonitor(scene)
    near, (event,) = watch.observe(seen(0.0, 20.0, aside=6.0))
    assert event.gap_m == pytest.approx(6.0 * 0.5, rel=1e-6)
    assert near.distance_m < 3.0


def test_a_line_that_turns_up_again_is_counted(scene: Scene) -> None:
    """A loop of slack rope."""
    watch, snapshot = ClearanceMonitor(scene), seen(0.0, -4.0)
    snapshot.ropes[0].node_position_m[10, 2] = -300.0
    watch.observe(snapshot)
    assert watch.turned_up == 1


def test_what_has_no_two_lines_is_refused(scene: Scene) -> None:
    """In one sentence."""
    with pytest.raises(InputError, match="has 0 sheaves; give a scene with one, such as two_line"):
        lines_of(load_scene("two_line_lift"))
    together = replace(scene.hang_offs[0], at_m=scene.ship.hang_off_m)
    with pytest.raises(InputError, match="both are at one place; set `at_m` of one of them aside"):
        ClearanceMonitor(replace(scene, hang_offs=(together,)))


def at(snapshot: Snapshot, step: int, time_s: float) -> Snapshot:
    """The lines of a snapshot in one of a whole twin."""
    return replace(
        hanging_rope(time_s=time_s),
        step=step,
        ropes=tuple(snapshot.ropes),
        sheaves=tuple(snapshot.sheaves),
    )


def test_a_running_twin_reports_once_a_second_and_goes_on_after_a_restart(scene: Scene) -> None:
    """The first look is after the first step; what was reported is not reported again."""
    report = report_on(scene)
    assert report is not None
    assert report_on(load_scene("two_line_lift")) is None
    apart, crossed = seen(0.0, -4.0), seen(0.0, 20.0)
    begin = report.complete(at(crossed, 0, 0.0))
    assert begin.lines is None
    assert begin.line_events == ()
    first = report.complete(at(crossed, 1, 0.02))
    (event,) = first.line_events
    assert event.what == "cross"
    assert first.lines is not None
    assert first.lines.crossings[0].depth_m == event.depth_m
    again = report.complete(at(apart, 2, 0.04))
    assert again.line_events == ()
    assert again.lines == first.lines, "looked at once a second"
    other = ClearanceReport(ClearanceMonitor(scene))
    other.restore(json.loads(json.dumps(report.state())))
    for one in (report, other):
        later = one.complete(at(crossed, 3, 1.0))
        assert later.line_events == ()
        (gone,) = one.complete(at(apart, 4, 2.0)).line_events
        assert gone.what == "part"
        assert gone.words().startswith("the lines part again at ")


def test_crossings_are_reported_in_topics() -> None:
    """Depth, angle and gap by name; events in words when there are any, and only then."""
    near = Nearest(2.0, 900.0, 0.5)
    crossing = Crossing(depth_m=836.0, angle_deg=0.08, gap_m=0.02, position_m=(3.0, 4.0, -836.0))
    event = LineEvent(121.4, "cross", 836.0, 0.08, 0.02)
    snapshot = replace(hanging_rope(), lines=LinesSnapshot(near, (crossing,)), line_events=(event,))
    assert {"lines/crossings", "lines/events"} <= set(due_topics(10, 20_000_000, snapshot))
    assert "lines/events" not in due_topics(10, 20_000_000, replace(snapshot, line_events=()))
    encoder = messages.Encoder(0)
    reported = messages.decode("lines/crossings", encoder.encode("lines/crossings", snapshot))
    rows = messages.read_cloud(reported)
    assert rows[0][["name", "z", "distance_m"]].tolist() == (b"nearest", -900.0, 0.5)
    assert rows[1].tolist() == (b"crossing_1", 3.0, 4.0, -836.0, 0.02, 0.08)
    words = messages.decode("lines/events", encoder.encode("lines/events", snapshot)).data
    assert words == "121.4 s: the lines cross at 836 m, 0.08 degrees, 0.02 m apart"


def test_a_recorded_run_of_the_loop_has_its_crossings(tmp_path: Path) -> None:
    """The bag holds each event once, and the crossings five times a second from then on."""
    text = (share_dir() / "config" / "scenes" / "two_line_loop.yaml").read_text()
    assert "upper: [0.4, 0.0]" in text
    (tmp_path / "loop.yaml").write_text(text.replace("upper: [0.4", "upper: [0.8"))
    run_unpaced(
        RunOptions(
            scene=str(tmp_path / "loop.yaml"), speed=0.0, end_s=1.5, record=tmp_path / "bag"
        ),
        lambda run: None,
    )
    with BagReader(tmp_path / "bag") as bag:
        events = [messages.decode("lines/events", m).data for _, m in bag.messages("/lines/events")]
        rows = [messages.decode("lines/crossings", m)
                for _, m in bag.messages("/lines/crossings")]  # fmt: skip
    assert len(events) == 1
    assert events[0].startswith("0.0 s: the lines cross at ")
    assert len(rows) == 7
    assert b"crossing_1" in messages.read_cloud(rows[-1])["name"]


def test_a_loop_runs_calm_and_in_a_sea(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Forty seconds each: smooth when calm, tensions swing in the sea, crossings with depths."""
    assert main(["lines", "two_line_loop", "--duration", "40", "--out", str(tmp_path)]) == 0
    reported = capsys.readouterr()
    found = json.loads((tmp_path / "two_lines.json").read_text())
    assert (tmp_path / "two_lines.png").stat().st_size > 10_000
    assert "main" in reported.out
    assert "the lines cross at" in reported.err
    calm, rough = found["calm"], found["in_sea_state"]
    assert max(noise["jump_pct"] for noise in calm["noise"]) < 0.01
    assert min(noise["events"] for noise in calm["noise"]) > 0
    for line in ("main", "haulback"):
        assert rough["tension_n"][line] != calm["tension_n"][line]
        assert rough["tension_n"][line]["max"] < 1.2 * calm["tension_n"][line]["mean"]
    event = calm["crossings"][0]
    assert 0.0 < event["depth_m"] < 1500.0
    assert event["gap_m"] < 0.1, "the current is in the plane of both hang-offs"
    assert 0.0 < event["angle_deg"] < 10.0


def test_too_short_a_run_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """Before anything is computed."""
    assert main(["lines", "two_line_loop", "--duration", "3"]) == 1
    assert (
        "3 s is not possible; give a whole number of seconds from 10 to 7200"
        in capsys.readouterr().err
    )
